//! The laws that no storm may break, whatever acts on the rig.
//!
//! A safe stop breaks none: it is what a fault shall lead to. That the rig neither panics nor refuses a storm, and that a
//! storm played again is the same, shows only who plays it.

use std::fmt::{self, Display, Formatter};
use std::sync::LazyLock;

use masseter_judge::{Breach, Check, CheckResult, FaultFigures, Figures, Verdict};
use masseter_runtime::messages::codes::EventKind;
use masseter_scenario::{
    AxisFault, ChecksConfig, DriveFault, FaultConfig, FaultKindConfig, Quantity, Scenario,
};
use serde::{Deserialize, Serialize};

/// The matrix of faults: what detects each of them.
const MATRIX: &str = include_str!("../../../../docs/faults-matrix.csv");
/// A fault of the matrix acts so long; a shorter one need not show, s.
const LONG_S: f64 = 0.5;
/// The time that a report may take beyond the longest of the matrix, ns: an axis may rest as long before the fault shows.
const MARGIN_NS: u64 = 1_000_000_000;

/// What must hold of every storm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Law {
    /// The rig plays the storm to an end that can be judged, and does not panic.
    Judged,
    /// A jaw beyond its limits is reported, unless a fault acts that the matrix calls undetected.
    NoSilentDeviation,
    /// A run in which the jaw left its limits does not pass.
    NoWrongPass,
    /// A fault that the matrix calls detected is reported in the time that the matrix says, with a margin.
    Detected,
    /// The mechanism stands still after a stop, unless nothing holds the jaw, or a fault that was not yet detected led it away
    /// before.
    Standstill,
    /// No message is missing, and the same storm has the same messages with a recording.
    Complete,
    /// The requirements of the base scenario hold.
    Requirement,
}

impl Display for Law {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Judged => "every storm ends and can be judged",
            Self::NoSilentDeviation => "no silent deviation",
            Self::NoWrongPass => "no wrong pass",
            Self::Detected => "what the matrix calls detected is detected",
            Self::Standstill => "standstill after a stop",
            Self::Complete => "the recording is complete",
            Self::Requirement => "the requirements hold",
        })
    }
}

/// A law that a storm broke, and how.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Broken {
    /// The law.
    pub law: Law,
    /// What happened instead, in words.
    pub by: String,
}

impl Broken {
    /// The first law that a run of this storm breaks, in the order of [`Law`]; none where all hold.
    pub fn find(storm: &Scenario, verdict: &Verdict, figures: &Figures) -> Option<Self> {
        let run = Run { storm, verdict, figures };
        let laws = [
            (Law::Judged, run.unjudged()),
            (Law::NoSilentDeviation, run.silent_deviation()),
            (Law::NoWrongPass, run.wrong_pass()),
            (Law::Detected, run.undetected()),
            (Law::Standstill, run.moved()),
            (Law::Complete, run.incomplete()),
            (Law::Requirement, run.failed_requirement()),
        ];
        laws.into_iter().find_map(|(law, by)| Some(Self { law, by: by? }))
    }
}

impl Display for Broken {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.law, self.by)
    }
}

/// A storm that was played and judged.
struct Run<'a> {
    storm: &'a Scenario,
    verdict: &'a Verdict,
    figures: &'a Figures,
}

