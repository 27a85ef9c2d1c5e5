//! The controller's gains and limits, the real-time request, and what a run is judged by.

use serde::{Deserialize, Serialize};

use super::ScenarioError;
use super::need::{require_duration, require_positive};

/// Sequence, pose control and safety of the controller.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ControllerConfig {
    /// Complete readings in a row before the drives are switched on.
    pub steady_readings: u32,
    /// How long the first readings, the enabling of the drives, and at the end their switching off may take each, s.
    pub start_timeout_s: f64,
    /// Duration of the move from the measured pose to the first pose of the motion, s.
    pub ease_s: f64,
    /// How long the last pose is held before the drives are switched off, s.
    pub hold_s: f64,
    /// How long a motion takes to come to rest when it is stopped halfway, s.
    pub stop_ramp_s: f64,
    /// Time from a command's reading to the moment its targets are reached, in cycles: one until SYNC
    /// makes the drives take the targets, one for their interpolation.
    pub lead_cycles: f64,
    /// Integral gain of the pose control, 1/s.
    pub integral_gain_per_s: f64,
    /// The most that pose control may add to the wanted position, m.
    pub trim_limit_m: f64,
    /// The most that pose control may add to the wanted orientation, rad.
    pub trim_limit_rad: f64,
    /// Cycles without a fresh, complete reading after which the controller stops safely.
    pub stale_cycles: u32,
    /// Distance of the platform from where it should be at which the controller stops safely, m.
    pub tracking_limit_m: f64,
}

impl Default for ControllerConfig {
    fn default() -> Self {
        Self {
            steady_readings: 10,
            start_timeout_s: 5.0,
            ease_s: 1.0,
            hold_s: 0.2,
            stop_ramp_s: 0.3,
            lead_cycles: 2.0,
            integral_gain_per_s: 5.0,
            trim_limit_m: 1e-3,
            trim_limit_rad: 0.02,
            stale_cycles: 20,
            tracking_limit_m: 3e-3,
        }
    }
}

/// What the real-time processes ask of the system.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RealtimeConfig {
    /// Cores of the controller and of the plant.
    pub cores: [usize; 2],
    /// SCHED_FIFO priority of both.
    pub priority: u8,
    /// Whether their memory is locked.
    pub lock_memory: bool,
    /// Whether the cores are kept from idle states for the duration of the run.
    pub cpu_dma_latency: CpuDmaLatency,
}

/// What becomes of `/dev/cpu_dma_latency` during a run.
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

impl Default for RealtimeConfig {
    fn default() -> Self {
        Self { cores: [0, 1], priority: 80, lock_memory: true, cpu_dma_latency: CpuDmaLatency::default() }
    }
}

/// What makes a run fail.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ChecksConfig {
    /// Largest rms distance of the platform's origin from the wanted one while the motion plays, mm.
    pub tracking_rms_mm: f64,
    /// Most deadlines that the controller and the plant together may skip.
    pub missed_cycles: u64,
}

impl Default for ChecksConfig {
    fn default() -> Self {
        Self { tracking_rms_mm: 0.1, missed_cycles: 0 }
    }
}

impl ControllerConfig {
    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        require_duration(&[
            ("controller.start_timeout_s", self.start_timeout_s),
            ("controller.ease_s", self.ease_s),
            ("controller.hold_s", self.hold_s),
            ("controller.stop_ramp_s", self.stop_ramp_s),
        ])?;
        require_positive(&[
            ("controller.steady_readings", f64::from(self.steady_readings)),
            ("controller.lead_cycles", self.lead_cycles),
            ("controller.integral_gain_per_s", self.integral_gain_per_s),
            ("controller.trim_limit_m", self.trim_limit_m),
            ("controller.trim_limit_rad", self.trim_limit_rad),
            ("controller.stale_cycles", f64::from(self.stale_cycles)),
            ("controller.tracking_limit_m", self.tracking_limit_m),
        ])
    }
}

impl ChecksConfig {
    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        require_positive(&[("checks.tracking_rms_mm", self.tracking_rms_mm)])
    }
}
