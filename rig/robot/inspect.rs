//! `masseter robot inspect`: reads all drives, and changes nothing.
//!
//! A device configuration file (CiA 306) of each drive holds what was read: other tools read it, and so does
//! `drive_profile.dcf`.

use std::{collections::BTreeMap, fmt::Write};

use masseter_can::{JudgedInterface, canopen::ObjectAddress};
use masseter_commissioning::{
    BootUps, Deviation, Identity, LineError, OtherMaster, Outcome, Restarted, Survey, description, gaps,
    object_name, reason_text,
};
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_plant::{Address, judge_interfaces};
use masseter_scenario::{DriveProfile, wording::counted};
use masseter_terminal::{Exit, Failure, OrFailure, Tone, result_with_tones};
use serde::Serialize;

use super::ledger::{owed_advice, owed_axes};
use super::robot_line::{RobotLine, axes_text, deviations_table, drives, failed};
use super::{args::RobotArgs, evidence::StepFolder, step::Step};

/// For how long the buses are listened to before the first question, ns.
const LISTEN_NS: u64 = 2 * masseter_runtime::clock::SECOND_NS;

const TONES: [(&str, Tone); 3] = [("passed", Tone::Good), ("failed", Tone::Bad), ("warning", Tone::Doubtful)];

/// The arguments of `robot inspect`.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "\
Example:
  masseter robot inspect robot.toml --can can0,can1

Exit 0: configure can mend every deviation. Exit 1: it cannot, or a drive does not answer.")]
pub(crate) struct InspectArgs {
    #[command(flatten)]
    robot: RobotArgs,
    /// Also ask the node ids 1 to 127 that the scenario does not have
    #[arg(long)]
    scan: bool,
}

/// What was found of one drive.
#[derive(Debug, Serialize)]
struct DriveResult {
    axis: &'static str,
    node: u8,
    answers: bool,
    device: [Option<String>; 3],
    deviations: Vec<Deviation>,
    /// Objects that the drive does not have, or refuses to show.
    unread: BTreeMap<String, String>,
}

/// What the drives say.
struct Read {
    /// None of a drive that never answered.
    surveys: [Option<Survey>; AXES],
    /// Whether a drive answers to the end.
    answer: [bool; AXES],
    /// Drives whose values may be others than those that were read.
    restarted: Vec<Restarted>,
}

/// What was found of everything.
#[derive(Debug, Serialize)]
struct InspectResult {
    interfaces: Vec<JudgedInterface>,
    masters: Vec<String>,
    other_nodes: Vec<String>,
    restarted: Vec<String>,
    drives: Vec<DriveResult>,
}

/// Inspects, and prints one table.
pub(crate) fn inspect(args: &InspectArgs) -> Result<Exit, Failure> {
    let scenario = args.robot.scenario().usage()?;
    let parent = &args.robot.folder;
    let mut folder = StepFolder::begin(parent, Step::Inspect, &Step::Inspect.axes(), &scenario).usage()?;
    let interfaces = judge_interfaces(&scenario.can).usage()?;
    if interfaces.iter().any(|interface| !interface.faults.is_empty()) {
        // A frame at a wrong bit rate would disturb every other node.
        let mut text = String::new();
        describe_interfaces(&interfaces, &mut text);
        text += "nothing was sent, and no drive was asked\n";
        folder.finish_step(false, &serde_json::json!({ "interfaces": interfaces })).incomplete()?;
        result_with_tones(&text, &TONES).usage()?;
        return Ok(Exit::Failed);
    }
    let mut robot = RobotLine::open(scenario, folder.log().usage()?).usage()?;
    let Read { surveys, answer, restarted } = read(&mut robot, args.scan).map_err(failed)?;
    let (strangers, can) = (robot.line.strangers(), &robot.scenario.can);
    let other_nodes = strangers.nodes.iter().map(|Address { bus, node }| format!("node {node} on bus {bus}"));
    let result = InspectResult {
        interfaces,
        masters: strangers.masters.iter().map(OtherMaster::to_string).collect(),
        other_nodes: other_nodes.collect(),
        restarted: restarted.iter().map(Restarted::to_string).collect(),
        drives: (0..AXES).map(|axis| drive(&robot, axis, surveys[axis].as_ref(), answer[axis])).collect(),
    };
    for ((name, survey), node) in AXIS_NAMES.iter().zip(&surveys).zip(can.node_ids) {
        if let Some(survey) = survey {
            folder.keep(&format!("{name}.dcf"), &description::dcf(survey, node, name)).incomplete()?;
        }
    }
    let drives = drives(&surveys, can);
    folder.evidence.basis.drives = drives;
    let (mut text, passed) = describe(&robot, &result);
    let advice = owed_axes(parent).into_iter().map(|axis| owed_advice(parent, axis));
    let of_files = robot.scenario.drive_profile.iter().filter_map(DriveProfile::dcf_warning);
    for warning in gaps(&drives).into_iter().chain(advice).chain(of_files) {
        let _ = writeln!(text, "warning: {warning}");
    }
    folder.finish_step(passed, &result).incomplete()?;
    result_with_tones(&text, &TONES).usage()?;
    Ok(if passed { Exit::Passed } else { Exit::Failed })
}

