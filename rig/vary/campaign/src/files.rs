//! The files of a campaign's report: the page, which needs no network, and the table, a row a case.

use std::fs::{self, File};

use anyhow::Context;
use askama::Template;
use masseter_charts::{Axis, BLUE, Chart, GREY, Look, Scale, Series, VERMILION, drawing};
use masseter_table::{Column, Table, Values, write_table};

use crate::campaign::Campaign;
use crate::case::{COLUMNS, CaseCheck, CaseResult};
use crate::factor::{Distribution, Factor, Setting};
use crate::folder::CampaignFolder;
use crate::report::{PAGE, Report, WorstCase, percent};

/// Size of a plot, px.
const SIZE: [f64; 2] = [360.0, 260.0];
/// Room above and below the dots, as a share of their height.
const ROOM: f64 = 0.08;

/// Writes page and table into the folder of the campaign.
///
/// # Errors
/// When a file cannot be written.
pub fn write(report: &Report<'_>, folder: &CampaignFolder, worst: &[WorstCase]) -> anyhow::Result<()> {
    // The page first: it needs no other program.
    let html = html(report, worst).context("cannot make the page")?;
    let path = folder.file(PAGE);
    fs::write(&path, html).with_context(|| format!("cannot write {}", path.display()))?;
    let path = report.table_path(folder);
    let unfinished = path.with_extension("part");
    let unwritten = || format!("cannot write {}", path.display());
    let file = File::create(&unfinished).with_context(unwritten)?;
    write_table(&report.format, file, &results_table(report.campaign, &report.results))?;
    fs::rename(&unfinished, &path).with_context(unwritten)
}

#[derive(Template)]
#[template(path = "campaign.html")]
struct Page<'a> {
    report: &'a Report<'a>,
    rate: String,
    rows: Vec<WorstRow<'a>>,
    plots: Vec<(String, Vec<String>)>,
}

/// A line of the table of worst cases.
struct WorstRow<'a> {
    result: &'a CaseResult,
    kept: &'a WorstCase,
    link: Option<String>,
}

fn html(report: &Report<'_>, worst: &[WorstCase]) -> anyhow::Result<String> {
    let rows = worst.iter().filter_map(|kept| {
        let result = report.results.iter().find(|result| result.number == kept.number)?;
        let name = kept.run.as_ref().and_then(|run| Some(run.file_name()?.to_string_lossy().into_owned()));
        let link = name.map(|name| format!("worst/{name}/report.html"));
        Some(WorstRow { result, kept, link })
    });
    let page = Page { report, rate: rate_in_words(report), rows: rows.collect(), plots: plots(report) };
    Ok(page.render()?)
}

/// For every check with a margin, a plot a factor.
fn plots(report: &Report<'_>) -> Vec<(String, Vec<String>)> {
    let results = &report.results;
    let factors = || report.campaign.file.factors.iter().enumerate();
    let has_points = |name: &String| !points(results, name, 0).is_empty();
    let drawn = |name: &str| {
        let plots = factors().map(|(at, factor)| plot(factor, results, at, &points(results, name, at)));
        plots.collect()
    };
    names(results).into_iter().filter(has_points).map(|name| (name.clone(), drawn(&name))).collect()
}

/// A case in a plot: the value of a factor, the margin in percent, and whether the case passed.
struct Point {
    x: f64,
    margin_percent: f64,
    has_passed: bool,
}

fn points(results: &[CaseResult], check: &str, factor: usize) -> Vec<Point> {
    let categories = categories(results, factor);
    let point = |result: &CaseResult| {
        let check = result.checks.iter().find(|found| found.name == check)?;
        let setting = result.settings.get(factor)?;
        let place = || categories.iter().position(|word| *word == setting.word()).map(|place| place as f64);
        let x = if categories.is_empty() { setting.number() } else { place() }?;
        let margin_percent = check.relative_margin.filter(|margin| margin.is_finite())? * 100.0;
        Some(Point { x, margin_percent, has_passed: result.has_passed() })
    };
    results.iter().filter_map(point).collect()
}

/// The values of a factor that are not all numbers, in the order in which they appear; empty for numbers.
fn categories(results: &[CaseResult], factor: usize) -> Vec<String> {
    let settings = || results.iter().filter_map(|result| result.settings.get(factor));
    if settings().all(|setting| setting.number().is_some()) {
        return Vec::new();
    }
    in_order_of_appearance(settings().map(Setting::word))
}

