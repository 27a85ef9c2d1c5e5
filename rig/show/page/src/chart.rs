//! A chart: its axes, curves and limits, the points of its curves, and what happened when. All times are seconds since the
//! run's first SYNC.

use data_encoding::BASE64;
use serde::{Serialize, Serializer};

/// What is drawn from left to right.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Across {
    /// Seconds since the first SYNC. Charts over time share cursor and zoom.
    Time,
    /// 1/(1 − quantile), by its logarithm, labelled as percentiles.
    Percentile,
    /// Ends of buckets of durations, µs, by their logarithm: curves are stairs.
    Duration,
    /// Another quantity.
    Quantity {
        /// What it is, with its unit.
        label: String,
        /// How it is spaced.
        scale: Scale,
    },
}

/// How values are spaced along an axis.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// Evenly.
    Linear,
    /// By their logarithm.
    Log,
    /// Names: the first at 0, the next at 1.
    Names(Vec<String>),
}

/// How a curve looks, by what it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Style {
    /// One of several alike, in the palette's colour.
    Plain,
    /// Wide and pale, below the others.
    Desired,
    /// A solid line.
    True,
    /// Thin and dashed, above the others.
    Estimated,
    /// Thin and pale.
    Raw,
    /// Above its raw values, in their colour.
    Smoothed,
    /// Points one by one. The cursor shows the nearest of all.
    Dots,
    /// Bars from nothing on, evenly apart. The cursor shows the nearest of all.
    Bars,
}

/// A curve.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Series {
    /// The name in the legend, unique in its chart.
    pub name: String,
    /// How it looks.
    pub style: Style,
    /// Whether its name must be clicked first.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub is_hidden: bool,
    /// A place in the palette, from 0. Without one, a plain curve takes the next and the others that of their style.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub colour: Option<usize>,
    /// Where it goes.
    pub points: Points,
    /// Of dots and bars: what each point is.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub names: Vec<String>,
    /// Of dots: the file beside the page that a click opens.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub links: Vec<String>,
}

/// A dot.
#[derive(Debug, Clone, PartialEq)]
pub struct Dot {
    /// Where it lies.
    pub at: (f64, f64),
    /// What it is.
    pub name: String,
    /// The file beside the page that a click opens.
    pub link: String,
}

impl Series {
    /// In the colour of its style.
    #[must_use]
    pub fn new(name: impl Into<String>, style: Style, points: Points) -> Self {
        let (names, links) = (Vec::new(), Vec::new());
        Self { name: name.into(), style, is_hidden: false, colour: None, points, names, links }
    }

    /// Named dots, each with a file.
    #[must_use]
    pub fn dots(name: impl Into<String>, dots: impl IntoIterator<Item = Dot>) -> Self {
        let finite = dots.into_iter().filter(|dot| dot.at.0.is_finite() && dot.at.1.abs() < LARGEST);
        let (points, (names, links)): (Vec<_>, (Vec<_>, Vec<_>)) =
            finite.map(|dot| (dot.at, (dot.name, dot.link))).unzip();
        Self { names, links, ..Self::new(name, Style::Dots, Points::plain(&points)) }
    }

    /// Named bars.
    #[must_use]
    pub fn bars(name: impl Into<String>, bars: impl IntoIterator<Item = ((f64, f64), String)>) -> Self {
        let (points, names): (Vec<_>, _) = bars.into_iter().unzip();
        Self { names, ..Self::new(name, Style::Bars, Points::plain(&points)) }
    }

    /// In a colour of the palette.
    #[must_use]
    pub fn coloured(self, colour: usize) -> Self {
        Self { colour: Some(colour), ..self }
    }
}

/// What a level is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LevelKind {
    /// It must not be passed.
    Limit,
    /// It was found, such as the rms of a curve.
    Found,
}

/// Levels over the whole width. A level far from all curves stands in words below the chart.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Limit {
    /// What it is.
    pub name: String,
    /// Whether it bounds or was found.
    pub kind: LevelKind,
    /// In the chart's unit.
    pub values: Vec<f64>,
}

