//! The recording in its plain form: numbers in s, mm and quaternions over increasing time.
//!
//! A row without a whole pose is a gap. The frame of the jaw is not part of this module.

use std::{fmt::Write, path::Path};

use masseter_scenario::{FileConfig, input::excerpt, wording::counted};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::layout::{Clock, Content, Layout, Scaled, Turn};
use super::markers::{Body, settle};
use super::row::{Located, Row, gaps, is_lost};
use super::{doubts::upper_median, extras::Extras, sheet::Sheet};

/// Least rows of a motion.
const FEWEST_ROWS: usize = 4;
/// Least time between samples, s. Closer samples are repeats: the slope between them is the clock's noise.
const SHORTEST_STEP_S: f64 = 1e-6;
/// The longest time without a sample that interpolation may bridge, s.
pub(super) const LARGEST_GAP_S: f64 = 0.25;
const DAY_S: f64 = 86_400.0;
/// Largest distance of a marker from the origin of any tracker, mm.
pub(super) const LARGEST_MM: f64 = 1e5;
/// Largest element by which a matrix by its transpose differs from the identity by rounding.
const MATRIX_TOLERANCE: f64 = 5e-3;
/// Columns of the plain form, after the time.
const POSES: [&str; 7] = ["x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"];

/// The same of a file of markers.
fn marker_column(at: usize) -> String {
    format!("m{}_{}_mm", at / 3 + 1, ["x", "y", "z"][at % 3])
}

/// The content of a file.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Format {
    Poses,
    Markers(Body),
}

/// A file's content.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Table {
    pub format: Format,
    pub rows: Vec<Row>,
    /// Columns beside the motion.
    pub extras: Extras,
    /// What was read, converted and left out, a line each.
    pub protocol: Vec<String>,
    /// What the user must know before a run, each with its line.
    pub doubts: Vec<String>,
}

impl Table {
    pub(super) fn parse(text: &str, config: &FileConfig) -> Result<Self, Located> {
        let sheet = Sheet::of(text, config.columns.as_deref())?;
        let is_filled = |row: &Result<(_, Vec<&str>), _>| !matches!(row, Ok((_, cells)) if cells.is_empty());
        let first = sheet.rows().find(is_filled).transpose()?.map_or_else(Vec::new, |(_, cells)| cells);
        let is_clock = |at: usize| first.get(at).is_some_and(|cell: &&str| cell.contains(':'));
        let layout = Layout::of(&sheet.columns, config, &sheet.assumed, is_clock);
        let layout = layout.map_err(|problem| Located { line: sheet.header_line, problem })?;
        let mut protocol = [sheet.protocol.clone(), layout.protocol.clone()].concat();
        let mut reader = Reader { layout: &layout, sheet: &sheet, decimal: None, last_s: None };
        let (mut rows, mut lost, mut empty) = (Vec::new(), Vec::new(), Vec::new());
        let mut beside = Vec::new();
        for (index, row) in sheet.rows().enumerate() {
            let (line, cells) = row?;
            // Programs leave empty rows at the end of a table; between others an empty row is a lost sample.
            if cells.is_empty() {
                empty.push(line);
                continue;
            }
            lost.append(&mut empty);
            let (time_s, values) =
                reader.row(index, line, &cells).map_err(|problem| Located::at(line, problem))?;
            if !layout.extra.is_empty() {
                beside.push((line, time_s, layout.extra.iter().map(|&at| cells[at]).collect()));
            }
            match values {
                Some(values) => rows.push(Row { line, time_s, values }),
                None => lost.push(line),
            }
        }
        if let Some((',', _)) = reader.decimal {
            protocol.push("decimal comma".to_owned());
        }
        protocol.extend(gaps(&lost));
        let names: Vec<&str> = layout.extra.iter().map(|&at| sheet.columns[at].name.as_str()).collect();
        let (extras, of_extras) = Extras::of(&names, &beside, reader.decimal.map(|(mark, _)| mark))?;
        protocol.extend(of_extras);
        let too_few = |rows: usize| {
            let rows = counted(rows as u64, "row");
            Located::whole(format!("{rows} of data, at least {FEWEST_ROWS} are needed"))
        };
        if rows.len() < FEWEST_ROWS {
            return Err(too_few(rows.len()));
        }
        let (format, doubts) = match &layout.content {
            Content::Poses { .. } => (Format::Poses, Vec::new()),
            Content::Markers { names, .. } => {
                lose_origins(&mut rows);
                let settled = settle(names, rows)?;
                protocol.extend(settled.protocol);
                rows = settled.rows;
                (Format::Markers(settled.body), settled.doubts)
            }
        };
        if rows.len() < FEWEST_ROWS {
            return Err(too_few(rows.len()));
        }
        check_steps(&rows)?;
        Ok(Self { format, rows, extras, protocol, doubts })
    }

