//! A campaign: its file, its base scenario, its points, and the case of each.

use std::path::{Path, PathBuf};

use anyhow::ensure;
use masseter_scenario::input::{read_bytes, read_text};
use masseter_scenario::{FileConfig, Scenario, ScenarioError, parse_toml};
use rand::{RngExt, SeedableRng, seq::SliceRandom};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};
use sha1::{Digest, Sha1};
use toml::{Table, Value};

use crate::case::{COLUMNS, Case, CaseResult};
use crate::factor::{Factor, Setting};

/// Size of the largest file, bytes.
const MOST_BYTES: u64 = 1 << 20;
/// The most cases of a campaign.
const MOST_CASES: usize = 1_000_000;
/// Keys that name files which only the reading of a scenario's file resolves.
const FILE_KEYS: [&str; 2] = ["robot", "drive_profile"];

/// How the points of a campaign are chosen.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sampler {
    /// Every combination of the levels.
    #[default]
    Grid,
    /// Independent points.
    Random,
    /// Random points of which every slice of a factor has one.
    LatinHypercube,
    /// The Sobol sequence, scrambled by the seed: even in all factors together.
    Sobol,
}

impl Sampler {
    /// The most points of a Sobol sequence.
    pub const MOST_SOBOL: usize = 1 << 16;
    /// The most factors of a Sobol sequence.
    pub const MOST_SOBOL_FACTORS: usize = 256;
}

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

/// A file of a campaign that is refused.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The text is no file of a campaign.
    #[error(transparent)]
    Malformed(#[from] ScenarioError),
    /// The file cannot be read, or its values do not belong together.
    #[error("{}: {reason}", path.display())]
    Refused {
        /// The file.
        path: PathBuf,
        /// The reason and what to do.
        reason: String,
    },
}

impl CampaignFile {
    /// Reads and checks a file; the path of the scenario is then one of this process.
    ///
    /// # Errors
    /// [`FileError`] with the place and what to do.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let refused = |reason| FileError::Refused { path: path.to_owned(), reason };
        let text = read_text(path, MOST_BYTES).map_err(|error| refused(error.to_string()))?;
        parse_toml::<Self>(path, &text)?.checked(path).map_err(refused)
    }

    fn checked(mut self, path: &Path) -> Result<Self, String> {
        let file = &mut self;
        file.check_numbers()?;
        file.factors.iter().try_for_each(Factor::validate)?;
        file.refuse_twins()?;
        let folder = path.parent().unwrap_or(Path::new(""));
        file.scenario = file.scenario.take().map(|scenario| folder.join(scenario));
        Ok(self)
    }

    /// The number of points.
    fn point_count(&self) -> usize {
        match self.sampler {
            Sampler::Grid => {
                self.factors.iter().fold(1, |count, factor| count.saturating_mul(factor.level_count()))
            }
            _ => self.runs.unwrap_or(0),
        }
    }

    /// With how many seeds every point is run.
    fn seed_count(&self) -> usize {
        self.seeds.unwrap_or(1)
    }

    fn check_numbers(&self) -> Result<(), &'static str> {
        let is_grid = self.sampler == Sampler::Grid;
        let points = self.point_count();
        let StopRules { failures, time_s } = self.stop_after;
        let refusals = [
            (
                is_grid && self.runs.is_some(),
                "runs: a grid has as many points as its levels; give levels, or another sampler",
            ),
            (!is_grid && points == 0, "runs: give the number of points"),
            (self.seeds == Some(0), "seeds: give at least 1"),
            (
                points.saturating_mul(self.seed_count()) > MOST_CASES,
                "the campaign has more than 1000000 cases; give fewer levels, runs or seeds",
            ),
            (
                self.sampler == Sampler::Sobol
                    && (points > Sampler::MOST_SOBOL || self.factors.len() > Sampler::MOST_SOBOL_FACTORS),
                "a Sobol sequence has at most 65536 points of 256 factors",
            ),
            (
                self.least_success.is_some_and(|share| !(0.0..=1.0).contains(&share)),
                "least_success: give a share from 0 to 1",
            ),
            (
                time_s.is_some_and(|time_s| !time_s.is_finite() || time_s <= 0.0),
                "stop_after.time_s: give a finite time above 0",
            ),
            (failures == Some(0), "stop_after.failures: give at least 1"),
        ];
        let refusal = refusals.into_iter().find(|(is_wrong, _)| *is_wrong);
        refusal.map_or(Ok(()), |(_, reason)| Err(reason))
    }

    /// Refuses two factors of one name, and names of other columns: a table could not tell their values apart.
    fn refuse_twins(&self) -> Result<(), String> {
        for (at, factor) in self.factors.iter().enumerate() {
            let name = factor.name();
            if COLUMNS.iter().copied().flatten().any(|(column, ..)| *column == name) {
                return Err(format!("'{name}' is the name of another column; give the factor another name"));
            }
            if self.factors[..at].iter().any(|other| other.name() == name) {
                return Err(format!("two factors are called '{name}'; give each a name"));
            }
        }
        Ok(())
    }
}

