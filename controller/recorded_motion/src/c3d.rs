//! The markers of a C3D file, as the text of a table.
//!
//! The format is that of the C3D User Guide (c3d.org, 2008), as Intel processors write it. Points are floats or scaled
//! integers; a point with a negative residual is lost. No number of the file counts beyond the file's bytes. Analog
//! channels are only named.

use std::fmt::Write;

use masseter_scenario::input::{excerpt, sentence};
use masseter_scenario::wording::{counted, listed};

use super::columns::{Column, Meaning};
use super::units::Unit;

/// The second byte of every C3D file.
const KEY: u8 = 0x50;
const BLOCK: usize = 512;
/// The most dimensions of a parameter.
const MOST_DIMENSIONS: usize = 7;
/// Most names that are read of a parameter: more than a file's points.
const MOST_NAMES: usize = u16::MAX as usize;
/// A frame number that stands for a larger one.
const OVERFLOW: u16 = u16::MAX;

/// Why a C3D file cannot be read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(super) enum C3dError {
    #[error("the C3D file is cut short at {0}; copy or export the file again")]
    CutShort(String),
    #[error(
        "the C3D file has the numbers of a {0} processor, which are not read; save the file again for Intel (little-endian) \
         processors, or export the markers as TRC or CSV"
    )]
    Processor(String),
    #[error("the C3D file's parameter section is damaged: {0}; export the file again")]
    Parameters(String),
    #[error("the C3D file holds no {0}; export the markers' trajectories")]
    Empty(&'static str),
    #[error("the C3D file states {0}; correct it in the tracker's program and export again")]
    Contradiction(String),
}

/// Whether these are the bytes of a C3D file, and no text.
pub(super) fn is_c3d(bytes: &[u8]) -> bool {
    bytes.get(1) == Some(&KEY) && bytes.contains(&0)
}

/// The markers of a file.
#[derive(Debug)]
pub(super) struct Markers {
    /// A header, and a row for each frame; the first frame has line 2.
    pub text: String,
    pub first_frame: u64,
    pub protocol: Vec<String>,
}

/// Reads the markers.
pub(super) fn markers(bytes: &[u8]) -> Result<Markers, C3dError> {
    let head = Head::read(bytes)?;
    let parameters = Parameters::read(bytes, head.parameters_at)?;
    let points = usize::from(head.points);
    let [first, last] = frames(&head, &parameters)?;
    let count = (last + 1).checked_sub(first).filter(|count| *count > 0).ok_or(C3dError::Empty("frame"))?;
    let rate_hz = parameters.number("POINT", "RATE").unwrap_or(f64::from(head.rate_hz));
    if !(rate_hz.is_finite() && rate_hz > 0.0) {
        return Err(C3dError::Contradiction(format!("a rate of {rate_hz} frames a second")));
    }
    let scale = parameters.number("POINT", "SCALE").map_or(head.scale, |scale| scale as f32);
    if !(scale.is_finite() && scale != 0.0) {
        return Err(C3dError::Contradiction(format!("a scale of {scale}")));
    }
    let size = if scale < 0.0 { 4 } else { 2 };
    let point_size = 4 * size;
    let analog_size = size * usize::from(head.analog);
    let frame_size = point_size * points + analog_size;
    let data = bytes.get(head.data_at..).unwrap_or_default();
    // The last frame's analog values are not needed. No product is larger than 2^53.
    let needed = (count - 1) * frame_size as u64 + (point_size * points) as u64;
    if needed > data.len() as u64 {
        let frame = first + ((data.len() + analog_size) / frame_size) as u64;
        return Err(C3dError::CutShort(format!("frame {frame} of {first} to {last}")));
    }
    let unit = parameters.texts("POINT", "UNITS").into_iter().next().unwrap_or_default();
    let (names, renamed) = names(&parameters, points);
    let mut text = header(&names, &unit);
    for (index, frame) in data.chunks(frame_size).take(count as usize).enumerate() {
        let _ = write!(text, "\n{}", index as f64 / rate_hz);
        frame.chunks_exact(point_size).take(points).for_each(|point| write_point(&mut text, point, scale));
    }
    let mut protocol = vec![format!(
        "format C3D: {}, frames {first} to {last} at {rate_hz} Hz as lines 2 to {}",
        counted(points as u64, "marker"),
        count + 1
    )];
    protocol.extend(renamed);
    if head.analog > 0 {
        let channels = [parameters.texts("ANALOG", "LABELS"), parameters.texts("ANALOG", "LABELS2")].concat();
        let channels = listed(channels.iter().map(|name| format!("'{}'", excerpt(name))));
        protocol.push(format!("analog channels are not read: {}", sentence(&channels)));
    }
    Ok(Markers { text, first_frame: first, protocol })
}

