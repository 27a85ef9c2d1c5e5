//! The named numbers of a controller: signals, which it publishes, and parameters, which its user sets.
//!
//! A controller [declares](Declared) both once, before the start; the declaration is checked then, and kept beside the
//! recording. [`NamedValues`] holds the values of a run. [`access`] lets other programs read and set the parameters
//! meanwhile. What a controller does with a parameter is not known here.

pub mod access;

use std::array;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use masseter_scenario::input::{excerpt, is_printable};
use masseter_scenario::wording::question;
use serde::{Deserialize, Serialize};

use crate::messages::codes::{Cause, EventKind, Source};
use crate::messages::{Event, MOST_VALUES, Values};

/// Characters of the longest name.
const LONGEST_NAME: usize = 48;
/// Bytes of the longest unit.
const LONGEST_UNIT: usize = 48;
/// Bytes of all texts of a declaration together.
const MOST_TEXT_BYTES: usize = 64 << 10;
/// The fields that stand beside the named values in a recorded message.
const TAKEN: [&str; 5] = ["seq", "published_ns", "version", "cycle", "length"];

/// A number that the controller publishes in each cycle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Signal {
    /// Its name, in lower case, such as `grip_force`.
    pub name: String,
    /// Its unit, such as `mm`; empty for none.
    pub unit: String,
    /// What it is.
    pub about: String,
}

/// A number that the user sets, also during a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Its name, in lower case, such as `gain`.
    pub name: String,
    /// Its unit, such as `1/s`; empty for none.
    pub unit: String,
    /// What it is.
    pub about: String,
    /// Its value at the start.
    pub value: f64,
    /// Its smallest and largest value.
    pub range: [f64; 2],
}

impl Parameter {
    /// A parameter of this value without unit and range; fields can be set otherwise.
    pub fn new(name: &str, value: f64) -> Self {
        Self {
            name: name.to_owned(),
            unit: String::new(),
            about: String::new(),
            value,
            range: [f64::MIN, f64::MAX],
        }
    }

    /// Refuses a value beyond the range.
    ///
    /// # Errors
    /// [`NameError::OutOfRange`], also for what is no number.
    pub fn check(&self, value: f64) -> Result<(), NameError> {
        let [least, most] = self.range;
        if (least..=most).contains(&value) {
            return Ok(());
        }
        let (name, unit) = (self.name.clone(), self.unit.clone());
        Err(NameError::OutOfRange { name, value, least, most, unit })
    }
}

/// Which motion a controller plays.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlayedMotion {
    /// The scenario's: its desired poses are held against those of the scenario.
    #[default]
    Scenario,
    /// One of its own, of which the rig knows nothing: the scenario must require something of the run.
    Own,
}

/// What a controller declares: its signals and parameters, each in the order of its values, and which motion it plays.
///
/// ```
/// use masseter_runtime::named::{Declared, Parameter, Signal};
///
/// let declared = Declared {
///     signals: vec![Signal { name: "trim".into(), unit: "mm".into(), about: "Length of the correction.".into() }],
///     parameters: vec![Parameter { range: [0.0, 10.0], ..Parameter::new("gain", 3.0) }],
///     ..Declared::default()
/// };
/// assert_eq!(declared.check(), Ok(()));
/// assert_eq!(
///     declared.place_of("gian").unwrap_err().to_string(),
///     "the controller has no parameter 'gian', but: gain; did you mean 'gain'?"
/// );
/// ```
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Declared {
    /// The signals.
    pub signals: Vec<Signal>,
    /// The parameters.
    pub parameters: Vec<Parameter>,
    /// The motion.
    pub motion: PlayedMotion,
}

