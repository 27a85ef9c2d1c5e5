//! `masseter export`: a recording as tables with a codebook, and its CAN frames as candump logs. Each topic has a
//! table; one more has the named signals of each cycle, another the cycles of the jaw.
//!
//! Everything comes from the recording alone: a run folder is not needed. The recording is read twice, first for its gaps and
//! the start of its motion. Rows are written in groups, so that its length does not matter for the memory.

use std::path::{Path, PathBuf};
use std::{collections::BTreeMap, fs};

use anyhow::{Context, anyhow, bail};
use masseter_judge::Analysis;
use masseter_recording::{Columns, Description, Field, Reader, Recorded, Topic, new_file, new_folder};
use masseter_report::{CandumpLogs, jaw_cycle_table};
use masseter_runtime::messages::tap;
use masseter_runtime::named::{Declared, Parameter, Signal};
use masseter_scenario::{Scenario, wording::nearest};
use masseter_table::{Cell, Format, ParquetProgram, Table, TableWriter, write_table};
use masseter_terminal::{Exit, result};
use mcap::Channel;

use crate::tables::{CYCLES, CycleTable, TopicTable};
use crate::{survey::Survey, verbs::RecordingArgs};

/// The name of the table of jaw cycles.
const JAW_CYCLES: &str = "jaw_cycles";
/// The name of the codebook's file.
const CODEBOOK: &str = "codebook.csv";

/// The arguments of `export`.
#[derive(Debug, Clone, clap::Args)]
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
    /// Table to write: cycles, jaw_cycles, or a topic; may be repeated [default: all with rows]
    #[arg(long = "table", value_name = "NAME")]
    tables: Vec<String>,
}

/// The format of the tables.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum FileFormat {
    /// Apache Parquet: types, units in the metadata, a fifth of the bytes
    #[default]
    Parquet,
    /// Comma-separated values
    Csv,
}

