//! Access of other programs to the parameters of a running controller.
//!
//! The controller's process listens on a socket in the private folder of its domain, so only the same user's programs
//! reach it. A request and its answer are a line of JSON each. A thread of its own serves the requests, never the loop.

use std::{fs, io, os::unix::net::UnixListener, path::PathBuf, sync::Arc, thread, time::Duration};

use masseter_scenario::input::sentence;
use serde::{Deserialize, Serialize};

use super::{Declared, Parameter, Settings};
use crate::clock::{self, MILLISECOND_NS, SECOND_NS};
use crate::conversation::{Conversation, Left, Limits, Newcomers, line};
use crate::transport::{Domain, DomainError};

const SOCKET: &str = "parameters";
/// Lifetime of a request, ns.
const EXPIRY_NS: u64 = 2 * SECOND_NS;
/// Further time for the answer to a request at the end of its lifetime, ns.
const GRACE_NS: u64 = 200 * MILLISECOND_NS;
/// Bytes of the longest request.
const LONGEST_REQUEST: usize = 4096;
/// Bytes of the longest answer: 64 parameters with long descriptions.
const LONGEST_ANSWER: usize = 1 << 20;
/// Most programs without a whole request, and most programs with an unread answer.
const MOST_PEERS: usize = 16;
/// Least time between two looks for requests, which bounds their cost.
const INTERVAL: Duration = Duration::from_millis(5);
/// Longest time between two looks.
const IDLE: Duration = Duration::from_secs(60);

#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Request {
    List,
    /// The request expires at `expires_ns`, ns of `CLOCK_MONOTONIC`: its sender waits no longer.
    Set {
        name: String,
        value: f64,
        expires_ns: u64,
    },
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Answer {
    /// The parameters with their set values.
    Parameters(Vec<Parameter>),
    Refused {
        reason: String,
    },
}

/// The reason for a failed access to parameters.
#[derive(Debug, thiserror::Error)]
pub enum AccessError {
    /// No controller listens.
    #[error("the rig '{0}' does not run, or its controller declares no parameters")]
    NoParameters(String),
    /// The list of domains fails.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// The controller refuses the name or the value.
    #[error("{0}")]
    Refused(String),
    /// The controller does not answer.
    #[error("the controller of rig '{rig}' does not answer: {left}")]
    NoAnswer {
        /// The rig.
        rig: String,
        /// The reason for the end of the wait.
        left: Left,
    },
    /// The controller does not answer a request for another value.
    #[error(
        "the controller of rig '{rig}' does not answer: {left}; the request has expired, but the controller may have taken \
         the value just before: 'masseter param get {name} --rig {rig}' shows the value that holds"
    )]
    NotConfirmed {
        /// The rig.
        rig: String,
        /// The parameter.
        name: String,
        /// The reason for the end of the wait.
        left: Left,
    },
}

fn parameter_socket(domain: &Domain) -> PathBuf {
    domain.root().join(SOCKET)
}

/// Gives other programs access to these parameters until the end of the process.
///
/// # Errors
/// When the socket or the thread cannot be made.
pub(crate) fn serve(domain: &Domain, settings: Arc<Settings>) -> io::Result<()> {
    let path = parameter_socket(domain);
    // The old socket of a program that has ended before the start of the run.
    let _ = fs::remove_file(&path);
    let listener = UnixListener::bind(path)?;
    let mut newcomers = Newcomers::at(listener.into(), MOST_PEERS, Limits::newcomer(LONGEST_REQUEST))?;
    thread::Builder::new().name("parameters".to_owned()).spawn(move || {
        let mut reading: Vec<Conversation> = Vec::new();
        loop {
            newcomers.wait(if reading.is_empty() { IDLE } else { INTERVAL });
            let now_ns = clock::now_ns();
            let mut look = newcomers.look(now_ns, |bytes| bytes.contains(&b'\n'));
            look.asking.iter_mut().for_each(|conversation| answer_request(conversation, &settings));
            reading.append(&mut look.asking);
            reading.iter_mut().for_each(Conversation::hear);
            reading.retain_mut(|conversation| !conversation.is_sent() && conversation.left(now_ns).is_none());
            reading.drain(..reading.len().saturating_sub(MOST_PEERS));
            clock::sleep(INTERVAL);
        }
    })?;
    Ok(())
}

/// Answers a request, unless its sender has left or waits no longer. So a refused value is never set later.
fn answer_request(conversation: &mut Conversation, settings: &Settings) {
    let request = conversation.next_line().unwrap_or_default();
    conversation.hear();
    let now_ns = clock::now_ns();
    if conversation.left(now_ns).is_some() {
        return;
    }
    let set = match serde_json::from_str(&request) {
        Ok(Request::List) => Ok(()),
        Ok(Request::Set { expires_ns, .. }) if now_ns >= expires_ns => {
            Err("the request came too late: its time is over".to_owned())
        }
        Ok(Request::Set { name, value, .. }) => settings.set(&name, value).map_err(|error| error.to_string()),
        Err(error) => Err(format!("it is no request: {error}")),
    };
    let parameters = settings.declared().parameters.iter().enumerate();
    let present =
        parameters.map(|(place, known)| Parameter { value: settings.value(place), ..known.clone() });
    let answer = match set {
        Ok(()) => Answer::Parameters(present.collect()),
        Err(reason) => Answer::Refused { reason },
    };
    conversation.say(line(&answer).as_bytes());
}

/// The parameters of a rig's controller, with their set values.
///
/// # Errors
/// [`AccessError`] without a controller with parameters.
pub fn list(domain: &Domain) -> Result<Vec<Parameter>, AccessError> {
    ask_controller(domain, &Request::List)
}

