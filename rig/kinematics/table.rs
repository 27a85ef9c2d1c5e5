//! The CSV frame around both commands: columns checked, lines counted, bad ones reported.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Write};

use anyhow::{Context, bail};
use masseter_shared::config::Scenario;
use masseter_shared::geometry::Mechanism;

use crate::cli::CsvArgs;
use crate::exit::{Exit, Failure};

/// Status of a line that could not be read.
const BAD_LINE: &str = "bad_line";

/// An output line: the values, none where there is nothing to say, and the status.
pub(super) struct Row<const OUT: usize> {
    pub values: Option<[f64; OUT]>,
    pub status: &'static str,
}

/// The mechanism that the arguments mean.
pub(super) fn mechanism(args: &CsvArgs) -> anyhow::Result<Mechanism> {
    let scenario = args.scenario.as_deref().map_or_else(|| Ok(Scenario::default()), Scenario::read)?;
    Ok(Mechanism::new(&scenario.mechanism)?)
}

/// Passes every line through `solve`. Its error says what is wrong with the values of a line.
pub(super) fn convert<const IN: usize, const OUT: usize>(
    args: &CsvArgs,
    columns_in: [&str; IN],
    columns_out: [&str; OUT],
    mut solve: impl FnMut([f64; IN]) -> Result<Row<OUT>, String>,
) -> Result<Exit, Failure> {
    let input: Box<dyn Read> = match &args.input {
        Some(path) => {
            let file = File::open(path).with_context(|| format!("cannot read {}", path.display()))?;
            Box::new(BufReader::new(file))
        }
        None => Box::new(io::stdin().lock()),
    };
    let name =
        args.input.as_ref().map_or_else(|| "standard input".to_owned(), |path| path.display().to_string());
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).flexible(true).from_reader(input);
    check_columns(&name, reader.headers().with_context(|| name.clone())?, &columns_in)?;

    let mut output = BufWriter::new(io::stdout().lock());
    let mut exit = Exit::Passed;
    let written = (|| -> io::Result<()> {
        writeln!(output, "{},status", columns_out.join(","))?;
        let mut record = csv::StringRecord::new();
        loop {
            let row = match reader.read_record(&mut record) {
                Ok(false) => return output.flush(),
                Ok(true) => numbers(&record, &columns_in).and_then(&mut solve),
                Err(error) => Err(error.to_string()),
            };
            let row = row.unwrap_or_else(|reason| {
                let line = record.position().map_or(0, csv::Position::line);
                eprintln!("{name}:{line}: {reason}");
                exit = Exit::Usage;
                Row { values: None, status: BAD_LINE }
            });
            write_row(&mut output, &row)?;
        }
    })();
    match written {
        // Whoever reads the output has had enough.
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(exit),
        Err(error) => Err(Failure::from(anyhow::Error::new(error).context("cannot write standard output"))),
        Ok(()) => Ok(exit),
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

fn write_row<const OUT: usize>(output: &mut impl Write, row: &Row<OUT>) -> io::Result<()> {
    for index in 0..OUT {
        if let Some(values) = &row.values {
            write!(output, "{}", values[index])?;
        }
        write!(output, ",")?;
    }
    writeln!(output, "{}", row.status)
}
