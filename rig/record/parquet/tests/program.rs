//! What the program writes, another reader gets back.

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::process::{Command, Stdio};

use masseter_table::{
    Cell, Column, Format, ParquetProgram, Table, TableError, TableWriter, Values, write_table,
};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::RowAccessor;

const PROGRAM: &str = env!("CARGO_BIN_EXE_masseter-parquet");

fn parquet() -> Format {
    Format::Parquet(ParquetProgram::at(PROGRAM))
}

fn table() -> Table {
    Table::new(vec![
        Column::new("case", "", "number", Values::Whole(vec![Some(0), Some(1)])),
        Column::new("margin", "mm", "distance from the limit", Values::Numbers(vec![None, Some(f64::NAN)])),
        Column::new("verdict", "", "word", Values::Words(vec![Some(String::new()), None])),
        Column::new("passed", "", "truth", Values::Truths(vec![Some(true), Some(false)])),
    ])
}

fn written(table: &Table) -> SerializedFileReader<File> {
    let file = tempfile::tempfile().unwrap();
    write_table(&parquet(), file.try_clone().unwrap(), table).unwrap();
    SerializedFileReader::new(file).unwrap()
}

/// What the program says to this input, and whether it writes a whole file.
fn said(input: &[u8]) -> (Option<i32>, String, bool) {
    let mut command = Command::new(PROGRAM);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut program = command.spawn().unwrap();
    program.stdin.take().unwrap().write_all(input).unwrap();
    let output = program.wait_with_output().unwrap();
    (
        output.status.code(),
        String::from_utf8(output.stderr).unwrap(),
        output.stdout.get(4..).is_some_and(|rest| rest.ends_with(b"PAR1")),
    )
}

#[test]
fn a_table_is_read_back_with_its_gaps_and_units() {
    let reader = written(&table());
    let metadata = reader.metadata().file_metadata().key_value_metadata().unwrap();
    let units: serde_json::Value = serde_json::from_str(metadata[0].value.as_ref().unwrap()).unwrap();
    assert_eq!((metadata[0].key.as_str(), units["margin"].as_str()), ("units", Some("mm")));
    let rows: Vec<_> = reader.get_row_iter(None).unwrap().map(Result::unwrap).collect();
    assert_eq!(rows[1].get_long(0).unwrap(), 1);
    assert!(rows[0].get_double(1).is_err() && rows[1].get_double(1).unwrap().is_nan());
    assert_eq!(rows[0].get_string(2).unwrap(), "");
    assert!(rows[1].get_string(2).is_err() && rows[0].get_bool(3).unwrap());
}

#[test]
fn a_long_table_is_written_in_parts() {
    let empty = Table::new(vec![
        Column::new("cycle", "", "number", Values::Whole(Vec::new())),
        Column::new("force_n", "N", "force", Values::Numbers(Vec::new())),
    ]);
    let file = tempfile::tempfile().unwrap();
    let mut writer = TableWriter::new(&parquet(), file.try_clone().unwrap(), &empty).unwrap();
    let mut part = empty.clone();
    for cycles in [0..3, 3..5] {
        part.clear();
        cycles.for_each(|cycle| part.push([Cell::Whole(Some(cycle)), Cell::Number(Some(cycle as f64))]));
        writer.write(&part).unwrap();
    }
    writer.finish().unwrap();
    let reader = SerializedFileReader::new(file).unwrap();
    assert_eq!(reader.num_row_groups(), 2);
    let cycles = reader.get_row_iter(None).unwrap().map(|row| row.unwrap().get_long(0).unwrap());
    assert!(cycles.eq(0..5));
}

#[test]
fn a_table_without_rows_has_its_columns() {
    let mut empty = table();
    empty.clear();
    let reader = written(&empty);
    assert_eq!(reader.metadata().file_metadata().schema_descr().num_columns(), 4);
    assert_eq!(reader.get_row_iter(None).unwrap().count(), 0);
}

#[test]
fn a_full_disk_is_an_error_of_that_kind_at_the_end_or_at_once() {
    for parts in [1, 1000] {
        let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
        let mut writer = TableWriter::new(&parquet(), full, &table()).unwrap();
        let written = (0..parts).try_for_each(|_| writer.write(&table())).and_then(|()| writer.finish());
        let Err(TableError::File(error)) = written else { panic!("{written:?}") };
        assert_eq!((error.kind(), error.to_string()), full_disk());
    }
}

/// A table without columns on its way to the program.
const NO_COLUMNS: &[u8] = b"rows of masseter, v. 2\x01\0\0\0\0\0\0\0\0";
/// What ends its rows.
const END: [u8; 8] = [0; 8];

fn full_disk() -> (ErrorKind, String) {
    (ErrorKind::StorageFull, io::Error::from_raw_os_error(28).to_string())
}

#[test]
fn a_program_that_fails_is_quoted() {
    let file = tempfile::tempfile().unwrap();
    let stranger = Format::Parquet(ParquetProgram::at("/bin/false"));
    let failed = write_table(&stranger, file.try_clone().unwrap(), &table()).unwrap_err().to_string();
    assert!(failed.contains("ended with exit status: 1"), "{failed}");
    let missing = Format::Parquet(ParquetProgram::at("/nowhere/masseter-parquet"));
    let failed = write_table(&missing, file, &table()).unwrap_err().to_string();
    assert!(failed.starts_with("cannot start /nowhere/masseter-parquet: No such file"), "{failed}");
}

#[test]
fn a_writer_that_is_dropped_leaves_no_valid_file() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let mut writer = TableWriter::new(&parquet(), file.reopen().unwrap(), &table()).unwrap();
    writer.write(&table()).unwrap();
    drop(writer);
    assert!(SerializedFileReader::new(file.reopen().unwrap()).is_err());
}

#[test]
fn a_sender_that_dies_leaves_no_valid_file() {
    let (code, words, is_whole) = said(NO_COLUMNS);
    assert_eq!((code, is_whole), (Some(2), false));
    assert!(words.starts_with("the rows have no end"), "{words}");
    let (code, words, is_whole) = said(&[NO_COLUMNS, &END].concat());
    assert_eq!((code, is_whole), (Some(0), true), "{words}");
}

#[test]
fn other_input_is_refused_with_what_to_do() {
    for input in ["", "rows", "case,margin,verdict,passed\n0,1,2,3\n"] {
        let (code, words, _) = said(input.as_bytes());
        assert_eq!(code, Some(2));
        assert!(words.contains("no rows of this build of masseter: `cargo build --release`"), "{words}");
    }
    let output = Command::new(PROGRAM).arg("--help").output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8(output.stderr).unwrap().contains("masseter export RUN --format parquet"));
}

#[test]
fn a_limit_on_the_size_of_files_is_a_full_disk() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = Command::new("sh");
    command.args(["-c", "ulimit -f 0 && exec \"$0\" > table.parquet", PROGRAM]).current_dir(folder.path());
    let mut program = command.stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    program.stdin.take().unwrap().write_all(&[NO_COLUMNS, &END].concat()).unwrap();
    let output = program.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(6), "{}", String::from_utf8_lossy(&output.stderr));
}
