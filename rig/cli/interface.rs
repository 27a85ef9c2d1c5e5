//! `masseter interface`: the messages and codes between the rig and a controller in other languages.
//!
//! It prints the files that users include. `tests/interface.rs` makes them from the one table of the messages.

use masseter_terminal::{Exit, result};

/// The arguments of `interface`.
#[derive(Debug, Clone, clap::Args)]
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

/// Prints the types.
pub(super) fn interface(args: &InterfaceArgs) -> anyhow::Result<Exit> {
    result(match args.language {
        Language::C => include_str!("../bindings/interface/masseter_messages.h"),
        Language::Python => include_str!("../bindings/python/masseter/messages.py"),
    })?;
    Ok(Exit::Passed)
}
