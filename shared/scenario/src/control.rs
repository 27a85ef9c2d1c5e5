//! Control, execution and judgement of a run: `[controller]`, `[limits]`, `[dry]`, `[realtime]`, `[recording]` and
//! `[checks]`.

use masseter_can::codes;
use masseter_model::{dynamics::DynamicsConfig, geometry::LEGS};
use serde::{Deserialize, Serialize};

use super::error::{Checked, LONGEST_S, ranges_of, require};
use super::{DrivesConfig, dynamics};
use crate::wording::shortest;

/// The controller extrapolates the motion by this time. SYNC takes one cycle, the drives' interpolation one, and
/// smoothing in the drives some more.
pub const MOST_LEAD_CYCLES: usize = 10;
/// Smallest lead, cycles. The rate divided by the lead is the largest integral gain, which must be finite.
const LEAST_LEAD_CYCLES: f64 = 1e-3;

/// Shortest move to the first pose, s. From the default start, 7 mm away, this move takes half of the legs' velocity;
/// drives cannot follow a shorter move.
const SHORTEST_EASE_S: f64 = 0.1;

codes! {
    /// State of the controller's sequence.
    ControllerState as u32 {
        /// No steady readings yet; drives off.
        WaitReadings = 0 "wait_readings",
        /// Bringing all drives to operation enabled, holding where they are.
        Enabling = 1 "enabling",
        /// Easing from the measured pose to the first pose of the motion.
        Easing = 2 "easing",
        /// Playing the motion.
        Running = 3 "running",
        /// Holding the last pose.
        Holding = 4 "holding",
        /// Switching the drives off.
        Disabling = 5 "disabling",
        /// Done: drives off.
        Finished = 6 "finished",
        /// Stopped by a fault: quick stop requested, nothing moves again.
        SafeStop = 7 "safe_stop",
    }
}

section! {
    /// Sequence, pose control and safety of the controller.
    #[derive(Copy)]
    pub struct ControllerConfig {
        /// Consecutive complete readings before the drives are switched on.
        pub steady_readings: u32 = 10 => Positive,
        /// Longest time for each of: the first readings, switching the drives off. Switching them on may take
        /// `can.ready_timeout_ms` and `can.enable_timeout_ms` more.
        pub start_timeout_s: f64 = 5.0 => UpTo(LONGEST_S) "more than the drives take to boot at `rate_hz`",
        /// Duration of the move from the measured pose to the first one of the motion.
        pub ease_s: f64 = 1.0 => Within(SHORTEST_EASE_S, LONGEST_S),
        /// Distance from the first pose of the motion beyond which the run does not start: the largest of the incisal
        /// point and the corners of the platform. By default 2 mm on real interfaces, and any on simulated buses.
        pub start_tolerance_mm: Option<f64> = None => Positive,
        /// Time in the last pose before the drives are switched off.
        pub hold_s: f64 = 0.2 => UpTo(LONGEST_S),
        /// Time in which an interrupted motion comes to rest.
        pub stop_ramp_s: f64 = 0.3 => UpTo(LONGEST_S),
        /// Time that a controller may take beyond its waits, its moves and the motion, until it begins the motion, and until it
        /// ends. Then the plant stops the drives, and the run fails.
        pub overdue_s: f64 = 10.0 => UpTo(LONGEST_S),
        /// From the sample of a reading to the instant at which the targets of its command are reached: a cycle until
        /// SYNC, and what the drives interpolate over.
        pub lead_cycles: f64 = 2.0 => Within(LEAST_LEAD_CYCLES, MOST_LEAD_CYCLES as f64),
        /// Integral gain of the pose control. With more than `rate_hz` / `lead_cycles` an error would be corrected more
        /// than once before the first correction shows.
        pub integral_gain_per_s: f64 = 5.0 => Positive "at most `rate_hz` / `lead_cycles`",
        /// The most that pose control may add to the desired position.
        pub trim_limit_m: f64 = 1e-3 => Positive,
        /// The most that pose control may add to the desired orientation.
        pub trim_limit_rad: f64 = 0.02 => Positive,
        /// Cycles without a fresh, complete reading before the controller stops safely.
        pub stale_cycles: u32 = 20 => Positive,
        /// Distance of the incisal point from its desired position at which the controller stops safely.
        pub tracking_limit_m: f64 = 0.2e-3 => Positive,
        /// Angle of the platform to its desired orientation at which the controller stops safely.
        pub tracking_limit_rad: f64 = 3.5e-3 => Positive,
        /// Time constant of the mean squares of that distance and that angle.
        pub tracking_rms_time_s: f64 = 0.05 => Positive,
        /// Root mean square distance at which the controller stops safely.
        pub tracking_rms_limit_m: f64 = 0.1e-3 => Positive,
        /// Root mean square angle at which the controller stops safely.
        pub tracking_rms_limit_rad: f64 = 1.75e-3 => Positive,
        /// Whether the drives are sent the forces that the desired motion needs (60B2h).
        pub feed_forward_torque: bool = false => "`true` needs 60B2h in `drive_profile.pdos.rpdo1` of every drive",
        /// Masses and friction that the controller believes in. A key that is absent is that of `[dynamics]`.
        pub model: Option<DynamicsConfig> = None,
    }
}

