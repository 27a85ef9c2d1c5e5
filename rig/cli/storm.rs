//! `masseter storm`: random faults, stimuli and parameters from one seed, until a law is broken.

use crate::prelude::*;
use crate::run::request::{ControllerChoice, ControllerKind};
use crate::vary::storm::{self, Limits, Season};

/// The arguments of `storm`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  masseter storm --seed 7\n  masseter storm chewing.toml --seed 7 --minutes 60 --out storms/7\n\nThe same command with the same --out goes on where it was."
)]
pub(super) struct StormArgs {
    /// The scenario that the storms change [default: the built-in scenario]
    scenario: Option<PathBuf>,
    /// The seed of all storms
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The number of the first storm [default: 0, or where the storms of the folder go on]
    #[arg(long, value_name = "N")]
    from: Option<u64>,
    #[command(flatten)]
    limits: Limits,
    /// Folder of the log and of the storms that break a law; storms begun there go on [default: storms/SEED]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Who controls the robot
    #[arg(long, value_enum, default_value_t, hide_default_value = true)]
    controller: ControllerKind,
    /// Format of standard output
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Plays storms; [`Exit::Failed`] where one breaks a law.
pub(super) fn storm(args: &StormArgs) -> Result<Exit, Failure> {
    let base = scenario_with(args.scenario.as_deref(), &[]).usage()?;
    // A mistake in the scenario itself is in every storm.
    crate::run::resolve_simulated(&base, args.scenario.as_deref(), args.controller.builder()).usage()?;
    let runner = crate::run::runner::Runner::of_verb(ControllerChoice::Own(args.controller))?;
    let out = args.out.clone().unwrap_or_else(|| PathBuf::from("storms").join(args.seed.to_string()));
    let season = Season::begin(&runner, &base, args.seed, args.from, &out).usage()?;
    status!("storms of seed {}; log in {}", args.seed, out.display());
    let log = season.play(args.limits)?;
    let text = match args.format {
        Format::Human => storm::in_words(&log),
        Format::Json => serde_json::to_string_pretty(&log).expect("a log has a JSON form") + "\n",
    };
    result(&text).incomplete()?;
    Ok(storm::exit_of(&log, &runner))
}
