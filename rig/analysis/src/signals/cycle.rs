//! The messages of one cycle of the rig, from both loops.

use masseter_runtime::messages::{Command, Contact, Parameters, Reading, Signals, State, Truth};

/// The messages of a cycle; none where a message is missing.
#[derive(Debug, Clone, Copy, Default)]
pub struct CycleMessages {
    /// Number of the cycle, from 1: that of both loops, which count deadlines from one epoch.
    pub cycle: u64,
    /// Whether a lost cycle may have acted on the jaw.
    pub is_disturbed: bool,
    /// The plant's sample.
    pub reading: Option<Reading>,
    /// The true motion at the sample.
    pub truth: Option<Truth>,
    /// The forces between the jaws in the cycle before.
    pub contact: Option<Contact>,
    /// What the controller made of the sample; without a new sample, its state alone.
    pub state: Option<State>,
    /// Whether the state was computed from this sample.
    pub has_solution: bool,
    /// The controller's command.
    pub command: Option<Command>,
    /// The signals that the controller declares.
    pub signals: Option<Signals>,
    /// Shares of their cores that the loops of controller and plant took since the message before.
    pub cpu: [Option<f64>; 2],
    /// The controller's parameters, which hold until they change.
    pub parameters: Option<Parameters>,
}

impl CycleMessages {
    /// When the drives sampled, ns; without a sample the controller's deadline.
    pub fn time_ns(&self) -> Option<u64> {
        let sampled =
            self.reading.map(|reading| reading.sampled_ns).or(self.truth.map(|truth| truth.sampled_ns));
        sampled.filter(|ns| *ns > 0).or(self.state.map(|state| state.due_ns))
    }
}