/// A campaign with its resolved scenario.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Campaign {
    /// What varies, and how.
    pub file: CampaignFile,
    /// The controller of every case.
    pub controller: String,
    /// The program that runs the cases, as a digest: another one may give other results.
    pub program: String,
    /// The absolute folder to which paths among the values are relative.
    pub folder: PathBuf,
    /// The scenario that varies, as TOML with every default filled in, and with absolute paths.
    pub base: String,
}

impl Campaign {
    /// The number of cases.
    pub fn case_count(&self) -> usize {
        self.file.point_count() * self.file.seed_count()
    }

    /// Every point of the sampler, in \[0, 1)ⁿ.
    pub fn points(&self) -> Vec<Vec<f64>> {
        let levels: Vec<_> = self.file.factors.iter().map(Factor::level_count).collect();
        points(self.file.sampler, &levels, self.file.runs.unwrap_or(0), self.file.seed)
    }

    /// Refuses factors that no scenario can have: an unknown key, or values of another type.
    ///
    /// # Errors
    /// The scenario's refusal, with the name of the factor.
    pub fn check_factors(&self) -> anyhow::Result<()> {
        self.base()?;
        for factor in &self.file.factors {
            let key = factor.key.as_deref().unwrap_or_default();
            // Their files are read with the file of a scenario alone.
            let is_of_file = FILE_KEYS.iter().any(|name| key.split('.').next() == Some(*name));
            ensure!(!is_of_file, "factor '{}': give each variant a campaign of its own", factor.name());
            let levels = factor.level_count();
            for level in 0..levels {
                let setting = factor.at((level as f64 + 0.5) / levels as f64);
                let refusal = self
                    .scenario(&[setting], 0)
                    .err()
                    .filter(|error| !matches!(error.downcast_ref(), Some(ScenarioError::BadValue { .. })));
                refusal.map_or(Ok(()), |error| Err(error.context(format!("factor '{}'", factor.name()))))?;
            }
        }
        Ok(())
    }

    /// The case of a number: the seeds of a point follow each other.
    pub fn case(&self, points: &[Vec<f64>], number: usize) -> Case {
        let seeds = self.file.seed_count();
        self.case_at(number, &points[number / seeds], (number % seeds) as u64)
    }

    /// The case at a point, with this number added to the seed of the scenario.
    pub fn case_at(&self, number: usize, point: &[f64], more_seed: u64) -> Case {
        let settings = self.file.factors.iter().zip(point).map(|(factor, u)| factor.at(*u)).collect();
        self.case_with(number, settings, more_seed)
    }

    /// The case of a result.
    pub fn case_of(&self, result: &CaseResult) -> Case {
        self.case_with(result.number, result.settings.clone(), result.more_seed)
    }

    fn case_with(&self, number: usize, settings: Vec<Setting>, more_seed: u64) -> Case {
        let scenario = self.scenario(&settings, more_seed).map_err(|error| format!("{error:#}"));
        let id = self.id_of(&settings, more_seed, scenario.as_ref().ok());
        Case { number, id, settings, more_seed, scenario }
    }

    /// The scenario that varies.
    ///
    /// # Errors
    /// When a campaign was read whose scenario this program does not understand.
    pub fn base(&self) -> Result<Scenario, ScenarioError> {
        Scenario::parse("the scenario of the campaign".as_ref(), &self.base)
    }

    fn scenario(&self, settings: &[Setting], more_seed: u64) -> anyhow::Result<Scenario> {
        let mut changes = Table::new();
        for setting in settings {
            setting.enter(&mut changes);
        }
        let mut scenario = self.base()?.with_table(changes)?;
        let added: Vec<_> = settings.iter().filter_map(|setting| setting.fault.clone()).collect();
        if !added.is_empty() {
            let there = scenario.faults.iter().map(Value::try_from).collect::<Result<Vec<_>, _>>()?;
            let all = Value::Array(there.into_iter().chain(added.into_iter().map(Value::Table)).collect());
            scenario = scenario.with_table(Table::from_iter([("faults".to_owned(), all)]))?;
        }
        scenario.files_mut().for_each(|(_, path)| *path = self.folder.join(&path));
        if let Some(memory) = &mut scenario.drives.memory {
            *memory = self.folder.join(&memory);
        }
        scenario.seed = scenario.seed.wrapping_add(more_seed);
        scenario.validate()?;
        Ok(scenario)
    }

