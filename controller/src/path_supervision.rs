//! Supervision of the platform's path: distance of the incisal point and angle of the platform, for a moment and on
//! average.
//!
//! The drives interpolate between SYNCs, and hold their targets while a command is missing. So after a SYNC or a
//! command at an unplanned time, the platform is elsewhere on its path. The motion's way in that time is no deviation,
//! but the slack.

use masseter_model::geometry::{Deviation, Mechanism, Pose, Vec3};
use masseter_runtime::messages::codes::Cause;
use masseter_scenario::Scenario;

use crate::{safety::Fault, sequencer::Estimate};

/// Least number of readings, and least time, with an effect of a disturbed one. The drives take a target at the next
/// SYNC and reach the target at the second; the motion catches up in the third. The drives' loops need milliseconds at
/// every rate.
const SHOWS_FOR: usize = 4;
const SHOWS_FOR_S: f64 = 0.004;
/// Longest time of a motion without an answer, or of drives that stop late.
const MOST_SLACK_CYCLES: f64 = 2.0;
const MOST_SLACK_S: f64 = 0.002;

/// The limits of one quantity, with its mean square.
#[derive(Debug, Clone)]
struct Supervised {
    cause: Cause,
    limit: f64,
    rms_limit: f64,
    mean_square: f64,
}

impl Supervised {
    /// Checks a value, of which `slack` is no deviation. A value that is no number is infinitely far.
    fn check_value(&mut self, value: f64, slack: f64, share: f64) -> Result<(), Fault> {
        let beyond_slack = value - slack;
        let deviation = if beyond_slack.is_finite() { beyond_slack.max(0.0) } else { f64::INFINITY };
        self.mean_square += (deviation * deviation - self.mean_square) * share;
        let rms = self.mean_square.sqrt();
        if deviation > self.limit {
            Err(Fault::new(self.cause, value, self.limit + slack))
        } else if rms > self.rms_limit {
            Err(Fault::new(self.cause, rms, self.rms_limit))
        } else {
            Ok(())
        }
    }
}

/// Supervision of the platform's pose.
#[derive(Debug, Clone)]
pub(crate) struct PathSupervision {
    incisal_m: [f64; 3],
    period_ns: u64,
    /// Weight of a cycle in the mean squares.
    share: f64,
    position: Supervised,
    orientation: Supervised,
    last_sampled_ns: u64,
    most_slack_cycles: f64,
    /// Difference of the last readings from their plan, in cycles.
    recent_slack: Vec<f64>,
    /// The largest of these: the platform may be so many cycles earlier or later on its path.
    pub(crate) slack_cycles: f64,
}

impl PathSupervision {
    pub(crate) fn new(scenario: &Scenario) -> Self {
        let (config, period_s) = (&scenario.controller, scenario.period_s());
        let (limit_rad, rms_limit_rad) = (config.tracking_limit_rad, config.tracking_rms_limit_rad);
        let supervised = |cause, limit, rms_limit| Supervised { cause, limit, rms_limit, mean_square: 0.0 };
        Self {
            incisal_m: scenario.jaw.reference_point_m,
            period_ns: scenario.period_ns(),
            share: (period_s / config.tracking_rms_time_s).min(1.0),
            position: supervised(Cause::TrackingLost, config.tracking_limit_m, config.tracking_rms_limit_m),
            orientation: supervised(Cause::OrientationLost, limit_rad, rms_limit_rad),
            last_sampled_ns: 0,
            most_slack_cycles: MOST_SLACK_CYCLES.max(MOST_SLACK_S / period_s),
            recent_slack: vec![0.0; SHOWS_FOR.max((SHOWS_FOR_S / period_s).ceil() as usize)],
            slack_cycles: 0.0,
        }
    }

    /// Updates the slack by the time and the answer of a new estimate.
    pub(crate) fn update_slack(&mut self, estimate: &Estimate) {
        let Estimate { reading_cycle, answers_cycle, sampled_ns, .. } = *estimate;
        let apart_ns = sampled_ns.saturating_sub(self.last_sampled_ns);
        let late_cycles = apart_ns.abs_diff(self.period_ns) as f64 / self.period_ns as f64;
        let unanswered = reading_cycle.saturating_sub(answers_cycle + 1) as f64;
        self.last_sampled_ns = sampled_ns;
        self.recent_slack.rotate_right(1);
        self.recent_slack[0] = late_cycles.max(unanswered).min(self.most_slack_cycles);
        self.slack_cycles = self.recent_slack.iter().copied().fold(0.0, f64::max);
    }

    /// Compares desired and estimated pose at one instant; `earlier` is the desired pose by the slack before.
    pub(crate) fn check_pose(
        &mut self,
        desired: &Pose,
        estimated: &Pose,
        earlier: &Pose,
    ) -> Result<(), Fault> {
        let between = |to| Deviation::between(desired, to, self.incisal_m);
        let (found, slack) = (between(estimated), between(earlier));
        let position = self.position.check_value(found.incisal_m, slack.incisal_m, self.share);
        let orientation = self.orientation.check_value(found.angle_rad, slack.angle_rad, self.share);
        position.and(orientation)
    }
}

