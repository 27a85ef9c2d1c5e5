//! Jaw, axes, wake-ups and buses of a run over time, for plots. The greatest loads are in [`loads`](crate::loads).

use masseter_can::{Bitrate, Tapped, wire};
use masseter_model::geometry::{AXES, Pose};
use masseter_runtime::messages::{MOST_VALUES, Reading, Signals, Truth};

use crate::series::{Curve, Extremes, Series, Smoothing};
use crate::{poses::place, tracking::PathSample};

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
    /// Of the emulated mechanism since the start, J: work of the drives, of friction, of everything else, and the energy of
    /// motion and height that is their sum.
    pub energy_j: [Curve; ENERGIES],
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
    /// Of the axes, the bite force, and the ledger of energy.
    axes: Series<Extremes<{ ENERGY + ENERGIES }>>,
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

/// Curves of the ledger of energy.
const ENERGIES: usize = 4;

/// Indices of the first axis in each quantity, and of the bite force and the energies behind them.
const POSITION: usize = 0;
const VELOCITY: usize = AXES;
const FORCE: usize = 2 * AXES;
const BITE_FORCE: usize = 3 * AXES;
const ENERGY: usize = BITE_FORCE + 1;

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
        self.jaw.add_all(since_ns, of as usize, place(pose, &self.incisal_m.into()).as_slice());
    }

    pub(super) fn apply_truth(&mut self, truth: &Truth) {
        let since_ns = self.since(truth.sampled_ns);
        self.axes.add_all(since_ns, POSITION, &truth.joint_m);
        self.axes.add_all(since_ns, VELOCITY, &truth.joint_m_s);
        self.force(since_ns, truth.force_n);
        self.axes.add(since_ns, BITE_FORCE, truth.bite_force_n);
        let [motors_j, slides_j, legs_j, joints_j, contact_j, others_j] = truth.work_j;
        let stored_j = truth.kinetic_j + truth.potential_j;
        let energies_j = [motors_j, slides_j + legs_j + joints_j, contact_j + others_j, stored_j];
        self.axes.add_all(since_ns, ENERGY, &energies_j);
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
            energy_j: self.axes.bands(ENERGY),
            bus_load: self.busy_ns.iter().map(|bus| self.recorded(load(bus))).collect(),
            signals: (0..signals).map(|place| self.signals.band(place)).collect(),
        }
    }
}

#[cfg(test)]
mod tests;
