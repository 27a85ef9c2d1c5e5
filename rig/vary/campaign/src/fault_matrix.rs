//! The matrix of faults: what each fault did to the jaw and who detected it, as a table, as a picture and in words.

use std::{collections::BTreeMap, fs, path::Path};

use anyhow::Context;
use askama::Template;
use masseter_scenario::{FaultConfig, FaultKindConfig};

use crate::case::in_order_of_appearance;

/// The first line of the CSV file.
const HEADER: &str = "kind,layer,axis,phase,size,struck,detected_by,cause,latency_ms,deviation_mm,deviation_deg,end_state,verdict\n";

/// What a fault came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Coverage {
    /// It never acted.
    Idle,
    /// Nobody detected it, and the jaw stayed within the limits.
    Harmless,
    /// It was detected before the jaw left the limits.
    Detected,
    /// It was detected too late.
    Late,
    /// Nobody detected it, and the jaw left the limits.
    Undetected,
}

impl Coverage {
    const LEGEND: [Self; 5] = [Self::Detected, Self::Harmless, Self::Late, Self::Undetected, Self::Idle];

    /// The word for it, and a colour. Colour-blind readers can tell these apart: Okabe and Ito, lightened.
    fn shown(self) -> (&'static str, &'static str) {
        match self {
            Self::Idle => ("never struck", "#ffffff"),
            Self::Harmless => ("within the limits, undetected", "#e5e5e5"),
            Self::Detected => ("detected in time", "#9ad1f0"),
            Self::Late => ("detected too late", "#f5c26b"),
            Self::Undetected => ("beyond the limits, undetected", "#e8825a"),
        }
    }
}

/// A fault that was played.
#[derive(Debug, Clone)]
pub struct FaultRow {
    /// The fault.
    pub fault: FaultConfig,
    /// The axis concerned by name; empty where the fault has none.
    pub axis: &'static str,
    /// The phase of the motion in which it acted.
    pub phase: &'static str,
    /// What it came to.
    pub coverage: Coverage,
    /// Who detected it first, and as what.
    pub detection: Option<(String, String)>,
    /// From the strike to the detection, ms.
    pub latency_ms: Option<f64>,
    /// How far the jaw left its path, mm.
    pub deviation_mm: f64,
    /// How far it turned from its path, degrees.
    pub deviation_deg: f64,
    /// The last state of the controller.
    pub end_state: String,
    /// The verdict on the run in a word.
    pub verdict: &'static str,
}

impl FaultRow {
    /// Whether the jaw left the limits before anybody detected the fault.
    pub fn is_bad(&self) -> bool {
        matches!(self.coverage, Coverage::Undetected | Coverage::Late)
    }

    fn detected_by(&self) -> (&str, &str) {
        self.detection.as_ref().map_or(("nobody", ""), |(source, cause)| (source, cause))
    }

    /// The line of the CSV file.
    fn csv_line(&self) -> String {
        let Self { fault, axis, phase, coverage, end_state, verdict, .. } = self;
        let (source, cause) = self.detected_by();
        let size = fault.size.map(|size| size.to_string()).unwrap_or_default();
        let latency = self.latency_ms.map(|latency_ms| format!("{latency_ms:.3}")).unwrap_or_default();
        format!(
            "{},{},{axis},{phase},{size},{},{source},{cause},{latency},{:.4},{:.4},{end_state},{verdict}\n",
            fault.kind,
            fault.kind.declared().layer,
            *coverage != Coverage::Idle,
            self.deviation_mm,
            self.deviation_deg,
        )
    }

    /// Of who detected the fault.
    fn initial(&self) -> &'static str {
        match self.detected_by() {
            _ if self.coverage == Coverage::Idle => "",
            ("controller", _) => "C",
            ("master", _) => "M",
            ("drive", _) => "D",
            _ => "–",
        }
    }

    /// All figures.
    fn title(&self) -> String {
        let Self { fault, phase, deviation_mm, deviation_deg, .. } = self;
        let (source, cause) = self.detected_by();
        let word = self.coverage.shown().0;
        format!("{fault} {phase}: {word}, {source} {cause}, {deviation_mm:.3} mm, {deviation_deg:.3}°")
    }
}

/// The picture: a line a kind, a column an axis and phase.
#[derive(Template)]
#[template(path = "fault_matrix.svg")]
struct Picture<'a> {
    rows: &'a [FaultRow],
    kinds: Vec<FaultKindConfig>,
    columns: Vec<(&'static str, &'static str)>,
}

