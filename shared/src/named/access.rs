//! How other programs read and set the parameters of a running controller.
//!
//! The controller's process listens on a socket in the private folder of its domain, so only the same user's programs reach
//! it. A request and its answer are a line of JSON each. A thread of its own serves them, never the loop.

use std::fs;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::{Parameter, Settings};
use crate::transport::{Domain, DomainError};

const SOCKET: &str = "parameters";
/// Longest wait for the other side.
const TIMEOUT: Duration = Duration::from_secs(2);
/// Bytes of the longest line: 64 parameters with long descriptions.
const LONGEST_LINE: u64 = 1 << 20;

#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Request {
    List,
    Set { name: String, value: f64 },
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Answer {
    /// The parameters with the values that are set.
    Parameters(Vec<Parameter>),
    Refused {
        reason: String,
    },
}

/// Why parameters could not be read or set.
#[derive(Debug, thiserror::Error)]
pub enum AccessError {
    /// Nobody listens.
    #[error("the rig '{0}' does not run, or its controller declares no parameters")]
    NoParameters(String),
    /// The domains cannot be read.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// The controller refuses the name or the value.
    #[error("{0}")]
    Refused(String),
    /// The line to the controller failed.
    #[error("the controller of rig '{rig}' does not answer: {error}")]
    NoAnswer {
        /// The rig.
        rig: String,
        /// The system's error.
        error: io::Error,
    },
}

fn socket(domain: &Domain) -> PathBuf {
    domain.root().join(SOCKET)
}

/// Lets other programs read and set these parameters until the process ends.
///
/// # Errors
/// When the socket or the thread cannot be made.
pub(crate) fn serve(domain: &Domain, settings: Arc<Settings>) -> io::Result<()> {
    let path = socket(domain);
    // That of a program which ended before the start of the run.
    let _ = fs::remove_file(&path);
    let listener = UnixListener::bind(path)?;
    thread::Builder::new().name("parameters".to_owned()).spawn(move || {
        for stream in listener.incoming().map_while(Result::ok) {
            // The other side may leave at any time.
            let _ = answer(&stream, &settings);
        }
    })?;
    Ok(())
}

fn answer(stream: &UnixStream, settings: &Settings) -> io::Result<()> {
    let set = match receive(stream)? {
        Request::List => Ok(()),
        Request::Set { name, value } => settings.set(&name, value),
    };
    let answer = match set {
        Ok(()) => Answer::Parameters(present(settings)),
        Err(error) => Answer::Refused { reason: error.to_string() },
    };
    send(stream, &answer)
}

fn present(settings: &Settings) -> Vec<Parameter> {
    let parameters = settings.declared().parameters.iter().enumerate();
    parameters
        .map(|(place, parameter)| Parameter { value: settings.value(place), ..parameter.clone() })
        .collect()
}

/// The parameters of a rig's controller, with the values that are set.
///
/// # Errors
/// [`AccessError`] when no controller with parameters runs there.
pub fn list(domain: &Domain) -> Result<Vec<Parameter>, AccessError> {
    ask(domain, &Request::List)
}

/// Sets a parameter of a rig's controller, which takes it over in its next cycle. Returns all parameters.
///
/// # Errors
/// [`AccessError`], also when there is no such parameter or the value is beyond its range.
pub fn set(domain: &Domain, name: &str, value: f64) -> Result<Vec<Parameter>, AccessError> {
    if !value.is_finite() {
        return Err(AccessError::Refused(format!("parameter '{name}' cannot be {value}")));
    }
    ask(domain, &Request::Set { name: name.to_owned(), value })
}

/// The rigs whose controllers have parameters.
///
/// # Errors
/// When the domains of this user cannot be listed.
pub fn rigs() -> Result<Vec<Domain>, DomainError> {
    let serves = |domain: &Domain| socket(domain).exists() && domain.is_alive().unwrap_or(false);
    Ok(Domain::all()?.into_iter().filter(serves).collect())
}

fn ask(domain: &Domain, request: &Request) -> Result<Vec<Parameter>, AccessError> {
    let rig = domain.id().to_owned();
    let Ok(stream) = UnixStream::connect(socket(domain)) else { return Err(AccessError::NoParameters(rig)) };
    match send(&stream, request).and_then(|()| receive(&stream)) {
        Ok(Answer::Parameters(parameters)) => Ok(parameters),
        Ok(Answer::Refused { reason }) => Err(AccessError::Refused(reason)),
        Err(error) => Err(AccessError::NoAnswer { rig, error }),
    }
}

fn send(mut stream: &UnixStream, message: &impl Serialize) -> io::Result<()> {
    stream.set_write_timeout(Some(TIMEOUT))?;
    let line = serde_json::to_string(message)? + "\n";
    stream.write_all(line.as_bytes())
}

fn receive<T: DeserializeOwned>(stream: &UnixStream) -> io::Result<T> {
    stream.set_read_timeout(Some(TIMEOUT))?;
    let mut line = String::new();
    BufReader::new(stream.take(LONGEST_LINE)).read_line(&mut line)?;
    Ok(serde_json::from_str(&line)?)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::named::{Declared, NamedValues};
    use crate::transport::ScratchDomain;

    #[test]
    fn another_program_lists_and_sets_parameters() {
        let domain = ScratchDomain::claim("parameters").unwrap();
        assert!(matches!(list(&domain), Err(AccessError::NoParameters(_))));
        let gain = Parameter { range: [0.0, 9.0], ..Parameter::new("gain", 1.0) };
        let declared = Declared { parameters: vec![gain], signals: Vec::new() };
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
        // What is no request closes its own connection only.
        UnixStream::connect(socket(&domain)).unwrap().write_all(b"hello\n").unwrap();
        assert_eq!(value(list(&domain)), Some([3.0]));
    }
}
