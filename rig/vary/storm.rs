//! Storms: random faults, stimuli and parameters from one seed, played until a law is broken. They stop, go on later,
//! and shrink what they found.
//!
//! [`masseter_campaign`] draws a storm and holds the laws.

use std::collections::BTreeMap;
use std::fs::{self, File};

use clap::value_parser;
use masseter_campaign::{Broken, Law, Shrink, Storms};
use masseter_scenario::input::{MOST_KEPT_BYTES, read_text};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::prelude::*;
use crate::run::runner::{Judged, Runner, Source};

/// Storms between two looks at clock, interrupts and disk, a core.
const BATCH: usize = 16;
/// One storm of so many is played again with a recording.
const RECORDED_EVERY: u64 = 100;
/// Time between two lines of progress, ns.
const PROGRESS_EVERY_NS: u64 = 10_000_000_000;
const LOG: &str = "storms.json";
const LOCK: &str = "lock";

/// What storms came to, as kept in their folder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct StormLog {
    /// The seed of all storms.
    pub(crate) seed: u64,
    /// The digest of the program that plays them.
    program: String,
    /// Who controls the robot.
    controller: String,
    /// The scenario that they change, as TOML.
    base: String,
    /// The number of the next storm.
    pub(crate) next: u64,
    /// Storms played.
    pub(crate) played: u64,
    /// The time that they took, s.
    pub(crate) took_s: f64,
    /// Storms by the word of their verdict.
    pub(crate) verdicts: BTreeMap<String, u64>,
    /// Storms in which a fault of that kind, or a stimulus, acted.
    pub(crate) acted: BTreeMap<String, u64>,
    /// The storms that broke a law.
    pub(crate) violations: Vec<Violation>,
}

/// A storm that broke a law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Violation {
    /// Its number.
    pub(crate) number: u64,
    /// The law, and how.
    #[serde(flatten)]
    pub(crate) broken: Broken,
    /// Its scenario.
    pub(crate) scenario: PathBuf,
    /// The command that plays it again.
    pub(crate) again: String,
    /// The smallest scenario that breaks the law; none where the storm itself cannot be played.
    pub(crate) smallest: Option<PathBuf>,
}

/// When storms end, beside at the first that breaks a law.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct Limits {
    /// The most storms of this call
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = value_parser!(u64).range(1..))]
    storms: u64,
    /// The most time of this call, instead of a number of storms
    #[arg(long, value_name = "MINUTES", conflicts_with = "storms", value_parser = parse_minutes)]
    minutes: Option<f64>,
    /// Go on after a storm that breaks a law
    #[arg(long)]
    go_on: bool,
}

fn parse_minutes(text: &str) -> anyhow::Result<f64> {
    let minutes: f64 = text.parse()?;
    ensure!(minutes.is_finite() && minutes > 0.0, "give a time above 0");
    Ok(minutes)
}

/// Storms in their folder, in which nobody else plays.
pub(crate) struct Season<'a> {
    runner: &'a Runner,
    storms: Storms,
    out: &'a Path,
    log: StormLog,
    _lock: File,
}

impl<'a> Season<'a> {
    /// Begins storms in a folder, from this number on, or goes on with those that began there.
    pub(crate) fn begin(
        runner: &'a Runner,
        base: &Scenario,
        seed: u64,
        from: Option<u64>,
        out: &'a Path,
    ) -> anyhow::Result<Self> {
        fs::create_dir_all(out).with_context(|| out.display().to_string())?;
        let lock = File::create(out.join(LOCK)).with_context(|| out.display().to_string())?;
        lock.try_lock().map_err(|_| anyhow!("another masseter plays storms in {}", out.display()))?;
        let new = StormLog {
            seed,
            program: super::play::this_program()?,
            controller: runner.controller.name().unwrap_or_default(),
            base: base.to_toml(),
            next: from.unwrap_or(0),
            played: 0,
            took_s: 0.0,
            verdicts: BTreeMap::new(),
            acted: BTreeMap::new(),
            violations: Vec::new(),
        };
        let path = out.join(LOG);
        let log = if path.exists() { read_log(&path, &new)? } else { new };
        ensure!(
            from.is_none_or(|from| from == log.next),
            "the storms in {} go on with number {}; leave --from away, or choose another --out",
            out.display(),
            log.next
        );
        Ok(Self { runner, storms: Storms::new(base, seed), out, log, _lock: lock })
    }

