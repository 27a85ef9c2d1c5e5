//! Forces in the paper study: friction under load while the jaw chews, controlled bites on three foods, and the
//! pressure between the jaws. All of them come from runs of the emulated rig under virtual time.

use anyhow::Context;
use masseter_controller::motion_controller::MotionController;
use masseter_judge::{Analysis, Band, Bearing, Curve, Figures, PressedTooth, ToothFigures};
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_recording::Manifest;
use masseter_runtime::messages::codes::ControllerState;
use masseter_scenario::Scenario;

use crate::tables::{csv, number};

/// Encoders without noise, whose share of the forces would hide that of friction.
const CHEWING: &str = "duration_s = 4.0
[motion]
kind = 'chewing'
cycle_rate_hz = 1.43
[drives]
slide = { encoder_noise_m = 0.0, encoder_resolution_m = 1e-9 }
leg = { encoder_noise_m = 0.0, encoder_resolution_m = 1e-9 }
";
/// A cycle of that motion, s.
const CHEWING_CYCLE_S: f64 = 1.0 / 1.43;
/// The chewing motion with less and less friction: name, and what the scenario has beside the motion.
const FRICTIONS: [(&str, &str); 3] = [
    ("all friction", ""),
    ("friction under load alone", "[dynamics]\nslide_friction_n = 0.0\nviscous_friction_n_s_per_m = 0.0\n"),
    ("no friction", "[dynamics.friction]\nmodel = 'none'\n"),
];

const BITES: [(&str, &str); 3] = [
    ("soft food", include_str!("../../../examples/suite/bite_soft.toml")),
    ("gum", include_str!("../../../examples/suite/bite_gum.toml")),
    ("peanut", include_str!("../../../examples/suite/bite_peanut.toml")),
];
/// Of [`bite`].
const FORCES: [&str; 3] = ["desired", "true", "estimated"];
/// Shown before and after a bite, s.
const AROUND_S: f64 = 0.1;

/// The jaws, pressed together by the controller.
const PRESSED: &str = include_str!("../../../examples/suite/pressed_teeth.toml");

/// Plays the runs. Names and tables of their forces.
pub(crate) fn play() -> anyhow::Result<[(&'static str, String); 5]> {
    let chewing =
        FRICTIONS.iter().map(|(_, friction)| cycle_forces(&run(&format!("{CHEWING}{friction}"))?.1));
    let chewing = chewing.collect::<anyhow::Result<Vec<_>>>()?;
    let bitten_runs = BITES.iter().map(|(_, text)| run(text)).collect::<anyhow::Result<Vec<_>>>()?;
    let bites = bitten_runs.iter().map(bite).collect::<anyhow::Result<Vec<_>>>()?;
    let forces = FRICTIONS.iter().zip(&chewing);
    let forces = forces.flat_map(|((name, _), forces)| curves(name, AXIS_NAMES.into_iter().zip(forces)));
    let bitten = BITES.iter().zip(&bites);
    let bitten = bitten.flat_map(|((food, _), forces)| curves(food, FORCES.into_iter().zip(forces)));
    let (manifest, pressed) = run(PRESSED)?;
    let contact = pressed.contact.as_ref().context("the jaws have not touched")?;
    let at_s = contact.total_max_at_ns.saturating_sub(pressed.over_time.began_ns()) as f64 / 1e9;
    let bite_n = pressed.bite_force_max_n.context("the jaws have not bitten")?;
    let teeth = PressedTooth::all(&manifest.scenario);
    let cusp = teeth.first().and_then(|tooth| tooth.cusp).context("the jaws have no teeth that meet")?;
    let tooth = |tooth: &ToothFigures| {
        let load_n = tooth.at_total_max_n.iter().map(|force_n| force_n * force_n).sum::<f64>().sqrt();
        let place_mm = [-tooth.place_m[1], tooth.place_m[0]].map(|place_m| place_m * 1e3);
        (tooth.number, place_mm.map(number), [load_n, tooth.max_n].map(number), pressure(cusp, load_n))
    };
    let course = |tooth: &ToothFigures| {
        let course_n = tooth.force_n.highest();
        let points = course_n.iter();
        let rows: Vec<_> = points
            .map(|&(at_s, load_n)| ("pressed teeth", tooth.number, number(at_s), pressure(cusp, load_n)))
            .collect();
        rows
    };
    let mut courses: Vec<_> = contact.teeth.iter().flat_map(course).collect();
    for ((name, _), (manifest, figures)) in BITES.iter().zip(&bitten_runs) {
        for tooth in PressedTooth::all(&manifest.scenario) {
            let found = figures.contact.iter().flat_map(|contact| &contact.teeth);
            let Some((food, loads)) = tooth.food.zip(found.clone().find(|one| one.number == tooth.number))
            else {
                continue;
            };
            let row =
                |&(at_s, load_n): &(f64, f64)| (*name, tooth.number, number(at_s), pressure(food, load_n));
            courses.extend(loads.force_n.highest().iter().map(row));
        }
    }
    Ok([
        ("forces", csv("friction,axis,time_s,force_n", forces)),
        ("bites", csv("food,force,time_s,force_n", bitten)),
        (
            "pressure",
            csv(
                "tooth,right_mm,forward_mm,force_n,greatest_n,area_mm2,mean_mpa,peak_mpa",
                contact.teeth.iter().map(tooth),
            ),
        ),
        ("pressures", csv("run,tooth,time_s,area_mm2,mean_mpa,peak_mpa", courses)),
        ("pressed", csv("time_s,teeth_n,bite_n", [[at_s, contact.total_max_n, bite_n].map(number)])),
    ])
}

/// Rows of a table, with the names of a run and of its curves.
fn curves<'a>(
    run: &'a str,
    curves: impl Iterator<Item = (&'a str, &'a Curve)>,
) -> impl Iterator<Item = (&'a str, &'a str, [String; 2])> {
    curves.flat_map(move |(name, curve)| {
        curve.iter().map(move |&(at_s, force_n)| (run, name, [at_s, force_n].map(number)))
    })
}

