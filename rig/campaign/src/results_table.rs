//! The results of a campaign as a table: a row a case.

use masseter_table::{Column, Table, Values};

use crate::campaign::Campaign;
use crate::result::{CaseCheck, CaseResult};

/// The table: case, factors, verdict, margins, figures.
pub(crate) fn results_table(campaign: &Campaign, results: &[CaseResult]) -> Table {
    let columns =
        [identity(results), factors(campaign, results), verdict(results), checks(results), figures(results)];
    Table::new(columns.into_iter().flatten().collect())
}

fn identity(results: &[CaseResult]) -> Vec<Column> {
    vec![
        Column::new("case", "", "place in the campaign", whole(results, |result| result.number as i64)),
        Column::new("id", "", "identity by content", words(results, |result| result.id.clone())),
        Column::new(
            "more_seed",
            "",
            "added to the seed of the scenario",
            whole(results, |result| result.more_seed as i64),
        ),
    ]
}

/// A column a factor: numbers where all values are numbers, otherwise words.
fn factors(campaign: &Campaign, results: &[CaseResult]) -> Vec<Column> {
    let column = |(at, factor): (usize, &crate::Factor)| {
        let settings: Vec<_> = results.iter().map(|result| &result.settings[at]).collect();
        let numbers: Vec<_> = settings.iter().map(|setting| setting.number()).collect();
        let values = if numbers.iter().all(Option::is_some) {
            Values::Numbers(numbers)
        } else {
            Values::Words(settings.iter().map(|setting| Some(setting.word())).collect())
        };
        Column::new(factor.name(), factor.unit(), "factor", values)
    };
    campaign.file.factors.iter().enumerate().map(column).collect()
}

fn verdict(results: &[CaseResult]) -> Vec<Column> {
    vec![
        Column::new("verdict", "", "verdict in a word", words(results, |result| result.word.clone())),
        Column::new(
            "exit_code",
            "",
            "verdict as exit code",
            whole(results, |result| result.exit_code.into()),
        ),
        Column::new("reason", "", "reason of the verdict", words(results, |result| result.reason.clone())),
        Column::new("digest", "", "what the rig did", words(results, |result| result.digest.clone())),
        Column::new("took_s", "s", "time that the case took", numbers(results, |result| Some(result.took_s))),
    ]
}

/// Whether each check passed, and its margin where it has one.
fn checks(results: &[CaseResult]) -> Vec<Column> {
    let columns = |name: &String| {
        let of = |result: &CaseResult| result.checks.iter().find(|check| check.name == *name).cloned();
        let passed = results.iter().map(|result| of(result).and_then(|check| check.passed)).collect();
        let mut columns = vec![Column::new(
            &format!("{name}.passed"),
            "",
            "whether the check passed",
            Values::Truths(passed),
        )];
        let some: Vec<CaseCheck> = results.iter().filter_map(of).collect();
        if let Some(unit) = some.iter().find(|check| check.margin.is_some()).map(|check| &check.unit) {
            let margin = |result: &CaseResult| of(result)?.margin;
            let relative = |result: &CaseResult| of(result)?.relative_margin;
            columns.push(Column::new(
                &format!("{name}.margin"),
                unit,
                "distance from failing",
                numbers(results, margin),
            ));
            columns.push(Column::new(
                &format!("{name}.relative_margin"),
                "",
                "distance from failing as a share of the limit",
                numbers(results, relative),
            ));
        }
        columns
    };
    names(results).iter().flat_map(columns).collect()
}

/// The names of all checks, in the order in which they first appear.
pub(crate) fn names(results: &[CaseResult]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for check in results.iter().flat_map(|result| &result.checks) {
        if !names.contains(&check.name) {
            names.push(check.name.clone());
        }
    }
    names
}

fn figures(results: &[CaseResult]) -> Vec<Column> {
    let column = |name, unit, about, of: fn(&CaseResult) -> Option<f64>| {
        Column::new(name, unit, about, numbers(results, of))
    };
    vec![
        column("incisal_rms_mm", "mm", "error of the incisal point, root mean square", |result| {
            result.incisal_rms_mm
        }),
        column("incisal_max_mm", "mm", "largest error of the incisal point", |result| result.incisal_max_mm),
        column("rotation_max_deg", "deg", "largest error of the rotation", |result| result.rotation_max_deg),
        column("bite_force_max_n", "N", "greatest bite force", |result| result.bite_force_max_n),
    ]
}

fn numbers(results: &[CaseResult], of: impl Fn(&CaseResult) -> Option<f64>) -> Values {
    Values::Numbers(results.iter().map(of).collect())
}

fn whole(results: &[CaseResult], of: impl Fn(&CaseResult) -> i64) -> Values {
    Values::Whole(results.iter().map(|result| Some(of(result))).collect())
}

fn words(results: &[CaseResult], of: impl Fn(&CaseResult) -> String) -> Values {
    Values::Words(results.iter().map(|result| Some(of(result))).collect())
}
