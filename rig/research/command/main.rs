//! The command `masseter-research`: the paper's study, and where six inputs determine one pose.

// `println!` panics on a closed terminal: see `masseter_terminal`.
#![warn(clippy::print_stdout, clippy::print_stderr)]

mod uniqueness;

use std::{fs, path::PathBuf, process::ExitCode, sync::Arc};

use anyhow::Context;
use clap::{Args, Parser, Subcommand};
use masseter_plan::{read_scenario_with, set_keys};
use masseter_research::{Settings, Study};
use masseter_scenario::Scenario;
use masseter_terminal::{Exit, Failure, OrFailure, in_one_line, result_line, status};
use rustix::{fs::Mode, process::umask};

use uniqueness::{UniquenessVerb, uniqueness};

/// Research on the published mechanism: what the paper claims measured again, and proofs
///
/// Exits with 0 where all went well, 1 where uniqueness is not shown, 2 for wrong usage or input, 6 for a full disk.
#[derive(Debug, Parser)]
#[command(name = "masseter-research", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Reproduce the paper's study of the kinematics as tables
    Study(StudyArgs),
    /// Prove where the six inputs determine one pose, or search for exceptions
    #[command(subcommand, after_help = "Example:\n  masseter-research uniqueness prove --region jaw")]
    Uniqueness(UniquenessVerb),
}

fn main() -> ExitCode {
    // A write beyond the limit on the size of files is then an error, not the end.
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
    // Recorded motions are private, and so is what comes of them.
    umask(Mode::RWXG | Mode::RWXO);
    let done = match Cli::parse().verb {
        Verb::Study(args) => study(&args),
        Verb::Uniqueness(verb) => uniqueness(&verb),
    };
    match done.usage() {
        Ok(exit) => exit.into(),
        Err(Failure { exit, error }) => {
            status!("masseter-research: {}", in_one_line(&error));
            exit.into()
        }
    }
}

/// The arguments of `study`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example:\n  masseter-research study --out study")]
struct StudyArgs {
    /// Folder for the tables (CSV); must not exist
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Seed of every random number
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Random guesses of each kind, and random inputs
    #[arg(long, value_name = "N", default_value_t = 20_000, value_parser = clap::value_parser!(u32).range(1..))]
    samples: u32,
    /// Cells along each side of a map
    #[arg(long, value_name = "N", default_value_t = 160, value_parser = clap::value_parser!(u32).range(2..=1000))]
    cells: u32,
    /// Recorded jaw motion (CSV, TRC, MOT, STO or C3D) to judge as well
    #[arg(long, value_name = "FILE.csv")]
    trajectory: Option<PathBuf>,
    /// Scenario with a motion to judge as well; for a recording its axes, jaw and limits
    #[arg(long, value_name = "FILE.toml")]
    scenario: Option<PathBuf>,
}

/// Makes the study.
fn study(args: &StudyArgs) -> anyhow::Result<Exit> {
    let study = Study::prepare(args.own_scenario()?.as_ref())?;
    masseter_recording::new_folder(&args.out)?;
    let settings = Settings { seed: args.seed, samples: args.samples as usize, cells: args.cells as usize };
    let mut tables = study.run(settings, |stage| status!("{stage}"))?;
    tables.push(("settings", args.settings_table()));
    for (name, table) in tables {
        let path = args.out.join(name).with_extension("csv");
        fs::write(&path, table).with_context(|| format!("cannot write {}", path.display()))?;
    }
    result_line!("{}", args.out.display())?;
    Ok(Exit::Passed)
}

impl StudyArgs {
    /// The scenario of a motion beside the rig's own, if one is given.
    fn own_scenario(&self) -> anyhow::Result<Option<Scenario>> {
        if self.scenario.is_none() && self.trajectory.is_none() {
            return Ok(None);
        }
        let play = |scenario: &mut Scenario| set_keys(scenario, self.trajectory.as_deref(), &[]);
        read_scenario_with(self.scenario.as_deref(), play).map(Some)
    }

    /// The version, the settings, and the command line that repeats the study.
    fn settings_table(&self) -> String {
        let Self { seed, samples, cells, trajectory, scenario, .. } = self;
        let options = [("trajectory", trajectory), ("scenario", scenario)].into_iter();
        let option =
            |(name, path): (_, &Option<PathBuf>)| Some(format!(" --{name} {}", path.as_ref()?.display()));
        let options: String = options.filter_map(option).collect();
        let command = format!(
            "masseter-research study --out DIR --seed {seed} --samples {samples} --cells {cells}{options}"
        );
        let version = env!("CARGO_PKG_VERSION");
        format!(
            "version,seed,samples,command\n{version},{seed},{samples},\"{}\"\n",
            command.replace('"', "\"\"")
        )
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn every_example_of_the_help_is_right() {
        let mut examples = 0;
        let mut commands = vec![Cli::command()];
        while let Some(mut command) = commands.pop() {
            let help = command.render_long_help().to_string();
            commands.extend(command.get_subcommands().cloned());
            for line in help.lines().filter(|line| line.starts_with("  masseter-research ")) {
                let parsed = Cli::try_parse_from(line.split_whitespace());
                assert!(parsed.is_ok(), "{line}: {}", parsed.unwrap_err());
                examples += 1;
            }
        }
        assert_eq!(examples, 5);
    }
}
