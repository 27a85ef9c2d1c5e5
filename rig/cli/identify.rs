//! `masseter identify`: friction, masses, lag and play of a robot from the recording of a run.

use std::fmt::Write;

use crate::prelude::*;
use crate::vary::identify::{self, Answer, Found, Identified, IdentifyError};

/// Beyond this the rig does not explain the recording.
const WORST_MISFIT: f64 = 1.2;

/// The arguments of `identify`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  masseter identify runs/latest --out twin.toml\n  masseter identify runs/latest --set dynamics.platform_mass_kg=0.4"
)]
pub(super) struct IdentifyArgs {
    /// Run folder, its recording.mcap, or a link to either
    #[arg(default_value = "runs/latest")]
    run: PathBuf,
    /// Change a key of the scenario that the fit begins with; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Write the scenario with the identified values into this file
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Format of standard output
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Prints what a recording says of the robot's parameters.
pub(super) fn identify(args: &IdentifyArgs) -> Result<Exit, Failure> {
    let interrupts = crate::run::interrupts::Interrupts::of_verb()?;
    let answer = match identify::identify(&args.run, &args.set, &interrupts) {
        Err(IdentifyError::Interrupted) => return Ok(Exit::Interrupted),
        answer => answer.usage()?,
    };
    let text = match args.format {
        Format::Human => in_words(&answer),
        Format::Json => {
            serde_json::to_string_pretty(&answer).map(|json| json + "\n").context("JSON").usage()?
        }
    };
    result(&text).usage()?;
    if let Some(out) = &args.out {
        let written = fs::write(out, answer.scenario.to_toml());
        written.with_context(|| format!("cannot write {}", out.display())).incomplete()?;
        status!("scenario: {}", out.display());
    }
    Ok(Exit::Passed)
}

fn in_words(answer: &Answer) -> String {
    let mut text = format!("{:<37}{:>10}{:>14}  95 % interval\n", "key", "start", "found");
    for Identified { key, start, found } in &answer.keys {
        let _ = match found {
            Some(Found { value, low, high }) => {
                let [value, low, high] = [value, low, high].map(|number| in_digits(*number));
                writeln!(text, "{key:<37}{start:>10}{value:>14}  {low} to {high}")
            }
            None => writeln!(
                text,
                "{key:<37}{start:>10}{:>14}  the motion does not excite it enough",
                "undetermined"
            ),
        };
    }
    let Answer { cycles, misfit, .. } = answer;
    let _ =
        writeln!(text, "{cycles} cycles; the recording differs from the rig by {misfit:.2} times the noise");
    if *misfit > WORST_MISFIT {
        text += "the rig does not explain the recording: another key differs, too, and the intervals are too narrow\n";
    }
    text
}

/// Four digits.
fn in_digits(number: f64) -> String {
    let digits = if number > 0.0 { 3 - number.log10().floor() as i32 } else { 0 };
    format!("{number:.*}", digits.clamp(0, 9) as usize)
}
