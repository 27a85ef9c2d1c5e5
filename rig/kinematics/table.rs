//! The CSV frame around both commands: columns checked, lines counted, bad ones reported.
//!
//! Lines are read in batches, solved on all cores and written in order, so memory stays the same
//! however long the input is. What is computed from a line is not known here.

use std::fs::File;
use std::io::{self, BufReader, Read, Write};

use anyhow::{Context, bail};
use masseter_shared::config::Scenario;
use masseter_shared::geometry::Mechanism;
use rayon::prelude::*;

use crate::cli::CsvArgs;
use crate::exit::{Exit, Failure};

/// Status of a line that could not be read.
const BAD_LINE: &str = "bad_line";
/// Lines read before they are solved and written: a few milliseconds of work for every core.
const BATCH_LINES: usize = 16_384;
/// Lines that one core takes at a time.
const CHUNK_LINES: usize = 256;

/// The columns of a command, without the status that ends every output line.
#[derive(Debug, Clone, Copy)]
pub(super) struct Columns<'a, const IN: usize> {
    pub read: [&'a str; IN],
    pub written: &'a [&'a str],
}

/// Solves one line's values and writes the output lines they lead to. Its error says what is wrong
/// with the values.
pub(super) type Solved = Result<(), String>;

/// Output lines under way.
#[derive(Debug, Default)]
pub(super) struct Lines {
    text: Vec<u8>,
    /// Where and why lines could not be read.
    refusals: Vec<(u64, String)>,
}

impl Lines {
    /// One line: its values, nothing for those that are no number, then its status.
    pub(super) fn row(&mut self, values: &[f64], status: &str) {
        for value in values {
            if !value.is_nan() {
                // A vector takes all that is written to it.
                let _ = write!(self.text, "{value}");
            }
            self.text.push(b',');
        }
        self.end(status);
    }

    /// A line without values.
    pub(super) fn empty(&mut self, columns: usize, status: &str) {
        self.text.resize(self.text.len() + columns, b',');
        self.end(status);
    }

    fn end(&mut self, status: &str) {
        self.text.extend_from_slice(status.as_bytes());
        self.text.push(b'\n');
    }
}

/// The mechanism that the arguments mean.
pub(super) fn mechanism(args: &CsvArgs) -> anyhow::Result<Mechanism> {
    let scenario = args.scenario.as_deref().map_or_else(|| Ok(Scenario::default()), Scenario::read)?;
    Ok(Mechanism::new(&scenario.mechanism)?)
}

/// Passes every line through `solve`, on all cores. `solve` gets the line's number as well.
pub(super) fn convert<const IN: usize>(
    args: &CsvArgs,
    columns: Columns<'_, IN>,
    solve: impl Fn(u64, [f64; IN], &mut Lines) -> Solved + Sync,
) -> Result<Exit, Failure> {
    stream(args, columns, |batch| {
        let chunks = batch.par_chunks(CHUNK_LINES).map(|chunk| {
            let mut lines = Lines::default();
            for record in chunk {
                solve_record(record, &columns, &mut lines, &solve);
            }
            lines
        });
        chunks.collect()
    })
}

/// Passes every line through `solve`, one after the other.
pub(super) fn convert_in_turn<const IN: usize>(
    args: &CsvArgs,
    columns: Columns<'_, IN>,
    mut solve: impl FnMut(u64, [f64; IN], &mut Lines) -> Solved,
) -> Result<Exit, Failure> {
    stream(args, columns, |batch| {
        let mut lines = Lines::default();
        for record in batch {
            solve_record(record, &columns, &mut lines, &mut solve);
        }
        vec![lines]
    })
}

/// What was read of a line, and its number.
struct Record {
    line: u64,
    fields: Result<csv::StringRecord, String>,
}

fn solve_record<const IN: usize>(
    record: &Record,
    columns: &Columns<'_, IN>,
    lines: &mut Lines,
    mut solve: impl FnMut(u64, [f64; IN], &mut Lines) -> Solved,
) {
    let values = record.fields.as_ref().map_err(Clone::clone);
    let values = values.and_then(|fields| numbers(fields, &columns.read));
    if let Err(reason) = values.and_then(|values| solve(record.line, values, lines)) {
        lines.empty(columns.written.len(), BAD_LINE);
        lines.refusals.push((record.line, reason));
    }
}

fn stream<const IN: usize>(
    args: &CsvArgs,
    columns: Columns<'_, IN>,
    mut solve: impl FnMut(&[Record]) -> Vec<Lines>,
) -> Result<Exit, Failure> {
    let (name, input) = open(args)?;
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).flexible(true).from_reader(input);
    check_columns(&name, reader.headers().with_context(|| name.clone())?, &columns.read)?;

    let mut exit = Exit::Passed;
    let mut output = io::stdout().lock();
    let written = (|| -> io::Result<()> {
        writeln!(output, "{},status", columns.written.join(","))?;
        let mut batch = Vec::with_capacity(BATCH_LINES);
        loop {
            read_batch(&mut reader, &mut batch);
            if batch.is_empty() {
                return output.flush();
            }
            for lines in solve(&batch) {
                output.write_all(&lines.text)?;
                for (line, reason) in lines.refusals {
                    tell!("{name}:{line}: {reason}");
                    exit = Exit::Usage;
                }
            }
        }
    })();
    match written {
        // Whoever reads the output has had enough.
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(exit),
        Err(error) => Err(Failure::from(anyhow::Error::new(error).context("cannot write standard output"))),
        Ok(()) => Ok(exit),
    }
}

/// The input and what it is called in messages.
fn open(args: &CsvArgs) -> anyhow::Result<(String, Box<dyn Read>)> {
    let Some(path) = &args.input else {
        return Ok(("standard input".to_owned(), Box::new(io::stdin().lock())));
    };
    let name = path.display().to_string();
    let file = File::open(path).with_context(|| format!("cannot read {name}"))?;
    Ok((name, Box::new(BufReader::new(file))))
}

/// Fills the batch; empty at the end of the input, which an error of the system is as well.
fn read_batch(reader: &mut csv::Reader<Box<dyn Read>>, batch: &mut Vec<Record>) {
    batch.clear();
    while batch.len() < BATCH_LINES {
        let mut fields = csv::StringRecord::new();
        let (position, fields) = match reader.read_record(&mut fields) {
            Ok(false) => return,
            Ok(true) => (fields.position().cloned(), Ok(fields)),
            Err(error) => (error.position().cloned(), Err(error.to_string())),
        };
        let line = position.as_ref().unwrap_or_else(|| reader.position()).line();
        batch.push(Record { line, fields });
    }
}

fn check_columns(name: &str, found: &csv::StringRecord, expected: &[&str]) -> anyhow::Result<()> {
    if found.iter().eq(expected.iter().copied()) {
        return Ok(());
    }
    let found: Vec<_> = found.iter().collect();
    bail!("{name}:1: the columns are '{}', expected '{}'", found.join(","), expected.join(","))
}

fn numbers<const IN: usize>(record: &csv::StringRecord, columns: &[&str; IN]) -> Result<[f64; IN], String> {
    if record.len() != IN {
        return Err(format!("{} values, expected {IN}", record.len()));
    }
    let mut values = [0.0_f64; IN];
    for ((value, text), column) in values.iter_mut().zip(record).zip(columns) {
        *value = text.parse().map_err(|_| format!("{column} is '{text}', not a number"))?;
        if !value.is_finite() {
            return Err(format!("{column} is {value}, not a finite number"));
        }
    }
    Ok(values)
}
