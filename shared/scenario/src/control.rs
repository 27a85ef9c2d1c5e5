//! How a run is controlled, executed and judged: `[controller]`, `[limits]`, `[dry]`, `[realtime]`, `[recording]` and
//! `[checks]`.

use masseter_can::codes;
use masseter_model::dynamics::DynamicsConfig;
use masseter_model::geometry::LEGS;
use serde::{Deserialize, Serialize};

use super::error::{
    Checked, LONGEST_S, bounded, keyed, require, require_duration, require_positive, require_within,
};
use super::{DrivesConfig, dynamics};

/// SYNC takes one cycle and the drives' interpolation one; drives that smooth their targets take some more. The
/// controller extrapolates the motion by this time.
pub const MOST_LEAD_CYCLES: usize = 10;
/// Smallest lead, cycles: the largest integral gain is the rate divided by it, which must be a number.
const LEAST_LEAD_CYCLES: f64 = 1e-3;

/// From the default start, 7 mm away, the move takes half of the legs' velocity then; a shorter one is none that drives
/// follow, s.
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
        /// Complete readings in a row before the drives are switched on.
        pub steady_readings: u32 = 10,
        /// How long the first readings, and at the end the switching off of the drives, may take each, s. The enabling may
        /// take longer by `can.ready_timeout_ms` and `can.enable_timeout_ms`.
        pub start_timeout_s: f64 = 5.0,
        /// Duration of the move from the measured pose to the first pose of the motion, s.
        pub ease_s: f64 = 1.0,
        /// Distance of the jaw from the first pose of the motion from which on it does not start, mm: the largest of the
        /// incisal point and the corners of the platform. By default 2 mm on real interfaces, and any on simulated buses.
        pub start_tolerance_mm: Option<f64> = None,
        /// How long the last pose is held before the drives are switched off, s.
        pub hold_s: f64 = 0.2,
        /// How long a motion takes to come to rest when it is stopped halfway, s.
        pub stop_ramp_s: f64 = 0.3,
        /// Time from a command's reading to the moment its targets are reached, in cycles: one until SYNC
        /// makes the drives take the targets, one for their interpolation. At most 10: the motion is looked ahead by as
        /// much.
        pub lead_cycles: f64 = 2.0,
        /// Integral gain of the pose control, 1/s. At most `rate_hz` / `lead_cycles`: with more, an error would be corrected
        /// more than once before the first correction shows.
        pub integral_gain_per_s: f64 = 5.0,
        /// The most that pose control may add to the desired position, m.
        pub trim_limit_m: f64 = 1e-3,
        /// The most that pose control may add to the desired orientation, rad.
        pub trim_limit_rad: f64 = 0.02,
        /// Cycles without a fresh, complete reading after which the controller stops safely.
        pub stale_cycles: u32 = 20,
        /// Distance of the incisal point from its desired position at which the controller stops safely, m.
        /// Six times the largest of the default motions and of the default food, 0.036 mm. A drive that
        /// misses its targets in the fastest motion adds 0.14 mm a cycle at 1 kHz, so the stop comes before 0.5 mm. From
        /// 300 Hz on a first missed target stays below 0.5 mm and 0.5° too, at 100 Hz it leads to 1.1 mm and 1.5°.
        pub tracking_limit_m: f64 = 0.2e-3,
        /// Angle of the platform to its desired orientation at which the controller stops safely, rad.
        /// 0.2°, four times the largest of the default food, 0.053°; such a drive adds up to 0.18° a cycle at
        /// 1 kHz.
        pub tracking_limit_rad: f64 = 3.5e-3,
        /// Time constant of the mean squares of that distance and that angle, s.
        pub tracking_rms_time_s: f64 = 0.05,
        /// Root mean square distance at which the controller stops safely, m. Half of the limit for a moment.
        pub tracking_rms_limit_m: f64 = 0.1e-3,
        /// Root mean square angle at which the controller stops safely, rad. Half of the limit for a moment.
        pub tracking_rms_limit_rad: f64 = 1.75e-3,
        /// Whether the drives are sent the forces that the desired motion needs (60B2h).
        pub feed_forward_torque: bool = false,
        /// Masses and friction that the controller believes in. A key that is absent is that of `[dynamics]`.
        pub model: Option<DynamicsConfig> = None,
    }
}

impl ControllerConfig {
    /// Start tolerance on real interfaces, mm: a person puts the jaw so near to the first pose, and a wrong zero of an
    /// encoder is mostly farther away.
    pub(super) const START_TOLERANCE_MM: f64 = 2.0;

    /// The largest integral gain at this rate of cycles, 1/s.
    pub fn most_integral_gain_per_s(&self, rate_hz: u32) -> f64 {
        f64::from(rate_hz) / self.lead_cycles
    }

