//! Reduction of a failing scenario to a minimal one that still fails: fewer changes to the default scenario, values
//! nearer to the defaults, fewer digits, a shorter run.
//!
//! The changes are reduced by delta debugging (Zeller and Hildebrandt, 2002). The result depends on the scenario alone.

use std::path::Path;

use masseter_scenario::{RequirementConfig, Scenario};
use toml::{Table, Value};

/// The lists whose entries are changes of their own.
const LISTS: [&str; 3] = ["faults", "stimulus", REQUIREMENTS];
/// The list whose entries stay as they are, or go whole: another limit would be another failure.
const REQUIREMENTS: &str = "require";
/// The most rounds of all reductions; two are usual.
const ROUNDS: usize = 8;
/// Bisections towards a default.
const BISECTIONS: usize = 5;
/// Digits of numbers, the fewest first.
const DIGITS: [usize; 4] = [1, 2, 3, 4];
/// Key of the duration.
const DURATION: &str = "duration_s";

/// A difference of a scenario from the default one.
#[derive(Debug, Clone, PartialEq)]
struct Change {
    /// The names of the key.
    path: Vec<String>,
    value: Value,
    /// The default; `None` without one.
    default: Option<Value>,
    /// Whether the value is an entry of the list at the path.
    is_entry: bool,
}

impl Change {
    fn is_requirement(&self) -> bool {
        self.path == [REQUIREMENTS]
    }
}

/// Reduces a scenario as long as `fails` holds of it.
pub struct Shrink<F> {
    fails: F,
    name: Value,
    default: Table,
}

impl<F: FnMut(&Scenario) -> bool> Shrink<F> {
    /// The minimal scenario of one that fails, as TOML with its changes alone.
    pub fn run(fails: F, scenario: &Scenario) -> String {
        let name: String = format!("{}-shrunk", scenario.name).chars().take(64).collect();
        let mut shrink = Self { fails, name: Value::String(name), default: table(&Scenario::default()) };
        let mut changes = changes(scenario);
        for _ in 0..ROUNDS {
            let before = changes.clone();
            changes = shrink.fewer(changes);
            shrink.barer(&mut changes);
            shrink.simpler(&mut changes);
            if changes == before {
                break;
            }
        }
        shrink.scenario_text(&changes)
    }

    /// Delta debugging: removes parts of the changes, halves first.
    fn fewer(&mut self, mut changes: Vec<Change>) -> Vec<Change> {
        let mut parts = 2;
        while !changes.is_empty() {
            let length = changes.len().div_ceil(parts);
            let without = (0..parts).find_map(|part| {
                let (from, to) =
                    ((part * length).min(changes.len()), ((part + 1) * length).min(changes.len()));
                let rest = [&changes[..from], &changes[to..]].concat();
                (from < to && self.does_fail(&rest)).then_some(rest)
            });
            match without {
                Some(rest) => (changes, parts) = (rest, (parts - 1).max(2)),
                None if length == 1 => break,
                None => parts = (parts * 2).min(changes.len()),
            }
        }
        changes
    }

    /// Removes the keys of entries and whole tables that the failure does not need.
    fn barer(&mut self, changes: &mut Vec<Change>) {
        for at in (0..changes.len()).filter(|at| !changes[*at].is_requirement()).collect::<Vec<_>>() {
            let keys = |change: &Change| {
                change.value.as_table().map_or_else(Vec::new, |t| t.keys().cloned().collect())
            };
            for key in keys(&changes[at]) {
                let mut tried = changes.clone();
                tried[at].value.as_table_mut().map(|table| table.remove(&key));
                if self.does_fail(&tried) {
                    *changes = tried;
                }
            }
        }
    }

    /// Moves every number towards its default, then cuts its digits.
    fn simpler(&mut self, changes: &mut Vec<Change>) {
        for at in (0..changes.len()).filter(|at| !changes[*at].is_requirement()).collect::<Vec<_>>() {
            let places = number_places(&changes[at].value);
            for place in places {
                self.nearer(changes, at, &place);
                self.shorter(changes, at, &place);
            }
        }
    }

    fn nearer(&mut self, changes: &mut Vec<Change>, at: usize, place: &[String]) {
        let change = &changes[at];
        let target = if change.path == [DURATION] {
            Some(0.0)
        } else {
            change.default.as_ref().and_then(|default| number(at_place(default, place)?))
        };
        let Some(mut passing) = target else { return };
        let Some(mut failing) = at_place(&change.value, place).and_then(number) else { return };
        for _ in 0..BISECTIONS {
            let middle = f64::midpoint(passing, failing);
            if self.try_number(changes, at, place, middle) { failing = middle } else { passing = middle }
        }
    }

