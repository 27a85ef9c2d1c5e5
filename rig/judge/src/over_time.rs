//! Jaw, axes, wake-ups and buses of a run over time, for plots. The greatest loads are in [`loads`](crate::loads).

use masseter_can::{Bitrate, Tapped, wire};
use masseter_model::geometry::{AXES, Pose};
use masseter_runtime::messages::{Reading, Signals, Truth};

use crate::series::{Band, Curve, Smoothing, Stretches};
use crate::{poses::place, tracking::PathSample};

/// A run over time, from the first message to the last: seconds since its first SYNC.
#[derive(Debug, Clone, Default)]
pub struct OverTime {
    /// The instant that curves count from, ns of the run's clock.
    began_ns: Option<u64>,
    /// The sample with which the motion began: the first of the controller's state `running`, ns of the run's clock; none
    /// where the motion never began.
    pub motion_began_ns: Option<u64>,
    /// When the last value came, s.
    pub duration_s: f64,
    /// The incisal point in the platform frame.
    incisal_m: [f64; 3],
    /// Place of the incisal point along x, y and z of the base while it has a desired one, m.
    pub desired_incisal_m: [Band; 3],
    /// The same of the actual pose of the platform, in the whole run.
    pub actual_incisal_m: [Band; 3],
    /// The same of the pose that forward kinematics found; without truth it is the actual one.
    pub estimated_incisal_m: [Band; 3],
    /// Distance of the incisal point from its desired place, m.
    pub distance_m: Band,
    /// Angle of the platform from its desired orientation, rad.
    pub angle_rad: Band,
    /// Wake-ups of controller and plant, ns late.
    pub late_ns: [Band; 2],
    /// Position of each axis, m.
    pub position_m: [Band; AXES],
    /// Position that the drive of each axis reports, m; beside a true one alone.
    pub reported_m: [Band; AXES],
    /// Velocity of each axis, m/s.
    pub velocity_m_s: [Band; AXES],
    /// Force of each actuator, N.
    pub force_n: [Band; AXES],
    /// Its moving mean over 20 ms.
    pub smooth_force_n: [Band; AXES],
    smoothing: Smoothing<AXES>,
    /// Vertical force of food and upper teeth on the jaw, N.
    pub bite_force_n: Band,
    /// Of the emulated mechanism since the start, J: work of the drives, of friction, of everything else, and the energy of
    /// motion and height that is their sum.
    pub energy_j: [Band; 4],
    /// The controller's signals.
    pub signals: Vec<Band>,
    /// Time that frames took on each bus.
    busy_ns: Vec<Stretches<u64>>,
    bitrate: Option<Bitrate>,
}

/// Whose place of the incisal point.
#[derive(Debug, Clone, Copy)]
pub(super) enum Place {
    Desired,
    Actual,
    Estimated,
}

/// Time over which the load of a bus is a share and a wake-up the latest of several, ns.
const WIDE_NS: u64 = 10_000_000;

/// Indices of the two processes.
pub(super) const CONTROLLER: usize = 0;
pub(super) const PLANT: usize = 1;

impl OverTime {
    /// For a jaw with this incisal point in the platform frame, buses of this bit rate, and so many signals of the controller.
    /// Without a bit rate there is no load.
    pub(super) fn new(incisal_m: [f64; 3], bitrate: Option<Bitrate>, signals: usize) -> Self {
        let (late_ns, signals) = ([0; 2].map(|_| Band::of_width(WIDE_NS)), vec![Band::default(); signals]);
        Self { incisal_m, late_ns, signals, bitrate, ..Self::default() }
    }

    /// The instant that curves count from, ns of the run's clock.
    pub fn began_ns(&self) -> u64 {
        self.began_ns.unwrap_or(0)
    }

    /// A time of the run's clock since the first, ns.
    pub(super) fn since(&mut self, time_ns: u64) -> u64 {
        let since_ns = time_ns.saturating_sub(*self.began_ns.get_or_insert(time_ns));
        self.duration_s = self.duration_s.max(since_ns as f64 / 1e9);
        since_ns
    }