/// Each interface as the kernel has it, with what is wrong and what is risky.
fn describe_interfaces(interfaces: &[JudgedInterface], text: &mut String) {
    for JudgedInterface { name, details, faults, doubts } in interfaces {
        let _ = writeln!(text, "{name}: {details}");
        for (word, lines) in [("failed", faults), ("warning", doubts)] {
            for line in lines {
                let _ = writeln!(text, "{word}: {line}");
            }
        }
    }
}

/// Reads all drives, and asks each of them again at the end.
fn read(robot: &mut RobotLine, scan: bool) -> Result<Read, LineError> {
    robot.line.listen(LISTEN_NS)?;
    let boot_ups = BootUps::until_now(&robot.line);
    let mut surveys = [const { None }; AXES];
    for (axis, place) in surveys.iter_mut().enumerate() {
        let survey = Survey::of_drive(&mut robot.line, axis, robot.settings[axis].addresses())?;
        *place = Some(survey).filter(|survey| !survey.is_silent());
    }
    if scan {
        robot.line.scan()?;
    }
    let is_whole = |survey: &Option<Survey>| survey.as_ref().is_some_and(|survey| !survey.fell_silent());
    let RobotLine { line, scenario, .. } = robot;
    let mut says_who = |axis| Identity::read(line, &scenario.can, axis).is_ok();
    let answer = std::array::from_fn(|axis| is_whole(&surveys[axis]) && says_who(axis));
    line.flush()?;
    let restarted = (0..AXES).filter_map(|axis| boot_ups.check_axis(line, axis).err()).collect();
    Ok(Read { surveys, answer, restarted })
}

fn drive(robot: &RobotLine, axis: usize, survey: Option<&Survey>, answers: bool) -> DriveResult {
    let text = |index| survey?.string(ObjectAddress::new(index, 0));
    let unread = survey.into_iter().flat_map(Survey::readings);
    let unread = unread.filter_map(|(object, reading)| {
        let reason = reading.as_ref().err()?;
        Some((format!("{object} {}", object_name(object)).trim_end().to_owned(), reason_text(*reason)))
    });
    // What a drive did not answer says nothing of what it has.
    let whole = survey.filter(|survey| !survey.fell_silent());
    DriveResult {
        axis: AXIS_NAMES[axis],
        node: robot.scenario.can.node_ids[axis],
        answers,
        device: [0x1008, 0x1009, 0x100A].map(text),
        deviations: whole.map_or_else(Vec::new, |survey| robot.deviations(axis, survey)),
        unread: unread.collect(),
    }
}