/// Why a name or a value is refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NameError {
    /// A recording could not have the name.
    #[error(
        "'{}' is no name of a signal or parameter: use up to {LONGEST_NAME} lower-case letters, digits and single '_', \
         beginning with a letter, and none of seq, published_ns, version, cycle, length", excerpt(.0)
    )]
    BadName(String),
    /// Two have one name.
    #[error("two signals, or two parameters, are named '{0}'")]
    Twice(String),
    /// There are too many.
    #[error("{0} {1} are too many: a controller has up to {MOST_VALUES}")]
    TooMany(usize, &'static str),
    /// A unit or a description cannot be shown.
    #[error(
        "the {what} of '{name}' is '{}': use printable characters on one line, at most {most_bytes} bytes", excerpt(.text)
    )]
    Unprintable {
        /// The signal or parameter.
        name: String,
        /// Unit or description.
        what: &'static str,
        /// The text.
        text: String,
        /// The longest such text.
        most_bytes: usize,
    },
    /// The texts are too long.
    #[error("names, units and descriptions take {0} bytes together: shorten them to {MOST_TEXT_BYTES} bytes")]
    TooLong(usize),
    /// A range is not one, or is infinite.
    #[error("the range of parameter '{0}' is none: give a smallest and a larger or equal largest number")]
    BadRange(String),
    /// The value is beyond the parameter's range.
    #[error("parameter '{name}' cannot be {value}: its range is {least} to {most} {unit}")]
    OutOfRange {
        /// The parameter.
        name: String,
        /// The refused value.
        value: f64,
        /// The smallest value.
        least: f64,
        /// The largest value.
        most: f64,
        /// The unit of all three.
        unit: String,
    },
    /// There is no such parameter.
    #[error("the controller has no parameter '{}'{}", excerpt(.name), others(.name, .parameters))]
    Unknown {
        /// The name.
        name: String,
        /// The parameters that there are.
        parameters: Vec<String>,
    },
}

impl NameError {
    /// The signal or parameter, where one is at fault.
    pub fn name(&self) -> Option<&str> {
        match self {
            Self::BadName(name)
            | Self::Twice(name)
            | Self::BadRange(name)
            | Self::Unprintable { name, .. }
            | Self::OutOfRange { name, .. }
            | Self::Unknown { name, .. } => Some(name),
            Self::TooMany(..) | Self::TooLong(_) => None,
        }
    }
}

fn others(name: &str, parameters: &[String]) -> String {
    let question = question(name, parameters.iter().map(String::as_str));
    if parameters.is_empty() {
        return "; it declares none".to_owned();
    }
    format!(", but: {}{question}", parameters.join(", "))
}

impl Declared {
    /// Refuses what a recording could not contain, and parameters whose value is beyond their range.
    ///
    /// # Errors
    /// [`NameError`].
    pub fn check(&self) -> Result<(), NameError> {
        require_names(&self.signals.iter().map(|signal| &*signal.name).collect::<Vec<_>>(), "signals")?;
        require_names(&self.names(), "parameters")?;
        self.require_texts()?;
        for parameter in &self.parameters {
            let [least, most] = parameter.range;
            if !(least.is_finite() && most.is_finite() && least <= most) {
                return Err(NameError::BadRange(parameter.name.clone()));
            }
            parameter.check(parameter.value)?;
        }
        Ok(())
    }

    /// The texts stand in schemas, pages and terminals.
    fn require_texts(&self) -> Result<(), NameError> {
        let signals = self.signals.iter().map(|known| [&known.name, &known.unit, &known.about]);
        let parameters = self.parameters.iter().map(|known| [&known.name, &known.unit, &known.about]);
        let mut bytes = 0;
        for texts @ [name, unit, about] in signals.chain(parameters) {
            for (what, text, most_bytes) in
                [("unit", unit, LONGEST_UNIT), ("description", about, MOST_TEXT_BYTES)]
            {
                if !is_printable(text, most_bytes) {
                    let (name, text) = (name.clone(), text.clone());
                    return Err(NameError::Unprintable { name, what, text, most_bytes });
                }
            }
            bytes += texts.map(String::len).iter().sum::<usize>();
        }
        if bytes > MOST_TEXT_BYTES { Err(NameError::TooLong(bytes)) } else { Ok(()) }
    }

