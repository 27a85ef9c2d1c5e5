//! The plan of a run: scenario and arguments resolved, and checked against mechanism, drives and buses.
//!
//! It refuses a run before anything starts. It does not examine the machine: real CAN interfaces, cores and privileges are
//! checked by their users.
//!
//! ```
//! use masseter_plan::{RunPlan, scenario_with};
//!
//! let plan = RunPlan::new(scenario_with(None, &["rate_hz=500".to_owned()])?)?;
//! assert_eq!(plan.scenario.period_ns(), 2_000_000);
//! # Ok::<(), anyhow::Error>(())
//! ```

mod placement;
mod stiffness;

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use masseter_controller::trajectory::{self, Trajectory, TrajectoryError, TrajectoryReport};
use masseter_model::{dynamics::Friction, geometry::Mechanism};
use masseter_plant::core as plant;
use masseter_runtime::schedule::CycleSchedule;
use masseter_scenario::{DriveProfile, FileConfig, MotionConfig, Scenario};

pub use placement::{Placement, best_placement};

/// A run that fits its mechanism, drives and buses.
#[derive(Debug)]
pub struct RunPlan {
    /// The scenario with all overrides.
    pub scenario: Scenario,
    /// Its mechanism.
    pub mechanism: Mechanism,
    /// Its motion, within the limits of strokes, velocities, accelerations and conditioning.
    pub trajectory: Trajectory,
    /// The largest demands of the motion on the axes, at full speed.
    pub demands: TrajectoryReport,
    /// The cycle's time table on the bus.
    pub schedule: CycleSchedule,
}

impl RunPlan {
    /// Plans a scenario.
    ///
    /// # Errors
    /// When the cycle does not fit the buses, the plant cannot be built, or the motion exceeds a limit.
    pub fn new(scenario: Scenario) -> anyhow::Result<Self> {
        let mechanism = Mechanism::new(&scenario.mechanism)?;
        let schedule = CycleSchedule::new(&scenario)?;
        plant::check_scenario(&scenario)?;
        let trajectory = Trajectory::new(&scenario.motion, &scenario.jaw, &mechanism, scenario.duration_s)?;
        // Also a dry run is one of a motion that the mechanism can follow at full speed.
        let demands = demands(&scenario, &trajectory, &mechanism)?;
        let trajectory = trajectory.slowed(scenario.dry.speed_now());
        Ok(Self { scenario, mechanism, trajectory, demands, schedule })
    }

    /// Plans the scenario of a file, or the default one.
    ///
    /// # Errors
    /// Those of [`Self::new`], with the place of the key in the file.
    pub fn of_file(scenario: Scenario, path: Option<&Path>) -> anyhow::Result<Self> {
        let Some(path) = path else { return Self::new(scenario).context("the default scenario") };
        Self::new(scenario.clone()).map_err(|error| {
            let place = scenario.place_of(path, &error.to_string());
            error.context(place.unwrap_or_else(|| path.display().to_string()))
        })
    }

    /// What a user should look at before the results: a file without the marker's offset, doubtful rows, guides that can lock,
    /// what the rig does not take from files of drives, a stiffness stated for the force control that is far from the real one.
    pub fn warnings(&self) -> Vec<String> {
        let centroid = self.trajectory.centroid_turn_deg().map(|turn_deg| {
            format!(
                "the jaw turns by up to {turn_deg:.1}°, so the markers' centroid does not follow the incisal point; \
                 set motion.marker_origin_mm"
            )
        });
        let doubts = self.trajectory.doubts().into_iter().map(|doubt| format!("the motion's {doubt}"));
        let of_files = self.scenario.drive_profile.iter().filter_map(DriveProfile::dcf_warning);
        let stiffness = stiffness::warnings(&self.scenario, &self.mechanism, &self.trajectory.closed_pose());
        centroid.into_iter().chain(doubts).chain(self.locking()).chain(of_files).chain(stiffness).collect()
    }

    /// A line that describes the run, and one for each warning.
    pub fn announcement(&self) -> String {
        let scenario = &self.scenario;
        let wires = match &scenario.can.interfaces[..] {
            [] => "virtual CAN".to_owned(),
            interfaces => interfaces.join(", "),
        };
        let cut = self.trajectory.cut_from_s();
        let cut = cut.map_or_else(String::new, |whole_s| {
            format!("; cut short: the whole motion takes {whole_s:.1} s")
        });
        let run = format!(
            "{}: {:.1} s of motion at {} Hz on {wires}, seed {}{cut}",
            scenario.name,
            self.trajectory.duration_s(),
            scenario.rate_hz,
            scenario.seed
        );
        [vec![run], self.warnings()].concat().join("\n  warning: ")
    }

    /// The defect of guides that a force at the balls can lock: their friction grows as fast as the force.
    fn locking(&self) -> Option<String> {
        let joints = self.mechanism.inverse(&self.trajectory.pose(0.0)).ok()?;
        let heights_m =
            joints.actuators.leg_m.into_iter().zip(joints.theta_rad).map(|(m, rad)| m * rad.sin());
        let lever_m = heights_m.fold(0.0, f64::max);
        let dynamics = &self.scenario.dynamics;
        let ratio = Friction::new(dynamics).self_locking(lever_m);
        (ratio >= 1.0).then(|| {
            format!(
                "the guides can jam: a force across at a ball, {:.0} mm above the slide, causes {ratio:.1} times as much \
                 friction; use bearing blocks further apart than {:.0} mm (dynamics.friction.block_spacing_m), or a lower \
                 guide_coefficient",
                lever_m * 1e3,
                dynamics.friction.block_spacing_m * ratio * 1e3,
            )
        })
    }
}

