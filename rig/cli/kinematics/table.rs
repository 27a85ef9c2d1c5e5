//! The CSV frame around both commands: columns checked, lines counted, bad ones reported.
//!
//! Lines are read in batches, solved on all cores and written in order, so memory stays the same
//! however long the input is. The computation is an argument.

use std::io::{self, BufReader, Write};
use std::{fs::File, iter, path::PathBuf};

use anyhow::{Context, anyhow, ensure};
use masseter_model::geometry::Mechanism;
use masseter_scenario::rows::{Line, fields, lines, numbers};
use masseter_scenario::{input::excerpt, wording::shortest};
use masseter_terminal::{Exit, status, taken};
use rayon::prelude::*;

/// Status of a line that could not be read.
const BAD_LINE: &str = "bad_line";
/// Lines read before they are solved and written: a few milliseconds of work for every core.
const BATCH_LINES: usize = 16_384;
/// Lines that one core takes at a time.
const CHUNK_LINES: usize = 256;

/// CSV in, CSV out.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct CsvArgs {
    /// CSV file to read [default: standard input]
    #[arg(long, value_name = "FILE.csv")]
    input: Option<PathBuf>,
    /// Scenario with the mechanism [default: the built-in scenario]
    #[arg(long, value_name = "SCENARIO.toml")]
    scenario: Option<PathBuf>,
}

impl CsvArgs {
    /// The mechanism of the scenario.
    pub(super) fn mechanism(&self) -> anyhow::Result<Mechanism> {
        let scenario = masseter_plan::read_scenario(self.scenario.as_deref())?;
        Ok(Mechanism::new(&scenario.mechanism)?)
    }

    /// The input's name in messages, and its lines.
    fn open(&self) -> anyhow::Result<(String, Box<dyn Iterator<Item = Line>>)> {
        let Some(path) = &self.input else {
            return Ok(("standard input".to_owned(), Box::new(lines(io::stdin().lock()))));
        };
        let name = path.display().to_string();
        let file = File::open(path).with_context(|| format!("cannot read {name}"))?;
        Ok((name, Box::new(lines(BufReader::new(file)))))
    }
}

/// The header lines of a command, without the status that ends every output line.
#[derive(Debug, Clone, Copy)]
pub(super) struct Columns {
    pub read: &'static str,
    pub written: &'static str,
}

/// Solves one line's values and writes the output lines. The error names the wrong value.
pub(super) type Solved = Result<(), String>;

/// Output lines under way.
pub(super) struct Lines {
    csv: csv::Writer<Vec<u8>>,
    /// Values of a line.
    width: usize,
    /// Where and why lines could not be read.
    refusals: Vec<(u64, String)>,
    /// Where and why lines that were read have no solution.
    remarks: Vec<(u64, String)>,
}

impl Lines {
    /// One line: its values, nothing for those that are no number or absent, then its status.
    pub(super) fn row(&mut self, values: impl IntoIterator<Item = f64>, status: &str) {
        let values = values.into_iter().chain(iter::repeat(f64::NAN)).take(self.width);
        let cells = values.map(|value| if value.is_nan() { String::new() } else { shortest(value) });
        let written = self.csv.write_record(cells.chain([status.to_owned()]));
        written.expect("all lines have the same width, and a vector takes them");
    }

    /// Explains a line of the input on standard error.
    pub(super) fn remark(&mut self, line: u64, reason: String) {
        self.remarks.push((line, reason));
    }
}

/// Passes every line through `solve`, on all cores. `solve` gets the line's number as well.
pub(super) fn convert<const IN: usize>(
    args: &CsvArgs,
    columns: Columns,
    solve: impl Fn(u64, [f64; IN], &mut Lines) -> Solved + Sync,
) -> anyhow::Result<Exit> {
    stream(args, columns, |batch| {
        batch.par_chunks(CHUNK_LINES).map(|chunk| solve_lines(chunk, columns, &solve)).collect()
    })
}

/// The same, one line after the other.
pub(super) fn convert_in_turn<const IN: usize>(
    args: &CsvArgs,
    columns: Columns,
    mut solve: impl FnMut(u64, [f64; IN], &mut Lines) -> Solved,
) -> anyhow::Result<Exit> {
    stream(args, columns, |batch| vec![solve_lines(batch, columns, &mut solve)])
}

/// Passes lines through `solve`.
fn solve_lines<const IN: usize>(
    batch: &[Line],
    columns: Columns,
    mut solve: impl FnMut(u64, [f64; IN], &mut Lines) -> Solved,
) -> Lines {
    let width = columns.written.split(',').count();
    let csv = csv::Writer::from_writer(Vec::new());
    let mut lines = Lines { csv, width, refusals: Vec::new(), remarks: Vec::new() };
    let read: Vec<_> = columns.read.split(',').collect();
    for line in batch {
        let text = line.text.as_deref().map_err(Clone::clone);
        let values = text.and_then(|text| numbers(text, &read));
        let values = values.map(|values| values.try_into().expect("a number for each column"));
        if let Err(reason) = values.and_then(|values| solve(line.number, values, &mut lines)) {
            lines.row([], BAD_LINE);
            lines.refusals.push((line.number, reason));
        }
    }
    lines
}

/// Reads lines in batches and writes what `solve` makes of each.
fn stream(
    args: &CsvArgs,
    columns: Columns,
    mut solve: impl FnMut(&[Line]) -> Vec<Lines>,
) -> anyhow::Result<Exit> {
    let (name, mut input) = args.open()?;
    let header = input.next().unwrap_or(Line { number: 1, text: Ok(String::new()) });
    check_columns(header, &name, columns.read)?;
    let mut exit = Exit::Passed;
    let mut output = io::stdout().lock();
    let written = (|| -> io::Result<()> {
        writeln!(output, "{},status", columns.written)?;
        loop {
            let batch: Vec<_> = input.by_ref().take(BATCH_LINES).collect();
            if batch.is_empty() {
                return output.flush();
            }
            for mut lines in solve(&batch) {
                lines.csv.flush()?;
                output.write_all(lines.csv.get_ref())?;
                for (line, remark) in lines.remarks {
                    status!("{name}:{line}: {remark}");
                }
                for (line, reason) in lines.refusals {
                    status!("{name}:{line}: {reason}");
                    exit = Exit::Usage;
                }
            }
        }
    })();
    taken(written)?;
    Ok(exit)
}

fn check_columns(header: Line, name: &str, expected: &str) -> anyhow::Result<()> {
    let place = format!("{name}:{}", header.number);
    let text = header.text.map_err(|reason| anyhow!("{place}: {reason}"))?;
    let found = fields(&text).collect::<Vec<_>>().join(",");
    ensure!(found == expected, "{place}: the columns are '{}', expected '{expected}'", excerpt(&found));
    Ok(())
}