    /// The place of a parameter.
    ///
    /// # Errors
    /// [`NameError::Unknown`].
    pub fn place_of(&self, name: &str) -> Result<usize, NameError> {
        self.parameters.iter().position(|parameter| parameter.name == name).ok_or_else(|| {
            NameError::Unknown {
                name: name.to_owned(),
                parameters: self.names().into_iter().map(str::to_owned).collect(),
            }
        })
    }

    /// The same with the values of a scenario at the start.
    ///
    /// # Errors
    /// [`NameError`] for a parameter that is not declared, or a value beyond its range.
    pub fn with(mut self, values: &BTreeMap<String, f64>) -> Result<Self, NameError> {
        for (name, &value) in values {
            let place = self.place_of(name)?;
            self.parameters[place].value = value;
        }
        self.check()?;
        Ok(self)
    }

    fn names(&self) -> Vec<&str> {
        self.parameters.iter().map(|parameter| &*parameter.name).collect()
    }
}

fn require_names(names: &[&str], kind: &'static str) -> Result<(), NameError> {
    if names.len() > MOST_VALUES {
        return Err(NameError::TooMany(names.len(), kind));
    }
    if let Some(bad) = names.iter().find(|name| !is_name(name)) {
        return Err(NameError::BadName((*bad).to_owned()));
    }
    let mut seen = BTreeSet::new();
    let twice = names.iter().find(|name| !seen.insert(**name));
    twice.map_or(Ok(()), |name| Err(NameError::Twice((*name).to_owned())))
}

/// Whether a field of a ROS 2 message may have this name.
fn is_name(name: &str) -> bool {
    let has_form = name.len() <= LONGEST_NAME
        && name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.bytes().all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_');
    has_form && !name.ends_with('_') && !name.contains("__") && !TAKEN.contains(&name)
}

/// The parameters as their user wants them. Any thread may set them; the loop that takes them over never waits.
#[derive(Debug)]
pub struct Settings {
    declared: Declared,
    /// The bits of each value.
    wanted: [AtomicU64; MOST_VALUES],
}

impl Settings {
    fn new(declared: Declared) -> Self {
        let value = |place: usize| declared.parameters.get(place).map_or(0.0, |parameter| parameter.value);
        let wanted = array::from_fn(|place| AtomicU64::new(value(place).to_bits()));
        Self { declared, wanted }
    }

    /// What the controller declares.
    pub fn declared(&self) -> &Declared {
        &self.declared
    }

    /// The value of a parameter that is set, and takes effect in the next cycle if it has not yet.
    pub fn value(&self, place: usize) -> f64 {
        f64::from_bits(self.wanted[place].load(Ordering::Relaxed))
    }

    /// Sets the parameter at this place to a value within its range.
    pub(crate) fn store(&self, place: usize, value: f64) {
        self.wanted[place].store(value.to_bits(), Ordering::Relaxed);
    }

    /// Sets a parameter.
    ///
    /// # Errors
    /// [`NameError`] for an unknown parameter, or a value beyond its range.
    pub fn set(&self, name: &str, value: f64) -> Result<(), NameError> {
        let place = self.declared.place_of(name)?;
        self.declared.parameters[place].check(value)?;
        self.store(place, value);
        Ok(())
    }
}

/// A parameter that has a new value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// The place of the parameter.
    pub place: usize,
    /// Its value before.
    pub from: f64,
    /// Its value from now on.
    pub to: f64,
}

impl Change {
    /// The event of the change in this cycle.
    pub fn event(&self, cycle: u64, time_ns: u64) -> Event {
        Event {
            time_ns,
            cycle,
            object: self.place as u32,
            value: self.to,
            limit: self.from,
            ..Event::new(Source::Controller, EventKind::Notice, Cause::ParameterSet)
        }
    }
}

/// The values of a controller's signals and parameters in a run.
#[derive(Debug)]
pub struct NamedValues {
    settings: Arc<Settings>,
    parameters: Values,
    signals: Values,
    is_changed: bool,
}