impl Run<'_> {
    /// Under virtual time neither the machine nor a process disturbs a run.
    fn unjudged(&self) -> Option<String> {
        let Verdict { word, reason, .. } = self.verdict;
        ["DIED", "INVALID", "INCOMPLETE"].contains(word).then(|| format!("{word}: {reason}"))
    }

    fn silent_deviation(&self) -> Option<String> {
        let breach = self.left_path()?;
        (!self.has_undetected() && !self.is_reported()).then_some(breach)
    }

    /// Whether a fault acts that the matrix calls undetected.
    fn has_undetected(&self) -> bool {
        self.struck().any(|(fault, _)| !is_always_reported(fault.kind))
    }

    fn wrong_pass(&self) -> Option<String> {
        self.left_path().filter(|_| self.verdict.word == "PASS")
    }

    /// How the jaw first left its path; none if it did not.
    fn left_path(&self) -> Option<String> {
        let Breach { what, value, limit, .. } = self.figures.path_breach.first.as_ref()?;
        Some(format!("{what} {value}, limit {limit}"))
    }

    fn undetected(&self) -> Option<String> {
        let figures = self.figures;
        let first_ns = figures.events.iter().find(|event| event.kind == EventKind::Fault);
        let first_ns = first_ns.map_or(u64::MAX, |event| event.time_ns);
        let ended_ns = figures.path_breach.motion_ns.map_or(0, |[_, to_ns]| to_ns);
        // Of several faults before the first report, each may be what it reports.
        let is_missed = |(fault, struck_ns): &(&FaultConfig, u64)| {
            let due_ns = struck_ns + longest_ns(fault.kind) + MARGIN_NS;
            is_as_in_matrix(fault) && due_ns < first_ns && due_ns < ended_ns
        };
        let (fault, struck_ns) = self.struck().find(is_missed)?;
        let within_s = (longest_ns(fault.kind) + MARGIN_NS) as f64 / 1e9;
        let struck_s = struck_ns as f64 / 1e9;
        Some(format!(
            "{fault} struck at {struck_s:.3} s of the run, and nobody reported it within {within_s:.2} s"
        ))
    }

    fn moved(&self) -> Option<String> {
        let check = self.verdict.checks.iter().find(|check| check.name == "standstill")?;
        // A fault that begins while the rig stands still strikes no part of the test.
        let is_let_go = self.storm.faults.iter().any(|fault| moves_on(fault.kind));
        // Pressed against its stops, the jaw gives way as the drives let go.
        let is_pressed = self.left_path().is_some() && self.has_undetected();
        let was_late = self.figures.faults.iter().any(|fault| was_detected_late(fault, &self.storm.checks));
        let is_excused = is_let_go || ((is_pressed || was_late) && self.has_settled());
        (check.result == CheckResult::Failed && !is_excused).then(|| check.finding.clone())
    }

    /// Whether the jaw stood once its axes had run into their brakes: no late detection excuses a fall.
    fn has_settled(&self) -> bool {
        let ChecksConfig { standstill_jaw_mm, standstill_jaw_deg, .. } = self.storm.checks;
        let [mm, deg] = self.figures.standstill.settled;
        mm <= standstill_jaw_mm && deg <= standstill_jaw_deg
    }

    fn incomplete(&self) -> Option<String> {
        let missing = self.figures.missing_messages();
        (missing > 0).then(|| format!("{missing} messages are missing"))
    }

    fn failed_requirement(&self) -> Option<String> {
        let failed = |check: &&Check| check.is_requirement() && check.result == CheckResult::Failed;
        let check = self.verdict.checks.iter().find(failed)?;
        Some(format!("{} {}", check.name, check.finding))
    }

    /// The faults that struck, each with the time.
    fn struck(&self) -> impl Iterator<Item = (&FaultConfig, u64)> {
        let figures = self.figures.faults.iter();
        self.storm
            .faults
            .iter()
            .zip(figures)
            .filter_map(|(fault, FaultFigures { struck_ns, .. })| Some((fault, (*struck_ns)?)))
    }

    /// An emergency without an error is no report of a deviation.
    fn is_reported(&self) -> bool {
        let mut faults = self.figures.events.iter().filter(|event| event.kind == EventKind::Fault);
        faults.any(|event| !event.is_without_error())
    }
}

/// The rows of the matrix of one kind: who reports, and when, ms.
fn rows(kind: FaultKindConfig) -> impl Iterator<Item = (&'static str, f64)> {
    static ROWS: LazyLock<Vec<Vec<&str>>> =
        LazyLock::new(|| MATRIX.lines().skip(1).map(|line| line.split(',').collect()).collect());
    let of_kind = ROWS.iter().filter(move |row| row[0] == kind.name());
    of_kind.map(|row| (row[6], row[8].parse().unwrap_or(0.0)))
}

