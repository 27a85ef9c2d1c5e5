//! `masseter can eds` and `masseter can dbc`: the drives as other tools read them, to standard output.

use std::io::{self, Write};
use std::path::Path;

use masseter_plant::description;
use masseter_shared::config::Scenario;

use crate::cli::EdsArgs;
use crate::exit::{Exit, Failure};

/// The electronic data sheet of one drive.
pub(crate) fn eds(args: &EdsArgs) -> Result<Exit, Failure> {
    let sheets = description::eds(&scenario(args.scenario.as_deref())?)?;
    print(&sheets[args.axis])
}

/// The messages of the whole link.
pub(crate) fn dbc(path: Option<&Path>) -> Result<Exit, Failure> {
    print(&description::dbc(&scenario(path)?)?)
}

fn scenario(path: Option<&Path>) -> anyhow::Result<Scenario> {
    let scenario = path.map_or_else(|| Ok(Scenario::default()), Scenario::read)?;
    scenario.validate()?;
    Ok(scenario)
}

fn print(text: &str) -> Result<Exit, Failure> {
    match io::stdout().lock().write_all(text.as_bytes()) {
        // Whoever reads the output has had enough.
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(Exit::Passed),
        Err(error) => Err(Failure::from(anyhow::Error::new(error).context("cannot write standard output"))),
        Ok(()) => Ok(Exit::Passed),
    }
}
