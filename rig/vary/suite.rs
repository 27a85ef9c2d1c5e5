//! A suite: the scenarios of folders, each run with its own verdict.
//!
//! Under virtual time they run on all cores, without a recording; a scenario that fails is run again with one. Runs
//! with processes come one after the other, since all of them use the same cores.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail, ensure};
use masseter_analysis::Verdict;
use masseter_runtime::clock;
use masseter_terminal::{Exit, Failure, in_one_line, status};
use rayon::prelude::*;

use crate::run::needs_processes;
use crate::run::request::ClockKind;
use crate::run::runner::{Runner, Source};

/// The word of a verdict on a run that left something untested.
const UNTESTED: &str = "UNTESTED";

/// How the scenarios of a suite are run.
pub(crate) struct Suite<'a> {
    pub(crate) runner: Runner<'a>,
    /// The clock of the scenarios that can have it.
    pub(crate) clock: ClockKind,
    /// How often a failed run with processes is tried again.
    pub(crate) retries: u32,
    pub(crate) allow_untested: bool,
    /// Folder for the runs that failed, which nothing makes before.
    pub(crate) out: &'a Path,
}

/// A scenario of a suite.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Case {
    /// Its name in the suite: that of its file, or its path where two files have one name.
    pub(crate) name: String,
    /// Its file.
    pub(crate) path: PathBuf,
}

/// The scenarios of a command line.
#[derive(Debug)]
pub(crate) struct Cases {
    /// Those that run.
    pub(crate) chosen: Vec<Case>,
    /// The number of the others.
    pub(crate) filtered_out: usize,
}

impl Cases {
    /// Finds the scenarios of folders and files, and chooses those with this text in their names.
    ///
    /// # Errors
    /// When a folder or file does not exist, or nothing is left to run.
    pub(crate) fn find(paths: &[PathBuf], filter: Option<&str>) -> anyhow::Result<Self> {
        let mut files = Vec::new();
        for path in paths {
            files.extend(files_of(path)?);
        }
        // A folder may be named beside one of its files.
        let mut seen = BTreeSet::new();
        files.retain(|file| seen.insert(located(file)));
        let all = named(files);
        let (chosen, others): (Vec<_>, Vec<_>) =
            all.into_iter().partition(|case| filter.is_none_or(|text| case.name.contains(text)));
        if let (true, Some(text)) = (chosen.is_empty(), filter) {
            let names: Vec<_> = others.iter().map(|case| case.name.as_str()).collect();
            bail!("no scenario has '{text}' in its name; there are: {}", names.join(", "));
        }
        Ok(Self { chosen, filtered_out: others.len() })
    }
}

/// A file by the one name of its folder. The file may be a link, and its folder has the files that it names.
fn located(file: &Path) -> PathBuf {
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    folder.canonicalize().unwrap_or_else(|_| folder.to_owned()).join(file.file_name().unwrap_or_default())
}

/// The scenarios of a folder in the order of their names, or a file itself.
fn files_of(path: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let unread = || format!("cannot read {}", path.display());
    if fs::metadata(path).with_context(unread)?.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    let entries: Vec<_> = fs::read_dir(path).and_then(Iterator::collect).with_context(unread)?;
    let entries = entries.into_iter().map(|entry: fs::DirEntry| entry.path());
    let is_scenario = |file: &PathBuf| file.extension().is_some_and(|name| name == "toml") && file.is_file();
    let mut files: Vec<_> = entries.filter(is_scenario).collect();
    files.sort();
    ensure!(!files.is_empty(), "{} has no scenario: put *.toml files into it", path.display());
    Ok(files)
}

fn named(files: Vec<PathBuf>) -> Vec<Case> {
    let stem = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut times: BTreeMap<String, usize> = BTreeMap::new();
    for path in &files {
        *times.entry(stem(path)).or_default() += 1;
    }
    let name = |path: &Path| match stem(path) {
        stem if times[&stem] == 1 => stem,
        _ => path.with_extension("").display().to_string(),
    };
    files.into_iter().map(|path| Case { name: name(&path), path }).collect()
}

/// A scenario that was run.
#[derive(Debug)]
pub(crate) struct Tested {
    pub(crate) case: Case,
    /// Its verdict, or why it could not run.
    pub(crate) verdict: Result<Verdict, String>,
    /// The command that shows the run again.
    pub(crate) command: String,
    /// The folder of the run, if it was kept.
    pub(crate) folder: Option<PathBuf>,
    /// How often it was run again until it passed or the tries were over.
    pub(crate) retries: u32,
    /// The time that it took, s.
    pub(crate) took_s: f64,
}

impl Tested {
    pub(crate) fn outcome(&self) -> Outcome {
        self.verdict.as_ref().map_or(Outcome::Failed, Outcome::of)
    }
}

/// How a scenario counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outcome {
    Passed,
    Failed,
    Untested,
}

impl Outcome {
    fn of(verdict: &Verdict) -> Self {
        match verdict.exit_code {
            Exit::Passed => Self::Passed,
            _ if verdict.word == UNTESTED => Self::Untested,
            _ => Self::Failed,
        }
    }

    /// The word in the list of tests.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Passed => "ok",
            Self::Failed => "FAILED",
            Self::Untested => UNTESTED,
        }
    }

    /// Whether a suite with it does not pass.
    pub(crate) fn is_short(self, allow_untested: bool) -> bool {
        self == Self::Failed || self == Self::Untested && !allow_untested
    }
}

/// The verdict on a run, the folder where it is kept, and how often it was tried again.
type Tried = (Verdict, Option<PathBuf>, u32);