    fn shorter(&mut self, changes: &mut Vec<Change>, at: usize, place: &[String]) {
        let exact = at_place(&changes[at].value, place).and_then(number).filter(|exact| *exact != 0.0);
        let Some(exact) = exact else { return };
        for digits in DIGITS {
            let nearest: f64 = format!("{exact:.*e}", digits - 1).parse().unwrap_or(exact);
            // The nearest may lie on the other side of the failure's border.
            let unit = 10f64.powi(exact.abs().log10().floor() as i32 - digits as i32 + 1);
            let beside = [unit, -unit].map(|step| format!("{:.*e}", digits - 1, nearest + step).parse());
            for rounded in [Ok(nearest)].into_iter().chain(beside).flatten() {
                if rounded.to_bits() == exact.to_bits() || self.try_number(changes, at, place, rounded) {
                    return;
                }
            }
        }
    }

    /// Takes a number if the scenario still fails with it.
    fn try_number(&mut self, changes: &mut Vec<Change>, at: usize, place: &[String], to: f64) -> bool {
        let mut tried = changes.clone();
        let Some(value) = at_place_mut(&mut tried[at].value, place) else { return false };
        match value {
            Value::Integer(whole) => *whole = to.round() as i64,
            Value::String(text) => {
                let unit = text.split_once(' ').map_or("", |(_, unit)| unit);
                format!("{to} {unit}").trim_end().clone_into(text);
            }
            other => *other = Value::Float(to),
        }
        if tried == *changes || !self.does_fail(&tried) {
            return false;
        }
        *changes = tried;
        true
    }

    fn does_fail(&mut self, changes: &[Change]) -> bool {
        let scenario = Scenario::parse(Path::new("shrink"), &self.scenario_text(changes));
        scenario.is_ok_and(|scenario| scenario.validate().is_ok() && (self.fails)(&scenario))
    }

    fn scenario_text(&self, changes: &[Change]) -> String {
        let mut whole = Table::from_iter([("name".to_owned(), self.name.clone())]);
        for Change { path, value, is_entry, .. } in changes {
            let [folders @ .., name] = path.as_slice() else { continue };
            let mut default = Some(&self.default);
            let table = folders.iter().fold(&mut whole, |table, folder| {
                default = default.and_then(|default| default.get(folder)?.as_table());
                // A table of a kind cannot be read without its kind.
                let kind = default.and_then(|default| default.get_key_value("kind"));
                let begun = Table::from_iter(kind.map(|(key, kind)| (key.clone(), kind.clone())));
                let inner = table.entry(folder).or_insert_with(|| Value::Table(begun));
                inner.as_table_mut().expect("a key is either a table or a value")
            });
            if *is_entry {
                let list = table.entry(name).or_insert_with(|| Value::Array(Vec::new()));
                list.as_array_mut().expect("it is a list").push(value.clone());
            } else {
                table.insert(name.clone(), value.clone());
            }
        }
        toml::to_string_pretty(&whole).expect("changes have a TOML form")
    }
}

/// The differences of a scenario from the default one.
fn changes(scenario: &Scenario) -> Vec<Change> {
    let mut given = table(scenario);
    given.remove("name");
    let mut found = Vec::new();
    collect(&mut found, &[], &given, &table(&Scenario::default()));
    found
}

fn table(scenario: &Scenario) -> Table {
    toml::from_str(&scenario.to_toml()).expect("it was written from a scenario")
}

fn collect(found: &mut Vec<Change>, path: &[String], given: &Table, default: &Table) {
    for (name, value) in given {
        let path = [path, std::slice::from_ref(name)].concat();
        match (value, default.get(name)) {
            (value, Some(default)) if value == default => {}
            (Value::Table(given), Some(Value::Table(default)))
                if given.get("kind") == default.get("kind") =>
            {
                collect(found, &path, given, default);
            }
            (Value::Array(list), _) if path.len() == 1 && LISTS.contains(&name.as_str()) => {
                let entry = |value: &Value| Change {
                    path: path.clone(),
                    value: if name == REQUIREMENTS { as_written(value) } else { value.clone() },
                    default: None,
                    is_entry: true,
                };
                found.extend(list.iter().map(entry));
            }
            (value, default) => {
                found.push(Change { path, value: value.clone(), default: default.cloned(), is_entry: false });
            }
        }
    }
}

/// A requirement without the keys that have their defaults.
fn as_written(requirement: &Value) -> Value {
    let default = Table::try_from(RequirementConfig::default()).expect("the default is a table");
    let keys = requirement.as_table().into_iter().flatten();
    let written = keys.filter(|(key, value)| default.get(*key) != Some(*value));
    Value::Table(written.map(|(key, value)| (key.clone(), value.clone())).collect())
}

