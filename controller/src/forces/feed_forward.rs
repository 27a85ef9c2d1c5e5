//! Feed-forward of forces by the controller's model.

use masseter_model::geometry::{AXES, Pose, Twist};

use super::model::{Model, derivatives};
use crate::pose_law::Detour;

/// Time from no offset to the whole offset, s: ten times that of a drive's loops.
const FADE_IN_S: f64 = 0.3;

/// Feed-forward of forces: the forces of the axes for the desired motion while the drives move to the targets of a
/// cycle.
///
/// A target acts from the next SYNC on and is reached one period later. The offset of this cycle is that of the middle
/// of this period. Velocity and acceleration are differences of three desired poses, one period apart. The offsets fade
/// in, because the drives' own loops carry the weight at the beginning of the motion.
#[derive(Debug, Clone)]
pub(super) struct FeedForward {
    model: Model,
    period_s: f64,
    /// Share of the forces in the offsets.
    share: f64,
}

impl FeedForward {
    pub(super) fn new(model: Model, period_s: f64) -> Self {
        Self { model, period_s, share: 0.0 }
    }

    /// The motion begins anew.
    pub(super) fn begin(&mut self) {
        self.share = 0.0;
    }

    /// The forces for the middle of three desired poses, one period apart, N. A law's detour changes the velocity; its
    /// acceleration and its distance from the pose are ignored. Zeros in a singular pose.
    pub(super) fn offset_n(&mut self, poses: [Pose; 3], detour: &Detour) -> [f64; AXES] {
        let (mut twist, acceleration) = derivatives(poses, self.period_s);
        twist.fixed_rows_mut::<3>(0).zip_apply(&detour.ahead_m_s, |mean, more| *mean += more);
        let motion = self.model.motion(&poses[1], &twist);
        let force_n = motion.and_then(|motion| self.model.force_n(&motion, &acceleration, &Twist::zeros()));
        self.share = (self.share + self.period_s / FADE_IN_S).min(1.0);
        force_n.map_or([0.0; AXES], |force_n| (force_n * self.share).into())
    }
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::{LEGS, Mechanism, MechanismConfig, Vec3};
    use masseter_scenario::{DynamicsConfig, FrictionModel, Scenario};

    use super::*;

    const PERIOD_S: f64 = 1e-3;

    fn offset_n(
        dynamics: &DynamicsConfig,
        velocity_m_s: f64,
        acceleration_m_s2: f64,
        detour: &Detour,
    ) -> [f64; AXES] {
        let scenario = Scenario { dynamics: *dynamics, ..Scenario::default() };
        let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
        let mut feed =
            FeedForward { share: 1.0, ..FeedForward::new(Model::new(&scenario, mechanism), PERIOD_S) };
        let at = |time_s: f64| {
            let way_m = velocity_m_s * time_s + acceleration_m_s2 * time_s * time_s / 2.0;
            Pose::translation(0.0, 0.0, 0.268_452_355 + way_m)
        };
        feed.offset_n([at(-PERIOD_S), at(0.0), at(PERIOD_S)], detour)
    }

    fn legs_n(forces_n: [f64; AXES]) -> f64 {
        forces_n[LEGS..].iter().sum()
    }

    #[test]
    fn at_rest_the_legs_carry_the_weight_of_platform_and_rods() {
        let still = offset_n(&DynamicsConfig::default(), 0.0, 0.0, &Detour::default());
        let weight_n = (0.5 + 3.0 * 0.4) * 9.81;
        assert!((legs_n(still) - weight_n).abs() < 0.3, "{still:?}");
        assert!(still[..LEGS].iter().all(|slide_n| slide_n.abs() < 0.5), "{still:?}");
    }

    #[test]
    fn friction_changes_its_sign_with_the_motion_and_mass_adds_with_the_acceleration() {
        let mut frictionless = DynamicsConfig::default();
        frictionless.friction.model = FrictionModel::None;
        let none = Detour::default();
        let [up, down] =
            [0.05, -0.05].map(|speed| legs_n(offset_n(&DynamicsConfig::default(), speed, 0.0, &none)));
        // Each leg: 1.25 N and 20 N s/m · 50 mm/s, in both directions; and the screws lose a ninth of the weight.
        let screws_n = 2.0 * (0.5 + 3.0 * 0.4) * 9.81 / 9.0;
        assert!((up - down - 13.5 - screws_n).abs() < 0.2, "{up} {down}");
        let [still, gains] = [0.0, 2.0].map(|gain| legs_n(offset_n(&frictionless, 0.0, gain, &none)));
        assert!((gains - still - 2.0 * 1.7).abs() < 0.2, "{still} {gains}");
    }

    #[test]
    fn the_forces_fade_in_after_a_beginning() {
        let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
        let mut feed = FeedForward::new(Model::new(&Scenario::default(), mechanism), PERIOD_S);
        let mut weight_n =
            || legs_n(feed.offset_n([Pose::translation(0.0, 0.0, 0.27); 3], &Detour::default()));
        let first_n = weight_n();
        let most_n = (0..400).map(|_| weight_n()).fold(0.0, f64::max);
        assert!(first_n < 0.1 && (most_n - 1.7 * 9.81).abs() < 0.3, "{first_n} {most_n}");
        feed.begin();
        assert!(feed.share <= 0.0);
    }

    #[test]
    fn a_law_that_holds_the_platform_back_takes_the_friction_back() {
        let held = Detour { ahead_m_s: Vec3::new(0.0, 0.0, -0.05), ..Detour::default() };
        let [still, held] = [(0.0, Detour::default()), (0.05, held)]
            .map(|(speed, detour)| legs_n(offset_n(&DynamicsConfig::default(), speed, 0.0, &detour)));
        assert!((still - held).abs() < 1e-6, "{still} {held}");
    }
}