impl Suite<'_> {
    /// Runs the scenarios, those with processes last; returns the results in the order of the scenarios. Tells of each
    /// scenario that is over.
    pub(crate) fn run_all(
        &self,
        cases: &[Case],
        tell: impl Fn(&Tested) -> anyhow::Result<()> + Sync,
    ) -> anyhow::Result<Vec<Tested>> {
        let clocked = cases.iter().map(|case| (case, self.clock_of(case))).enumerate();
        let (alone, together): (Vec<_>, Vec<_>) =
            clocked.partition(|(_, (_, clock))| *clock != ClockKind::Virtual);
        if self.clock == ClockKind::Virtual && !alone.is_empty() {
            let names: Vec<_> = alone.iter().map(|(_, (case, _))| case.name.as_str()).collect();
            status!("in lockstep, one after the other, because they need processes: {}", names.join(", "));
        }
        let run = |(number, (case, clock)): (usize, (&Case, ClockKind))| {
            let tested = self.test(case, clock)?;
            Some(tell(&tested).map(|()| (number, tested)))
        };
        let mut all: Vec<_> = together.into_par_iter().filter_map(run).collect::<Result<_, _>>()?;
        for case in alone {
            all.extend(run(case).transpose()?);
        }
        // Nothing is in it if every run with processes passed.
        let _ = fs::remove_dir(self.out);
        all.sort_by_key(|(number, _)| *number);
        Ok(all.into_iter().map(|(_, tested)| tested).collect())
    }

    /// The clock of a scenario: virtual time has no processes that could be killed, and none for a program of the user.
    fn clock_of(&self, case: &Case) -> ClockKind {
        let is_program = self.runner.controller.builder().is_none();
        // A scenario that cannot be read fails under any clock.
        let read = || masseter_plan::read_scenario(Some(&case.path));
        let needs = || read().is_ok_and(|scenario| needs_processes(&scenario));
        match self.clock {
            ClockKind::Virtual if is_program || needs() => ClockKind::Lockstep,
            clock => clock,
        }
    }

    /// Runs a scenario by this clock; none if the user interrupts.
    fn test(&self, case: &Case, clock: ClockKind) -> Option<Tested> {
        if self.is_interrupted() {
            return None;
        }
        let began_ns = clock::now_ns();
        let tried = match clock {
            ClockKind::Virtual => self.in_virtual_time(case),
            _ => self.in_processes(case, clock),
        };
        if self.is_interrupted() {
            return None;
        }
        let took_s = (clock::now_ns() - began_ns) as f64 / 1e9;
        let (verdict, folder, retries) = match tried {
            Ok((verdict, folder, retries)) => (Ok(verdict), folder, retries),
            Err(failure) => (Err(in_one_line(&failure.error)), None, 0),
        };
        let command = self.runner.command(&case.path, clock);
        Some(Tested { case: case.clone(), verdict, command, folder, retries, took_s })
    }

    /// Runs a scenario without a recording. One that does not pass is run again with a recording: the same bytes.
    fn in_virtual_time(&self, case: &Case) -> Result<Tried, Failure> {
        let judged = self.runner.play(Source::File(Some(&case.path)))?;
        let unkept = |verdict| Ok((verdict, None, 0));
        if !self.is_short(&judged.verdict) || self.is_interrupted() {
            return unkept(judged.verdict);
        }
        let folder = self.folder_of(case);
        match self.runner.record_again("the run", &case.path, &folder, &judged.figures.digest) {
            Ok(Some(again)) => Ok((again.verdict, Some(folder), 0)),
            Ok(None) => unkept(judged.verdict),
            // The result is known without the recording.
            Err(failure) if failure.exit == Exit::Incomplete => {
                status!("masseter: {}: no recording: {}", case.name, in_one_line(&failure.error));
                unkept(judged.verdict)
            }
            Err(failure) => Err(failure),
        }
    }

    /// Runs a scenario in three processes, and again while it fails and tries are left.
    fn in_processes(&self, case: &Case, clock: ClockKind) -> Result<Tried, Failure> {
        let folder = self.folder_of(case);
        // Nothing was recorded.
        let unstarted = || Failure::with(Exit::Interrupted, anyhow!("interrupted"));
        let mut retries = 0;
        loop {
            let recorded = self.runner.record(&case.path, clock, &folder);
            let verdict = recorded.and_then(|judgement| Ok(judgement.ok_or_else(unstarted)?.verdict));
            let is_short = verdict.as_ref().map_or(true, |verdict| self.is_short(verdict));
            if is_short && (retries == self.retries || self.is_interrupted()) {
                return Ok((verdict?, Some(folder), retries));
            }
            // Only runs that failed are kept; what cannot be removed stays, and does no harm.
            let _ = fs::remove_dir_all(&folder);
            if !is_short {
                return Ok((verdict?, None, retries));
            }
            retries += 1;
        }
    }

    fn is_short(&self, verdict: &Verdict) -> bool {
        Outcome::of(verdict).is_short(self.allow_untested)
    }

    fn is_interrupted(&self) -> bool {
        self.runner.interrupts.is_stop_requested()
    }

    fn folder_of(&self, case: &Case) -> PathBuf {
        self.out.join(case.name.replace(['/', '\\'], "-"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_with_one_name_go_by_their_paths() {
        let names = |paths: &[&str]| {
            let cases = named(paths.iter().map(PathBuf::from).collect());
            cases.into_iter().map(|case| case.name).collect::<Vec<_>>()
        };
        assert_eq!(names(&["a/one.toml", "b/two.toml"]), ["one", "two"]);
        assert_eq!(names(&["a/one.toml", "b/one.toml", "b/two.toml"]), ["a/one", "b/one", "two"]);
    }
}
