//! The recording as a table of finite numbers over increasing time.
//!
//! Blank lines are ignored. The module reads the columns' names; their meaning is not part of it.

use std::path::Path;

use masseter_scenario::TimeUnit;
use masseter_scenario::input::excerpt;
use masseter_scenario::rows::{Line, fields, lines, numbers};
use masseter_scenario::wording::counted;

use super::TrajectoryError;

/// Least rows of a motion.
const FEWEST_ROWS: usize = 4;
/// Least time between samples, s. Closer samples are repeats: the slope between them is the clock's noise.
const SHORTEST_STEP_S: f64 = 1e-6;
/// The longest time without a sample that interpolation may bridge, s.
const LARGEST_GAP_S: f64 = 0.25;
/// Largest distance of a marker from the origin of any tracker, mm.
pub(super) const LARGEST_MM: f64 = 1e5;

const POSES: [&str; 8] = ["time_s", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"];
const MARKERS: [&str; 10] = [
    "time_s", "m1_x_mm", "m1_y_mm", "m1_z_mm", "m2_x_mm", "m2_y_mm", "m2_z_mm", "m3_x_mm", "m3_y_mm",
    "m3_z_mm",
];

/// A problem of a recording, before its path is known.
#[derive(Debug)]
pub(super) struct Located {
    /// The line, from 1; `None` if the file as a whole is at fault.
    pub line: Option<u64>,
    /// The error and its remedy, for the author of the file.
    pub problem: String,
}

impl Located {
    pub(super) fn at(line: u64, problem: String) -> Self {
        Self { line: Some(line), problem }
    }

    pub(super) fn whole(problem: String) -> Self {
        Self { line: None, problem }
    }

    pub(super) fn in_file(self, path: &Path) -> TrajectoryError {
        let line = self.line.map_or_else(String::new, |line| format!(":{line}"));
        TrajectoryError(format!("{}{line}: {}", path.display(), self.problem))
    }
}

/// The content by the header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    Poses,
    Markers,
}

/// A row: time and the other columns, as written.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Row {
    pub line: u64,
    pub time_s: f64,
    pub values: Vec<f64>,
}

/// A file's content.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Table {
    pub format: Format,
    pub rows: Vec<Row>,
}

impl Format {
    pub(super) fn columns(self) -> &'static [&'static str] {
        match self {
            Self::Poses => &POSES,
            Self::Markers => &MARKERS,
        }
    }

    fn of_header(header: &str) -> Result<Self, String> {
        let found: Vec<&str> = fields(header).collect();
        let is_of_markers = found.iter().any(|name| name.starts_with("m1"));
        let format = if is_of_markers { Self::Markers } else { Self::Poses };
        let columns = format.columns();
        let differs = |&position: &usize| found.get(position) != columns.get(position);
        let Some(position) = (0..found.len().max(columns.len())).find(differs) else { return Ok(format) };
        let [found, expected] =
            [&found, columns].map(|names| names.get(position).copied().unwrap_or_default());
        let (position, header) = (position + 1, columns.join(","));
        let found = excerpt(found);
        Err(format!("column {position} is '{found}', expected '{expected}'; the header must be '{header}'"))
    }
}

impl Table {
    pub(super) fn parse(text: &str, time_unit: TimeUnit) -> Result<Self, Located> {
        let mut content = lines(text.as_bytes()).filter(|line| line.text.as_deref() != Ok(""));
        let too_few = |rows| {
            let rows = counted(rows as u64, "row");
            Located::whole(format!("{rows} of data, at least {FEWEST_ROWS} are needed"))
        };
        let Line { number, text } = content.next().ok_or_else(|| too_few(0))?;
        let format = text.and_then(|header| Format::of_header(&header));
        let format = format.map_err(|problem| Located::at(number, problem))?;
        let mut rows: Vec<Row> = Vec::new();
        for Line { number, text } in content {
            let row = text.and_then(|text| parse_row(number, &text, format.columns(), time_unit, &rows));
            rows.push(row.map_err(|problem| Located::at(number, problem))?);
        }
        if rows.len() < FEWEST_ROWS {
            return Err(too_few(rows.len()));
        }
        Ok(Self { format, rows })
    }
}

fn parse_row(
    line: u64,
    text: &str,
    columns: &[&str],
    time_unit: TimeUnit,
    before: &[Row],
) -> Result<Row, String> {
    let mut values = numbers(text, columns)?;
    let is_too_far = |(value, column): &(&f64, &&str)| column.ends_with("_mm") && value.abs() > LARGEST_MM;
    if let Some((value, column)) = values.iter().zip(columns).find(is_too_far) {
        return Err(format!("{column} is {value:e}, beyond ±{LARGEST_MM} mm; is the unit millimetres?"));
    }
    let time_s = time_unit.seconds(values.remove(0));
    before.last().map_or(Ok(()), |previous| check_time(time_s, previous.time_s, before.len() == 1))?;
    Ok(Row { line, time_s, values })
}

