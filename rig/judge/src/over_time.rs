//! Jaw, axes, wake-ups and buses of a run over time, for plots; and the greatest loads of teeth and drives.

use masseter_can::{Bitrate, Tapped, wire};
use masseter_model::geometry::{AXES, Pose, Vec3};
use masseter_runtime::messages::codes::ControllerState;
use masseter_runtime::messages::{Command, Contact, MOST_VALUES, Reading, Signals, ToothContact, Truth};
use masseter_scenario::{MOST_PAIRS, Scenario};
use serde::Serialize;

use crate::series::{ByCycle, Curve, Extremes, Series, Smoothing};
use crate::tracking::PathSample;

/// A run over time, from the first message to the last: seconds since its first SYNC, and the lowest and the highest value
/// of each stretch of time.
#[derive(Debug, Clone, Default)]
pub struct OverTime {
    /// The instant that curves count from, ns of the run's clock.
    pub began_ns: u64,
    /// The sample with which the motion began: the first of the controller's state `running`, ns of the run's clock; none
    /// where the motion never began.
    pub motion_began_ns: Option<u64>,
    /// When the last value came, s.
    pub duration_s: f64,
    /// Place of the incisal point along x, y and z of the base while it has a desired one, m.
    pub desired_incisal_m: [Curve; 3],
    /// The same of the actual pose of the platform, in the whole run.
    pub actual_incisal_m: [Curve; 3],
    /// The same of the pose that forward kinematics found; without truth it is the actual one.
    pub estimated_incisal_m: [Curve; 3],
    /// Largest distance of the incisal point from its desired place, m.
    pub distance_m: Curve,
    /// Largest angle of the platform from its desired orientation, rad.
    pub angle_rad: Curve,
    /// Latest wake-up of the controller in each stretch, ns late.
    pub controller_late_ns: Curve,
    /// Latest wake-up of the plant in each stretch, ns late.
    pub plant_late_ns: Curve,
    /// Position of each axis, m.
    pub position_m: [Curve; AXES],
    /// Position that the drive of each axis reports, m; beside a true one alone.
    pub reported_m: [Curve; AXES],
    /// Velocity of each axis, m/s.
    pub velocity_m_s: [Curve; AXES],
    /// Force of each actuator, N.
    pub force_n: [Curve; AXES],
    /// Its moving mean over 20 ms.
    pub smooth_force_n: [Curve; AXES],
    /// Vertical force of food and upper teeth on the jaw, N.
    pub bite_force_n: Curve,
    /// Share of each bus in use, 0 to 1.
    pub bus_load: Vec<Curve>,
    /// The controller's signals.
    pub signals: Vec<Curve>,
}

/// Collects them.
#[derive(Debug, Clone, Default)]
pub(super) struct OverTimeCollector {
    began_ns: Option<u64>,
    lasted_ns: u64,
    /// The incisal point in the platform frame.
    incisal_m: [f64; 3],
    motion_began_ns: Option<u64>,
    jaw: Series<Extremes<{ ANGLE + 1 }>>,
    late: Series<Extremes<2>>,
    /// Of the axes, and the bite force.
    axes: Series<Extremes<{ BITE_FORCE + 1 }>>,
    smoothing: Smoothing<AXES>,
    smooth_force_n: Series<Extremes<AXES>>,
    reported_m: Series<Extremes<AXES>>,
    /// Time that frames took on each bus.
    busy_ns: Vec<Series<u64>>,
    signals: Series<Extremes<MOST_VALUES>>,
    bitrate: Option<Bitrate>,
}

/// Whose place of the incisal point: the index of its x; y and z follow. The others are distance and angle between desired
/// and actual pose.
#[derive(Debug, Clone, Copy)]
pub(super) enum Place {
    Desired = 0,
    Actual = 3,
    Estimated = 6,
}
const DISTANCE: usize = 9;
const ANGLE: usize = 10;

/// Indices of the first axis in each quantity, and of the bite force behind them.
const POSITION: usize = 0;
const VELOCITY: usize = AXES;
const FORCE: usize = 2 * AXES;
const BITE_FORCE: usize = 3 * AXES;

/// Time over which the load of a bus is a share and a wake-up the latest of several, ns.
const WIDE_NS: u64 = 10_000_000;

/// Indices of the two processes.
pub(super) const CONTROLLER: usize = 0;
pub(super) const PLANT: usize = 1;