/// Whether somebody reports a fault of this kind in every row of the matrix.
fn is_always_reported(kind: FaultKindConfig) -> bool {
    rows(kind).next().is_some() && rows(kind).all(|(who, _)| who != "nobody")
}

/// The longest time from the strike to the report in the matrix, ns.
fn longest_ns(kind: FaultKindConfig) -> u64 {
    (rows(kind).map(|(_, latency_ms)| latency_ms).fold(0.0, f64::max) * 1e6) as u64
}

/// Whether the jaw may move after a stop with such a fault: nothing holds it, or only within a play.
fn moves_on(kind: FaultKindConfig) -> bool {
    use AxisFault::{BrokenRod, Play};
    [DriveFault::BrakeOpen.into(), DriveFault::Runaway.into(), BrokenRod.into(), Play.into()].contains(&kind)
}

/// Whether a fault is one that the matrix calls detected: of its kind, as large, as long, on every frame.
fn is_as_in_matrix(fault: &FaultConfig) -> bool {
    let example = fault.kind.declared().size.and_then(|size| size.example.parse::<Quantity>().ok());
    let is_as_large = example.is_none_or(|example| fault.size_si().abs() >= example.si());
    let is_as_long = fault.for_s.is_none_or(|for_s| for_s >= LONG_S);
    let is_of_every_frame = fault.probability >= 1.0 && fault.count.is_none() && fault.id.is_none();
    is_always_reported(fault.kind) && is_as_large && is_as_long && is_of_every_frame
}

/// Whether a fault was detected when the jaw was beyond the limits: the axis then runs into its brake.
fn was_detected_late(fault: &FaultFigures, checks: &ChecksConfig) -> bool {
    let is_beyond =
        fault.deviation_mm > checks.tracking_max_mm || fault.deviation_deg > checks.tracking_max_deg;
    is_beyond && fault.detection.is_some()
}

#[cfg(test)]
mod tests {
    use masseter_judge::Detection;
    use masseter_runtime::messages::codes::{Cause, Source};
    use masseter_scenario::{BusFault, EncoderFault, ProcessFault};

    use super::*;

    #[test]
    fn the_matrix_excuses_what_nothing_detects_alone() {
        let reported = [BusFault::Disconnect.into(), DriveFault::Fault.into(), AxisFault::Jam.into()];
        assert!(reported.into_iter().all(is_always_reported));
        let silent = [EncoderFault::Drift.into(), DriveFault::Scale.into(), AxisFault::BrokenRod.into()];
        assert!(!silent.into_iter().any(is_always_reported));
        assert!(
            !is_always_reported(ProcessFault::ControllerKill.into()),
            "the matrix has no faults of processes"
        );
        assert_eq!(longest_ns(AxisFault::Jam.into()) / 1_000_000, 237);
    }

    #[test]
    fn a_fault_is_late_that_was_detected_beyond_the_limits() {
        let detection = Detection {
            source: Source::Master.code().into(),
            cause: Cause::FollowingError.code().into(),
            latency_ms: 135.0,
            deviation_mm: 0.1,
            deviation_deg: 0.0,
        };
        for (detection, deviation_mm, deviation_deg, is_late) in [
            (Some(detection), 0.6, 0.0, true),
            (Some(detection), 0.0, 0.6, true),
            (Some(detection), 0.4, 0.4, false),
            (None, 0.6, 0.6, false),
        ] {
            let fault = FaultFigures { detection, deviation_mm, deviation_deg, ..FaultFigures::default() };
            assert_eq!(was_detected_late(&fault, &ChecksConfig::default()), is_late, "{fault:?}");
        }
    }

    #[test]
    fn a_fault_smaller_or_shorter_than_that_of_the_matrix_need_not_show() {
        let offset = |size: &str, for_s| FaultConfig {
            size: size.parse().ok(),
            for_s,
            ..FaultConfig::new(EncoderFault::Offset)
        };
        assert!(is_as_in_matrix(&offset("-1.2 mm", None)));
        assert!(!is_as_in_matrix(&offset("0.9 mm", None)));
        assert!(!is_as_in_matrix(&offset("1.2 mm", Some(0.4))));
    }
}
