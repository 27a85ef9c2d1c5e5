//! Single rows: which are read, which are gaps, which are refused.

use super::*;

const HEADER: &str = "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n";
const ROWS: &str = "0.00,0,0,0,1,0,0,0\n0.01,0,0,-1,1,0,0,0\n0.02,0,0,-2,1,0,0,0\n0.03,0,0,-3,1,0,0,0\n";

fn parse(text: &str) -> Result<Table, Located> {
    Table::parse(text, &FileConfig::new("motion.csv"))
}

#[test]
fn lines_are_counted_past_comments_blank_lines_and_a_byte_order_mark() {
    let text = format!("\u{feff}# a comment\r\n\r\n{HEADER}# another\n{ROWS}");
    let table = parse(&text).ok().unwrap();
    assert_eq!(table.format, Format::Poses);
    assert_eq!(table.rows.iter().map(|row| row.line).collect::<Vec<_>>(), [5, 6, 7, 8]);
    assert_eq!(table.rows[2].values[2].to_bits(), (-2.0f64).to_bits());
}

#[test]
fn names_and_numbers_may_stand_in_quotes() {
    let quoted = |line: &str| format!("\"{}\"\n", line.replace(',', "\",\""));
    let text: String = (HEADER.to_owned() + ROWS).lines().map(quoted).collect();
    assert_eq!(parse(&text).ok(), parse(&(HEADER.to_owned() + ROWS)).ok());
    assert!(parse(&text).is_ok());
}

#[test]
fn bad_files_are_refused_with_line_and_reason() {
    let with = |row: &str| format!("{HEADER}{ROWS}{row}\n");
    let table = [
        (String::new(), None, "0 rows"),
        (HEADER.to_owned(), None, "0 rows"),
        (ROWS.to_owned(), Some(1), "no line names the columns of a motion"),
        ("time_s,x_mm,ymm,z_mm,qw,qx,qy,qz".to_owned(), Some(1), "no columns of a place (x,y,z)"),
        ("time_s,m1_x_mm,m1_y_mm".to_owned(), Some(1), "or time_s,m1_x_mm,m1_y_mm,m1_z_mm"),
        (with("0.04,0,0,0,1,0,0"), Some(6), "7 cells, expected 8"),
        (with("0.04,0,zero,0,1,0,0,0"), Some(6), "column 3 'y_mm' is 'zero'"),
        (with("inf,0,0,0,1,0,0,0"), Some(6), "column 1 'time_s' is 'inf'"),
        (with(&"0".repeat(5000)), Some(6), "1 cell, expected 8"),
        (with("0.03,0,0,0,1,0,0,0"), Some(6), "does not come after"),
        (with("0.02,0,0,0,1,0,0,0"), Some(6), "does not come after"),
        (with("0.0300001,0,0,0,1,0,0,0"), Some(6), "does not come after"),
        (with("9.03,0,0,0,1,0,0,0"), Some(6), "without a sample"),
        (with("0.04,0,0,-4e262,1,0,0,0"), Some(6), "z_mm is -4e262, beyond"),
    ];
    for (text, line, reason) in table {
        let error = parse(&text).err().unwrap();
        assert_eq!(error.line, line, "{text}");
        assert!(error.problem.contains(reason), "{}", error.problem);
    }
}

#[test]
fn a_row_without_a_whole_pose_is_a_gap_in_whatever_way_the_tracker_writes_it() {
    for lost in ["", "-", "NaN", "nan", "N/A", "-3.697314E28", "\"\""] {
        let table = parse(&format!("{HEADER}{ROWS}0.04,0,0,{lost},1,0,0,0\n0.05,0,0,-3,1,0,0,0\n")).unwrap();
        assert_eq!(table.rows.iter().map(|row| row.line).collect::<Vec<_>>(), [2, 3, 4, 5, 7], "{lost}");
        assert!(
            table.protocol.iter().any(|line| line == "gaps for lost samples: 1 row, lines 6 to 6"),
            "{:?}",
            table.protocol
        );
    }
}

/// The closed jaw is asked about, though a key and no header names the columns.
#[test]
fn a_marker_lost_in_the_first_row_is_no_line_before_the_rows() {
    let row = |row: u32| {
        let x = if row == 0 { String::new() } else { format!("{row}") };
        format!("{},{x},0,0,{},0,0,{row},40,0\n", f64::from(row) / 100.0, row + 40)
    };
    let columns = ["time_s".to_owned()].into_iter().chain((0..9).map(marker_column)).collect();
    let config = FileConfig { columns: Some(columns), ..FileConfig::new("motion.csv") };
    let table = Table::parse(&(0..6).map(row).collect::<String>(), &config).ok().unwrap();
    assert_eq!(table.rows[0].line, 2);
    assert!(table.doubts[0].starts_with("line 2: the closed jaw is this row"), "{:?}", table.doubts);
}