fn header(names: &[String], unit: &str) -> String {
    let unit =
        if matches!(Unit::of(unit), Some(Unit::Length(_))) { format!("_{unit}") } else { String::new() };
    let columns = names.iter().flat_map(|name| ["x", "y", "z"].map(|axis| format!(",{name}_{axis}{unit}")));
    "time_s".to_owned() + &columns.collect::<String>()
}

/// Three coordinates and the residual, which is negative where the point is lost.
fn write_point(text: &mut String, point: &[u8], scale: f32) {
    let number = |bytes: &[u8]| match *bytes {
        [a, b] => f32::from(i16::from_le_bytes([a, b])) * scale,
        [a, b, c, d] => f32::from_le_bytes([a, b, c, d]),
        _ => f32::NAN,
    };
    let mut numbers = [0.0; 4];
    for (value, bytes) in numbers.iter_mut().zip(point.chunks_exact(point.len() / 4)) {
        *value = number(bytes);
    }
    let [x, y, z, residual] = numbers;
    let is_seen = residual >= 0.0 && [x, y, z].iter().all(|coordinate| coordinate.is_finite());
    // With an exponent no number is long.
    let _ = if is_seen { write!(text, ",{x:e},{y:e},{z:e}") } else { write!(text, ",,,") };
}

/// The first and the last frame.
fn frames(head: &Head, parameters: &Parameters) -> Result<[u64; 2], C3dError> {
    let field = |name| match parameters.numbers("TRIAL", name)[..] {
        [low, high, ..] if [low, high].iter().all(|word| (0.0..=f64::from(u16::MAX)).contains(word)) => {
            Some(low as u64 + ((high as u64) << 16))
        }
        _ => None,
    };
    if head.last_frame == OVERFLOW {
        let ends = field("ACTUAL_START_FIELD").zip(field("ACTUAL_END_FIELD"));
        return ends.map(|(first, last)| [first, last]).ok_or_else(|| {
            C3dError::Contradiction(
                "more than 65534 frames without TRIAL:ACTUAL_START_FIELD and ACTUAL_END_FIELD".to_owned(),
            )
        });
    }
    let [first, last] = [head.first_frame, head.last_frame].map(u64::from);
    let count = (last + 1).saturating_sub(first);
    match parameters.number("POINT", "FRAMES") {
        Some(frames) if frames as u64 != count => {
            Err(C3dError::Contradiction(format!("{count} frames in its header and {frames} in POINT:FRAMES")))
        }
        _ => Ok([first, last]),
    }
}

/// A name for each point, and what was changed.
fn names(parameters: &Parameters, points: usize) -> (Vec<String>, Option<String>) {
    let labels = [parameters.texts("POINT", "LABELS"), parameters.texts("POINT", "LABELS2")].concat();
    let (mut names, mut changed) = (Vec::new(), Vec::new());
    for point in 0..points {
        let label = labels.get(point).filter(|label| !label.is_empty());
        let Some(label) = label else {
            names.push(format!("m{}", point + 1));
            continue;
        };
        let is_plain = |c: char| c.is_ascii_alphanumeric() || ":.-_".contains(c);
        let mut name: String = label.chars().map(|c| if is_plain(c) { c } else { '_' }).collect();
        // A label such as R names a turn in a table.
        if !matches!(Column::of(&format!("{name}_x")).meaning, Meaning::Marker(..)) {
            name.insert(0, 'm');
            changed.push(format!("'{}' is {name}", excerpt(label)));
        }
        names.push(name);
    }
    let changed = sentence(&changed.join(", "));
    (names, (!changed.is_empty()).then(|| format!("markers renamed: {changed}")))
}

/// The first block.
struct Head {
    parameters_at: usize,
    data_at: usize,
    points: u16,
    /// Analog values in a frame.
    analog: u16,
    first_frame: u16,
    last_frame: u16,
    scale: f32,
    rate_hz: f32,
}

impl Head {
    fn read(bytes: &[u8]) -> Result<Self, C3dError> {
        let head = bytes.get(..BLOCK).ok_or_else(|| C3dError::CutShort("its header".to_owned()))?;
        // The third block's fourth byte names the processor, on which all numbers depend.
        let parameters_at = block_at(u16::from(head[0]))
            .ok_or_else(|| C3dError::Parameters("its header names no block for it".to_owned()))?;
        let section = bytes.get(parameters_at..).unwrap_or_default();
        let processor = *section.get(3).ok_or_else(|| C3dError::CutShort("its parameters".to_owned()))?;
        match processor {
            84 => {}
            85 => return Err(C3dError::Processor("DEC".to_owned())),
            86 => return Err(C3dError::Processor("big-endian (SGI/MIPS)".to_owned())),
            other => return Err(C3dError::Processor(format!("unknown ({other})"))),
        }
        let word = |at: usize| u16::from_le_bytes([head[at], head[at + 1]]);
        let float = |at: usize| f32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
        let points = word(2);
        if points == 0 {
            return Err(C3dError::Empty("points"));
        }
        let data_at = block_at(word(16))
            .ok_or_else(|| C3dError::Contradiction("no block where its data begin".to_owned()))?;
        Ok(Self {
            parameters_at,
            data_at,
            points,
            analog: word(4),
            first_frame: word(6),
            last_frame: word(8),
            scale: float(12),
            rate_hz: float(20),
        })
    }
}