impl ControllerConfig {
    /// Start tolerance on real interfaces, mm. A person can put the jaw so near to the first pose; a wrong zero of an
    /// encoder is mostly farther away.
    pub(super) const START_TOLERANCE_MM: f64 = 2.0;

    /// The largest integral gain at this rate of cycles, 1/s.
    pub fn most_integral_gain_per_s(&self, rate_hz: u32) -> f64 {
        f64::from(rate_hz) / self.lead_cycles
    }

    pub(super) fn validate(&self, rate_hz: u32) -> Checked {
        self.check_ranges(ranges_of("controller"))?;
        self.model.as_ref().map_or(Ok(()), |model| dynamics::validate("controller.model", model))?;
        let most_per_s = self.most_integral_gain_per_s(rate_hz);
        require(
            self.integral_gain_per_s <= most_per_s,
            "controller.integral_gain_per_s",
            &shortest(self.integral_gain_per_s),
            format_args!(
                "use at most {most_per_s} (rate_hz / lead_cycles): with more, an error is corrected more than once before \
                 the first correction shows"
            ),
        )
    }
}

section! {
    /// What the axes may be asked for by a trajectory, where their drives do not allow less. Strokes are the mechanism's
    /// own.
    ///
    /// Velocities stay a quarter below the drives' own limits. Fast human chewing (0.46 s a cycle) takes 3.5 m/s² of a
    /// leg. A jaw tracker's own jumps, low-passed at 12 Hz, take up to 5.8 m/s² of a slide. The limit of 8 m/s² admits
    /// both, and refuses a motion that no jaw makes.
    #[derive(Copy)]
    pub struct TrajectoryLimitsConfig {
        /// Speed of a slide.
        pub slide_velocity_m_s: f64 = 0.15 => Positive,
        /// Speed of a leg.
        pub leg_velocity_m_s: f64 = 0.30 => Positive,
        /// Acceleration of a slide.
        pub slide_acceleration_m_s2: f64 = 8.0 => Positive,
        /// Acceleration of a leg.
        pub leg_acceleration_m_s2: f64 = 8.0 => Positive,
        /// Condition number of the 6×6 Jacobian; angular velocities are scaled by the platform's side A₁A₂.
        pub max_condition: f64 = 10.0 => Positive,
    }
}

impl TrajectoryLimitsConfig {
    /// Speed of an axis, m/s.
    pub const fn velocity_m_s(&self, axis: usize) -> f64 {
        if axis < LEGS { self.slide_velocity_m_s } else { self.leg_velocity_m_s }
    }

    /// Acceleration of an axis, m/s².
    pub const fn acceleration_m_s2(&self, axis: usize) -> f64 {
        if axis < LEGS { self.slide_acceleration_m_s2 } else { self.leg_acceleration_m_s2 }
    }

