//! Which factors move the smallest margin most.

use crate::{case::CaseResult, report::Report};

/// A factor is cut into so many parts, each with as many of its values.
const PARTS: usize = 5;

/// At most so many factors, in the order of the campaign: those whose parts differ most in their mean margin.
pub(crate) fn most_influential(report: &Report<'_>, most: usize) -> Vec<usize> {
    let mut factors: Vec<_> = (0..report.campaign.file.factors.len()).collect();
    // Of an equal influence, the first stay.
    factors.sort_by(|&a, &b| influence(report, b).total_cmp(&influence(report, a)));
    factors.truncate(most);
    factors.sort_unstable();
    factors
}

/// Variance of the means of a factor's parts, each weighted by its cases.
fn influence(report: &Report<'_>, factor: usize) -> f64 {
    let case = |result: &CaseResult| {
        let setting = result.settings.get(factor)?;
        let (_, margin) = result.least_margin()?;
        Some((setting.number().unwrap_or(0.0), setting.word(), margin))
    };
    let mut cases: Vec<_> =
        report.results.iter().filter_map(case).filter(|case| case.2.is_finite()).collect();
    cases.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
    // No value is in two parts.
    let values: Vec<_> = cases.chunk_by(|a, b| (a.0, &a.1) == (b.0, &b.1)).collect();
    let all = mean(&cases);
    let of_part = |part: &[&[Sample]]| {
        let part = part.concat();
        part.len() as f64 * (mean(&part) - all).powi(2)
    };
    values.chunks(values.len().div_ceil(PARTS).max(1)).map(of_part).sum()
}

/// A value of the factor, as a number and as a word, and the smallest margin of its case.
type Sample = (f64, String, f64);

fn mean(samples: &[Sample]) -> f64 {
    samples.iter().map(|sample| sample.2).sum::<f64>() / samples.len() as f64
}

#[cfg(test)]
mod tests {
    use masseter_scenario::Scenario;
    use masseter_table::Format;

    use super::*;
    use crate::campaign::Campaign;
    use crate::case::CaseCheck;

    #[test]
    fn factors_that_move_the_margin_come_before_others() {
        let factor = |key: &str| format!("[[factor]]\nkey = '{key}'\nrange = [1.0, 2.0]\nlevels = 3\n");
        let keys = ["dynamics.rod_mass_kg", "dynamics.slide_friction_n", "dynamics.platform_mass_kg"];
        let campaign = Campaign {
            file: toml::from_str(&keys.map(factor).concat()).unwrap(),
            controller: "motion".to_owned(),
            program: "program".to_owned(),
            folder: "/".into(),
            base: Scenario::default().to_toml(),
        };
        let points = campaign.points();
        let results = (0..campaign.case_count()).map(|number| {
            let result = CaseResult::without_run(&campaign.case(&points, number), "PASS", 0, String::new());
            let [_, friction, mass] = [0, 1, 2].map(|at| result.settings[at].number().unwrap());
            let margin = Some(3.0 - friction - 0.1 * mass);
            let name = "incisal".to_owned();
            let check =
                CaseCheck { name, passed: Some(true), margin, unit: String::new(), relative_margin: margin };
            CaseResult { checks: vec![check], ..result }
        });
        let report = Report::new(&campaign, results.collect(), Format::Csv);
        assert_eq!(most_influential(&report, 1), [1]);
        assert_eq!(most_influential(&report, 2), [1, 2]);
    }
}
