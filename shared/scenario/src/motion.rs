//! The motion of the jaw: `[motion]`.
//!
//! The jaw frame has its origin at the incisal point, x anterior, y left, z up; the upper jaw is fixed. Every motion is
//! a displacement from the closed (intercuspal) pose. The trajectory checks the ranges. Defaults are figures of
//! published studies, with references in the generators.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// A side of the jaw, from the patient's view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JawSide {
    /// +y.
    Left,
    /// −y.
    Right,
}

impl JawSide {
    /// +1 for left, −1 for right: the sign of y on this side.
    pub fn sign(self) -> f64 {
        match self {
            Self::Left => 1.0,
            Self::Right => -1.0,
        }
    }
}

/// The desired motion of the jaw.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum MotionConfig {
    /// Cyclic chewing on one side.
    Chewing(ChewingConfig),
    /// Symmetric opening and closing.
    Opening(OpeningConfig),
    /// Both condyles forward and back.
    Protrusion(ProtrusionConfig),
    /// Excursion to one side and back.
    Lateral(LateralConfig),
    /// A recorded motion.
    File(FileConfig),
}

impl MotionConfig {
    /// The rig's controller gives up a motion after this many of its durations, at any speed.
    pub const MOST_DURATIONS: f64 = 10.0;
}

impl Default for MotionConfig {
    fn default() -> Self {
        Self::Chewing(ChewingConfig::default())
    }
}

section! {
    /// Chewing: a tear-drop loop of the incisal point, once a cycle.
    #[derive(Copy)]
    pub struct ChewingConfig {
        /// Chewing cycles per second.
        pub cycle_rate_hz: f64 = 1.43 => UpTo(10.0),
        /// Shares of a cycle; together 1.
        pub phases: PhaseShares = PhaseShares::default(),
        /// Downward amplitude of the incisal point.
        pub vertical_mm: f64 = 18.0 => Within(0.0, 60.0),
        /// Amplitude towards the working side.
        pub lateral_mm: f64 = 4.0 => Within(0.0, 15.0),
        /// Backward movement on the way down.
        pub anterior_posterior_mm: f64 = 5.0 => Within(-15.0, 40.0),
        /// Working side, from the patient's view.
        pub side: JawSide = JawSide::Left,
        /// Inclination of the condylar path below the horizontal.
        pub condylar_inclination_deg: f64 = 40.0 => Within(0.0, 80.0),
        /// Inward turn of the balancing condyle's path.
        pub bennett_angle_deg: f64 = 8.0 => Within(0.0, 45.0),
    }
}

section! {
    /// How a motion's cycle divides into going out, coming back and resting at the closed pose.
    #[derive(Copy)]
    pub struct PhaseShares {
        /// Share of the cycle in which the jaw leaves the closed pose.
        pub opening: f64 = 0.43 => Positive,
        /// Share of the cycle in which it returns.
        pub closing: f64 = 0.40 => Positive,
        /// Share of the cycle in which it stays closed.
        pub occlusion: f64 = 0.17 => NotNegative,
    }
}

section! {
    /// Symmetric opening: the condyles glide forward in proportion to the opening angle.
    #[derive(Copy)]
    pub struct OpeningConfig {
        /// Largest distance of the incisal point from its closed position.
        pub amplitude_mm: f64 = 35.0 => NotNegative "as far as the jaw opens",
        /// Openings per second.
        pub cycle_rate_hz: f64 = 0.5 => UpTo(10.0),
        /// Shares of a cycle; together 1.
        pub phases: PhaseShares = PhaseShares::default(),
        /// Inclination of the condylar path below the horizontal.
        pub condylar_inclination_deg: f64 = 40.0 => Within(0.0, 80.0),
    }
}

section! {
    /// Protrusion: the jaw glides along the condylar path without turning.
    #[derive(Copy)]
    pub struct ProtrusionConfig {
        /// Length of the glide.
        pub amplitude_mm: f64 = 9.0 => Within(0.0, 15.0),
        /// Protrusions per second.
        pub cycle_rate_hz: f64 = 0.5 => UpTo(10.0),
        /// Shares of a cycle; together 1.
        pub phases: PhaseShares = PhaseShares::default(),
        /// Inclination of the condylar path below the horizontal.
        pub condylar_inclination_deg: f64 = 40.0 => Within(0.0, 80.0),
    }
}

section! {
    /// Lateral excursion: the balancing condyle advances, the working condyle only shifts sideways.
    #[derive(Copy)]
    pub struct LateralConfig {
        /// Sideways amplitude of the incisal point.
        pub amplitude_mm: f64 = 8.0 => NotNegative "as far as the jaw turns",
        /// Working side: the jaw moves to it.
        pub side: JawSide = JawSide::Left,
        /// Excursions per second.
        pub cycle_rate_hz: f64 = 0.5 => UpTo(10.0),
        /// Shares of a cycle; together 1.
        pub phases: PhaseShares = PhaseShares::default(),
        /// Inclination of the condylar path below the horizontal.
        pub condylar_inclination_deg: f64 = 40.0 => Within(0.0, 80.0),
        /// Inward turn of the balancing condyle's path.
        pub bennett_angle_deg: f64 = 8.0 => Within(0.0, 45.0),
    }
}

