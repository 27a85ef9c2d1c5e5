//! The matrix as a picture: a row for each kind, a column for each axis and phase, coloured by what the fault came to.

use std::fmt::Write;

use masseter_model::geometry::AXIS_NAMES;

use super::table::{Coverage, Row};

/// Size of a cell, px.
const CELL: [usize; 2] = [46, 20];
/// Room for the names of the kinds, and for the two header lines, px.
const LEFT: usize = 170;
const TOP: usize = 56;

/// The picture. Each cell has the initial of who detected the fault, and all figures as its title.
pub(super) fn svg(rows: &[Row]) -> String {
    let mut kinds: Vec<_> = rows.iter().map(|row| row.case.fault.kind).collect();
    kinds.dedup();
    let mut phases: Vec<_> = rows.iter().map(|row| row.case.phase).collect();
    phases.sort_by_key(|phase| rows.iter().position(|row| row.case.phase == *phase));
    phases.dedup();
    let columns: Vec<_> = std::iter::once("")
        .chain(AXIS_NAMES)
        .flat_map(|axis| phases.iter().map(move |phase| (axis, *phase)))
        .filter(|(axis, phase)| rows.iter().any(|row| row.axis() == *axis && row.case.phase == *phase))
        .collect();
    let (width, height) = (LEFT + columns.len() * CELL[0] + 10, TOP + kinds.len() * CELL[1] + 60);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    for (place, (axis, phase)) in columns.iter().enumerate() {
        let x = LEFT + place * CELL[0] + CELL[0] / 2;
        let axis = if axis.is_empty() { "rig" } else { axis };
        let _ = writeln!(svg, "<text x=\"{x}\" y=\"20\" text-anchor=\"middle\">{axis}</text>");
        let _ =
            writeln!(svg, "<text x=\"{x}\" y=\"40\" text-anchor=\"middle\" font-size=\"9\">{phase}</text>");
    }
    for (place, kind) in kinds.iter().enumerate() {
        let y = TOP + place * CELL[1] + 14;
        let _ = writeln!(svg, "<text x=\"{}\" y=\"{y}\" text-anchor=\"end\">{kind}</text>", LEFT - 8);
    }
    for row in rows {
        let column = columns.iter().position(|(axis, phase)| row.axis() == *axis && row.case.phase == *phase);
        let line = kinds.iter().position(|kind| *kind == row.case.fault.kind);
        if let Some((column, line)) = column.zip(line) {
            svg += &cell(row, LEFT + column * CELL[0], TOP + line * CELL[1]);
        }
    }
    svg += &legend(TOP + kinds.len() * CELL[1] + 24);
    svg + "</svg>\n"
}

fn cell(row: &Row, x: usize, y: usize) -> String {
    let (source, cause) = row.detection.clone().unwrap_or_else(|| ("nobody".to_owned(), String::new()));
    let initial = match source.as_str() {
        "controller" => "C",
        "master" => "M",
        "drive" => "D",
        _ => "–",
    };
    let initial = if row.coverage == Coverage::Idle { "" } else { initial };
    let title = format!(
        "{} {}: {}, {source} {cause}, {:.3} mm, {:.3}°",
        row.case.fault,
        row.case.phase,
        row.coverage.word(),
        row.deviation_mm,
        row.deviation_deg
    );
    format!(
        "<g><title>{title}</title><rect x=\"{x}\" y=\"{y}\" width=\"{}\" height=\"{}\" fill=\"{}\"/>\
         <text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{initial}</text></g>\n",
        CELL[0] - 2,
        CELL[1] - 2,
        colour(row.coverage),
        x + CELL[0] / 2 - 1,
        y + 13
    )
}

/// Colours that colour-blind readers can tell apart: Okabe and Ito, lightened.
fn colour(coverage: Coverage) -> &'static str {
    match coverage {
        Coverage::Idle => "#ffffff",
        Coverage::Harmless => "#e5e5e5",
        Coverage::Detected => "#9ad1f0",
        Coverage::Late => "#f5c26b",
        Coverage::Undetected => "#e8825a",
    }
}

fn legend(y: usize) -> String {
    let entries =
        [Coverage::Detected, Coverage::Harmless, Coverage::Late, Coverage::Undetected, Coverage::Idle];
    let entries = entries.iter().enumerate().map(|(place, coverage)| {
        let x = 20 + place * 190;
        format!(
            "<rect x=\"{x}\" y=\"{}\" width=\"14\" height=\"14\" fill=\"{}\" stroke=\"#999\"/>\
             <text x=\"{}\" y=\"{y}\">{}</text>\n",
            y - 11,
            colour(*coverage),
            x + 20,
            coverage.word()
        )
    });
    let key = "C controller, M master, D drive, – nobody: the first that reported a fault after the strike";
    let key = format!("<text x=\"20\" y=\"{}\">{key}</text>\n", y + 22);
    entries.collect::<String>() + &key
}
