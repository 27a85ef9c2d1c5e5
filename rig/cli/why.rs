//! `masseter why`: the last instant from which a failed run still passes without what acted on it.

use std::fmt::Write;

use masseter_report::why::{Detected, Interval, Left, Why};
use masseter_runtime::injection::{Injected, Withdrawn};
use masseter_virtual_time::Without;

use crate::prelude::*;
use crate::{run::interrupts::Interrupts, vary::why};

/// The arguments of `why`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  masseter why runs/latest\n  masseter why runs/latest --without faults.2 --format json"
)]
pub(super) struct WhyArgs {
    /// Run folder, its recording.mcap, or a link to either
    #[arg(default_value = "runs/latest")]
    run: PathBuf,
    /// What is taken away: all, faults, stimuli, or one of them by its place in the scenario, such as faults.2; or a
    /// value of the scenario's parameters, such as parameters.motion_rate: the controller's own comes back
    #[arg(long, value_name = "WHAT", default_value = "all", value_parser = without)]
    without: Without,
    /// Format of standard output
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

fn without(text: &str) -> anyhow::Result<Without> {
    if let Some(name) = text.strip_prefix("parameters.") {
        return Ok(Without::Parameter(name.to_owned()));
    }
    Ok(Without::Acting(match text {
        "all" => Withdrawn::All,
        "faults" => Withdrawn::Faults,
        "stimuli" => Withdrawn::Stimuli,
        _ => {
            let place = |number: &str| number.parse::<usize>().ok()?.checked_sub(1);
            let one = text.split_once('.').and_then(|(list, number)| match list {
                "faults" => place(number).map(Injected::Fault),
                "stimulus" => place(number).map(Injected::Stimulus),
                _ => None,
            });
            let forms = "give all, faults, stimuli, parameters.NAME, faults.N or stimulus.N, with N from 1";
            Withdrawn::One(one.context(forms)?)
        }
    }))
}

/// Prints why a run failed.
pub(super) fn why(args: &WhyArgs) -> Result<Exit, Failure> {
    let interrupts = Interrupts::of_verb()?;
    let why = why::why(&args.run, args.without.clone(), &interrupts).usage()?;
    let text = match args.format {
        Format::Human => in_words(&why),
        Format::Json => serde_json::to_string_pretty(&why).map(|json| json + "\n").context("JSON").usage()?,
    };
    result(&text).usage()?;
    // An archive takes no files; the answer is given.
    match masseter_report::explain(&args.run, &why) {
        Ok(page) => status!("report: {}", page.display()),
        Err(Failure { error, .. }) => status!("masseter: the page stays as it was: {error:#}"),
    }
    Ok(Exit::Passed)
}

fn in_words(why: &Why) -> String {
    let Why { verdict, without, intervals, last_way_back: last, left_first, detection, looks, .. } = why;
    let at = last
        .motion_s
        .map_or("before the motion".to_owned(), |motion_s| format!("{motion_s:.3} s after the motion began"));
    let mut text = format!(
        "{verdict}\nlast way back: {at} (cycle {}); without {without} from then on the run passes, a cycle later it fails\n",
        last.cycle
    );
    for left in left_first {
        let Left { signal, unit, nominal, found, cycle } = left;
        let _ =
            writeln!(text, "left first: {signal} {found:.4} {unit} instead of {nominal:.4} (cycle {cycle})");
    }
    if let Some(Detected { cycle, event, after_ms }) = detection {
        let _ = writeln!(text, "first report, {after_ms:.0} ms later (cycle {cycle}): {event}");
    }
    // Where the way back closed once, the line above has it all.
    for Interval { from_cycle, to_cycle, passes } in intervals.iter().filter(|_| intervals.len() > 2) {
        let word = if *passes { "passes" } else { "fails" };
        let _ = writeln!(text, "left in cycles {from_cycle} to {to_cycle}, the run {word}");
    }
    let _ = writeln!(
        text,
        "{} played and judged; --format json has the margin at each",
        counted(looks.len() as u64, "instant")
    );
    text
}