    fn id_of(&self, settings: &[Setting], more_seed: u64, scenario: Option<&Scenario>) -> String {
        let settings = serde_json::to_string(settings).expect("settings have a JSON form");
        let mut hasher = Sha1::new();
        for part in [&self.program, &self.controller, &self.base, &settings, &more_seed.to_string()] {
            hasher.update(part.as_bytes());
            hasher.update([0]);
        }
        let memory = scenario.and_then(|scenario| scenario.drives.memory.clone());
        let mut scenario = scenario.cloned();
        let files = scenario.iter_mut().flat_map(Scenario::files_mut).map(|(_, path)| path.clone());
        for path in files.chain(memory) {
            // A file that cannot be read is the reason why its case cannot run.
            hasher.update(read_bytes(&path, FileConfig::MOST_BYTES).unwrap_or_default());
        }
        data_encoding::HEXLOWER.encode(&hasher.finalize()[..6])
    }

    /// What differs from another campaign, in words; `None` if both are the same.
    pub(crate) fn difference_to(&self, other: &Self) -> Option<&'static str> {
        let differences = [
            (self.program != other.program, "another build of masseter began it"),
            (self.file != other.file, "the file of the campaign has changed"),
            (self.controller != other.controller, "it has another controller"),
            (self.base != other.base || self.folder != other.folder, "the scenario has changed"),
        ];
        differences.into_iter().find_map(|(is_different, words)| is_different.then_some(words))
    }
}

/// The points of a sampler, each in \[0, 1)ⁿ. `levels` has the number of levels of every factor, for the grid alone;
/// `runs` is the number of points of the others.
fn points(sampler: Sampler, levels: &[usize], runs: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut random = Pcg64::seed_from_u64(seed);
    match sampler {
        Sampler::Grid => grid(levels),
        Sampler::Random => (0..runs).map(|_| levels.iter().map(|_| random.random()).collect()).collect(),
        Sampler::LatinHypercube => latin_hypercube(levels.len(), runs, &mut random),
        Sampler::Sobol => (0..runs)
            .map(|number| {
                let coordinate =
                    |at: usize| f64::from(sobol_burley::sample(number as u32, at as u32, seed as u32));
                (0..levels.len()).map(coordinate).collect()
            })
            .collect(),
    }
}

/// The middle of every level, in the order of an odometer: the last factor changes first.
fn grid(levels: &[usize]) -> Vec<Vec<f64>> {
    levels.iter().fold(vec![Vec::new()], |begun, &count| {
        let extended = begun.iter().flat_map(|point| {
            (0..count).map(move |level| {
                let middle = (level as f64 + 0.5) / count as f64;
                point.iter().copied().chain([middle]).collect()
            })
        });
        extended.collect()
    })
}

fn latin_hypercube(factors: usize, runs: usize, random: &mut Pcg64) -> Vec<Vec<f64>> {
    let columns: Vec<Vec<f64>> = (0..factors)
        .map(|_| {
            let mut slices: Vec<usize> = (0..runs).collect();
            slices.shuffle(random);
            slices.into_iter().map(|slice| (slice as f64 + random.random::<f64>()) / runs as f64).collect()
        })
        .collect();
    (0..runs).map(|run| columns.iter().map(|column| column[run]).collect()).collect()
}