/// Blocks count from 1.
fn block_at(number: u16) -> Option<usize> {
    Some(usize::from(number.checked_sub(1)?) * BLOCK)
}

struct Parameter<'a> {
    group: u8,
    name: &'a [u8],
    /// -1 text, 1 bytes, 2 integers, 4 floats.
    kind: i8,
    dimensions: &'a [u8],
    data: &'a [u8],
}

#[derive(Default)]
struct Parameters<'a> {
    groups: Vec<(u8, &'a [u8])>,
    all: Vec<Parameter<'a>>,
}

impl<'a> Parameters<'a> {
    fn read(bytes: &'a [u8], at: usize) -> Result<Self, C3dError> {
        let mut parameters = Self::default();
        let mut rest = bytes.get(at + 4..).unwrap_or_default();
        let damaged = |what: &str, read: &Self| {
            C3dError::Parameters(format!("{what} after {} entries", read.all.len()))
        };
        loop {
            let [length, id, after @ ..] = rest else { return Err(damaged("it has no end", &parameters)) };
            let (length, id) = ((*length as i8).unsigned_abs(), *id as i8);
            if length == 0 {
                return Ok(parameters);
            }
            let entry = after.split_at_checked(usize::from(length));
            let Some((name, [low, high, content @ ..])) = entry else {
                return Err(damaged("a name is cut short", &parameters));
            };
            let offset = usize::from(u16::from_le_bytes([*low, *high]));
            let mut used = 0;
            if id < 0 {
                parameters.groups.push((id.unsigned_abs(), name));
            } else {
                let parameter = Parameter::read(id.unsigned_abs(), name, content)
                    .ok_or_else(|| damaged("a value is cut short", &parameters))?;
                used = 2 + parameter.dimensions.len() + parameter.data.len();
                parameters.all.push(parameter);
            }
            if offset == 0 {
                return Ok(parameters);
            }
            let next =
                offset.checked_sub(2).filter(|next| *next >= used).and_then(|next| content.get(next..));
            rest = next.ok_or_else(|| damaged("a wrong offset", &parameters))?;
        }
    }

    fn find(&self, group: &str, name: &str) -> Option<&Parameter<'a>> {
        let is_named = |found: &[u8], name: &str| found.eq_ignore_ascii_case(name.as_bytes());
        let (id, _) = self.groups.iter().find(|(_, found)| is_named(found, group))?;
        self.all.iter().find(|parameter| parameter.group == *id && is_named(parameter.name, name))
    }

    fn texts(&self, group: &str, name: &str) -> Vec<String> {
        let Some(found) = self.find(group, name).filter(|found| found.kind == -1) else { return Vec::new() };
        let width = found.dimensions.first().map_or(1, |width| usize::from(*width).max(1));
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim_matches([' ', '\0']).to_owned();
        found.data.chunks(width).take(MOST_NAMES).map(text).collect()
    }

    /// Integers have no sign, as counts of frames have none.
    fn numbers(&self, group: &str, name: &str) -> Vec<f64> {
        let Some(found) = self.find(group, name) else { return Vec::new() };
        let (pairs, _) = found.data.as_chunks();
        let (fours, _) = found.data.as_chunks();
        match found.kind {
            2 => pairs.iter().map(|bytes| f64::from(u16::from_le_bytes(*bytes))).collect(),
            4 => fours.iter().map(|bytes| f64::from(f32::from_le_bytes(*bytes))).collect(),
            _ => Vec::new(),
        }
    }

    fn number(&self, group: &str, name: &str) -> Option<f64> {
        self.numbers(group, name).first().copied()
    }
}

impl<'a> Parameter<'a> {
    fn read(group: u8, name: &'a [u8], content: &'a [u8]) -> Option<Self> {
        let [kind, count, rest @ ..] = content else { return None };
        let (kind, count) = (*kind as i8, usize::from(*count));
        if count > MOST_DIMENSIONS {
            return None;
        }
        let (dimensions, rest) = rest.split_at_checked(count)?;
        let size = usize::from(kind.unsigned_abs());
        let size =
            dimensions.iter().try_fold(size, |size, dimension| size.checked_mul(usize::from(*dimension)))?;
        Some(Self { group, name, kind, dimensions, data: rest.get(..size)? })
    }
}

#[cfg(test)]
pub(super) mod tests;
