//! A campaign that can be run: its base scenario, its points, and the case of each.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use anyhow::ensure;
use masseter_scenario::input::read_bytes;
use masseter_scenario::{FileConfig, Scenario, ScenarioError};
use serde::{Deserialize, Serialize};
use sha1::{Digest, Sha1};
use toml::{Table, Value};

use crate::case::{Case, Setting};
use crate::factor::Factor;
use crate::file::CampaignFile;
use crate::result::CaseResult;
use crate::sampler::points;

/// Keys that name files which only the reading of a scenario's file resolves.
const FILE_KEYS: [&str; 2] = ["robot", "drive_profile"];

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
    pub fn check(&self) -> anyhow::Result<()> {
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
        let scenario = self.scenario(&settings, more_seed);
        let id = self.id_of(&settings, more_seed, scenario.as_ref().ok());
        Case { number, id, settings, more_seed, scenario: scenario.map_err(|error| format!("{error:#}")) }
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

    /// What differs from another campaign, in words; none where both are the same.
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

/// A digest of a program: of the one that runs the cases.
///
/// # Errors
/// When the file cannot be read.
pub fn digest_of_program(path: &Path) -> io::Result<String> {
    Ok(data_encoding::HEXLOWER.encode(&Sha1::digest(fs::read(path)?)))
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
        campaign.check().unwrap();
        let refusal = campaign.case(&points, 0).scenario.unwrap_err();
        assert!(refusal.contains("rate_hz = 1"), "{refusal}");
        assert_ne!(campaign.case(&points, 0).id, campaign.case(&points, 1).id);
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
            let refusal = format!("{:#}", campaign(&format!("[[factor]]\n{text}")).check().unwrap_err());
            assert!(refusal.starts_with("factor '") && refusal.contains(reason), "{refusal}");
        }
    }
}
