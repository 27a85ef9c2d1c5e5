//! Forces in the paper study: friction under load while the jaw chews, controlled bites on three foods, and the pressure
//! between the jaws. All of them come from runs of the emulated rig under virtual time.

use std::path::Path;

use anyhow::Context;
use masseter_analysis::{Analysis, Curve, Figures};
use masseter_charts::{
    Axis, Error, Key, LegendEntry, Line, LineChart, Scale, SeriesLabelPosition, legend, palette, svg,
};
use masseter_controller::motion_controller::MotionController;
use masseter_model::geometry::{AXES, AXIS_NAMES, LEGS};
use masseter_plan::RunPlan;
use masseter_recording::Manifest;
use masseter_runtime::messages::codes::ControllerState;
use masseter_scenario::Scenario;
use masseter_virtual_time::Requests;

use crate::claims::{ClaimJudgement, PaperClaim};
use crate::pressure::Pressure;

/// What runs of the emulated rig say of forces: claims after those of the study, and figures.
#[derive(Debug)]
pub(super) struct Forces {
    pub claims: Vec<PaperClaim>,
    /// In the order of the page.
    pub figures: Vec<ForceFigure>,
}

/// A figure of a run.
#[derive(Debug)]
pub(super) struct ForceFigure {
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

/// Plays the runs.
pub(super) fn play() -> anyhow::Result<Forces> {
    let mut chewing = Vec::new();
    for (_, friction) in FRICTIONS {
        chewing.push(cycle_forces(&run(&format!("{CHEWING}{friction}"))?.1)?);
    }
    let mut bites = Vec::new();
    for (food, text) in BITES {
        bites.push((food, bite(&run(text)?)?));
    }
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
    let mut manifest = Manifest::new(
        env!("CARGO_PKG_VERSION"),
        plan.scenario.clone(),
        motion_s,
        "virtual",
        masseter_machine::describe(),
    );
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
    let is_running = |to: &str| to == ControllerState::Running.name();
    let began =
        figures.events.iter().find(|event| event.transition.as_ref().is_some_and(|[_, to]| is_running(to)));
    let began_ns = began.context("the motion of a run has not begun")?.time_ns;
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
    let text = |[all, load, none]: [f64; 3]| {
        format!(
            "{none:.2} N without friction, {load:.2} N with friction under load alone, {all:.2} N with all of it"
        )
    };
    let adds = |share_of: f64| share_of / slides[2] - 1.0 > MATTERS;
    let claim = PaperClaim {
        statement: "Friction comes from the total weight of platform and legs.",
        section: "On friction",
        measured: format!(
            "rms force while chewing at 1.43 Hz — slides: {}; legs: {}",
            text(slides),
            text(legs)
        ),
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
        let values =
            chewing.iter().flat_map(|forces| forces[axes.clone()].iter().flatten()).map(|point| point.1);
        let [low, high] =
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], n| [low.min(n), high.max(n)]);
        let room = 0.08 * (high - low);
        [low - room, high + room]
    };
    let spans = [span(0..LEGS), span(LEGS..AXES)];
    let colours = [palette::BLUE, palette::VERMILION, palette::GREEN];
    let names = FRICTIONS.iter().zip(colours);
    let entries: Vec<_> = names
        .map(|((name, _), colour)| LegendEntry { name: (*name).to_owned(), colour, key: Key::Line })
        .collect();
    svg((1140, 640), |area| {
        let (top, panels) = area.split_vertically(36);
        legend(&top, &entries, entries.len())?;
        for (axis, panel) in panels.split_evenly((2, LEGS)).iter().enumerate() {
            let line =
                |(forces, colour): (&CycleForces, _)| Line::new("", forces[axis].clone()).coloured(colour);
            LineChart {
                title: format!("{} {}", if axis < LEGS { "slide" } else { "leg" }, AXIS_NAMES[axis]),
                x: Axis::new("time in the cycle, s", Scale::Linear, [0.0, CYCLE_S]),
                y: Axis::new("force, N", Scale::Linear, spans[axis / LEGS]),
                lines: chewing.iter().zip(colours).map(line).collect(),
                legend: SeriesLabelPosition::UpperRight,
            }
            .draw_on(panel)?;
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
    Ok([desired, &over_time.bite_force_n, estimated]
        .map(|curve| cut(curve, from_s - AROUND_S, to_s + AROUND_S, from_s)))
}

fn bites_svg(bites: &[(&str, [Curve; 3])]) -> Result<String, Error> {
    svg((1140, 380), |area| {
        for ((food, curves), panel) in bites.iter().zip(area.split_evenly((1, bites.len()))) {
            let [desired, bitten, estimated] = curves.clone();
            LineChart {
                title: (*food).to_owned(),
                x: Axis::new("time since the contact, s", Scale::Linear, [-AROUND_S, 0.6]),
                y: Axis::new("bite force, N", Scale::Linear, [-3.0, 85.0]),
                lines: vec![
                    Line::new("desired", desired).coloured(palette::GREY).wide(),
                    Line::new("estimated", estimated).coloured(palette::VERMILION),
                    Line::new("true", bitten).coloured(palette::BLUE),
                ],
                legend: SeriesLabelPosition::UpperRight,
            }
            .draw_on(&panel)?;
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
    let Pressure { caption, arch } = Pressure::draw(figures).context("cannot draw the pressure")?;
    Ok((claim, ForceFigure { name: "pressure", svg: arch, caption }))
}