/// A chart.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Chart {
    /// What the values are.
    pub title: String,
    /// Their unit; may be empty.
    pub unit: String,
    /// From left to right.
    pub across: Across,
    /// From bottom to top.
    pub scale: Scale,
    /// The first is drawn first.
    pub series: Vec<Series>,
    /// Levels over the whole width.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub limits: Vec<Limit>,
    /// Whether the stretches in which the first curve has points are shaded: they were judged.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub is_shaded: bool,
    /// Moments of this chart alone, beside those of the page.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub moments: Vec<Moment>,
    /// Height of the plot, px.
    pub height: u32,
    /// Why there may be no point.
    pub otherwise: String,
}

impl Chart {
    /// Whether it shares cursor and zoom with the other charts over time.
    pub fn is_over_time(&self) -> bool {
        self.across == Across::Time
    }

    /// Over time, without curves yet.
    #[must_use]
    pub fn over_time(title: impl Into<String>, unit: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            unit: unit.into(),
            across: Across::Time,
            scale: Scale::Linear,
            series: Vec::new(),
            limits: Vec::new(),
            is_shaded: false,
            moments: Vec::new(),
            height: 190,
            otherwise: "No value was recorded.".to_owned(),
        }
    }
}

/// Resolution of times, s.
const TIME_STEP_S: f64 = 1e-6;
/// Steps of a packed value from the lowest to the highest.
const VALUE_STEPS: f64 = 1_048_576.0;
/// Beyond this, values are so far apart that their difference may be no number.
const LARGEST: f64 = 1e300;

/// The points of a curve in the order of x. What is no finite number is left out.
///
/// Packed, they are whole numbers of steps, each as the difference from the one before. A difference is zigzag-coded (0, −1, 1,
/// −2 …) and written in bytes of seven bits, the lowest first, the eighth bit set where more follow. The bytes are in Base64.
#[derive(Debug, Clone, PartialEq)]
pub struct Points {
    points: Vec<(f64, f64)>,
    is_packed: bool,
}

/// Points as the page reads them.
#[derive(Serialize)]
#[serde(untagged)]
enum Written {
    /// One list of x, y, x, y …
    Plain(Vec<f64>),
    Packed {
        packed: String,
        x_step: f64,
        y_step: f64,
        /// What y counts from.
        y_from: f64,
    },
}

impl Points {
    /// Values by seconds, written to the microsecond and a millionth of their range.
    #[must_use]
    pub fn over_time(points: &[(f64, f64)]) -> Self {
        Self { is_packed: true, ..Self::plain(points) }
    }

    /// Points that are written as they are, for short curves of any two quantities.
    #[must_use]
    pub fn plain(points: &[(f64, f64)]) -> Self {
        let is_finite = |(x, y): &&(f64, f64)| x.is_finite() && y.abs() < LARGEST;
        Self { points: points.iter().filter(is_finite).copied().collect(), is_packed: false }
    }

    /// The points, x and y.
    pub fn iter(&self) -> impl Iterator<Item = (f64, f64)> {
        self.points.iter().copied()
    }

    fn packed(&self) -> Written {
        let outside = [f64::INFINITY, f64::NEG_INFINITY];
        let [low, high] = self.iter().fold(outside, |[low, high], (_, y)| [low.min(y), high.max(y)]);
        let y_step = if high > low { (high - low) / VALUE_STEPS } else { 1.0 };
        let y_from = if low.is_finite() { low } else { 0.0 };
        let (mut bytes, mut before) = (Vec::new(), [0_i64; 2]);
        for (at_s, value) in self.iter() {
            let steps = [at_s / TIME_STEP_S, (value - y_from) / y_step].map(|steps| steps.round() as i64);
            for (now, before) in steps.iter().zip(&before) {
                push(&mut bytes, now - before);
            }
            before = steps;
        }
        Written::Packed { packed: BASE64.encode(&bytes), x_step: TIME_STEP_S, y_step, y_from }
    }
}

impl Serialize for Points {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let written = if self.is_packed {
            self.packed()
        } else {
            Written::Plain(self.iter().flat_map(|(x, y)| [x, y]).collect())
        };
        written.serialize(serializer)
    }
}

