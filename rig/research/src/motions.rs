//! Jaw motions against the mechanism: whether it can follow them, and whether the solvers can.

use masseter_controller::trajectory::{Trajectory, TrajectoryReport};
use masseter_model::geometry::{Actuators, Conditioning, Jacobian, LEGS, Mechanism, Pose};
use masseter_scenario::{
    ChewingConfig, LateralConfig, MotionConfig, OpeningConfig, ProtrusionConfig, Scenario,
};
use rand::RngExt;
use rayon::prelude::*;

use crate::maps::COORDINATES;
use crate::solver::{CONTROLLER, SOLVERS, Solver, Start, distance_rad};
use crate::tables::{csv, number};

/// A cycle of the rig, s.
pub(crate) const CYCLE_S: f64 = 1e-3;
/// Times from one solution to the next, ms.
const STEPS_MS: [usize; 3] = [1, 10, 100];
/// Leg angles closer than this to those of the inverse kinematics are the true ones, radians.
const TRUE_WITHIN_RAD: f64 = 1e-6;

/// A motion of the jaw on the platform.
#[derive(Debug, Clone)]
pub(crate) struct Motion {
    name: String,
    pub trajectory: Trajectory,
    /// The strokes and velocities that it needs, or why the mechanism cannot follow.
    demands: Result<TrajectoryReport, String>,
    /// Largest condition number of its poses every 10 ms.
    condition: f64,
    /// How each of [`SOLVERS`] followed it, by [`STEPS_MS`].
    followed: [[Followed; SOLVERS.len()]; STEPS_MS.len()],
}

/// How a solver followed a motion, each step from its last solution.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Followed {
    steps: usize,
    /// Steps at which it was not at the true leg angles.
    lost: usize,
    iterations_mean: f64,
    iterations_max: u32,
}

/// The reach of adults at the incisal point, mean and 95th percentile, mm. Opening and lateral excursion: Kordass et al.,
/// Int J Comput Dent 17 (2014) 9–20, 259 adults. Protrusion: 500 patients in Basel (Swiss Dental Journal), 8.8 ± 2.3 mm,
/// of which the 95th percentile is that of a normal distribution.
const REACH: [Reach; 2] = [
    Reach { name: "mean", opening_mm: 44.3, lateral_mm: 8.9, protrusion_mm: 8.8 },
    Reach { name: "95th percentile", opening_mm: 56.1, lateral_mm: 13.0, protrusion_mm: 12.6 },
];

/// Duration of these motions, s: two cycles of the slowest.
const GENERATED_S: f64 = 4.0;

/// How far the jaw goes.
struct Reach {
    name: &'static str,
    opening_mm: f64,
    lateral_mm: f64,
    protrusion_mm: f64,
}

/// The rig's generators with their defaults, the default scenario's first, but over the human range; and the motion of
/// `own` if given.
///
/// # Errors
/// When its recording cannot be used, or a value of it lies outside its range.
pub(crate) fn motions(mechanism: &Mechanism, own: Option<&Scenario>) -> anyhow::Result<Vec<Motion>> {
    let reaching = |Reach { name, opening_mm, lateral_mm, protrusion_mm }| {
        let opening = OpeningConfig { amplitude_mm: opening_mm, ..OpeningConfig::default() };
        let lateral = LateralConfig { amplitude_mm: lateral_mm, ..LateralConfig::default() };
        let protrusion = ProtrusionConfig { amplitude_mm: protrusion_mm, ..ProtrusionConfig::default() };
        [
            (format!("opening, {name}"), MotionConfig::Opening(opening)),
            (format!("lateral excursion, {name}"), MotionConfig::Lateral(lateral)),
            (format!("protrusion, {name}"), MotionConfig::Protrusion(protrusion)),
        ]
    };
    let chewing = ("chewing".to_owned(), MotionConfig::Chewing(ChewingConfig::default()));
    let generated = [chewing].into_iter().chain(REACH.into_iter().flat_map(reaching));
    let generated = generated.map(|(name, motion)| {
        (name, Scenario { motion, duration_s: Some(GENERATED_S), ..Scenario::default() })
    });
    let own = own.map(|own| {
        let name = if matches!(own.motion, MotionConfig::File(_)) { "recording" } else { "scenario" };
        (name.to_owned(), own.clone())
    });
    let all: Vec<_> = generated.chain(own).collect();
    all.into_par_iter().map(|(name, scenario)| Motion::new(name, &scenario, mechanism)).collect()
}