/// The check that the jaw is near enough to the first pose of the motion for easing.
#[derive(Debug, Clone)]
pub(crate) struct StartTolerance {
    /// None for a way of any length.
    limit_m: Option<f64>,
    /// The incisal point and the corners of the platform, platform frame: no turn leaves all of them in place.
    points: [Vec3; 4],
}

impl StartTolerance {
    pub(crate) fn new(scenario: &Scenario, mechanism: &Mechanism) -> Self {
        let [a1, a2, a3] = *mechanism.platform_corners();
        let points = [Vec3::from(scenario.jaw.reference_point_m), a1, a2, a3];
        Self { limit_m: scenario.start_tolerance_m(), points }
    }

    /// Refuses a start with a point farther from its place in the first pose than allowed.
    pub(crate) fn check_way(&self, found: &Pose, first: &Pose) -> Result<(), Fault> {
        let Some(limit_m) = self.limit_m else { return Ok(()) };
        let place = |pose: &Pose, point: &Vec3| pose.rotation * point + pose.translation.vector;
        let distances_m = self.points.iter().map(|point| (place(found, point) - place(first, point)).norm());
        let farthest_m = distances_m.fold(0.0, f64::max);
        if farthest_m <= limit_m {
            return Ok(());
        }
        Err(Fault::new(Cause::StartTooFar, farthest_m, limit_m))
    }
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::{Actuators, LEGS, MechanismConfig};
    use masseter_scenario::{ControllerConfig, JawConfig};

    use super::*;
    use crate::kinematics::ForwardTracker;

    const LIMIT_M: f64 = 1e-3;
    const LIMIT_RAD: f64 = 2e-3;

    /// The incisal point is in the axis of the turns, so that they do not move it.
    fn supervision() -> PathSupervision {
        let controller = ControllerConfig {
            tracking_limit_m: LIMIT_M,
            tracking_limit_rad: LIMIT_RAD,
            tracking_rms_time_s: 0.01,
            tracking_rms_limit_m: LIMIT_M / 2.0,
            tracking_rms_limit_rad: LIMIT_RAD / 2.0,
            ..ControllerConfig::default()
        };
        let jaw = JawConfig { reference_point_m: [0.0, 0.0, 0.1], ..JawConfig::default() };
        PathSupervision::new(&Scenario { controller, jaw, ..Scenario::default() })
    }

    type Displace = fn(Vec3) -> Pose;
    const QUANTITIES: [(Cause, Displace, f64); 2] =
        [(Cause::TrackingLost, shifted, LIMIT_M), (Cause::OrientationLost, turned, LIMIT_RAD)];

    fn shifted(limits: Vec3) -> Pose {
        Pose::new(limits * LIMIT_M, Vec3::zeros())
    }

    fn turned(limits: Vec3) -> Pose {
        Pose::new(Vec3::zeros(), limits * LIMIT_RAD)
    }

    #[test]
    fn a_moment_beyond_its_limit_in_any_direction_is_a_fault_with_value_and_limit() {
        let here = Pose::identity();
        for (cause, displace, limit) in QUANTITIES {
            for direction in [Vec3::x(), -Vec3::x(), Vec3::y(), -Vec3::y(), Vec3::z(), -Vec3::z()] {
                let mut supervision = supervision();
                supervision.check_pose(&here, &displace(direction * 0.99), &here).unwrap();
                let fault = supervision.check_pose(&here, &displace(direction * 1.01), &here).unwrap_err();
                assert_eq!((fault.cause, fault.axis, fault.limit), (cause, None, limit));
                assert!((fault.value / (1.01 * limit) - 1.0).abs() < 1e-9, "{fault:?}");
            }
        }
    }

    /// A position that is no number stops by the position. A turn that is no number gives no incisal point either.
    #[test]
    fn a_pose_that_is_no_number_is_a_fault_wherever_it_stands() {
        let here = Pose::identity();
        for number in [f64::NAN, f64::INFINITY] {
            for nowhere in [Pose::translation(0.0, number, 0.0), Pose::new(Vec3::zeros(), Vec3::x() * number)]
            {
                for [desired, estimated, earlier] in
                    [[&nowhere, &here, &here], [&here, &nowhere, &here], [&here, &here, &nowhere]]
                {
                    let fault = supervision().check_pose(desired, estimated, earlier).unwrap_err();
                    assert_eq!(fault.cause, Cause::TrackingLost);
                }
            }
        }
        for (value, slack) in [(f64::NAN, 0.0), (0.0, f64::NAN), (f64::INFINITY, f64::INFINITY)] {
            let PathSupervision { position, orientation, .. } = &mut supervision();
            position.check_value(value, slack, 1.0).unwrap_err();
            orientation.check_value(value, slack, 1.0).unwrap_err();
        }
    }