fn check_time(time_s: f64, previous_s: f64, is_first_step: bool) -> Result<(), String> {
    let gap_s = time_s - previous_s;
    if gap_s < SHORTEST_STEP_S {
        return Err(format!(
            "time {time_s} s does not come after {previous_s} s of the row before by 1 µs or more; sort the rows, \
             drop repeats"
        ));
    }
    if gap_s > LARGEST_GAP_S && is_first_step {
        return Err(format!(
            "the time between the first rows is {gap_s:.3} s, at most {LARGEST_GAP_S} s can be bridged; is the time in \
             ms? set motion.time_unit = \"ms\""
        ));
    }
    if gap_s > LARGEST_GAP_S {
        return Err(format!(
            "{gap_s:.3} s without a sample, at most {LARGEST_GAP_S} s can be bridged; cut the recording here"
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n";
    const ROWS: &str = "0.00,0,0,0,1,0,0,0\n0.01,0,0,-1,1,0,0,0\n0.02,0,0,-2,1,0,0,0\n0.03,0,0,-3,1,0,0,0\n";

    #[test]
    fn lines_are_counted_past_comments_blank_lines_and_a_byte_order_mark() {
        let text = format!("\u{feff}# a comment\r\n\r\n{HEADER}# another\n{ROWS}");
        let table = Table::parse(&text, TimeUnit::S).ok().unwrap();
        assert_eq!(table.format, Format::Poses);
        assert_eq!(table.rows.iter().map(|row| row.line).collect::<Vec<_>>(), [5, 6, 7, 8]);
        assert_eq!(table.rows[2].values[2].to_bits(), (-2.0f64).to_bits());
    }

    #[test]
    fn names_and_numbers_may_stand_in_quotes() {
        let quoted = |line: &str| format!("\"{}\"\n", line.replace(',', "\",\""));
        let text: String = (HEADER.to_owned() + ROWS).lines().map(quoted).collect();
        assert_eq!(
            Table::parse(&text, TimeUnit::S).ok(),
            Table::parse(&(HEADER.to_owned() + ROWS), TimeUnit::S).ok()
        );
        assert!(Table::parse(&text, TimeUnit::S).is_ok());
    }

    #[test]
    fn bad_files_are_refused_with_line_and_reason() {
        let with = |row: &str| format!("{HEADER}{ROWS}{row}\n");
        let table = [
            (String::new(), None, "0 rows"),
            (HEADER.to_owned(), None, "0 rows"),
            (ROWS.to_owned(), Some(1), "column 1 is '0.00', expected 'time_s'"),
            ("time_s,x_mm,ymm,z_mm,qw,qx,qy,qz".to_owned(), Some(1), "column 3 is 'ymm', expected 'y_mm'"),
            ("time_s,m1_x_mm,m1_y_mm".to_owned(), Some(1), "column 4 is '', expected 'm1_z_mm'"),
            ("time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz,more".to_owned(), Some(1), "column 9 is 'more'"),
            (with("0.04,0,0,0,1,0,0"), Some(6), "7 fields"),
            (with("0.04,0,zero,0,1,0,0,0"), Some(6), "y_mm is 'zero'"),
            (with("0.04,0,0,NaN,1,0,0,0"), Some(6), "z_mm is 'NaN'"),
            (with("inf,0,0,0,1,0,0,0"), Some(6), "time_s is 'inf'"),
            (with(&"0".repeat(5000)), Some(6), "longer than 4096 bytes"),
            (with("0.03,0,0,0,1,0,0,0"), Some(6), "does not come after"),
            (with("0.02,0,0,0,1,0,0,0"), Some(6), "does not come after"),
            (with("0.0300001,0,0,0,1,0,0,0"), Some(6), "does not come after"),
            (with("9.03,0,0,0,1,0,0,0"), Some(6), "without a sample"),
            (with("0.04,0,0,-4e262,1,0,0,0"), Some(6), "z_mm is -4e262, beyond"),
        ];
        for (text, line, reason) in table {
            let error = Table::parse(&text, TimeUnit::S).err().unwrap();
            assert_eq!(error.line, line, "{text}");
            assert!(error.problem.contains(reason), "{}", error.problem);
        }
    }
}
