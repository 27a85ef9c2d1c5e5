//! `masseter param`: lists, reads and sets the parameters of a running controller.

use clap::{Args, Subcommand};
use masseter_runtime::named::{Parameter, access};
use masseter_runtime::transport::Domain;
use masseter_terminal::{Exit, result_line};

use anyhow::{Context, bail};

/// The verbs of `param`.
#[derive(Debug, Clone, Subcommand)]
pub(crate) enum ParamVerb {
    /// List the parameters with their values, units and ranges
    #[command(after_help = "Example:\n  masseter param list")]
    List(RigArgs),
    /// Print the value of a parameter
    #[command(after_help = "Example:\n  masseter param get integral_gain_per_s")]
    Get {
        /// Name of the parameter
        name: String,
        #[command(flatten)]
        rig: RigArgs,
    },
    /// Set a parameter; the controller takes the value over in its next cycle
    #[command(after_help = "Example:\n  masseter param set integral_gain_per_s=8")]
    Set {
        /// Name and value
        #[arg(value_name = "NAME=VALUE")]
        assignment: String,
        #[command(flatten)]
        rig: RigArgs,
    },
}

/// Which rig.
#[derive(Debug, Clone, Args)]
pub(crate) struct RigArgs {
    /// Name of the rig [default: the only one whose controller has parameters]
    #[arg(long, value_name = "NAME")]
    rig: Option<String>,
}

/// Executes a verb.
pub(crate) fn param(verb: &ParamVerb) -> anyhow::Result<Exit> {
    match verb {
        ParamVerb::List(rig) => {
            for parameter in access::list(&rig.domain()?)? {
                result_line!("{}", describe(&parameter))?;
            }
        }
        ParamVerb::Get { name, rig } => {
            let parameters = access::list(&rig.domain()?)?;
            result_line!("{}", find(&parameters, name)?.value)?;
        }
        ParamVerb::Set { assignment, rig } => {
            let (name, value) = assignment.split_once('=').context("write NAME=VALUE")?;
            let value = value.trim().parse().with_context(|| format!("'{value}' is no number"))?;
            let parameters = access::set(&rig.domain()?, name.trim(), value)?;
            result_line!("{}", describe(find(&parameters, name.trim())?))?;
        }
    }
    Ok(Exit::Passed)
}

impl RigArgs {
    fn domain(&self) -> anyhow::Result<Domain> {
        if let Some(name) = &self.rig {
            return Ok(Domain::named(name)?);
        }
        let mut rigs = access::rigs()?;
        match (rigs.pop(), &rigs[..]) {
            (Some(only), []) => Ok(only),
            (None, _) => {
                bail!("no rig with a parameter runs; start one, such as: masseter run --duration 60")
            }
            (Some(last), others) => {
                let names: Vec<_> = others.iter().chain([&last]).map(Domain::id).collect();
                bail!("several rigs run: choose one by --rig: {}", names.join(", "))
            }
        }
    }
}

fn find<'a>(parameters: &'a [Parameter], name: &str) -> anyhow::Result<&'a Parameter> {
    let found = parameters.iter().find(|parameter| parameter.name == name);
    found.with_context(|| {
        let names: Vec<_> = parameters.iter().map(|parameter| &*parameter.name).collect();
        format!("the controller has no parameter '{name}', but: {}", names.join(", "))
    })
}

fn describe(Parameter { name, unit, about, value, range: [least, most] }: &Parameter) -> String {
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    format!("{name} = {value}{unit}  ({least} to {most})  {about}").trim_end().to_owned()
}
