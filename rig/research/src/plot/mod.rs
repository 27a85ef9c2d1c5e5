//! The study's figures, as SVG. Their captions stand in the template of the page.

mod mechanism;

use masseter_charts::palette::{BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION};
use masseter_charts::{
    Area, Axis, Bar, ColourScale, Error, Key, LegendEntry, Line, LineChart, Scale, SeriesLabelPosition, bars,
    cells, chart, legend, svg,
};
use masseter_controller::kinematics::MOST_SOLUTIONS;
use plotters::prelude::{BLACK, Color, LineSeries, RGBColor};

use crate::evidence::{Share, quantile};
use crate::maps::{Basins, Map, PoseQuality};
use crate::motions::Motion;
use crate::pairs::{Course, Disagreement, Trace};
use crate::solutions::Multiplicity;
use crate::solver::{COMPARED, Solver};
use crate::speed::Timing;
use crate::study::Study;
use crate::trials::{GUESSES, Guesses, Trials};

/// Of the paper's solver, Newton–Raphson and the controller's, in every figure.
const SOLVER_COLOURS: [RGBColor; 3] = [BLUE, VERMILION, GREEN];
/// Of the classes of solutions; the true solution's first.
const CLASSES: [RGBColor; 6] = [BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILION];
/// Iterations shown.
const ITERATIONS: usize = 40;
/// Iterations shown of a cycle.
const LAST: usize = 20;
/// Errors below this are drawn there: they are zero but for rounding, cm².
const LEAST_CM2: f64 = 1e-30;
/// Where guesses anywhere above the base are drawn, °: each leg is within 90° of the vertical.
const ABOVE_BASE_DEG: f64 = 90.0;
/// Of the motions: the default scenario's, the other generators', the one given.
const MOTIONS: [RGBColor; 6] = [
    RGBColor(0xff, 0xff, 0xff),
    RGBColor(0xff, 0xb0, 0x00),
    RGBColor(0xff, 0x5f, 0x8f),
    RGBColor(0x9f, 0xff, 0xff),
    RGBColor(0xc0, 0x90, 0xff),
    RGBColor(0xff, 0x30, 0x30),
];