impl<'a> Picture<'a> {
    fn new(rows: &'a [FaultRow]) -> Self {
        let kinds = in_order_of_appearance(rows.iter().map(|row| row.fault.kind));
        let phases = in_order_of_appearance(rows.iter().map(|row| row.phase));
        let mut columns = in_order_of_appearance(rows.iter().map(|row| (row.axis, row.phase)));
        let axes = in_order_of_appearance(rows.iter().map(|row| row.axis));
        // Faults without an axis come first.
        columns.sort_by_key(|(axis, phase)| {
            let axis = (!axis.is_empty(), axes.iter().position(|other| other == axis));
            (axis, phases.iter().position(|other| other == phase))
        });
        Self { rows, kinds, columns }
    }

    fn column(&self, row: &FaultRow) -> usize {
        let found = self.columns.iter().position(|column| *column == (row.axis, row.phase));
        found.expect("the columns are those of the rows")
    }

    fn line(&self, row: &FaultRow) -> usize {
        let found = self.kinds.iter().position(|kind| *kind == row.fault.kind);
        found.expect("the kinds are those of the rows")
    }
}

/// Writes the table and the picture into a folder.
///
/// # Errors
/// When a file cannot be written.
pub fn write_fault_matrix(folder: &Path, rows: &[FaultRow]) -> anyhow::Result<()> {
    let table = HEADER.to_owned() + &rows.iter().map(FaultRow::csv_line).collect::<String>();
    for (name, text) in [("matrix.csv", table), ("matrix.svg", Picture::new(rows).render()?)] {
        let path = folder.join(name);
        fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// How many cases came to what, and each that left the limits.
pub fn fault_matrix_in_words(folder: &Path, rows: &[FaultRow]) -> String {
    let mut counts: BTreeMap<Coverage, usize> = BTreeMap::new();
    for row in rows {
        *counts.entry(row.coverage).or_default() += 1;
    }
    let counts = counts.iter().map(|(coverage, count)| format!("{count:>5}  {}\n", coverage.shown().0));
    let bad = rows.iter().filter(|row| row.is_bad()).map(|row| {
        let FaultRow { fault, axis, phase, deviation_mm, deviation_deg, .. } = row;
        let detection = match row.detected_by() {
            ("nobody", _) => "nobody detected it".to_owned(),
            (source, cause) => format!("detected by {source} as {cause}"),
        };
        format!("  {fault} {axis} {phase}: {deviation_mm:.3} mm, {deviation_deg:.3}°, {detection}\n")
    });
    format!("{}{}\n{}\n", counts.collect::<String>(), bad.collect::<String>(), folder.display())
}

#[cfg(test)]
mod tests {
    use masseter_scenario::{BusFault, DriveFault};

    use super::*;

    fn row(fault: FaultConfig, axis: &'static str, phase: &'static str, coverage: Coverage) -> FaultRow {
        let detection =
            (coverage == Coverage::Late).then(|| ("master".to_owned(), "following error".to_owned()));
        FaultRow {
            fault,
            axis,
            phase,
            coverage,
            latency_ms: detection.as_ref().map(|_| 2.0),
            detection,
            deviation_mm: 0.25,
            deviation_deg: 0.5,
            end_state: "finished".to_owned(),
            verdict: "PASS",
        }
    }

    #[test]
    fn table_picture_and_words_show_every_fault() {
        let (lose, runaway) = (FaultConfig::new(BusFault::Lose), FaultConfig::new(DriveFault::Runaway));
        let rows = [
            row(runaway.clone(), "d1", "rest", Coverage::Late),
            row(runaway, "d2", "rest", Coverage::Idle),
            row(lose, "", "opening", Coverage::Harmless),
        ];
        let folder = tempfile::tempdir().unwrap();
        write_fault_matrix(folder.path(), &rows).unwrap();
        let read = |name| fs::read_to_string(folder.path().join(name)).unwrap();
        let lines: Vec<_> = read("matrix.csv").lines().map(str::to_owned).collect();
        assert_eq!(lines.len(), 4);
        assert_eq!(
            lines[1],
            "drive_runaway,drive,d1,rest,,true,master,following error,2.000,0.2500,0.5000,finished,PASS"
        );
        let picture = read("matrix.svg");
        assert!(picture.starts_with("<svg ") && picture.ends_with("</svg>"), "{picture}");
        // Faults without an axis have the first column, and the kinds the order of the rows.
        assert!(
            picture.contains("translate(216 56)\"><title>drive_runaway") && picture.contains(">M</text>"),
            "{picture}"
        );
        assert!(
            picture.contains("translate(170 76)\"><title>lose") && picture.contains(">–</text>"),
            "{picture}"
        );
        let words = fault_matrix_in_words(folder.path(), &rows);
        assert!(words.contains("    1  detected too late\n"), "{words}");
        assert!(
            words.contains("d1 rest: 0.250 mm, 0.500°, detected by master as following error\n"),
            "{words}"
        );
        assert!(rows[0].is_bad() && !rows[1].is_bad());
    }
}
