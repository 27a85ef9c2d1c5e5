//! Tables are read back as they were written.

use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::RowAccessor;

use super::*;

fn table() -> Table {
    Table::new(vec![
        Column::new("case", "", "number", Values::Whole(vec![Some(0), Some(1)])),
        Column::new("margin", "mm", "distance from the limit", Values::Numbers(vec![None, Some(0.5)])),
        Column::new("verdict", "", "word", Values::Words(vec![Some("PASS, or not".to_owned()), None])),
        Column::new("passed", "", "truth", Values::Truths(vec![Some(true), Some(false)])),
    ])
}

#[test]
fn a_table_is_read_back_with_its_gaps_and_units() {
    let mut file = tempfile::tempfile().unwrap();
    write_table(Format::Parquet, &mut file, &table()).unwrap();
    let reader = SerializedFileReader::new(file).unwrap();
    let metadata = reader.metadata().file_metadata().key_value_metadata().unwrap();
    let units: serde_json::Value = serde_json::from_str(metadata[0].value.as_ref().unwrap()).unwrap();
    assert_eq!((metadata[0].key.as_str(), units["margin"].as_str()), ("units", Some("mm")));
    let rows: Vec<_> = reader.get_row_iter(None).unwrap().map(Result::unwrap).collect();
    assert_eq!((rows[1].get_long(0).unwrap(), rows[1].get_double(1).unwrap()), (1, 0.5));
    assert!(rows[0].get_double(1).is_err() && rows[0].get_bool(3).unwrap());
    assert_eq!(rows[0].get_string(2).unwrap(), "PASS, or not");
}

#[test]
fn a_long_table_is_written_in_parts() {
    let empty = Table::new(vec![
        Column::new("cycle", "", "number", Values::Whole(Vec::new())),
        Column::new("force_n", "N", "force", Values::Numbers(Vec::new())),
    ]);
    let mut file = tempfile::tempfile().unwrap();
    let mut writer = TableWriter::new(Format::Parquet, &mut file, &empty).unwrap();
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
fn values_as_text_keep_their_digits_and_missing_ones_are_empty() {
    let mut file = Vec::new();
    write_table(Format::Csv, &mut file, &table()).unwrap();
    let text = String::from_utf8(file).unwrap();
    assert_eq!(text, "case,margin,verdict,passed\n0,,\"PASS, or not\",true\n1,0.5,,false\n");
}

#[test]
fn the_codebook_describes_every_column() {
    let table = table();
    let mut file = Vec::new();
    let codebook = Table::codebook([("cases", &table)]);
    write_table(Format::Csv, &mut file, &codebook).unwrap();
    let text = String::from_utf8(file).unwrap();
    assert!(text.starts_with("table,column,unit,type,meaning\ncases,case,,whole number,number\n"), "{text}");
    assert!(text.contains("\ncases,margin,mm,number,distance from the limit\n"), "{text}");
    assert_eq!(codebook.rows(), 4);
}
