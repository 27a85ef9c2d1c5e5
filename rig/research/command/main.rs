//! The command `masseter-research`: the paper's study, and where six inputs determine one pose.

// `println!` panics on a closed terminal: see `masseter_terminal`.
#![warn(clippy::print_stdout, clippy::print_stderr)]

mod study;
mod uniqueness;

use std::process::ExitCode;
use std::sync::Arc;

use clap::{Parser, Subcommand};
use masseter_terminal::{Failure, OrFailure, in_one_line, status};
use rustix::fs::Mode;
use rustix::process::umask;

use study::{StudyArgs, study};
use uniqueness::{UniquenessVerb, uniqueness};

/// Research on the published mechanism: the paper's claims measured again, and proofs
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
    /// Reproduce the paper's study of the kinematics: figures, data, claims
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
