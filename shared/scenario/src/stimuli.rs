//! Stimuli of the jaw, the food and the controller during the motion: `[[stimulus]]`.

use std::fmt::{self, Display, Formatter};
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use masseter_model::section::Range;

use super::error::{Checked, LONGEST_S, ScenarioError, ranges_of, require, require_name, require_range};
use super::jaw::{FoodConfig, ToothConfig, over_food};
use super::quantity::{Dimension, Quantity};
use super::when::{EntryNames, When, WhenKeys};

/// The course of a stimulus between its beginning and its end.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// Its whole size at once.
    #[default]
    Step,
    /// Growing evenly, up to its whole size at the end.
    Ramp,
    /// Half a period of a sine: grows and fades.
    HalfSine,
    /// A sine of `frequency_hz`.
    Sine,
}

impl Shape {
    /// The share of the whole size, −1 to 1, after `since_s` of `for_s`.
    ///
    /// ```
    /// use masseter_scenario::Shape;
    ///
    /// assert_eq!(Shape::Ramp.at(0.05, 0.2, 0.0), 0.25);
    /// assert_eq!(Shape::HalfSine.at(0.1, 0.2, 0.0), 1.0);
    /// ```
    #[inline]
    pub fn at(self, since_s: f64, for_s: f64, frequency_hz: f64) -> f64 {
        use std::f64::consts::PI;
        match self {
            Self::Step => 1.0,
            Self::Ramp => (since_s / for_s).min(1.0),
            Self::HalfSine => (PI * since_s / for_s).sin(),
            Self::Sine => (2.0 * PI * frequency_hz * since_s).sin(),
        }
    }
}

keys! {
    /// One stimulus. Exactly one of a push, `food`, `payload`, `parameter` and `stop` says what happens. A push is `push_n`,
    /// `torque_n_m` or both; or `push_table`.
    #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct StimulusConfig {
        /// Name in requirements and in `after`; by default `push`, `food`, `payload`, `parameter` or `stop`.
        pub name: Option<String> => "1 to 64 lower-case letters, digits, `_`",
        /// Beginning, since the motion began or since `after`.
        pub at_s: f64 => NotNegative,
        /// What `at_s` counts from.
        pub after: Option<String> => "`fault.NAME`, `stimulus.NAME`, `controller.STATE`; no circle",
        /// How long; by default to the end of the run, or of the table.
        pub for_s: Option<f64> => UpTo(LONGEST_S) "not of `parameter`, `stop`",
        /// Course of a push.
        #[serde(default)]
        pub shape: Shape => "not of `push_table`",
        /// Frequency of a sine.
        pub frequency_hz: Option<f64> => Within(0.01, 1000.0) "of a `sine`",
        /// Force on the jaw, in base axes.
        pub push_n: Option<[f64; 3]> => Within(-2000.0, 2000.0),
        /// Torque on the jaw, in base axes.
        pub torque_n_m: Option<[f64; 3]> => Within(-200.0, 200.0),
        /// File with the force, or force and torque, over time; relative to the scenario's folder.
        pub push_table: Option<PathBuf> => "UTF-8",
        /// Where the force acts, in the platform frame; by default the incisal point.
        pub point_m: Option<[f64; 3]> => Within(-0.5, 0.5) "of a force",
        /// Another food from then on.
        #[serde(default, deserialize_with = "over_food")]
        pub food: Option<FoodConfig> => "the keys of `[food]`",
        /// Mass that the platform carries at the incisal point.
        pub payload: Option<Quantity> => "0 to 20 kg, such as `\"0.2 kg\"`",
        /// The name of a parameter of the controller, which gets `value`.
        pub parameter: Option<String> => "a parameter of the controller",
        /// The parameter's value.
        pub value: Option<f64> => "the parameter's range; required of `parameter`",
        /// The operator asks for an orderly stop, as by Ctrl-C.
        #[serde(default)]
        pub stop: bool,
    }
}

/// What happens, as `push`.
impl Display for StimulusConfig {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(self.what().unwrap_or("nothing"))
    }
}

impl StimulusConfig {
    /// Size of the largest table, bytes: more than an hour at 50 Hz.
    pub const MOST_TABLE_BYTES: u64 = 16 << 20;

    /// A stimulus at that time of the motion, without an effect.
    pub fn at(at_s: f64) -> Self {
        Self { at_s, ..Self::default() }
    }

