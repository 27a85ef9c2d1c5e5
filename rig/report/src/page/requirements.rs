//! The scenario's requirements: a row each with a small plot, then each signal with its limits.

use masseter_analysis::Figures;
use masseter_analysis::requirements::{RequirementFigures, RequirementPlot};
use masseter_page::{Block, Cell, Chart, Column, Moment, MomentKind, Points, Section, Series, Style, Table};

use super::charts::limit;
use super::result::mark;
use super::times::since_s;
use crate::check::Check;
use crate::text::{or_dash, significant};
use crate::verdict::Verdict;

/// Height of a small plot, px.
const SMALL: u32 = 34;

/// None where the scenario requires nothing.
pub(super) fn section(figures: &Figures, verdict: &Verdict) -> Option<Section> {
    let checks = verdict.checks.iter().filter(|check| check.is_requirement());
    let rows: Vec<_> =
        figures.requirements.iter().zip(checks).map(|(found, check)| row(figures, found, check)).collect();
    if rows.is_empty() {
        return None;
    }
    let columns = vec![
        Column::text("requirement"),
        Column::text("result"),
        Column::text("signal and limit"),
        Column::text("must hold"),
        Column::text("found"),
        Column::number("margin"),
        Column::number("smallest at, s"),
        Column::number("latency, ms"),
    ];
    let table = Table { label: "Requirements".to_owned(), columns, rows };
    let charts = figures.requirements.iter().enumerate().filter_map(|(place, found)| {
        Some(Block::chart(format!("requirement-{place}"), chart(figures, found)?))
    });
    let blocks = [Block::table("requirements", table)].into_iter().chain(charts).collect();
    Some(Section::new("requirements", "Requirements", blocks))
}

fn row(figures: &Figures, found: &RequirementFigures, check: &Check) -> Vec<Cell> {
    let margin = or_dash(found.margin, |margin| format!("{} {}", significant(margin), found.margin_unit));
    let share = found.relative_margin.map(|share| format!(" ({:.0} %)", share * 100.0)).unwrap_or_default();
    let plot = chart(figures, found)
        .map_or_else(|| "".into(), |chart| Cell::Plot { plot: Box::new(Chart { height: SMALL, ..chart }) });
    vec![
        found.name.clone().into(),
        mark(check.result),
        plot,
        found.must.clone().into(),
        found.finding.clone().into(),
        format!("{}{share}", margin.trim_end()).into(),
        or_dash(found.worst_at_s, |at_s| format!("{at_s:.3}")).into(),
        or_dash(found.latency_ms, |ms| format!("{ms:.3}")).into(),
    ]
}

/// The signal, its limits, and the moment of the smallest margin; none without a signal.
fn chart(figures: &Figures, of: &RequirementFigures) -> Option<Chart> {
    let RequirementPlot { signal, unit, began_ns, curve, limits } = of.plot.as_ref()?;
    let shift_s = since_s(figures, *began_ns);
    let points: Vec<_> = curve.iter().map(|&(at_s, value)| (at_s + shift_s, value)).collect();
    let smallest = of.worst_ns.map(|ns| Moment {
        at_s: since_s(figures, ns),
        kind: MomentKind::Note,
        name: "smallest margin".to_owned(),
        text: format!("smallest margin of {}", of.name),
    });
    Some(Chart {
        series: vec![Series::new(signal, Style::Plain, Points::over_time(&points))],
        limits: if limits.is_empty() { Vec::new() } else { vec![limit("limit", limits)] },
        moments: smallest.into_iter().collect(),
        otherwise: "The signal has no value.".to_owned(),
        ..Chart::over_time(format!("{}: {signal}", of.name), *unit)
    })
}