    /// Plays storms until a law is broken, a limit is reached or the user interrupts.
    pub(crate) fn play(mut self, limits: Limits) -> Result<StormLog, Failure> {
        let (began_ns, mut said_ns) = (clock::now_ns(), clock::now_ns());
        let (mut left, most_s) =
            limits.minutes.map_or((limits.storms, f64::INFINITY), |minutes| (u64::MAX, minutes * 60.0));
        let lasted_s = |now_ns: u64| (now_ns - began_ns) as f64 / 1e9;
        let before_s = self.log.took_s;
        while left > 0 && lasted_s(clock::now_ns()) < most_s {
            let count = left.min((BATCH * rayon::current_num_threads()) as u64);
            let numbers = self.log.next..self.log.next + count;
            let played: Vec<_> = numbers.into_par_iter().map(|number| self.play_one(number)).collect();
            if self.runner.is_interrupted() {
                break;
            }
            left -= count;
            self.log.next += count;
            let broken = self.count(played)?;
            let now_ns = clock::now_ns();
            self.log.took_s = before_s + lasted_s(now_ns);
            self.write()?;
            if broken && !limits.go_on {
                break;
            }
            if now_ns - said_ns >= PROGRESS_EVERY_NS {
                said_ns = now_ns;
                let StormLog { played, took_s, violations, .. } = &self.log;
                let an_hour = *played as f64 / took_s * 3600.0;
                status!("{played} storms, {an_hour:.0} an hour, {} broke a law", violations.len());
            }
        }
        self.write()?;
        Ok(self.log)
    }

    fn play_one(&self, number: u64) -> Played {
        let storm = self.storms.draw(number);
        let unplayed = || Outcome::unplayed("REFUSED", "the base scenario leaves no valid storm".to_owned());
        let with_recording = number.is_multiple_of(RECORDED_EVERY);
        let outcome = storm.as_ref().map_or_else(unplayed, |storm| self.judge(storm, with_recording));
        Played { number, storm, outcome }
    }

    fn judge(&self, storm: &Scenario, with_recording: bool) -> Outcome {
        let judged = |Judged { verdict, figures }: Judged| {
            let struck =
                storm.faults.iter().zip(&figures.faults).filter(|(_, found)| found.struck_ns.is_some());
            let mut acted: Vec<_> = struck.map(|(fault, _)| fault.kind.to_string()).collect();
            acted.extend(storm.stimulus.iter().map(ToString::to_string));
            acted.sort_unstable();
            acted.dedup();
            let broken = Broken::find(storm, &verdict, &figures)
                .or_else(|| with_recording.then(|| self.differs(storm, &figures.digest)).flatten());
            Outcome { word: verdict.word, acted, broken }
        };
        // Laws that panic break the first law.
        self.runner
            .play_and(Source::Scenario(storm), judged)
            .unwrap_or_else(|failure| Outcome::unplayed("DIED", format!("{:#}", failure.error)))
    }

    /// How the storm with a recording differs from the one without.
    // What the disk refuses is no law of the rig.
    fn differs(&self, storm: &Scenario, digest: &str) -> Option<Broken> {
        let recorded = || -> Result<_, Failure> {
            let folder = tempfile::tempdir().context("no temporary folder").incomplete()?;
            let file = folder.path().join("storm.toml");
            fs::write(&file, storm.to_toml()).context("cannot write the storm").incomplete()?;
            self.runner.record_again("the storm", file.as_path().into(), &folder.path().join("run"), digest)
        };
        recorded()
            .err()
            .filter(|failure| failure.exit != Exit::Incomplete)
            .map(|failure| Broken { law: Law::Complete, by: format!("{:#}", failure.error) })
    }

    /// Enters storms into the log; returns whether one broke a law.
    fn count(&mut self, played: Vec<Played>) -> Result<bool, Failure> {
        let before = self.log.violations.len();
        for Played { number, storm, outcome: Outcome { word, acted, broken } } in played {
            self.log.played += 1;
            *self.log.verdicts.entry(word.to_owned()).or_default() += 1;
            for what in acted {
                *self.log.acted.entry(what).or_default() += 1;
            }
            if let Some(broken) = broken {
                let violation = self.keep(number, storm.as_ref(), broken).incomplete()?;
                self.log.violations.push(violation);
            }
        }
        Ok(self.log.violations.len() > before)
    }

