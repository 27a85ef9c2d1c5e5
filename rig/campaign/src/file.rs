//! The file of a campaign, read and checked.

use std::path::{Path, PathBuf};

use masseter_scenario::input::read_text;
use serde::{Deserialize, Serialize};

use crate::factor::{Factor, FactorError};
use crate::sampler::Sampler;

/// Size of the largest file, bytes.
const MOST_BYTES: u64 = 1 << 20;
/// The most cases of a campaign.
const MOST_CASES: usize = 1_000_000;

/// The columns of every table of results that are no factors.
const COLUMNS: [&str; 12] = [
    "case",
    "id",
    "more_seed",
    "verdict",
    "exit_code",
    "reason",
    "digest",
    "took_s",
    "incisal_rms_mm",
    "incisal_max_mm",
    "rotation_max_deg",
    "bite_force_max_n",
];

/// When a campaign ends before its last case.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StopRules {
    /// After this many cases that did not pass.
    pub failures: Option<usize>,
    /// After this time, s.
    pub time_s: Option<f64>,
}

/// A campaign as it is written.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CampaignFile {
    /// The scenario that varies, relative to the folder of this file; the default one when absent.
    pub scenario: Option<PathBuf>,
    /// How the points are chosen.
    pub sampler: Sampler,
    /// The number of points, unless the sampler is a grid.
    pub runs: Option<usize>,
    /// The seed of the sampler.
    pub seed: u64,
    /// With how many seeds every point is run: those of the scenario and the following numbers.
    pub seeds: Option<usize>,
    /// The share of cases that must pass for the campaign to pass.
    pub least_success: Option<f64>,
    /// When the campaign ends early.
    pub stop_after: StopRules,
    /// What varies.
    #[serde(rename = "factor")]
    pub factors: Vec<Factor>,
}

/// Why the file of a campaign is refused.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// It cannot be read.
    #[error("{}: {error}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        error: std::io::Error,
    },
    /// The text is not that of a campaign.
    #[error("{}: {reason}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Line, column and what is wrong there.
        reason: String,
    },
    /// A factor is wrong.
    #[error("{}: {error}", path.display())]
    Factor {
        /// The file.
        path: PathBuf,
        /// What is wrong with the factor.
        error: FactorError,
    },
}

impl CampaignFile {
    /// Reads and checks a file; the path of the scenario is then one of this process.
    ///
    /// # Errors
    /// [`FileError`] with the place and what to do.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let text = read_text(path, MOST_BYTES)
            .map_err(|error| FileError::Unreadable { path: path.to_owned(), error })?;
        let malformed = |reason: String| FileError::Malformed { path: path.to_owned(), reason };
        let mut file: Self =
            toml::from_str(&text).map_err(|error: toml::de::Error| malformed(error.to_string()))?;
        file.check().map_err(|reason| malformed(reason.to_owned()))?;
        for factor in &file.factors {
            factor.validate().map_err(|error| FileError::Factor { path: path.to_owned(), error })?;
        }
        file.refuse_twins().map_err(malformed)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        file.scenario = file.scenario.map(|scenario| folder.join(scenario));
        Ok(file)
    }

    /// The number of points.
    pub fn point_count(&self) -> usize {
        match self.sampler {
            Sampler::Grid => {
                self.factors.iter().fold(1, |count, factor| count.saturating_mul(factor.level_count()))
            }
            _ => self.runs.unwrap_or(0),
        }
    }

    /// With how many seeds every point is run.
    pub fn seed_count(&self) -> usize {
        self.seeds.unwrap_or(1)
    }

    fn check(&self) -> Result<(), &'static str> {
        let is_grid = self.sampler == Sampler::Grid;
        if is_grid && self.runs.is_some() {
            return Err("runs: a grid has as many points as its levels; give levels, or another sampler");
        }
        if !is_grid && self.runs.is_none_or(|runs| runs == 0) {
            return Err("runs: give the number of points");
        }
        if self.seeds == Some(0) {
            return Err("seeds: give at least 1");
        }
        if self.point_count().saturating_mul(self.seed_count()) > MOST_CASES {
            return Err("the campaign has more than 1000000 cases; give fewer levels, runs or seeds");
        }
        if self.sampler == Sampler::Sobol
            && (self.point_count() > Sampler::MOST_SOBOL || self.factors.len() > Sampler::MOST_SOBOL_FACTORS)
        {
            return Err("a Sobol sequence has at most 65536 points of 256 factors");
        }
        if self.least_success.is_some_and(|share| !(0.0..=1.0).contains(&share)) {
            return Err("least_success: give a share from 0 to 1");
        }
        if self.stop_after.time_s.is_some_and(|time_s| !time_s.is_finite() || time_s <= 0.0) {
            return Err("stop_after.time_s: give a finite time above 0");
        }
        if self.stop_after.failures == Some(0) {
            return Err("stop_after.failures: give at least 1");
        }
        Ok(())
    }

    /// Refuses two factors of one name, and names of other columns: a table could not tell their values apart.
    fn refuse_twins(&self) -> Result<(), String> {
        for (at, factor) in self.factors.iter().enumerate() {
            if COLUMNS.contains(&factor.name()) {
                return Err(format!(
                    "'{}' is the name of another column; give the factor another name",
                    factor.name()
                ));
            }
            if self.factors[..at].iter().any(|other| other.name() == factor.name()) {
                return Err(format!("two factors are called '{}'; give each a name", factor.name()));
            }
        }
        Ok(())
    }
}