    /// Its name in requirements.
    pub fn name(&self) -> &str {
        self.name.as_deref().or(self.what()).unwrap_or("nothing")
    }

    /// The kind of the stimulus; none unless there is exactly one.
    fn what(&self) -> Option<&'static str> {
        let given = [
            (self.push_n.is_some() || self.torque_n_m.is_some(), "push"),
            (self.push_table.is_some(), "push"),
            (self.food.is_some(), "food"),
            (self.payload.is_some(), "payload"),
            (self.parameter.is_some(), "parameter"),
            (self.stop, "stop"),
        ];
        let mut given = given.into_iter().filter(|(is_given, _)| *is_given);
        given.next().map(|(_, what)| what).filter(|_| given.next().is_none())
    }

    /// Whether the controller carries the stimulus out; otherwise the plant.
    pub fn is_of_controller(&self) -> bool {
        self.stop || self.parameter.is_some()
    }

    /// Whether it pushes without a force and a torque, or adds no mass.
    pub fn changes_nothing(&self) -> bool {
        let is_zero =
            |vector: Option<[f64; 3]>| vector.is_none_or(|vector| vector.iter().all(|number| *number == 0.0));
        match self.what() {
            Some("push") => self.push_table.is_none() && is_zero(self.push_n) && is_zero(self.torque_n_m),
            Some("payload") => self.payload.is_some_and(|payload| payload.si() == 0.0),
            _ => false,
        }
    }

    /// The time of the stimulus.
    ///
    /// # Errors
    /// For a time that names no entry of the scenario.
    pub fn when(&self, entries: &EntryNames<'_>) -> Result<When, ScenarioError> {
        let (at_s, after) = (Some(self.at_s), self.after.as_deref());
        let keys = WhenKeys { at_s, after, for_s: self.for_s, from_s: None, until_s: None };
        keys.resolve(entries).map_err(|refusal| refusal.in_table("stimulus"))
    }

    pub(super) fn validate(&self, entries: &EntryNames<'_>, arch: &[ToothConfig]) -> Checked {
        self.when(entries)?;
        self.name.as_ref().map_or(Ok(()), |name| require_name("stimulus.name", name))?;
        let Some(what) = self.what() else {
            let need = "give exactly one of push_n and torque_n_m, push_table, food, payload, parameter, stop = true";
            return Err(ScenarioError::bad("stimulus.push_n", &"none or several", need));
        };
        let (has_force, is_table) = (self.push_n.is_some(), self.push_table.is_some());
        let keys = [
            ("stimulus.point_m", self.point_m.is_some(), has_force || is_table),
            ("stimulus.shape", self.shape != Shape::Step, what == "push" && !is_table),
            ("stimulus.frequency_hz", self.frequency_hz.is_some(), self.shape == Shape::Sine),
            ("stimulus.value", self.value.is_some(), what == "parameter"),
            ("stimulus.for_s", self.for_s.is_some(), what != "stop" && what != "parameter"),
        ];
        keys.into_iter().try_for_each(|(key, is_given, has_effect)| {
            require(has_effect || !is_given, key, &"given", "leave it away: it has no effect here")
        })?;
        let has_end = matches!(self.shape, Shape::Step | Shape::Sine) || self.for_s.is_some();
        let need = "give the time in which the shape comes to its end";
        require(has_end, "stimulus.for_s", &"none", need)?;
        let has_frequency = self.shape != Shape::Sine || self.frequency_hz.is_some();
        require(has_frequency, "stimulus.frequency_hz", &"none", "give the frequency of the sine")?;
        let has_value = what != "parameter" || self.value.is_some();
        require(has_value, "stimulus.value", &"none", "give the value that the parameter gets")?;
        self.require_ranges()?;
        self.food.as_ref().map_or(Ok(()), |food| food.validate(arch))
    }

    fn require_ranges(&self) -> Checked {
        self.check_ranges(ranges_of("stimulus"))?;
        if let Some(payload) = self.payload {
            let kg = payload.si_of(Dimension::Mass);
            let kg = kg.map_err(|need| ScenarioError::bad("stimulus.payload", &payload, need))?;
            require_range("stimulus.payload", Range::Within(0.0, 20.0), kg)?;
        }
        let is_number = self.value.is_none_or(f64::is_finite);
        require(is_number, "stimulus.value", &"not finite", "use a finite number")
    }
}
