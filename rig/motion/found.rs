//! What is found in a recorded motion.

use std::path::PathBuf;

use masseter_controller::trajectory::RecordingSurvey;
use serde::Serialize;

use super::strokes::Strokes;
use super::suggestion::Suggestion;

/// What the verb finds.
#[derive(Debug, Serialize)]
pub(super) struct Found {
    pub file: PathBuf,
    #[serde(flatten)]
    pub survey: RecordingSurvey,
    pub strokes: Option<Strokes>,
    /// Why the rig would not play it.
    pub refused: Option<String>,
    pub suggestion: Option<Suggestion>,
}