    /// Writes a storm that broke a law, and the smallest one.
    fn keep(&self, number: u64, storm: Option<&Scenario>, broken: Broken) -> anyhow::Result<Violation> {
        let path = self.out.join(format!("storm-{number}.toml"));
        let write = |path: &Path, text: &str| {
            fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
        };
        let mut smallest = None;
        if let Some(storm) = storm {
            write(&path, &storm.to_toml())?;
            status!("storm {number} breaks a law; {broken}; shrinking");
            let with_recording = broken.law == Law::Complete;
            let breaks = |smaller: &Scenario| {
                let same = |found: Broken| found.law == broken.law;
                !self.runner.is_interrupted() && self.judge(smaller, with_recording).broken.is_some_and(same)
            };
            let text = Shrink::run(breaks, storm);
            let small = self.out.join(format!("storm-{number}-smallest.toml"));
            write(&small, &text)?;
            smallest = Some(small);
        }
        let again = self.runner.command(path.as_path().into(), crate::run::request::ClockKind::Virtual);
        Ok(Violation { number, broken, scenario: path, again, smallest })
    }

    /// Writes the log, whole or not at all.
    fn write(&self) -> Result<(), Failure> {
        let path = self.out.join(LOG);
        let unfinished = path.with_extension("part");
        let text = serde_json::to_string_pretty(&self.log).expect("a log has a JSON form");
        let written = fs::write(&unfinished, text + "\n").and_then(|()| fs::rename(&unfinished, &path));
        written.with_context(|| format!("cannot write {}", path.display())).incomplete()
    }
}

/// A storm that was played.
struct Played {
    number: u64,
    storm: Option<Scenario>,
    outcome: Outcome,
}

/// The word of a storm's verdict, what acted, and the law that it breaks.
struct Outcome {
    word: &'static str,
    acted: Vec<String>,
    broken: Option<Broken>,
}

impl Outcome {
    fn unplayed(word: &'static str, by: String) -> Self {
        Self { word, acted: Vec::new(), broken: Some(Broken { law: Law::Judged, by }) }
    }
}

/// The log of a folder; refused where its storms are others.
fn read_log(path: &Path, new: &StormLog) -> anyhow::Result<StormLog> {
    let text = read_text(path, MOST_KEPT_BYTES).with_context(|| path.display().to_string())?;
    let log: StormLog = serde_json::from_str(&text)
        .with_context(|| format!("{} is no log of storms; choose another --out", path.display()))?;
    let differences = [
        (log.seed != new.seed, "another seed"),
        (log.base != new.base, "another scenario"),
        (log.controller != new.controller, "another controller"),
        (log.program != new.program, "another build of masseter"),
    ];
    let difference = differences.iter().find(|(differs, _)| *differs);
    ensure!(
        difference.is_none(),
        "the storms in {} have {}; choose another --out",
        path.parent().unwrap_or(path).display(),
        difference.map_or("", |(_, what)| what)
    );
    Ok(log)
}

/// What storms came to, in words.
pub(crate) fn in_words(log: &StormLog) -> String {
    use std::fmt::Write;
    let StormLog { seed, next, played, took_s, verdicts, violations, .. } = log;
    let an_hour = *played as f64 / took_s.max(f64::MIN_POSITIVE) * 3600.0;
    let mut text = format!("{played} storms of seed {seed} in {took_s:.0} s ({an_hour:.0} an hour)");
    for (word, count) in verdicts {
        let _ = write!(text, ", {count} {word}");
    }
    let _ = writeln!(text, "; the next is {next}");
    for Violation { number, broken, again, smallest, .. } in violations {
        let _ = writeln!(text, "storm {number} breaks a law; {broken}\n  again: {again}");
        if let Some(smallest) = smallest {
            let _ = writeln!(text, "  smallest: {}", smallest.display());
        }
    }
    if violations.is_empty() {
        text.push_str("no law is broken\n");
    }
    text
}

/// [`Exit::Passed`] where no law is broken.
pub(crate) fn exit_of(log: &StormLog, runner: &Runner) -> Exit {
    match (log.violations.is_empty(), runner.is_interrupted()) {
        (false, _) => Exit::Failed,
        (true, true) => Exit::Interrupted,
        (true, false) => Exit::Passed,
    }
}
