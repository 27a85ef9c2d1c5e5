//! Help: the overview of all verbs, grouped by purpose; `masseter completions` and `masseter man`. All of
//! it is made from the definition of the command line.

use std::fmt::Write;

use clap::Command;

use crate::BUILD;
use crate::prelude::*;

/// What a user wants, and the verbs for that.
const GROUPS: [(&str, &[&str]); 8] = [
    ("Play a motion and judge it", &["init", "motion", "run", "test", "signals", "faults"]),
    ("Play a scenario in many variants", &["campaign", "search", "shrink", "storm"]),
    (
        "Work with past runs",
        &["report", "compare", "export", "why", "identify", "replay", "diff", "recording"],
    ),
    ("Bring your own controller", &["new", "interface", "controller", "param"]),
    ("Prepare this machine", &["doctor", "clean"]),
    ("Work with CAN and the drives", &["robot", "can", "plant"]),
    ("Solve the kinematics", &["ik", "fk"]),
    ("Set up the shell", &["completions", "man"]),
];

/// The command with this overview as its help. clap itself knows one group of verbs only.
pub(super) fn with_overview(command: Command) -> Command {
    let header = *command.get_styles().get_header();
    let literal = *command.get_styles().get_literal();
    let mut overview = String::new();
    for (purpose, verbs) in GROUPS {
        let _ = writeln!(overview, "{header}{purpose}:{header:#}");
        for verb in verbs.iter().filter_map(|verb| command.find_subcommand(verb)) {
            let about = verb.get_about().map(ToString::to_string).unwrap_or_default();
            let _ = writeln!(overview, "  {literal}{:<11}{literal:#}  {about}", verb.get_name());
        }
        overview.push('\n');
    }
    let template = format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{overview}{header}Options:{header:#}\n{{options}}{{after-help}}"
    );
    command.help_template(template)
}

/// The arguments of `completions`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Example:\n  masseter completions bash > ~/.local/share/bash-completion/completions/masseter"
)]
pub(super) struct CompletionsArgs {
    /// Shell that completes the command line
    shell: clap_complete::Shell,
}

/// The arguments of `man`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Examples:\n  masseter man | man -l -\n  masseter man --out ~/.local/share/man/man1")]
pub(super) struct ManArgs {
    /// Folder for one page each verb [default: the page of the whole command, to standard output]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Writes the completions for a shell to standard output.
pub(super) fn completions(args: &CompletionsArgs, command: &Command) -> anyhow::Result<Exit> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut without_hidden_verbs(command), command.get_name(), &mut script);
    result(&String::from_utf8(script)?)?;
    Ok(Exit::Passed)
}

/// As much of a command as its completions need: `clap_complete` would offer hidden verbs too.
fn without_hidden_verbs(command: &Command) -> Command {
    let verbs = command.get_subcommands().filter(|verb| !verb.is_hide_set());
    Command::new("masseter").version(BUILD).args(command.get_arguments().cloned()).subcommands(verbs.cloned())
}

/// Writes manual pages. Pages of a folder that are there already are replaced.
pub(super) fn manual(args: &ManArgs, command: Command) -> anyhow::Result<Exit> {
    match &args.out {
        Some(folder) => write_pages(command, folder)?,
        None => result(&page(command)?)?,
    }
    Ok(Exit::Passed)
}

fn page(command: Command) -> anyhow::Result<String> {
    let mut page = Vec::new();
    clap_mangen::Man::new(command).render(&mut page)?;
    Ok(String::from_utf8(page)?)
}

fn write_pages(command: Command, folder: &Path) -> anyhow::Result<()> {
    let unwritten = || format!("cannot write manual pages to {}", folder.display());
    fs::create_dir_all(folder).with_context(unwritten)?;
    clap_mangen::generate_to(command, folder).with_context(unwritten)?;
    result_line!("{}", folder.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_visible_verb_of_the_overview_is_there_and_the_others_are_not() {
        let command = with_overview(
            Command::new("any")
                .subcommand(Command::new("ik").about("Inverse"))
                .subcommand(Command::new("other").hide(true)),
        );
        let help = command.clone().render_help().to_string();
        assert!(help.contains("Solve the kinematics:\n  ik           Inverse\n"), "{help}");
        assert!(!help.contains("other"), "{help}");
    }
}