/// A digest of a program: of the one that runs the cases.
///
/// # Errors
/// When the file cannot be read.
pub fn digest_of_program(path: &Path) -> std::io::Result<String> {
    Ok(data_encoding::HEXLOWER.encode(&Sha1::digest(std::fs::read(path)?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn campaign(text: &str) -> Campaign {
        Campaign {
            file: toml::from_str(text).unwrap(),
            controller: "motion".to_owned(),
            program: "program".to_owned(),
            folder: "/".into(),
            base: Scenario::default().to_toml(),
        }
    }

    #[test]
    fn every_point_is_run_with_every_seed() {
        let campaign = campaign("seeds = 2\n[[factor]]\nkey = 'rate_hz'\nvalues = [500, 1000]");
        let points = campaign.points();
        let scenarios =
            (0..campaign.case_count()).map(|number| campaign.case(&points, number).scenario.unwrap());
        let runs: Vec<_> = scenarios.map(|scenario| (scenario.rate_hz, scenario.seed)).collect();
        assert_eq!(runs, [(500, 1), (500, 2), (1000, 1), (1000, 2)]);
    }

    #[test]
    fn the_identity_follows_from_everything_that_the_result_depends_on() {
        let text = "[[factor]]\nkey = 'rate_hz'\nvalues = [500, 1000]";
        let ids = |campaign: &Campaign| {
            let points = campaign.points();
            [0, 1].map(|number| campaign.case(&points, number).id)
        };
        let first = campaign(text);
        assert_eq!(ids(&first), ids(&first.clone()));
        assert_ne!(ids(&first)[0], ids(&first)[1]);
        let other = Campaign { program: "other".to_owned(), ..first.clone() };
        assert_ne!(ids(&first)[0], ids(&other)[0]);
        let other = Campaign { controller: "hold".to_owned(), ..first.clone() };
        assert_ne!(ids(&first)[0], ids(&other)[0]);
    }

    #[test]
    fn a_chosen_fault_joins_those_of_the_scenario() {
        let campaign = campaign(
            "[[factor]]\nfaults = ['none', { kind = 'encoder_stuck', axis = 'l2', at_s = 2.0 }]\n\
             [[factor]]\nkey = 'dynamics.slide_friction_n'\nrange = [1.0, 3.0]\nlevels = 1",
        );
        let points = campaign.points();
        let faults = |number| campaign.case(&points, number).scenario.unwrap().faults.len();
        assert_eq!([faults(0), faults(1)], [0, 1]);
        let friction_n = campaign.case(&points, 0).scenario.unwrap().dynamics.slide_friction_n;
        assert!((friction_n - 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_value_out_of_range_is_a_case_without_a_scenario() {
        let campaign = campaign("[[factor]]\nkey = 'rate_hz'\nvalues = [1, 1000]");
        let points = campaign.points();
        campaign.check_factors().unwrap();
        let refusal = campaign.case(&points, 0).scenario.unwrap_err();
        assert!(refusal.contains("rate_hz = 1"), "{refusal}");
        assert_ne!(campaign.case(&points, 0).id, campaign.case(&points, 1).id);
    }

    #[test]
    fn a_file_that_is_no_campaign_is_refused_with_its_place_in_plain_words() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.toml");
        for (text, expected) in [
            ("a,b", "c.toml:1:2: "),
            ("seed = 1\nruns = 'many'", "c.toml:2:8: runs: \"many\" is no whole number"),
            ("run = 5", "c.toml:1:1: unknown key 'run'"),
        ] {
            std::fs::write(&path, text).unwrap();
            let refusal = CampaignFile::read(&path).unwrap_err().to_string();
            assert!(refusal.contains(expected) && !refusal.contains('\n'), "{refusal}");
        }
    }

    #[test]
    fn a_key_that_no_scenario_has_refuses_the_campaign() {
        for (text, reason) in [
            ("key = 'dynamics.slide_frictio_n'\nrange = [1.0, 2.0]", "did you mean 'slide_friction_n'?"),
            ("key = 'rate_hz'\nrange = [500.0, 1000.0]", "rate_hz"),
            ("key = 'rate_hz'\nvalues = [500, 'fast']", "rate_hz"),
            ("key = 'robot'\nvalues = ['a.toml']", "a campaign of its own"),
            ("key = 'faults.late.at_s'\nrange = [1.0, 2.0]", "faults has no entry"),
        ] {
            let refusal =
                format!("{:#}", campaign(&format!("[[factor]]\n{text}")).check_factors().unwrap_err());
            assert!(refusal.starts_with("factor '") && refusal.contains(reason), "{refusal}");
        }
    }

    const THREE: [usize; 3] = [2, 3, 1];

    #[test]
    fn a_grid_has_every_combination_once() {
        let all = points(Sampler::Grid, &THREE, 0, 1);
        assert_eq!(all.len(), 6);
        assert_eq!(all[0], [0.25, 0.5 / 3.0, 0.5]);
        assert_eq!(all[5], [0.75, 2.5 / 3.0, 0.5]);
        assert_eq!(points(Sampler::Grid, &[], 0, 1), [Vec::<f64>::new()]);
    }

    #[test]
    fn every_slice_of_a_latin_hypercube_has_one_point() {
        let all = points(Sampler::LatinHypercube, &THREE, 20, 7);
        for factor in 0..3 {
            let mut slices: Vec<_> = all.iter().map(|point| (point[factor] * 20.0) as usize).collect();
            slices.sort_unstable();
            assert_eq!(slices, (0..20).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_sobol_sequence_has_one_point_in_every_square_of_a_power_of_two() {
        let all = points(Sampler::Sobol, &[1, 1], 16, 3);
        let mut squares: Vec<_> =
            all.iter().map(|point| (point[0] * 4.0) as usize * 4 + (point[1] * 4.0) as usize).collect();
        squares.sort_unstable();
        assert_eq!(squares, (0..16).collect::<Vec<_>>());
    }

    #[test]
    fn a_seed_gives_the_same_points_and_another_seed_others() {
        for sampler in [Sampler::Random, Sampler::LatinHypercube, Sampler::Sobol] {
            let of_seed = |seed| points(sampler, &THREE, 10, seed);
            assert_eq!(of_seed(1), of_seed(1));
            assert_ne!(of_seed(1), of_seed(2));
            assert!(of_seed(1).iter().flatten().all(|u| (0.0..1.0).contains(u)));
        }
    }
}
