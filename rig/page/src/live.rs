//! What only the page of a run that goes on has: the state at this moment, and parameters to change.

use serde::Serialize;

use crate::tone::Tone;

/// The state of a run that goes on. Its block has a button that ends the run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Live {
    /// The update that the page shows; the next ones follow from it.
    pub number: u64,
    /// The controller's state in a word.
    pub state: String,
    /// The state as a colour.
    pub tone: Tone,
    /// How far the run has come, in a sentence.
    pub progress: String,
    /// Figures that matter most, each with its name.
    pub figures: Vec<[String; 2]>,
}

/// A parameter of the controller, which the page can change.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// The name of its unit; may be empty.
    pub unit: String,
    /// What it is.
    pub about: String,
    /// The value that the controller reported last.
    pub value: f64,
    /// The least and the greatest value.
    pub range: [f64; 2],
}
