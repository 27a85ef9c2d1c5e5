//! A factor: a key of the scenario that varies, or a fault that is there or not, and the values that it takes. A
//! [`Setting`] is one of them.

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

/// The word for no fault.
const NO_FAULT: &str = "none";
/// Levels of a range on a grid, if the factor names none.
const LEVELS: usize = 5;
/// The most levels of a factor.
const MOST_LEVELS: usize = 10_000;

/// How the values of a range are spread.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Distribution {
    /// Evenly.
    #[default]
    Uniform,
    /// Evenly in the logarithm.
    LogUniform,
    /// By a normal distribution of `mean` and `deviation`, cut at the range where there is one.
    Normal,
}

/// What varies. Exactly one of `range`, `values` and `faults` is given; a normal distribution needs no range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Factor {
    /// The key of the scenario, as on the command line: `dynamics.slide_friction_n`, `faults.NAME.at_s`, `motion`.
    pub key: Option<String>,
    /// The name in results; the key when absent.
    pub name: Option<String>,
    /// Least and greatest value.
    pub range: Option<[Value; 2]>,
    /// How the values are spread.
    #[serde(default)]
    pub distribution: Distribution,
    /// Mean of a normal distribution.
    pub mean: Option<f64>,
    /// Standard deviation of a normal distribution.
    pub deviation: Option<f64>,
    /// Unit, for keys whose values have one in the scenario, such as "mm".
    pub unit: Option<String>,
    /// Points on a grid.
    pub levels: Option<usize>,
    /// The values themselves, of any type: numbers, names, whole tables.
    pub values: Option<Vec<Value>>,
    /// Whole faults, of which one at a time is added to those of the scenario, or "none".
    pub faults: Option<Vec<Value>>,
}

impl Factor {
    /// The name in results.
    pub fn name(&self) -> &str {
        let faults = self.faults.as_ref().map(|_| "fault");
        self.name.as_deref().or(self.key.as_deref()).or(faults).unwrap_or("?")
    }

    /// The unit of its numbers: the given one, or the one with which the key ends.
    pub fn unit(&self) -> &str {
        self.unit.as_deref().or_else(|| masseter_scenario::unit_of(self.key.as_deref()?)).unwrap_or_default()
    }

    /// Whether its values are numbers between two ends, as a search needs them.
    pub fn is_continuous(&self) -> bool {
        self.values.is_none() && self.faults.is_none()
    }

    /// The number of its levels on a grid.
    pub fn level_count(&self) -> usize {
        let listed = self.values.as_ref().or(self.faults.as_ref());
        listed.map_or_else(|| self.levels.unwrap_or(LEVELS.min(self.most_levels())), Vec::len)
    }

    /// A range of whole numbers has no more levels than numbers.
    fn most_levels(&self) -> usize {
        let [low, high] = self.ends();
        if self.is_whole() { (high - low) as usize + 1 } else { MOST_LEVELS }
    }

    /// The value at `u` of \[0, 1): that quantile of a range, or that share of a list.
    pub fn at(&self, u: f64) -> Setting {
        let of_list = |list: &[Value]| list[((u * list.len() as f64) as usize).min(list.len() - 1)].clone();
        if let Some(faults) = &self.faults {
            let chosen = of_list(faults);
            let fault = chosen.as_table().cloned();
            return Setting::fault(self.name(), fault);
        }
        let value = match &self.values {
            Some(values) => of_list(values),
            None => self.of_range_at(u),
        };
        Setting::key(self.name(), self.key.as_deref().unwrap_or_default(), value)
    }

    fn of_range_at(&self, u: f64) -> Value {
        let ends = self.ends();
        let number = match self.distribution {
            // Every whole number has the same share.
            Distribution::Uniform if self.is_whole() => {
                (ends[0] + u * (ends[1] - ends[0] + 1.0)).floor().min(ends[1])
            }
            Distribution::Uniform => ends[0] + u * (ends[1] - ends[0]),
            Distribution::LogUniform => ends[0] * (ends[1] / ends[0]).powf(u),
            Distribution::Normal => self.normal().map_or(f64::NAN, |(mean, deviation)| {
                let [from, to] = ends.map(|end| normal_share((end - mean) / deviation));
                // The ends of an endless range have no quantile.
                let share = (from + u * (to - from)).clamp(1e-12, 1.0 - 1e-12);
                (mean + deviation * normal_quantile(share)).clamp(ends[0], ends[1])
            }),
        };
        match (&self.unit, self.is_whole()) {
            (Some(unit), _) => Value::String(format!("{number} {unit}")),
            (None, true) => Value::Integer(number.round() as i64),
            (None, false) => Value::Float(number),
        }
    }