impl Clone for NamedValues {
    /// The same values, with settings of their own: whoever sets these sets no others.
    fn clone(&self) -> Self {
        let Self { settings, parameters, signals, is_changed } = self;
        let wanted = array::from_fn(|place| AtomicU64::new(settings.value(place).to_bits()));
        let settings = Arc::new(Settings { declared: settings.declared.clone(), wanted });
        Self { settings, parameters: *parameters, signals: *signals, is_changed: *is_changed }
    }
}

impl NamedValues {
    /// The values at the start: the declared ones, or those given for parameters by their names.
    ///
    /// # Errors
    /// [`NameError`] when the declaration cannot be used, or the given values do not fit.
    pub fn new(declared: Declared, given: &BTreeMap<String, f64>) -> Result<Self, NameError> {
        let declared = declared.with(given)?;
        let mut parameters = Values::zeros(declared.parameters.len());
        let values = declared.parameters.iter().map(|parameter| parameter.value);
        parameters.as_mut_slice().iter_mut().zip(values).for_each(|(place, value)| *place = value);
        let signals = Values::zeros(declared.signals.len());
        let is_changed = !declared.parameters.is_empty();
        Ok(Self { settings: Arc::new(Settings::new(declared)), parameters, signals, is_changed })
    }

    /// The parameters as their user wants them.
    pub fn settings(&self) -> &Arc<Settings> {
        &self.settings
    }

    /// The parameters in force.
    pub fn parameters(&self) -> &[f64] {
        self.parameters.as_slice()
    }

    /// The signals, to be filled.
    pub fn signals_mut(&mut self) -> &mut [f64] {
        self.signals.as_mut_slice()
    }

    /// The signals of a cycle, if any are declared.
    pub fn signals(&self) -> Option<Values> {
        (self.signals.length > 0).then_some(self.signals)
    }

    /// Takes over one parameter that is set otherwise than it is in force: at most one a cycle, so that the work of a cycle
    /// is bounded.
    pub fn take_change(&mut self) -> Option<Change> {
        let changed = |(place, value): (usize, &f64)| {
            let to = self.settings.value(place);
            (to.to_bits() != value.to_bits()).then_some(Change { place, from: *value, to })
        };
        let change = self.parameters.as_slice().iter().enumerate().find_map(changed)?;
        self.parameters.values[change.place] = change.to;
        self.is_changed = true;
        Some(change)
    }

