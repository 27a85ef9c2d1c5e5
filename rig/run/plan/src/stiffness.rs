//! The stiffness that a scenario states for its force control, against that of its emulated drives, teeth and foods.
//!
//! Teeth and food push against the platform, which the loops of six drives hold. In series they are what the force
//! control meets. A real robot shows its stiffness only in a bite: nothing is compared there.

use masseter_model::geometry::{Jacobian, Mechanism, Pose, Vec3};
use masseter_scenario::{ForceControlConfig, Scenario};
use nalgebra::{Matrix6, Vector6};

/// Ratio of the stated and the real stiffness from which on a warning is due.
const FAR: f64 = 1.5;

/// A stated stiffness with the damping that belongs to it.
struct Stated<'a> {
    /// What is stiff, in words, and the beginning of its key of damping.
    what: String,
    prefix: &'a str,
    key: &'a str,
    n_per_m: f64,
    damping_n_s_per_m: f64,
}

/// A line for each stated stiffness that is far from the real one.
pub(super) fn warnings(scenario: &Scenario, mechanism: &Mechanism, closed: &Pose) -> Vec<String> {
    let control = scenario.force_control.filter(|_| scenario.has_contact());
    let Some((control, drives)) = control.zip(drives_n_per_m(scenario, mechanism, closed)) else {
        return Vec::new();
    };
    let teeth = scenario.teeth.as_ref().map(|teeth| {
        let numbers = scenario.arch().into_iter().map(|tooth| tooth.number).collect::<Vec<_>>();
        let each_n_per_m = teeth.stiff_n_per_m.max(teeth.soft_n_per_m);
        let stated = Stated {
            what: "the teeth".to_owned(),
            prefix: "tooth_",
            key: "tooth_stiffness_n_per_m",
            n_per_m: control.tooth_stiffness_n_per_m,
            damping_n_s_per_m: control.tooth_damping_n_s_per_m,
        };
        (stated, with_n_per_m(scenario, closed, &drives, &numbers, each_n_per_m))
    });
    let foods = scenario.foods().map(|food| {
        let each_n_per_m = food.stiffest_n_per_m() / food.teeth.len() as f64;
        let stated = Stated {
            what: format!("the food '{}'", food.kind),
            prefix: "",
            key: "food_stiffness_n_per_m",
            n_per_m: control.food_stiffness_n_per_m,
            damping_n_s_per_m: control.damping_n_s_per_m,
        };
        (stated, with_n_per_m(scenario, closed, &drives, &food.teeth, each_n_per_m))
    });
    let stiffest = foods.max_by(|one, other| one.1.total_cmp(&other.1));
    let all = teeth.into_iter().chain(stiffest);
    all.filter_map(|(stated, n_per_m)| stated.warning(n_per_m, scenario.force_delay_s(&control))).collect()
}

/// Stiffness of the loops of the drives against the platform's twist; none for a pose without joints.
fn drives_n_per_m(scenario: &Scenario, mechanism: &Mechanism, closed: &Pose) -> Option<Matrix6<f64>> {
    let jacobian = Jacobian::of_legs(mechanism, &mechanism.legs(closed).ok()?).actuators;
    let loops = Vector6::from_fn(|axis, _| scenario.drives.of_axis(axis).stiffness_n_per_m());
    Some(jacobian.transpose() * Matrix6::from_diagonal(&loops) * jacobian)
}

/// Vertical force by requested height of the platform, N/m, for contacts of this stiffness on these teeth. With lateral control the
/// largest along x, y and z: a contact that does not slide is as stiff to the side.
///
/// With the stiffness C of the contacts and D of the drives, the request z meets C (C + D)⁻¹ D z.
fn with_n_per_m(
    scenario: &Scenario,
    closed: &Pose,
    drives: &Matrix6<f64>,
    teeth: &[u8],
    each_n_per_m: f64,
) -> f64 {
    let is_lateral = scenario.force_control.is_some_and(|control| control.lateral.is_some());
    let mut contacts = Matrix6::zeros();
    for tooth in scenario.arch().iter().filter(|tooth| teeth.contains(&tooth.number)) {
        let normal = closed.rotation * Vec3::from(tooth.normal).normalize();
        let across = if is_lateral {
            [Vec3::x(), Vec3::y()].map(|side| side.cross(&normal))
        } else {
            [Vec3::zeros(); 2]
        };
        for direction in [normal, across[0], across[1]] {
            let moment = (closed.rotation * Vec3::from(tooth.point_m)).cross(&direction);
            let row = Vector6::new(direction.x, direction.y, direction.z, moment.x, moment.y, moment.z);
            contacts += row * row.transpose() * each_n_per_m;
        }
    }
    let whole = (contacts + drives).lu();
    let against =
        |way: Vector6<f64>| whole.solve(&(drives * way)).map_or(0.0, |moved| way.dot(&(contacts * moved)));
    let sides = [Vector6::x(), Vector6::y()].into_iter().filter(|_| is_lateral);
    sides.chain([Vector6::z()]).map(against).fold(0.0, f64::max)
}