    /// Whether the values are whole numbers: those of both ends are.
    fn is_whole(&self) -> bool {
        self.range.as_ref().is_some_and(|ends| ends.iter().all(Value::is_integer))
    }

    fn ends(&self) -> [f64; 2] {
        let endless = [f64::NEG_INFINITY, f64::INFINITY];
        self.range
            .as_ref()
            .map_or(endless, |ends| ends.each_ref().map(|end| bare_number(end).unwrap_or(f64::NAN)))
    }

    /// Mean and deviation of a normal distribution.
    fn normal(&self) -> Option<(f64, f64)> {
        self.mean.zip(self.deviation).filter(|(_, deviation)| *deviation > 0.0)
    }

    /// Checks the factor by itself; its keys are checked with the scenario of each case.
    pub(crate) fn validate(&self) -> Result<(), String> {
        let is_normal = self.distribution == Distribution::Normal;
        let is_logarithmic = self.distribution == Distribution::LogUniform;
        let given = [self.range.is_some() || is_normal, self.values.is_some(), self.faults.is_some()];
        let listed = || self.values.iter().chain(&self.faults);
        let is_fault = |fault: &Value| fault.is_table() || fault.as_str() == Some(NO_FAULT);
        let [low, high] = self.ends();
        let are_ends = low.is_finite() && high.is_finite() && low < high;
        let most_levels = || MOST_LEVELS.min(self.most_levels());
        let numbers = [self.mean, self.deviation].into_iter().flatten();
        let refusals = [
            (given.iter().filter(|is_given| **is_given).count() != 1, "give one of range, values and faults"),
            (
                self.faults.is_some() == self.key.is_some(),
                "give the key of the scenario that varies, or faults",
            ),
            (listed().any(Vec::is_empty), "give at least one value"),
            (
                !self.faults.iter().flatten().all(is_fault),
                "write each fault as a table, such as { kind = \"lose\", at_s = 2.0 }, or \"none\"",
            ),
            (self.range.is_some() && !are_ends, "range: give two numbers, the smaller first"),
            (
                self.range.is_some() && is_logarithmic && low <= 0.0,
                "range: a log-uniform distribution needs numbers above 0",
            ),
            (
                self.levels.is_some_and(|levels| !(1..=most_levels()).contains(&levels)),
                "levels: use 1 to 10000, and no more than a range has whole numbers",
            ),
            (is_logarithmic && self.range.is_none(), "distribution: it needs a range"),
            (
                !listed().flatten().all(is_finite) || !numbers.into_iter().all(f64::is_finite),
                "use finite numbers",
            ),
            (
                is_normal && self.normal().is_none(),
                "a normal distribution needs mean, and a deviation above 0",
            ),
            (
                !is_normal && (self.mean.is_some() || self.deviation.is_some()),
                "mean and deviation need distribution = \"normal\"",
            ),
        ];
        let refusal = refusals.into_iter().find(|(is_wrong, _)| *is_wrong);
        refusal.map_or(Ok(()), |(_, reason)| Err(format!("factor '{}': {reason}", self.name())))
    }
}

/// The value of a factor in a case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Setting {
    /// Name of the factor.
    pub name: String,
    /// The key of the scenario; none for a fault.
    pub key: Option<String>,
    /// The value of the key; none for a fault.
    pub value: Option<Value>,
    /// The fault that is added; `None` if nothing is.
    pub fault: Option<Table>,
}

impl Setting {
    pub(crate) fn key(name: &str, key: &str, value: Value) -> Self {
        Self { name: name.to_owned(), key: Some(key.to_owned()), value: Some(value), fault: None }
    }

    pub(crate) fn fault(name: &str, fault: Option<Table>) -> Self {
        Self { name: name.to_owned(), key: None, value: None, fault }
    }

    /// The value as a number, without its unit; none of one that is no number.
    pub fn number(&self) -> Option<f64> {
        match self.value.as_ref()? {
            Value::Boolean(is_true) => Some(f64::from(u8::from(*is_true))),
            Value::String(text) => text.split_whitespace().next()?.parse().ok(),
            other => bare_number(other),
        }
    }

