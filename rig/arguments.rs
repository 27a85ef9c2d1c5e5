//! Command-line arguments that several verbs share, and the parsers of their values.

use std::net::{Ipv4Addr, SocketAddr};
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::bail;
use clap::{Args, ValueEnum};
use masseter_controller::hold_position::HoldPosition;
use masseter_controller::motion_controller::MotionController;
use masseter_controller::process::BuildController;
use masseter_runtime::lifecycle::{Patience, ProcessArguments};
use masseter_runtime::realtime::scheduling::usable_cores;

/// The arguments that the supervisor passes to every process of a run. Some verbs are also a user's, without them.
#[derive(Debug, Clone, Args)]
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

/// A controller of the rig.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum ControllerKind {
    /// Plays the motion of the scenario
    #[default]
    Motion,
    /// Holds the position found at the start, for as long as the motion takes
    Hold,
}

impl ControllerKind {
    /// The controller that a manifest names; none for a program of the user.
    pub(crate) fn of_manifest(name: Option<&str>) -> Option<Self> {
        name.map_or_else(|| Some(Self::default()), |name| Self::from_str(name, false).ok())
    }

    /// How the controller is built.
    pub(crate) fn builder(self) -> BuildController {
        match self {
            Self::Motion => {
                |scenario, mechanism, motion| Box::new(MotionController::new(scenario, mechanism, motion))
            }
            Self::Hold => |scenario, mechanism, motion| {
                Box::new(HoldPosition::new(scenario, mechanism, motion.duration_s()))
            },
        }
    }
}

/// Who controls the robot in a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum ControllerChoice {
    /// A controller of the rig.
    Own(ControllerKind),
    /// A program that the user starts.
    External,
    /// A program that the rig starts.
    Executable(PathBuf),
    /// Nobody, or whoever publishes commands: the rig starts, invites and watches no controller.
    None,
}

impl Default for ControllerChoice {
    fn default() -> Self {
        Self::Own(ControllerKind::default())
    }
}

impl ControllerChoice {
    /// How a controller of the rig is built; none for a program of the user.
    pub(crate) fn builder(&self) -> Option<BuildController> {
        match self {
            Self::Own(kind) => Some(kind.builder()),
            Self::External | Self::Executable(_) | Self::None => None,
        }
    }

    /// Its name in the manifest; none for the controller that runs by default.
    pub(crate) fn name(&self) -> Option<String> {
        match self {
            Self::Own(kind) => Some(name_of(kind)).filter(|_| *kind != ControllerKind::default()),
            Self::External => Some("external".to_owned()),
            Self::None => Some("none".to_owned()),
            Self::Executable(path) => Some(path.display().to_string()),
        }
    }
}

/// The name of a controller of the rig, `external`, or the path of an executable file.
pub(crate) fn parse_controller(text: &str) -> Result<ControllerChoice, String> {
    if let Ok(kind) = ControllerKind::from_str(text, false) {
        return Ok(ControllerChoice::Own(kind));
    }
    if text == "external" {
        return Ok(ControllerChoice::External);
    }
    if text == "none" {
        return Ok(ControllerChoice::None);
    }
    let path = PathBuf::from(text);
    match path.metadata() {
        Ok(found) if found.is_file() && found.permissions().mode() & 0o111 != 0 => {
            // Without a folder, the system would search PATH.
            std::path::absolute(path).map(ControllerChoice::Executable).map_err(|error| error.to_string())
        }
        Ok(found) if found.is_file() => Err(format!("the file is not executable: chmod +x {text}")),
        Ok(_) => Err("it is a folder: give the executable file of your controller".to_owned()),
        Err(error) => {
            Err(format!("use motion, hold, external, none, or the path of an executable file ({error})"))
        }
    }
}

/// The name of a value on the command line.
pub(crate) fn name_of(value: &impl ValueEnum) -> String {
    value.to_possible_value().expect("no value is skipped").get_name().to_owned()
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

/// Refuses cores of the command line to which the kernel pins no thread.
pub(crate) fn check_cores(cores: &[usize]) -> anyhow::Result<()> {
    check_among(cores, &usable_cores())
}

/// Where no pinning is allowed at all, the refusal of the kernel says so later.
fn check_among(cores: &[usize], usable: &[usize]) -> anyhow::Result<()> {
    match cores.iter().find(|core| !usable.contains(core)) {
        Some(core) if !usable.is_empty() => {
            let choice: Vec<_> = usable.iter().map(usize::to_string).collect();
            bail!("--cores: there is no core {core} for this process; choose among {}", choice.join(", "))
        }
        _ => Ok(()),
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

/// The same as [`parse_patience`] reads.
pub(crate) fn patience_text(Patience(patience): Patience) -> String {
    patience.map_or_else(|| "none".to_owned(), |patience| humantime::format_duration(patience).to_string())
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

    #[test]
    fn cores_that_cannot_be_used_are_refused_with_those_that_can() {
        let refusal = |cores: &[usize], usable: &[usize]| {
            check_among(cores, usable).err().map(|error| error.to_string())
        };
        assert_eq!(refusal(&[0, 1], &[0, 1]), None);
        assert_eq!(refusal(&[0, 9], &[]), None, "nothing is known");
        let refused = refusal(&[0, 9], &[0, 2]).unwrap();
        assert!(refused.contains("no core 9") && refused.contains("choose among 0, 2"), "{refused}");
    }
}
