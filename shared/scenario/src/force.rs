//! Estimate, measurement and control of the bite force: `[force_estimate]`, `[load_cell]` and `[force_control]`.

use std::f64::consts::{FRAC_2_PI, TAU};

use masseter_model::section::Range;
use serde::{Deserialize, Serialize};

use super::error::{Checked, ScenarioError, ranges_of, require, require_range};

/// What the estimate of the drives is fused with.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ForceFusion {
    /// Nothing: the drives alone.
    #[default]
    None,
    /// The bite force that the load cell shows.
    LoadCell,
}

section! {
    /// The estimate of the external force on the platform from the forces of the drives.
    #[derive(Copy)]
    pub struct ForceEstimateConfig {
        /// Time constant of the observer.
        pub observer_time_s: f64 = 0.003 => Within(0.0, 1.0),
        /// Time from the first estimate on in which nothing touches the jaw while it moves: friction and weight beside the
        /// model's are identified from this time, and there is no estimate until then. 0: no calibration.
        pub calibration_s: f64 = 0.0 => Within(0.0, 60.0),
        /// Whether the bite force is fused with that of the load cell, each weighted by its variance; `load_cell` needs
        /// `[load_cell]` with noise, and a calibration, which tares the cell.
        pub fusion: ForceFusion = ForceFusion::None,
        /// Share by which Coulomb, viscous and joint friction may differ from the model's. This key and those below are for the
        /// uncertainty, by which the force control judges the stiffness that a bite shows.
        pub friction_uncertainty: f64 = 0.3 => Within(0.0, 10.0),
        /// By which the breakaway ratio may exceed the model's.
        pub breakaway_uncertainty: f64 = 0.4 => Within(0.0, 2.0),
        /// By which the efficiency of a screw may differ from the model's.
        pub screw_uncertainty: f64 = 0.1 => Within(0.0, 0.5),
        /// Share by which the weight may differ from the model's.
        pub mass_uncertainty: f64 = 0.1 => Within(0.0, 10.0),
        /// Speed of an axis below which its friction may have either direction, as another law of friction gives; also the width of
        /// rest in a calibration.
        pub rest_speed_m_s: f64 = 0.002 => Within(0.0, 0.1),
    }
}

impl ForceEstimateConfig {
    /// Refuses a fusion without a cell, or with one that it cannot tare or trust. The range must exceed the peak (N) of a controlled
    /// bite: at the end of the range the force would jump to that of the drives.
    pub(super) fn require_fusible(
        &self,
        cell: Option<&LoadCellConfig>,
        is_emulated: bool,
        peak_n: f64,
    ) -> Checked {
        if self.fusion == ForceFusion::None {
            return Ok(());
        }
        let cell = require_cell("force_estimate.fusion", cell, is_emulated, "none")?;
        let need = "use a time without contact: the fusion tares the load cell in this time";
        require(self.calibration_s > 0.0, "force_estimate.calibration_s", &self.calibration_s, need)?;
        let need = "use the noise of the cell: the fusion weights the cell by it, and without noise a cell that sticks looks sound";
        require(cell.noise_n > 0.0, "load_cell.noise_n", &cell.noise_n, need)?;
        let least_range_n = cell.least_range_n(peak_n);
        let need = format!(
            "use more than {least_range_n} N, offset and five times the noise, and 1.2 times the peak of a controlled bite: \
             this cell comes to the end of its range"
        );
        require(cell.range_n > least_range_n, "load_cell.range_n", &cell.range_n, need)
    }
}

/// The load cell that the value "load_cell" of a key needs; `instead` is the value without one. Only the emulated jaw has a
/// load cell.
pub(super) fn require_cell<'a>(
    key: &str,
    cell: Option<&'a LoadCellConfig>,
    is_emulated: bool,
    instead: &str,
) -> Result<&'a LoadCellConfig, ScenarioError> {
    cell.ok_or_else(|| {
        let need = if is_emulated {
            format!("add the table [load_cell], or use {instead:?}")
        } else {
            format!("use {instead:?}: on real interfaces the rig reads no load cell")
        };
        ScenarioError::bad(key, &"\"load_cell\"", need)
    })
}

/// The course of the desired bite force from the contact on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BiteProfile {
    /// Half a sine from the force of contact to the peak and back.
    #[default]
    HalfSine,
    /// A ramp of a tenth of the bite to the peak, which is held.
    Hold,
}