    /// The lower of these limits and the limits of the drives.
    #[must_use]
    pub fn within(self, drives: &DrivesConfig) -> Self {
        Self {
            slide_velocity_m_s: self.slide_velocity_m_s.min(drives.slide.max_velocity_m_s),
            leg_velocity_m_s: self.leg_velocity_m_s.min(drives.leg.max_velocity_m_s),
            slide_acceleration_m_s2: self.slide_acceleration_m_s2.min(drives.slide.max_acceleration_m_s2),
            leg_acceleration_m_s2: self.leg_acceleration_m_s2.min(drives.leg.max_acceleration_m_s2),
            ..self
        }
    }
}

section! {
    /// How a dry run differs from the run that it prepares. `masseter run --dry` switches it on.
    #[derive(Copy)]
    pub struct DryConfig {
        /// Whether the run is a dry one. `masseter run --dry` sets it; it then also shortens `mechanism.strokes` by the
        /// margin and divides `controller.ease_s` by the speed.
        pub is_on: bool = false,
        /// Share of the motion's speed.
        pub speed: f64 = 0.1 => Within(0.01, 0.25),
        /// Share of `max_force_n` that the master writes as the drives' limit of force (6072h).
        pub force: f64 = 0.3 => Within(0.01, 0.5),
        /// Distance that targets keep from the ends of the strokes.
        pub stroke_margin_mm: f64 = 1.0 => Within(0.0, 100.0),
    }
}

impl DryConfig {
    /// The speed of the motion in this run, as a share of its own.
    pub fn speed_now(&self) -> f64 {
        if self.is_on { self.speed } else { 1.0 }
    }

    /// The limit of force in this run, as a share of the drives' own.
    pub fn force_now(&self) -> f64 {
        if self.is_on { self.force } else { 1.0 }
    }
}

section! {
    /// The scheduling that the real-time processes request.
    #[derive(Copy, Eq)]
    pub struct RealtimeConfig {
        /// Cores of the controller and of the plant.
        pub cores: [usize; 2] = [0, 1] => "two different ones",
        /// SCHED_FIFO priority of both.
        pub priority: u8 = 80 => Within(1.0, 99.0),
        /// Whether their memory is locked.
        pub lock_memory: bool = true,
        /// `/dev/cpu_dma_latency` during a run: held at 0, so that cores poll instead of idling, or left alone; `auto`
        /// holds it on a real machine only.
        pub cpu_dma_latency: CpuDmaLatency = CpuDmaLatency::default(),
    }
}

/// The use of `/dev/cpu_dma_latency` during a run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CpuDmaLatency {
    /// Held at 0 on a real machine; left alone in a virtual one, where idling virtual cores that poll
    /// cost more than they gain.
    #[default]
    Auto,
    /// Held at 0: the cores poll instead of idling.
    Hold,
    /// Left alone.
    Leave,
}

/// Time of recording after the end of the controller, so that the recording shows a fall or a drift after the stop, s.
pub const AFTER_STOP_S: f64 = 0.5;