    /// The parameters, once after the start and once after each change.
    pub fn take_changed_parameters(&mut self) -> Option<Values> {
        std::mem::take(&mut self.is_changed).then_some(self.parameters)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with_signals(names: &[&str]) -> Declared {
        let signal =
            |name: &&str| Signal { name: (*name).to_owned(), unit: String::new(), about: String::new() };
        Declared { signals: names.iter().map(signal).collect(), ..Declared::default() }
    }

    #[test]
    fn names_that_no_recording_can_have_are_refused() {
        for bad in ["", "Gain", "1st", "a b", "a__b", "a_", "cycle", "grün", &"a".repeat(49)] {
            assert_eq!(with_signals(&[bad]).check(), Err(NameError::BadName(bad.to_owned())), "{bad}");
        }
        let refusal = with_signals(&[&"\u{1b}[2J".repeat(10_000)]).check().unwrap_err().to_string();
        assert!(is_printable(&refusal, 400), "{refusal}");
        assert_eq!(with_signals(&["a", "b", "a"]).check(), Err(NameError::Twice("a".to_owned())));
        let many: Vec<_> = (0..65).map(|number| format!("s{number}")).collect();
        let many: Vec<_> = many.iter().map(String::as_str).collect();
        assert_eq!(with_signals(&many).check(), Err(NameError::TooMany(65, "signals")));
        assert_eq!(with_signals(&many[..64]).check(), Ok(()));
    }

    #[test]
    fn texts_that_would_command_a_terminal_or_fill_a_schema_are_refused() {
        let with = |unit: &str, about: &str| {
            let signal = Signal { name: "grip".to_owned(), unit: unit.to_owned(), about: about.to_owned() };
            let parameter = Parameter {
                unit: unit.to_owned(),
                about: about.to_owned(),
                range: [0.0, 1.0],
                ..Parameter::new("gain", 1.0)
            };
            let signals = Declared { signals: vec![signal], ..Declared::default() };
            [signals, Declared { parameters: vec![parameter], ..Declared::default() }]
        };
        for declared in with("µm/s²", "Length of the <correction> \"so far\".") {
            assert_eq!(declared.check(), Ok(()));
        }
        for hostile in ["m\nfloat64 evil", "\u{1b}[31m", "\0", "\u{202e}", "\u{2028}", "\u{9b}2J", "\r"] {
            for declared in with(hostile, "").into_iter().chain(with("", hostile)) {
                let error = declared.check().unwrap_err();
                assert!(matches!(error, NameError::Unprintable { .. }), "{error}");
                assert!(is_printable(&error.to_string(), 300), "{error}");
            }
        }
        let [long, _] = with(&"m".repeat(49), "");
        assert!(long.check().unwrap_err().to_string().contains("at most 48 bytes"));
    }

    #[test]
    fn all_texts_together_take_64_kibibytes() {
        let of = |about: usize| {
            let signal = |number| Signal {
                name: format!("s{number:02}"),
                unit: "mm".to_owned(),
                about: "x".repeat(about - 5),
            };
            Declared { signals: (0..64).map(signal).collect(), ..Declared::default() }
        };
        assert_eq!(of(1024).check(), Ok(()));
        assert_eq!(of(1025).check(), Err(NameError::TooLong(65_600)));
    }

    #[test]
    fn a_value_lies_within_its_range() {
        let gain = |value, range| Declared {
            parameters: vec![Parameter { range, ..Parameter::new("gain", value) }],
            ..Declared::default()
        };
        assert_eq!(gain(0.0, [0.0, 1.0]).check(), Ok(()));
        for value in [-0.1, 1.1, f64::NAN, f64::INFINITY] {
            let error = gain(value, [0.0, 1.0]).check().unwrap_err();
            assert!(matches!(error, NameError::OutOfRange { .. }), "{error}");
        }
        for range in [[1.0, 0.0], [f64::NAN, 1.0], [0.0, f64::INFINITY]] {
            assert_eq!(gain(0.5, range).check(), Err(NameError::BadRange("gain".to_owned())));
        }
    }

    #[test]
    fn a_scenario_sets_declared_parameters_only() {
        let declared = Declared { parameters: vec![Parameter::new("gain", 1.0)], ..Declared::default() };
        let set = declared.clone().with(&BTreeMap::from([("gain".to_owned(), 4.0)])).unwrap();
        assert!((set.parameters[0].value - 4.0).abs() < f64::EPSILON);
        let error = declared.with(&BTreeMap::from([("mass".to_owned(), 4.0)])).unwrap_err();
        assert_eq!(error.to_string(), "the controller has no parameter 'mass', but: gain");
    }

    #[test]
    fn a_cycle_takes_one_change_over() {
        let parameters = ["a", "b"].map(|name| Parameter { range: [0.0, 9.0], ..Parameter::new(name, 1.0) });
        let declared = Declared { parameters: parameters.to_vec(), ..Declared::default() };
        let mut named = NamedValues::new(declared, &BTreeMap::new()).unwrap();
        assert_eq!(named.take_changed_parameters().unwrap().as_slice(), [1.0, 1.0]);
        assert_eq!((named.take_change(), named.take_changed_parameters()), (None, None));
        let settings = Arc::clone(named.settings());
        settings.set("b", 5.0).unwrap();
        settings.set("a", 4.0).unwrap();
        assert!(settings.set("a", 10.0).is_err() && settings.set("c", 1.0).is_err());
        assert_eq!(named.take_change(), Some(Change { place: 0, from: 1.0, to: 4.0 }));
        assert_eq!(named.take_changed_parameters().unwrap().as_slice(), [4.0, 1.0]);
        assert_eq!(named.take_change(), Some(Change { place: 1, from: 1.0, to: 5.0 }));
        assert_eq!(named.take_change(), None);
    }
}
