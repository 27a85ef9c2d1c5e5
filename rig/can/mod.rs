//! `masseter can`: verbs on the CAN link alone. They run no controller and no real interface.

mod client;
mod describe;
mod plan;
mod serve;

use clap::Subcommand;
use masseter_terminal::Exit;

use describe::{DbcArgs, EdsArgs};
use plan::PlanArgs;
use serve::ServeArgs;

/// Verbs of `can`.
#[derive(Debug, Clone, Subcommand)]
pub(crate) enum CanVerb {
    /// Print the load and the worst-case response times of every bus
    Plan(PlanArgs),
    /// Print the electronic data sheet (EDS, CiA 306) of a drive
    Eds(EdsArgs),
    /// Print the messages of the link as a DBC file
    Dbc(DbcArgs),
    /// Serve the simulated buses and drives to other tools (socketcand protocol)
    Serve(ServeArgs),
}

/// Executes a verb.
pub(crate) fn execute(verb: &CanVerb) -> anyhow::Result<Exit> {
    match verb {
        CanVerb::Plan(args) => plan::plan(args),
        CanVerb::Eds(args) => describe::eds(args),
        CanVerb::Dbc(args) => describe::dbc(args),
        CanVerb::Serve(args) => serve::serve(args),
    }
}
