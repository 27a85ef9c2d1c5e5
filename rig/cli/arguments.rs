//! Command-line arguments that several verbs share, and the parsers of their values.

use std::net::{Ipv4Addr, SocketAddr};
use std::{path::PathBuf, time::Duration};

use masseter_runtime::lifecycle::{Patience, ProcessArguments};

/// The arguments that the supervisor passes to every process of a run. Some verbs are also a user's, without them.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct ProcessArgs {
    #[arg(long, hide = true, required = false, requires = "domain")]
    scenario: PathBuf,
    #[arg(long, hide = true, required = false, requires = "scenario")]
    domain: String,
    /// For a run in lockstep
    #[arg(long, hide = true, requires = "scenario", value_parser = parse_patience)]
    lockstep: Option<Patience>,
}

impl ProcessArgs {
    pub(crate) fn process_arguments(self) -> ProcessArguments {
        ProcessArguments { scenario: self.scenario, domain: self.domain, lockstep: self.lockstep }
    }
}

/// The real CAN interface of each bus; none for simulated buses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Wires(pub Vec<String>);

/// A duration with its unit, or a number of seconds.
pub(crate) fn parse_duration(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    let duration = seconds.or_else(|| humantime::parse_duration(text).ok());
    duration.ok_or_else(|| "give seconds, or a number with its unit, such as 10, 10s or 2min".to_owned())
}

/// An address with its port, or a port of this machine alone.
pub(crate) fn parse_address(text: &str) -> Result<SocketAddr, String> {
    let port = text.parse().ok().map(|port| SocketAddr::from((Ipv4Addr::LOCALHOST, port)));
    let address = port.or_else(|| text.parse().ok());
    address.ok_or_else(|| {
        "give a port, or an IP address and a port, such as 8765 or 192.168.1.5:8765".to_owned()
    })
}

pub(crate) fn parse_cores(text: &str) -> Result<[usize; 2], String> {
    let cores: Result<Vec<usize>, _> = text.split(',').map(|core| core.trim().parse()).collect();
    match cores.as_deref() {
        Ok([controller, plant]) => Ok([*controller, *plant]),
        _ => Err("expected two cores, such as 0,1".to_owned()),
    }
}

const LEAST_PATIENCE: Duration = Duration::from_millis(100);

/// `none`, or a duration.
pub(crate) fn parse_patience(text: &str) -> Result<Patience, String> {
    if text == "none" {
        return Ok(Patience(None));
    }
    match parse_duration(text) {
        Ok(duration) if duration >= LEAST_PATIENCE => Ok(Patience(Some(duration))),
        Ok(_) => Err("give at least 100ms, which a busy machine may need; or none".to_owned()),
        Err(error) => Err(format!("{error}; or none")),
    }
}

pub(crate) fn parse_wires(text: &str) -> Result<Wires, String> {
    if text == "virtual" {
        return Ok(Wires(Vec::new()));
    }
    let names: Vec<_> = text.split(',').map(|name| name.trim().to_owned()).collect();
    if names.iter().any(String::is_empty) {
        return Err("expected 'virtual', or interfaces such as can0,can1".to_owned());
    }
    Ok(Wires(names))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_duration_without_a_unit_is_in_seconds() {
        let cases = [
            ("10", Some(10_000)),
            ("2.5", Some(2_500)),
            ("10s", Some(10_000)),
            ("2min", Some(120_000)),
            ("1m 30s", Some(90_000)),
            ("250ms", Some(250)),
            ("soon", None),
            ("-1", None),
            ("nan", None),
            ("1e300", None),
            ("10 apples", None),
            ("", None),
        ];
        for (text, expected_ms) in cases {
            assert_eq!(parse_duration(text).ok(), expected_ms.map(Duration::from_millis), "{text}");
        }
    }

    #[test]
    fn an_address_without_a_host_is_a_port_of_this_machine_alone() {
        let cases = [
            ("8765", Some("127.0.0.1:8765")),
            ("0", Some("127.0.0.1:0")),
            ("192.168.1.5:9000", Some("192.168.1.5:9000")),
            ("[::1]:9000", Some("[::1]:9000")),
            ("65536", None),
            ("192.168.1.5", None),
            ("host:9000", None),
            ("", None),
        ];
        for (text, expected) in cases {
            let expected = expected.map(|address| address.parse().unwrap());
            assert_eq!(parse_address(text).ok(), expected, "{text}");
        }
    }
}
