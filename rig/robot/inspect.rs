//! `masseter robot inspect`: reads all drives, and changes nothing.

use std::collections::BTreeMap;
use std::fmt::Write;

use clap::Args;
use masseter_can::canopen::ObjectAddress;
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_plant::bringup::{
    BootUps, Deviation, LineError, OtherMaster, Outcome, Restarted, Survey, object_name, reason_text,
};
use masseter_runtime::clock::SECOND_NS;
use masseter_scenario::wording::counted;
use masseter_terminal::{Exit, Failure, OrFailure, Tone, result_with_tones};
use serde::Serialize;

use super::args::RobotArgs;
use super::evidence::StepFolder;
use super::identity::gaps;
use super::interfaces::{InterfaceResult, interfaces};
use super::ledger;
use super::robot_line::{RobotLine, drives, failed};
use super::snapshot::dcf;
use super::step::Step;
use super::table::{axes_text, table};

/// For how long the buses are listened to before the first question, ns.
const LISTEN_NS: u64 = 2 * SECOND_NS;

/// The arguments of `robot inspect`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Example:\n  masseter robot inspect robot.toml --can can0,can1\n\nExit 0: configure can mend every deviation. Exit 1: it cannot, or a drive does not answer."
)]
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
    interfaces: Vec<InterfaceResult>,
    masters: Vec<String>,
    other_nodes: Vec<String>,
    restarted: Vec<String>,
    drives: Vec<DriveResult>,
}

/// Inspects, and prints one table.
pub(crate) fn inspect(args: &InspectArgs) -> Result<Exit, Failure> {
    let scenario = args.robot.scenario().usage()?;
    let all: Vec<usize> = (0..AXES).collect();
    let mut folder = StepFolder::begin(&args.robot.folder, Step::Inspect, &all, &scenario).usage()?;
    let interfaces = interfaces(&scenario.can);
    let mut robot = RobotLine::open(scenario, folder.log().usage()?).usage()?;
    let Read { surveys, answer, restarted } = read(&mut robot, args.scan).map_err(failed)?;
    let result = InspectResult {
        interfaces,
        masters: masters(&robot),
        other_nodes: other_nodes(&robot),
        restarted: restarted.iter().map(Restarted::to_string).collect(),
        drives: all.iter().map(|&axis| drive(&robot, axis, surveys[axis].as_ref(), answer[axis])).collect(),
    };
    for (axis, survey) in surveys.iter().enumerate() {
        let Some(survey) = survey else { continue };
        let text = dcf(survey, robot.scenario.can.node_ids[axis], AXIS_NAMES[axis]);
        folder.keep(&format!("{}.dcf", AXIS_NAMES[axis]), &text).incomplete()?;
    }
    let drives = drives(&surveys, &robot.scenario.can);
    folder.note_drives(drives);
    let (mut text, passed) = describe(&robot, &result);
    for gap in gaps(&drives) {
        let _ = writeln!(text, "warning: {gap}");
    }
    for axis in ledger::owed_axes(&args.robot.folder) {
        let _ = writeln!(text, "warning: {}", ledger::advice(&args.robot.folder, axis));
    }
    folder.finish(passed, &result).incomplete()?;
    result_with_tones(&text, &[("passed", Tone::Good), ("failed", Tone::Bad), ("warning", Tone::Doubtful)])
        .usage()?;
    Ok(if passed { Exit::Passed } else { Exit::Failed })
}

/// Reads all drives, and asks each of them again at the end.
fn read(robot: &mut RobotLine, scan: bool) -> Result<Read, LineError> {
    robot.line.listen(LISTEN_NS)?;
    let boot_ups = BootUps::until_now(&robot.line);
    let mut surveys = [const { None }; AXES];
    for (axis, place) in surveys.iter_mut().enumerate() {
        let settings = robot.settings(axis).clone();
        *place = Some(robot.survey(axis, &settings)?).filter(|survey| !survey.is_silent());
    }
    if scan {
        robot.line.scan()?;
    }
    let is_whole = |survey: &Option<Survey>| survey.as_ref().is_some_and(|survey| !survey.fell_silent());
    let answer = std::array::from_fn(|axis| is_whole(&surveys[axis]) && robot.answers(axis));
    robot.line.flush()?;
    let restarted = (0..AXES).filter_map(|axis| boot_ups.check_axis(&robot.line, axis).err()).collect();
    Ok(Read { surveys, answer, restarted })
}

fn masters(robot: &RobotLine) -> Vec<String> {
    let masters = &robot.line.strangers().masters;
    masters.iter().map(|&(bus, sign)| OtherMaster { bus, sign }.to_string()).collect()
}

fn other_nodes(robot: &RobotLine) -> Vec<String> {
    let nodes = &robot.line.strangers().nodes;
    nodes.iter().map(|(bus, node)| format!("node {node} on bus {bus}")).collect()
}

fn drive(robot: &RobotLine, axis: usize, survey: Option<&Survey>, answers: bool) -> DriveResult {
    let text = |index| survey?.text(ObjectAddress::new(index, 0));
    let unread = survey.into_iter().flat_map(Survey::readings);
    let unread = unread.filter_map(|(object, reading)| {
        let reason = reading.as_ref().err()?;
        Some((format!("{object} {}", object_name(object)).trim_end().to_owned(), reason_text(*reason)))
    });
    DriveResult {
        axis: AXIS_NAMES[axis],
        node: robot.scenario.can.node_ids[axis],
        answers,
        device: [0x1008, 0x1009, 0x100A].map(text),
        // What a drive did not answer says nothing of what it has.
        deviations: survey
            .filter(|survey| !survey.fell_silent())
            .map(|survey| robot.deviations(axis, survey))
            .unwrap_or_default(),
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
    for interface in &result.interfaces {
        interface.faults.iter().for_each(|fault| fail(&mut text, fault));
        for doubt in &interface.doubts {
            let _ = writeln!(text, "warning: {doubt}");
        }
    }
    for sign in &result.masters {
        fail(&mut text, sign);
    }
    for node in &result.other_nodes {
        let _ = writeln!(text, "warning: {node} is not of the scenario");
    }
    result.restarted.iter().for_each(|restarted| fail(&mut text, restarted));
    for (axis, drive) in result.drives.iter().enumerate().filter(|(_, drive)| !drive.answers) {
        fail(&mut text, &format!("{}: {}", drive.axis, robot.silence(axis)));
    }
    let of_drive = |(axis, drive): (usize, &DriveResult)| {
        drive.deviations.iter().map(move |deviation| (axis, deviation.clone())).collect::<Vec<_>>()
    };
    let deviations: Vec<_> = result.drives.iter().enumerate().flat_map(of_drive).collect();
    text += &table(&deviations);
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
        let objects: Vec<_> = drive.unread.keys().filter_map(|object| object.split_once(' ')).collect();
        let mut objects: Vec<_> = objects.into_iter().map(|(object, _)| &object[..5]).collect();
        objects.dedup();
        let without =
            if objects.is_empty() { String::new() } else { format!("; without {}", objects.join(" ")) };
        groups.entry(format!("{}{without}", device.join(", "))).or_default().push(axis);
    }
    let lines: Vec<_> =
        groups.iter().map(|(device, axes)| format!("{}: {device}", axes_text(axes))).collect();
    lines.join("\n")
}
