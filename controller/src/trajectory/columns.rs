//! The meaning of a recording's columns by their names and units.
//!
//! A name counts in any case and with any signs between its words. A unit stands in brackets or at the end. What the
//! names and the keys of `[motion]` leave open is asked for. The module reads no numbers.

use std::fmt::{self, Display, Formatter};

use masseter_scenario::input::{excerpt, sentence};
use masseter_scenario::wording::counted;
use masseter_scenario::{AngleUnit, FileConfig, LengthUnit, TimeUnit};
use serde::Serialize;

/// Most and least markers of a body.
pub(super) const MARKERS: [usize; 2] = [3, 12];

/// Words before a coordinate that is a place, a turn about an axis, or a part of a quaternion.
const PLACES: [&str; 11] =
    ["t", "p", "d", "pos", "position", "trans", "translation", "disp", "displacement", "loc", "location"];
const TURNS: [&str; 6] = ["r", "rot", "rotation", "euler", "angle", "ang"];
const QUATERNIONS: [&str; 4] = ["q", "quat", "quaternion", "orientation"];
const MATRICES: [&str; 7] = ["m", "r", "t", "a", "mat", "rot", "matrix"];
const TIMES: [&str; 6] = ["time", "t", "timestamp", "clock", "zeit", "uhrzeit"];
const FRAMES: [&str; 7] = ["frame", "frameno", "framenumber", "sample", "sampleno", "samplenumber", "bild"];

/// A unit of a recording, by its key.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Unit {
    /// Of times.
    #[serde(rename = "time_unit")]
    Time(TimeUnit),
    /// Of lengths.
    #[serde(rename = "length_unit")]
    Length(LengthUnit),
    /// Of three angles.
    #[serde(rename = "angle_unit")]
    Angle(AngleUnit),
}

impl Unit {
    pub(super) fn of(word: &str) -> Option<Self> {
        Some(match word.trim().to_lowercase().as_str() {
            "s" | "sec" | "second" | "seconds" | "sek" => Self::Time(TimeUnit::S),
            "ms" | "msec" | "millisecond" | "milliseconds" => Self::Time(TimeUnit::Ms),
            "us" | "µs" | "μs" | "microsecond" | "microseconds" => Self::Time(TimeUnit::Us),
            "um" | "µm" | "μm" | "micrometer" | "micrometers" => Self::Length(LengthUnit::Um),
            "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => {
                Self::Length(LengthUnit::Mm)
            }
            "cm" | "centimeter" | "centimeters" | "centimetre" | "centimetres" => {
                Self::Length(LengthUnit::Cm)
            }
            "m" | "meter" | "meters" | "metre" | "metres" => Self::Length(LengthUnit::M),
            "deg" | "degree" | "degrees" | "°" => Self::Angle(AngleUnit::Deg),
            "rad" | "radian" | "radians" => Self::Angle(AngleUnit::Rad),
            _ => return None,
        })
    }

    /// The section with this unit.
    pub fn applied(self, config: &FileConfig) -> FileConfig {
        let mut config = config.clone();
        match self {
            Self::Time(unit) => config.time_unit = Some(unit),
            Self::Length(unit) => config.length_unit = Some(unit),
            Self::Angle(unit) => config.angle_unit = Some(unit),
        }
        config
    }

    /// Its name, as in a scenario, and its size in s, mm or rad.
    pub(super) fn parts(self) -> (&'static str, f64) {
        match self {
            Self::Time(TimeUnit::S) => ("s", 1.0),
            Self::Time(TimeUnit::Ms) => ("ms", 1e-3),
            Self::Time(TimeUnit::Us) => ("us", 1e-6),
            Self::Length(LengthUnit::Um) => ("um", 1e-3),
            Self::Length(LengthUnit::Mm) => ("mm", 1.0),
            Self::Length(LengthUnit::Cm) => ("cm", 10.0),
            Self::Length(LengthUnit::M) => ("m", 1000.0),
            Self::Angle(AngleUnit::Deg) => ("deg", std::f64::consts::PI / 180.0),
            Self::Angle(AngleUnit::Rad) => ("rad", 1.0),
        }
    }
}

