//! `masseter completions` and `masseter man`: the shell's completions and the manual pages, both made from the
//! definition of the command line.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::{Args, Command};
use clap_complete::Shell;
use clap_mangen::Man;
use masseter_terminal::{Exit, result, result_line};

/// The arguments of `completions`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Example:\n  masseter completions bash > ~/.local/share/bash-completion/completions/masseter"
)]
pub(crate) struct CompletionsArgs {
    /// Shell that completes the command line
    shell: Shell,
}

/// The arguments of `man`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Examples:\n  masseter man | man -l -\n  masseter man --out ~/.local/share/man/man1")]
pub(crate) struct ManArgs {
    /// Folder for one page each verb [default: the page of the whole command, to standard output]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Writes the completions for a shell to standard output.
pub(crate) fn completions(args: &CompletionsArgs, mut command: Command) -> anyhow::Result<Exit> {
    let name = command.get_name().to_owned();
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, name, &mut script);
    result(&String::from_utf8(script)?)?;
    Ok(Exit::Passed)
}

/// Writes manual pages. Pages of a folder that are there already are replaced.
pub(crate) fn manual(args: &ManArgs, command: Command) -> anyhow::Result<Exit> {
    match &args.out {
        Some(folder) => write_pages(command, folder)?,
        None => result(&page(command)?)?,
    }
    Ok(Exit::Passed)
}

fn page(command: Command) -> anyhow::Result<String> {
    let mut page = Vec::new();
    Man::new(command).render(&mut page)?;
    Ok(String::from_utf8(page)?)
}

fn write_pages(command: Command, folder: &Path) -> anyhow::Result<()> {
    let unwritten = || format!("cannot write manual pages to {}", folder.display());
    fs::create_dir_all(folder).with_context(unwritten)?;
    clap_mangen::generate_to(command, folder).with_context(unwritten)?;
    result_line!("{}", folder.display())
}
