//! Something of a drive that is not as scenario and profile need it, and what would mend that.

use masseter_can::canopen::ObjectAddress;
use serde::Serialize;

use super::wording::object_name;

/// What becomes of a deviation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// `configure` mends it.
    Mended,
    /// Somebody should look at it; it stops nothing.
    Doubtful,
    /// `configure` cannot mend it and refuses.
    Refused,
}

/// One deviation.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Deviation {
    /// The object, such as `6066h:00h`.
    pub object: String,
    /// Its name.
    pub name: &'static str,
    /// The value that the rig needs.
    pub wanted: String,
    /// The value of the drive.
    pub found: String,
    /// What becomes of it.
    pub outcome: Outcome,
    /// What `configure` would do, or what the user should.
    pub remedy: String,
    /// The key of the scenario that decides.
    pub key: String,
}

impl Deviation {
    /// A deviation of an object: its value as wanted and as found, in words.
    pub(super) fn new(
        object: ObjectAddress,
        [wanted, found]: [String; 2],
        outcome: Outcome,
        remedy: &str,
        key: &str,
    ) -> Self {
        let (name, remedy, key) = (object_name(object), remedy.to_owned(), key.to_owned());
        Self { object: object.to_string(), name, wanted, found, outcome, remedy, key }
    }
}
