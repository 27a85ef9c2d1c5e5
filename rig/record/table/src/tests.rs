//! Tables are read back as they were written.

use std::fs::{self, File, Permissions};
use std::io::ErrorKind;
use std::os::unix::fs::PermissionsExt;

use super::rows::{send_columns, send_end, send_part};
use super::*;

fn table() -> Table {
    Table::new(vec![
        Column::new("case", "", "number", Values::Whole(vec![Some(0), Some(1)])),
        Column::new("margin", "mm", "distance from the limit", Values::Numbers(vec![None, Some(0.5)])),
        Column::new("verdict", "", "word", Values::Words(vec![Some("PASS, or not".to_owned()), None])),
        Column::new("passed", "", "truth", Values::Truths(vec![Some(true), Some(false)])),
    ])
}

fn as_csv(table: &Table) -> String {
    let file = tempfile::NamedTempFile::new().unwrap();
    write_table(&Format::Csv, file.reopen().unwrap(), table).unwrap();
    fs::read_to_string(file).unwrap()
}

#[test]
fn values_as_text_keep_their_digits_and_missing_ones_are_empty() {
    assert_eq!(as_csv(&table()), "case,margin,verdict,passed\n0,,\"PASS, or not\",true\n1,0.5,,false\n");
}

#[test]
fn the_codebook_describes_every_column() {
    let table = table();
    let codebook = Table::codebook([("cases", &table)]);
    let text = as_csv(&codebook);
    assert!(text.starts_with("table,column,unit,type,meaning\ncases,case,,whole number,number\n"), "{text}");
    assert!(text.contains("\ncases,margin,mm,number,distance from the limit\n"), "{text}");
    assert_eq!(codebook.rows(), 4);
}

#[test]
fn rows_arrive_bit_by_bit_with_their_columns() {
    let numbers = [f64::NAN, -f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.0, 5e-324, 0.1 + 0.2];
    let texts = ["", "two\nlines", "µ\u{0}\"", "1", "2", "3", "4"];
    let table = Table::new(vec![
        Column::new("number", "", "", Values::Numbers(numbers.map(Some).to_vec())),
        Column::new(
            "text",
            "",
            "a \"name\"\nof two lines",
            Values::Words(texts.map(|text| Some(text.to_owned())).to_vec()),
        ),
        Column::new("whole", "", "", Values::Whole([i64::MIN, i64::MAX, 0, -1, 1, 2, 3].map(Some).to_vec())),
        Column::new("none", "N", "", Values::Words(vec![None; 7])),
    ]);
    let mut sent = Vec::new();
    send_columns(&table, &mut sent).unwrap();
    send_part(&table, &mut sent).unwrap();
    send_part(&table, &mut sent).unwrap();
    send_end(&mut sent).unwrap();
    let mut rows = Rows::new(sent.as_slice()).unwrap();
    assert_eq!(
        rows.columns().iter().map(|column| &*column.name).collect::<Vec<_>>(),
        ["number", "text", "whole", "none"]
    );
    for _ in 0..2 {
        let part = rows.next_part().unwrap().unwrap();
        let Values::Numbers(received) = &part.columns()[0].values else { panic!("{part:?}") };
        assert!(received.iter().map(|number| number.unwrap().to_bits()).eq(numbers.map(f64::to_bits)));
        assert_eq!(part.columns()[1..], table.columns()[1..]);
    }
    assert!(rows.next_part().unwrap().is_none());
}

#[test]
fn a_text_that_is_cut_short_is_an_error() {
    let words = Values::Words(vec![Some("passed".to_owned())]);
    let table = Table::new(vec![Column::new("verdict", "", "verdict", words)]);
    let mut sent = Vec::new();
    send_columns(&table, &mut sent).unwrap();
    send_part(&table, &mut sent).unwrap();
    let mut rows = Rows::new(&sent[..sent.len() - 1]).unwrap();
    assert_eq!(rows.next_part().unwrap_err().kind(), ErrorKind::UnexpectedEof);
}

#[test]
fn rows_without_their_end_are_an_error() {
    let mut sent = Vec::new();
    send_columns(&table(), &mut sent).unwrap();
    let columns = sent.len();
    send_part(&table(), &mut sent).unwrap();
    for length in columns..=sent.len() {
        let mut rows = Rows::new(&sent[..length]).unwrap();
        let end = if length < sent.len() {
            rows.next_part()
        } else {
            rows.next_part().unwrap();
            rows.next_part()
        };
        assert_eq!(end.unwrap_err().kind(), ErrorKind::UnexpectedEof, "{length}");
    }
    assert_eq!(Rows::new(&b"case,margin,verdict,passed\n0,"[..]).unwrap_err().kind(), ErrorKind::InvalidData);
}

#[test]
fn a_missing_program_is_named_with_what_builds_it() {
    let missing = ParquetProgram::beside_this_one().unwrap_err().to_string();
    assert!(missing.contains("masseter-parquet, which does not exist"), "{missing}");
    assert!(missing.contains("`cargo build --release`"), "{missing}");
}

#[test]
fn a_program_that_says_much_before_it_takes_rows_blocks_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("program");
    let table = Table::new(vec![Column::new("case", "", "", Values::Whole(vec![Some(1); 100_000]))]);
    // One program ends amid the rows, the other after the end of the pipe.
    for takes_rows in ["head -c 100000", "cat"] {
        let script = format!("#!/bin/sh\nhead -c 200000 /dev/zero >&2\n{takes_rows} > /dev/null\nexit 3\n");
        fs::write(&path, script).unwrap();
        fs::set_permissions(&path, Permissions::from_mode(0o700)).unwrap();
        let format = Format::Parquet(ParquetProgram::at(&path));
        let written = write_table(&format, tempfile::tempfile().unwrap(), &table);
        let Err(TableError::Program { status, said }) = written else { panic!("{written:?}") };
        assert_eq!((status.code(), said.len()), (Some(3), 200_000), "{takes_rows}");
    }
}

#[test]
fn a_full_disk_is_an_error_of_that_kind_in_csv_too() {
    for rows in [1, 100_000] {
        let table = Table::new(vec![Column::new("case", "", "", Values::Whole(vec![Some(1); rows]))]);
        let full = File::options().write(true).open("/dev/full").unwrap();
        let written = write_table(&Format::Csv, full, &table);
        let Err(TableError::File(error)) = written else { panic!("{written:?}") };
        assert_eq!(error.kind(), ErrorKind::StorageFull);
    }
}
