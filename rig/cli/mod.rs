//! The command line: dispatches each verb to its module, and prints errors. Arguments are defined beside their verbs, and
//! those of `run` are the [`RunRequest`] itself.

pub(crate) mod arguments;
mod campaign;
mod can;
mod compare;
mod controller;
mod faults;
mod help;
mod identify;
mod kinematics;
mod motion;
mod plant;
mod report;
mod sdk;
mod starter;
mod storm;
mod test;
mod why;

use std::{ffi::OsString, path::PathBuf, process::ExitCode, sync::Arc};

use clap::{ColorChoice, Command, CommandFactory, FromArgMatches, Parser, Subcommand};
use masseter_terminal::{Exit, Failure, OrFailure, choose_colour, in_one_line, result_line, status};
use rustix::process::umask;

use crate::doctor::{self, DoctorArgs};
use crate::robot::{self, RobotVerb};
use crate::run::request::{Readers, RunRequest};
use controller::{ControllerArgs, InterfaceArgs, ParamVerb, SignalsArgs};

const FIRST_STEPS: &str = "\
First steps:
  masseter run
  masseter init DIR
  masseter doctor
  masseter help run";
const EXIT_CODES: &str = "\
Exit codes of every verb: 0 passed, 1 a check failed or was not tested, 2 wrong usage or input,
3 cannot be judged, 4 a process died, 5 unexpected safe stop, 6 files incomplete, 130 interrupted.";

/// A hardware-in-the-loop rig for a 6-DOF mastication robot
#[derive(Debug, Parser)]
#[command(
    name = "masseter",
    version = crate::BUILD,
    max_term_width = 100,
    after_help = FIRST_STEPS,
    after_long_help = format!("{FIRST_STEPS}\n\n{EXIT_CODES}")
)]
struct Cli {
    /// Colour: auto (on a terminal, unless NO_COLOR is set), always or never
    #[arg(
        long,
        global = true,
        value_name = "WHEN",
        default_value_t,
        hide_default_value = true,
        hide_possible_values = true
    )]
    color: ColorChoice,
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Run a jaw motion through controller, plant and recorder, and judge it
    Run(RunRequest),
    /// Run the scenarios of a folder as a suite of tests
    Test(test::TestArgs),
    /// Run a scenario with many values of its keys, faults and motions
    Campaign(campaign::CampaignArgs),
    /// Search for the values of a campaign's factors that come nearest to a failure
    Search(campaign::SearchArgs),
    /// Make a failing scenario as small as it can be and still fail
    Shrink(campaign::ShrinkArgs),
    /// Play random faults, stimuli and parameters from one seed until a law is broken
    Storm(storm::StormArgs),
    /// Find the last instant from which a failed run passes without what acted on it
    Why(why::WhyArgs),
    /// Estimate friction, masses, lag and play of the robot from a recording
    Identify(identify::IdentifyArgs),
    /// Describe a recorded jaw motion, and whether the rig can play it
    Motion(motion::MotionArgs),
    /// Lay down a scenario, a motion and a CI workflow to start from
    Init(starter::InitArgs),
    /// Forward kinematics of a CSV file: actuator positions to poses
    Fk(kinematics::FkArgs),
    /// Inverse kinematics of a CSV file: poses to actuator positions
    #[command(after_help = "Example:\n  masseter ik < poses.csv > joints.csv")]
    Ik(kinematics::CsvArgs),
    /// Attach a controller of the rig to a rig that waits for one
    Controller(ControllerArgs),
    /// Lay down a project for your own controller
    #[command(subcommand, after_help = "Example:\n  masseter new controller --lang cpp my_controller")]
    New(starter::NewVerb),
    /// List, read and set the parameters of a running controller
    #[command(subcommand, after_help = "Example:\n  masseter param set integral_gain_per_s=8")]
    Param(ParamVerb),
    /// List the kinds of faults, or play them all: what detects each
    #[command(subcommand, after_help = "Example:\n  masseter faults matrix")]
    Faults(faults::FaultsVerb),
    /// List the signals that requirements can use
    Signals(SignalsArgs),
    /// Print the messages as types of C or Python
    Interface(InterfaceArgs),
    /// Bring up a robot in steps: inspect, configure, and what follows
    #[command(subcommand, after_help = "Example:\n  masseter robot inspect robot.toml --can can0,can1")]
    Robot(RobotVerb),
    /// Emulate the six drives and the mechanism on real CAN interfaces
    Plant(plant::PlantArgs),
    /// Write the report of a run again, or compare two runs
    Report(report::ReportArgs),
    /// Compare the jaw motion of persons and sessions: tables, figures for print, a page
    Compare(compare::CompareArgs),
    /// Give the recorded readings of a run to its controller again, and compare the answers
    Replay(report::ReplayArgs),
    /// Find the first message in which two recordings differ
    Diff(report::DiffArgs),
    /// Check whether this machine is fit for real-time runs
    Doctor(DoctorArgs),
    /// Write a recording as tables: Parquet or CSV, with a codebook
    Export(masseter_recording_verbs::ExportArgs),
    /// Inspect, verify, recover and thin recordings
    #[command(subcommand, alias = "log", after_help = "Example:\n  masseter recording info runs/latest")]
    Recording(masseter_recording_verbs::RecordingVerb),
    /// Plan the buses, describe the drives (EDS, DBC), serve simulated buses
    #[command(subcommand, after_help = "Example:\n  masseter can plan --rate-hz 500")]
    Can(can::CanVerb),
    /// Remove what killed runs left in shared memory
    #[command(after_help = "Example:\n  masseter clean")]
    Clean,
    /// Print the completions of the command line for a shell
    Completions(help::CompletionsArgs),
    /// Write manual pages
    Man(help::ManArgs),
    /// Run one case of a campaign, for a scheduler
    #[command(hide = true)]
    CampaignCase {
        /// Folder of the campaign
        folder: PathBuf,
        /// Number of the case
        number: usize,
    },
    #[command(hide = true)]
    Recorder {
        #[command(flatten)]
        process: arguments::ProcessArgs,
        #[command(flatten)]
        recorder: masseter_recorder::RecorderArgs,
    },
    #[command(hide = true)]
    ExecProgram {
        /// Process id of the supervisor
        supervisor: i32,
        /// The program
        path: PathBuf,
        /// Its arguments
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<OsString>,
    },
}

