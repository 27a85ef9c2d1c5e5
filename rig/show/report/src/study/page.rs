//! The page of a study: differences, the courses of the cycles as charts, the figures for print, and the recordings.
//!
//! The page has no link to a run: names of folders may be names of persons.

use masseter_judge::{CoursePoint, Statistic};
use masseter_page::{
    Across, Block, Chart, Column, Content, Life, Page, PageError, Points, Scale, Section, Series, Style,
    Table, Time,
};

use super::figures::{Figure, band, groups, percent};
use super::{Difference, Recorded, Study};
use crate::text::{or_dash, significant};

/// Of this figure no chart shows the same.
const PATHS: &str = "paths-170mm.svg";

/// The page.
pub(super) fn html(
    study: &Study,
    differences: &[Difference],
    figures: Vec<Figure>,
    caption: &str,
) -> Result<String, PageError> {
    let columns = [
        Column::texts(&["cycles", "quantity", "condition"]),
        Column::numbers(&["difference", "95 % interval", "SD", "Hedges' g", "pairs"]),
    ];
    let changes =
        Table::new("Table of differences within persons", columns, differences.iter().map(difference_cells));
    let changes = vec![Block::text("caption", caption), Block::table("differences", changes)];
    let print = figures.into_iter().map(|Figure { name, svg }| {
        let is_folded = name != PATHS;
        let block = Block::new(name.clone(), Content::Figure(svg));
        if is_folded { block.folded(name) } else { block }
    });
    let sections = vec![
        Section::new("differences", "Differences", changes),
        Section::new("courses", "Courses of the cycles", courses(study)),
        Section::new("figures", "Figures for print", print.collect()),
        Section::new("recordings", "Recordings", vec![recordings(study)]),
    ];
    let about =
        format!("{} recordings by {} and {}", study.recordings.len(), study.by.person, study.by.condition);
    let page = Page::new("Jaw motion compared", Life::Finished, Time::default());
    Page { about, sections, ..page }.to_html()
}

fn interval(of: &Statistic) -> String {
    let ends = of.mean_low.zip(of.mean_high);
    or_dash(ends, |(low, high)| format!("{} to {}", significant(low), significant(high)))
}

/// A row of the differences, also for the terminal.
pub(super) fn difference_cells(
    Difference { measure, from, to, statistic, effect }: &Difference,
) -> [String; 8] {
    [
        measure.group.clone(),
        format!("{}, {}", measure.of.about, measure.of.unit),
        format!("{from} to {to}"),
        or_dash(statistic.mean, significant),
        interval(statistic),
        or_dash(statistic.sd, significant),
        or_dash(*effect, |g| format!("{g:.2}")),
        statistic.count.to_string(),
    ]
}

/// Two charts for each kind and side of cycles.
fn courses(study: &Study) -> Vec<Block> {
    let charts = groups(study).into_iter().flat_map(|group| {
        let opening = course(study, group, "opening", |at| at.opening_mm);
        let lateral = course(study, group, "to the left", |at| at.lateral_mm);
        [opening, lateral]
    });
    charts.enumerate().map(|(place, chart)| Block::chart(format!("course-{place}"), chart).half()).collect()
}

/// Mean and mean ± SD of a coordinate over the cycle, in each condition.
fn course(study: &Study, group: &str, name: &str, of: fn(&CoursePoint) -> f64) -> Chart {
    let conditions = study.conditions().into_iter().enumerate();
    let series = conditions.flat_map(|(colour, condition)| {
        let band = band(study, group, condition);
        let lines =
            [("", 0.0, Style::Smoothed), (", mean + SD", 1.0, Style::Raw), (", mean − SD", -1.0, Style::Raw)];
        lines.map(|(ending, sign, style)| {
            let at =
                band.iter().enumerate().map(|(point, [mean, sd])| (percent(point), of(mean) + sign * of(sd)));
            let points = Points::plain(&at.collect::<Vec<_>>());
            Series::new(format!("{condition}{ending}"), style, points).coloured(colour)
        })
    });
    let across = Across::Quantity { label: "share of the cycle, %".to_owned(), scale: Scale::Linear };
    Chart { across, series: series.collect(), ..Chart::over_time(format!("{group}: {name}"), "mm") }
}

fn recordings(study: &Study) -> Block {
    let columns = [
        Column::texts(&["person", "condition", "rig", "cycles that count"]),
        Column::numbers(&["left out", "unclear", "most closed, mm open"]),
    ];
    Block::table(
        "recordings",
        Table::new("Table of recordings", columns, study.recordings.iter().map(recording_cells)),
    )
}

fn recording_cells(of: &Recorded) -> [String; 7] {
    let open = or_dash(of.jaw.most_closed_mm, |open_mm| format!("{:.1}", open_mm.max(0.0)));
    let kinds: Vec<_> = of.jaw.groups.iter().map(|group| format!("{} {}", group.count, group.name)).collect();
    let [left_out, unclear] = [of.jaw.left_out, of.jaw.unclear].map(|count| count.to_string());
    [of.person.clone(), of.condition.clone(), of.verdict.clone(), kinds.join(", "), left_out, unclear, open]
}
