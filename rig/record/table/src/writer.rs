//! Writes a table part by part, so that its length does not matter for the memory: as CSV, or by the program that writes
//! Parquet. That is one of its own, since the crates that it needs would lengthen every first build.

use std::io::{self, BufWriter, ErrorKind, Read, Write};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::thread::{self, JoinHandle};
use std::{env, fs::File, os::unix::process::CommandExt, path::PathBuf};

use crate::rows::{send_columns, send_end, send_part};
use crate::table::Table;

const NAME: &str = "masseter-parquet";
/// Its exit code when the disk is full, as that of every command.
const DISK_FULL: i32 = 6;

/// Why a table could not be written.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The program that writes Parquet was not built.
    #[error(
        "Parquet files need {}, which does not exist: build it with `cargo build --release`, or install it with \
         `cargo install --path rig/record/parquet`",
        path.display()
    )]
    NoProgram {
        /// Where it is expected.
        path: PathBuf,
    },
    /// The program that writes Parquet does not start.
    #[error("cannot start {}: {source}; `cargo build --release` builds it again", path.display())]
    NotStarted {
        /// Where it is.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// The program that writes Parquet failed, for another reason than a full disk.
    #[error("cannot write the table: masseter-parquet ended with {status}: {said}")]
    Program {
        /// How it ended.
        status: ExitStatus,
        /// What it wrote to standard error.
        said: String,
    },
    /// The file, or the way to the program that writes it. After a full disk the kind is that of one, in both formats.
    #[error("cannot write the table: {0}")]
    File(#[from] io::Error),
}

impl From<csv::Error> for TableError {
    fn from(error: csv::Error) -> Self {
        match error.into_kind() {
            csv::ErrorKind::Io(error) => Self::File(error),
            other => Self::File(io::Error::other(format!("{other:?}"))),
        }
    }
}

/// The format of a file.
#[derive(Debug, Clone)]
pub enum Format {
    /// Apache Parquet, which this program writes.
    Parquet(ParquetProgram),
    /// Comma-separated values below a line of names.
    Csv,
}

impl Format {
    /// The ending of files, without the dot.
    pub fn extension(&self) -> &'static str {
        match self {
            Self::Parquet(_) => "parquet",
            Self::Csv => "csv",
        }
    }
}

/// A file that a table is written to.
pub struct TableWriter {
    sink: Sink,
}

enum Sink {
    Parquet(ParquetFile),
    Csv(Box<csv::Writer<File>>),
}

impl TableWriter {
    /// Begins a file with the columns of a table, and none of its rows.
    ///
    /// # Errors
    /// Those of the medium, and of the program that writes Parquet.
    pub fn new(format: &Format, file: File, table: &Table) -> Result<Self, TableError> {
        let sink = match format {
            Format::Parquet(program) => Sink::Parquet(program.begin_file(file, table)?),
            Format::Csv => {
                let mut writer = csv::Writer::from_writer(file);
                writer.write_record(table.columns().iter().map(|column| &column.name))?;
                Sink::Csv(Box::new(writer))
            }
        };
        Ok(Self { sink })
    }

    /// Appends all rows of a table with the same columns; in Parquet they are a row group.
    ///
    /// # Errors
    /// Those of the medium, and of the program that writes Parquet.
    pub fn write(&mut self, table: &Table) -> Result<(), TableError> {
        match &mut self.sink {
            Sink::Parquet(file) => file.send_rows(|rows| send_part(table, rows))?,
            Sink::Csv(writer) => {
                for row in 0..table.rows() {
                    writer.write_record(table.columns().iter().map(|column| column.values.cell_text(row)))?;
                }
            }
        }
        Ok(())
    }

    /// Ends the file. Without this it is no valid Parquet file.
    ///
    /// # Errors
    /// Those of the medium, and of the program that writes Parquet.
    pub fn finish(self) -> Result<(), TableError> {
        match self.sink {
            Sink::Parquet(mut file) => {
                file.send_rows(|rows| send_end(rows).and_then(|()| rows.flush()))?;
                file.await_end()
            }
            Sink::Csv(mut writer) => Ok(writer.flush()?),
        }
    }
}

/// Writes a whole table.
///
/// # Errors
/// Those of the medium, and of the program that writes Parquet.
pub fn write_table(format: &Format, file: File, table: &Table) -> Result<(), TableError> {
    let mut writer = TableWriter::new(format, file, table)?;
    writer.write(table)?;
    writer.finish()
}

/// The program `masseter-parquet`. It takes rows from standard input, and writes the file to standard output.
#[derive(Debug, Clone)]
pub struct ParquetProgram {
    path: PathBuf,
}

impl ParquetProgram {
    /// The program in the folder of this one.
    ///
    /// # Errors
    /// [`TableError::NoProgram`] where it was not built.
    pub fn beside_this_one() -> Result<Self, TableError> {
        let path = env::current_exe()?.with_file_name(NAME);
        if path.is_file() { Ok(Self::at(path)) } else { Err(TableError::NoProgram { path }) }
    }

    /// The program at this path.
    pub fn at(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into() }
    }

    /// Begins a file with the columns of a table.
    fn begin_file(&self, file: File, table: &Table) -> Result<ParquetFile, TableError> {
        let mut command = Command::new(&self.path);
        command.stdin(Stdio::piped()).stdout(file).stderr(Stdio::piped());
        // Ctrl-C is for the command, which ends this program in order.
        command.process_group(0);
        let mut child =
            command.spawn().map_err(|source| TableError::NotStarted { path: self.path.clone(), source })?;
        let rows = BufWriter::new(child.stdin.take().expect("its standard input is a pipe"));
        let mut stderr = child.stderr.take().expect("its standard error is a pipe");
        let said = thread::spawn(move || {
            let mut said = Vec::new();
            stderr.read_to_end(&mut said).map(|_| said)
        });
        let mut file = ParquetFile { child, rows: Some(rows), said: Some(said) };
        file.send_rows(|rows| send_columns(table, rows))?;
        Ok(file)
    }
}

/// A file that the program writes.
struct ParquetFile {
    child: Child,
    /// None once their end was sent, or the program ended before it.
    rows: Option<BufWriter<ChildStdin>>,
    /// Gathers what it writes to standard error, so that the pipe never fills and blocks it. None once it was waited for.
    said: Option<JoinHandle<io::Result<Vec<u8>>>>,
}

impl ParquetFile {
    fn send_rows(
        &mut self,
        write: impl FnOnce(&mut BufWriter<ChildStdin>) -> io::Result<()>,
    ) -> Result<(), TableError> {
        let Some(rows) = &mut self.rows else { return Err(io::Error::from(ErrorKind::BrokenPipe).into()) };
        match write(rows) {
            // The program has ended, and says why.
            Err(error) if error.kind() == ErrorKind::BrokenPipe => self.await_end().and(Err(error.into())),
            sent => Ok(sent?),
        }
    }

    /// Waits until the program has ended, and with that the file.
    fn await_end(&mut self) -> Result<(), TableError> {
        // A program may read to the end of the pipe before it exits.
        self.rows = None;
        let said = self.said.take().map(|said| said.join().expect("reading does not panic")).transpose()?;
        let said = String::from_utf8_lossy(&said.unwrap_or_default()).trim().to_owned();
        let status = self.child.wait()?;
        match status.code() {
            Some(0) => Ok(()),
            Some(DISK_FULL) => Err(io::Error::new(ErrorKind::StorageFull, said).into()),
            _ => Err(TableError::Program { status, said }),
        }
    }
}

/// Without its end the file stays unfinished.
impl Drop for ParquetFile {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
