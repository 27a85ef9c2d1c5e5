//! Where the motion is in a recording's rows: its columns, and their units.
//!
//! What the names of the columns and the keys of `[motion]` leave open is asked for. The module reads no numbers.

use masseter_scenario::FileConfig;
use masseter_scenario::input::{excerpt, sentence};
use masseter_scenario::wording::{counted, listed};

use super::columns::{Column, Meaning, words_and_unit};
use super::units::{Quantity, Unit};

/// Most and least markers of a body.
pub(super) const MARKERS: [usize; 2] = [3, 12];

/// A column of numbers, and the size of its unit in s, mm or rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scaled {
    pub column: usize,
    pub size: f64,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Clock {
    /// Numbers of a unit or of frames, or times of the day.
    Times(Scaled),
    Rows {
        rate_hz: f64,
    },
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Turn {
    /// Scalar first.
    Quaternion([usize; 4]),
    /// Axes in the order of the turns, about axes that move with the jaw.
    Angles([(usize, Scaled); 3]),
    /// Row after row, and the last row of four where the file has it.
    Matrix { rotation: [usize; 9], last_row: Option<[usize; 4]> },
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Content {
    Poses { place: [Scaled; 3], turn: Turn },
    Markers { names: Vec<String>, places: Vec<[Scaled; 3]> },
}

/// Where the motion is in a row.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Layout {
    pub clock: Clock,
    pub content: Content,
    /// Columns with another meaning than a motion's.
    pub extra: Vec<usize>,
    /// A line for each part: the columns and their unit.
    pub protocol: Vec<String>,
}

impl Layout {
    /// `is_clock`: whether the cells of a column are times of the day.
    pub(super) fn of(
        columns: &[Column],
        config: &FileConfig,
        assumed: &[Unit],
        is_clock: impl Fn(usize) -> bool,
    ) -> Result<Self, String> {
        let mut reader =
            Reader { columns, config, assumed, used: Vec::new(), protocol: Vec::new(), asked: Vec::new() };
        let clock = reader.clock(is_clock)?;
        let content = reader.content()?;
        reader.refuse_unused_keys(&content)?;
        if !reader.asked.is_empty() {
            return Err(reader.asked.join("; "));
        }
        let is_unused = |at: &usize| {
            let name = &columns[*at].name;
            !reader.used.contains(at) && !name.is_empty() && name != "-"
        };
        let is_extra = |at: &usize| columns[*at].meaning == Meaning::Unknown;
        let (extra, unused): (Vec<usize>, Vec<usize>) =
            (0..columns.len()).filter(is_unused).partition(is_extra);
        let mut protocol = reader.protocol;
        if !unused.is_empty() {
            let unused = listed(unused.into_iter().map(|at| quoted(&columns[at])));
            protocol.push(format!("not used: {}", sentence(&unused)));
        }
        Ok(Self { clock, content, extra, protocol })
    }
}

struct Reader<'a> {
    columns: &'a [Column],
    config: &'a FileConfig,
    /// The units that the format of the file fixes.
    assumed: &'a [Unit],
    used: Vec<usize>,
    protocol: Vec<String>,
    /// What is in neither the file nor a key, each with its key.
    asked: Vec<String>,
}

fn quoted(column: &Column) -> String {
    format!("'{}'", excerpt(&column.name))
}