/// Which force is controlled.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ForceSource {
    /// The estimate from the forces of the drives.
    #[default]
    Estimate,
    /// The measurement of the load cell.
    LoadCell,
}

section! {
    /// Control of the bite force, between contact and opening of the mouth.
    #[derive(Copy)]
    pub struct ForceControlConfig {
        /// Where the bite force is known from; `load_cell` needs `[load_cell]` and emulated drives.
        pub source: ForceSource = ForceSource::Estimate,
        /// Course of the desired force; `hold` comes to the peak within a tenth of the bite.
        pub profile: BiteProfile = BiteProfile::HalfSine,
        /// Bite force at which force control takes over.
        pub contact_n: f64 = 10.0 => Positive,
        /// Largest desired bite force.
        pub peak_n: f64 = 30.0 => "`contact_n` to 1000",
        /// Bite force, as a share of `peak_n`, above which the run ends in a safe stop (`force_limit`). The drives of the legs
        /// get a limit (6072h) of this force and 60 N for the jaw itself.
        pub overload: f64 = 1.5 => Within(1.1, 10.0),
        /// Duration of a bite.
        pub bite_s: f64 = 0.3 => Positive,
        /// Admittance: force error per closing speed, with food between the teeth.
        pub damping_n_s_per_m: f64 = 100.0 => "from the limit of stability on",
        /// The stiffest food that this damping is for.
        pub food_stiffness_n_per_m: f64 = 3500.0 => Positive,
        /// Admittance where the teeth meet.
        pub tooth_damping_n_s_per_m: f64 = 2000.0 => "from the limit of stability on",
        /// Stiffness of teeth, holder and drives in series.
        pub tooth_stiffness_n_per_m: f64 = 3.6e5 => Positive,
        /// Opening, at the platform's origin, below which the damping grows towards that of the teeth.
        pub tooth_zone_m: f64 = 5e-4 => Positive,
        /// Largest speed of closing on food, and of giving way after a bite.
        pub closing_m_s: f64 = 0.06 => Positive,
        /// Largest distance of the platform from the motion. Closing stops there; food that keeps the mouth further
        /// open ends the run in a safe stop (`law_failed`).
        pub reach_m: f64 = 0.012 => Within(0.000_001, 0.05),
        /// Control of the lateral force beside the bite force; none without the table.
        pub lateral: Option<LateralForceConfig> = None,
        /// A probe of the stiffness before the first bite; none without the table.
        pub probe: Option<ProbeConfig> = None,
    }
}

section! {
    /// The probe of the stiffness before the first bite.
    #[derive(Copy)]
    pub struct ProbeConfig {
        /// Bite force to which the probe rises from `force_control.contact_n`.
        pub force_n: f64 = 20.0 => Positive "1.2 times `force_control.contact_n` to `force_control.peak_n`",
        /// Largest speed of closing before the stiffness is known; the jaw then stays behind the motion, by at most
        /// `force_control.reach_m`.
        pub closing_m_s: f64 = 0.005 => Within(0.0001, 1.0),
        /// Ratio of the stiffness that the probe shows and the stated one, or the reverse, from which on it is reported (`wrong_stiffness`).
        pub factor: f64 = 2.0 => Within(1.1, 100.0),
    }
}

section! {
    /// Control of the lateral force in a bite.
    #[derive(Copy)]
    pub struct LateralForceConfig {
        /// Force of the lower jaw on the food along x and y of the base, while the bite force is at its peak; otherwise in proportion
        /// to the bite force. With zeros the jaw gives way to every lateral force.
        pub peak_n: [f64; 2] = [0.0; 2] => Within(-1000.0, 1000.0) "together at most `force_control.peak_n`",
        /// Largest lateral distance of the platform from the motion. There the platform gives way no further.
        pub reach_m: f64 = 0.005 => Within(0.000_001, 0.05),
    }
}

impl ForceControlConfig {
    /// Time constant of the admittance, virtual mass by damping, s.
    pub const MASS_TIME_S: f64 = 0.003;

    /// Room in the force limit of a leg's drive for weight, friction and acceleration of the jaw, N.
    const OF_JAW_N: f64 = 60.0;