    /// The value in a word: that of a table is its name or kind.
    pub fn word(&self) -> String {
        let of_table = |table: &Table| {
            let named = ["name", "kind"].into_iter().find_map(|key| table.get(key)?.as_str());
            named.map_or_else(|| table.to_string().replace('\n', " "), str::to_owned)
        };
        match &self.value {
            Some(Value::Table(table)) => of_table(table),
            Some(Value::String(text)) => text.clone(),
            Some(value) => value.to_string(),
            None => self.fault.as_ref().map_or_else(|| "none".to_owned(), of_table),
        }
    }

    /// Enters the value into a scenario's table of changes.
    pub(crate) fn enter(&self, changes: &mut Table) {
        let (Some(key), Some(value)) = (&self.key, &self.value) else { return };
        let (folders, name) =
            key.rsplit_once('.').map_or(("", key.as_str()), |(folders, name)| (folders, name));
        let folders = folders.split('.').filter(|name| !name.is_empty());
        let inner = folders.fold(changes, |table, name| {
            let entry = table.entry(name).or_insert_with(|| Value::Table(Table::new()));
            if !entry.is_table() {
                // Another factor gives the whole table as something else; the later factor counts.
                *entry = Value::Table(Table::new());
            }
            entry.as_table_mut().expect("it is one now")
        });
        inner.insert(name.to_owned(), value.clone());
    }
}

/// The share of a standard normal distribution below a number.
fn normal_share(number: f64) -> f64 {
    libm::erfc(-number / std::f64::consts::SQRT_2) / 2.0
}

/// The number below which a share of a standard normal distribution lies.
fn normal_quantile(share: f64) -> f64 {
    let mut between = [-10.0, 10.0];
    // As long as halving changes anything.
    for _ in 0..64 {
        let middle = f64::midpoint(between[0], between[1]);
        between[usize::from(normal_share(middle) >= share)] = middle;
    }
    f64::midpoint(between[0], between[1])
}

/// Whether every number of a value is finite: other numbers have no form in the files of a campaign.
fn is_finite(value: &Value) -> bool {
    match value {
        Value::Float(number) => number.is_finite(),
        Value::Table(table) => table.values().all(is_finite),
        Value::Array(list) => list.iter().all(is_finite),
        _ => true,
    }
}