impl Reader<'_> {
    /// The column with a meaning.
    fn one(&self, meaning: &Meaning) -> Result<Option<usize>, String> {
        let found: Vec<usize> =
            (0..self.columns.len()).filter(|&at| self.columns[at].meaning == *meaning).collect();
        match found[..] {
            [] => Ok(None),
            [at] => Ok(Some(at)),
            [first, second, ..] => {
                let [first, second] = [first, second].map(|at| self.numbered(at));
                let template = self.template();
                Err(format!(
                    "{first} and {second} name the same quantity; name the one to be used, {template}"
                ))
            }
        }
    }

    /// The columns of all these meanings; none if one is absent.
    fn all<const N: usize>(&self, meanings: impl Fn(usize) -> Meaning) -> Result<Option<[usize; N]>, String> {
        let mut found = [0; N];
        for (part, at) in found.iter_mut().enumerate() {
            let Some(column) = self.one(&meanings(part))? else { return Ok(None) };
            *at = column;
        }
        Ok(Some(found))
    }

    /// The key that names every column, with the names as they are understood.
    fn template(&self) -> String {
        let name = |column: &Column| match column.meaning {
            Meaning::Unknown => "\"-\"".to_owned(),
            _ => format!("\"{}\"", excerpt(&column.name)),
        };
        format!("such as motion.columns = [{}]", sentence(&listed(self.columns.iter().map(name))))
    }

    /// A column with its number, from 1.
    fn numbered(&self, at: usize) -> String {
        format!("column {} {}", at + 1, quoted(&self.columns[at]))
    }

    fn quoted(&self, columns: &[usize]) -> String {
        listed(columns.iter().map(|&at| quoted(&self.columns[at])))
    }

    fn use_columns(&mut self, what: &str, columns: &[usize], units: &str) {
        self.used.extend(columns);
        self.protocol.push(format!("{what} from {}{units}", sentence(&self.quoted(columns))));
    }

    /// The columns in the unit of a key, of their names, or of the format, and the units in words.
    fn scaled<const N: usize>(&mut self, found: [usize; N], quantity: Quantity) -> ([Scaled; N], String) {
        let is_of_quantity = |unit: &Unit| unit.quantity() == quantity;
        let set = Unit::set_by(self.config).find(is_of_quantity);
        let assumed = self.assumed.iter().copied().find(is_of_quantity);
        let (key, need) = quantity.key();
        let unit_of = |at: usize| set.or(self.columns[at].unit).or(assumed);
        if let Some(&at) = found.iter().find(|&&at| unit_of(at).is_none())
            && !self.asked.iter().any(|asked| asked.ends_with(need))
        {
            self.asked.push(format!("{} has no unit; set motion.{key} = {need}", self.numbered(at)));
        }
        let parts = found.map(|at| unit_of(at).map_or(("?", 1.0), Unit::parts));
        let mut symbols = parts.map(|(symbol, _)| symbol).to_vec();
        symbols.dedup();
        let by = if set.is_some() { format!(" by motion.{key}") } else { String::new() };
        let scaled = std::array::from_fn(|part| Scaled { column: found[part], size: parts[part].1 });
        (scaled, format!("{}{by}", symbols.join(", ")))
    }

    fn clock(&mut self, is_clock: impl Fn(usize) -> bool) -> Result<Clock, String> {
        let rate_hz = self.config.rate_hz;
        let has_unit = self.config.time_unit.is_some();
        if let Some(at) = self.one(&Meaning::Time)? {
            refuse_unused("rate_hz", rate_hz.is_some(), "is for files without a column of times")?;
            if is_clock(at) {
                refuse_unused("time_unit", has_unit, "is for times in numbers, not of the day")?;
                self.use_columns("time", &[at], ", times of the day");
                return Ok(Clock::Times(Scaled { column: at, size: 1.0 }));
            }
            let ([scaled], unit) = self.scaled([at], Quantity::Time);
            self.use_columns("time", &[at], &format!(" in {unit}"));
            return Ok(Clock::Times(scaled));
        }
        refuse_unused("time_unit", has_unit, "is for files with a column of times")?;
        let frames = self.one(&Meaning::Frame)?;
        let Some(rate_hz) = rate_hz else {
            self.asked.push("no column has times; set motion.rate_hz = the rows a second".to_owned());
            return Ok(Clock::Rows { rate_hz: 1.0 });
        };
        if let Some(column) = frames {
            self.use_columns("time", &[column], &format!(", frames at motion.rate_hz = {rate_hz}"));
            return Ok(Clock::Times(Scaled { column, size: 1.0 / rate_hz }));
        }
        self.protocol.push(format!("time from the order of the rows at motion.rate_hz = {rate_hz}"));
        Ok(Clock::Rows { rate_hz })
    }

    fn content(&mut self) -> Result<Content, String> {
        let (place, bare) = (self.all(Meaning::Place)?, self.all(Meaning::Bare)?);
        let turn = self.turn(place.is_some().then_some(bare).flatten())?;
        let place = match (place, bare) {
            (Some(_), Some(bare)) if !self.used.contains(&bare[0]) => {
                let (name, template) = (self.quoted(&bare[..1]), self.template());
                return Err(format!(
                    "{name} is one of two places in a row; name the one to be used, {template}"
                ));
            }
            (place, bare) => place.or(bare),
        };
        let place = match (place, &turn) {
            // The last column of a 4×4 matrix is a place.
            (None, Some(Turn::Matrix { .. })) => self.matrix(|row| [row, 3])?,
            (place, _) => place,
        };
        match (place, turn) {
            (Some(place), Some(turn)) => {
                let (scaled, unit) = self.scaled(place, Quantity::Length);
                self.use_columns("place", &place, &format!(" in {unit}"));
                Ok(Content::Poses { place: scaled, turn })
            }
            (place, turn) => {
                let markers = self.markers()?;
                markers.ok_or_else(|| self.not_a_motion(place.is_some(), turn.is_some()))
            }
        }
    }

    /// What a file without a motion lacks.
    fn not_a_motion(&self, has_place: bool, has_turn: bool) -> String {
        let is_part = |column: &&Column| {
            matches!(
                column.meaning,
                Meaning::Place(_) | Meaning::Bare(_) | Meaning::Turn(_) | Meaning::Quaternion(_)
            )
        };
        let parts = listed(self.columns.iter().filter(is_part).map(quoted));
        let turn = "qw,qx,qy,qz, three angles, or a matrix";
        let lacks = match (has_place, has_turn) {
            (true, false) => format!("no columns of an orientation ({turn})"),
            (false, true) => "no columns of a place (x,y,z)".to_owned(),
            _ if !parts.is_empty() => format!(
                "{} are only a part of a pose (x,y,z and {turn}); add the others, with 0 where the jaw is held",
                sentence(&parts)
            ),
            _ => format!("no columns of poses (x,y,z and {turn}) or of three markers or more"),
        };
        format!(
            "{lacks}; name the columns, {}; poses are time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz, markers \
             time_s,m1_x_mm,m1_y_mm,m1_z_mm,m2_x_mm and so on",
            self.template()
        )
    }

    /// `spare`: the columns x, y, z, if the place has other columns.
    fn turn(&mut self, spare: Option<[usize; 3]>) -> Result<Option<Turn>, String> {
        let vector = self.all(|part| Meaning::Quaternion(part + 1))?;
        let angles = self.all(Meaning::Turn)?;
        let after_q0 = self.all(|part| Meaning::Numbered(part + 1))?;
        if let Some(scalar) = self.one(&Meaning::Quaternion(0))?
            && let Some([x, y, z]) = vector.or(after_q0).or(angles).or(spare)
        {
            self.use_columns("turn", &[scalar, x, y, z], ", a quaternion, scalar first");
            return Ok(Some(Turn::Quaternion([scalar, x, y, z])));
        }
        if let Some(numbered) = self.all::<4>(|part| Meaning::Numbered(part + 1))? {
            return Err(format!(
                "{} do not say which is the scalar; name them qw,qx,qy,qz or qx,qy,qz,qw, {}",
                self.quoted(&numbered),
                self.template()
            ));
        }
        if let Some(rotation) = self.matrix(|part| [part / 3, part % 3])? {
            let last_row = self.matrix(|part| [3, part])?;
            self.use_columns("turn", &rotation, ", a matrix");
            self.used.extend(last_row.iter().flatten());
            return Ok(Some(Turn::Matrix { rotation, last_row }));
        }
        angles.map(|angles| self.angles(angles)).transpose()
    }

    /// The columns of these elements of a matrix, whose rows and columns count from 0 or from 1.
    fn matrix<const N: usize>(
        &self,
        elements: impl Fn(usize) -> [usize; 2],
    ) -> Result<Option<[usize; N]>, String> {
        let base = usize::from(self.one(&Meaning::Matrix([0, 0]))?.is_none());
        self.all(|part| Meaning::Matrix(elements(part).map(|place| place + base)))
    }

    fn angles(&mut self, angles: [usize; 3]) -> Result<Turn, String> {
        let order = self.config.euler_order.as_deref();
        let axes = order.map(euler_axes).transpose()?.unwrap_or_else(|| {
            self.asked.push(format!(
                "{} are angles about the file's x, y and z in an order that the file does not say; set \
                 motion.euler_order = \"XYZ\", \"XZY\", \"YXZ\", \"YZX\", \"ZXY\" or \"ZYX\" (axes that move with the jaw), or \
                 the same in small letters (fixed axes)",
                self.quoted(&angles)
            ));
            [0, 1, 2]
        });
        let (scaled, unit) = self.scaled(angles, Quantity::Angle);
        let order = order.unwrap_or_default();
        self.use_columns("turn", &angles, &format!(" in {unit}, angles about x, y, z in the order {order}"));
        Ok(Turn::Angles(axes.map(|axis| (axis, scaled[axis]))))
    }

    fn markers(&mut self) -> Result<Option<Content>, String> {
        let mut found: Vec<&str> = Vec::new();
        for Column { meaning, .. } in self.columns {
            if let Meaning::Marker(name, _) = meaning
                && !found.contains(&name.as_str())
            {
                found.push(name);
            }
        }
        let plain = |name: &str| words_and_unit(name).0.concat();
        let wanted = self.config.markers.as_deref();
        if let Some(absent) = wanted.into_iter().flatten().find(|name| !found.contains(&plain(name).as_str()))
        {
            let (absent, found) = (excerpt(absent), found.join(", "));
            return Err(format!(
                "motion.markers names '{absent}'; the file's markers are {}",
                sentence(&found)
            ));
        }
        let (mut names, mut columns) = (Vec::new(), Vec::new());
        for name in found {
            if wanted.is_some_and(|wanted| !wanted.iter().any(|wanted| plain(wanted) == name)) {
                continue;
            }
            let axes = [0, 1, 2].map(|axis| self.one(&Meaning::Marker(name.to_owned(), axis)));
            match axes {
                [Ok(Some(x)), Ok(Some(y)), Ok(Some(z))] => {
                    names.push(name.to_owned());
                    columns.push([x, y, z]);
                }
                [Err(error), ..] | [_, Err(error), _] | [_, _, Err(error)] => return Err(error),
                // A word may end in an axis by chance.
                [Ok(x), Ok(y), Ok(z)] if [x, y, z].iter().flatten().count() == 2 => {
                    let absent = [x, y, z].iter().position(Option::is_none).unwrap_or_default();
                    let (axis, name) = (["x", "y", "z"][absent], excerpt(name));
                    return Err(format!(
                        "marker '{name}' has no column for {axis}; add it, or name the markers to be used, motion.markers = [\"m1\", \"m2\", \"m3\"]"
                    ));
                }
                _ => {}
            }
        }
        if names.is_empty() {
            return Ok(None);
        }
        let [least, most] = MARKERS;
        if !(least..=most).contains(&names.len()) {
            return Err(format!(
                "{} with three coordinates ({}), {least} to {most} are needed, with the header \
                 time_s,m1_x_mm,m1_y_mm,m1_z_mm,m2_x_mm and so on; motion.markers = [\"m1\", \"m2\", \"m3\"] chooses some",
                counted(names.len() as u64, "marker"),
                sentence(&names.join(", "))
            ));
        }
        let (mut places, mut units) = (Vec::new(), Vec::new());
        for columns in columns {
            let (scaled, unit) = self.scaled(columns, Quantity::Length);
            self.used.extend(columns);
            places.push(scaled);
            units.push(unit);
        }
        units.dedup();
        self.protocol.push(format!("markers {} in {}", sentence(&names.join(", ")), units.join(", ")));
        Ok(Some(Content::Markers { names, places }))
    }

    fn refuse_unused_keys(&self, content: &Content) -> Result<(), String> {
        let config = self.config;
        let has_angles = matches!(content, Content::Poses { turn: Turn::Angles(_), .. });
        let is_of_poses = matches!(content, Content::Poses { .. });
        let of_markers = "is for files of markers, and this one holds poses";
        let of_poses = "is for files of poses, and this one holds markers";
        let of_angles = "is for files with three angles";
        refuse_unused("marker_origin_mm", config.marker_origin_mm.is_some() && is_of_poses, of_markers)?;
        refuse_unused("markers", config.markers.is_some() && is_of_poses, of_markers)?;
        refuse_unused("reference_point_mm", config.reference_point_mm.is_some() && !is_of_poses, of_poses)?;
        refuse_unused("angle_unit", config.angle_unit.is_some() && !has_angles, of_angles)?;
        refuse_unused("euler_order", config.euler_order.is_some() && !has_angles, of_angles)
    }
}

/// Refuses a key without a use in the file, because an ignored key hides a mistake.
fn refuse_unused(key: &str, is_unused: bool, reason: &str) -> Result<(), String> {
    if is_unused { Err(format!("motion.{key} {reason}; leave it away")) } else { Ok(()) }
}

/// The axes of an order of turns, as turns about axes that move with the jaw: turns about fixed axes are those in the
/// opposite order.
fn euler_axes(order: &str) -> Result<[usize; 3], String> {
    let axes: Vec<usize> = order.chars().filter_map(|c| "xyz".find(c.to_ascii_lowercase())).collect();
    let is_of_one_case = order.chars().all(char::is_uppercase) || order.chars().all(char::is_lowercase);
    match axes[..] {
        [a, b, c] if order.len() == 3 && is_of_one_case && a != b && b != c && a != c => {
            Ok(if order.starts_with(char::is_uppercase) { [a, b, c] } else { [c, b, a] })
        }
        _ => Err(format!(
            "motion.euler_order is '{}'; name each axis once, such as \"XYZ\" for axes that move with the jaw, or \"xyz\" for fixed axes",
            excerpt(order)
        )),
    }
}