/// The valid scenario of a file, or the default one.
///
/// # Errors
/// When the file cannot be read or a value is out of range.
pub fn read_scenario(path: Option<&Path>) -> anyhow::Result<Scenario> {
    read_scenario_with(path, |_| Ok(()))
}

/// The same after `change`, which applies the arguments of a verb. Only the result must be valid.
///
/// # Errors
/// When the file cannot be read, `change` fails, or a value is out of range.
pub fn read_scenario_with(
    path: Option<&Path>,
    change: impl FnOnce(&mut Scenario) -> anyhow::Result<()>,
) -> anyhow::Result<Scenario> {
    let mut scenario = path.map_or_else(|| Ok(Scenario::default()), Scenario::read)?;
    change(&mut scenario)?;
    let checked = scenario.validate();
    checked.map_err(|error| match path {
        Some(path) => Scenario::place_refusal(error, path),
        None => error,
    })?;
    Ok(scenario)
}

/// The scenario of a file, or the default one, with values of keys, each as `KEY=VALUE`.
///
/// # Errors
/// When the file or the motion cannot be read, or a value lies outside its range.
pub fn scenario_with(path: Option<&Path>, set: &[String]) -> anyhow::Result<Scenario> {
    read_scenario_with(path, |scenario| set_keys(scenario, None, set))
}

/// The largest demands of a motion on the axes of a scenario.
///
/// # Errors
/// When the motion exceeds the scenario's limits or those of its drives.
pub fn demands(
    scenario: &Scenario,
    trajectory: &Trajectory,
    mechanism: &Mechanism,
) -> Result<TrajectoryReport, TrajectoryError> {
    let limits = scenario.limits.within(&scenario.drives);
    trajectory::check(trajectory, mechanism, &limits, scenario.period_s())
}

/// Replaces the motion of a scenario by that of a file, if one is given; then sets keys, each as `KEY=VALUE`, and makes the
/// paths of files absolute.
///
/// # Errors
/// When a key or its value is refused, or there is no such file.
pub fn set_keys(scenario: &mut Scenario, trajectory: Option<&Path>, set: &[String]) -> anyhow::Result<()> {
    // The keys of a file can be set only for a motion that is a file.
    if let Some(path) = trajectory {
        play_file(path, scenario);
    }
    for assignment in set {
        *scenario = scenario.with(assignment).context("--set")?;
    }
    if let MotionConfig::File(file) = &scenario.motion
        && scenario.name == Scenario::default().name
    {
        scenario.name = name_of_file(&file.path);
    }
    for (_, file) in scenario.files_mut() {
        *file = absolute(file)?;
    }
    if let Some(memory) = &mut scenario.drives.memory {
        // The processes read it too, from other folders.
        *memory = std::path::absolute(&*memory).context("drives.memory")?;
    }
    Ok(())
}

/// Makes a scenario that of its dry run; one that is a dry run already stays as it is.
pub fn enter_dry_run(scenario: &mut Scenario) {
    if std::mem::replace(&mut scenario.dry.is_on, true) {
        return;
    }
    let margin_m = scenario.dry.stroke_margin_mm * 1e-3;
    let strokes = &mut scenario.mechanism.strokes;
    for [low_m, high_m] in [&mut strokes.slide_m, &mut strokes.leg_m] {
        (*low_m, *high_m) = (*low_m + margin_m, *high_m - margin_m);
    }
    scenario.controller.ease_s /= scenario.dry.speed;
}

/// Replaces the motion of a scenario by a file. A scenario that already plays a file keeps its axes and filter.
fn play_file(path: &Path, scenario: &mut Scenario) {
    match &mut scenario.motion {
        MotionConfig::File(file) => path.clone_into(&mut file.path),
        motion => *motion = MotionConfig::File(FileConfig::new(path)),
    }
    scenario.name = name_of_file(path);
}

/// The name of a run that plays a file.
fn name_of_file(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let name: String =
        stem.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).take(64).collect();
    // `.` and `..` are no names of files, and are refused as such.
    if name.is_empty() { "motion".to_owned() } else { name }
}

/// The absolute path, for readers of the manifest in other folders.
fn absolute(path: &Path) -> anyhow::Result<PathBuf> {
    let absolute = path.canonicalize().with_context(|| format!("cannot read '{}'", path.display()))?;
    // The manifest is written down with it.
    let is_text = absolute.to_str().is_some();
    ensure!(is_text, "cannot use '{}': choose folders and a file whose names are UTF-8", path.display());
    Ok(absolute)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_path_gives_a_name() {
        for (path, name) in [("a/jaw 1.csv", "jaw-1"), (".", "motion"), ("", "motion"), ("..", "motion")] {
            assert_eq!(name_of_file(Path::new(path)), name, "{path}");
        }
    }

    #[test]
    fn a_dry_run_keeps_from_the_ends_and_is_entered_once() {
        let normal = Scenario::default();
        let mut dry = normal.clone();
        (0..2).for_each(|_| enter_dry_run(&mut dry));
        let ends =
            |scenario: &Scenario| [scenario.mechanism.strokes.slide_m, scenario.mechanism.strokes.leg_m];
        for ([low_m, high_m], [dry_low_m, dry_high_m]) in ends(&normal).into_iter().zip(ends(&dry)) {
            assert!((dry_low_m - low_m - 1e-3).abs() < 1e-12 && (high_m - dry_high_m - 1e-3).abs() < 1e-12);
        }
        assert!((dry.controller.ease_s - 10.0).abs() < 1e-12);
        assert_eq!((dry.dry.speed_now(), dry.dry.force_now()), (0.1, 0.3));
        assert_eq!((normal.dry.speed_now(), normal.dry.force_now()), (1.0, 1.0));
        dry.validate().unwrap();
    }
}