/// The result in words, and whether it passed.
fn describe(robot: &RobotLine, result: &InspectResult) -> (String, bool) {
    let mut text = String::new();
    let mut failures = 0;
    let mut fail = |text: &mut String, line: &str| {
        failures += 1;
        let _ = writeln!(text, "failed: {line}");
    };
    let _ = writeln!(text, "{}", devices(&result.drives));
    describe_interfaces(&result.interfaces, &mut text);
    result.masters.iter().for_each(|sign| fail(&mut text, sign));
    for node in &result.other_nodes {
        let _ = writeln!(text, "warning: {node} is not of the scenario");
    }
    result.restarted.iter().for_each(|restarted| fail(&mut text, restarted));
    for (axis, drive) in result.drives.iter().enumerate().filter(|(_, drive)| !drive.answers) {
        fail(&mut text, &format!("{}: {}", drive.axis, robot.silence(axis)));
    }
    let drives = result.drives.iter().enumerate();
    let deviations =
        drives.flat_map(|(axis, drive)| drive.deviations.iter().map(move |one| (axis, one.clone())));
    let deviations: Vec<_> = deviations.collect();
    text += &deviations_table(&deviations);
    let of = |outcome| deviations.iter().filter(|(_, deviation)| deviation.outcome == outcome).count() as u64;
    let (refused, mended) = (of(Outcome::Refused), of(Outcome::Mended));
    if refused > 0 {
        fail(&mut text, &format!("configure cannot mend {}", counted(refused, "deviation")));
    }
    if failures == 0 {
        let _ = match mended {
            0 => writeln!(text, "passed: all drives are as the scenario needs them"),
            _ => writeln!(text, "passed: configure would mend {}", counted(mended, "deviation")),
        };
    }
    (text, failures == 0)
}

/// The devices, equal ones in one line.
fn devices(drives: &[DriveResult]) -> String {
    let mut groups: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (axis, drive) in drives.iter().enumerate().filter(|(_, drive)| drive.answers) {
        let device: Vec<_> = drive.device.iter().flatten().map(String::as_str).collect();
        let objects = drive.unread.keys().filter_map(|object| object.split_once(' '));
        let mut objects: Vec<_> = objects.map(|(object, _)| &object[..5]).collect();
        objects.dedup();
        let mut device = device.join(", ");
        if !objects.is_empty() {
            device = format!("{device}; without {}", objects.join(" "));
        }
        groups.entry(device).or_default().push(axis);
    }
    let line = |(device, axes): (&String, &Vec<usize>)| format!("{}: {device}", axes_text(axes));
    groups.iter().map(line).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use masseter_can::{InterfaceDetails, InterfaceNeeds};

    use super::*;

    #[test]
    fn a_wrong_bit_rate_is_a_fault_and_no_restart_a_doubt() {
        let needs = InterfaceNeeds { bitrate_bps: 1_000_000, frames: 9 };
        let of = |details| JudgedInterface::new("can0", details, needs);
        let details = InterfaceDetails {
            is_up: true,
            bitrate_bps: Some(500_000),
            restart_ms: Some(0),
            errors: Some([0, 3]),
            ..InterfaceDetails::default()
        };
        let result = of(InterfaceDetails { state: Some("bus-off"), ..details.clone() });
        assert_eq!((result.faults.len(), result.doubts.len()), (2, 1), "{result:?}");
        assert_eq!(of(details).doubts.len(), 2, "errors, and no restart");
        let mut text = String::new();
        describe_interfaces(&[result], &mut text);
        assert!(
            text.starts_with("can0: up, 500000 bit/s, bus-off, error counters 0 and 3, restart-ms 0\n"),
            "{text}"
        );
        assert!(text.contains("\nfailed: can0 has 500000 bit/s, can.bitrate_bps is 1000000"), "{text}");
        let virtual_one =
            of(InterfaceDetails { is_up: true, is_virtual: true, ..InterfaceDetails::default() });
        assert!(virtual_one.faults.is_empty() && virtual_one.doubts.is_empty());
    }
}
