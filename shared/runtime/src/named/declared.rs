//! The declaration of a controller: its signals, its parameters, and its motion.

use std::collections::{BTreeMap, BTreeSet};

use masseter_scenario::input::{excerpt, is_printable};
use masseter_scenario::wording::{question, shortest};
use serde::{Deserialize, Serialize};

use crate::messages::MOST_VALUES;

/// Characters of the longest name.
const LONGEST_NAME: usize = 48;
/// Bytes of the longest unit.
const LONGEST_UNIT: usize = 48;
/// Bytes of all texts of a declaration together.
const MOST_TEXT_BYTES: usize = 64 << 10;
/// The fields beside the named values in a recorded message.
const TAKEN: [&str; 5] = ["seq", "published_ns", "version", "cycle", "length"];

/// A number that the controller publishes in each cycle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Signal {
    /// Its name, in lower case, such as `grip_force`.
    pub name: String,
    /// Its unit, such as `mm`; empty for none.
    pub unit: String,
    /// Its meaning.
    pub about: String,
}

/// A number that the user sets, at any time of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Its name, in lower case, such as `gain`.
    pub name: String,
    /// Its unit, such as `1/s`; empty for none.
    pub unit: String,
    /// Its meaning.
    pub about: String,
    /// Its value at the start.
    pub value: f64,
    /// Its smallest and largest value.
    pub range: [f64; 2],
}

impl Parameter {
    /// A parameter with this value, without unit and range. Other fields are for the caller.
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
    /// [`NameError::OutOfRange`], also for a value that is no number.
    pub fn check(&self, value: f64) -> Result<(), NameError> {
        let [least, most] = self.range;
        if (least..=most).contains(&value) {
            return Ok(());
        }
        let (name, unit) = (self.name.clone(), self.unit.clone());
        Err(NameError::OutOfRange { name, value, least, most, unit })
    }
}

/// The motion of a controller.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlayedMotion {
    /// The scenario's motion: checks compare its desired poses with those of the scenario.
    #[default]
    Scenario,
    /// One of its own: at least one requirement of the scenario must judge the true jaw.
    Own,
}

/// The declaration of a controller: its signals and parameters, each in the order of its values, and its motion.
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

/// The reason for the refusal of a name or a value.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NameError {
    /// The name is not valid in a recording.
    #[error(
        "'{}' is no name of a signal or parameter: use up to {LONGEST_NAME} lower-case letters, digits and single '_', \
         beginning with a letter, and none of seq, published_ns, version, cycle, length", excerpt(.0)
    )]
    BadName(String),
    /// Two signals or parameters have one name.
    #[error("two signals, or two parameters, are named '{0}'")]
    Twice(String),
    /// Too many signals or parameters.
    #[error("{0} {1} are too many: a controller has up to {MOST_VALUES}")]
    TooMany(usize, &'static str),
    /// A unit or a description is not fit for display.
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
    /// A range is no range, or is infinite.
    #[error(
        "parameter '{0}' has no valid range: give a smallest number, and a largest one that is not below it"
    )]
    BadRange(String),
    /// The value is beyond the parameter's range.
    #[error(
        "parameter '{name}' cannot be {}: its range is {} to {} {unit}",
        shortest(*.value), shortest(*.least), shortest(*.most)
    )]
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
    /// The parameter is unknown.
    #[error("the controller has no parameter '{}'{}", excerpt(.name), others(.name, .parameters))]
    Unknown {
        /// The name.
        name: String,
        /// The declared parameters.
        parameters: Vec<String>,
    },
}

impl NameError {
    /// The signal or parameter at fault, if any.
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
    /// Refuses declarations that are not valid in a recording, and parameters with a value beyond their range.
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

    /// Schemas, pages and terminals show the texts.
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

    /// The declaration with the start values of a scenario.
    ///
    /// # Errors
    /// [`NameError`] for an undeclared parameter, or a value beyond its range.
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

/// Whether the name is valid for a field of a ROS 2 message.
fn is_name(name: &str) -> bool {
    let has_form = name.len() <= LONGEST_NAME
        && name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.bytes().all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_');
    has_form && !name.ends_with('_') && !name.contains("__") && !TAKEN.contains(&name)
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
}
