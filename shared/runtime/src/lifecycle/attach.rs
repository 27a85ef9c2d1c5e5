//! Attaches a program of the user to a running rig as its controller.
//!
//! The rig listens on a socket in the private folder of its domain, so only the same user's programs reach it. The
//! program sends [`Hello`]; the rig answers with the [`Invitation`] or a refusal. From then on the socket carries
//! [`Report`]s and [`Order`]s. The cycle itself is in [`control::Session`](crate::control::Session).
//!
//! [`Report`]: super::Report
//! [`Order`]: super::Order

use std::{env, iter, path::PathBuf, time::Duration};

use masseter_scenario::input::excerpt;
use serde::{Deserialize, Serialize};

use super::{Patience, ProcessArguments, ProcessContext, ProcessError, SupervisorLink};
use crate::clock::SECOND_NS;
use crate::conversation::{Conversation, Left, Limits};
use crate::messages::{Command, Event, Message, Reading, State};
use crate::transport::{Domain, DomainError};

/// The environment variable with the name of the rig. The rig sets it for a program that it starts.
pub const RIG_VARIABLE: &str = "MASSETER_RIG";

/// Longest wait for the rig's answer, ns.
const ANSWER_TIMEOUT_NS: u64 = 10 * SECOND_NS;
/// Bytes of the longest answer.
const LONGEST_ANSWER: usize = 1 << 16;
const SOCKET: &str = "attach";

/// The first message of a program.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello {
    /// The layouts of the program's messages, with their hashes.
    pub layouts: Vec<String>,
}

impl Default for Hello {
    /// The greeting of a program built from this version.
    fn default() -> Self {
        let layouts = [
            Reading::SHARED_MEMORY_NAME,
            Command::SHARED_MEMORY_NAME,
            State::SHARED_MEMORY_NAME,
            Event::SHARED_MEMORY_NAME,
        ];
        Self { layouts: layouts.map(str::to_owned).to_vec() }
    }
}

impl Hello {
    /// The first layout that differs from this version, quoted for messages, with this version's layout; none without a
    /// difference.
    pub fn difference(&self) -> Option<(String, String)> {
        let theirs = self.layouts.iter().map(String::as_str).chain(iter::repeat(""));
        let mut pairs = theirs.zip(Self::default().layouts);
        let (theirs, own) = pairs.find(|(theirs, own)| theirs != own)?;
        Some((excerpt(theirs), own))
    }
}

/// The rig's answer.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Answer {
    /// The program is the rig's controller.
    Invited(Invitation),
    /// The rig refuses the program.
    Refused {
        /// The reason and the remedy.
        reason: String,
    },
}

/// The data of a run for a program.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Invitation {
    /// The resolved scenario.
    pub scenario: PathBuf,
    /// Whether the run is in lockstep.
    pub is_lockstep: bool,
    /// In lockstep, the longest silence of a process; none for ever.
    pub patience: Option<Duration>,
}

impl Invitation {
    /// The invitation to a run with this scenario; in lockstep with a patience.
    pub fn new(scenario: PathBuf, lockstep: Option<Patience>) -> Self {
        let patience = lockstep.and_then(|Patience(patience)| patience);
        Self { scenario, is_lockstep: lockstep.is_some(), patience }
    }
}

/// The reason for a failed attachment.
#[derive(Debug, thiserror::Error)]
pub enum AttachError {
    /// No rig of that name waits for a controller.
    #[error("no rig named '{name}' takes a controller; {}", choice_of(.waiting))]
    NoSuchRig {
        /// The name.
        name: String,
        /// The rigs that wait.
        waiting: Vec<String>,
    },
    /// A request without a name needs exactly one rig.
    #[error("there is not one rig to attach to; {}", choice_of(.0))]
    NotOneRig(Vec<String>),
    /// The rig refused the program.
    #[error("the rig '{rig}' refuses this program: {reason}")]
    Refused {
        /// The rig.
        rig: String,
        /// The reason and the remedy.
        reason: String,
    },
    /// The rig does not answer.
    #[error("the rig '{rig}' does not answer: {left}")]
    NoAnswer {
        /// The rig.
        rig: String,
        /// The reason for the end of the wait.
        left: Left,
    },
    /// The search for the rigs of this user fails.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// The scenario or the domain is not usable.
    #[error(transparent)]
    Process(#[from] ProcessError),
}

/// What to do, by the names of the rigs that take a controller.
fn choice_of(waiting: &[String]) -> String {
    if waiting.is_empty() {
        return "none runs: start one with 'masseter run --controller external --name NAME'".to_owned();
    }
    format!("those that do: {}; choose one by its name or by {RIG_VARIABLE}", waiting.join(", "))
}

/// The socket on which the rig of this domain listens.
pub fn socket(domain: &Domain) -> PathBuf {
    domain.root().join(SOCKET)
}

/// Attaches this process as the controller of a rig: the named rig, or that of [`RIG_VARIABLE`], or the only rig that
/// takes a controller. The call leaves other threads alone, and installs no signal handler.
///
/// ```no_run
/// use masseter_runtime::control::Session;
/// use masseter_runtime::lifecycle::attach::attach;
/// use masseter_runtime::named::Declared;
///
/// let context = attach(Some("bench"))?;
/// println!("{} cycles per second", context.scenario.rate_hz);
/// let mut session = Session::start(context, Declared::default())?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`AttachError`] without such a rig, for a refused program, or for an unusable scenario.
pub fn attach(rig: Option<&str>) -> Result<ProcessContext, AttachError> {
    let named = rig.map(str::to_owned).or_else(|| env::var(RIG_VARIABLE).ok());
    let rig = named.map_or_else(only_rig, Ok)?;
    let limits = Limits::answer(ANSWER_TIMEOUT_NS, LONGEST_ANSWER);
    let Ok(mut conversation) = Conversation::connect(&socket(&Domain::named(&rig)?), limits) else {
        return Err(AttachError::NoSuchRig { name: rig, waiting: waiting()? });
    };
    // The rig sends no more bytes before this program is ready.
    let invitation = match conversation.ask(&Hello::default()) {
        Ok(Answer::Invited(invitation)) => invitation,
        Ok(Answer::Refused { reason }) => return Err(AttachError::Refused { rig, reason }),
        Err(left) => return Err(AttachError::NoAnswer { rig, left }),
    };
    let lockstep = invitation.is_lockstep.then_some(Patience(invitation.patience));
    let arguments = ProcessArguments { scenario: invitation.scenario, domain: rig, lockstep };
    let connection = conversation.into_connection().map_err(ProcessError::Supervisor)?;
    let (link, stop) = SupervisorLink::over(connection.into()).map_err(ProcessError::Supervisor)?;
    Ok(ProcessContext::new(&arguments, stop, link)?)
}

fn only_rig() -> Result<String, AttachError> {
    let waiting = waiting()?;
    match &waiting[..] {
        [rig] => Ok(rig.clone()),
        _ => Err(AttachError::NotOneRig(waiting)),
    }
}

fn waiting() -> Result<Vec<String>, DomainError> {
    Ok(Domain::serving(SOCKET)?.iter().map(|domain| domain.id().to_owned()).collect())
}