/// The key and its value.
impl Display for Unit {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let key = match self {
            Self::Time(_) => "time_unit",
            Self::Length(_) => "length_unit",
            Self::Angle(_) => "angle_unit",
        };
        write!(f, "{key} = \"{}\"", self.parts().0)
    }
}

/// What a column holds. Axes are 0 to 2, parts of a quaternion 0 (the scalar) to 3.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Meaning {
    Time,
    Frame,
    Place(usize),
    /// A coordinate without another word.
    Bare(usize),
    Quaternion(usize),
    /// One of q1 to q4, whose names leave the place of the scalar open.
    Numbered(usize),
    Turn(usize),
    Matrix([usize; 2]),
    Marker(String, usize),
    Unknown,
}

impl Meaning {
    fn has_unit(&self, unit: Unit) -> bool {
        match self {
            Self::Time => matches!(unit, Unit::Time(_)),
            Self::Place(_) | Self::Bare(_) | Self::Marker(..) | Self::Matrix(_) => {
                matches!(unit, Unit::Length(_))
            }
            Self::Turn(_) => matches!(unit, Unit::Angle(_)),
            Self::Frame | Self::Quaternion(_) | Self::Numbered(_) | Self::Unknown => false,
        }
    }
}

/// A column by its name.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Column {
    pub name: String,
    pub meaning: Meaning,
    pub unit: Option<Unit>,
}

impl Column {
    pub(super) fn of(name: &str) -> Self {
        let (words, unit) = words_and_unit(name);
        let meaning = match (meaning(&words), unit) {
            (Meaning::Place(axis) | Meaning::Bare(axis), Some(Unit::Angle(_))) => Meaning::Turn(axis),
            // A velocity in mm/s, for example.
            (meaning, Some(unit)) if !meaning.has_unit(unit) => Meaning::Unknown,
            (meaning, _) => meaning,
        };
        Self { name: name.trim().to_owned(), meaning, unit }
    }
}

fn words_and_unit(name: &str) -> (Vec<String>, Option<Unit>) {
    let lower = name.to_lowercase();
    let bracket = lower.rfind(['[', '(']).and_then(|open| {
        let close = open + lower[open..].find([']', ')'])?;
        let unit = Unit::of(&lower[open + 1..close])?;
        Some((format!("{} {}", &lower[..open], &lower[close + 1..]), unit))
    });
    let (text, mut unit) = bracket.map_or((lower.clone(), None), |(text, unit)| (text, Some(unit)));
    let is_part = |c: char| c.is_alphanumeric() || c == '°';
    let words = text.split(|c| !is_part(c)).filter(|word| !word.is_empty());
    let mut words: Vec<String> = words.map(str::to_owned).collect();
    if unit.is_none() && words.len() > 1 {
        unit = words.last().and_then(|word| Unit::of(word));
        words.truncate(words.len() - usize::from(unit.is_some()));
    }
    (words, unit)
}