impl Motion {
    fn new(name: String, scenario: &Scenario, mechanism: &Mechanism) -> anyhow::Result<Self> {
        let Scenario { motion, jaw, duration_s, .. } = scenario;
        let trajectory = Trajectory::new(motion, jaw, mechanism, *duration_s)?;
        let demands =
            masseter_plan::demands(scenario, &trajectory, mechanism).map_err(|error| error.to_string());
        let followed =
            STEPS_MS.map(|step_ms| SOLVERS.map(|solver| follow(solver, mechanism, &trajectory, step_ms)));
        let conditions = poses(&trajectory).filter_map(|pose| {
            let jacobian = Jacobian::of_legs(mechanism, &mechanism.legs(&pose).ok()?);
            Some(Conditioning::new(&jacobian).number())
        });
        let condition = conditions.fold(0.0, f64::max);
        Ok(Self { name, trajectory, demands, condition, followed })
    }

    /// The input of any instant.
    pub(crate) fn input(&self, mechanism: &Mechanism, random: &mut rand_pcg::Pcg64Mcg) -> Actuators {
        loop {
            let at_s = random.random_range(0.0..=self.trajectory.duration_s());
            if let Ok(joints) = mechanism.inverse(&self.trajectory.pose(at_s)) {
                return joints.actuators;
            }
        }
    }
}

/// The platform's poses, every 10 ms.
fn poses(trajectory: &Trajectory) -> impl Iterator<Item = Pose> {
    let steps = (trajectory.duration_s() / (10.0 * CYCLE_S)) as usize;
    (0..=steps).map(|step| trajectory.pose(step as f64 * 10.0 * CYCLE_S))
}

fn follow(solver: Solver, mechanism: &Mechanism, trajectory: &Trajectory, step_ms: usize) -> Followed {
    let mut last_rad: Option<[f64; LEGS]> = None;
    let mut tracker = masseter_controller::kinematics::ForwardTracker::new(mechanism.clone());
    let (mut followed, mut iterations) = (Followed::default(), 0);
    let cycles = (trajectory.duration_s() / CYCLE_S) as usize;
    for cycle in (0..=cycles).step_by(step_ms) {
        let Ok(joints) = mechanism.inverse(&trajectory.pose(cycle as f64 * CYCLE_S)) else { continue };
        let found = if solver == CONTROLLER {
            tracker.update(&joints.actuators).ok().map(|solution| (solution.theta_rad, solution.iterations))
        } else {
            // The first pose is known, as the paper supposes.
            let guess_rad = last_rad.unwrap_or(joints.theta_rad);
            let found = solver.attempt(mechanism, &Start { actuators: joints.actuators, guess_rad });
            found.ok().map(|found| (found.theta_rad, found.iterations))
        };
        followed.steps += 1;
        let is_true = |(found_rad, _)| distance_rad(&found_rad, &joints.theta_rad) < TRUE_WITHIN_RAD;
        followed.lost += usize::from(!found.is_some_and(is_true));
        if let Some((found_rad, made)) = found {
            last_rad = Some(found_rad);
            iterations += made;
            followed.iterations_max = followed.iterations_max.max(made);
        }
    }
    followed.iterations_mean = f64::from(iterations) / followed.steps as f64;
    followed
}

/// The platform's coordinates along each motion.
pub(crate) fn paths_table(motions: &[Motion]) -> String {
    let rows = motions.iter().flat_map(|motion| {
        poses(&motion.trajectory).map(|pose| (&motion.name, COORDINATES.map(|axis| number(axis.at(&pose)))))
    });
    csv("motion,x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg", rows)
}

/// A row for each motion, step and solver.
pub(crate) fn table(motions: &[Motion], mechanism: &Mechanism) -> String {
    let rows = motions.iter().flat_map(|motion| {
        let needs = motion.demands.as_ref().map_or([f64::NAN; 3], |demands| {
            let margins_m = demands.margin_m(mechanism.strokes());
            let least_m = |axes: &[f64]| axes.iter().copied().fold(f64::INFINITY, f64::min);
            [least_m(&margins_m[..LEGS]), least_m(&margins_m[LEGS..]), motion.condition]
        });
        let is_within = u8::from(motion.demands.is_ok());
        let refused = motion.demands.as_ref().err();
        STEPS_MS.into_iter().zip(motion.followed).flat_map(move |(step_ms, followed)| {
            SOLVERS.into_iter().zip(followed).map(move |(solver, followed)| {
                let Followed { steps, lost, iterations_mean, iterations_max } = followed;
                let followed = (step_ms, solver.name, steps, lost, number(iterations_mean), iterations_max);
                (&motion.name, is_within, needs.map(number), followed, refused)
            })
        })
    });
    csv(
        "motion,within_limits,least_slide_margin_m,least_leg_margin_m,greatest_condition,step_ms,solver,steps,\
         steps_lost,iterations_mean,iterations_max,refused",
        rows,
    )
}
