//! A case: a whole scenario with its number and its identity, and what came of it, as it is kept.

use masseter_judge::{BiteEstimateFigures, Check, CheckResult, Figures, Verdict};
use masseter_table::Values;
use serde::{Deserialize, Serialize};

use crate::factor::Setting;

/// A column of a table of results: name, unit, meaning and values.
type ResultColumn = (&'static str, &'static str, &'static str, fn(&[CaseResult]) -> Values);

/// The columns of every table of results before its factors, before its checks, and after them.
pub(crate) const COLUMNS: [&[ResultColumn]; 3] = [
    &[
        ("case", "", "place in the campaign", |all| whole(all, |case| case.number as i64)),
        ("id", "", "identity by content", |all| words(all, |case| &case.id)),
        ("more_seed", "", "added to the seed of the scenario", |all| {
            whole(all, |case| case.more_seed as i64)
        }),
    ],
    &[
        ("verdict", "", "verdict in a word", |all| words(all, |case| &case.word)),
        ("exit_code", "", "verdict as exit code", |all| whole(all, |case| case.exit_code.into())),
        ("reason", "", "reason of the verdict", |all| words(all, |case| &case.reason)),
        ("warnings", "", "what the plan warns of", |all| words(all, |case| &case.warnings)),
        ("digest", "", "what the rig did", |all| words(all, |case| &case.digest)),
        ("took_s", "s", "time that the case took", |all| numbers(all, |case| Some(case.took_s))),
    ],
    &[
        ("incisal_rms_mm", "mm", "error of the incisal point, root mean square", |all| {
            numbers(all, |case| case.incisal_rms_mm)
        }),
        ("incisal_max_mm", "mm", "largest error of the incisal point", |all| {
            numbers(all, |case| case.incisal_max_mm)
        }),
        ("rotation_max_deg", "deg", "largest error of the rotation", |all| {
            numbers(all, |case| case.rotation_max_deg)
        }),
        ("bite_force_max_n", "N", "greatest bite force", |all| numbers(all, |case| case.bite_force_max_n)),
        ("bite_error_rms_n", "N", "error of the estimated bite force, root mean square", |all| {
            numbers(all, |case| case.bite_estimate.map(|of| of.error_rms_n))
        }),
        ("bite_error_median_n", "N", "its median, without its sign", |all| {
            numbers(all, |case| case.bite_estimate.map(|of| of.error_median_n))
        }),
        ("bite_error_95_n", "N", "error that 95 % of its cycles are below", |all| {
            numbers(all, |case| case.bite_estimate.map(|of| of.error_95_n))
        }),
        ("bite_uncertainty_median_n", "N", "median of the stated uncertainty", |all| {
            numbers(all, |case| case.bite_estimate.map(|of| of.uncertainty_median_n))
        }),
        ("bite_covered", "", "share of the cycles in which the uncertainty is at least the error", |all| {
            numbers(all, |case| case.bite_estimate.map(|of| of.covered))
        }),
        ("bite_missing", "", "share of the cycles of the motion without an estimate", |all| {
            numbers(all, |case| case.bite_estimate.map(|of| of.missing))
        }),
        ("bite_phantom_n", "N", "estimate that 95 % of the cycles without contact are below", |all| {
            numbers(all, |case| case.bite_estimate.and_then(|of| of.phantom_n))
        }),
    ],
];

fn numbers(all: &[CaseResult], of: fn(&CaseResult) -> Option<f64>) -> Values {
    Values::Numbers(all.iter().map(of).collect())
}

fn whole(all: &[CaseResult], of: fn(&CaseResult) -> i64) -> Values {
    Values::Whole(all.iter().map(|case| Some(of(case))).collect())
}

fn words(all: &[CaseResult], of: fn(&CaseResult) -> &String) -> Values {
    Values::Words(all.iter().map(|case| Some(of(case).clone())).collect())
}

/// A run of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// Its place in the campaign, from 0.
    pub number: usize,
    /// Twelve hexadecimal digits for everything that the result depends on.
    pub id: String,
    /// The values of the factors.
    pub settings: Vec<Setting>,
    /// The number added to the seed of the scenario.
    pub more_seed: u64,
    /// The scenario, or why the values lead to none.
    pub scenario: Result<masseter_scenario::Scenario, String>,
}

/// A requirement or check of a case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CaseCheck {
    /// Its name.
    pub name: String,
    /// Whether it passed; `None` if it could not show.
    pub passed: Option<bool>,
    /// How far it is from failing; none of a check without a limit in numbers.
    pub margin: Option<f64>,
    /// Unit of the margin.
    pub unit: String,
    /// The margin as a share of the limit.
    pub relative_margin: Option<f64>,
}