/// The places of all numbers in a value, also of those with a unit.
fn number_places(value: &Value) -> Vec<Vec<String>> {
    match value {
        Value::Table(table) => {
            let inner = |(name, value): (&String, &Value)| {
                let name = name.clone();
                number_places(value).into_iter().map(move |place| [vec![name.clone()], place].concat())
            };
            table.iter().flat_map(inner).collect()
        }
        other if number(other).is_some() => vec![Vec::new()],
        _ => Vec::new(),
    }
}

fn at_place<'a>(value: &'a Value, place: &[String]) -> Option<&'a Value> {
    place.iter().try_fold(value, |value, name| value.as_table()?.get(name))
}

fn at_place_mut<'a>(value: &'a mut Value, place: &[String]) -> Option<&'a mut Value> {
    place.iter().try_fold(value, |value, name| value.as_table_mut()?.get_mut(name))
}

/// Also one with a unit.
fn number(value: &Value) -> Option<f64> {
    crate::factor::bare_number(value).or_else(|| value.as_str()?.split_once(' ')?.0.parse().ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scenario(text: &str) -> Scenario {
        let scenario = Scenario::parse(Path::new("test"), text).unwrap();
        scenario.validate().unwrap();
        scenario
    }

    const MANY: &str = "\
seed = 7
rate_hz = 500
duration_s = 8.0
[dynamics]
slide_friction_n = 9.137
platform_mass_kg = 1.5
[[faults]]
kind = 'encoder_stuck'
axis = 'l2'
at_s = 2.123456
[[faults]]
kind = 'lose'
bus = 0
at_s = 3.0
for_s = 0.1
";

    #[test]
    fn only_what_the_failure_needs_is_left_with_few_digits() {
        let fails = |scenario: &Scenario| {
            scenario.dynamics.slide_friction_n > 7.03
                && scenario.faults.iter().any(|fault| fault.at_s.is_some_and(|at_s| at_s > 2.1))
        };
        let shrunk = Shrink::run(fails, &scenario(MANY));
        let small = scenario(&shrunk);
        assert!(fails(&small), "{shrunk}");
        assert_eq!((small.seed, small.rate_hz, small.duration_s), (1, 1000, None), "{shrunk}");
        assert!(shrunk.contains("slide_friction_n = 8.0"), "{shrunk}");
        assert!(
            shrunk.ends_with("[[faults]]\nat_s = 3.0\naxis = \"l2\"\nkind = \"encoder_stuck\"\n"),
            "{shrunk}"
        );
    }

    #[test]
    fn the_run_gets_as_short_as_the_failure_allows() {
        let fails = |scenario: &Scenario| scenario.duration_s.is_some_and(|duration_s| duration_s > 2.9);
        let small = scenario(&Shrink::run(fails, &scenario(MANY)));
        assert!(small.duration_s.unwrap() < 3.5, "{:?}", small.duration_s);
    }

    #[test]
    fn a_key_of_the_motion_keeps_the_kind_of_the_motion() {
        let fails = |scenario: &Scenario| {
            let masseter_scenario::MotionConfig::Chewing(chewing) = &scenario.motion else {
                return false;
            };
            chewing.cycle_rate_hz > 1.5
        };
        let small = Shrink::run(
            fails,
            &scenario("[motion]\nkind = 'chewing'\ncycle_rate_hz = 1.6321\nlateral_mm = 5.0"),
        );
        assert!(small.ends_with("[motion]\ncycle_rate_hz = 2.0\nkind = \"chewing\"\n"), "{small}");
    }

    #[test]
    fn a_requirement_stays_as_it_is_or_goes() {
        let text = "[[require]]\nname = 'a'\nsignal = 'incisal.error'\nduring = 'running'\nmax = '61.7 um'\n\
                    [[require]]\nname = 'b'\nsignal = 'jaw.opening'\nmax = '40 mm'";
        let fails = |scenario: &Scenario| scenario.require.iter().any(|require| require.name == "a");
        let shrunk = Shrink::run(fails, &scenario(text));
        assert_eq!(scenario(&shrunk).require, scenario(text).require[..1]);
        assert!(!shrunk.contains("order") && !shrunk.contains("statistic"), "nobody wrote them: {shrunk}");
    }

    #[test]
    fn the_same_scenario_shrinks_to_the_same_text() {
        let shrunk = || Shrink::run(|scenario| scenario.faults.len() == 2, &scenario(MANY));
        assert_eq!(shrunk(), shrunk());
    }

    #[test]
    fn a_scenario_that_fails_without_any_change_is_empty() {
        assert_eq!(Shrink::run(|_| true, &scenario(MANY)), "name = \"chewing-shrunk\"\n");
    }
}