    /// The bite force above which a run ends, N.
    pub fn limit_n(&self) -> f64 {
        self.overload * self.peak_n
    }

    /// The force limit of a leg's drive, N. A bite within the triangle of the balls loads no leg with more than its force.
    pub(super) fn limit_of_leg_n(&self) -> f64 {
        self.limit_n() + Self::OF_JAW_N
    }

    /// The delay of the loop, s, with a lead (s) and the delay of an observer or a load cell (s).
    pub fn delay_s(lead_s: f64, source_s: f64) -> f64 {
        lead_s + source_s + Self::MASS_TIME_S
    }

    /// The least damping for a stable loop against a stiffness k (N/m) with a delay t (s), N per m/s: 2/π k t. This is
    /// the limit of a pure delay; the lags of the rig turn the phase less.
    pub fn least_damping_n_s_per_m(stiffness_n_per_m: f64, delay_s: f64) -> f64 {
        FRAC_2_PI * stiffness_n_per_m * delay_s
    }

    /// Refuses values without use, and a damping below the limit of stability with this delay of the loop.
    pub(super) fn validate(&self, delay_s: f64) -> Checked {
        self.check_ranges(ranges_of("force_control"))?;
        require_range("force_control.peak_n", Range::Within(self.contact_n, 1000.0), self.peak_n)?;
        let Self { damping_n_s_per_m, food_stiffness_n_per_m, tooth_damping_n_s_per_m, .. } = *self;
        for (key, damping, stiffness) in [
            ("damping_n_s_per_m", damping_n_s_per_m, food_stiffness_n_per_m),
            ("tooth_damping_n_s_per_m", tooth_damping_n_s_per_m, self.tooth_stiffness_n_per_m),
        ] {
            let key = format!("force_control.{key}");
            let least = Self::least_damping_n_s_per_m(stiffness, delay_s);
            let need = format!(
                "use at least {least:.1}: with less, the loop is not stable against {stiffness} N/m with a delay of \
                 {:.1} ms; or state a smaller stiffness",
                delay_s * 1e3
            );
            require(damping >= least && damping.is_finite(), &key, &damping, need)?;
        }
        self.lateral.as_ref().map_or(Ok(()), |lateral| lateral.validate(self))?;
        self.probe.as_ref().map_or(Ok(()), |probe| {
            probe.check_ranges(ranges_of("force_control.probe"))?;
            let least_n = 1.2 * self.contact_n;
            let need = format!(
                "use at least {least_n} N, 1.2 times the force of contact: a probe lies between the two"
            );
            require(self.peak_n >= least_n, "force_control.peak_n", &self.peak_n, need)?;
            let range = Range::Within(least_n, self.peak_n);
            require_range("force_control.probe.force_n", range, probe.force_n)
        })
    }
}

impl LateralForceConfig {
    fn validate(&self, control: &ForceControlConfig) -> Checked {
        self.check_ranges(ranges_of("force_control.lateral"))?;
        let need = "use \"estimate\", or leave [force_control.lateral] away: a load cell shows the vertical force alone";
        require(control.source == ForceSource::Estimate, "force_control.source", &"\"load_cell\"", need)?;
        let [x_n, y_n] = self.peak_n;
        let need = format!(
            "use at most {} N in all, force_control.peak_n: more slides off the food",
            control.peak_n
        );
        require(
            x_n.hypot(y_n) <= control.peak_n,
            "force_control.lateral.peak_n",
            &format!("{:?}", self.peak_n),
            need,
        )
    }
}

section! {
    /// The load cell.
    #[derive(Copy)]
    pub struct LoadCellConfig {
        /// Bandwidth of its amplifier, a low-pass of first order.
        pub bandwidth_hz: f64 = 500.0 => Within(1.0, 100_000.0),
        /// Noise of a sample, rms.
        pub noise_n: f64 = 0.1 => Within(0.0, 1000.0),
        /// What the cell shows without load.
        pub offset_n: f64 = 0.0 => Within(-1000.0, 1000.0),
        /// Ends of its range on both sides; beyond them the cell shows these.
        pub range_n: f64 = 1000.0 => Within(0.1, 100_000.0),
    }
}

impl LoadCellConfig {
    /// Time constant of the low-pass, s.
    pub fn time_s(&self) -> f64 {
        1.0 / (TAU * self.bandwidth_hz)
    }

