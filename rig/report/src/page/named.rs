//! Signals and parameters that the controller declares.

use masseter_analysis::{Curve, Figures, ParameterFigures, SignalFigures};
use masseter_page::{Block, Cell, Chart, Column, Section, Series, Table};

use super::charts::plain;
use crate::text::or_dash;

/// None where the controller declares nothing.
pub(super) fn section(figures: &Figures) -> Option<Section> {
    let mut blocks = Vec::new();
    if !figures.signals.is_empty() {
        blocks.push(Block::table("signals", signals(&figures.signals)));
        blocks.extend(charts(figures));
    }
    if !figures.parameters.is_empty() {
        blocks.push(Block::table("parameters", parameters(&figures.parameters)));
    }
    let title = match (figures.signals.is_empty(), figures.parameters.is_empty()) {
        (false, true) => "Signals of the controller",
        (true, false) => "Parameters of the controller",
        _ => "Signals of the controller and its parameters",
    };
    (!blocks.is_empty()).then(|| Section::new("named", title, blocks))
}

fn signals(signals: &[SignalFigures]) -> Table {
    let row = |named: &SignalFigures| -> Vec<Cell> {
        let values = [named.min, named.mean, named.max, named.last].map(value);
        let not_finite = match named.not_finite {
            0 => String::new(),
            count => format!(" ({count} values were no finite numbers)"),
        };
        let words = [named.signal.name.clone(), named.signal.unit.clone()];
        let about = format!("{}{not_finite}", named.signal.about);
        words.into_iter().chain(values).chain([about]).map(Cell::from).collect()
    };
    let numbers = ["smallest", "mean", "largest", "last"].map(Column::number);
    let columns = [Column::text("signal"), Column::text("unit")]
        .into_iter()
        .chain(numbers)
        .chain([Column::text("meaning")])
        .collect();
    Table { label: "Signals of the controller".to_owned(), columns, rows: signals.iter().map(row).collect() }
}

/// One chart for each unit, in the order of the signals' declaration.
fn charts(figures: &Figures) -> Vec<Block> {
    let mut units: Vec<(&str, Vec<Series>)> = Vec::new();
    for (SignalFigures { signal, .. }, curve) in figures.signals.iter().zip(&figures.over_time.signals) {
        let curve: &Curve = curve;
        let series = plain(&signal.name, curve, 1.0);
        match units.iter_mut().find(|(unit, _)| *unit == signal.unit) {
            Some((_, all)) => all.push(series),
            None => units.push((&signal.unit, vec![series])),
        }
    }
    let chart = |(number, (unit, series)): (usize, (&str, Vec<Series>))| {
        let title = if let [only] = &series[..] { only.name.clone() } else { "Signals".to_owned() };
        let otherwise = "No finite value came.".to_owned();
        let chart = Chart { series, otherwise, ..Chart::over_time(title, unit) };
        Block::chart(format!("signals-{number}"), chart)
    };
    units.into_iter().enumerate().map(chart).collect()
}

fn parameters(parameters: &[ParameterFigures]) -> Table {
    let row = |named: &ParameterFigures| -> Vec<Cell> {
        let parameter = &named.parameter;
        let [low, high] = parameter.range;
        let cells = [
            parameter.name.clone(),
            parameter.unit.clone(),
            parameter.value.to_string(),
            named.last.to_string(),
            named.changes.to_string(),
            format!("{low} to {high}"),
            parameter.about.clone(),
        ];
        cells.map(Cell::from).into()
    };
    let columns = vec![
        Column::text("parameter"),
        Column::text("unit"),
        Column::number("at the start"),
        Column::number("at the end"),
        Column::number("changes"),
        Column::number("range"),
        Column::text("meaning"),
    ];
    let rows = parameters.iter().map(row).collect();
    Table { label: "Parameters of the controller".to_owned(), columns, rows }
}

fn value(value: Option<f64>) -> String {
    or_dash(value, |value| format!("{value:.6}").trim_end_matches('0').trim_end_matches('.').to_owned())
}