fn plot(factor: &Factor, results: &[CaseResult], at: usize, points: &[Point]) -> String {
    let unit = factor.unit();
    let label = if unit.is_empty() { factor.name().to_owned() } else { format!("{}, {unit}", factor.name()) };
    let categories = categories(results, at);
    let mut x = Axis::around(&label, points.iter().map(|point| point.x), 0.0);
    if !categories.is_empty() {
        let ends = [-0.5, categories.len() as f64 - 0.5];
        x = Axis { scale: Scale::Names(categories), ends, ..x };
    } else if factor.distribution == Distribution::LogUniform {
        x.scale = Scale::Log;
    }
    let margins = points.iter().map(|point| point.margin_percent);
    let dots = |has_passed: bool, colour| {
        let dots = points.iter().filter(|point| point.has_passed == has_passed);
        let points = dots.map(|point| (point.x, point.margin_percent)).collect();
        Series { name: String::new(), colour, look: Look::Dots, points }
    };
    let zero = x.ends.map(|end| (end, 0.0)).to_vec();
    let series = vec![
        Series { name: String::new(), colour: GREY, look: Look::Line, points: zero },
        dots(true, BLUE),
        dots(false, VERMILION),
    ];
    let [width, height] = SIZE;
    let y = Axis::around("margin, % of limit", margins.chain([0.0]), ROOM);
    drawing(SIZE, &[Chart { frame: [0.0, 0.0, width, height], title: String::new(), x, y, series }])
}

/// The rate with its interval, and the demanded one.
fn rate_in_words(report: &Report<'_>) -> String {
    let rate = report.rate();
    let Some(share) = rate.share() else { return "No case was judged.".to_owned() };
    let [low, high] = rate.interval.map(percent);
    let demanded = report.campaign.file.least_success;
    let demanded = demanded.map_or_else(String::new, |least| format!("; {} demanded", percent(least)));
    format!(
        "Success rate {} of {} judged cases, 95 % interval {low} to {high}{demanded}.",
        percent(share),
        rate.judged
    )
}

fn least_margin(result: &CaseResult) -> String {
    let margin = result.least_margin();
    margin.map_or_else(|| "–".to_owned(), |(name, margin)| format!("{}, {name}", percent(margin)))
}

fn values(result: &CaseResult) -> String {
    let value = |setting: &Setting| {
        let number = setting.number().filter(|_| !matches!(setting.value, Some(toml::Value::String(_))));
        let word = number.map_or_else(|| setting.word(), |number| format!("{number:.4}"));
        format!("{} = {word}", setting.name)
    };
    result.settings.iter().map(value).collect::<Vec<_>>().join(", ")
}

/// The table: case, factors, verdict, margins, figures.
fn results_table(campaign: &Campaign, results: &[CaseResult]) -> Table {
    let [identity, verdict, figures] = COLUMNS.map(|columns| {
        columns.iter().map(|&(name, unit, about, values)| Column::new(name, unit, about, values(results)))
    });
    let factors = campaign.file.factors.iter().enumerate();
    let factors = factors.map(|(at, factor)| factor_column(results, at, factor));
    let checks = names(results).into_iter().flat_map(|name| check_columns(results, &name));
    Table::new(identity.chain(factors).chain(verdict).chain(checks).chain(figures).collect())
}

/// Numbers where all values of the factor are numbers, otherwise words.
fn factor_column(results: &[CaseResult], at: usize, factor: &Factor) -> Column {
    let settings = || results.iter().map(|result| &result.settings[at]);
    let values = if settings().all(|setting| setting.number().is_some()) {
        Values::Numbers(settings().map(Setting::number).collect())
    } else {
        Values::Words(settings().map(|setting| Some(setting.word())).collect())
    };
    Column::new(factor.name(), factor.unit(), "factor", values)
}

/// Whether the check passed, and its margin where it has one.
fn check_columns(results: &[CaseResult], name: &str) -> Vec<Column> {
    let checks = || results.iter().map(|result| result.checks.iter().find(|check| check.name == name));
    let passed = checks().map(|check| check?.passed).collect();
    let about = "whether the check passed";
    let mut columns = vec![Column::new(&format!("{name}.passed"), "", about, Values::Truths(passed))];
    let with_margin = checks().flatten().find(|check| check.margin.is_some());
    if let Some(CaseCheck { unit, .. }) = with_margin {
        let column = |ending: &str, unit: &str, about: &str, number: fn(&CaseCheck) -> Option<f64>| {
            let numbers = checks().map(|check| number(check?)).collect();
            Column::new(&format!("{name}.{ending}"), unit, about, Values::Numbers(numbers))
        };
        columns.push(column("margin", unit, "distance from failing", |check| check.margin));
        let about = "distance from failing as a share of the limit";
        columns.push(column("relative_margin", "", about, |check| check.relative_margin));
    }
    columns
}

/// The names of all checks, in the order in which they first appear.
fn names(results: &[CaseResult]) -> Vec<String> {
    in_order_of_appearance(results.iter().flat_map(|result| &result.checks).map(|check| check.name.clone()))
}

pub(crate) fn in_order_of_appearance<T: PartialEq>(values: impl Iterator<Item = T>) -> Vec<T> {
    let mut seen = Vec::new();
    for value in values {
        if !seen.contains(&value) {
            seen.push(value);
        }
    }
    seen
}
