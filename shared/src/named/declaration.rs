//! What a controller names: checked before the start, and kept beside the recording.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::messages::MOST_VALUES;
use crate::wording::nearest;

/// Characters of the longest name.
const LONGEST_NAME: usize = 48;
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

/// The signals and parameters of a controller, each in the order of its values.
///
/// ```
/// use masseter_shared::named::{Declared, Parameter, Signal};
///
/// let declared = Declared {
///     signals: vec![Signal { name: "trim".into(), unit: "mm".into(), about: "Length of the correction.".into() }],
///     parameters: vec![Parameter { range: [0.0, 10.0], ..Parameter::new("gain", 3.0) }],
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
}

/// Why a name or a value is refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NameError {
    /// A recording could not have the name.
    #[error(
        "'{0}' is no name of a signal or parameter: use up to {LONGEST_NAME} lower-case letters, digits and single '_', \
         beginning with a letter, and none of seq, published_ns, version, cycle, length"
    )]
    BadName(String),
    /// Two have one name.
    #[error("two signals, or two parameters, are named '{0}'")]
    Twice(String),
    /// There are too many.
    #[error("{0} {1} are too many: a controller has up to {MOST_VALUES}")]
    TooMany(usize, &'static str),
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
    #[error("the controller has no parameter '{name}'{}", others(.name, .parameters))]
    Unknown {
        /// The name.
        name: String,
        /// The parameters that there are.
        parameters: Vec<String>,
    },
}

fn others(name: &str, parameters: &[String]) -> String {
    let likely = nearest(name, parameters.iter().map(String::as_str));
    let question = likely.map_or_else(String::new, |likely| format!("; did you mean '{likely}'?"));
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
        check_names(&self.signals.iter().map(|signal| &*signal.name).collect::<Vec<_>>(), "signals")?;
        check_names(&self.names(), "parameters")?;
        for parameter in &self.parameters {
            let [least, most] = parameter.range;
            if !(least.is_finite() && most.is_finite() && least <= most) {
                return Err(NameError::BadRange(parameter.name.clone()));
            }
            parameter.check(parameter.value)?;
        }
        Ok(())
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

fn check_names(names: &[&str], kind: &'static str) -> Result<(), NameError> {
    if names.len() > MOST_VALUES {
        return Err(NameError::TooMany(names.len(), kind));
    }
    if let Some(bad) = names.iter().find(|name| !is_name(name)) {
        return Err(NameError::BadName((*bad).to_owned()));
    }
    let mut seen = BTreeSet::new();
    names
        .iter()
        .find(|name| !seen.insert(**name))
        .map_or(Ok(()), |name| Err(NameError::Twice((*name).to_owned())))
}

/// Whether a field of a ROS 2 message may have this name.
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
        Declared { signals: names.iter().map(signal).collect(), parameters: Vec::new() }
    }

    #[test]
    fn names_that_no_recording_can_have_are_refused() {
        for bad in ["", "Gain", "1st", "a b", "a__b", "a_", "cycle", "grün", &"a".repeat(49)] {
            assert_eq!(with_signals(&[bad]).check(), Err(NameError::BadName(bad.to_owned())), "{bad}");
        }
        assert_eq!(with_signals(&["a", "b", "a"]).check(), Err(NameError::Twice("a".to_owned())));
        let many: Vec<_> = (0..65).map(|number| format!("s{number}")).collect();
        let many: Vec<_> = many.iter().map(String::as_str).collect();
        assert_eq!(with_signals(&many).check(), Err(NameError::TooMany(65, "signals")));
        assert_eq!(with_signals(&many[..64]).check(), Ok(()));
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