    /// The names in the plain form, after the time.
    pub(super) fn columns(&self) -> Vec<String> {
        match self.format {
            Format::Poses => POSES.map(str::to_owned).to_vec(),
            Format::Markers(_) => (0..self.rows[0].values.len()).map(marker_column).collect(),
        }
    }

    /// The plain form, under comments with the protocol.
    pub(super) fn plain(&self, path: &Path) -> String {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let mut text = format!(
            "# The plain form of {}; axes and point of reference are those of the file.\n",
            excerpt(&name)
        );
        for line in &self.protocol {
            let _ = writeln!(text, "# {line}");
        }
        let names = [vec!["time_s".to_owned()], self.columns(), self.extras.names.clone()];
        text += &names.concat().join(",");
        // A row without a pose is written where it has other columns.
        let lost = vec![f64::NAN; self.rows[0].values.len()];
        let mut poses = self.rows.iter().peekable();
        let mut extras = self.extras.rows.iter().filter(|_| !self.extras.names.is_empty()).peekable();
        while let Some(row) = [poses.peek(), extras.peek()].into_iter().flatten().min_by_key(|row| row.line) {
            let (line, time_s) = (row.line, row.time_s);
            let pose = poses.next_if(|row| row.line == line).map_or(&lost, |row| &row.values);
            let extra = extras.next_if(|row| row.line == line).map_or(&[][..], |row| &row.values);
            let _ = write!(text, "\n{time_s}");
            for value in pose.iter().chain(extra) {
                let _ = if value.is_nan() { write!(text, ",") } else { write!(text, ",{value}") };
            }
        }
        text + "\n"
    }
}

/// The numbers of rows.
struct Reader<'a> {
    layout: &'a Layout,
    sheet: &'a Sheet<'a>,
    /// The decimal mark, and the line of its first use.
    decimal: Option<(char, u64)>,
    last_s: Option<f64>,
}

