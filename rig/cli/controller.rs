//! The verbs for one's own controller: `masseter controller` attaches one of the rig's to a rig, or is the
//! controller's process of a run; `masseter param` lists, reads and sets the parameters of a running one; `masseter
//! signals` lists what `[[require]]` can use; `masseter interface` prints the messages for other languages.

use masseter_controller::process;
use masseter_judge::{requirements::event_names, signals::Registry};
use masseter_plan::{RunPlan, read_scenario};
use masseter_runtime::named::{Parameter, access};
use masseter_runtime::{control::Outcome, transport::Domain};

use crate::prelude::*;

/// The arguments of `controller`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Example:\n  masseter run --controller external --name bench\n  masseter controller --rig bench"
)]
pub(super) struct ControllerArgs {
    /// Name of the rig [default: that of MASSETER_RIG, or the only rig that takes a controller]
    #[arg(long, value_name = "NAME")]
    rig: Option<String>,
    /// Which controller
    #[arg(long, value_enum, default_value_t)]
    kind: crate::run::request::ControllerKind,
    #[command(flatten)]
    process: Option<super::arguments::ProcessArgs>,
}

/// Runs the controller to the end of its motion or a safe stop.
pub(super) fn control(args: ControllerArgs) -> anyhow::Result<Exit> {
    let build = args.kind.builder();
    let outcome = match args.process {
        Some(process) => process::run(&process.process_arguments(), build)?,
        None => process::run_attached(args.rig.as_deref(), build)?,
    };
    Ok(match outcome {
        Outcome::Finished => Exit::Passed,
        Outcome::SafeStop => Exit::SafeStop,
    })
}

/// The verbs of `param`.
#[derive(Debug, Clone, clap::Subcommand)]
pub(super) enum ParamVerb {
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
pub(super) struct RigArgs {
    /// Name of the rig [default: the only one whose controller has parameters]
    #[arg(long, value_name = "NAME")]
    rig: Option<String>,
}

/// Executes a verb.
pub(super) fn param(verb: &ParamVerb) -> anyhow::Result<Exit> {
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

/// The arguments of `signals`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  masseter signals | grep incisal\n  masseter signals --controller hold | grep '^signal'"
)]
pub(super) struct SignalsArgs {
    /// Scenario file [default: the built-in scenario, ten seconds of chewing]
    scenario: Option<PathBuf>,
    /// Whose own signals and parameters are listed too: motion, hold, or a program, which is started and left before the
    /// first cycle [default: motion]
    #[arg(
        long,
        value_name = "motion|hold|PROGRAM|fmu:FILE.fmu",
        default_value = "motion",
        hide_default_value = true
    )]
    controller: crate::run::request::ControllerChoice,
    /// Which values of the rig the variables of an FMU are [default: the FMU's path with .toml]
    #[arg(long, value_name = "FILE.toml")]
    map: Option<String>,
    /// Format of standard output
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Prints every signal with its unit and its meaning, and the names of states.
pub(super) fn signals(args: &SignalsArgs) -> anyhow::Result<Exit> {
    let plan = RunPlan::of_file(read_scenario(args.scenario.as_deref())?, args.scenario.as_deref())?;
    let controller = args.controller.clone().with_map(args.map.as_ref())?;
    let registry = Registry::new(&plan.scenario, &crate::run::declared_by(&controller, &plan)?);
    let text = match args.format {
        Format::Json => serde_json::to_string_pretty(registry.signals())? + "\n",
        Format::Human => {
            let signals = registry.signals().iter().fold(String::new(), |text, signal| {
                text + &format!("{:<26} {:<6} {}\n", signal.name, signal.unit, signal.about)
            });
            let states =
                registry.signals().iter().fold(String::new(), |text, signal| match signal.states() {
                    Some(states) => {
                        let names: Vec<_> = states.into_iter().map(|(name, _)| name).collect();
                        text + &format!("states of {}: {}\n", signal.name, names.join(", "))
                    }
                    None => text,
                });
            let names: Vec<_> = event_names().collect();
            format!("{signals}\n{states}\nevents: {}\n", names.join(", "))
        }
    };
    result(&text)?;
    Ok(Exit::Passed)
}

/// The arguments of `interface`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example:\n  masseter interface c > masseter_messages.h")]
pub(super) struct InterfaceArgs {
    /// Language
    #[arg(value_enum)]
    language: Language,
}

/// A language with generated types.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Language {
    /// C header, for C++ too
    C,
    /// Python module: ctypes, NumPy types, enumerations
    Python,
}

/// Prints the files that users include. `tests/interface.rs` makes them from the one table of the messages.
pub(super) fn interface(args: &InterfaceArgs) -> anyhow::Result<Exit> {
    result(match args.language {
        Language::C => include_str!("../bindings/interface/masseter_messages.h"),
        Language::Python => include_str!("../bindings/python/masseter/messages.py"),
    })?;
    Ok(Exit::Passed)
}
