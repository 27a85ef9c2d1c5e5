//! The default pose law: a slow integral trim on top of the drives' own position loops.
//!
//! The drives follow fast motion by feed-forward. The trim corrects the remaining mean error (friction, gravity,
//! calibration). The trim adds no damping and no feed-forward.

use masseter_model::geometry::{Pose, Vec3};
use masseter_runtime::named::{Declared, Parameter};
use masseter_scenario::ControllerConfig;

use crate::pose_law::{Demand, LawFailed, PoseLaw};

/// The present correction.
#[derive(Debug, Clone)]
pub(crate) struct PoseControl {
    config: ControllerConfig,
    most_gain_per_s: f64,
    position_m: Vec3,
    rotation_rad: Vec3,
}

impl PoseControl {
    /// The law at this rate of cycles, Hz.
    pub(crate) fn new(config: &ControllerConfig, rate_hz: u32) -> Self {
        let most_gain_per_s = config.most_integral_gain_per_s(rate_hz);
        Self { config: *config, most_gain_per_s, position_m: Vec3::zeros(), rotation_rad: Vec3::zeros() }
    }

    /// Takes the difference between the desired pose and the estimated pose, at the same instant.
    fn observe(&mut self, desired: &Pose, estimated: &Pose, dt_s: f64) {
        let share = self.config.integral_gain_per_s * dt_s;
        let offset = desired.translation.vector - estimated.translation.vector;
        let turn = (desired.rotation * estimated.rotation.inverse()).scaled_axis();
        self.position_m = (self.position_m + offset * share).cap_magnitude(self.config.trim_limit_m);
        self.rotation_rad = (self.rotation_rad + turn * share).cap_magnitude(self.config.trim_limit_rad);
    }

    /// The requested pose for a desired pose.
    fn correct(&self, desired: &Pose) -> Pose {
        Pose::from_parts(
            (desired.translation.vector + self.position_m).into(),
            nalgebra::UnitQuaternion::from_scaled_axis(self.rotation_rad) * desired.rotation,
        )
    }
}

impl PoseLaw for PoseControl {
    fn command(&mut self, demand: &Demand) -> Result<Pose, LawFailed> {
        if let Some(estimated) = &demand.estimated {
            self.observe(&demand.desired, estimated, demand.period_s);
        }
        Ok(self.correct(&demand.ahead))
    }

    /// The gains of the scenario. A trim limit can only become narrower, because the check of the strokes uses the
    /// scenario's limit.
    fn declared(&self) -> Declared {
        let ControllerConfig { integral_gain_per_s: gain, trim_limit_m, trim_limit_rad, .. } = self.config;
        let parameter = |name, unit: &str, about: &str, value, most| Parameter {
            unit: unit.to_owned(),
            about: about.to_owned(),
            range: [0.0, most],
            ..Parameter::new(name, value)
        };
        let (moves, turns) =
            ("The trim moves the platform by no more.", "The trim turns the platform by no more.");
        let parameters = vec![
            parameter("integral_gain_per_s", "1/s", "Integral gain of the trim.", gain, self.most_gain_per_s),
            parameter("trim_limit_m", "m", moves, trim_limit_m, trim_limit_m),
            parameter("trim_limit_rad", "rad", turns, trim_limit_rad, trim_limit_rad),
        ];
        Declared { parameters, ..Declared::default() }
    }

    fn set_parameter(&mut self, place: usize, value: f64) {
        match place {
            0 => self.config.integral_gain_per_s = value,
            1 => self.config.trim_limit_m = value,
            _ => self.config.trim_limit_rad = value,
        }
    }

    fn branch(&self) -> Result<Box<dyn PoseLaw>, masseter_runtime::control::NoBranch> {
        Ok(Box::new(self.clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A platform with a fixed distance from the requested pose.
    #[test]
    fn a_constant_offset_is_taken_out() {
        let mut control = PoseControl::new(&ControllerConfig::default(), 1000);
        let offset = Pose::new(Vec3::new(2e-4, -1e-4, 5e-5), Vec3::new(1e-3, 0.0, -2e-3));
        let desired = Pose::translation(0.0, 0.0, 0.27);
        let estimated = |asked: &Pose| {
            Pose::from_parts(
                (asked.translation.vector + offset.translation.vector).into(),
                offset.rotation * asked.rotation,
            )
        };
        for _ in 0..3000 {
            let estimated = estimated(&control.correct(&desired));
            control.observe(&desired, &estimated, 1e-3);
        }
        let left = estimated(&control.correct(&desired));
        assert!((left.translation.vector - desired.translation.vector).norm() < 1e-9);
        assert!(left.rotation.angle_to(&desired.rotation) < 1e-8);
    }

    #[test]
    fn the_correction_is_bounded() {
        let config = ControllerConfig::default();
        let mut control = PoseControl::new(&config, 1000);
        let (desired, estimated) = (Pose::identity(), Pose::new(Vec3::repeat(1.0), Vec3::repeat(0.5)));
        for _ in 0..10_000 {
            control.observe(&desired, &estimated, 1e-3);
        }
        let asked = control.correct(&desired);
        assert!((asked.translation.vector.norm() / config.trim_limit_m - 1.0).abs() < 1e-6);
        assert!((asked.rotation.angle() / config.trim_limit_rad - 1.0).abs() < 1e-6);
    }
}
