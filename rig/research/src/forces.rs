//! Forces in the paper study: friction under load while the jaw chews, controlled bites on three foods, and the
//! pressure between the jaws. All of them come from runs of the emulated rig under virtual time.

use std::path::Path;

use anyhow::Context;
use masseter_analysis::{Analysis, ContactFigures, Curve, Figures, ToothFigures};
use masseter_charts::{
    Axis, ColourScale, Disc, Error, Key, LegendEntry, Line, LineChart, Scale, SeriesLabelPosition, chart,
    discs, legend, palette, svg,
};
use masseter_controller::motion_controller::MotionController;
use masseter_model::geometry::{AXES, AXIS_NAMES, LEGS};
use masseter_plan::RunPlan;
use masseter_recording::Manifest;
use masseter_runtime::messages::codes::ControllerState;
use masseter_scenario::Scenario;
use masseter_virtual_time::Requests;

use crate::evidence::{ClaimJudgement, PaperClaim};

/// What runs of the emulated rig say of forces: claims after those of the study, and figures.
#[derive(Debug)]
pub(crate) struct Forces {
    pub claims: Vec<PaperClaim>,
    /// In the order of the page.
    pub figures: Vec<ForceFigure>,
}

/// A figure of a run.
#[derive(Debug)]
pub(crate) struct ForceFigure {
    /// Name of its file, without the extension.
    pub name: &'static str,
    pub svg: String,
    /// What it shows.
    pub caption: String,
}

/// Encoders without noise, whose share of the forces would hide that of friction.
const CHEWING: &str = "duration_s = 4.0
[motion]
kind = 'chewing'
cycle_rate_hz = 1.43
[drives]
slide = { encoder_noise_m = 0.0, encoder_resolution_m = 1e-9 }
leg = { encoder_noise_m = 0.0, encoder_resolution_m = 1e-9 }
";
const CYCLE_S: f64 = 1.0 / 1.43;
/// The chewing motion with less and less friction: name, and what the scenario has beside the motion.
const FRICTIONS: [(&str, &str); 3] = [
    ("all friction", ""),
    ("friction under load alone", "[dynamics]\nslide_friction_n = 0.0\nviscous_friction_n_s_per_m = 0.0\n"),
    ("no friction", "[dynamics.friction]\nmodel = 'none'\n"),
];
/// Share of the force without friction above which friction matters.
const MATTERS: f64 = 0.1;

const BITES: [(&str, &str); 3] = [
    ("soft food", include_str!("../../../examples/suite/bite_soft.toml")),
    ("gum", include_str!("../../../examples/suite/bite_gum.toml")),
    ("peanut", include_str!("../../../examples/suite/bite_peanut.toml")),
];
const DESIRED: &str = "desired_bite_force_n";
const ESTIMATED: &str = "bite_force_n";
/// Shown before and after a bite, s.
const AROUND_S: f64 = 0.1;

/// The jaws, pressed together by the controller.
const PRESSED: &str = include_str!("../../../examples/suite/pressed_teeth.toml");
/// Largest difference between the forces of the teeth and the bite force, as a share.
const BALANCED: f64 = 0.05;

/// Width of the picture of the lower arch, px.
const ARCH_WIDTH: u32 = 960;
/// Width of the bar of colours, px.
const ARCH_BAR: u32 = 110;
/// Height of the picture of the lower arch, px.
const ARCH_HEIGHT: u32 = 460;
/// Room for axes and margins beside a plot, px: across, and up.
const AROUND_ARCH: [f64; 2] = [94.0, 62.0];
/// Room around the teeth, mm.
const ROOM_MM: f64 = 7.0;
/// Radius of the tooth that bears most, and least radius, px.
const RADII: [f64; 2] = [18.0, 4.0];
/// Between a disc and its text, px.
const GAP: f64 = 6.0;
/// What counts as no force, N.
const NONE_N: f64 = 0.05;

