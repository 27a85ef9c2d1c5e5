//! What a campaign came to: the share that passed, the worst cases, and the files in which both are kept.

use std::{collections::BTreeMap, path::PathBuf};

use masseter_scenario::wording::counted;
use masseter_table::Format;

use crate::{campaign::Campaign, case::CaseResult, folder::CampaignFolder};

/// Quantile of the normal distribution for an interval of 95 %.
const Z: f64 = 1.959_963_984_540_054;
/// The page.
pub(crate) const PAGE: &str = "campaign.html";

/// A share with an interval that covers the true one in 95 of 100 campaigns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SuccessRate {
    /// Cases that passed.
    pub passed: usize,
    /// Cases that were judged.
    pub judged: usize,
    /// Ends of the interval.
    pub interval: [f64; 2],
}

impl SuccessRate {
    /// The share with the interval of Wilson (1927), which also holds for few cases and for shares near 0 and 1. It
    /// means something for random cases; on a grid it is only a measure of their number.
    pub fn new(passed: usize, judged: usize) -> Self {
        let n = judged as f64;
        let share = if judged == 0 { 0.5 } else { passed as f64 / n };
        let (z_square, n) = (Z * Z, n.max(f64::MIN_POSITIVE));
        let middle = (share + z_square / (2.0 * n)) / (1.0 + z_square / n);
        let half = Z * (share * (1.0 - share) / n + z_square / (4.0 * n * n)).sqrt() / (1.0 + z_square / n);
        let interval = if judged == 0 { [0.0, 1.0] } else { [middle - half, middle + half] };
        Self { passed, judged, interval: interval.map(|end| end.clamp(0.0, 1.0)) }
    }

    /// The share; none without a case.
    pub fn share(&self) -> Option<f64> {
        (self.judged > 0).then(|| self.passed as f64 / self.judged as f64)
    }
}

/// A case with a small margin, and how to see it again.
#[derive(Debug, Clone, PartialEq)]
pub struct WorstCase {
    /// The case's place in the campaign.
    pub number: usize,
    /// The command that plays it again.
    pub command: String,
    /// The folder of its run, if it was recorded.
    pub run: Option<PathBuf>,
}

/// The results of a campaign.
#[derive(Debug)]
pub struct Report<'a> {
    pub(crate) campaign: &'a Campaign,
    /// In the order of their numbers.
    pub(crate) results: Vec<CaseResult>,
    /// Of the table.
    pub(crate) format: Format,
}

impl<'a> Report<'a> {
    /// The report on these results, with a table in this format.
    pub fn new(campaign: &'a Campaign, mut results: Vec<CaseResult>, format: Format) -> Self {
        results.sort_by_key(|result| result.number);
        Self { campaign, results, format }
    }

    /// The share of judged cases that passed.
    pub fn rate(&self) -> SuccessRate {
        // Equal cases are one trial.
        let cases: BTreeMap<_, _> = self.results.iter().map(|result| (&result.id, result)).collect();
        let judged = cases.values().filter(|result| result.is_judged());
        let passed = cases.values().filter(|result| result.has_passed());
        SuccessRate::new(passed.count(), judged.count())
    }

    /// Whether enough cases passed: all, or the share that the file demands. Only judged cases count towards that
    /// share; without any, nothing was shown. A defect of the rig fails the campaign.
    pub fn is_success(&self) -> bool {
        if self.results.iter().any(|result| result.word == CaseResult::DIED) {
            return false;
        }
        match (self.campaign.file.least_success, self.rate().share()) {
            (_, None) => false,
            (Some(least), Some(share)) => share >= least,
            (None, Some(_)) => self.results.iter().all(CaseResult::has_passed),
        }
    }