/// A number without a unit.
pub(crate) fn bare_number(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn factor(text: &str) -> Factor {
        toml::from_str(text).unwrap()
    }

    fn value_at(text: &str, u: f64) -> Value {
        let factor = factor(text);
        factor.validate().unwrap();
        factor.at(u).value.unwrap()
    }

    #[test]
    fn the_values_of_a_range_follow_its_distribution() {
        assert_eq!(value_at("key = 'a'\nrange = [2.0, 4.0]", 0.5), Value::Float(3.0));
        let log = value_at("key = 'a'\nrange = [1.0, 100.0]\ndistribution = 'log-uniform'", 0.5);
        assert!((log.as_float().unwrap() - 10.0).abs() < 1e-12);
        let normal = "key = 'a'\ndistribution = 'normal'\nmean = 5.0\ndeviation = 2.0";
        assert!((value_at(normal, 0.5).as_float().unwrap() - 5.0).abs() < 1e-9);
        assert!((value_at(normal, 0.841_344_746).as_float().unwrap() - 7.0).abs() < 1e-6);
        let cut = format!("{normal}\nrange = [5.0, 6.0]");
        assert!((value_at(&cut, 0.0).as_float().unwrap() - 5.0).abs() < 1e-9);
        assert!(value_at(&cut, 0.999_999).as_float().unwrap() <= 6.0);
        let tail = "key = 'a'\ndistribution = 'normal'\nmean = 0.0\ndeviation = 1.0\nrange = [8.0, 9.0]";
        assert!((8.0..=9.0).contains(&value_at(tail, 0.5).as_float().unwrap()));
    }

    #[test]
    fn whole_ends_give_whole_numbers_and_a_unit_gives_quantities() {
        let whole = "key = 'a'\nrange = [1, 3]";
        let shares = [0.0, 0.33, 0.34, 0.66, 0.67, 0.999].map(|u| value_at(whole, u));
        assert_eq!(shares, [1, 1, 2, 2, 3, 3].map(Value::Integer));
        assert_eq!(factor(whole).level_count(), 3);
        assert_eq!(value_at("key = 'a'\nrange = [1.0, 2.0]\nunit = 'mm'", 0.5), Value::from("1.5 mm"));
    }

    #[test]
    fn the_unit_is_given_or_that_of_the_key() {
        let unit = |text: &str| factor(text).unit().to_owned();
        assert_eq!(unit("key = 'dynamics.slide_friction_n'\nrange = [1.0, 2.0]"), "N");
        assert_eq!(unit("key = 'drives.d1.velocity_gain_n_s_per_m'\nrange = [1.0, 2.0]"), "N s/m");
        assert_eq!(unit("key = 'faults.play.size'\nunit = 'mm'\nrange = [1.0, 2.0]"), "mm");
        assert_eq!(unit("key = 'motion'\nvalues = [1]"), "");
    }

    #[test]
    fn a_list_is_shared_out_evenly() {
        let list = "key = 'motion'\nvalues = [{ kind = 'opening' }, { kind = 'chewing' }]";
        assert_eq!(value_at(list, 0.49).get("kind"), Some(&Value::from("opening")));
        assert_eq!(value_at(list, 0.5).get("kind"), Some(&Value::from("chewing")));
    }

    #[test]
    fn a_fault_is_added_or_not() {
        let faults = factor("faults = ['none', { kind = 'lose', at_s = 2.0 }]");
        faults.validate().unwrap();
        assert_eq!(faults.name(), "fault");
        assert_eq!(faults.at(0.0).fault, None);
        assert_eq!(faults.at(0.9).fault.unwrap()["at_s"], Value::Float(2.0));
    }

    #[test]
    fn a_wrong_factor_is_refused_with_what_to_do() {
        for (text, reason) in [
            ("key = 'a'", "give one of range, values and faults"),
            ("key = 'a'\nrange = [1.0, 2.0]\nvalues = [1]", "give one of range"),
            ("range = [1.0, 2.0]", "give the key"),
            ("key = 'a'\nfaults = ['none']", "give the key of the scenario that varies, or faults"),
            ("key = 'a'\nvalues = []", "at least one value"),
            ("faults = ['some']", "write each fault as a table"),
            ("key = 'a'\nrange = [2.0, 1.0]", "the smaller first"),
            ("key = 'a'\nrange = ['1 mm', '2 mm']", "give two numbers"),
            ("key = 'a'\nrange = [0.0, 1.0]\ndistribution = 'log-uniform'", "above 0"),
            ("key = 'a'\ndistribution = 'normal'\nmean = 1.0", "a deviation above 0"),
            ("key = 'a'\nrange = [1.0, 2.0]\nmean = 1.0", "need distribution"),
            ("key = 'a'\nrange = [1.0, 2.0]\nlevels = 0", "use 1 to 10000"),
            ("key = 'a'\nrange = [1, 3]\nlevels = 4", "no more than a range has whole numbers"),
            ("key = 'a'\nvalues = [0.0, 1.0]\ndistribution = 'log-uniform'", "it needs a range"),
            ("key = 'a'\nvalues = [nan]", "use finite numbers"),
            ("faults = [{ kind = 'lose', at_s = inf }]", "use finite numbers"),
        ] {
            let refusal = factor(text).validate().unwrap_err();
            assert!(refusal.contains(reason), "{text}: {refusal}");
        }
    }

    #[test]
    fn settings_share_the_tables_of_their_keys() {
        let mut changes = Table::new();
        for (key, value) in [("a.b.c", 1), ("a.b.d", 2), ("e", 3)] {
            Setting::key(key, key, Value::Integer(value)).enter(&mut changes);
        }
        let wanted: Table = toml::from_str("e = 3\n[a.b]\nc = 1\nd = 2").unwrap();
        assert_eq!(changes, wanted);
    }

    #[test]
    fn a_value_has_a_number_and_a_word() {
        let of = |value: Value| Setting::key("x", "x", value);
        assert_eq!(of(Value::from("1.5 mm")).number(), Some(1.5));
        assert_eq!(of(Value::from("chewing")).number(), None);
        assert_eq!(of(Value::Boolean(true)).number(), Some(1.0));
        let motion: Table = toml::from_str("kind = 'opening'").unwrap();
        assert_eq!(of(Value::Table(motion.clone())).word(), "opening");
        assert_eq!(Setting::fault("fault", Some(motion)).word(), "opening");
        assert_eq!(Setting::fault("fault", None).word(), "none");
    }
}