impl OverTimeCollector {
    /// For a jaw with this incisal point in the platform frame, and buses of this bit rate; without one there is no load.
    pub(super) fn new(incisal_m: [f64; 3], bitrate: Option<Bitrate>) -> Self {
        Self { incisal_m, bitrate, late: Series::of_width(WIDE_NS), ..Self::default() }
    }

    /// A time of the run's clock since the first, ns.
    pub(super) fn since(&mut self, time_ns: u64) -> u64 {
        let since_ns = time_ns.saturating_sub(*self.began_ns.get_or_insert(time_ns));
        self.lasted_ns = self.lasted_ns.max(since_ns);
        since_ns
    }

    pub(super) fn wake_up(&mut self, process: usize, due_ns: u64, woke_ns: u64) {
        let since_ns = self.since(due_ns);
        self.late.add(since_ns, process, woke_ns.saturating_sub(due_ns) as f64);
    }

    /// The desired pose of a sample, and how far the actual one is from it.
    pub(super) fn apply_path(&mut self, sample: &PathSample) {
        let since_ns = self.since(sample.sampled_ns);
        self.jaw.add_all(since_ns, DISTANCE, &[sample.deviation.incisal_m, sample.deviation.angle_rad]);
        self.incisal(Place::Desired, sample.sampled_ns, sample.desired.as_ref());
    }

    /// The motion plays in this sample.
    pub(super) fn running(&mut self, sampled_ns: u64) {
        self.motion_began_ns.get_or_insert(sampled_ns);
    }

    /// A time of the run's clock since the motion began, ns; none before.
    pub(super) fn since_motion(&self, time_ns: u64) -> Option<u64> {
        time_ns.checked_sub(self.motion_began_ns?)
    }

    /// The incisal point of a pose.
    pub(super) fn incisal(&mut self, of: Place, sampled_ns: u64, pose: Option<&Pose>) {
        let since_ns = self.since(sampled_ns);
        let Some(pose) = pose else { return };
        let place_m = pose.translation.vector + pose.rotation * Vec3::from(self.incisal_m);
        self.jaw.add_all(since_ns, of as usize, place_m.as_slice());
    }

    pub(super) fn apply_truth(&mut self, truth: &Truth) {
        let since_ns = self.since(truth.sampled_ns);
        self.axes.add_all(since_ns, POSITION, &truth.joint_m);
        self.axes.add_all(since_ns, VELOCITY, &truth.joint_m_s);
        self.force(since_ns, truth.force_n);
        self.axes.add(since_ns, BITE_FORCE, truth.bite_force_n);
    }

    /// Positions that drives report of an emulated mechanism. An axis without news has none.
    pub(super) fn reported_beside_truth(&mut self, reading: &Reading) {
        let since_ns = self.since(reading.sampled_ns);
        for axis in (0..AXES).filter(|axis| reading.fresh_axes >> axis & 1 == 1) {
            self.reported_m.add(since_ns, axis, reading.position_m[axis]);
        }
    }

    /// Positions and forces that the drives of the robot report, which has no truth.
    pub(super) fn reported(&mut self, reading: &Reading) {
        let since_ns = self.since(reading.sampled_ns);
        self.axes.add_all(since_ns, POSITION, &reading.position_m);
        self.force(since_ns, reading.force_n);
    }

    fn force(&mut self, since_ns: u64, force_n: [f64; AXES]) {
        self.axes.add_all(since_ns, FORCE, &force_n);
        if let Some((at_ns, mean_n)) = self.smoothing.add(since_ns, force_n) {
            self.smooth_force_n.add_all(at_ns, 0, &mean_n);
        }
    }

    pub(super) fn apply_signals(&mut self, message: &Signals) {
        let since_ns = self.since(message.published_ns);
        self.signals.add_all(since_ns, 0, message.signals.as_slice());
    }

    pub(super) fn apply_frame(&mut self, time_ns: u64, bus: usize, tapped: &Tapped) {
        let since_ns = self.since(time_ns);
        if let Some((received, bitrate)) = tapped.frame().zip(self.bitrate) {
            let busy_ns = bitrate.bits_to_ns(wire::frame_bits(&received.frame));
            let buses = self.busy_ns.len().max(bus + 1);
            self.busy_ns.resize_with(buses, || Series::of_width(WIDE_NS));
            *self.busy_ns[bus].at(since_ns) += busy_ns;
        }
    }