/// Parses the arguments, executes the verb, and prints its error.
pub fn main() -> ExitCode {
    // A write beyond the limit on the size of files is then an error, not the end.
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
    let Cli { color, verb } =
        Cli::from_arg_matches(&command().get_matches()).unwrap_or_else(|error| error.exit());
    choose_colour(color);
    keep_files_private(&verb);
    match execute(verb) {
        Ok(exit) => exit.into(),
        Err(Failure { exit, error }) => {
            status!("masseter: {}", in_one_line(&error));
            exit.into()
        }
    }
}

/// The whole command line.
fn command() -> Command {
    help::with_overview(Cli::command())
}

/// Lets no other user read new files, unless `run --readable-by` allows it. The processes of a run inherit that, and
/// its reports take it from the folder.
fn keep_files_private(verb: &Verb) {
    umask(match verb {
        // What init lays down is public.
        Verb::Controller(_)
        | Verb::Recorder { .. }
        | Verb::ExecProgram { .. }
        | Verb::Init(_)
        | Verb::New(_) => {
            return;
        }
        Verb::Run(request) => request.readable_by.umask(),
        Verb::Report(args) => args.umask(),
        _ => Readers::Owner.umask(),
    });
}

/// Errors lead to exit code 2 unless the verb itself chooses another.
fn execute(verb: Verb) -> Result<Exit, Failure> {
    match verb {
        Verb::Run(request) => run(&request),
        Verb::Test(args) => test::test(&args),
        Verb::Campaign(args) => campaign::campaign(&args),
        Verb::Search(args) => campaign::search(&args),
        Verb::Shrink(args) => campaign::shrink(&args),
        Verb::Storm(args) => storm::storm(&args),
        Verb::Why(args) => why::why(&args),
        Verb::Identify(args) => identify::identify(&args),
        Verb::CampaignCase { folder, number } => crate::vary::play::play_case(&folder, number),
        Verb::Motion(args) => motion::motion(&args).usage(),
        Verb::Init(args) => starter::init(&args).usage(),
        Verb::Faults(verb) => faults::execute(&verb),
        Verb::Signals(args) => controller::signals(&args).usage(),
        Verb::Report(args) => report::report(&args),
        Verb::Compare(args) => compare::compare(&args).usage(),
        Verb::Replay(args) => report::replay(&args).usage(),
        Verb::Diff(args) => report::diff(&args).usage(),
        Verb::Fk(args) => kinematics::forward(&args).usage(),
        Verb::Ik(args) => kinematics::inverse(&args).usage(),
        Verb::Can(verb) => can::execute(&verb).usage(),
        Verb::Robot(verb) => robot::execute(&verb),
        Verb::Doctor(args) => doctor::examine(&args).usage(),
        Verb::Export(args) => masseter_recording_verbs::export(&args).usage(),
        Verb::Recording(verb) => masseter_recording_verbs::execute(&verb).usage(),
        Verb::Clean => clean().usage(),
        Verb::Completions(args) => help::completions(&args, &command()).usage(),
        Verb::Man(args) => help::manual(&args, command()).usage(),
        Verb::New(verb) => starter::new(&verb).usage(),
        Verb::Param(verb) => controller::param(&verb).usage(),
        Verb::Interface(args) => controller::interface(&args).usage(),
        Verb::Controller(args) => controller::control(args).usage(),
        Verb::Plant(args) => plant::plant(args).usage(),
        Verb::Recorder { process, recorder } => {
            masseter_recorder::record(&process.process_arguments(), &recorder).usage()
        }
        Verb::ExecProgram { supervisor, path, arguments } => {
            crate::run::exec_program(supervisor, &path, &arguments).usage()
        }
    }
}

