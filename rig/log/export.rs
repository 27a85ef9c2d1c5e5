//! Recordings as CSV, a file a topic, and CAN frames as candump logs.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Read, Seek, Write};
use std::path::Path;

use anyhow::Context;

use super::columns::Columns;
use crate::analysis::CandumpLogs;
use crate::recording::{CDR_LITTLE_ENDIAN, Entry, Reader, Recorded};

/// A table being written; none for a topic that makes no table.
type Table = Option<Csv>;

struct Csv {
    name: String,
    columns: Columns,
    file: BufWriter<File>,
    lines: u64,
}

/// Writes the topics that are `wanted`, all of them without one, into `folder`. Returns the files with
/// their lines.
pub(super) fn write<R: Read + Seek>(
    reader: &mut Reader<R>,
    folder: &Path,
    wanted: &[String],
) -> anyhow::Result<Vec<(String, u64)>> {
    let mut tables: BTreeMap<u16, Table> = BTreeMap::new();
    let mut candump = CandumpLogs::new(folder, &[]);
    let mut line = String::new();
    while let Some(entry) = reader.next_entry()? {
        let Some(channel) = entry.channel else { continue };
        if !wanted.is_empty() && !wanted.contains(&channel.topic) {
            continue;
        }
        let table = match tables.entry(channel.id) {
            std::collections::btree_map::Entry::Occupied(table) => table.into_mut(),
            std::collections::btree_map::Entry::Vacant(place) => place.insert(Csv::create(folder, &entry)?),
        };
        if let Some(csv) = table {
            csv.write(&mut line, &entry)?;
        }
        if let Some(Ok(Recorded::Frame(frame))) = entry.recorded() {
            candump.write(&frame)?;
        }
    }
    let mut written = Vec::new();
    for csv in tables.into_values().flatten() {
        written.push(csv.finish()?);
    }
    for (bus, logged) in candump.finish()?.into_iter().enumerate() {
        written.push((format!("can{bus}.log"), logged.frames + logged.errors));
    }
    Ok(written)
}

impl Csv {
    /// Begins the table of the entry's topic, if its schema makes one.
    fn create(folder: &Path, entry: &Entry) -> anyhow::Result<Table> {
        let (Some(channel), Some(schema)) = (entry.channel, entry.schema) else { return Ok(None) };
        let definition = str::from_utf8(&schema.data).ok().filter(|_| schema.encoding == "ros2msg");
        let Some(columns) = definition.and_then(Columns::of) else { return Ok(None) };
        let safe = |c: char| if c.is_ascii_alphanumeric() || c == '_' { c } else { '-' };
        let name = format!("{}.csv", channel.topic.chars().map(safe).collect::<String>());
        let path = folder.join(&name);
        let file = File::create_new(&path).with_context(|| format!("cannot create {}", path.display()))?;
        let mut file = BufWriter::new(file);
        writeln!(file, "log_time_ns,{}", columns.header())?;
        Ok(Some(Self { name, columns, file, lines: 0 }))
    }

    fn write(&mut self, line: &mut String, entry: &Entry) -> anyhow::Result<()> {
        let Some(body) = entry.data.strip_prefix(&CDR_LITTLE_ENDIAN) else { return Ok(()) };
        line.clear();
        if self.columns.write(line, body) {
            writeln!(self.file, "{},{line}", entry.header.log_time)?;
            self.lines += 1;
        }
        Ok(())
    }

    fn finish(mut self) -> anyhow::Result<(String, u64)> {
        self.file.flush().with_context(|| format!("cannot write {}", self.name))?;
        Ok((self.name, self.lines))
    }
}
