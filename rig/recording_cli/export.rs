//! Writes a recording as CSV, one file per topic, and its CAN frames as candump logs.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek};
use std::iter;
use std::path::Path;

use anyhow::Context;
use masseter_recording::{CDR_LITTLE_ENDIAN, Columns, Entry, Reader, Recorded};
use masseter_report::CandumpLogs;
use masseter_shared::messages::tap;

/// A CSV file that is being written.
struct CsvFile {
    name: String,
    columns: Columns,
    table: csv::Writer<File>,
    rows: u64,
}

/// Writes topics, by channel id, into `folder`. Returns the names of the files with their numbers of rows.
pub(super) fn write<R: Read + Seek>(
    reader: &mut Reader<R>,
    folder: &Path,
    tables: BTreeMap<u16, (String, Columns)>,
) -> anyhow::Result<Vec<(String, u64)>> {
    let mut files = BTreeMap::new();
    for (channel, (topic, columns)) in tables {
        files.insert(channel, CsvFile::create(folder, &topic, columns)?);
    }
    let mut candump = CandumpLogs::new(folder, &[]);
    while let Some(entry) = reader.next_entry()? {
        let Some(csv) = files.get_mut(&entry.header.channel_id) else { continue };
        csv.write(&entry)?;
        if let Some(Ok(Recorded::Frame(frame))) = entry.recorded() {
            candump.write(tap::bus_of(&frame)?, &tap::decode(&frame)?)?;
        }
    }
    let mut written = Vec::new();
    for csv in files.into_values() {
        written.push(csv.finish()?);
    }
    for (bus, lines) in candump.finish()?.into_iter().enumerate() {
        written.push((format!("can{bus}.log"), lines));
    }
    Ok(written)
}

impl CsvFile {
    fn create(folder: &Path, topic: &str, columns: Columns) -> anyhow::Result<Self> {
        let safe = |c: char| if c.is_ascii_alphanumeric() || c == '_' { c } else { '-' };
        let name = format!("{}.csv", topic.chars().map(safe).collect::<String>());
        let path = folder.join(&name);
        let file = File::create_new(&path).with_context(|| format!("cannot create {}", path.display()))?;
        let mut table = csv::Writer::from_writer(file);
        table.write_record(iter::once("log_time_ns".to_owned()).chain(columns.names()))?;
        Ok(Self { name, columns, table, rows: 0 })
    }

    fn write(&mut self, entry: &Entry) -> anyhow::Result<()> {
        let Some(body) = entry.data.strip_prefix(&CDR_LITTLE_ENDIAN) else { return Ok(()) };
        if let Some(values) = self.columns.values(body) {
            self.table.write_record(iter::once(entry.header.log_time.to_string()).chain(values))?;
            self.rows += 1;
        }
        Ok(())
    }

    fn finish(mut self) -> anyhow::Result<(String, u64)> {
        self.table.flush().with_context(|| format!("cannot write {}", self.name))?;
        Ok((self.name, self.rows))
    }
}
