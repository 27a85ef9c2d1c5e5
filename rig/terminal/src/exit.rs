//! Exit codes, the same for every verb.

use std::error::Error;
use std::io::{self, ErrorKind};
use std::process::ExitCode;

/// How a command ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// All is well.
    Passed = 0,
    /// A check of the run failed.
    Failed = 1,
    /// Wrong usage, scenario or input file.
    Usage = 2,
    /// The environment is invalid: too disturbed to measure, or real time wanted and not granted.
    Invalid = 3,
    /// A process died.
    Died = 4,
    /// An unexpected safe stop.
    SafeStop = 5,
    /// The recording is incomplete, or there was no room for a file or for standard output.
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

/// An error with the exit code it leads to.
#[derive(Debug)]
pub struct Failure {
    /// The code.
    pub exit: Exit,
    /// What to tell the user.
    pub error: anyhow::Error,
}

/// Says at the place where an error arises which exit code it leads to.
pub trait OrFailure<T> {
    /// To [`Exit::Usage`], since the arguments or inputs are wrong; a full disk leads to [`Exit::Incomplete`].
    fn usage(self) -> Result<T, Failure>;

    /// To [`Exit::Incomplete`]: what a run leaves could not be written or read.
    fn incomplete(self) -> Result<T, Failure>;

    /// To [`Exit::Died`]: a process of the rig could not go on.
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
    /// An error that leads to `exit`; where a full disk caused it, [`Exit::Usage`] becomes [`Exit::Incomplete`].
    pub fn with(exit: Exit, error: impl Into<anyhow::Error>) -> Self {
        let error = error.into();
        let exit = if exit == Exit::Usage && is_out_of_room(&error) { Exit::Incomplete } else { exit };
        Self { exit, error }
    }
}

/// Whether the system refused a write because the disk, a quota or the largest size of a file is reached.
fn is_out_of_room(error: &anyhow::Error) -> bool {
    error.chain().filter_map(io_kind).any(|kind| {
        matches!(kind, ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge)
    })
}

fn io_kind(cause: &(dyn Error + 'static)) -> Option<ErrorKind> {
    // An error of `csv` does not have its cause as a source.
    let in_csv = |error: &csv::Error| match error.kind() {
        csv::ErrorKind::Io(error) => Some(error.kind()),
        _ => None,
    };
    let in_io = cause.downcast_ref().map(io::Error::kind);
    in_io.or_else(|| cause.downcast_ref().and_then(in_csv))
}