/// Sets a parameter of a rig's controller from its next cycle on. Returns all parameters.
///
/// # Errors
/// [`AccessError`], also for an unknown parameter or a value beyond its range.
pub fn set(domain: &Domain, name: &str, value: f64) -> Result<Vec<Parameter>, AccessError> {
    if !value.is_finite() {
        return Err(AccessError::Refused(format!("parameter '{name}' cannot be {value}")));
    }
    let expires_ns = clock::now_ns() + EXPIRY_NS;
    ask_controller(domain, &Request::Set { name: name.to_owned(), value, expires_ns })
}

/// The rigs whose controllers have parameters.
///
/// # Errors
/// When the list of this user's domains fails.
pub fn rigs() -> Result<Vec<Domain>, DomainError> {
    Domain::serving(SOCKET)
}

fn ask_controller(domain: &Domain, request: &Request) -> Result<Vec<Parameter>, AccessError> {
    let rig = || domain.id().to_owned();
    let no_answer = |left| match request {
        Request::List => AccessError::NoAnswer { rig: rig(), left },
        Request::Set { name, .. } => AccessError::NotConfirmed { rig: rig(), name: name.clone(), left },
    };
    let limits = Limits::answer(EXPIRY_NS + GRACE_NS, LONGEST_ANSWER);
    let connected = Conversation::connect(&parameter_socket(domain), limits);
    let mut conversation = connected.map_err(|_| AccessError::NoParameters(rig()))?;
    match conversation.ask(request).map_err(no_answer)? {
        Answer::Parameters(parameters) => {
            // Pages and terminals show these texts.
            let declared = Declared { parameters, ..Declared::default() };
            declared.check().map_err(|error| AccessError::Refused(error.to_string()))?;
            Ok(declared.parameters)
        }
        Answer::Refused { reason } => Err(AccessError::Refused(sentence(&reason))),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::io::Write;
    use std::os::unix::net::UnixStream;

    use super::*;
    use crate::named::NamedValues;
    use crate::transport::ScratchDomain;

    #[test]
    fn another_program_lists_and_sets_parameters() {
        let domain = ScratchDomain::claim("parameters").unwrap();
        assert!(matches!(list(&domain), Err(AccessError::NoParameters(_))));
        let gain = Parameter { range: [0.0, 9.0], ..Parameter::new("gain", 1.0) };
        let declared = Declared { parameters: vec![gain], ..Declared::default() };
        let mut named = NamedValues::new(declared, &BTreeMap::new()).unwrap();
        serve(&domain, Arc::clone(named.settings())).unwrap();
        let value =
            |parameters: Result<Vec<Parameter>, _>| parameters.map(|parameters| [parameters[0].value]).ok();
        assert_eq!(value(list(&domain)), Some([1.0]));
        assert_eq!(value(set(&domain, "gain", 3.0)), Some([3.0]));
        assert_eq!(named.take_change().map(|change| [change.to]), Some([3.0]));
        assert!(rigs().unwrap().contains(&domain));
        for (name, value) in [("gain", 10.0), ("gain", f64::NAN), ("gian", 1.0)] {
            assert!(matches!(set(&domain, name, value), Err(AccessError::Refused(_))));
        }
        // A line that is no request concerns its own connection only.
        UnixStream::connect(parameter_socket(&domain)).unwrap().write_all(b"hello\n").unwrap();
        assert_eq!(value(list(&domain)), Some([3.0]));
    }

    #[test]
    fn a_request_has_no_effect_once_its_time_is_over_or_its_sender_has_left() {
        let declared = Declared { parameters: vec![Parameter::new("gain", 1.0)], ..Declared::default() };
        let mut named = NamedValues::new(declared, &BTreeMap::new()).unwrap();
        let settings = Arc::clone(named.settings());
        let mut ask = |expires_ns, is_there: bool| {
            let (mut peer, own) = UnixStream::pair().unwrap();
            let now_ns = clock::now_ns();
            let mut conversation =
                Conversation::begin(own.into(), Limits::newcomer(LONGEST_REQUEST), now_ns).unwrap();
            let request = Request::Set { name: "gain".to_owned(), value: 2.0, expires_ns };
            peer.write_all(line(&request).as_bytes()).unwrap();
            let peer = is_there.then_some(peer);
            conversation.hear();
            answer_request(&mut conversation, &settings);
            drop(peer);
            named.take_change().is_some()
        };
        let later_ns = clock::now_ns() + SECOND_NS;
        assert!(!ask(clock::now_ns(), true), "it has expired");
        assert!(!ask(later_ns, false), "nobody waits for it");
        assert!(ask(later_ns, true));
    }

    #[test]
    fn peers_that_drip_or_stay_silent_delay_no_other() {
        let domain = ScratchDomain::claim("drip").unwrap();
        let declared = Declared { parameters: vec![Parameter::new("gain", 1.0)], ..Declared::default() };
        let named = NamedValues::new(declared, &BTreeMap::new()).unwrap();
        serve(&domain, Arc::clone(named.settings())).unwrap();
        let mut peers: Vec<_> =
            (0..100).map(|_| UnixStream::connect(parameter_socket(&domain)).unwrap()).collect();
        for _ in 0..10 {
            // The write fails after the server has closed the connection.
            for peer in &mut peers {
                let _ = peer.write_all(b"x");
            }
            let began_ns = clock::now_ns();
            assert!(set(&domain, "gain", 2.0).is_ok());
            assert!(clock::now_ns() - began_ns < SECOND_NS);
        }
    }
}
