//! Exit codes, the same for every verb, and errors as text.

use std::io::{self, ErrorKind};
use std::process::ExitCode;

/// The exit code of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// Success.
    Passed = 0,
    /// A check failed, or was not tested.
    Failed = 1,
    /// Wrong usage, scenario or input file.
    Usage = 2,
    /// The run cannot be judged: the machine was too disturbed, or did not grant the required real time.
    Invalid = 3,
    /// A process died.
    Died = 4,
    /// An unexpected safe stop.
    SafeStop = 5,
    /// The recording is incomplete, or a disk is full.
    Incomplete = 6,
    /// Interrupted by the user.
    Interrupted = 130,
}

impl serde::Serialize for Exit {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_u8(*self as u8)
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

/// An error and its exit code.
#[derive(Debug)]
pub struct Failure {
    /// The code.
    pub exit: Exit,
    /// The error.
    pub error: anyhow::Error,
}

/// Gives errors an exit code where they arise.
pub trait OrFailure<T> {
    /// [`Exit::Usage`]: arguments or inputs are wrong. A full disk leads to [`Exit::Incomplete`].
    fn usage(self) -> Result<T, Failure>;

    /// [`Exit::Incomplete`]: a file of the run cannot be written or read.
    fn incomplete(self) -> Result<T, Failure>;

    /// [`Exit::Died`]: a process of the rig failed.
    fn died(self) -> Result<T, Failure>;
}

impl<T, E: Into<anyhow::Error>> OrFailure<T> for Result<T, E> {
    fn usage(self) -> Result<T, Failure> {
        self.map_err(|error| Failure::with(Exit::Usage, error))
    }

    fn incomplete(self) -> Result<T, Failure> {
        self.map_err(|error| Failure::with(Exit::Incomplete, error))
    }

    fn died(self) -> Result<T, Failure> {
        self.map_err(|error| Failure::with(Exit::Died, error))
    }
}

impl Failure {
    /// An error with this exit code; [`Exit::Usage`] becomes [`Exit::Incomplete`] if a full disk caused the error.
    pub fn with(exit: Exit, error: impl Into<anyhow::Error>) -> Self {
        let error = error.into();
        let exit = if exit == Exit::Usage && is_out_of_room(&error) { Exit::Incomplete } else { exit };
        Self { exit, error }
    }
}

/// An error and its causes in one line, without causes that the text before quotes.
pub fn in_one_line(error: &anyhow::Error) -> String {
    error.chain().fold(String::new(), |text, cause| {
        let cause = cause.to_string();
        match text.as_str() {
            "" => cause,
            _ if text.contains(&cause) => text,
            _ => text + ": " + &cause,
        }
    })
}

/// Whether a write failed because the disk is full, or a quota or the maximum file size is reached.
fn is_out_of_room(error: &anyhow::Error) -> bool {
    error.chain().filter_map(|cause| cause.downcast_ref().map(io::Error::kind)).any(|kind| {
        matches!(kind, ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge)
    })
}
