//! What `masseter compare` writes: tables, figures with their caption, and a page with all of it.

use std::fs::{self, File};
use std::{collections::BTreeSet, path::Path};

use anyhow::Context;
use masseter_judge::Statistic;
use masseter_scenario::wording::counted;
use masseter_table::{Cell, Column, Format, Table, write_table};

use super::figures::{figures, groups, percent};
use super::page::{difference_cells, html};
use super::{Difference, Measure, Study, means};
use crate::jaw_table::{jaw_cycle_table, number, recording_cells, recording_columns, whole, word, words};
use crate::text;

/// The meaning of a column.
const GROUP: &str = "Kind and side of the cycles.";

/// Writes tables, figures, caption and page into a folder, and returns the text for a terminal.
///
/// # Errors
/// When a file cannot be written.
pub fn write(study: &Study, folder: &Path, format: &Format) -> anyhow::Result<String> {
    let differences = study.differences();
    let tables = [
        ("cycles", cycles(study)),
        ("means", means_table(study)),
        ("courses", courses(study)),
        ("differences", differences_table(&differences)),
    ];
    for (name, table) in &tables {
        let path = folder.join(format!("{name}.{}", format.extension()));
        write_one(&path, format, table)?;
    }
    let codebook = Table::codebook(tables.iter().map(|(name, table)| (*name, table)));
    write_one(&folder.join("codebook.csv"), &Format::Csv, &codebook)?;
    let (figures, caption) = (figures(study), caption(study, &differences));
    let write = |name: &str, text: &str| {
        let path = folder.join(name);
        fs::write(&path, text).with_context(|| path.display().to_string())
    };
    figures.iter().try_for_each(|figure| write(&figure.name, &figure.svg))?;
    write("caption.txt", &caption)?;
    write("compare.html", &html(study, &differences, figures, &caption)?)?;
    Ok(in_words(study, &differences))
}

fn write_one(path: &Path, format: &Format, table: &Table) -> anyhow::Result<()> {
    let written = || -> anyhow::Result<()> {
        write_table(format, File::create_new(path)?, table)?;
        Ok(())
    };
    written().with_context(|| path.display().to_string())
}

fn cycles(study: &Study) -> Table {
    jaw_cycle_table(study.recordings.iter().map(|of| (of.names(), &of.jaw.cycles[..])))
}

/// Columns of a statistic, whose unit is in a column of its own.
fn statistic_columns(of: &str) -> [Column; 7] {
    [
        whole("n", &format!("Number of {of}.")),
        number("mean", "", "Their mean, in the unit of the row."),
        number("sd", "", "Their standard deviation, as of a sample."),
        number("median", "", "Their median."),
        number("cv", "", "Standard deviation by mean."),
        number("mean_low", "", "Lower end of the 95 % confidence interval of the mean, by Student's t."),
        number("mean_high", "", "Its upper end."),
    ]
}

fn statistic_cells(of: &Statistic) -> [Cell; 7] {
    let Statistic { count, mean, sd, median, cv, mean_low, mean_high } = *of;
    let [mean, sd, median, cv, low, high] = [mean, sd, median, cv, mean_low, mean_high].map(Cell::Number);
    [Cell::Whole(Some(count.cast_signed())), mean, sd, median, cv, low, high]
}

/// Columns of a group of cycles, and of a quantity of theirs.
fn measure_columns() -> [Column; 3] {
    [
        words("group", GROUP),
        words("quantity", "Key of the quantity in the table of cycles."),
        words("unit", "Its unit."),
    ]
}

fn measure_cells(Measure { group, of }: &Measure) -> [Cell; 3] {
    [group, of.name, of.unit].map(word)
}

fn means_table(study: &Study) -> Table {
    let columns = recording_columns().into_iter().chain(measure_columns());
    let columns = columns.chain(statistic_columns("cycles"));
    let mut table = Table::new(columns.collect());
    for (recording, of) in (1..).zip(&study.recordings) {
        for (measure, statistic) in means(of) {
            let first = recording_cells(of.names(), recording).into_iter().chain(measure_cells(&measure));
            table.push(first.chain(statistic_cells(&statistic)));
        }
    }
    table
}