impl Reader<'_> {
    /// Time, and the other columns of the plain form; these are absent in a row of a lost sample.
    fn row(&mut self, index: usize, line: u64, cells: &[&str]) -> Result<(f64, Option<Vec<f64>>), String> {
        let layout = self.layout;
        let time_s = match layout.clock {
            Clock::Times(scaled) => self.time_s(line, cells[scaled.column], scaled)?,
            Clock::Rows { rate_hz } => index as f64 / rate_hz,
        };
        self.last_s = Some(time_s);
        let values = match &layout.content {
            Content::Poses { place, turn } => {
                let place = self.numbers(line, cells, place)?;
                let turn = self.quaternion(line, cells, turn)?;
                place.zip(turn).map(|(place, turn)| [&place[..], &turn[..]].concat())
            }
            Content::Markers { places, .. } => {
                let mut values = Vec::with_capacity(3 * places.len());
                for place in places {
                    values.extend(self.numbers(line, cells, place)?.unwrap_or([f64::NAN; 3]));
                }
                Some(values)
            }
        };
        let (lengths, name): (_, fn(usize) -> String) = match layout.content {
            Content::Poses { .. } => (3, |at| POSES[at].to_owned()),
            Content::Markers { .. } => (usize::MAX, marker_column),
        };
        let mut lengths_mm = values.iter().flatten().take(lengths).enumerate();
        if let Some((at, value)) = lengths_mm.find(|(_, value)| value.abs() > LARGEST_MM) {
            let column = name(at);
            return Err(format!(
                "{column} is {value:e}, beyond ±{LARGEST_MM} mm; is the unit millimetres? (motion.length_unit)"
            ));
        }
        Ok((time_s, values))
    }

    /// A number of s, or a time of the day; midnight may pass.
    fn time_s(&mut self, line: u64, cell: &str, scaled: Scaled) -> Result<f64, String> {
        if !cell.contains(':') {
            return match self.number(line, scaled.column, cell)? {
                Some(number) => Ok(number * scaled.size),
                None => {
                    Err(format!("{} has no time; complete the line or delete it", self.name(scaled.column)))
                }
            };
        }
        let of_day =
            cell.rsplit(['T', ' ']).next().unwrap_or_default().trim_end_matches('Z').replace(',', ".");
        let parts: Option<Vec<f64>> = of_day.split(':').map(|part| part.parse().ok()).collect();
        let seconds = match parts.as_deref() {
            Some(&[h, m, s])
                if (0.0..24.0).contains(&h) && (0.0..60.0).contains(&m) && (0.0..60.0).contains(&s) =>
            {
                3600.0 * h + 60.0 * m + s
            }
            Some(&[m, s]) if m >= 0.0 && (0.0..60.0).contains(&s) => 60.0 * m + s,
            _ => {
                let name = self.name(scaled.column);
                return Err(format!(
                    "{name} is '{}', no time of the day such as 10:00:00.015",
                    excerpt(cell)
                ));
            }
        };
        let days = self.last_s.map_or(0.0, |last_s| ((last_s - seconds) / DAY_S).round().max(0.0));
        Ok(seconds + days * DAY_S)
    }

    /// The numbers of columns in their units; none if one is lost.
    fn numbers<const N: usize>(
        &mut self,
        line: u64,
        cells: &[&str],
        columns: &[Scaled; N],
    ) -> Result<Option<[f64; N]>, String> {
        let mut numbers = [Some(0.0); N];
        for (number, &Scaled { column, size }) in numbers.iter_mut().zip(columns) {
            *number = self.number(line, column, cells[column])?.map(|number| number * size);
        }
        Ok(numbers.iter().all(Option::is_some).then(|| numbers.map(Option::unwrap_or_default)))
    }

    /// A quaternion, scalar first; none if it is lost.
    fn quaternion(&mut self, line: u64, cells: &[&str], turn: &Turn) -> Result<Option<[f64; 4]>, String> {
        let plain = |column| Scaled { column, size: 1.0 };
        let of_turn = |turn: UnitQuaternion<f64>| [turn.w, turn.i, turn.j, turn.k];
        Ok(match turn {
            Turn::Quaternion(columns) => {
                let parts = self.numbers(line, cells, &columns.map(plain))?;
                parts.filter(|parts| parts.iter().any(|part| *part != 0.0))
            }
            Turn::Angles(angles) => {
                let values = self.numbers(line, cells, &angles.map(|(_, scaled)| scaled))?;
                values.map(|values| {
                    let turn = |part: usize| {
                        UnitQuaternion::from_scaled_axis(Vector3::ith(angles[part].0, values[part]))
                    };
                    of_turn(turn(0) * turn(1) * turn(2))
                })
            }
            Turn::Matrix { rotation: columns, last_row } => {
                let elements = self.numbers(line, cells, &columns.map(plain))?;
                let last_row =
                    last_row.map(|columns| self.numbers(line, cells, &columns.map(plain))).transpose()?;
                if let Some(Some(last_row)) = last_row.filter(|row| *row != Some([0.0, 0.0, 0.0, 1.0])) {
                    return Err(format!(
                        "the last row of the matrix is {last_row:?}, not 0, 0, 0, 1; is it written column after column? name the \
                         columns in their order by motion.columns"
                    ));
                }
                let elements = elements.filter(|elements| elements.iter().any(|element| *element != 0.0));
                elements.map(|elements| rotation(&elements).map(of_turn)).transpose()?
            }
        })
    }

    fn name(&self, column: usize) -> String {
        format!("column {} '{}'", column + 1, excerpt(&self.sheet.columns[column].name))
    }

    /// A finite number with a decimal point or comma; none if it is lost.
    fn number(&mut self, line: u64, column: usize, cell: &str) -> Result<Option<f64>, String> {
        let mark = cell.chars().find(|c| matches!(c, '.' | ','));
        let finite = |text: &str| text.parse().ok().filter(|number: &f64| number.is_finite());
        let number = if mark == Some(',') { finite(&cell.replacen(',', ".", 1)) } else { finite(cell) };
        let may_be_lost = number.is_none() || cell.starts_with("-3.697");
        if may_be_lost && is_lost(cell) {
            return Ok(None);
        }
        let Some(number) = number else {
            let name = self.name(column);
            return Err(format!(
                "{name} is '{}', not a finite number; correct it, or leave the cell empty for a lost sample",
                excerpt(cell)
            ));
        };
        if let Some(mark) = mark {
            let (first, first_line) = *self.decimal.get_or_insert((mark, line));
            if first != mark {
                let name = self.name(column);
                return Err(format!(
                    "{name} is '{}', but line {first_line} has the decimal mark '{first}'; use one in all lines",
                    excerpt(cell)
                ));
            }
        }
        Ok(Some(number))
    }
}