/// Area, mean and highest pressure under a load, which friction raises by 3 % at most: mm² and MPa.
fn pressure(bearing: Bearing, load_n: f64) -> [String; 3] {
    let pressure = bearing.under(load_n);
    [pressure.area_m2, pressure.mean_pa * 1e-12, pressure.peak_pa * 1e-12].map(|value| number(value * 1e6))
}

/// Plays a scenario under virtual time without a recording.
fn run(scenario: &str) -> anyhow::Result<(Manifest, Figures)> {
    let plan = masseter_plan::RunPlan::new(Scenario::parse(std::path::Path::new("study.toml"), scenario)?)?;
    let motion_s = plan.trajectory.duration_s();
    let (version, machine) = (env!("CARGO_PKG_VERSION"), masseter_machine::describe());
    let mut manifest = Manifest::new(version, plan.scenario.clone(), motion_s, "virtual", machine);
    let figures = masseter_virtual_time::analyse(
        &plan,
        |scenario, mechanism, motion| Box::new(MotionController::new(scenario, mechanism, motion)),
        Analysis::new,
        &mut manifest,
        &masseter_virtual_time::Uninterrupted,
    )?;
    Ok((manifest, figures))
}

/// Force of each axis in the second cycle of the motion, N over s.
type CycleForces = [Curve; AXES];

fn cycle_forces(figures: &Figures) -> anyhow::Result<CycleForces> {
    let began = figures.events.iter().find(|event| event.enters(ControllerState::Running));
    let began_ns = began.context("the motion of a run has not begun")?.time_ns;
    let from_s = (began_ns - figures.over_time.began_ns()) as f64 / 1e9 + CHEWING_CYCLE_S;
    let part = |band: &Band| cut(&band.curve(), from_s, from_s + CHEWING_CYCLE_S, from_s);
    Ok(figures.over_time.force_n.each_ref().map(part))
}

/// The part of a curve between two times, which counts from a third.
fn cut(curve: &Curve, from_s: f64, to_s: f64, zero_s: f64) -> Curve {
    let inside = curve.iter().filter(|(at_s, _)| (from_s..=to_s).contains(at_s));
    inside.map(|(at_s, value)| (at_s - zero_s, *value)).collect()
}

/// The second bite of a run: the [forces](FORCES), N over s since the contact.
fn bite((manifest, figures): &(Manifest, Figures)) -> anyhow::Result<[Curve; 3]> {
    let over_time = &figures.over_time;
    let signal = |name: &str| {
        let place = manifest.declared.signals.iter().position(|signal| signal.name == name);
        place
            .map(|place| over_time.signals[place].curve())
            .with_context(|| format!("a run has no signal {name}"))
    };
    let (desired, estimated) = (signal("desired_bite_force_n")?, signal("bite_force_n")?);
    let is_bite = |point: &(f64, f64)| point.1 > 0.0;
    let starts = desired.windows(2).filter(|pair| !is_bite(&pair[0]) && is_bite(&pair[1]));
    let from_s = starts.map(|pair| pair[1].0).nth(1).context("a run has no second bite")?;
    let after = desired.iter().find(|point| point.0 > from_s && !is_bite(point));
    let to_s = after.context("a run ends within a bite")?.0;
    let curves = [desired, over_time.bite_force_n.curve(), estimated];
    Ok(curves.map(|curve| cut(&curve, from_s - AROUND_S, to_s + AROUND_S, from_s)))
}