pub(super) fn courses(study: &Study) -> Table {
    let columns = [
        words("group", GROUP),
        number("share_percent", "%", "Share of the cycle."),
        number("opening_mm", "mm", "Mean way down from the most closed place."),
        number("opening_sd_mm", "mm", "Its standard deviation over the cycles."),
        number("lateral_mm", "mm", "Mean way to the left."),
        number("lateral_sd_mm", "mm", "Its standard deviation over the cycles."),
    ];
    let mut table = Table::new(recording_columns().into_iter().chain(columns).collect());
    for (recording, of) in (1..).zip(&study.recordings) {
        for group in &of.jaw.groups {
            for (point, [mean, sd]) in group.mean_course.iter().enumerate() {
                let first = recording_cells(of.names(), recording).into_iter().chain([word(&group.name)]);
                // One course has no spread.
                let [opening_sd_mm, lateral_sd_mm] = [sd.opening_mm, sd.lateral_mm]
                    .map(|sd_mm| Some(sd_mm).filter(|_| group.courses.len() > 1));
                let [opening_mm, lateral_mm] = [mean.opening_mm, mean.lateral_mm].map(Some);
                let values = [Some(percent(point)), opening_mm, opening_sd_mm, lateral_mm, lateral_sd_mm];
                table.push(first.chain(values.map(Cell::Number)));
            }
        }
    }
    table
}

fn differences_table(differences: &[Difference]) -> Table {
    let conditions = [words("from", "Condition before."), words("to", "Condition after.")];
    let columns = measure_columns().into_iter().chain(conditions);
    let columns = columns.chain(statistic_columns("persons with both conditions"));
    let effect =
        number("hedges_g", "", "Paired effect size: mean by standard deviation, corrected for few pairs.");
    let mut table = Table::new(columns.chain([effect]).collect());
    for Difference { measure, from, to, statistic, effect } in differences {
        let first = measure_cells(measure).into_iter().chain([from, to].map(|condition| word(condition)));
        table.push(first.chain(statistic_cells(statistic)).chain([Cell::Number(*effect)]));
    }
    table
}

/// Method and numbers, for below the figures.
fn caption(study: &Study, differences: &[Difference]) -> String {
    let conditions = study.conditions().into_iter().map(|condition| {
        let of: Vec<_> = study.recordings.iter().filter(|recorded| recorded.condition == condition).collect();
        let persons: BTreeSet<_> = of.iter().map(|recorded| &recorded.person).collect();
        let cycles: u64 =
            of.iter().map(|recorded| recorded.jaw.count - recorded.jaw.left_out - recorded.jaw.unclear).sum();
        let [persons, recordings] =
            [(persons.len(), "person"), (of.len(), "recording")].map(|(n, noun)| counted(n as u64, noun));
        format!("{condition}: {persons}, {recordings}, {}", counted(cycles, "cycle"))
    });
    let conditions = conditions.collect::<Vec<_>>().join("; ");
    let pose =
        if study.recordings.iter().all(|recorded| recorded.is_true) { "true" } else { "true or estimated" };
    let pairs = differences.iter().map(|difference| difference.statistic.count).max().unwrap_or_default();
    let tested = if pairs > 1 {
        format!(
            " Differences are paired within persons ({pairs} pairs at most): mean of the persons' differences, 95 % confidence \
             interval by Student's t, effect size Hedges' g of paired values. No correction for several quantities."
        )
    } else {
        " There are no two persons with two conditions: no difference has an interval.".to_owned()
    };
    format!(
        "Movement of the incisal point from the closed jaw, by the {pose} pose of the jaw that the rig played. n = {conditions}. \
         Cycles are cut, named and scaled to their duration as docs/jaw-cycles.md of Masseter states; the rig's ramps are left \
         out, and cycles are pooled within a kind and a side only. Curves: mean ± SD of the recordings' mean courses; of a single recording, of \
         its cycles.{tested}\n"
    )
}

/// The differences that a terminal shows, a line each.
fn in_words(study: &Study, differences: &[Difference]) -> String {
    let groups = groups(study).into_iter().collect::<Vec<_>>().join(", ");
    let found = format!("{} recordings; cycles with courses: {groups}\n", study.recordings.len());
    let heads = ["cycles", "quantity", "condition", "difference", "95 % interval", "SD", "g", "pairs"];
    found + &text::table([14, 34, 20, 12, 22, 10, 7, 6], heads, differences.iter().map(difference_cells))
}
