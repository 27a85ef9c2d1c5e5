//! A push on the jaw: a force and a torque over the time since the beginning, by a shape or a CSV file.
//!
//! Comments in the file begin with `#`, and blank lines are ignored. Between two rows the values change evenly.

use std::{path::Path, sync::Arc};

use masseter_runtime::clock::SECOND_NS;
use masseter_scenario::rows::{fields, lines, numbers};
use masseter_scenario::{Shape, StimulusConfig, input::read_text};
use nalgebra::Vector6;

use crate::error::PlantError;

/// A push.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Push {
    course: Course,
    /// Where the force acts, m in the platform frame; the incisal point when absent.
    pub(crate) point_m: Option<[f64; 3]>,
}

#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
enum Course {
    Shaped {
        whole: Vector6<f64>,
        shape: Shape,
        for_s: f64,
        frequency_hz: f64,
    },
    /// A file of a snapshot has the checksum of the rows, which are those of its scenario.
    Table {
        checksum: u32,
        #[serde(skip)]
        rows: Arc<WrenchTable>,
    },
}

impl Push {
    /// The push of a stimulus; none for another kind of stimulus.
    pub(crate) fn new(config: &StimulusConfig) -> Result<Option<Self>, PlantError> {
        let StimulusConfig { push_n, torque_n_m, push_table, point_m, shape, for_s, frequency_hz, .. } =
            config;
        let course = match (push_table, push_n, torque_n_m) {
            (Some(path), ..) => {
                let rows = WrenchTable::read(path)?;
                Course::Table { checksum: rows.checksum(), rows: Arc::new(rows) }
            }
            (None, None, None) => return Ok(None),
            (None, force_n, torque_n_m) => {
                let [[x, y, z], [a, b, c]] = [force_n, torque_n_m].map(|given| given.unwrap_or_default());
                Course::Shaped {
                    whole: Vector6::new(x, y, z, a, b, c),
                    shape: *shape,
                    for_s: for_s.unwrap_or(f64::INFINITY),
                    frequency_hz: frequency_hz.unwrap_or_default(),
                }
            }
        };
        Ok(Some(Self { course, point_m: *point_m }))
    }

    /// Takes the rows of the same push; false if this is another one.
    pub(crate) fn take_rows_of(&mut self, other: &Self) -> bool {
        if let (Course::Table { checksum, rows }, Course::Table { checksum: wanted, rows: found }) =
            (&mut self.course, &other.course)
            && checksum == wanted
        {
            rows.clone_from(found);
        }
        self == other
    }

    /// Its most time, ns: a table ends with its last row.
    pub(crate) fn longest_ns(&self) -> u64 {
        match &self.course {
            Course::Shaped { .. } => u64::MAX,
            Course::Table { rows, .. } => (rows.length_s() * SECOND_NS as f64) as u64,
        }
    }

    /// The force (N) and the torque (N m) in base axes, so long after the beginning.
    pub(crate) fn wrench(&self, since_ns: u64) -> Vector6<f64> {
        let since_s = since_ns as f64 / SECOND_NS as f64;
        match &self.course {
            Course::Shaped { whole, shape, for_s, frequency_hz } => {
                whole * shape.at(since_s, *for_s, *frequency_hz)
            }
            Course::Table { rows, .. } => rows.at(since_s),
        }
    }
}

const COLUMNS: [&str; 7] =
    ["time_s", "force_x_n", "force_y_n", "force_z_n", "torque_x_n_m", "torque_y_n_m", "torque_z_n_m"];
/// How many of them a table without torques has.
const OF_FORCES: usize = 4;
/// The largest value of each column of [`COLUMNS`]: a day, and those of a push without a table.
const LARGEST: [f64; 7] = [86_400.0, 2000.0, 2000.0, 2000.0, 200.0, 200.0, 200.0];

/// The rows of a table.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct WrenchTable {
    /// Strictly increasing from 0.
    time_s: Vec<f64>,
    /// Force (N) and torque (N m) of each row.
    wrench: Vec<Vector6<f64>>,
}

impl WrenchTable {
    /// The table of a file.
    pub(crate) fn read(path: &Path) -> Result<Self, PlantError> {
        let refused = |line, problem| PlantError::Table { path: path.to_owned(), line, problem };
        let text = read_text(path, StimulusConfig::MOST_TABLE_BYTES)
            .map_err(|error| refused(None, format!("cannot be read ({error}); check the path")))?;
        Self::parse(&text).map_err(|(line, problem)| refused(line, problem))
    }

    /// The error has the line, if one is at fault.
    fn parse(text: &str) -> Result<Self, (Option<u64>, String)> {
        let mut content = lines(text.as_bytes()).filter(|line| line.text.as_deref() != Ok(""));
        let header =
            content.next().ok_or_else(|| (None, "it is empty; write a header and rows".to_owned()))?;
        let columns = header.text.and_then(|text| columns(&text));
        let columns = columns.map_err(|problem| (Some(header.number), problem))?;
        let mut table = Self { time_s: Vec::new(), wrench: Vec::new() };
        for line in content {
            let added = line.text.and_then(|text| table.add(&text, columns));
            added.map_err(|problem| (Some(line.number), problem))?;
        }
        if table.time_s.len() < 2 {
            return Err((None, "fewer than two rows; write at least the first and the last".to_owned()));
        }
        Ok(table)
    }

