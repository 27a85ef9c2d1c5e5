//! The rows of cells in a text of a tracker: separator, lines before the header, names of the columns.
//!
//! Formats with a head of their own are TRC (markers of motion laboratories), and MOT and STO (OpenSim). Lines that
//! begin with `#` are comments. The module reads no numbers.

use masseter_scenario::{AngleUnit, LengthUnit, TimeUnit, input::excerpt, wording::counted};

use super::columns::{Column, Meaning};
use super::row::{Located, is_lost};
use super::units::{Quantity, Unit};

/// Lines in which the header is looked for.
const HEAD_LINES: usize = 200;
/// The fewest columns that name a motion.
const FEWEST: usize = 4;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Separator {
    Comma,
    Tab,
    Semicolon,
    Spaces,
}

impl Separator {
    const ALL: [(Self, &'static str); 4] = [
        (Self::Comma, "commas"),
        (Self::Tab, "tabs"),
        (Self::Semicolon, "semicolons"),
        (Self::Spaces, "spaces"),
    ];

    fn name(self) -> &'static str {
        Self::ALL[self as usize].1
    }

    /// The cells of a line, without quotes.
    fn cells(self, line: &str) -> Vec<&str> {
        let character = match self {
            Self::Comma => ',',
            Self::Tab => '\t',
            Self::Semicolon => ';',
            Self::Spaces => return line.split_whitespace().map(unquoted).collect(),
        };
        let has_pairs = line.matches('"').count().is_multiple_of(2);
        let mut is_quoted = false;
        let split = |c: char| {
            is_quoted ^= c == '"' && has_pairs;
            c == character && !is_quoted
        };
        line.split(split).map(unquoted).collect()
    }

    /// The names in a header. A unit in brackets belongs to the name before.
    fn names(self, line: &str) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for cell in self.cells(line.trim_end()) {
            match names.last_mut() {
                Some(last) if self == Self::Spaces && cell.starts_with(['[', '(']) => *last += cell,
                _ => names.push(cell.to_owned()),
            }
        }
        names
    }
}

fn unquoted(cell: &str) -> &str {
    let cell = cell.trim();
    cell.strip_prefix('"').and_then(|rest| rest.strip_suffix('"')).unwrap_or(cell).trim()
}

/// A text whose header is found.
#[derive(Debug)]
pub(super) struct Sheet<'a> {
    text: &'a str,
    separator: Separator,
    /// Lines before the first row of numbers.
    head_lines: usize,
    pub columns: Vec<Column>,
    /// The line of the names; none if a key gives them.
    pub header_line: Option<u64>,
    /// The units that the format fixes.
    pub assumed: Vec<Unit>,
    pub protocol: Vec<String>,
}

impl<'a> Sheet<'a> {
    /// `named`: the columns by a key.
    pub(super) fn of(text: &'a str, named: Option<&[String]>) -> Result<Self, Located> {
        let (assumed, format, after) = vendor(text);
        let is_of_head = |(at, line): &(usize, &str)| *at >= after && !line.trim().is_empty();
        let head: Vec<_> = content(text).filter(is_of_head).take(HEAD_LINES).collect();
        let (separator, head_lines, columns, header_line) = match named {
            Some(names) => by_key(&head, names)?,
            None => with_header(&head)?,
        };
        let mut protocol = Vec::from_iter(format);
        protocol.push(format!("columns between {}", separator.name()));
        match header_line {
            Some(1) => {}
            Some(line) => protocol.push(format!("header in line {line}; the lines before are not read")),
            None => protocol.push(format!("columns by motion.columns, from line {} on", head_lines + 1)),
        }
        Ok(Self { text, separator, head_lines, columns, header_line, assumed, protocol })
    }

