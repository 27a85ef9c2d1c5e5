//! Columns of a recording beside the motion, such as an EMG: their names, and their numbers row by row.
//!
//! Rows without a pose count too. What the values mean is not part of this module.

use masseter_scenario::input::{excerpt, sentence};

use super::row::{Located, Row, is_lost};

/// The most columns that are kept.
const MOST: usize = 64;

/// The kept columns of a file.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Extras {
    /// As the file names them, without a sign that separates cells.
    pub names: Vec<String>,
    /// All rows with a time; NaN for a lost sample.
    pub rows: Vec<Row>,
}

/// A row's line, its time, and its cells beside the motion.
pub(super) type Cells<'a> = (u64, f64, Vec<&'a str>);

impl Extras {
    /// The columns whose cells are numbers, with the decimal mark of the motion, and lines of the protocol.
    pub(super) fn of(
        names: &[&str],
        rows: &[Cells],
        decimal: Option<char>,
    ) -> Result<(Self, Vec<String>), Located> {
        let blank = |&(line, time_s, _): &Cells| Row { line, time_s, values: Vec::new() };
        let mut extras = Self { names: Vec::new(), rows: rows.iter().map(blank).collect() };
        let (mut kept, mut unused) = (Vec::new(), Vec::new());
        for (at, name) in names.iter().enumerate() {
            let values = rows.iter().map(|(line, _, cells)| number(cells[at], decimal).ok_or(*line));
            match values.collect::<Result<Vec<f64>, u64>>() {
                Ok(values) if extras.names.len() < MOST => {
                    let lost = values.iter().filter(|value| value.is_nan()).count();
                    extras.names.push(name.replace([',', ';', '"', '\t', '#'], " "));
                    extras.rows.iter_mut().zip(values).for_each(|(row, value)| row.values.push(value));
                    let lost = if lost > 0 { format!(" ({lost} lost)") } else { String::new() };
                    kept.push(format!("{}{lost}", extras.signal_name(extras.names.len() - 1).0));
                }
                Ok(_) => unused.push(format!("'{}' (beyond {MOST} columns)", excerpt(name))),
                Err(line) => unused.push(format!("'{}' (no number in line {line})", excerpt(name))),
            }
        }
        let mut protocol = Vec::new();
        if !kept.is_empty() {
            check_order(rows)?;
            let columns = masseter_scenario::wording::counted(kept.len() as u64, "column");
            protocol.push(format!("signals from {columns}: {}", sentence(&kept.join(", "))));
        }
        if !unused.is_empty() {
            protocol.push(format!("not used: {}", sentence(&unused.join(", "))));
        }
        Ok((extras, protocol))
    }

    /// The signal of a column, and its unit, which stands in brackets. Equal names are numbered.
    pub(super) fn signal_name(&self, at: usize) -> (String, String) {
        let mut taken: Vec<String> = Vec::new();
        for column in &self.names[..at] {
            taken.push(free_name(&words(column).0, &taken));
        }
        let (name, unit) = words(&self.names[at]);
        (format!("recorded.{}", free_name(&name, &taken)), unit)
    }
}

/// The name, with the first number that makes it free.
fn free_name(name: &str, taken: &[String]) -> String {
    let is_free = |name: &String| !taken.contains(name);
    let mut numbered = (2..).map(|number| format!("{name}_{number}"));
    Some(name.to_owned()).filter(is_free).or_else(|| numbered.find(is_free)).unwrap_or_default()
}

fn check_order(rows: &[Cells]) -> Result<(), Located> {
    let back = rows.windows(2).find(|pair| pair[1].1 <= pair[0].1);
    back.map_or(Ok(()), |pair| {
        let [(_, before_s, _), (line, time_s, _)] = [&pair[0], &pair[1]];
        let remedy = "sort the rows, drop repeats";
        let problem = format!("time {time_s} s does not come after {before_s} s of the row before; {remedy}");
        Err(Located::at(*line, problem))
    })
}

/// A name of letters, digits and underscores, and the unit in brackets at the end.
fn words(column: &str) -> (String, String) {
    let bracketed = column.trim().strip_suffix([']', ')']).and_then(|text| text.rsplit_once(['[', '(']));
    let (name, unit) = bracketed.unwrap_or((column, ""));
    let name = name.to_lowercase().replace(['µ', 'μ'], "u");
    let words: Vec<&str> =
        name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty()).collect();
    let name = words.join("_");
    let is_named = name.starts_with(|c: char| c.is_ascii_alphabetic());
    (if is_named { name } else { format!("column_{name}") }, excerpt(unit.trim()))
}

/// NaN for a lost sample; nothing for what is no number.
fn number(cell: &str, decimal: Option<char>) -> Option<f64> {
    if is_lost(cell) {
        return Some(f64::NAN);
    }
    let cell = match decimal {
        Some(',') if cell.contains('.') => return None,
        Some('.') => cell.to_owned(),
        _ => cell.replacen(',', ".", 1),
    };
    cell.parse().ok().filter(|number: &f64| number.is_finite())
}