/// What a map's colours mean.
type Measure = (&'static str, fn(&PoseQuality) -> f64);
const CONDITION: Measure = ("condition number", |quality| quality.condition);
const SINGULARITY: Measure = ("regular within, °", |quality| quality.regular_within_deg);
const SEPARATION: Measure = ("next solution, °", |quality| quality.separation_deg);

/// All figures with their names.
pub(crate) fn figures(study: &Study) -> Result<Vec<(&'static str, String)>, Error> {
    let mut figures = vec![
        ("fig5_speed", speed_svg(study)?),
        ("fig6_assemblies", mechanism::assemblies(study)?),
        ("fig8_solutions", mechanism::solution_set(study)?),
        ("multiplicity", multiplicity_svg(&study.multiplicity)?),
        ("basins", basins_svg(&study.basins)?),
        ("success", success_svg(&study.trials)?),
    ];
    for pair in &study.pairs {
        figures.push((pair.name, traces_svg(pair)?));
    }
    figures.extend(workspace_figures(study)?);
    Ok(figures)
}

/// Fig. 5: iterations and time of a solution.
fn speed_svg(study: &Study) -> Result<String, Error> {
    svg((1100, 460), |area| {
        let (left, right) = area.split_horizontally(580);
        iterations_chart(study).draw_on(&left)?;
        draw_times(&right, study)
    })
}

fn iterations_chart(study: &Study) -> LineChart {
    let trials = study.trials.with(Guesses::AboveBase).len() as f64;
    let line = |(solver, colour): (Solver, _)| {
        let counts = study.trials.histogram(solver);
        let mut solved = 0;
        let points = (0..=ITERATIONS).map(|iterations| {
            solved += counts.get(iterations).copied().unwrap_or(0);
            (iterations as f64, 100.0 * solved as f64 / trials)
        });
        Line::new(solver.short_name, points.collect()).coloured(colour)
    };
    let title = "Solved within so many iterations".to_owned();
    let x = Axis::new("iterations", Scale::Linear, [0.0, ITERATIONS as f64]);
    let y = Axis::new("share of guesses solved, %", Scale::Linear, [0.0, 102.0]);
    let lines = COMPARED.into_iter().zip(SOLVER_COLOURS).map(line).collect();
    LineChart { title, x, y, lines, legend: SeriesLabelPosition::LowerRight }
}

/// Bars from 10 ns upwards, by decades.
fn draw_times(area: &Area, study: &Study) -> Result<(), Error> {
    let timings = study.speed.iter().flat_map(|situation| situation.timings);
    let most_ns = timings.map(|timing| timing.median_ns).fold(1e3, f64::max);
    let names = study.speed.iter().map(|situation| situation.name.to_owned()).collect();
    let y = Axis::new("median, ns", Scale::Log, [10.0, most_ns * 4.0]);
    let mut chart = chart(area, "Time of a solution", Axis::of_names("", names), y)?;
    for (group, situation) in study.speed.iter().enumerate() {
        let bar = |(index, (timing, colour)): (usize, (Timing, _))| {
            let left = group as f64 - 0.42 + 0.29 * index as f64;
            let text = vec![format!("{:.0} ns", timing.median_ns), format!("×{:.2}", timing.to_newton)];
            Bar { sides: [left, left + 0.26], height: timing.median_ns, colour, text }
        };
        let shown = situation.timings.into_iter().zip(SOLVER_COLOURS).enumerate().map(bar);
        bars(&mut chart, &shown.filter(|bar| bar.height.is_finite()).collect::<Vec<_>>())?;
    }
    Ok(())
}

/// How many solutions random inputs have.
fn multiplicity_svg(multiplicity: &Multiplicity) -> Result<String, Error> {
    svg((760, 420), |area| {
        let bar = |solutions: usize| {
            let (share, x) = (multiplicity.with_solutions(solutions), solutions as f64);
            let text = vec![format!("{solutions}: {share}")];
            Bar { sides: [x - 0.7, x + 0.7], height: 100.0 * share.value(), colour: BLUE, text }
        };
        let shown: Vec<_> = (0..=MOST_SOLUTIONS).step_by(2).map(bar).filter(|bar| bar.height > 0.0).collect();
        let most = shown.iter().map(|bar| bar.height).fold(10.0, f64::max);
        let x = Axis::new("real solutions (mirrored ones counted)", Scale::Linear, [-1.0, 17.0]);
        let y = Axis::new("share of inputs, %", Scale::Linear, [0.0, most * 1.15]);
        bars(&mut chart(area, "Solutions of random inputs", x, y)?, &shown)
    })
}

/// Maps of the basins of convergence.
fn basins_svg(basins: &Basins) -> Result<String, Error> {
    svg((1140, 500), |area| {
        let (maps, names) = area.split_vertically(424);
        let classes = basins.names.len() - 2;
        let colours: Vec<_> = CLASSES.into_iter().cycle().take(classes).chain([GREY, BLACK]).collect();
        for ((index, solver), panel) in COMPARED.iter().enumerate().zip(maps.split_evenly((1, 3))) {
            let axis = |label| Axis::new(label, Scale::Linear, [0.0, 180.0]);
            let [x, y] = ["θ₁ of the guess, °", "θ₂ of the guess, °"].map(axis);
            let mut chart = chart(&panel, solver.short_name, x, y)?;
            cells(&mut chart, basins.side, |cell| Some(colours[basins.cells[cell].basins[index]]))?;
        }
        let entry = |(name, &colour): (&String, _)| LegendEntry { name: name.clone(), colour, key: Key::Box };
        legend(&names, &basins.names.iter().zip(&colours).map(entry).collect::<Vec<_>>(), 3)
    })
}

/// How often random guesses lead to a solution, by their distance from the true one.
fn success_svg(trials: &Trials) -> Result<String, Error> {
    svg((1100, 440), |area| {
        let panels = area.split_evenly((1, 2));
        success_chart("Any solution", |solver, guesses| trials.solved(solver, guesses))
            .draw_on(&panels[0])?;
        success_chart("The true solution", |solver, guesses| trials.true_ones(solver, guesses))
            .draw_on(&panels[1])
    })
}

fn success_chart(title: &str, share: impl Fn(Solver, Guesses) -> Share) -> LineChart {
    let line = |(solver, colour): (Solver, _)| {
        let point = |guesses| {
            let x = match guesses {
                Guesses::Within(deg) => deg,
                Guesses::AboveBase => ABOVE_BASE_DEG,
            };
            (x, 100.0 * share(solver, guesses).value())
        };
        Line::new(solver.short_name, GUESSES.into_iter().map(point).collect()).coloured(colour).marked()
    };
    let x = Axis::new("guesses within ±, °", Scale::Linear, [0.0, 95.0]);
    let y = Axis::new("share of guesses, %", Scale::Linear, [0.0, 102.0]);
    let lines = COMPARED.into_iter().zip(SOLVER_COLOURS).map(line).collect();
    LineChart { title: title.to_owned(), x, y, lines, legend: SeriesLabelPosition::LowerLeft }
}

/// Figs. 3 and 4: the error against the iteration for single guesses.
///
/// The error over the iterations. Beside an oscillation, which is nearly a flat line there, a panel shows its last
/// cycles.
fn traces_svg(disagreement: &Disagreement) -> Result<String, Error> {
    let Disagreement { clearest, courses, .. } = disagreement;
    let oscillation = clearest.as_ref().filter(|_| courses[1] == Course::Oscillates);
    let width = if oscillation.is_some() { 1140 } else { 760 };
    svg((width, 440), |area| {
        let Some(pair) = oscillation else { return errors_chart(disagreement).draw_on(area) };
        let (left, right) = area.split_horizontally(690);
        errors_chart(disagreement).draw_on(&left)?;
        last_cycles_chart(&pair.traces[1].errors_cm2).draw_on(&right)
    })
}

fn errors_chart(disagreement: &Disagreement) -> LineChart {
    let line = |((name, trace), colour): ((_, &Trace), _)| {
        let shown = trace.errors_cm2.iter().take(ITERATIONS + 1).enumerate();
        let points = shown.map(|(at, error)| (at as f64, error.max(LEAST_CM2)));
        Line::new(name, points.collect()).coloured(colour).marked()
    };
    let traces = disagreement.clearest.iter().flat_map(|pair| &pair.traces);
    let named = ["paper's solver", "Newton–Raphson"].into_iter().zip(traces);
    let x = Axis::new("iteration", Scale::Linear, [0.0, ITERATIONS as f64]);
    let y = Axis::fitted("error f₁² + f₂² + f₃², cm²", Scale::Log).including(1.0);
    let (title, lines) = (disagreement.title.to_owned(), named.zip(SOLVER_COLOURS).map(line).collect());
    LineChart { title, x, y, lines, legend: SeriesLabelPosition::MiddleRight }
}

/// Newton–Raphson's last errors on a linear axis that they fill.
fn last_cycles_chart(errors_cm2: &[f64]) -> LineChart {
    let from = errors_cm2.len().saturating_sub(LAST);
    let points = (from..).map(|at| at as f64).zip(errors_cm2[from..].iter().copied());
    let [_, colour, _] = SOLVER_COLOURS;
    let title = "Newton–Raphson: last cycles".to_owned();
    let [x, y] = ["iteration", ""].map(|label| Axis::fitted(label, Scale::Linear));
    let lines = vec![Line::new("", points.collect()).coloured(colour).marked()];
    LineChart { title, x, y, lines, legend: SeriesLabelPosition::UpperRight }
}

/// Maps of the workspace with the jaw's motions inside.
fn workspace_figures(study: &Study) -> Result<Vec<(&'static str, String)>, Error> {
    let [xz, yz, roll_pitch, yaw_pitch] = &study.maps;
    let figures = [
        ("workspace_translation", CONDITION, [xz, yz]),
        ("workspace_orientation", CONDITION, [roll_pitch, yaw_pitch]),
        ("workspace_singularity", SINGULARITY, [xz, yz]),
        ("workspace_separation", SEPARATION, [xz, yz]),
    ];
    figures
        .into_iter()
        .map(|(name, measure, maps)| Ok((name, workspace_svg(study, measure, maps)?)))
        .collect()
}

fn workspace_svg(study: &Study, (label, value): Measure, maps: [&Map; 2]) -> Result<String, Error> {
    svg((1140, 554), |area| {
        let (names, content) = area.split_vertically(34);
        let entry =
            |(motion, colour): (&Motion, _)| LegendEntry { name: motion.name.clone(), colour, key: Key::Box };
        let motions: Vec<_> = study.motions.iter().zip(MOTIONS).map(entry).collect();
        legend(&names, &motions, MOTIONS.len())?;
        let (maps_area, bar) = content.split_horizontally(1030);
        let colours = ColourScale::new(label, colour_range(maps, value));
        for (panel, map) in maps_area.split_evenly((1, 2)).iter().zip(maps) {
            draw_map(panel, study, map, |quality| colours.colour(value(quality)))?;
        }
        colours.draw(&bar)
    })
}

fn draw_map(
    area: &Area,
    study: &Study,
    map: &Map,
    colour: impl Fn(&PoseQuality) -> RGBColor,
) -> Result<(), Error> {
    let [across, up] = map.slice.axes;
    let [x, y] = [across, up].map(|axis| Axis::new(axis.label, Scale::Linear, axis.range));
    let mut chart = chart(area, "", x, y)?;
    cells(&mut chart, map.side, |cell| map.poses[cell].as_ref().map(&colour))?;
    // The last first: a wide opening covers no smaller one on the same path.
    let motions: Vec<_> = study.motions.iter().zip(MOTIONS).collect();
    for (motion, colour) in motions.into_iter().rev() {
        let points: Vec<_> = motion.poses().map(|pose| (across.at(&pose), up.at(&pose))).collect();
        // A dark rim keeps the path visible on every colour of the map.
        for style in [BLACK.stroke_width(4), colour.stroke_width(2)] {
            chart.draw_series(LineSeries::new(points.iter().copied(), style))?;
        }
    }
    Ok(())
}

/// From the least value to the 90th percentile: the highest values would leave the others without contrast.
fn colour_range(maps: [&Map; 2], value: fn(&PoseQuality) -> f64) -> [f64; 2] {
    let values = || maps.into_iter().flat_map(|map| map.poses.iter().flatten()).map(value);
    let [low, high] = [0.0, 0.9].map(|share| quantile(values().filter(|value| value.is_finite()), share));
    if low < high { [low, high] } else { [0.0, 1.0] }
}
