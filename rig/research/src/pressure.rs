//! The pressure between the jaws as a drawing: the lower arch from above when the teeth bear most.

use masseter_analysis::{ContactFigures, Figures, ToothFigures};
use masseter_charts::{Axis, ColourScale, Disc, Error, Scale, chart, discs, svg};

/// Width of a picture, px.
const WIDTH: u32 = 960;
/// Width of the bar of colours, px.
const BAR: u32 = 110;
/// Height of the arch's picture, px.
const ARCH: u32 = 460;
/// Room for axes and margins beside a plot, px: across, and up.
const AROUND: [f64; 2] = [94.0, 62.0];
/// Room around the teeth, mm.
const ROOM_MM: f64 = 7.0;
/// Radius of the tooth that bears most, and least radius, px.
const RADII: [f64; 2] = [18.0, 4.0];
/// Between a disc and its text, px.
const GAP: f64 = 6.0;
/// What counts as no force, N.
const NONE_N: f64 = 0.05;

/// A drawing and the words to it.
#[derive(Debug)]
pub(super) struct Pressure {
    /// What the arch shows.
    pub(super) caption: String,
    /// The arch.
    pub(super) arch: String,
}

impl Pressure {
    /// None where the jaws cannot touch.
    pub(super) fn draw(figures: &Figures) -> Option<Self> {
        let contact = figures.contact.as_ref()?;
        let most_n = contact.teeth.iter().fold(0.0, |most_n: f64, tooth| most_n.max(tooth.max_n));
        let scale = ColourScale::new("force, N", [0.0, most_n]);
        Some(Self { caption: caption(figures, contact), arch: arch(contact, &scale).ok()? })
    }
}

fn caption(figures: &Figures, contact: &ContactFigures) -> String {
    if contact.total_max_n < NONE_N {
        return "Nothing pressed on a tooth.".to_owned();
    }
    let at_s = contact.total_max_at_ns.saturating_sub(figures.over_time.began_ns) as f64 / 1e9;
    format!(
        "The arch from above at {at_s:.3} s, when all teeth together bear most: {:.1} N. The area of a disc is the force.",
        contact.total_max_n
    )
}

fn arch(contact: &ContactFigures, scale: &ColourScale) -> Result<String, Error> {
    let teeth = &contact.teeth;
    let [x, y] = ends_mm(teeth);
    let middle = (f64::midpoint(x[0], x[1]), f64::midpoint(y[0], y[1]));
    let at = |tooth: &ToothFigures| (-tooth.place_m[1] * 1e3, tooth.place_m[0] * 1e3);
    let most_n = teeth.iter().map(load_n).fold(NONE_N, f64::max);
    let disc = |tooth: &ToothFigures| {
        let load_n = load_n(tooth);
        let radius = (RADII[0] * (load_n / most_n).sqrt()).max(RADII[1]);
        let outwards = (at(tooth).0 - middle.0, at(tooth).1 - middle.1);
        let px_a_mm = (radius + GAP) / outwards.0.hypot(outwards.1).max(1e-9);
        let is_loaded = load_n >= NONE_N;
        let force = if is_loaded { format!(": {load_n:.1} N") } else { String::new() };
        Disc {
            at: at(tooth),
            radius: radius as u32,
            colour: is_loaded.then(|| scale.colour(load_n)),
            text: format!("{}{force}", tooth.number),
            beside: [outwards.0 * px_a_mm, -outwards.1 * px_a_mm].map(|px| px as i32),
        }
    };
    svg((WIDTH, ARCH), |area| {
        let (plot, bar) = area.split_horizontally(WIDTH - BAR);
        let x = Axis::new("left  ←  mm  →  right", Scale::Linear, x);
        let y = Axis::new("forward, mm", Scale::Linear, y);
        let mut chart = chart(&plot, "", x, y)?;
        discs(&mut chart, &teeth.iter().map(disc).collect::<Vec<_>>())?;
        scale.draw(&bar)
    })
}

/// The force on a tooth when all bear most, N.
fn load_n(tooth: &ToothFigures) -> f64 {
    tooth.at_total_max_n.iter().map(|force_n| force_n * force_n).sum::<f64>().sqrt()
}

/// Ends of both axes around all teeth, across and up, with one scale for both, mm.
fn ends_mm(teeth: &[ToothFigures]) -> [[f64; 2]; 2] {
    let extent = |axis: usize, sign: f64| {
        let values = teeth.iter().map(|tooth| sign * tooth.place_m[axis] * 1e3);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], mm| [low.min(mm), high.max(mm)])
    };
    let extents = [extent(1, -1.0), extent(0, 1.0)];
    let pixels = [f64::from(WIDTH - BAR) - AROUND[0], f64::from(ARCH) - AROUND[1]];
    let mm_a_pixel =
        extents.iter().zip(pixels).map(|([low, high], pixels)| (high - low + 2.0 * ROOM_MM) / pixels);
    let mm_a_pixel = mm_a_pixel.fold(0.0, f64::max);
    let around = |[low, high]: [f64; 2], pixels: f64| {
        let (middle, half) = (f64::midpoint(low, high), mm_a_pixel * pixels / 2.0);
        [middle - half, middle + half]
    };
    [around(extents[0], pixels[0]), around(extents[1], pixels[1])]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tooth(number: u32, y_m: f64, load_n: f64) -> ToothFigures {
        ToothFigures {
            number,
            place_m: [0.01, y_m, 0.0],
            max_n: load_n,
            at_total_max_n: [0.0, 0.0, -load_n],
            course_n: Vec::new(),
        }
    }

    fn contact() -> ContactFigures {
        let teeth = vec![tooth(36, 0.025, 40.0), tooth(46, -0.025, 0.0)];
        ContactFigures { total_max_n: 40.0, total_max_at_ns: 0, teeth, moments: Vec::new() }
    }

    #[test]
    fn the_arch_names_every_tooth_and_the_force_on_those_that_bear() {
        let drawn = arch(&contact(), &ColourScale::new("force, N", [0.0, 40.0])).unwrap();
        assert!(drawn.contains("\n36: 40.0 N\n") && drawn.contains("\n46\n"), "{drawn}");
        assert!(drawn.contains("force, N"));
    }

    #[test]
    fn a_millimetre_is_as_long_across_as_up() {
        let [across, up] = ends_mm(&contact().teeth);
        let pixels = [f64::from(WIDTH - BAR) - AROUND[0], f64::from(ARCH) - AROUND[1]];
        assert!(((across[1] - across[0]) / pixels[0] - (up[1] - up[0]) / pixels[1]).abs() < 1e-9);
        assert!(across[0] <= -25.0 - ROOM_MM && across[1] >= 25.0 + ROOM_MM, "{across:?}");
    }
}