/// A difference in bytes of seven bits.
fn push(bytes: &mut Vec<u8>, difference: i64) {
    let mut rest = ((difference << 1) ^ (difference >> 63)) as u64;
    while rest >= 0x80 {
        bytes.push(rest as u8 | 0x80);
        rest >>= 7;
    }
    bytes.push(rest as u8);
}

/// How the page shows times: since the motion began, by cycle, or by the clock on the wall.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Time {
    /// When the motion began; none where it did not.
    pub motion_s: Option<f64>,
    /// When the last value came.
    pub end_s: f64,
    /// Period of the cycle, s.
    pub period_s: f64,
    /// The first SYNC on the wall's clock, s since 1970-01-01 00:00 UTC; none in simulated time.
    pub wall_s: Option<f64>,
}

impl Default for Time {
    fn default() -> Self {
        Self { motion_s: None, end_s: 0.0, period_s: 1e-3, wall_s: None }
    }
}

/// What a moment is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MomentKind {
    /// A fault of the scenario strikes.
    Fault,
    /// The rig notices a fault and begins a safe stop.
    Detection,
    /// Anything else.
    Note,
}

/// A moment that charts mark.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Moment {
    /// When.
    pub at_s: f64,
    /// What it is.
    pub kind: MomentKind,
    /// A word or two for the charts.
    pub name: String,
    /// A sentence.
    pub text: String,
}

/// A stretch of time in which the controller was in one state.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Phase {
    /// Its beginning.
    pub from_s: f64,
    /// Its end.
    pub to_s: f64,
    /// The state's name.
    pub name: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unpacked(points: &Points) -> Vec<(f64, f64)> {
        let Written::Packed { packed, x_step, y_step, y_from } = points.packed() else {
            panic!("not packed")
        };
        let (mut numbers, mut number, mut shift) = (Vec::new(), 0_u64, 0);
        for byte in BASE64.decode(packed.as_bytes()).unwrap() {
            number |= u64::from(byte & 0x7f) << shift;
            shift += 7;
            if byte & 0x80 == 0 {
                numbers.push((number >> 1) as i64 ^ -((number & 1) as i64));
                (number, shift) = (0, 0);
            }
        }
        let (mut x, mut y) = (0, 0);
        let pair = |pair: &[i64]| {
            (x, y) = (x + pair[0], y + pair[1]);
            (x as f64 * x_step, y_from + y as f64 * y_step)
        };
        numbers.chunks(2).map(pair).collect()
    }

    #[test]
    fn packed_points_are_those_of_the_curve_to_a_millionth_of_its_range() {
        let curve: Vec<_> =
            (0..5000).map(|i| (f64::from(i) * 1e-3, -40.0 + (f64::from(i) * 0.01).sin())).collect();
        let points = Points::over_time(&curve);
        for ((at_s, value), (at_found_s, found)) in curve.iter().zip(unpacked(&points)) {
            assert!((at_s - at_found_s).abs() < 1e-6 && (value - found).abs() < 2e-6, "{value}: {found}");
        }
        let Written::Packed { packed, .. } = points.packed() else { panic!("not packed") };
        assert!(packed.len() < 7 * curve.len(), "{} characters", packed.len());
    }

    #[test]
    fn a_curve_without_height_keeps_its_value_and_what_is_no_number_is_left_out() {
        assert_eq!(
            unpacked(&Points::over_time(&[(0.0, 2.5), (1.0, f64::NAN), (2.0, 2.5)])),
            [(0.0, 2.5), (2.0, 2.5)]
        );
        let plain = Points::plain(&[(1.0, 2.0), (f64::INFINITY, 3.0)]);
        assert_eq!(serde_json::to_string(&plain).unwrap(), "[1.0,2.0]");
        assert_eq!(unpacked(&Points::over_time(&[])), []);
        let far = [(0.0, 1e17), (1.0, 1e17 + 1e3), (2.0, 1e301)];
        assert_eq!(unpacked(&Points::over_time(&far)), far[..2]);
    }
}