/// The result of a case.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct CaseResult {
    /// The case's place in the campaign, from 0.
    pub number: usize,
    /// The case's identity.
    pub id: String,
    /// The values of the factors.
    pub settings: Vec<Setting>,
    /// The number added to the seed of the scenario.
    pub more_seed: u64,
    /// The verdict in a word; REFUSED where the values lead to no run.
    pub word: String,
    /// The verdict as an exit code.
    pub exit_code: u8,
    /// The reason in a sentence.
    pub reason: String,
    /// What the plan warns of, parted by semicolons; results of older campaigns have none.
    #[serde(default)]
    pub warnings: String,
    /// The digest of what the rig did; empty where nothing ran.
    pub digest: String,
    /// The checks in their order.
    pub checks: Vec<CaseCheck>,
    /// Root mean square distance of the incisal point from its desired place, mm.
    pub incisal_rms_mm: Option<f64>,
    /// The largest such distance, mm.
    pub incisal_max_mm: Option<f64>,
    /// The largest error of the platform's rotation, degrees.
    pub rotation_max_deg: Option<f64>,
    /// The greatest bite force, N.
    pub bite_force_max_n: Option<f64>,
    /// The estimate of the bite force beside the true one; results of older campaigns have none.
    #[serde(default)]
    pub bite_estimate: Option<BiteEstimateFigures>,
    /// The time that it took, s.
    pub took_s: f64,
}

impl CaseResult {
    /// The word of a case that could not run.
    pub const REFUSED: &str = "REFUSED";
    /// The word of a case at which the rig itself failed.
    pub const DIED: &str = "DIED";

    /// The result of a case that ran.
    pub fn new(case: &Case, verdict: &Verdict, figures: &Figures, took_s: f64) -> Self {
        let errors = &figures.tracking.actual;
        Self {
            checks: verdict.checks.iter().map(case_check).collect(),
            warnings: verdict.warnings.join("; "),
            digest: figures.digest.clone(),
            incisal_rms_mm: errors.incisal_rms_mm,
            incisal_max_mm: errors.incisal_max_mm,
            rotation_max_deg: errors.max_deg,
            bite_force_max_n: figures.bite_force_max_n,
            bite_estimate: figures.bite_estimate,
            took_s,
            ..Self::without_run(case, verdict.word, verdict.exit_code as u8, verdict.reason.clone())
        }
    }

    /// The result of a case that could not run.
    pub fn without_run(case: &Case, word: &str, exit_code: u8, reason: String) -> Self {
        Self {
            number: case.number,
            id: case.id.clone(),
            settings: case.settings.clone(),
            more_seed: case.more_seed,
            word: word.to_owned(),
            exit_code,
            reason,
            ..Self::default()
        }
    }

    /// Whether the case passed.
    pub fn has_passed(&self) -> bool {
        self.exit_code == 0
    }

    /// Whether it says anything about the rig: it passed, failed or stopped. What could not run, was not tested or
    /// cannot be judged says nothing.
    pub fn is_judged(&self) -> bool {
        !matches!(
            self.word.as_str(),
            Self::REFUSED | Self::DIED | "UNTESTED" | "INVALID" | "INCOMPLETE" | "INTERRUPTED"
        )
    }

    /// The smallest margin of its checks as a share of their limits, with the name of the check.
    pub fn least_margin(&self) -> Option<(&str, f64)> {
        let margins =
            self.checks.iter().filter_map(|check| Some((check.name.as_str(), check.relative_margin?)));
        margins.min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

fn case_check(check: &Check) -> CaseCheck {
    let figures = check.figures.as_ref();
    CaseCheck {
        name: check.name.to_string(),
        passed: match check.result {
            CheckResult::Passed => Some(true),
            CheckResult::Failed => Some(false),
            CheckResult::Excused | CheckResult::Untested | CheckResult::NotJudged => None,
        },
        margin: figures.and_then(|figures| figures.margin),
        unit: figures.map_or_else(String::new, |figures| figures.margin_unit.to_owned()),
        relative_margin: figures.and_then(|figures| figures.relative_margin),
    }
}

/// The names of all checks, in the order in which they first appear.
pub(crate) fn check_names(results: &[CaseResult]) -> Vec<String> {
    in_order_of_appearance(results.iter().flat_map(|result| &result.checks).map(|check| check.name.clone()))
}

/// Each value once.
pub(crate) fn in_order_of_appearance<T: PartialEq>(values: impl Iterator<Item = T>) -> Vec<T> {
    let mut seen = Vec::new();
    for value in values {
        if !seen.contains(&value) {
            seen.push(value);
        }
    }
    seen
}