/// Plays the runs.
pub(crate) fn play() -> anyhow::Result<Forces> {
    let chewing =
        FRICTIONS.iter().map(|(_, friction)| cycle_forces(&run(&format!("{CHEWING}{friction}"))?.1));
    let chewing = chewing.collect::<anyhow::Result<Vec<_>>>()?;
    let bites = BITES.iter().map(|(food, text)| Ok((*food, bite(&run(text)?)?)));
    let bites = bites.collect::<anyhow::Result<Vec<_>>>()?;
    let (_, pressed) = run(PRESSED)?;
    let (friction, caption) = friction_claim(&chewing);
    let (jaws, pressure) = pressure_claim(&pressed)?;
    let figure = |name, svg, caption| ForceFigure { name, svg, caption };
    let drawn = "cannot draw the forces";
    Ok(Forces {
        claims: vec![friction, jaws],
        figures: vec![
            figure("forces", forces_svg(&chewing).context(drawn)?, caption),
            figure("bites", bites_svg(&bites).context(drawn)?, BITES_CAPTION.to_owned()),
            pressure,
        ],
    })
}

/// Nothing asks a run to end: an interrupt ends the whole program.
struct Uninterrupted;

impl Requests for Uninterrupted {
    fn is_stop_requested(&self) -> bool {
        false
    }

    fn is_abort_requested(&self) -> bool {
        false
    }
}

/// Plays a scenario under virtual time without a recording.
fn run(scenario: &str) -> anyhow::Result<(Manifest, Figures)> {
    let plan = RunPlan::new(Scenario::parse(Path::new("study.toml"), scenario)?)?;
    let motion_s = plan.trajectory.duration_s();
    let (version, machine) = (env!("CARGO_PKG_VERSION"), masseter_machine::describe());
    let mut manifest = Manifest::new(version, plan.scenario.clone(), motion_s, "virtual", machine);
    let figures = masseter_virtual_time::analyse(
        &plan,
        |scenario, mechanism, motion| Box::new(MotionController::new(scenario, mechanism, motion)),
        Analysis::new,
        &mut manifest,
        &Uninterrupted,
    )?;
    Ok((manifest, figures))
}

/// Force of each axis in the second cycle of the motion, N over s.
type CycleForces = [Curve; AXES];

fn cycle_forces(figures: &Figures) -> anyhow::Result<CycleForces> {
    let running = ControllerState::Running.name();
    let mut begins =
        figures.events.iter().filter(|event| matches!(&event.transition, Some([_, to]) if to == running));
    let began_ns = begins.next().context("the motion of a run has not begun")?.time_ns;
    let from_s = (began_ns - figures.over_time.began_ns) as f64 / 1e9 + CYCLE_S;
    Ok(figures.over_time.force_n.each_ref().map(|curve| cut(curve, from_s, from_s + CYCLE_S, from_s)))
}

/// The part of a curve between two times, which counts from a third.
fn cut(curve: &Curve, from_s: f64, to_s: f64, zero_s: f64) -> Curve {
    let inside = curve.iter().filter(|(at_s, _)| (from_s..=to_s).contains(at_s));
    inside.map(|(at_s, value)| (at_s - zero_s, *value)).collect()
}

fn rms(curves: &[Curve]) -> f64 {
    let squares = curves.iter().flatten().map(|(_, value)| value * value);
    (squares.sum::<f64>() / curves.iter().map(Vec::len).sum::<usize>() as f64).sqrt()
}

fn friction_claim(chewing: &[CycleForces]) -> (PaperClaim, String) {
    let of = |axes: std::ops::Range<usize>| {
        let values: Vec<_> = chewing.iter().map(|forces| rms(&forces[axes.clone()])).collect();
        [values[0], values[1], values[2]]
    };
    let [slides, legs] = [of(0..LEGS), of(LEGS..AXES)];
    let [of_slides, of_legs] = [slides, legs].map(|[all, load, none]| {
        format!("{none:.2} N without friction, {load:.2} N with friction under load alone, {all:.2} N with all of it")
    });
    let adds = |share_of: f64| share_of / slides[2] - 1.0 > MATTERS;
    let claim = PaperClaim {
        statement: "Friction comes from the total weight of platform and legs.",
        section: "On friction",
        measured: format!("rms force while chewing at 1.43 Hz — slides: {of_slides}; legs: {of_legs}"),
        criterion: "holds if friction under load alone adds a tenth to the force of the slides; partly if only all of it does",
        judgement: ClaimJudgement::new(adds(slides[1]), adds(slides[0])),
        figure: Some("forces"),
    };
    let caption = "Forces of the six drives in one chewing cycle at 1.43 Hz, with encoders without noise. Friction under load is that of guides, screws and joints; seals and \
                   viscous friction come on top. Each drive of a leg carries a third of the weight."
        .to_owned();
    (claim, caption)
}