section! {
    /// The limits beyond which a run fails.
    #[derive(Copy)]
    pub struct ChecksConfig {
        /// Largest rms distance of the platform's origin and of the incisal point from the desired position during the
        /// motion.
        pub tracking_rms_mm: f64 = 0.1 => Positive,
        /// Largest such distance; no declared fault may lead the incisal point further before it is detected.
        pub tracking_max_mm: f64 = 0.5 => Positive,
        /// Largest rms angle of the platform to its desired orientation during the motion.
        pub tracking_rms_deg: f64 = 0.1 => Positive,
        /// Largest such angle; no declared fault may turn the platform further before it is detected.
        pub tracking_max_deg: f64 = 0.5 => Positive,
        /// By how much the motion may be late, since commands or readings were lost; the desired pose is late by no more.
        /// Beyond it the rig's controller stops.
        pub motion_lag_ms: f64 = 20.0 => Within(0.0, 1000.0),
        /// Largest way of an axis after a stop, from where it was when its drive lost power.
        pub standstill_axis_mm: f64 = 0.5 => Positive,
        /// Largest way of the incisal point after a stop, once no drive has power.
        pub standstill_jaw_mm: f64 = 0.5 => Positive,
        /// Largest angle by which the platform turns then.
        pub standstill_jaw_deg: f64 = 0.5 => Positive,
        /// Reaction time after the loss of power in which axes may coast; `drive_profile.brake.close_s` comes on top.
        pub standstill_after_ms: f64 = 0.0 => Within(0.0, 300.0),
        /// Largest number of cycles that the rig itself, controller and plant together, may miss.
        pub missed_cycles: u64 = 0,
        /// Largest share of the cycles that the machine may lose; beyond it the run is INVALID.
        pub machine_lost_percent: f64 = 5.0 => Within(0.0, 100.0),
        /// Use of a run whose cycles the machine lost: judged by its function, or INVALID.
        pub timing: TimingConfig = TimingConfig::default(),
    }
}

/// The use of a run whose cycles the machine lost.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TimingConfig {
    /// The function is judged, and the lost cycles are reported.
    #[default]
    Reported,
    /// A lost cycle makes the run INVALID.
    Strict,
}

section! {
    /// What the recording of a run contains.
    #[derive(Copy, Eq)]
    pub struct RecordingConfig {
        /// Record the CAN frames. Without them a recording is a seventh smaller; the check `bus response` is not judged,
        /// and reports, exports and `masseter diff` say that the frames are not recorded. Runs without a recording do
        /// not judge the check either.
        pub frames: bool = true,
    }
}

impl RealtimeConfig {
    pub(super) fn validate(&self) -> Checked {
        self.check_ranges(ranges_of("realtime"))?;
        let [controller, plant] = self.cores;
        let need = "name two: controller and plant wait for each other by spinning";
        require(controller != plant, "realtime.cores", &format_args!("{controller},{plant}"), need)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loop_that_looks_too_far_ahead_or_corrects_twice_is_refused() {
        let default = ControllerConfig::default();
        let table = [
            (default, 1000, None),
            (default, 10, None),
            (ControllerConfig { lead_cycles: 10.0, ..default }, 1000, None),
            (
                ControllerConfig { lead_cycles: 1000.0, ..default },
                1000,
                Some("controller.lead_cycles = 1000: use 0.001 to 10"),
            ),
            (ControllerConfig { lead_cycles: 5e-324, ..default }, 1000, Some(": use 0.001 to 10")),
            (ControllerConfig { integral_gain_per_s: 500.0, ..default }, 1000, None),
            (
                ControllerConfig { integral_gain_per_s: 1e9, ..default },
                1000,
                Some("controller.integral_gain_per_s = 1000000000: use at most 500"),
            ),
            (ControllerConfig { lead_cycles: 4.0, ..default }, 10, Some("use at most 2.5")),
        ];
        for (config, rate_hz, reason) in table {
            let said = config.validate(rate_hz).map_err(|error| error.to_string());
            match reason {
                None => assert_eq!(said, Ok(()), "{config:?}"),
                Some(reason) => assert!(said.as_ref().is_err_and(|said| said.contains(reason)), "{said:?}"),
            }
        }
    }

    #[test]
    fn targets_faster_than_a_drive_are_refused() {
        let (limits, mut drives) = (TrajectoryLimitsConfig::default(), DrivesConfig::default());
        assert_eq!(limits.within(&drives), limits);
        drives.leg.max_velocity_m_s = 0.1;
        assert_eq!(limits.within(&drives), TrajectoryLimitsConfig { leg_velocity_m_s: 0.1, ..limits });
        drives.slide.max_velocity_m_s = 0.05;
        assert_eq!(limits.within(&drives).slide_velocity_m_s.to_bits(), 0.05_f64.to_bits());
    }
}