impl Stated<'_> {
    /// The warning of a stated stiffness that is far from the real one (N/m).
    fn warning(&self, n_per_m: f64, delay_s: f64) -> Option<String> {
        let Self { what, prefix, key, n_per_m: stated_n_per_m, damping_n_s_per_m } = self;
        let least = ForceControlConfig::least_damping_n_s_per_m(n_per_m, delay_s);
        let effect = match stated_n_per_m / n_per_m {
            ratio if ratio > FAR && *damping_n_s_per_m > FAR * least => {
                "the bite follows more slowly than it could"
            }
            _ if *damping_n_s_per_m < least => "the bite can shake and overshoot",
            _ => return None,
        };
        Some(format!(
            "force_control.{key} is {stated_n_per_m:.0} N/m, but {what} and the drives together have {n_per_m:.0} N/m: {effect}; \
             set {key} to {n_per_m:.0} and {prefix}damping_n_s_per_m to {:.0} or more",
            least.ceil()
        ))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use masseter_controller::trajectory::Trajectory;

    use super::*;

    fn warnings_of(text: &str) -> Vec<String> {
        let scenario = Scenario::parse(Path::new("stiffness.toml"), text).unwrap();
        let mechanism = Mechanism::new(&scenario.mechanism).unwrap();
        let motion = Trajectory::new(&scenario.motion, &scenario.jaw, &mechanism, Some(4.0)).unwrap();
        warnings(&scenario, &mechanism, &motion.closed_pose())
    }

    #[test]
    fn the_default_statement_is_that_of_the_default_drives_and_teeth() {
        assert_eq!(warnings_of("[teeth]\n[food]\n[force_control]\ndamping_n_s_per_m = 20.0"), [""; 0]);
        assert_eq!(warnings_of("[force_control]"), [""; 0], "nothing touches");
    }

    #[test]
    fn with_lateral_control_the_drives_to_the_side_count_too() {
        let teeth = "[teeth]\n[force_control]\ntooth_damping_n_s_per_m = 3000\n";
        assert_eq!(warnings_of(teeth), [""; 0]);
        let lateral = format!("{}[force_control.lateral]", teeth.replace("3000", "2000"));
        let [warning] = &warnings_of(&lateral)[..] else { panic!("one warning") };
        assert!(warning.contains("tooth_stiffness_n_per_m to 588984"), "{warning}");
    }

    #[test]
    fn stiffer_drives_or_food_than_stated_are_named_with_both_values_and_the_keys() {
        let drives = "[drives]\nleg.velocity_gain_n_s_per_m = 3000\n[teeth]\n[force_control]";
        let [warning] = &warnings_of(drives)[..] else { panic!("one warning") };
        for words in ["tooth_stiffness_n_per_m is 360000 N/m", "can shake", "tooth_damping_n_s_per_m to "] {
            assert!(warning.contains(words), "{warning}");
        }
        for kind in ["peanut", "hazelnut", "almond", "gum"] {
            let [warning] = &warnings_of(&format!("[food]\nkind = '{kind}'\n[force_control]"))[..] else {
                panic!("one warning for {kind}")
            };
            let words = format!("food_stiffness_n_per_m is 3500 N/m, but the food '{kind}'");
            assert!(warning.starts_with(&format!("force_control.{words}")), "{warning}");
        }
    }

    #[test]
    fn softer_food_than_stated_makes_a_bite_slow() {
        let stated = "[food]\n[force_control]\nfood_stiffness_n_per_m = 17500\ndamping_n_s_per_m = 100";
        let [warning] = &warnings_of(stated)[..] else { panic!("one warning") };
        assert!(warning.contains("more slowly") && warning.contains("to 34"), "{warning}");
    }
}