    pub(super) fn wake_up(&mut self, process: usize, due_ns: u64, woke_ns: u64) {
        let since_ns = self.since(due_ns);
        self.late_ns[process].add(since_ns, woke_ns.saturating_sub(due_ns) as f64);
    }

    /// The desired pose of a sample, and how far the actual one is from it.
    pub(super) fn apply_path(&mut self, sample: &PathSample) {
        let since_ns = self.since(sample.sampled_ns);
        self.distance_m.add(since_ns, sample.deviation.incisal_m);
        self.angle_rad.add(since_ns, sample.deviation.angle_rad);
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
        let bands = match of {
            Place::Desired => &mut self.desired_incisal_m,
            Place::Actual => &mut self.actual_incisal_m,
            Place::Estimated => &mut self.estimated_incisal_m,
        };
        Band::add_all(bands, since_ns, place(pose, &self.incisal_m.into()).as_slice());
    }

    pub(super) fn apply_truth(&mut self, truth: &Truth) {
        let since_ns = self.since(truth.sampled_ns);
        Band::add_all(&mut self.position_m, since_ns, &truth.joint_m);
        Band::add_all(&mut self.velocity_m_s, since_ns, &truth.joint_m_s);
        self.force(since_ns, truth.force_n);
        self.bite_force_n.add(since_ns, truth.bite_force_n);
        let [motors_j, slides_j, legs_j, joints_j, contact_j, others_j] = truth.work_j;
        let stored_j = truth.kinetic_j + truth.potential_j;
        let energies_j = [motors_j, slides_j + legs_j + joints_j, contact_j + others_j, stored_j];
        Band::add_all(&mut self.energy_j, since_ns, &energies_j);
    }

    /// Positions that drives report of an emulated mechanism. An axis without news has none.
    pub(super) fn reported_beside_truth(&mut self, reading: &Reading) {
        let since_ns = self.since(reading.sampled_ns);
        for axis in (0..AXES).filter(|axis| reading.fresh_axes >> axis & 1 == 1) {
            self.reported_m[axis].add(since_ns, reading.position_m[axis]);
        }
    }

    /// Positions and forces that the drives of the robot report, which has no truth.
    pub(super) fn reported(&mut self, reading: &Reading) {
        let since_ns = self.since(reading.sampled_ns);
        Band::add_all(&mut self.position_m, since_ns, &reading.position_m);
        self.force(since_ns, reading.force_n);
    }

    fn force(&mut self, since_ns: u64, force_n: [f64; AXES]) {
        Band::add_all(&mut self.force_n, since_ns, &force_n);
        if let Some((at_ns, mean_n)) = self.smoothing.add(since_ns, force_n) {
            Band::add_all(&mut self.smooth_force_n, at_ns, &mean_n);
        }
    }

    pub(super) fn apply_signals(&mut self, message: &Signals) {
        let since_ns = self.since(message.published_ns);
        Band::add_all(&mut self.signals, since_ns, message.signals.as_slice());
    }

    pub(super) fn apply_frame(&mut self, time_ns: u64, bus: usize, tapped: &Tapped) {
        let since_ns = self.since(time_ns);
        if let Some((received, bitrate)) = tapped.frame().zip(self.bitrate) {
            let busy_ns = bitrate.bits_to_ns(wire::frame_bits(&received.frame));
            let buses = self.busy_ns.len().max(bus + 1);
            self.busy_ns.resize_with(buses, || Stretches::of_width(WIDE_NS));
            *self.busy_ns[bus].at(since_ns) += busy_ns;
        }
    }

    /// Share of each bus in use, 0 to 1, where a reading came: where nothing came, a silent bus is no finding.
    pub fn bus_load(&self) -> impl Iterator<Item = Curve> {
        let was_recorded = |at_s: f64| self.late_ns[PLANT].has_value((at_s * 1e9) as u64);
        self.busy_ns.iter().map(move |bus| {
            let load = bus.iter().map(|(at_s, busy_ns)| (at_s, *busy_ns as f64 / (bus.width_s() * 1e9)));
            load.filter(|(at_s, _)| was_recorded(*at_s)).collect()
        })
    }
}

#[cfg(test)]
mod tests;