    #[test]
    fn at_its_limits_a_value_is_no_fault() {
        let mut supervised =
            Supervised { cause: Cause::TrackingLost, limit: 0.5, rms_limit: 0.5, mean_square: 0.0 };
        assert_eq!(supervised.check_value(0.5, 0.0, 1.0), Ok(()));
    }

    #[test]
    fn an_average_beyond_its_limit_is_a_fault_that_a_short_deviation_is_not() {
        let here = Pose::identity();
        for (cause, displace, limit) in QUANTITIES {
            let cycles_to_fault = |share: f64| {
                let mut supervision = supervision();
                (1..=1000).find_map(|cycle| {
                    Some((cycle, supervision.check_pose(&here, &displace(Vec3::z() * share), &here).err()?))
                })
            };
            assert_eq!(cycles_to_fault(0.99 / 2.0), None);
            let (cycle, fault) = cycles_to_fault(1.01 / 2.0).unwrap();
            assert!(cycle > 20 && fault.cause == cause, "{cycle} {fault:?}");
            assert!((fault.limit - limit / 2.0).abs() < 1e-15 && fault.value > fault.limit, "{fault:?}");
            let (cycle, _) = cycles_to_fault(0.99).unwrap();
            assert!((2..5).contains(&cycle), "{cycle}");
        }
    }

    #[test]
    fn what_the_motion_makes_in_the_time_of_a_disturbance_is_no_deviation() {
        let here = Pose::identity();
        for (cause, displace, limit) in QUANTITIES {
            let mut supervision = supervision();
            supervision.check_pose(&here, &displace(Vec3::z() * -3.99), &displace(Vec3::z() * 3.0)).unwrap();
            let fault = supervision
                .check_pose(&here, &displace(Vec3::z() * -4.01), &displace(Vec3::z() * 3.0))
                .unwrap_err();
            assert!(fault.cause == cause && (fault.limit / limit - 4.0).abs() < 1e-9, "{fault:?}");
        }
    }

    /// A SYNC 0.3 periods late, two skipped, and a command that came too late for its SYNC.
    #[test]
    fn readings_at_unplanned_times_and_unanswered_commands_give_slack_for_a_while() {
        let readings = [(1, 1.0, 0.0), (2, 2.3, 0.3), (3, 3.0, 0.3), (6, 6.0, 2.0), (7, 7.0, 2.0)];
        let mut supervision = supervision();
        let mut slack = |reading_cycle: u64, answers_cycle, sampled_cycles: f64| {
            let sampled_ns = (sampled_cycles * 1e6) as u64;
            supervision.update_slack(&estimate(reading_cycle, answers_cycle, sampled_ns));
            supervision.slack_cycles
        };
        for (cycle, sampled_cycles, expected) in readings {
            assert!((slack(cycle, cycle - 1, sampled_cycles) - expected).abs() < 1e-9, "cycle {cycle}");
        }
        for (cycle, expected) in [(8, 2.0), (9, 2.0), (10, 0.0), (11, 0.0)] {
            assert!((slack(cycle, cycle - 1, cycle as f64) - expected).abs() < 1e-9, "cycle {cycle}");
        }
        assert!((slack(12, 10, 12.0) - 1.0).abs() < 1e-9);
    }

    fn estimate(reading_cycle: u64, answers_cycle: u64, sampled_ns: u64) -> Estimate {
        let measured = Actuators { slide_m: [0.0; LEGS], leg_m: [0.29; LEGS] };
        let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
        let solution = ForwardTracker::new(mechanism).update(&measured).unwrap();
        Estimate { reading_cycle, answers_cycle, sampled_ns, measured, force_n: [0.0; 6], solution }
    }

    fn tolerance(interfaces: &[&str], tolerance_mm: Option<f64>) -> StartTolerance {
        let mut scenario = Scenario::default();
        scenario.can.interfaces = interfaces.iter().map(|&name| name.to_owned()).collect();
        scenario.controller.start_tolerance_mm = tolerance_mm;
        StartTolerance::new(&scenario, &Mechanism::new(&MechanismConfig::default()).unwrap())
    }

    #[test]
    fn the_way_is_limited_on_real_interfaces_and_where_the_scenario_says_so() {
        let first = Pose::identity();
        let found = Pose::translation(0.0, 0.0, 3e-3);
        assert_eq!(tolerance(&[], None).check_way(&found, &first), Ok(()));
        assert_eq!(tolerance(&["can0", "can1"], Some(3.1)).check_way(&found, &first), Ok(()));
        for limited in [tolerance(&["can0", "can1"], None), tolerance(&[], Some(2.0))] {
            let fault = limited.check_way(&found, &first).unwrap_err();
            assert_eq!((fault.cause, fault.limit), (Cause::StartTooFar, 2e-3));
            assert!((fault.value - 3e-3).abs() < 1e-12);
        }
    }

    #[test]
    fn a_turn_counts_too() {
        let turned = Pose::new(Vec3::zeros(), Vec3::new(0.2, 0.0, 0.0));
        assert!(tolerance(&[], Some(2.0)).check_way(&turned, &Pose::identity()).is_err());
    }
}
