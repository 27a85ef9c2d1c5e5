//! One deviation of a drive from scenario and profile. [`deviations`](crate::deviations) finds them.

use std::fmt::Display;

use masseter_can::canopen::ObjectAddress;
use serde::{Serialize, Serializer};

use crate::object_words::object_name;

/// The consequence of a deviation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// `configure` mends the deviation.
    Mended,
    /// A person should look at the deviation, which stops nothing.
    Doubtful,
    /// `configure` cannot mend the deviation, and refuses.
    Refused,
}

/// One deviation.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Deviation {
    /// The object.
    #[serde(serialize_with = "as_text")]
    pub object: ObjectAddress,
    /// Its name.
    pub name: &'static str,
    /// The value that the rig needs.
    pub wanted: String,
    /// The value of the drive.
    pub found: String,
    /// Its consequence.
    pub outcome: Outcome,
    /// The action of `configure`, or the advice to the user.
    pub remedy: String,
    /// The key of the scenario that decides.
    pub key: String,
}

impl Deviation {
    /// The wanted and the found value of an object, in words.
    pub(crate) fn new(
        object: ObjectAddress,
        wanted: impl Into<String>,
        found: impl Into<String>,
        outcome: Outcome,
        remedy: impl Into<String>,
        key: &str,
    ) -> Self {
        let (name, wanted, found) = (object_name(object), wanted.into(), found.into());
        Self { object, name, wanted, found, outcome, remedy: remedy.into(), key: key.to_owned() }
    }
}

/// Serialises a value in its printed form, such as `6066h:00h`.
pub(crate) fn as_text<S: Serializer>(value: &impl Display, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(value)
}
