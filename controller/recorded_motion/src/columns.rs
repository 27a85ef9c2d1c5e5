//! The meaning of a recording's columns by their names.
//!
//! A name counts in any case and with any signs between its words. A unit is in brackets or at the end.

use super::units::{Quantity, Unit};

/// Words before a coordinate that is a place, a turn about an axis, or a part of a quaternion.
const PLACES: [&str; 11] =
    ["t", "p", "d", "pos", "position", "trans", "translation", "disp", "displacement", "loc", "location"];
const TURNS: [&str; 6] = ["r", "rot", "rotation", "euler", "angle", "ang"];
const QUATERNIONS: [&str; 4] = ["q", "quat", "quaternion", "orientation"];
const MATRICES: [&str; 7] = ["m", "r", "t", "a", "mat", "rot", "matrix"];
/// Whole names.
static WHOLE: [(Meaning, &[&str]); 9] = [
    (Meaning::Time, &["time", "t", "timestamp", "clock", "zeit", "uhrzeit"]),
    (Meaning::Frame, &["frame", "frameno", "framenumber", "sample", "sampleno", "samplenumber", "bild"]),
    (Meaning::Turn(0), &["roll"]),
    (Meaning::Turn(1), &["pitch"]),
    (Meaning::Turn(2), &["yaw"]),
    (Meaning::Quaternion(0), &["q0", "w"]),
    (Meaning::Quaternion(1), &["i"]),
    (Meaning::Quaternion(2), &["j"]),
    (Meaning::Quaternion(3), &["k"]),
];

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
    /// What its unit is of; none for numbers without a unit.
    fn quantity(&self) -> Option<Quantity> {
        match self {
            Self::Time => Some(Quantity::Time),
            Self::Place(_) | Self::Bare(_) | Self::Marker(..) | Self::Matrix(_) => Some(Quantity::Length),
            Self::Turn(_) => Some(Quantity::Angle),
            Self::Frame | Self::Quaternion(_) | Self::Numbered(_) | Self::Unknown => None,
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
            (meaning, Some(unit)) if meaning.quantity() != Some(unit.quantity()) => Meaning::Unknown,
            (meaning, _) => meaning,
        };
        Self { name: name.trim().to_owned(), meaning, unit }
    }
}

pub(super) fn words_and_unit(name: &str) -> (Vec<String>, Option<Unit>) {
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
    if let Some((known, _)) = WHOLE.iter().find(|(_, names)| names.contains(&joined.as_str())) {
        return known.clone();
    }
    let number = joined.trim_start_matches(|c: char| !c.is_ascii_digit());
    let head = &joined[..joined.len() - number.len()];
    let digits: Option<Vec<usize>> =
        number.chars().map(|c| c.to_digit(10).map(|digit| digit as usize)).collect();
    match digits.unwrap_or_default()[..] {
        [part @ 1..=4] if QUATERNIONS.contains(&head) => return Meaning::Numbered(part),
        [row @ 0..=4, column @ 0..=4] if MATRICES.contains(&head) => return Meaning::Matrix([row, column]),
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
        _ if QUATERNIONS.contains(&head) => Meaning::Quaternion(part),
        0 if TURNS.contains(&head) => Meaning::Quaternion(0),
        0 => Meaning::Unknown,
        _ if PLACES.contains(&head) => Meaning::Place(part - 1),
        _ if TURNS.contains(&head) => Meaning::Turn(part - 1),
        _ if name.is_empty() && number.is_empty() => Meaning::Bare(part - 1),
        _ if name.is_empty() => Meaning::Marker(number.to_owned(), part - 1),
        _ => Meaning::Marker(name.to_owned(), part - 1),
    }
}