fn rotation(elements: &[f64; 9]) -> Result<UnitQuaternion<f64>, String> {
    let matrix = Matrix3::from_row_slice(elements);
    let off = (matrix.transpose() * matrix - Matrix3::identity()).amax();
    if off > MATRIX_TOLERANCE || matrix.determinant() < 0.0 {
        let determinant = matrix.determinant();
        return Err(format!(
            "the matrix is no rotation (determinant {determinant:.3}, {off:.3} off orthogonal); are the columns named in the right \
             order (motion.columns), and is the frame right-handed?"
        ));
    }
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix));
    Ok(UnitQuaternion::from_quaternion(turn.into_inner()))
}

/// A marker exactly at the origin, where it is not at first, is lost: so some trackers write it.
fn lose_origins(rows: &mut [Row]) {
    let Some(first) = rows.first().map(|row| row.values.clone()) else { return };
    let is_origin = |place: &[f64]| place.iter().all(|coordinate| *coordinate == 0.0);
    for row in rows {
        for (place, first) in row.values.chunks_exact_mut(3).zip(first.chunks_exact(3)) {
            if is_origin(place) && !is_origin(first) {
                place.fill(f64::NAN);
            }
        }
    }
}

fn check_steps(rows: &[Row]) -> Result<(), Located> {
    let step_s = |pair: &[Row]| pair[1].time_s - pair[0].time_s;
    let usual_s = upper_median(&rows.windows(2).map(step_s).collect::<Vec<_>>());
    // Steps that are short for a tracker are judged with the speeds.
    if usual_s > 0.0 && !(SHORTEST_STEP_S..=LARGEST_GAP_S).contains(&usual_s) {
        let unit = match usual_s / LARGEST_GAP_S {
            1e3.. => "us",
            1.0.. => "ms",
            _ => "s",
        };
        return Err(Located::at(
            rows[1].line,
            format!(
                "the usual time between rows is {usual_s} s, which no tracker has; if the times are in {unit}, set \
                 motion.time_unit = \"{unit}\""
            ),
        ));
    }
    for pair in rows.windows(2) {
        let (time_s, previous_s, gap_s) = (pair[1].time_s, pair[0].time_s, step_s(pair));
        let problem = if gap_s < SHORTEST_STEP_S {
            format!(
                "time {time_s} s does not come after {previous_s} s of the row before by 1 µs or more; sort the rows, \
                 drop repeats"
            )
        } else if gap_s > LARGEST_GAP_S {
            format!(
                "{gap_s:.3} s without a sample, at most {LARGEST_GAP_S} s can be bridged; cut the recording here"
            )
        } else {
            continue;
        };
        return Err(Located::at(pair[1].line, problem));
    }
    Ok(())
}

#[cfg(test)]
mod tests;
