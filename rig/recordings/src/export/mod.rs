//! `masseter export`: a recording as tables, one for each topic and one with the named signals of each cycle, with a codebook;
//! and its CAN frames as candump logs.
//!
//! Everything comes from the recording alone: a run folder is not needed. The recording is read twice, first for its gaps and
//! the start of its motion. Rows are written in groups, so that its length does not matter for the memory.

mod cycles;
mod declared;
mod file;
mod selection;
mod topic;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow};
use clap::{Args, ValueEnum};
use masseter_recording::output::new_folder;
use masseter_recording::{Reader, Recorded, Topic};
use masseter_report::CandumpLogs;
use masseter_runtime::messages::tap;
use masseter_table::{Format, ParquetProgram, Table, write_table};
use masseter_terminal::{Exit, result};

use crate::recording::RecordingArgs;
use crate::recording::survey::Survey;
use cycles::{CYCLES, CycleTable};
use file::TableFile;
use selection::Selection;
use topic::TopicTable;

/// The name of the codebook's file.
const CODEBOOK: &str = "codebook.csv";

/// The arguments of `export`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  masseter export runs/latest\n  masseter export recording.mcap --format csv --table cycles --table event --out tables"
)]
pub struct ExportArgs {
    #[command(flatten)]
    from: RecordingArgs,
    /// Format of the tables
    #[arg(long, value_enum, default_value_t)]
    format: FileFormat,
    /// Folder for the files; must not exist [default: beside the recording, with the ending .tables]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Table to write: cycles, or a topic; may be repeated [default: all with rows]
    #[arg(long = "table", value_name = "NAME")]
    tables: Vec<String>,
}

/// The format of the tables.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
enum FileFormat {
    /// Apache Parquet: types, units in the metadata, a fifth of the bytes
    #[default]
    Parquet,
    /// Comma-separated values
    Csv,
}

impl FileFormat {
    /// A missing program is an error before any work is done.
    fn of_tables(self) -> anyhow::Result<Format> {
        match self {
            Self::Parquet => {
                let program = ParquetProgram::beside_this_one();
                let program = program.map_err(|error| anyhow!("{error}; or choose --format csv"))?;
                Ok(Format::Parquet(program))
            }
            Self::Csv => Ok(Format::Csv),
        }
    }
}

/// Writes the tables. Ends with 0 if the recording is complete, 6 if messages or its end are missing, and 2 if it holds bytes
/// that Masseter did not write: what can be read is written all the same.
pub fn export(args: &ExportArgs) -> anyhow::Result<Exit> {
    let format = args.format.of_tables()?;
    let path = args.from.path()?;
    let named = || path.display().to_string();
    let mut reader = Reader::open(&path).with_context(named)?;
    let survey = Survey::read(&mut reader).with_context(named)?;
    let selection = Selection::new(&reader, &survey, &args.tables).with_context(named)?;
    let out = args.out.clone().unwrap_or_else(|| path.with_extension("tables"));
    new_folder(&out)?;
    let export = Export { format, out: &out, motion_ns: survey.motion_ns() };
    let written = export.write(&path, selection).inspect_err(|_| {
        // The first error is the one to report.
        let _ = fs::remove_dir_all(&out);
    })?;
    for (name, rows) in written {
        result(&format!("{rows:>10}  {}\n", out.join(name).display()))?;
    }
    if survey.motion_ns().is_none() {
        result("the recording has no motion: the tables have no time_s\n")?;
    }
    if args.tables.is_empty() && !reader.has_frames() {
        result("the recording leaves out the CAN frames: there is no table 'frame' and no candump log\n")?;
    }
    result(&survey.loss_with_advice()?)?;
    Ok(survey.exit())
}

/// Where the tables go, and what their times count from.
struct Export<'a> {
    format: Format,
    out: &'a Path,
    motion_ns: Option<u64>,
}

impl Export<'_> {
    /// Returns the names of the files with their numbers of rows.
    fn write(&self, recording: &Path, selection: Selection) -> anyhow::Result<Vec<(String, u64)>> {
        let mut topics = BTreeMap::new();
        for (topic, shape) in selection.topics {
            let table = TopicTable::new(topic, shape, self.motion_ns);
            let file = TableFile::create(self.out, topic.name(), &self.format, table.empty())?;
            topics.insert(topic, (table, file));
        }
        let mut cycles = match selection.registry {
            Some(registry) => {
                let table = CycleTable::new(registry, self.motion_ns);
                let file = TableFile::create(self.out, CYCLES, &self.format, table.empty())?;
                Some((table, file))
            }
            None => None,
        };
        let mut candump = topics.contains_key(&Topic::Frame).then(|| CandumpLogs::new(self.out, &[]));
        let mut reader = Reader::open(recording)?;
        while let Some(entry) = reader.next_entry()? {
            // The survey counts what cannot be read.
            let message = entry.recorded().and_then(Result::ok);
            let frames = entry.frames().and_then(Result::ok).unwrap_or_default();
            for message in message.into_iter().chain(frames.into_iter().map(Recorded::Frame)) {
                if let Some((table, file)) = topics.get_mut(&message.topic()) {
                    file.push(table.row(&message))?;
                }
                if let Some((table, file)) = &mut cycles {
                    table.take(&message).map_or(Ok(()), |row| file.push(row))?;
                }
                if let (Some(logs), Recorded::Frame(frame)) = (&mut candump, &message) {
                    logs.write(tap::bus_of(frame)?, &tap::decode(frame)?)?;
                }
            }
        }
        let mut files = Vec::new();
        if let Some((mut table, mut file)) = cycles {
            while let Some(row) = table.finish() {
                file.push(row)?;
            }
            files.push(file);
        }
        files.extend(topics.into_values().map(|(_, file)| file));
        self.finish(files, candump)
    }

    fn finish(
        &self,
        files: Vec<TableFile>,
        candump: Option<CandumpLogs>,
    ) -> anyhow::Result<Vec<(String, u64)>> {
        let (mut written, mut tables) = (Vec::new(), Vec::new());
        for file in files {
            let (name, rows, table) = file.finish()?;
            written.push((format!("{name}.{}", self.format.extension()), rows));
            tables.push((name, table));
        }
        let codebook = Table::codebook(tables.iter().map(|(name, table)| (name.as_str(), table)));
        let path = self.out.join(CODEBOOK);
        let file =
            fs::File::create_new(&path).with_context(|| format!("cannot create {}", path.display()))?;
        write_table(&Format::Csv, file, &codebook).with_context(|| path.display().to_string())?;
        written.push((CODEBOOK.to_owned(), codebook.rows() as u64));
        for (bus, lines) in candump.map(CandumpLogs::finish).transpose()?.into_iter().flatten().enumerate() {
            written.push((format!("can{bus}.log"), lines));
        }
        Ok(written)
    }
}