fn forces_svg(chewing: &[CycleForces]) -> Result<String, Error> {
    let span = |axes: std::ops::Range<usize>| {
        let points = chewing.iter().flat_map(|forces| forces[axes.clone()].iter().flatten());
        let [low, high] = extent(points.map(|point| point.1));
        let room = 0.08 * (high - low);
        [low - room, high + room]
    };
    let spans = [span(0..LEGS), span(LEGS..AXES)];
    let colours = [palette::BLUE, palette::VERMILION, palette::GREEN];
    let entry =
        |((name, _), colour): ((&str, _), _)| LegendEntry { name: name.to_owned(), colour, key: Key::Line };
    let entries: Vec<_> = FRICTIONS.into_iter().zip(colours).map(entry).collect();
    svg((1140, 640), |area| {
        let (top, panels) = area.split_vertically(36);
        legend(&top, &entries, entries.len())?;
        for (axis, panel) in panels.split_evenly((2, LEGS)).iter().enumerate() {
            let title = format!("{} {}", if axis < LEGS { "slide" } else { "leg" }, AXIS_NAMES[axis]);
            let x = Axis::new("time in the cycle, s", Scale::Linear, [0.0, CYCLE_S]);
            let y = Axis::new("force, N", Scale::Linear, spans[axis / LEGS]);
            let line =
                |(forces, colour): (&CycleForces, _)| Line::new("", forces[axis].clone()).coloured(colour);
            let lines = chewing.iter().zip(colours).map(line).collect();
            LineChart { title, x, y, lines, legend: SeriesLabelPosition::UpperRight }.draw_on(panel)?;
        }
        Ok(())
    })
}

const BITES_CAPTION: &str = "The second controlled bite on each food: the desired force is half a sine from the force of contact on. \
                             The jaw meets gum and peanut at the speed of the motion, so that the force rises above that of contact at \
                             first. After the bite the jaw waits until the motion opens.";

/// The second bite of a run: desired, true and estimated force, N over s since the contact.
fn bite((manifest, figures): &(Manifest, Figures)) -> anyhow::Result<[Curve; 3]> {
    let over_time = &figures.over_time;
    let signal = |name: &str| {
        let place = manifest.declared.signals.iter().position(|signal| signal.name == name);
        place.map(|place| &over_time.signals[place]).with_context(|| format!("a run has no signal {name}"))
    };
    let (desired, estimated) = (signal(DESIRED)?, signal(ESTIMATED)?);
    let is_bite = |point: &(f64, f64)| point.1 > 0.0;
    let starts = desired.windows(2).filter(|pair| !is_bite(&pair[0]) && is_bite(&pair[1]));
    let from_s = starts.map(|pair| pair[1].0).nth(1).context("a run has no second bite")?;
    let after = desired.iter().find(|point| point.0 > from_s && !is_bite(point));
    let to_s = after.context("a run ends within a bite")?.0;
    let curves = [desired, &over_time.bite_force_n, estimated];
    Ok(curves.map(|curve| cut(curve, from_s - AROUND_S, to_s + AROUND_S, from_s)))
}

