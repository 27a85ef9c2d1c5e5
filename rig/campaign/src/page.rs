//! The page of a campaign: success rate, margins against factors, worst cases. It needs no network.

use askama::Template;
use masseter_charts::palette::{BLUE, GREY, VERMILION};
use masseter_charts::{Axis, Error, Scale, chart, marks, svg};

use crate::factor::Factor;
use crate::report::{Report, WorstCase};
use crate::result::CaseResult;
use crate::results_table::names;

/// Size of a plot, px.
const SIZE: (u32, u32) = (360, 260);
/// Radius of a dot, px.
const DOT: u32 = 3;
/// Room above and below the dots, as a share of their height.
const ROOM: f64 = 0.08;

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

pub(crate) fn html(report: &Report<'_>, worst: &[WorstCase]) -> anyhow::Result<String> {
    let rows = worst.iter().filter_map(|kept| {
        let result = report.results.iter().find(|result| result.number == kept.number)?;
        let name = kept.run.as_ref().and_then(|run| Some(run.file_name()?.to_string_lossy().into_owned()));
        let link = name.map(|name| format!("worst/{name}/report.html"));
        Some(WorstRow { result, kept, link })
    });
    let page = Page { report, rate: rate_in_words(report), rows: rows.collect(), plots: plots(report)? };
    Ok(page.render()?)
}

/// For every check with a margin, a plot a factor.
fn plots(report: &Report<'_>) -> Result<Vec<(String, Vec<String>)>, Error> {
    let mut plots = Vec::new();
    for name in names(&report.results) {
        let points = |at| points(&report.results, &name, at);
        if points(0).is_empty() {
            continue;
        }
        let factors = report.campaign.file.factors.iter().enumerate();
        let drawn: Result<Vec<_>, _> =
            factors.map(|(at, factor)| plot(factor, &report.results, at, &points(at))).collect();
        plots.push((name, drawn?));
    }
    Ok(plots)
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
    let mut words: Vec<String> = Vec::new();
    for word in settings().map(crate::case::Setting::word) {
        if !words.contains(&word) {
            words.push(word);
        }
    }
    words
}

fn plot(factor: &Factor, results: &[CaseResult], at: usize, points: &[Point]) -> Result<String, Error> {
    let unit = factor.unit();
    let label = if unit.is_empty() { factor.name().to_owned() } else { format!("{}, {unit}", factor.name()) };
    let categories = categories(results, at);
    let x = if categories.is_empty() {
        Axis::new(&label, scale(factor), ends(points.iter().map(|point| point.x), 0.0))
    } else {
        Axis::of_names(&label, categories)
    };
    let y_ends = ends(points.iter().map(|point| point.margin_percent).chain([0.0]), ROOM);
    svg(SIZE, |area| {
        let mut chart = chart(area, "", x, Axis::new("margin, % of limit", Scale::Linear, y_ends))?;
        let x_ends = chart.x_range();
        let zero = [(x_ends.start, 0.0), (x_ends.end, 0.0)];
        chart.draw_series(plotters::prelude::LineSeries::new(zero, GREY))?;
        for (has_passed, colour) in [(true, BLUE), (false, VERMILION)] {
            let dots = points.iter().filter(|point| point.has_passed == has_passed);
            marks(&mut chart, dots.map(|point| (point.x, point.margin_percent)), DOT, colour)?;
        }
        Ok(())
    })
}

fn scale(factor: &Factor) -> Scale {
    if factor.distribution == crate::Distribution::LogUniform { Scale::Log } else { Scale::Linear }
}

fn ends(values: impl Iterator<Item = f64> + Clone, room: f64) -> [f64; 2] {
    let low = values.clone().fold(f64::INFINITY, f64::min);
    let high = values.fold(f64::NEG_INFINITY, f64::max);
    let room = (high - low) * room;
    [low - room, high + room]
}

fn percent(share: f64) -> String {
    format!("{:.1} %", share * 100.0)
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
    let value = |setting: &crate::case::Setting| {
        let number = setting.number().filter(|_| !matches!(setting.value, Some(toml::Value::String(_))));
        let word = number.map_or_else(|| setting.word(), |number| format!("{number:.4}"));
        format!("{} = {word}", setting.name)
    };
    result.settings.iter().map(value).collect::<Vec<_>>().join(", ")
}