    pub(super) fn validate(&self, rate_hz: u32) -> Checked {
        require_duration(&keyed!("controller", self, start_timeout_s hold_s stop_ramp_s))?;
        require_within(&bounded!("controller", self, ease_s [SHORTEST_EASE_S, LONGEST_S]))?;
        require_positive(&keyed!("controller", self,
            steady_readings lead_cycles integral_gain_per_s trim_limit_m trim_limit_rad stale_cycles
            tracking_limit_m tracking_limit_rad tracking_rms_time_s tracking_rms_limit_m tracking_rms_limit_rad
        ))?;
        if let Some(tolerance_mm) = self.start_tolerance_mm {
            require_positive(&[("controller.start_tolerance_mm", tolerance_mm)])?;
        }
        if let Some(model) = &self.model {
            dynamics::validate(model).map_err(|error| error.of_table("controller.model"))?;
        }
        // The lead is no longer than a drive needs, and an error is corrected only once within the lead.
        require(
            (LEAST_LEAD_CYCLES..=MOST_LEAD_CYCLES as f64).contains(&self.lead_cycles),
            "controller.lead_cycles",
            &self.lead_cycles,
            format_args!(
                "use {LEAST_LEAD_CYCLES} to {MOST_LEAD_CYCLES}: one until SYNC, and what the drives interpolate over"
            ),
        )?;
        let most_per_s = self.most_integral_gain_per_s(rate_hz);
        require(
            self.integral_gain_per_s <= most_per_s,
            "controller.integral_gain_per_s",
            &self.integral_gain_per_s,
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
    /// both, and refuses what is no jaw motion.
    #[derive(Copy)]
    pub struct TrajectoryLimitsConfig {
        /// Speed of a slide, m/s.
        pub slide_velocity_m_s: f64 = 0.15,
        /// Speed of a leg, m/s.
        pub leg_velocity_m_s: f64 = 0.30,
        /// Acceleration of a slide, m/s².
        pub slide_acceleration_m_s2: f64 = 8.0,
        /// Acceleration of a leg, m/s².
        pub leg_acceleration_m_s2: f64 = 8.0,
        /// Condition number of the 6×6 Jacobian, angular velocities scaled by the platform's side A₁A₂.
        pub max_condition: f64 = 10.0,
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

    pub(super) fn validate(&self) -> Checked {
        require_positive(&keyed!("limits", self,
            slide_velocity_m_s leg_velocity_m_s slide_acceleration_m_s2 leg_acceleration_m_s2 max_condition
        ))
    }
}

section! {
    /// How a dry run differs from the run that it prepares. `masseter run --dry` switches it on.
    #[derive(Copy)]
    pub struct DryConfig {
        /// Whether the run is a dry one. `--dry` sets it, and then also shortens the strokes and lengthens `controller.ease_s`.
        pub is_on: bool = false,
        /// Speed of the motion, as a share of its own.
        pub speed: f64 = 0.1,
        /// Limit of force (object 6072), as a share of the drives' own.
        pub force: f64 = 0.3,
        /// Distance that targets keep from the ends of the strokes, mm.
        pub stroke_margin_mm: f64 = 1.0,
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

    pub(super) fn validate(&self) -> Checked {
        require_within(
            &bounded!("dry", self, speed [0.01, 0.25] force [0.01, 0.5] stroke_margin_mm [0.0, 100.0]),
        )
    }
}

section! {
    /// The scheduling that the real-time processes request.
    #[derive(Copy, Eq)]
    pub struct RealtimeConfig {
        /// Cores of the controller and of the plant.
        pub cores: [usize; 2] = [0, 1],
        /// SCHED_FIFO priority of both.
        pub priority: u8 = 80,
        /// Whether their memory is locked.
        pub lock_memory: bool = true,
        /// Whether the cores are kept from idle states for the duration of the run.
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

section! {
    /// The limits beyond which a run fails.
    #[derive(Copy)]
    pub struct ChecksConfig {
        /// Largest rms distance of the platform's origin, and of the incisal point, from the desired position while the
        /// motion plays, mm. True and estimated pose are each held against it, as against the next three limits.
        pub tracking_rms_mm: f64 = 0.1,
        /// Largest such distance, mm. No fault may lead further before it is detected.
        pub tracking_max_mm: f64 = 0.5,
        /// Largest rms angle of the platform to its desired orientation, degrees.
        pub tracking_rms_deg: f64 = 0.1,
        /// Largest such angle, degrees. No fault may turn the platform further before it is detected.
        pub tracking_max_deg: f64 = 0.5,
        /// Most cycles that the rig itself, controller and plant together, may miss.
        pub missed_cycles: u64 = 0,
        /// Largest share of the cycles that the machine may lose before nothing is left to judge the function by, %. In
        /// a run of ten seconds, 5 % are half a second.
        pub machine_lost_percent: f64 = 5.0,
        /// Whether the machine may lose any cycle.
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
        /// The CAN frames. Without them a run has no response times and no load of the buses, and no candump
        /// logs.
        pub frames: bool = true,
    }
}

impl RealtimeConfig {
    pub(super) fn validate(&self) -> Checked {
        let is_priority = (1..=99).contains(&self.priority);
        require(is_priority, "realtime.priority", &self.priority, "use 1 to 99 (SCHED_FIFO)")?;
        let [controller, plant] = self.cores;
        let need = "name two: controller and plant wait for each other by spinning";
        require(controller != plant, "realtime.cores", &format_args!("{controller},{plant}"), need)
    }
}

impl ChecksConfig {
    pub(super) fn validate(&self) -> Checked {
        require_positive(&keyed!("checks", self,
            tracking_rms_mm tracking_max_mm tracking_rms_deg tracking_max_deg
        ))?;
        require_within(&bounded!("checks", self, machine_lost_percent [0.0, 100.0]))
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