fn bites_svg(bites: &[(&str, [Curve; 3])]) -> Result<String, Error> {
    svg((1140, 380), |area| {
        for ((food, curves), panel) in bites.iter().zip(area.split_evenly((1, bites.len()))) {
            let [desired, bitten, estimated] = curves.clone();
            let title = (*food).to_owned();
            let x = Axis::new("time since the contact, s", Scale::Linear, [-AROUND_S, 0.6]);
            let y = Axis::new("bite force, N", Scale::Linear, [-3.0, 85.0]);
            let lines = vec![
                Line::new("desired", desired).coloured(palette::GREY).wide(),
                Line::new("estimated", estimated).coloured(palette::VERMILION),
                Line::new("true", bitten).coloured(palette::BLUE),
            ];
            LineChart { title, x, y, lines, legend: SeriesLabelPosition::UpperRight }.draw_on(&panel)?;
        }
        Ok(())
    })
}

fn pressure_claim(figures: &Figures) -> anyhow::Result<(PaperClaim, ForceFigure)> {
    let contact = figures.contact.as_ref().context("the jaws have not touched")?;
    let bite_n = figures.bite_force_max_n.context("the jaws have not bitten")?;
    let loads_n = contact.teeth.iter().map(|tooth| (tooth.number, tooth.max_n));
    let (tooth, most_n) = loads_n.max_by(|a, b| a.1.total_cmp(&b.1)).context("the jaw has no teeth")?;
    let claim = PaperClaim {
        statement: "The robot reproduces the pressure between the jaws.",
        section: "On the jaws",
        measured: format!(
            "{} lower teeth together bear {:.1} N at the peak of a bite that is controlled to 60 N; most, {most_n:.1} N, \
             tooth {tooth}; the bite force is {bite_n:.1} N",
            contact.teeth.len(),
            contact.total_max_n
        ),
        criterion: "holds if the teeth together bear the bite force within 5 %; friction between them is the rest",
        judgement: ClaimJudgement::new((contact.total_max_n / bite_n - 1.0).abs() < BALANCED, false),
        figure: Some("pressure"),
    };
    let svg = arch_svg(contact, &ColourScale::new("force, N", [0.0, most_n]))
        .context("cannot draw the pressure")?;
    let caption = pressure_caption(figures, contact);
    Ok((claim, ForceFigure { name: "pressure", svg, caption }))
}

/// Least and greatest of some values.
fn extent(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
}

fn pressure_caption(figures: &Figures, contact: &ContactFigures) -> String {
    if contact.total_max_n < NONE_N {
        return "Nothing pressed on a tooth.".to_owned();
    }
    let at_s = contact.total_max_at_ns.saturating_sub(figures.over_time.began_ns) as f64 / 1e9;
    format!(
        "The arch from above at {at_s:.3} s, when all teeth together bear most: {:.1} N. The area of a disc is the force.",
        contact.total_max_n
    )
}

fn arch_svg(contact: &ContactFigures, scale: &ColourScale) -> Result<String, Error> {
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
    svg((ARCH_WIDTH, ARCH_HEIGHT), |area| {
        let (plot, bar) = area.split_horizontally(ARCH_WIDTH - ARCH_BAR);
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
    let extents = [(1, -1.0), (0, 1.0)]
        .map(|(axis, sign)| extent(teeth.iter().map(|tooth| sign * tooth.place_m[axis] * 1e3)));
    let pixels = [f64::from(ARCH_WIDTH - ARCH_BAR) - AROUND_ARCH[0], f64::from(ARCH_HEIGHT) - AROUND_ARCH[1]];
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
        let drawn = arch_svg(&contact(), &ColourScale::new("force, N", [0.0, 40.0])).unwrap();
        assert!(drawn.contains("\n36: 40.0 N\n") && drawn.contains("\n46\n"), "{drawn}");
        assert!(drawn.contains("force, N"));
    }

    #[test]
    fn a_millimetre_is_as_long_across_as_up() {
        let [across, up] = ends_mm(&contact().teeth);
        let pixels =
            [f64::from(ARCH_WIDTH - ARCH_BAR) - AROUND_ARCH[0], f64::from(ARCH_HEIGHT) - AROUND_ARCH[1]];
        assert!(((across[1] - across[0]) / pixels[0] - (up[1] - up[0]) / pixels[1]).abs() < 1e-9);
        assert!(across[0] <= -25.0 - ROOM_MM && across[1] >= 25.0 + ROOM_MM, "{across:?}");
    }
}
