//! The runner of many runs: plays a scenario by a controller, recorded or not, and judges it. Suite, campaign, search,
//! shrinking and the matrix of faults play their runs here.
//!
//! Each run is by itself: a panic is the failure of its own run, and the others go on.

use std::panic::{self, AssertUnwindSafe};

use masseter_controller::process::BuildController;
use masseter_judge::{Figures, Verdict};
use masseter_virtual_time::Requests;

use super::interrupts::Interrupts;
use super::prepared::{PreparedRun, analyse_unrecorded};
use super::request::{ClockKind, ControllerChoice, RunRequest, name_of};
use super::resolve::{resolve, resolve_simulated};
use crate::prelude::*;

/// Plays runs by one controller, until the user interrupts.
#[derive(Default)]
pub(crate) struct Runner {
    pub(crate) controller: ControllerChoice,
    pub(crate) interrupts: Interrupts,
}

/// The scenario of a file, with values changed, each as `KEY=VALUE`.
#[derive(Clone, Copy)]
pub(crate) struct ScenarioFile<'a> {
    pub(crate) path: &'a Path,
    pub(crate) set: &'a [String],
}

impl<'a> From<&'a Path> for ScenarioFile<'a> {
    fn from(path: &'a Path) -> Self {
        Self { path, set: &[] }
    }
}

/// The scenario that is played.
#[derive(Clone, Copy)]
pub(crate) enum Source<'a> {
    File(ScenarioFile<'a>),
    /// A scenario whose files are found already.
    Scenario(&'a Scenario),
}

/// A run that was played and judged.
pub(crate) struct Judged {
    pub(crate) verdict: Verdict,
    pub(crate) figures: Figures,
}

impl Runner {
    /// The runner of a verb, which handles signals from now on.
    pub(crate) fn of_verb(controller: ControllerChoice) -> Result<Self, Failure> {
        Ok(Self { controller, interrupts: Interrupts::of_verb()? })
    }

    /// Whether the user interrupts.
    pub(crate) fn is_interrupted(&self) -> bool {
        self.interrupts.is_stop_requested()
    }

    /// Plays a scenario under virtual time, without a recording.
    ///
    /// # Errors
    /// [`Exit::Usage`] for a scenario that cannot be played.
    pub(crate) fn play(&self, source: Source<'_>) -> Result<Judged, Failure> {
        self.play_and(source, |judged| judged)
    }

    /// The same, and looks at what was judged; a panic in the look is the failure of the run, too.
    pub(crate) fn play_and<T>(
        &self,
        source: Source<'_>,
        look: impl FnOnce(Judged) -> T,
    ) -> Result<T, Failure> {
        let build = self.controller.builder();
        let build = build.context("virtual time runs controllers of the rig alone").usage()?;
        let judged = self.play_by(build, source)?;
        guarded(|| Ok(look(judged)))
    }

    /// The same by another controller.
    pub(crate) fn play_by(&self, build: BuildController, source: Source<'_>) -> Result<Judged, Failure> {
        guarded(|| {
            let plan = match source {
                Source::File(file) => resolve(&self.request(file, ClockKind::Virtual)).map(|(plan, _)| plan),
                Source::Scenario(scenario) => resolve_simulated(scenario, None, build),
            };
            let (manifest, figures) =
                analyse_unrecorded(&plan.usage()?, &self.controller, build, &self.interrupts)?;
            Ok(Judged { verdict: Verdict::new(&manifest, &figures), figures })
        })
    }

    /// Plays the scenario of a file by this clock into a folder, and writes the report there. None if the user
    /// interrupts before anything is recorded.
    pub(crate) fn record(
        &self,
        file: ScenarioFile<'_>,
        clock: ClockKind,
        folder: &Path,
    ) -> Result<Option<Verdict>, Failure> {
        let request = RunRequest { out: Some(folder.to_owned()), ..self.request(file, clock) };
        guarded(|| PreparedRun::new(&request)?.play(&self.interrupts)?.judge_unseen())
    }

    /// Plays a run under virtual time again, with a recording, and refuses another digest than before. None if the user
    /// interrupts. `name` is the run's name in the refusal.
    pub(crate) fn record_again(
        &self,
        name: &str,
        file: ScenarioFile<'_>,
        folder: &Path,
        digest: &str,
    ) -> Result<Option<Verdict>, Failure> {
        let again = self.record(file, ClockKind::Virtual, folder)?;
        let Some(again) = again.filter(|_| !self.is_interrupted()) else { return Ok(None) };
        if again.digest != digest {
            let what =
                format!("{name} with a recording ({}) differs from the one without ({digest})", again.digest);
            return Err(defect(Exit::Failed, &what));
        }
        Ok(Some(again))
    }

    /// The command that shows the run of a file again.
    pub(crate) fn command(&self, file: ScenarioFile<'_>, clock: ClockKind) -> String {
        let path = word(&file.path.display().to_string());
        let set: String = file.set.iter().flat_map(|value| [" --set ".to_owned(), word(value)]).collect();
        let controller = self.controller.name();
        let controller = controller.map_or_else(String::new, |name| format!(" --controller {}", word(&name)));
        format!("masseter run {path}{set} --clock {}{controller}", name_of(&clock))
    }

    fn request(&self, file: ScenarioFile<'_>, clock: ClockKind) -> RunRequest {
        RunRequest {
            scenario: Some(file.path.to_owned()),
            set: file.set.to_vec(),
            clock,
            controller: self.controller.clone(),
            quiet: true,
            ..RunRequest::default()
        }
    }
}

/// Plays one run; a panic is its failure.
fn guarded<T>(run: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    // What it leaves half done belongs to this run alone.
    panic::catch_unwind(AssertUnwindSafe(run)).unwrap_or_else(|payload| {
        let texts = [payload.downcast_ref::<String>().map(String::as_str), payload.downcast_ref().copied()];
        let why = texts.into_iter().flatten().next().unwrap_or("it gave no message");
        Err(defect(Exit::Died, &format!("DIED: the rig panicked: {why}")))
    })
}

fn defect(exit: Exit, what: &str) -> Failure {
    Failure::with(exit, anyhow!("{what}: report this as a defect of masseter"))
}

/// The text as one word of a shell's command line, quoted where a shell would read more.
pub(crate) fn word(text: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+=:,@%".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) {
        return text.to_owned();
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_the_failure_of_its_run() {
        let said = |run: fn() -> Result<u8, Failure>| guarded(run).unwrap_err().error.to_string();
        assert!(said(|| panic!("of {}", 3)).starts_with("DIED: the rig panicked: of 3: "));
        assert!(said(|| panic!("plain")).starts_with("DIED: the rig panicked: plain: "));
        assert!(said(|| panic::panic_any(7)).contains("it gave no message"));
        assert_eq!(guarded(|| Ok(1)).ok(), Some(1));
    }

    #[test]
    fn a_word_is_quoted_where_a_shell_would_read_more_than_one() {
        assert_eq!(word("a/b-1.toml"), "a/b-1.toml");
        assert_eq!(word("my file.toml"), "'my file.toml'");
        assert_eq!(word("it's"), r"'it'\''s'");
    }
}