fn meaning(words: &[String]) -> Meaning {
    let joined = words.concat();
    let is_one_of = |known: &[&str], word: &str| known.contains(&word);
    match joined.as_str() {
        name if is_one_of(&TIMES, name) => return Meaning::Time,
        name if is_one_of(&FRAMES, name) => return Meaning::Frame,
        "roll" => return Meaning::Turn(0),
        "pitch" => return Meaning::Turn(1),
        "yaw" => return Meaning::Turn(2),
        "q0" | "w" => return Meaning::Quaternion(0),
        "i" => return Meaning::Quaternion(1),
        "j" => return Meaning::Quaternion(2),
        "k" => return Meaning::Quaternion(3),
        _ => {}
    }
    let number = joined.trim_start_matches(|c: char| !c.is_ascii_digit());
    let head = &joined[..joined.len() - number.len()];
    let digits: Option<Vec<usize>> =
        number.chars().map(|c| c.to_digit(10).map(|digit| digit as usize)).collect();
    match digits.unwrap_or_default()[..] {
        [part @ 1..=4] if is_one_of(&QUATERNIONS, head) => return Meaning::Numbered(part),
        [row @ 0..=4, column @ 0..=4] if is_one_of(&MATRICES, head) => return Meaning::Matrix([row, column]),
        _ => {}
    }
    // A coordinate ends in its axis, perhaps with the number of its marker: X1.
    let coordinate = joined.trim_end_matches(|c: char| c.is_ascii_digit());
    let number = &joined[coordinate.len()..];
    let Some(part) = coordinate.chars().last().and_then(|axis| "wxyz".find(axis)) else {
        return Meaning::Unknown;
    };
    let name = &coordinate[..coordinate.len() - 1];
    // The word next to the axis decides: jaw_tx, jaw_rot_x.
    let last = words.last().map_or("", |word| word.trim_end_matches(|c: char| c.is_ascii_digit()));
    let head = match last.get(..last.len().saturating_sub(1)).unwrap_or_default() {
        "" => words.len().checked_sub(2).map_or("", |before| &words[before]),
        head => head,
    };
    match part {
        _ if is_one_of(&QUATERNIONS, head) => Meaning::Quaternion(part),
        0 if is_one_of(&TURNS, head) => Meaning::Quaternion(0),
        0 => Meaning::Unknown,
        _ if is_one_of(&PLACES, head) => Meaning::Place(part - 1),
        _ if is_one_of(&TURNS, head) => Meaning::Turn(part - 1),
        _ if name.is_empty() && number.is_empty() => Meaning::Bare(part - 1),
        _ if name.is_empty() => Meaning::Marker(number.to_owned(), part - 1),
        _ => Meaning::Marker(name.to_owned(), part - 1),
    }
}

/// What a unit is of.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Quantity {
    Time,
    Length,
    Angle,
}

/// Units that the format of a file or the keys fix.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Units {
    pub time: Option<TimeUnit>,
    pub length: Option<LengthUnit>,
    pub angle: Option<AngleUnit>,
}

impl Units {
    fn of(self, quantity: Quantity) -> Option<Unit> {
        match quantity {
            Quantity::Time => self.time.map(Unit::Time),
            Quantity::Length => self.length.map(Unit::Length),
            Quantity::Angle => self.angle.map(Unit::Angle),
        }
    }
}

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
        assumed: Units,
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
            let unused: Vec<_> = unused.into_iter().map(|at| quoted(&columns[at])).collect();
            protocol.push(format!("not used: {}", sentence(&unused.join(", "))));
        }
        Ok(Self { clock, content, extra, protocol })
    }
}