/// Plays, judges and reports a run.
fn run(request: &RunRequest) -> Result<Exit, Failure> {
    let prepared = crate::run::PreparedRun::new(request)?;
    let interrupts = crate::run::interrupts::Interrupts::of_verb()?;
    let played = prepared.play(&interrupts);
    interrupts.restore_default_actions();
    played?.report()
}

/// Removes the shared memory of killed runs, and lists all domains of this user. Live runs are not touched.
fn clean() -> anyhow::Result<Exit> {
    let domains = masseter_runtime::transport::Domain::all()?;
    for domain in &domains {
        match domain.sweep()? {
            Some(swept) => {
                result_line!(
                    "{}: {} removed from shared memory",
                    domain.id(),
                    masseter_scenario::wording::counted(swept.removed as u64, "file")
                )?;
                swept.remaining.iter().for_each(|error| status!("masseter: {error}"));
            }
            None => result_line!("{}: running, not removed", domain.id())?,
        }
    }
    if domains.is_empty() {
        result_line!("nothing to clean")?;
    }
    Ok(Exit::Passed)
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::{fs, iter};

    use masseter_judge::NextStep;

    use super::*;

    /// Every command that a user meets, with its names from the verb on.
    fn visible(command: &Command, names: &str) -> Vec<(String, Command)> {
        let verbs = command.get_subcommands().filter(|verb| !verb.is_hide_set());
        verbs
            .flat_map(|verb| {
                let name = format!("{names} {}", verb.get_name());
                let inner = visible(verb, &name);
                iter::once((name, verb.clone())).chain(inner)
            })
            .collect()
    }

    /// The command lines of a text, without what the shell takes from them, or what explains them.
    fn command_lines(text: &str) -> impl Iterator<Item = &str> {
        let lines = text.lines().map(str::trim_start).filter(|line| line.starts_with("masseter "));
        lines.map(|line| line.split(['<', '>', '|', '#', '(']).next().unwrap_or_default())
    }

    /// What stands between backticks.
    fn quoted(text: &str) -> impl Iterator<Item = &str> {
        text.split('`').skip(1).step_by(2)
    }

    #[test]
    fn what_to_do_next_names_commands_keys_and_documents_that_exist() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let reference = fs::read_to_string(root.join("docs/scenario.md")).unwrap();
        for step in NextStep::ALL {
            let sentence = step.name();
            let is_apart = |c: char| c.is_whitespace() || "(),:;".contains(c);
            for document in sentence.split(is_apart).filter(|word| word.starts_with("docs/")) {
                assert!(root.join(document.trim_end_matches('.')).is_file(), "{step:?}: {document}");
            }
            for quoted in quoted(sentence) {
                let line = quoted.replace("RUN", "runs/latest").replace("CLOCK", "virtual");
                // The command that mends depends on the machine.
                let line = line.replace("MEND", "masseter doctor");
                if line.starts_with("masseter ") {
                    assert_parsed(&line);
                } else if line.starts_with("--") {
                    assert_parsed(&format!("masseter run {line}"));
                } else if !line.contains('/') {
                    let (table, key) =
                        line.split_once('.').map_or((line.as_str(), ""), |(table, key)| (table, key));
                    let has_table = reference.contains(&format!("`[{table}]`"))
                        || reference.contains(&format!("| `{table}` |"));
                    assert!(has_table || table.starts_with("[["), "{step:?}: {quoted}");
                    assert!(
                        key.is_empty() || reference.contains(&format!("| `{key}` |")),
                        "{step:?}: {quoted}"
                    );
                }
            }
        }
    }

    fn assert_parsed(line: &str) {
        let parsed = command().try_get_matches_from(line.split_whitespace());
        assert!(parsed.is_ok(), "{line}: {}", parsed.unwrap_err());
    }

    #[test]
    fn every_verb_has_an_example_that_is_right_and_a_help_without_marks_of_markup() {
        let verbs = visible(&command(), "masseter");
        assert!(verbs.len() > 20, "{verbs:?}");
        for (name, mut verb) in verbs {
            let help = verb.render_long_help().to_string();
            let (_, examples) =
                help.split_once("\nExample").unwrap_or_else(|| panic!("{name}: no example in {help}"));
            let example = format!("  {name}");
            assert!(examples.lines().any(|line| line.starts_with(&example)), "{name}: {examples}");
            assert!(!help.contains('`'), "{name}: {help}");
            command_lines(&help).for_each(assert_parsed);
        }
    }

    #[test]
    fn every_command_line_of_the_documents_and_the_workflow_is_right() {
        let workflow = include_str!("../../examples/workflow.yml").replace("run: masseter", "masseter");
        let workflow: Vec<_> = command_lines(&workflow).collect();
        assert!(!workflow.is_empty());
        workflow.into_iter().for_each(assert_parsed);
        let project = Path::new(env!("CARGO_MANIFEST_DIR"));
        let files = ["docs", "docs/tutorials"].map(|folder| fs::read_dir(project.join(folder)).unwrap());
        let files = files.into_iter().flatten().map(|entry| entry.unwrap().path());
        let mut checked = 0;
        for path in
            files.chain([project.join("README.md")]).filter(|path| path.extension() == Some("md".as_ref()))
        {
            let text = fs::read_to_string(path).unwrap();
            let indented: Vec<_> = text.lines().filter(|line| line.starts_with("    ")).collect();
            // The program of a user does not exist here.
            let commands = indented.join("\n").replace("./my_controller", "motion");
            let commands = commands.replace("fmu:law.fmu", "fmu:Cargo.toml");
            // This test splits at blanks, as a shell does outside of quotes.
            for line in command_lines(&commands).filter(|line| !line.contains('"')) {
                assert_parsed(line);
                checked += 1;
            }
        }
        assert!(checked > 50, "only {checked} command lines were found");
    }

    #[test]
    fn the_overview_shows_every_visible_verb_once() {
        let command = command();
        let help = command.clone().render_help().to_string();
        for verb in command.get_subcommands() {
            let entries = help.lines().filter(|line| line.starts_with(&format!("  {} ", verb.get_name())));
            assert_eq!(entries.count(), usize::from(!verb.is_hide_set()), "{}: {help}", verb.get_name());
        }
        assert!(help.lines().all(|line| line.chars().count() <= 100), "{help}");
    }
}