    /// The cells of each row, with its line from 1. A row whose cells are all empty has none.
    pub(super) fn rows(&self) -> impl Iterator<Item = Result<(u64, Vec<&'a str>), Located>> {
        let rows = content(self.text).filter(|(at, _)| *at >= self.head_lines);
        rows.map(|(at, text)| {
            let (line, mut cells) = (at as u64 + 1, self.separator.cells(text));
            if cells.iter().all(|cell| cell.is_empty()) {
                return Ok((line, Vec::new()));
            }
            let (found, expected) = (cells.len(), self.columns.len());
            if found < expected || cells[expected..].iter().any(|cell| !cell.is_empty()) {
                let found = counted(found as u64, "cell");
                let mark = match self.separator {
                    Separator::Comma => "; a decimal comma needs another separator, such as a semicolon",
                    _ => "",
                };
                let problem = format!("{found}, expected {expected}; complete the line or delete it{mark}");
                return Err(Located::at(line, problem));
            }
            cells.truncate(expected);
            Ok((line, cells))
        })
    }
}

type Found = (Separator, usize, Vec<Column>, Option<u64>);

/// Separator, lines before the rows, columns, and the line of their names.
fn with_header(head: &[(usize, &str)]) -> Result<Found, Located> {
    let mut best = (0, 0, Separator::Comma);
    for (at, (_, line)) in head.iter().enumerate() {
        for (separator, _) in Separator::ALL {
            let names = separator.names(line);
            let known = names.iter().filter(|name| Column::of(name).meaning != Meaning::Unknown).count();
            // Of two lines that name as much, such as a translation, the lower is nearer to the numbers.
            if known > best.0 || (known == best.0 && at == best.1 + 1) {
                best = (known, at, separator);
            }
        }
    }
    let (known, at, separator) = best;
    if known < FEWEST {
        return Err(no_header(head));
    }
    let (line, header) = head[at];
    let above = at.checked_sub(1).map(|above| separator.names(head[above].1));
    let mut columns = names(&separator.names(header), &above.unwrap_or_default());
    let mut head_lines = line + 1;
    // A line of units may follow.
    if let Some((units_line, units)) = head.get(at + 1) {
        let units = separator.cells(units);
        let bare = |cell: &str| cell.trim_matches(['[', ']', '(', ')']).to_owned();
        let is_unit = |cell: &&str| cell.is_empty() || **cell == *"-" || Unit::of(&bare(cell)).is_some();
        if units.iter().all(is_unit) && units.iter().any(|cell| Unit::of(&bare(cell)).is_some()) {
            for (column, unit) in columns.iter_mut().zip(units) {
                if column.unit.is_none() && !unit.is_empty() {
                    *column = Column::of(&format!("{} [{}]", column.name, bare(unit)));
                }
            }
            head_lines = units_line + 1;
        }
    }
    Ok((separator, head_lines, columns, Some(line as u64 + 1)))
}

/// The rows begin at the first line with numbers, or lost samples, in the columns that a key names.
fn by_key(head: &[(usize, &str)], names: &[String]) -> Result<Found, Located> {
    let columns: Vec<Column> = names.iter().map(|name| Column::of(name)).collect();
    let is_number = |cell: &str| {
        cell.chars().all(|c| c.is_ascii_digit() || "+-.,:eE".contains(c))
            && cell.contains(|c: char| c.is_ascii_digit())
    };
    for (line, text_there) in head {
        for (separator, _) in Separator::ALL {
            let cells = separator.cells(text_there);
            let used = columns.iter().zip(&cells).filter(|(column, _)| column.meaning != Meaning::Unknown);
            let used: Vec<&str> = used.map(|(_, cell)| *cell).collect();
            if cells.len() == columns.len()
                && used.iter().all(|cell| is_number(cell) || is_lost(cell))
                && used.iter().any(|cell| is_number(cell))
            {
                return Ok((separator, *line, columns, None));
            }
        }
    }
    Err(Located::whole(format!(
        "motion.columns names {}, and no line has a number in each; give a name for each column of the file, \"-\" for one without use",
        counted(names.len() as u64, "column")
    )))
}

/// The lines that are not blank and no comments, each with its index. Tabs alone are cells of a row.
fn content(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let is_content = |line: &str| !line.trim_matches(' ').is_empty() && !line.trim_start().starts_with('#');
    text.lines().enumerate().filter(move |(_, line)| is_content(line))
}