    /// The range that a bite of this peak needs, N.
    fn least_range_n(&self, peak_n: f64) -> f64 {
        1.2 * peak_n + self.offset_n.abs() + 5.0 * self.noise_n
    }

    /// Refuses a cell that cannot measure a bite for this control. The range must exceed the peak; offset and noise
    /// must not look like a contact.
    pub(super) fn require_for(&self, control: &ForceControlConfig) -> Checked {
        let Self { noise_n, offset_n, range_n, .. } = *self;
        let [most_offset_n, most_noise_n] = [control.contact_n / 2.0, control.contact_n / 5.0];
        let least_range_n = self.least_range_n(control.peak_n);
        let need = format!(
            "use less than {most_offset_n} N on both sides, half of force_control.contact_n: with more, the controller \
             takes the offset for a contact, or misses one"
        );
        require(offset_n.abs() < most_offset_n, "load_cell.offset_n", &offset_n, need)?;
        let need = format!(
            "use at most {most_noise_n} N, a fifth of force_control.contact_n: with more, noise looks like a contact"
        );
        require(noise_n <= most_noise_n, "load_cell.noise_n", &noise_n, need)?;
        let need = format!(
            "use at least {least_range_n} N, 1.2 times force_control.peak_n with offset and five times the noise: a \
             cell at the end of its range hides the force"
        );
        require(range_n >= least_range_n, "load_cell.range_n", &range_n, need)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a lead of 2 ms and an observer of 3 ms.
    const DELAY_S: f64 = 0.005 + ForceControlConfig::MASS_TIME_S;

    #[test]
    fn a_damping_below_the_limit_of_stability_is_refused_with_the_limit() {
        let control = ForceControlConfig::default();
        let soft = |damping_n_s_per_m| ForceControlConfig { damping_n_s_per_m, ..control };
        // 2/π · 3500 N/m · 8 ms = 17.8 N s/m.
        for (control, reason) in [
            (control, None),
            (soft(18.0), None),
            (soft(17.0), Some("force_control.damping_n_s_per_m = 17: use at least 17.8")),
            (soft(f64::NAN), Some("damping_n_s_per_m = NaN")),
            (
                ForceControlConfig { tooth_stiffness_n_per_m: 5e6, ..control },
                Some("force_control.tooth_damping_n_s_per_m = 2000: use at least 25464.8"),
            ),
            (ForceControlConfig { peak_n: 5.0, ..control }, Some("force_control.peak_n = 5: use 10 to 1000")),
        ] {
            let said = control.validate(DELAY_S).map_err(|error| error.to_string());
            match reason {
                None => assert_eq!(said, Ok(())),
                Some(reason) => assert!(said.as_ref().is_err_and(|said| said.contains(reason)), "{said:?}"),
            }
        }
    }

    #[test]
    fn lateral_control_needs_the_estimate_and_no_more_force_than_the_bite() {
        let refusal =
            |control: ForceControlConfig| control.validate(DELAY_S).map_err(|error| error.to_string()).err();
        let of = |peak_n| ForceControlConfig {
            lateral: Some(LateralForceConfig { peak_n, ..LateralForceConfig::default() }),
            ..ForceControlConfig::default()
        };
        assert_eq!(refusal(of([-18.0, 24.0])), None);
        let said = refusal(of([-18.1, 24.0])).unwrap();
        assert!(said.contains("lateral.peak_n = [-18.1, 24.0]: use at most 30 N in all"), "{said}");
        let by_cell = ForceControlConfig { source: ForceSource::LoadCell, ..of([0.0; 2]) };
        let said = refusal(by_cell).unwrap();
        assert!(
            said.contains("leave [force_control.lateral] away: a load cell shows the vertical"),
            "{said}"
        );
    }

    #[test]
    fn a_load_cell_at_the_bounds_of_control_is_accepted() {
        let control = ForceControlConfig { peak_n: 60.0, ..ForceControlConfig::default() };
        let cell =
            LoadCellConfig { noise_n: 2.0, offset_n: -4.0, range_n: 86.0, ..LoadCellConfig::default() };
        assert!(cell.require_for(&control).is_ok());
        let narrow = LoadCellConfig { range_n: 85.9, ..cell };
        assert!(narrow.require_for(&control).is_err());
    }
}