struct Reader<'a> {
    columns: &'a [Column],
    config: &'a FileConfig,
    assumed: Units,
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
                let [first, second] =
                    [first, second].map(|at| format!("column {} {}", at + 1, quoted(&self.columns[at])));
                Err(format!(
                    "{first} and {second} name the same quantity; name the one to be used, {}",
                    self.template()
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
        let names: Vec<_> = self.columns.iter().map(name).collect();
        format!("such as motion.columns = [{}]", sentence(&names.join(", ")))
    }

    fn use_columns(&mut self, what: &str, columns: &[usize], units: &str) {
        self.used.extend(columns);
        let names: Vec<_> = columns.iter().map(|&at| quoted(&self.columns[at])).collect();
        self.protocol.push(format!("{what} from {}{units}", sentence(&names.join(", "))));
    }

    /// The columns in the unit of a key, of their names, or of the format, and the units in words.
    fn scaled<const N: usize>(&mut self, found: [usize; N], quantity: Quantity) -> ([Scaled; N], String) {
        let FileConfig { time_unit: time, length_unit: length, angle_unit: angle, .. } = *self.config;
        let (set, assumed) = (Units { time, length, angle }.of(quantity), self.assumed.of(quantity));
        let (key, need) = match quantity {
            Quantity::Time => ("motion.time_unit", "\"s\", \"ms\" or \"us\""),
            Quantity::Length => ("motion.length_unit", "\"um\", \"mm\", \"cm\" or \"m\""),
            Quantity::Angle => ("motion.angle_unit", "\"deg\" or \"rad\""),
        };
        let unit_of = |at: usize| set.or(self.columns[at].unit).or(assumed);
        if let Some(&at) = found.iter().find(|&&at| unit_of(at).is_none()) {
            let name = quoted(&self.columns[at]);
            if !self.asked.iter().any(|asked| asked.ends_with(need)) {
                self.asked.push(format!("column {} {name} has no unit; set {key} = {need}", at + 1));
            }
        }
        let parts = found.map(|at| unit_of(at).map_or(("?", 1.0), Unit::parts));
        let mut symbols = parts.map(|(symbol, _)| symbol).to_vec();
        symbols.dedup();
        let by = if set.is_some() { format!(" by {key}") } else { String::new() };
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
                let name = quoted(&self.columns[bare[0]]);
                return Err(format!(
                    "{name} is one of two places in a row; name the one to be used, {}",
                    self.template()
                ));
            }
            (place, bare) => place.or(bare),
        };
        // The last column of a 4×4 matrix is a place.
        let base = usize::from(self.one(&Meaning::Matrix([0, 0]))?.is_none());
        let of_matrix = || self.all(|row| Meaning::Matrix([row + base, 3 + base]));
        let place = match (place, &turn) {
            (None, Some(Turn::Matrix { .. })) => of_matrix()?,
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
        let parts: Vec<_> = self.columns.iter().filter(is_part).map(quoted).collect();
        let turn = "qw,qx,qy,qz, three angles, or a matrix";
        let lacks = match (has_place, has_turn) {
            (true, false) => format!("no columns of an orientation ({turn})"),
            (false, true) => "no columns of a place (x,y,z)".to_owned(),
            _ if !parts.is_empty() => format!(
                "{} are only a part of a pose (x,y,z and {turn}); add the others, with 0 where the jaw is held",
                sentence(&parts.join(", "))
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
            let names: Vec<_> = numbered.iter().map(|&at| quoted(&self.columns[at])).collect();
            return Err(format!(
                "{} do not say which is the scalar; name them qw,qx,qy,qz or qx,qy,qz,qw, {}",
                names.join(", "),
                self.template()
            ));
        }
        let base = usize::from(self.one(&Meaning::Matrix([0, 0]))?.is_none());
        if let Some(rotation) = self.all(|part| Meaning::Matrix([part / 3 + base, part % 3 + base]))? {
            let last_row = self.all(|part| Meaning::Matrix([3 + base, part + base]))?;
            self.use_columns("turn", &rotation, ", a matrix");
            self.used.extend(last_row.iter().flatten());
            return Ok(Some(Turn::Matrix { rotation, last_row }));
        }
        angles.map(|angles| self.angles(angles)).transpose()
    }

    fn angles(&mut self, angles: [usize; 3]) -> Result<Turn, String> {
        let order = self.config.euler_order.as_deref();
        let axes = order.map(euler_axes).transpose()?.unwrap_or_else(|| {
            let names = angles.map(|at| quoted(&self.columns[at]));
            self.asked.push(format!(
                "{} are angles about the file's x, y and z in an order that the file does not say; set \
                 motion.euler_order = \"XYZ\", \"XZY\", \"YXZ\", \"YZX\", \"ZXY\" or \"ZYX\" (axes that move with the jaw), or \
                 the same in small letters (fixed axes)",
                names.join(", ")
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
