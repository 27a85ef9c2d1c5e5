//! Jaw, axes, wake-ups and buses of a run over time, for plots.

use masseter_can::Tapped;
use masseter_can::{Bitrate, wire};
use masseter_model::geometry::{AXES, Pose, Vec3};
use masseter_runtime::messages::{MOST_VALUES, Reading, Signals, Truth};

use super::series::{Curve, Extremes, Series};
use super::smoothing::Smoothing;
use super::tracking::PathSample;

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
    /// Time that frames took on each bus.
    busy_ns: Vec<Series<u64>>,
    signals: Series<Extremes<MOST_VALUES>>,
    bitrate: Option<Bitrate>,
}

/// Indices of the incisal point's place along x, y and z, desired, actual and estimated; of the distance and of the angle
/// between desired and actual.
const DESIRED: usize = 0;
const ACTUAL: usize = 3;
const ESTIMATED: usize = 6;
const DISTANCE: usize = 9;
const ANGLE: usize = 10;

/// Quantities of the axes.
const POSITION: usize = 0;
const VELOCITY: usize = 1;
const FORCE: usize = 2;
/// Index of the bite force behind the values of the axes.
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
        self.late.take(since_ns, process, woke_ns.saturating_sub(due_ns) as f64);
    }

    /// The desired pose of a sample, and how far the actual one is from it.
    pub(super) fn path(&mut self, sample: &PathSample) {
        let since_ns = self.since(sample.sampled_ns);
        self.jaw.take(since_ns, DISTANCE, sample.deviation.incisal_m);
        self.jaw.take(since_ns, ANGLE, sample.deviation.angle_rad);
        self.incisal(since_ns, DESIRED, sample.desired.as_ref());
    }

    /// The actual pose of the platform.
    pub(super) fn actual(&mut self, sampled_ns: u64, pose: Option<&Pose>) {
        let since_ns = self.since(sampled_ns);
        self.incisal(since_ns, ACTUAL, pose);
    }

    /// The pose that forward kinematics found.
    pub(super) fn estimated(&mut self, sampled_ns: u64, pose: Option<&Pose>) {
        let since_ns = self.since(sampled_ns);
        self.incisal(since_ns, ESTIMATED, pose);
    }

    /// The motion plays in this sample.
    pub(super) fn running(&mut self, sampled_ns: u64) {
        self.motion_began_ns.get_or_insert(sampled_ns);
    }

    fn incisal(&mut self, since_ns: u64, first: usize, pose: Option<&Pose>) {
        let Some(pose) = pose else { return };
        let place_m = pose.translation.vector + pose.rotation * Vec3::from(self.incisal_m);
        place_m
            .iter()
            .enumerate()
            .for_each(|(axis, place_m)| self.jaw.take(since_ns, first + axis, *place_m));
    }

    pub(super) fn truth(&mut self, truth: &Truth) {
        let since_ns = self.since(truth.sampled_ns);
        self.axis(since_ns, POSITION, truth.joint_m);
        self.axis(since_ns, VELOCITY, truth.joint_m_s);
        self.force(since_ns, truth.force_n);
        self.axes.take(since_ns, BITE_FORCE, truth.bite_force_n);
    }

    /// Positions and forces that the drives of the robot report, which has no truth.
    pub(super) fn reported(&mut self, reading: &Reading) {
        let since_ns = self.since(reading.sampled_ns);
        self.axis(since_ns, POSITION, reading.position_m);
        self.force(since_ns, reading.force_n);
    }

    fn force(&mut self, since_ns: u64, force_n: [f64; AXES]) {
        self.axis(since_ns, FORCE, force_n);
        let Some((at_ns, mean_n)) = self.smoothing.take(since_ns, force_n) else { return };
        for (axis, mean_n) in mean_n.into_iter().enumerate() {
            self.smooth_force_n.take(at_ns, axis, mean_n);
        }
    }

    fn axis(&mut self, since_ns: u64, quantity: usize, values: [f64; AXES]) {
        for (axis, value) in values.into_iter().enumerate() {
            self.axes.take(since_ns, quantity * AXES + axis, value);
        }
    }

    pub(super) fn signals(&mut self, message: &Signals) {
        let since_ns = self.since(message.published_ns);
        for (place, &value) in message.signals.as_slice().iter().enumerate() {
            self.signals.take(since_ns, place, value);
        }
    }

    pub(super) fn frame(&mut self, time_ns: u64, bus: usize, tapped: &Tapped) {
        let since_ns = self.since(time_ns);
        if let Some((received, bitrate)) = tapped.frame().zip(self.bitrate) {
            let busy_ns = bitrate.bits_to_ns(wire::frame_bits(&received.frame));
            let buses = self.busy_ns.len().max(bus + 1);
            self.busy_ns.resize_with(buses, || Series::of_width(WIDE_NS));
            *self.busy_ns[bus].at(since_ns) += busy_ns;
        }
    }

    /// The values, with those of this many signals.
    pub(super) fn finish(self, signals: usize) -> OverTime {
        let bands = |quantity: usize| std::array::from_fn(|axis| self.axes.band(quantity * AXES + axis));
        let places = |first: usize| std::array::from_fn(|axis| self.jaw.band(first + axis));
        let load = |bus: &Series<u64>| {
            let full_ns = bus.width_s() * 1e9;
            bus.iter().map(|(at_s, busy_ns)| (at_s, *busy_ns as f64 / full_ns)).collect()
        };
        OverTime {
            began_ns: self.began_ns.unwrap_or(0),
            motion_began_ns: self.motion_began_ns,
            duration_s: self.lasted_ns as f64 / 1e9,
            desired_incisal_m: places(DESIRED),
            actual_incisal_m: places(ACTUAL),
            estimated_incisal_m: places(ESTIMATED),
            distance_m: self.jaw.highest(DISTANCE),
            angle_rad: self.jaw.highest(ANGLE),
            controller_late_ns: self.late.highest(CONTROLLER),
            plant_late_ns: self.late.highest(PLANT),
            position_m: bands(POSITION),
            velocity_m_s: bands(VELOCITY),
            force_n: bands(FORCE),
            smooth_force_n: std::array::from_fn(|axis| self.smooth_force_n.band(axis)),
            bite_force_n: self.axes.band(BITE_FORCE),
            bus_load: self.busy_ns.iter().map(load).collect(),
            signals: (0..signals).map(|place| self.signals.band(place)).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use masseter_can::TappedFrame;
    use masseter_can::{Bitrate, CanId, Frame};
    use masseter_model::geometry::Deviation;

    use super::*;

    #[test]
    fn a_bus_that_is_half_full_is_said_to_be() {
        let frame = Frame::fixed(CanId::standard(0x123).unwrap(), [0x55; 8]);
        let bits = wire::frame_bits(&frame);
        let mut collector = OverTimeCollector::new([0.0; 3], Some(Bitrate::new(2 * 1000 * bits).unwrap()));
        for millisecond in 0..1000 {
            let time_ns = millisecond * 1_000_000;
            collector.frame(time_ns, 0, &Tapped::Frame(TappedFrame { frame, time_ns, queued_ns: None }));
        }
        let over_time = collector.finish(0);
        assert_eq!(over_time.bus_load.len(), 1);
        assert!(over_time.bus_load[0].iter().all(|(_, share)| (share - 0.5).abs() < 1e-3));
    }

    /// The platform moves by 1 mm a cycle, and from cycle 20 on without a desired pose.
    #[test]
    fn the_incisal_point_is_followed_in_the_whole_run_and_its_path_to_its_end() {
        let mut collector = OverTimeCollector::new([0.03, 0.0, -0.01], None);
        for cycle in 0..40_u64 {
            let sampled_ns = 5_000_000 + cycle * 1_000_000;
            let x = cycle as f64 * 1e-3;
            let pose = Pose::translation(x, 0.0, 0.0);
            collector.actual(sampled_ns, Some(&pose));
            if cycle < 20 {
                let desired = Some(Pose::translation(x + 1e-3, 0.0, 0.0));
                let deviation = Deviation { origin_m: 9.0, incisal_m: 1e-3, angle_rad: 9.0 };
                collector.path(&PathSample { sampled_ns, desired, deviation });
            }
        }
        let over_time = collector.finish(0);
        assert!((over_time.duration_s - 0.039).abs() < 1e-12);
        let ends = |curve: &Curve| [curve[0], curve[curve.len() - 1]];
        assert_eq!(ends(&over_time.actual_incisal_m[0]), [(0.0, 0.03), (0.039, 0.069)]);
        assert_eq!(ends(&over_time.desired_incisal_m[0]), [(0.0, 0.031), (0.019, 0.05)]);
        assert_eq!(ends(&over_time.actual_incisal_m[2]), [(0.0, -0.01), (0.039, -0.01)]);
        assert!(over_time.distance_m.iter().all(|(_, distance_m)| (distance_m - 1e-3).abs() < 1e-12));
    }
}