    /// The cases that did not pass, then those with the smallest margins: at most this many.
    pub fn worst(&self, most: usize) -> Vec<&CaseResult> {
        let rank = |result: &CaseResult| {
            let margin = result.least_margin().map_or(f64::INFINITY, |(_, margin)| margin);
            (!result.is_judged(), result.has_passed(), margin)
        };
        let mut all: Vec<_> = self.results.iter().collect();
        all.sort_by(|a, b| {
            let (a, b) = (rank(a), rank(b));
            (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2))
        });
        all.truncate(most);
        all
    }

    /// How many cases have each word of a verdict.
    pub fn counts(&self) -> BTreeMap<&str, usize> {
        let mut counts = BTreeMap::new();
        for result in &self.results {
            *counts.entry(result.word.as_str()).or_default() += 1;
        }
        counts
    }

    /// The result in lines for a terminal.
    pub fn in_words(&self, folder: &CampaignFolder) -> String {
        let counts: Vec<_> = self.counts().iter().map(|(word, count)| format!("{count} {word}")).collect();
        let worst = self.worst(1);
        let worst = worst.first().and_then(|result| {
            let (name, margin) = result.least_margin()?;
            let margin = percent(margin);
            Some(format!("smallest margin: {margin} of its limit, {name}, case {}\n", result.number))
        });
        let word = if self.is_success() { "PASS" } else { "FAIL" };
        format!(
            "{word}: {} of {}: {}\n{}{}{}",
            counted(self.results.len() as u64, "case"),
            self.campaign.case_count(),
            counts.join(", "),
            self.rate_in_words(),
            worst.unwrap_or_default(),
            self.files(folder)
        )
    }

    /// Where page and table are, in lines for a terminal.
    pub fn files(&self, folder: &CampaignFolder) -> String {
        format!("page: {}\ntable: {}\n", folder.file(PAGE).display(), self.table_path(folder).display())
    }

    /// File of the results, a row a case.
    pub(crate) fn table_path(&self, folder: &CampaignFolder) -> PathBuf {
        folder.file(&format!("cases.{}", self.format.extension()))
    }

    fn rate_in_words(&self) -> String {
        let rate = self.rate();
        let Some(share) = rate.share() else { return "no case was judged\n".to_owned() };
        let [low, high] = rate.interval.map(|end| end * 100.0);
        let demanded = self.campaign.file.least_success;
        let demanded = demanded.map_or_else(String::new, |least| format!(", demanded {}", percent(least)));
        format!(
            "success rate: {} of {} judged, 95 % interval {low:.1} to {high:.1} %{demanded}\n{}",
            percent(share),
            rate.judged,
            self.unjudged_in_words()
        )
    }

    /// That cases without a judgement fail the campaign, where they do.
    fn unjudged_in_words(&self) -> String {
        let unjudged = self.results.iter().filter(|result| !result.is_judged()).count();
        if unjudged == 0 || self.campaign.file.least_success.is_some() {
            return String::new();
        }
        let unjudged = counted(unjudged as u64, "case");
        format!(
            "not judged: {unjudged}; every case must pass, unless least_success demands a share of the judged ones\n"
        )
    }
}

/// A share in percent.
pub(crate) fn percent(share: f64) -> String {
    format!("{:.1} %", share * 100.0)
}

#[cfg(test)]
mod tests {
    use masseter_scenario::Scenario;

    use super::*;
    use crate::case::CaseCheck;

    fn campaign(text: &str) -> Campaign {
        Campaign {
            file: toml::from_str(text).unwrap(),
            controller: "motion".to_owned(),
            program: "program".to_owned(),
            folder: "/".into(),
            base: Scenario::default().to_toml(),
        }
    }

    fn result(campaign: &Campaign, number: usize, word: &str, exit_code: u8, margin: f64) -> CaseResult {
        let case = campaign.case(&campaign.points(), number);
        let check = CaseCheck {
            name: "incisal".to_owned(),
            passed: Some(margin > 0.0),
            margin: Some(margin),
            unit: "mm".to_owned(),
            relative_margin: Some(margin),
        };
        CaseResult { checks: vec![check], ..CaseResult::without_run(&case, word, exit_code, String::new()) }
    }

    fn results(campaign: &Campaign) -> Vec<CaseResult> {
        vec![
            result(campaign, 3, "UNTESTED", 1, 0.9),
            result(campaign, 0, "PASS", 0, 0.5),
            result(campaign, 1, "FAIL", 1, -0.2),
            result(campaign, 2, "PASS", 0, 0.1),
        ]
    }

    const FOUR: &str = "[[factor]]\nkey = 'dynamics.slide_friction_n'\nrange = [1.0, 2.0]\nlevels = 4";

    #[test]
    fn the_worst_cases_are_those_that_failed_then_the_smallest_margins() {
        let campaign = campaign(FOUR);
        let report = Report::new(&campaign, results(&campaign), Format::Csv);
        let worst: Vec<_> = report.worst(3).iter().map(|result| result.number).collect();
        assert_eq!(worst, [1, 2, 0]);
    }

    #[test]
    fn only_judged_cases_count_towards_the_rate() {
        let campaign = campaign(FOUR);
        let rate = Report::new(&campaign, results(&campaign), Format::Csv).rate();
        assert_eq!((rate.passed, rate.judged), (2, 3));
    }

    #[test]
    fn a_campaign_passes_if_all_cases_do_or_the_share_that_it_demands() {
        let passes = |text: &str, results: fn(&Campaign) -> Vec<CaseResult>| {
            let campaign = campaign(&format!("{text}\n{FOUR}"));
            Report::new(&campaign, results(&campaign), Format::Csv).is_success()
        };
        assert!(!passes("", results));
        assert!(passes("least_success = 0.6", results));
        assert!(!passes("least_success = 0.7", results));
        assert!(passes("", |campaign| vec![result(campaign, 0, "PASS", 0, 0.5)]));
        assert!(!passes("least_success = 0.0", |campaign| vec![result(campaign, 0, "UNTESTED", 1, 0.5)]));
    }

    #[test]
    fn the_interval_is_wilsons() {
        // Newcombe (1998), table I: 81 of 263, and 0 of 20.
        let rate = SuccessRate::new(81, 263);
        assert!((rate.interval[0] - 0.2553).abs() < 5e-5 && (rate.interval[1] - 0.3662).abs() < 5e-5);
        let none = SuccessRate::new(0, 20);
        assert!(none.interval[0] <= 0.0 && (none.interval[1] - 0.1611).abs() < 5e-5);
        let [low, high] = SuccessRate::new(0, 0).interval;
        assert!(low <= 0.0 && high >= 1.0 && SuccessRate::new(0, 0).share().is_none());
    }
}