    /// The points of stretches in which a reading came. Where nothing came, a silent bus is no finding.
    fn recorded(&self, load: Curve) -> Curve {
        load.into_iter().filter(|(at_s, _)| self.late.has_value(PLANT, (at_s * 1e9) as u64)).collect()
    }

    /// The values, with those of this many signals.
    pub(super) fn into_figures(self, signals: usize) -> OverTime {
        let load = |bus: &Series<u64>| {
            let full_ns = bus.width_s() * 1e9;
            bus.iter().map(|(at_s, busy_ns)| (at_s, *busy_ns as f64 / full_ns)).collect()
        };
        OverTime {
            began_ns: self.began_ns.unwrap_or(0),
            motion_began_ns: self.motion_began_ns,
            duration_s: self.lasted_ns as f64 / 1e9,
            desired_incisal_m: self.jaw.bands(Place::Desired as usize),
            actual_incisal_m: self.jaw.bands(Place::Actual as usize),
            estimated_incisal_m: self.jaw.bands(Place::Estimated as usize),
            distance_m: self.jaw.highest(DISTANCE),
            angle_rad: self.jaw.highest(ANGLE),
            controller_late_ns: self.late.highest(CONTROLLER),
            plant_late_ns: self.late.highest(PLANT),
            position_m: self.axes.bands(POSITION),
            reported_m: self.reported_m.bands(0),
            velocity_m_s: self.axes.bands(VELOCITY),
            force_n: self.axes.bands(FORCE),
            smooth_force_n: self.smooth_force_n.bands(0),
            bite_force_n: self.axes.band(BITE_FORCE),
            bus_load: self.busy_ns.iter().map(|bus| self.recorded(load(bus))).collect(),
            signals: (0..signals).map(|place| self.signals.band(place)).collect(),
        }
    }
}

/// What the teeth of the emulated jaw bore.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ContactFigures {
    /// The greatest sum of the forces on all teeth, N.
    pub total_max_n: f64,
    /// When that was, ns of the run's clock.
    pub total_max_at_ns: u64,
    /// The lower teeth, in the order of their numbers.
    pub teeth: Vec<ToothFigures>,
    /// What the teeth bore over time, as often as a screen shows it; of a long run not to its end.
    #[serde(skip)]
    pub moments: Vec<ToothLoads>,
}

/// What a tooth bore.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ToothFigures {
    /// FDI number.
    pub number: u32,
    /// Where its force acts, platform frame, m.
    pub place_m: [f64; 3],
    /// The greatest force on it, N.
    pub max_n: f64,
    /// The force on it when the sum of all was greatest, base axes, N.
    pub at_total_max_n: [f64; 3],
    /// The greatest force in each stretch of time, with its own time since the run's first SYNC, s and N.
    #[serde(skip)]
    pub course_n: Curve,
}

/// What the teeth bore when their sum was greatest within the time of a frame on a screen.
#[derive(Debug, Clone, PartialEq)]
pub struct ToothLoads {
    /// When, s since the run's first SYNC.
    pub at_s: f64,
    /// Place of a tooth in the list of teeth, and the force on it, base axes, N; those without a force are left out.
    pub forces_n: Vec<(usize, [f64; 3])>,
    total_n: f64,
}

/// Length of a frame, s, and the frames that are kept.
const FRAME_S: f64 = 1.0 / 60.0;
const MOST_FRAMES: usize = 2048;
/// Less is no force to be shown, N.
const LEAST_N: f64 = 0.1;

/// Collects them.
#[derive(Debug, Clone, Default)]
pub(super) struct ContactWatch {
    moments: Vec<ToothLoads>,
    frame_ends_s: f64,
    total_max_n: f64,
    greatest: Contact,
    max_n: [f64; MOST_PAIRS],
    courses: Series<Extremes<MOST_PAIRS>>,
    /// The newest message, which names the teeth.
    newest: Option<Contact>,
}