/// The unit of a recording's lengths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LengthUnit {
    /// Millimetres, as the header says.
    Mm,
    /// Centimetres.
    Cm,
    /// Metres.
    M,
}

impl LengthUnit {
    /// All units.
    pub const ALL: [Self; 3] = [Self::Mm, Self::Cm, Self::M];

    /// Its name, as in a scenario.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mm => "mm",
            Self::Cm => "cm",
            Self::M => "m",
        }
    }

    /// Millimetres in one.
    pub fn mm(self) -> f64 {
        match self {
            Self::Mm => 1.0,
            Self::Cm => 10.0,
            Self::M => 1000.0,
        }
    }
}

/// The unit of a recording's times.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TimeUnit {
    /// Seconds, as the header says.
    S,
    /// Milliseconds.
    Ms,
}

impl TimeUnit {
    /// All units.
    pub const ALL: [Self; 2] = [Self::S, Self::Ms];

    /// Its name, as in a scenario.
    pub fn name(self) -> &'static str {
        match self {
            Self::S => "s",
            Self::Ms => "ms",
        }
    }

    /// A time in this unit, in seconds.
    pub fn seconds(self, time: f64) -> f64 {
        match self {
            Self::S => time,
            Self::Ms => time / 1000.0,
        }
    }
}

/// What becomes of a recording that is no motion of a jaw.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IfImplausible {
    /// The recording is refused.
    Refuse,
    /// The recording is played with a warning.
    Warn,
}

keys! {
    /// A recorded motion of the lower jaw, as CSV.
    ///
    /// The header decides the format: `time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz` (pose relative to the closed
    /// pose) or `time_s,m1_x_mm,…,m3_z_mm` (three markers, the first row closed).
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct FileConfig {
        /// The file, relative to the scenario's folder.
        pub path: PathBuf => "text in UTF-8, UTF-16 or Windows-1252",
        /// The file's axes that point anterior, left and up.
        #[serde(default = "FileConfig::default_axes")]
        pub axes: [String; 3] => "signed axes, right-handed",
        /// The unit of the file's lengths, whatever the header says.
        #[serde(default = "FileConfig::default_length_unit")]
        pub length_unit: LengthUnit,
        /// The unit of the file's times, whatever the header says.
        #[serde(default = "FileConfig::default_time_unit")]
        pub time_unit: TimeUnit,
        /// Whether a file whose ways, turns, speeds or axes are no jaw's is refused, or played with a warning.
        #[serde(default = "FileConfig::default_if_implausible")]
        pub if_implausible: IfImplausible,
        /// Only for poses: their point of reference, in the jaw frame at the closed pose; by default the midpoint between
        /// the condyles.
        pub reference_point_mm: Option<[f64; 3]> => "finite",
        /// Only for markers: the incisal point at the closed pose, in the file's coordinates; by default the markers'
        /// centroid.
        pub marker_origin_mm: Option<[f64; 3]> => "finite",
        /// Cut-off frequency of the zero-phase low-pass filter; 0 for none.
        #[serde(default = "FileConfig::default_lowpass_hz")]
        pub lowpass_hz: f64 => "0, or 0.5 to 50",
    }
}

impl FileConfig {
    /// Size of the largest file, bytes: more than an hour of three markers at 200 Hz.
    pub const MOST_BYTES: u64 = 256 << 20;

    /// A file read with the default axes, reference point and low-pass.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self {
            path: path.into(),
            axes: Self::default_axes(),
            length_unit: Self::default_length_unit(),
            time_unit: Self::default_time_unit(),
            if_implausible: Self::default_if_implausible(),
            reference_point_mm: None,
            marker_origin_mm: None,
            lowpass_hz: Self::default_lowpass_hz(),
        }
    }

    fn default_axes() -> [String; 3] {
        ["+x", "+y", "+z"].map(String::from)
    }

    fn default_length_unit() -> LengthUnit {
        LengthUnit::Mm
    }

    fn default_time_unit() -> TimeUnit {
        TimeUnit::S
    }

    fn default_if_implausible() -> IfImplausible {
        IfImplausible::Refuse
    }

    fn default_lowpass_hz() -> f64 {
        12.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_alone_takes_every_default() {
        let motion: MotionConfig = toml::from_str("kind = 'chewing'").unwrap();
        assert_eq!(motion, MotionConfig::default());
        let motion: MotionConfig = toml::from_str("kind = 'file'\npath = 'jaw.csv'").unwrap();
        assert_eq!(motion, MotionConfig::File(FileConfig::new("jaw.csv")));
    }

    #[test]
    fn an_unknown_key_is_named() {
        for text in ["kind = 'opening'\namplitude = 35.0", "kind = 'file'\npath = 'a'\nlowpass = 1.0"] {
            let error = toml::from_str::<MotionConfig>(text).unwrap_err().to_string();
            assert!(error.contains("unknown field"), "{error}");
        }
    }
}