    fn add(&mut self, text: &str, columns: &[&str]) -> Result<(), String> {
        let row = numbers(text, columns)?;
        let beyond = row.iter().zip(LARGEST).position(|(value, largest)| value.abs() > largest);
        if let Some(place) = beyond {
            let (column, value, largest) = (columns[place], row[place], LARGEST[place]);
            return Err(format!("{column} is {value}; use at most {largest}"));
        }
        let time_s = row[0];
        match self.time_s.last() {
            None if time_s != 0.0 => return Err(format!("the first time is {time_s} s; begin at 0 s")),
            Some(last_s) if time_s <= *last_s => {
                return Err(format!("time {time_s} s does not come after {last_s} s; sort the rows"));
            }
            _ => {}
        }
        self.time_s.push(time_s);
        self.wrench.push(Vector6::from_fn(|place, _| row.get(place + 1).copied().unwrap_or_default()));
        Ok(())
    }

    fn checksum(&self) -> u32 {
        let mut hasher = crc32fast::Hasher::new();
        let values = self.time_s.iter().chain(self.wrench.iter().flatten());
        values.for_each(|value| hasher.update(&value.to_le_bytes()));
        hasher.finalize()
    }

    /// The time of the last row, s.
    pub(crate) fn length_s(&self) -> f64 {
        self.time_s[self.time_s.len() - 1]
    }

    /// Force and torque at a time; those of the last row after its end.
    pub(crate) fn at(&self, time_s: f64) -> Vector6<f64> {
        let right = self.time_s.partition_point(|row_s| *row_s <= time_s).clamp(1, self.time_s.len() - 1);
        let [from_s, to_s] = [self.time_s[right - 1], self.time_s[right]];
        let share = ((time_s - from_s) / (to_s - from_s)).clamp(0.0, 1.0);
        self.wrench[right - 1].lerp(&self.wrench[right], share)
    }
}

/// The columns that a header announces.
fn columns(header: &str) -> Result<&'static [&'static str], String> {
    let known = [&COLUMNS[..], &COLUMNS[..OF_FORCES]];
    known.into_iter().find(|columns| fields(header).eq(columns.iter().copied())).ok_or_else(|| {
        let all = COLUMNS.join(",");
        format!("the header must be '{all}'; the torques may be left away")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "time_s,force_x_n,force_y_n,force_z_n";

    #[test]
    fn between_rows_the_values_change_evenly() {
        let text = format!(
            "# a push\n{HEADER},torque_x_n_m,torque_y_n_m,torque_z_n_m\n0,0,0,0,1,0,0\n\n0.2,2,0,-8,1,0,4\n1,0,0,0,0,0,0\n"
        );
        let table = WrenchTable::parse(&text).unwrap();
        assert!((table.length_s() - 1.0).abs() < f64::EPSILON);
        for (time_s, expected) in [
            (0.0, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]),
            (0.05, [0.5, 0.0, -2.0, 1.0, 0.0, 1.0]),
            (0.2, [2.0, 0.0, -8.0, 1.0, 0.0, 4.0]),
            (0.6, [1.0, 0.0, -4.0, 0.5, 0.0, 2.0]),
            (1.0, [0.0; 6]),
            (9.0, [0.0; 6]),
        ] {
            assert!((table.at(time_s) - Vector6::from(expected)).amax() < 1e-12, "{time_s}");
        }
    }

    #[test]
    fn a_table_may_have_no_torques() {
        let table = WrenchTable::parse(&format!("{HEADER}\n0,1,2,3\n1,1,2,3\n")).unwrap();
        assert_eq!(table.at(0.5), Vector6::new(1.0, 2.0, 3.0, 0.0, 0.0, 0.0));
    }

    #[test]
    fn bad_tables_are_refused_with_line_and_remedy() {
        let with = |rows: &str| format!("{HEADER}\n{rows}");
        for (text, line, reason) in [
            (String::new(), None, "it is empty"),
            (with(""), None, "fewer than two rows"),
            (with("0,0,0,0\n"), None, "fewer than two rows"),
            ("time_s,force_x\n".to_owned(), Some(1), "the header must be 'time_s,force_x_n,"),
            (with("0.1,0,0,0\n"), Some(2), "the first time is 0.1 s; begin at 0 s"),
            (with("0,0,0,0\n# no row\n1,0,0\n"), Some(4), "3 fields, expected 4"),
            (with("0,0,0,0\n1,0,zero,0\n"), Some(3), "force_y_n is 'zero'"),
            (with("0,0,0,0\n0,0,0,0\n"), Some(3), "time 0 s does not come after 0 s; sort the rows"),
            (with("0,0,0,-2001\n"), Some(2), "force_z_n is -2001; use at most 2000"),
        ] {
            let (at, problem) = WrenchTable::parse(&text).unwrap_err();
            assert_eq!(at, line, "{text}");
            assert!(problem.starts_with(reason), "{problem}");
        }
    }

    #[test]
    fn a_refusal_names_the_file() {
        let error = WrenchTable::read(Path::new("missing.csv")).unwrap_err().to_string();
        assert!(error.starts_with("missing.csv: cannot be read ("), "{error}");
    }
}
