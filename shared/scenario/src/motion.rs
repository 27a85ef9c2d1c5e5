//! The motion of the jaw: `[motion]`.
//!
//! The jaw frame has its origin at the incisal point, x anterior, y left, z up; the upper jaw is fixed. Every motion is
//! a displacement from the closed (intercuspal) pose. The trajectory checks the ranges. Defaults are figures of
//! published studies, with references in the generators.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use serde_json::json;

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

/// The unit of a recording's times.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TimeUnit {
    /// Seconds.
    S,
    /// Milliseconds.
    Ms,
    /// Microseconds.
    Us,
}

/// The unit of a recording's lengths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LengthUnit {
    /// Micrometres.
    Um,
    /// Millimetres.
    Mm,
    /// Centimetres.
    Cm,
    /// Metres.
    M,
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

/// The unit of a recording's angles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AngleUnit {
    /// Degrees.
    Deg,
    /// Radians.
    Rad,
}

keys! {
    /// A recorded motion of the lower jaw, as a tracker writes it.
    ///
    /// The names of the columns decide the content: poses relative to the closed pose, or markers, the first row closed.
    /// The plain forms are `time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz` and `time_s,m1_x_mm,…,m3_z_mm`.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct FileConfig {
        /// The file, relative to the scenario's folder.
        pub path: PathBuf => "text in UTF-8, UTF-16 or Windows-1252, or C3D",
        /// The file's axes that point anterior, left and up.
        #[serde(default = "FileConfig::default_axes")]
        pub axes: [String; 3] => "signed axes, right-handed",
        /// Whether a file whose ways, turns, speeds or axes are no jaw's is refused, or played with a warning.
        #[serde(default = "FileConfig::default_if_implausible")]
        pub if_implausible: IfImplausible,
        /// Only for poses: their point of reference, in the jaw frame at the closed pose; by default the midpoint between
        /// the condyles.
        pub reference_point_mm: Option<[f64; 3]> => "finite",
        /// Only for markers: the incisal point at the closed pose, in the file's coordinates; by default the markers'
        /// centroid.
        pub marker_origin_mm: Option<[f64; 3]> => "finite",
        /// A name for each column in the place of the file's own names, `-` for a column without use; by default those
        /// of the file's header.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub columns: Option<Vec<String>> => "one for each column",
        /// Only for markers: the names of those on the lower jaw; by default all.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub markers: Option<Vec<String>> => "three to twelve names of the file",
        /// The unit of times, in the place of the file's.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub time_unit: Option<TimeUnit>,
        /// The unit of lengths, in the place of the file's.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub length_unit: Option<LengthUnit>,
        /// Only for three angles: their unit, in the place of the file's.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub angle_unit: Option<AngleUnit>,
        /// Only for three angles: the axes of the file in the order of the turns. Capitals turn about the axes that move
        /// with the jaw, small letters about fixed axes.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub euler_order: Option<String> => "each of x, y, z once, such as `XYZ` or `xyz`",
        /// Only for files without times: rows, or numbered frames, a second.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub rate_hz: Option<f64> => Within(4.0, 10_000.0),
        /// Cut-off frequency of the zero-phase low-pass filter; 0 for none.
        #[serde(default = "FileConfig::default_lowpass_hz")]
        pub lowpass_hz: f64 => "0, or 0.5 to 50",
    }
}

impl FileConfig {
    /// Size of the largest file, bytes: more than an hour of three markers at 200 Hz.
    pub const MOST_BYTES: u64 = 256 << 20;

    /// A file read by its header, with the default axes, reference point and low-pass.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        let unnamed: Self =
            serde_json::from_value(json!({ "path": "" })).expect("a path alone is a recording");
        Self { path: path.into(), ..unnamed }
    }

    fn default_axes() -> [String; 3] {
        ["+x", "+y", "+z"].map(String::from)
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