impl ContactWatch {
    /// Takes a message, sampled so long after the run's first SYNC; `None` if no course is shown.
    pub(super) fn add_contact(&mut self, contact: &Contact, since_ns: Option<u64>) {
        let mut total_n = 0.0;
        for (place, tooth) in contact.teeth().enumerate() {
            let load_n = tooth.load_n();
            total_n += load_n;
            self.max_n[place] = self.max_n[place].max(load_n);
            if let Some(since_ns) = since_ns {
                self.courses.add(since_ns, place, load_n);
            }
        }
        if let Some(since_ns) = since_ns {
            self.add_moment(since_ns as f64 / 1e9, total_n, contact);
        }
        if total_n > self.total_max_n {
            (self.total_max_n, self.greatest) = (total_n, *contact);
        }
        self.newest = Some(*contact);
    }

    fn add_moment(&mut self, at_s: f64, total_n: f64, contact: &Contact) {
        let is_of_last = at_s < self.frame_ends_s;
        let is_less = self.moments.last().is_some_and(|last| is_of_last && total_n <= last.total_n);
        if total_n < LEAST_N || is_less {
            return;
        }
        if is_of_last {
            self.moments.pop();
        } else if self.moments.len() == MOST_FRAMES {
            return;
        } else {
            self.frame_ends_s = at_s + FRAME_S;
        }
        let loaded = contact.teeth().enumerate().filter(|(_, tooth)| tooth.load_n() >= LEAST_N);
        let forces_n = loaded.map(|(place, tooth)| (place, tooth.force_n)).collect();
        self.moments.push(ToothLoads { at_s, forces_n, total_n });
    }

    /// The figures; none without a message.
    pub(super) fn into_figures(self) -> Option<ContactFigures> {
        let greatest: Vec<_> = self.greatest.teeth().collect();
        let tooth = |(place, tooth): (usize, ToothContact)| ToothFigures {
            number: tooth.number,
            place_m: tooth.place_m,
            max_n: self.max_n[place],
            at_total_max_n: greatest.get(place).map_or([0.0; 3], |tooth| tooth.force_n),
            course_n: self.courses.highest(place),
        };
        Some(ContactFigures {
            total_max_n: self.total_max_n,
            total_max_at_ns: self.greatest.sampled_ns,
            teeth: self.newest?.teeth().enumerate().map(tooth).collect(),
            moments: self.moments,
        })
    }
}

/// Cycles in a row of which every command and reading must be there: a drive settles from a lost one.
const UNDISTURBED: u64 = 12;

/// The largest magnitudes of an axis.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct AxisFigures {
    /// Distance of the position from the target that should be reached, m.
    pub following_error_m: f64,
    /// Force of the drive, N.
    pub force_n: f64,
}

/// Collects them.
#[derive(Debug, Clone, Default)]
pub(super) struct AxisWatch {
    /// From a command to the reading of the position that its targets lead to.
    lead_cycles: u64,
    targets_m: ByCycle<[f64; AXES]>,
    /// Positions and forces.
    found: ByCycle<([f64; AXES], [f64; AXES])>,
    pub(super) figures: [AxisFigures; AXES],
}

impl AxisWatch {
    pub(super) fn new(scenario: &Scenario) -> Self {
        Self { lead_cycles: scenario.controller.lead_cycles.round() as u64, ..Self::default() }
    }

    pub(super) fn apply_command(&mut self, command: &Command) {
        if command.controller_state == ControllerState::Running.code() {
            self.targets_m.insert(command.cycle, command.target_m);
            self.compare(command.cycle);
        }
    }

    pub(super) fn apply_reading(&mut self, reading: &Reading) {
        self.found.insert(reading.cycle, (reading.position_m, reading.force_n));
        self.compare(reading.cycle.saturating_sub(self.lead_cycles));
    }

    /// Compares the targets of a cycle with the positions that they led to, once both are known.
    fn compare(&mut self, cycle: u64) {
        let pair = self.targets_m.get(cycle).zip(self.found.get(cycle + self.lead_cycles));
        let Some((targets_m, (positions_m, forces_n))) = pair else { return };
        let is_there = |cycle: u64| {
            self.targets_m.get(cycle).is_some() && self.found.get(cycle + self.lead_cycles).is_some()
        };
        if !(cycle.saturating_sub(UNDISTURBED)..cycle).all(is_there) {
            return;
        }
        for (axis, figures) in self.figures.iter_mut().enumerate() {
            let error_m = (targets_m[axis] - positions_m[axis]).abs();
            figures.following_error_m = figures.following_error_m.max(error_m);
            figures.force_n = figures.force_n.max(forces_n[axis].abs());
        }
    }
}

#[cfg(test)]
mod tests;
