//! `masseter robot status` and `report`: the steps that are done, outdated or next. Both read files alone.

use std::fmt::Write;

use masseter_commissioning::{Identity, Known};
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_terminal::{Exit, Tone, result, result_with_tones};

use super::{args::RobotArgs, basis::Basis, evidence::Past, step::Step};

/// The arguments of `robot status` and `robot report`.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "Example:\n  masseter robot status robot.toml")]
pub(crate) struct StatusArgs {
    #[command(flatten)]
    robot: RobotArgs,
}

/// A step of the chain: when it passed, or why it does not count.
struct Link {
    step: Step,
    state: Result<String, String>,
}

/// Prints the chain. Passed once all steps are.
pub(crate) fn status(args: &StatusArgs) -> anyhow::Result<Exit> {
    let (_, _, links) = read(args)?;
    let mut text = String::new();
    for Link { step, state } in &links {
        let (word, more) = match state {
            Ok(started) => ("passed", started),
            Err(why) => ("open", why),
        };
        writeln!(text, "{word:<7} {:<11} {more}", step.to_string())?;
    }
    let next = links.iter().find(|link| link.state.is_err());
    text += &next.map_or("every step passed\n".to_owned(), |open| format!("next: {}\n", open.step.command()));
    result_with_tones(&text, &[("passed", Tone::Good), ("open", Tone::Doubtful)])?;
    Ok(if next.is_none() { Exit::Passed } else { Exit::Failed })
}

/// Prints the chain and every result as Markdown.
pub(crate) fn report(args: &StatusArgs) -> anyhow::Result<Exit> {
    let (past, basis, links) = read(args)?;
    let mut text = "# Bring-up\n\n| step | state |\n| --- | --- |\n".to_owned();
    for Link { step, state } in &links {
        let (Ok(more) | Err(more)) = state;
        writeln!(text, "| {step} | {}{more} |", if state.is_ok() { "passed " } else { "" })?;
    }
    writeln!(text, "\nBuild: {}\n\n| axis | drive |\n| --- | --- |", crate::BUILD)?;
    for (name, drive) in AXIS_NAMES.iter().zip(basis.drives) {
        writeln!(text, "| {name} | {} |", drive.identity().map_or_else(String::new, Identity::to_string))?;
    }
    for evidence in &past.steps {
        let folder = evidence.folder.file_name().unwrap_or_default().display();
        let passed = if evidence.passed { "passed" } else { "not passed" };
        let data = serde_json::to_string_pretty(&evidence.result)?;
        write!(text, "\n## {folder}\n\n{}, {}: {passed}\n\n", evidence.started, evidence.axes.join(" "))?;
        writeln!(text, "```json\n{data}\n```")?;
    }
    result(&text)?;
    Ok(Exit::Passed)
}

fn read(args: &StatusArgs) -> anyhow::Result<(Past, Basis, Vec<Link>)> {
    let past = Past::read(&args.robot.folder)?;
    let newest = |axis: usize| {
        let mut drives = past.steps.iter().rev().map(|evidence| evidence.basis.drives[axis]);
        drives.find(|drive| *drive != Known::NotAsked).unwrap_or(Known::NotAsked)
    };
    let basis = Basis::new(&args.robot.scenario()?, std::array::from_fn(newest));
    let link = |step| Link { step, state: state(&past, &basis, step) };
    let links = Step::chain().into_iter().map(link).collect();
    Ok((past, basis, links))
}

/// The newest time of the step, or why it does not count, with the axes concerned.
fn state(past: &Past, basis: &Basis, step: Step) -> Result<String, String> {
    let (mut newest, mut lacks) = (String::new(), Vec::<(String, Vec<&str>)>::new());
    let axes = step.axes();
    for &axis in &axes {
        match past.check_step(step, axis, basis) {
            Ok(evidence) => newest = newest.max(evidence.started.clone()),
            Err(lack) => {
                let lack = lack.to_string();
                match lacks.iter_mut().find(|(known, _)| *known == lack) {
                    Some((_, names)) => names.push(AXIS_NAMES[axis]),
                    None => lacks.push((lack, vec![AXIS_NAMES[axis]])),
                }
            }
        }
    }
    let with_axes = |(lack, names): &(String, Vec<&str>)| {
        if [1, AXES].contains(&axes.len()) && names.len() == axes.len() {
            lack.clone()
        } else {
            format!("{}: {lack}", names.join(" "))
        }
    };
    if lacks.is_empty() {
        Ok(newest)
    } else {
        Err(lacks.iter().map(with_axes).collect::<Vec<_>>().join("; "))
    }
}
