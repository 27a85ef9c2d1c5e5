//! The program that writes Parquet files. It is one of its own, since the crates that it needs would lengthen every first build.

use std::env;
use std::fs::File;
use std::io::{self, BufWriter, ErrorKind, Read, Write};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};

use crate::error::TableError;
use crate::rows::{send_columns, send_end, send_part};
use crate::table::Table;

const NAME: &str = "masseter-parquet";
/// Its exit code when the disk is full, as that of every command.
const DISK_FULL: i32 = 6;

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
    pub(crate) fn begin(&self, file: File, table: &Table) -> Result<ParquetFile, TableError> {
        let mut command = Command::new(&self.path);
        command.stdin(Stdio::piped()).stdout(file).stderr(Stdio::piped());
        // Ctrl-C is for the command, which ends this program in order.
        command.process_group(0);
        let mut child =
            command.spawn().map_err(|source| TableError::NotStarted { path: self.path.clone(), source })?;
        let rows = BufWriter::new(child.stdin.take().expect("its standard input is a pipe"));
        let mut file = ParquetFile { child, rows };
        file.send(|rows| send_columns(table, rows))?;
        Ok(file)
    }
}

/// A file that the program writes.
pub(crate) struct ParquetFile {
    child: Child,
    rows: BufWriter<ChildStdin>,
}

impl ParquetFile {
    pub(crate) fn write(&mut self, table: &Table) -> Result<(), TableError> {
        self.send(|rows| send_part(table, rows))
    }

    /// Waits until the file is whole.
    pub(crate) fn finish(mut self) -> Result<(), TableError> {
        self.send(|rows| send_end(rows).and_then(|()| rows.flush()))?;
        self.wait()
    }

    fn send(
        &mut self,
        write: impl FnOnce(&mut BufWriter<ChildStdin>) -> io::Result<()>,
    ) -> Result<(), TableError> {
        match write(&mut self.rows) {
            // The program has ended, and says why.
            Err(error) if error.kind() == ErrorKind::BrokenPipe => self.wait().and(Err(error.into())),
            sent => Ok(sent?),
        }
    }

    fn wait(&mut self) -> Result<(), TableError> {
        let mut said = Vec::new();
        if let Some(stderr) = &mut self.child.stderr {
            stderr.read_to_end(&mut said)?;
        }
        let said = String::from_utf8_lossy(&said).trim().to_owned();
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
