//! `masseter can eds` and `masseter can dbc`: the drives as other tools read them, to standard output.

use std::path::Path;

use masseter_plant::description;

use crate::cli::EdsArgs;
use crate::exit::Exit;
use crate::say::result;
use crate::scenario::given;

/// The electronic data sheet of one drive.
pub(crate) fn eds(args: &EdsArgs) -> anyhow::Result<Exit> {
    let sheets = description::eds(&given(args.scenario.as_deref())?)?;
    result(&sheets[args.axis])?;
    Ok(Exit::Passed)
}

/// The messages of the whole link.
pub(crate) fn dbc(path: Option<&Path>) -> anyhow::Result<Exit> {
    result(&description::dbc(&given(path)?)?)?;
    Ok(Exit::Passed)
}
