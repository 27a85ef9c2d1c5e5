//! The overview of all verbs, grouped by what a user wants.

use std::fmt::Write;

use clap::Command;

/// What a user wants, and the verbs for that.
const GROUPS: [(&str, &[&str]); 8] = [
    ("Play a motion and judge it", &["init", "motion", "run", "test", "signals", "faults"]),
    ("Play a scenario in many variants", &["campaign", "search", "shrink"]),
    ("Work with past runs", &["report", "export", "replay", "diff", "recording"]),
    ("Bring your own controller", &["new", "interface", "controller", "param"]),
    ("Prepare this machine", &["doctor", "bench", "clean"]),
    ("Work with CAN and the drives", &["robot", "can", "plant"]),
    ("Solve the kinematics", &["ik", "fk"]),
    ("Set up the shell", &["completions", "man"]),
];

/// The command with this overview as its help. clap itself knows one group of verbs only.
pub(crate) fn with_overview(command: Command) -> Command {
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