impl FileFormat {
    /// The format of the table writer. A missing program is an error before any work is done.
    ///
    /// # Errors
    /// When the program that writes Parquet is missing.
    pub fn of_tables(self) -> anyhow::Result<Format> {
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

/// Writes the tables. Ends with 0 if the recording is complete, with 6 if messages or its end are missing, with 2 if it holds bytes
/// that Masseter did not write: what can be read is written all the same.
pub fn export(args: &ExportArgs) -> anyhow::Result<Exit> {
    let format = args.format.of_tables()?;
    let path = args.from.path()?;
    let survey = Survey::of_file(&path)?;
    let selection = Selection::new(&survey, &args.tables);
    let selection = selection.with_context(|| path.display().to_string())?;
    let out = args.out.clone().unwrap_or_else(|| path.with_extension("tables"));
    new_folder(&out)?;
    let export = Export { format, out: &out, motion_ns: survey.motion_ns };
    let written = export.write_tables(&path, selection).inspect_err(|_| {
        // The first error is the one to report.
        let _ = fs::remove_dir_all(&out);
    })?;
    for (name, rows) in written {
        result(&format!("{rows:>10}  {}\n", out.join(name).display()))?;
    }
    if survey.motion_ns.is_none() {
        result("the recording has no motion: the tables have no time_s\n")?;
    }
    if args.tables.is_empty() && !survey.reader.has_frames() {
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
    fn write_tables(&self, recording: &Path, selection: Selection) -> anyhow::Result<Vec<(String, u64)>> {
        let mut topics = BTreeMap::new();
        for (topic, columns) in selection.topics {
            let table = TopicTable::new(topic, columns, self.motion_ns);
            let file = TableFile::create(self.out, topic.name(), &self.format, table.empty())?;
            topics.insert(topic, (table, file));
        }
        let mut cycles = match selection.cycles {
            Some((scenario, declared)) => {
                let table = CycleTable::new(&beside(scenario, recording), &declared, self.motion_ns);
                let file = TableFile::create(self.out, CYCLES, &self.format, table.empty())?;
                Some((table, file))
            }
            None => None,
        };
        let mut jaw = match selection.jaw {
            Some((scenario, declared)) => {
                let file = TableFile::create(self.out, JAW_CYCLES, &self.format, jaw_cycle_table([]))?;
                let scenario = beside(scenario, recording);
                Some((Analysis::new(&scenario, &declared), scenario.study.unwrap_or_default(), file))
            }
            None => None,
        };
        let mut candump = topics.contains_key(&Topic::Frame).then(|| CandumpLogs::new(self.out, &[]));
        let mut reader = Reader::open(recording)?;
        while let Some(entry) = reader.next_entry()? {
            // The survey counts what cannot be read.
            for message in entry.messages().unwrap_or_default() {
                if let Some((table, file)) = topics.get_mut(&message.topic()) {
                    file.push_row(table.row(&message))?;
                }
                if let Some((table, file)) = &mut cycles {
                    table.completed_row(&message).map_or(Ok(()), |row| file.push_row(row))?;
                }
                if let Some((analysis, ..)) = &mut jaw {
                    analysis.take(&message)?;
                }
                if let (Some(logs), Recorded::Frame(frame)) = (&mut candump, &message) {
                    logs.write(tap::bus_of(frame)?, &tap::decode(frame)?)?;
                }
            }
        }
        let mut files = Vec::new();
        if let Some((mut table, mut file)) = cycles {
            while let Some(row) = table.last_row() {
                file.push_row(row)?;
            }
            files.push(file);
        }
        if let Some((analysis, study, mut file)) = jaw {
            let cycles = analysis.finish(false, &[]).jaw_cycles.cycles;
            file.group = jaw_cycle_table([([study.patient.as_str(), &study.session], &cycles[..])]);
            files.push(file);
        }
        files.extend(topics.into_values().map(|(_, file)| file));
        self.end_files(files, candump)
    }

    /// Ends the files and writes their codebook.
    fn end_files(
        &self,
        files: Vec<TableFile>,
        candump: Option<CandumpLogs>,
    ) -> anyhow::Result<Vec<(String, u64)>> {
        let (mut written, mut tables) = (Vec::new(), Vec::new());
        for file in files {
            let (name, rows, table) = file.end_file()?;
            written.push((format!("{name}.{}", self.format.extension()), rows));
            tables.push((name, table));
        }
        let codebook = Table::codebook(tables.iter().map(|(name, table)| (name.as_str(), table)));
        let path = self.out.join(CODEBOOK);
        write_table(&Format::Csv, new_file(&path)?, &codebook).with_context(|| path.display().to_string())?;
        written.push((CODEBOOK.to_owned(), codebook.rows() as u64));
        for (bus, lines) in candump.map(CandumpLogs::finish).transpose()?.into_iter().flatten().enumerate() {
            written.push((format!("can{bus}.log"), lines));
        }
        Ok(written)
    }
}

/// Rows of a group: some 30 MB of the widest table.
const GROUP_ROWS: usize = 1 << 14;

/// A file with the rows that are not in it yet.
struct TableFile {
    name: String,
    path: PathBuf,
    writer: TableWriter,
    group: Table,
    rows: u64,
}

impl TableFile {
    /// Creates a file in `folder` for rows of an empty table.
    fn create(folder: &Path, name: &str, format: &Format, empty: Table) -> anyhow::Result<Self> {
        let path = folder.join(format!("{name}.{}", format.extension()));
        let writer = TableWriter::new(format, new_file(&path)?, &empty);
        let writer = writer.with_context(|| path.display().to_string())?;
        Ok(Self { name: name.to_owned(), path, writer, group: empty, rows: 0 })
    }

    fn push_row(&mut self, row: impl IntoIterator<Item = Cell>) -> anyhow::Result<()> {
        self.group.push(row);
        if self.group.rows() < GROUP_ROWS { Ok(()) } else { self.write_group() }
    }

    fn write_group(&mut self) -> anyhow::Result<()> {
        self.rows += self.group.rows() as u64;
        self.writer.write(&self.group).with_context(|| self.path.display().to_string())?;
        self.group.clear();
        Ok(())
    }

    /// Ends the file. Returns its name, its number of rows, and its columns.
    fn end_file(mut self) -> anyhow::Result<(String, u64, Table)> {
        if self.group.rows() > 0 {
            self.write_group()?;
        }
        self.writer.finish().with_context(|| self.path.display().to_string())?;
        Ok((self.name, self.rows, self.group))
    }
}

/// The name of the attached scenario.
const SCENARIO: &str = "scenario.toml";

/// The selected tables.
struct Selection {
    topics: BTreeMap<Topic, Columns>,
    /// What the signals of the table of cycles come from; `None` if it is not selected.
    cycles: Option<(Scenario, Declared)>,
    /// The run of the table of jaw cycles; none where it is not selected.
    jaw: Option<(Scenario, Declared)>,
}

impl Selection {
    /// The `requested` tables; without any, all that have rows.
    fn new(survey: &Survey, requested: &[String]) -> anyhow::Result<Self> {
        let reader = &survey.reader;
        let has_rows: Vec<_> = survey.topics().collect();
        let mut topics = Columns::of_topics(reader.channels());
        topics.retain(|topic, _| has_rows.contains(&topic.name()));
        let has_scenario = reader.attachments().iter().any(|file| file.name == SCENARIO);
        let known: Vec<_> = has_scenario
            .then_some([CYCLES, JAW_CYCLES])
            .into_iter()
            .flatten()
            .chain(topics.keys().map(|topic| topic.name()))
            .collect();
        if let Some(unknown) = requested.iter().find(|name| !known.contains(&name.as_str())) {
            if unknown == Topic::Frame.name() && !reader.has_frames() {
                bail!("the recording gives no table 'frame': it leaves out the CAN frames");
            }
            let likely = nearest(unknown, known.iter().copied());
            let likely = likely.map_or_else(String::new, |name| format!("; did you mean '{name}'?"));
            bail!("the recording gives no table '{unknown}'; it gives {}{likely}", known.join(", "));
        }
        let is_selected =
            |name: &str| requested.is_empty() || requested.iter().any(|requested| requested == name);
        topics.retain(|topic, _| is_selected(topic.name()));
        let run_for = |name| (has_scenario && is_selected(name)).then(|| run_of(reader)).transpose();
        Ok(Self { topics, cycles: run_for(CYCLES)?, jaw: run_for(JAW_CYCLES)? })
    }
}

/// The scenario with the files that a run's folder holds beside its recording.
fn beside(mut scenario: Scenario, recording: &Path) -> Scenario {
    for (name, file) in scenario.files_mut() {
        let copy = recording.with_file_name(name);
        if copy.exists() {
            *file = copy;
        }
    }
    scenario
}

/// The run's scenario and what its controller declared, by the recording.
fn run_of(reader: &Reader) -> anyhow::Result<(Scenario, Declared)> {
    let attached = reader.attachments().iter().find(|file| file.name == SCENARIO);
    let text = attached.and_then(|file| str::from_utf8(&file.data).ok());
    let text = text.context("the attached scenario is no text")?;
    let scenario = Scenario::parse(Path::new(SCENARIO), text)?;
    scenario.validate().context("the attached scenario")?;
    Ok((scenario, declared(reader.channels())))
}

/// What the controller of the recorded run declared. The values of the parameters at the start, and their ranges, are not
/// known.
fn declared<'a>(channels: impl Iterator<Item = &'a Channel<'static>>) -> Declared {
    let mut declared = Declared::default();
    for channel in channels {
        match Topic::named(&channel.topic) {
            Some(Topic::Signals) => declared.signals.extend(named_values(channel)),
            Some(Topic::Parameters) => {
                let parameter = |Signal { name, unit, about }| Parameter {
                    unit,
                    about,
                    ..Parameter::new(&name, f64::NAN)
                };
                declared.parameters.extend(named_values(channel).into_iter().map(parameter));
            }
            _ => {}
        }
    }
    declared
}

/// The named values of a message: its numbers with fractions, which no other field of it has.
fn named_values(channel: &Channel) -> Vec<Signal> {
    let definition = channel.schema.as_ref().and_then(|schema| str::from_utf8(&schema.data).ok());
    let columns = definition.and_then(Columns::from_definition);
    let fields = columns.iter().flat_map(Columns::fields).filter(|field| !field.is_integer());
    let signal = |field: &Field| {
        let Description { unit, meaning, .. } = field.description.clone();
        Signal { name: field.name().to_owned(), unit, about: meaning }
    };
    fields.map(signal).collect()
}