/// The columns of a header. Coordinates without a marker's name take the name from the line above, as in TRC.
fn names(header: &[String], above: &[String]) -> Vec<Column> {
    let columns: Vec<Column> = header.iter().map(|name| Column::of(name)).collect();
    let bare = |axis| columns.iter().filter(|column| column.meaning == Meaning::Bare(axis)).count();
    let is_of_two_lines = header.first().is_some_and(String::is_empty) || (0..3).all(|axis| bare(axis) > 1);
    if !is_of_two_lines {
        return columns;
    }
    let (mut name, mut groups) = (String::new(), 0);
    let column = |(at, column): (usize, Column)| {
        if let Some(above) = above.get(at).filter(|above| !above.is_empty()) {
            name.clone_from(above);
        }
        groups += usize::from(column.meaning == Meaning::Bare(0));
        let is_coordinate = matches!(column.meaning, Meaning::Bare(_) | Meaning::Quaternion(0))
            || matches!(&column.meaning, Meaning::Marker(name, _) if name.bytes().all(|byte| byte.is_ascii_digit()));
        match (is_coordinate, name.is_empty()) {
            (true, false) => Column::of(&format!("{name} {}", column.name)),
            // Without any names the markers count.
            (true, true) if column.meaning != Meaning::Quaternion(0) => {
                Column::of(&format!("m{groups} {}", column.name))
            }
            _ if column.name.is_empty() => Column::of(&name),
            _ => column,
        }
    };
    columns.into_iter().enumerate().map(column).collect()
}

/// Content of a format's head: the units, a line of the protocol, and the line after the head, from 0.
fn vendor(text: &str) -> (Vec<Unit>, Option<String>, usize) {
    let lines: Vec<&str> = text.lines().take(HEAD_LINES).collect();
    let seconds = Unit::Time(TimeUnit::S);
    if let [first, keys, values, ..] = lines[..]
        && first.starts_with("PathFileType")
    {
        let at = keys.split('\t').position(|key| key.trim().eq_ignore_ascii_case("units"));
        let unit = at.and_then(|at| Unit::of(values.split('\t').nth(at)?));
        let length = unit.filter(|unit| unit.quantity() == Quantity::Length);
        return (
            [Some(seconds), length].into_iter().flatten().collect(),
            Some("format TRC: times in s".to_owned()),
            3,
        );
    }
    let Some(end) = lines.iter().position(|line| line.trim().eq_ignore_ascii_case("endheader")) else {
        return (Vec::new(), None, 0);
    };
    let is_in_degrees =
        lines[..end].iter().any(|line| line.replace(' ', "").eq_ignore_ascii_case("inDegrees=yes"));
    let (angle, angles) =
        if is_in_degrees { (AngleUnit::Deg, "degrees") } else { (AngleUnit::Rad, "radians") };
    let format = format!("format MOT/STO: times in s, lengths in m, angles in {angles}");
    (vec![seconds, Unit::Length(LengthUnit::M), Unit::Angle(angle)], Some(format), end + 1)
}

fn no_header(head: &[(usize, &str)]) -> Located {
    let cells = |line: &str| {
        Separator::ALL.map(|(separator, _)| separator.cells(line).len()).into_iter().max().unwrap_or_default()
    };
    let Some((line, text)) = head.iter().max_by_key(|(at, line)| (cells(line), std::cmp::Reverse(*at)))
    else {
        return Located::whole("0 rows of data; a header and rows are needed".to_owned());
    };
    let problem = format!(
        "no line names the columns of a motion, such as time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz or time_s,m1_x_mm,m1_y_mm,m1_z_mm \
         and so on; this line has {} ('{}'); give each a name by motion.columns = [\"time_s\", \"x_mm\", …]",
        counted(cells(text) as u64, "cell"),
        excerpt(text)
    );
    Located::at(*line as u64 + 1, problem)
}
