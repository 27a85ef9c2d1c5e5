//! Laws of the contact between the jaws.

use masseter_scenario::{FoodConfig, Scenario};
use nalgebra::{Matrix3, Vector3};

use super::*;

const CLOSED_M: f64 = 0.27;
/// Mass that the jaw moves upwards, kg.
const MASS_KG: f64 = 1.7;

fn teeth() -> TeethConfig {
    TeethConfig { clearance_m: 0.0, ..TeethConfig::default() }
}

fn occlusion(teeth: TeethConfig, food: Option<FoodConfig>) -> Occlusion {
    let scenario = Scenario { teeth: Some(teeth), food, ..Scenario::default() };
    scenario.validate().unwrap();
    crate::simulator::emulation::jaw::occlusion(&scenario, &Pose::translation(0.0, 0.0, CLOSED_M))
}

/// The platform that much above the closed mouth, m.
fn above(x_m: f64, z_m: f64) -> Pose {
    Pose::translation(x_m, 0.0, CLOSED_M + z_m)
}

fn upwards(speed_m_s: f64) -> Twist {
    Twist::new(0.0, 0.0, speed_m_s, 0.0, 0.0, 0.0)
}

#[test]
fn teeth_meet_without_a_jump() {
    let mut occlusion = occlusion(teeth(), None);
    let step_s = 1e-6;
    let most_n = (0..2000).scan(0.0, |before_n: &mut f64, step| {
        let speed_m_s = 0.06;
        occlusion.push(
            &above(0.0, -1e-4 + speed_m_s * step_s * f64::from(step)),
            &upwards(speed_m_s),
            step_s,
        );
        let force_n = occlusion.bite_force_n();
        Some((force_n - std::mem::replace(before_n, force_n)).abs())
    });
    let most_n = most_n.fold(0.0, f64::max);
    // 14 stiff teeth in a microsecond at 60 mm/s give 1.7 N; a damper of 10 N s/m a tooth jumps by 8 N.
    assert!(most_n < 2.1, "{most_n} N");
}

/// A bounce of the jaw on its teeth, at steps that meet the contact in every phase.
#[test]
fn a_bounce_never_returns_faster_than_it_came() {
    for phase in 0..50 {
        let (step_s, came_m_s) = (1.25e-4, 0.06);
        let mut occlusion = occlusion(teeth(), None);
        let (mut z_m, mut speed_m_s) = (-1e-4 - 1.5e-7 * f64::from(phase), came_m_s);
        for _ in 0..100 {
            speed_m_s += occlusion.push(&above(0.0, z_m), &upwards(speed_m_s), step_s)[2] / MASS_KG * step_s;
            z_m += speed_m_s * step_s;
        }
        assert!((-came_m_s..-0.1 * came_m_s).contains(&speed_m_s), "phase {phase}: {speed_m_s} m/s");
    }
}

/// The jaw taps the teeth, grinds along them and turns on them, on closed paths.
#[test]
fn no_closed_path_of_the_jaw_takes_energy_out_of_the_contact() {
    let step_s = 1e-5;
    for (place, [along, turned]) in
        [[0.0, 0.0], [1e-3, 0.0], [0.0, 0.01], [5e-4, 0.02]].into_iter().enumerate()
    {
        let mut occlusion = occlusion(teeth(), None);
        let pose_at = |time_s: f64| {
            let (sin, cos) = (std::f64::consts::TAU * 4.0 * time_s).sin_cos();
            let turn = Pose::rotation(Vec3::new(0.0, 0.0, turned * sin));
            above(along * sin, 5e-5 * cos) * turn
        };
        let mut work_j = 0.0;
        for step in 0..100_000 {
            let [from, to] = [step, step + 1].map(|step| pose_at(f64::from(step) * step_s));
            let linear = (to.translation.vector - from.translation.vector) / step_s;
            let angular = (to.rotation * from.rotation.inverse()).scaled_axis() / step_s;
            let twist = Twist::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z);
            work_j -= occlusion.push(&from, &twist, step_s).dot(&twist) * step_s;
        }
        assert!(work_j > 0.0, "path {place}: {work_j} J");
    }
}

#[test]
fn friction_stays_in_its_cone_opposes_sliding_and_holds_at_rest() {
    let only = ToothConfig { number: 36, point_m: [0.0; 3], normal: [0.0, 0.0, 1.0] };
    let missing = vec![31, 32, 33, 34, 35, 37, 41, 42, 43, 44, 45, 46, 47];
    let mut occlusion = occlusion(TeethConfig { tooth: vec![only], missing, ..teeth() }, None);
    let (step_s, slide_m_s) = (1e-5, 0.02);
    let mut shares = Vec::new();
    for step in 0..1000 {
        let twist = Twist::new(slide_m_s, 0.0, 0.0, 0.0, 0.0, 0.0);
        let force = occlusion.push(&above(slide_m_s * step_s * f64::from(step), 1e-4), &twist, step_s);
        shares.push(force[0] / force[2]);
        assert!(force.fixed_rows::<2>(0).norm() <= 0.23 * -force[2] * (1.0 + 1e-12), "{force}");
    }
    assert!(shares[0] < 0.05 && (shares[999] - 0.23).abs() < 1e-9, "{} to {}", shares[0], shares[999]);
    // The contact holds its load without creeping.
    let held: Vec<_> =
        (0..1000).map(|_| occlusion.push(&above(2e-4, 1e-4), &Twist::zeros(), step_s)[0]).collect();
    assert!(held[0] < -10.0 && (held[0] - held[999]).abs() < 1e-9, "{} to {} N", held[0], held[999]);
}

/// A rigid arch on equal springs: heave, roll and pitch follow from three equations of balance, the loads from them.
#[test]
fn a_stiff_arch_shares_a_load_as_statics_has_it() {
    let stiffness = 2e6;
    let linear =
        TeethConfig { soft_n_per_m: stiffness, soft_up_to_n: 0.0, stiff_n_per_m: stiffness, ..teeth() };
    let mut occlusion = occlusion(TeethConfig { friction: 0.0, ..linear }, None);
    let places: Vec<_> = occlusion.pairs.iter().map(|pair| [pair.lower_m.x, pair.lower_m.y]).collect();
    // 400 N upwards on the jaw, between the premolars and a little to the left.
    let (load_n, [x, y]) = (400.0, [0.012, 0.003]);
    let rows = places.iter().fold(Matrix3::zeros(), |sum: Matrix3<f64>, [x, y]| {
        let row = Vector3::new(1.0, *y, -*x);
        sum + row * row.transpose()
    });
    let moved = (rows * stiffness).lu().solve(&(Vector3::new(1.0, y, -x) * load_n)).unwrap();
    let expected_n = places.iter().map(|[x, y]| stiffness * (moved[0] + moved[1] * y - moved[2] * x));
    let pose = above(0.0, moved[0]) * Pose::rotation(Vec3::new(moved[1], moved[2], 0.0));
    let wrench = occlusion.push(&pose, &Twist::zeros(), 1e-4);
    assert!((wrench[2] + load_n).abs() < 0.1, "{wrench}");
    assert!((wrench[3] + load_n * y).abs() < 1e-3 && (wrench[4] - load_n * x).abs() < 1e-3, "{wrench}");
    let message = occlusion.take_mean();
    for (tooth, expected_n) in message.teeth().zip(expected_n) {
        assert!(expected_n > 0.0, "every tooth bears");
        assert!((tooth.load_n() - expected_n).abs() < 0.05, "{tooth:?}: {expected_n} N");
    }
    let loads_n: Vec<_> = message.teeth().map(|tooth| tooth.load_n()).collect();
    let of = |number: u32| loads_n[message.tooth.iter().position(|tooth| *tooth == number).unwrap()];
    assert!(of(36) > of(46) && of(34) > of(44), "the left side bears more: {loads_n:?}");
}

#[test]
fn a_cusp_that_leans_pushes_the_jaw_aside() {
    let cusp = ToothConfig { number: 36, point_m: [0.0024, 0.0248, 0.0], normal: [0.0, 0.5, 1.0] };
    let mut occlusion = occlusion(TeethConfig { tooth: vec![cusp], ..teeth() }, None);
    let wrench = occlusion.push(&above(0.0, 5e-5), &Twist::zeros(), 1e-4);
    let [tooth] = occlusion.take_mean().teeth().filter(|tooth| tooth.number == 36).collect::<Vec<_>>()[..]
    else {
        panic!("one tooth has this number")
    };
    assert!((tooth.force_n[1] / tooth.force_n[2] - 0.5).abs() < 1e-9 && tooth.force_n[1] < 0.0, "{tooth:?}");
    assert!((wrench[1] - tooth.force_n[1]).abs() < 1e-9, "{wrench}");
}

#[test]
fn a_message_has_the_mean_of_its_steps() {
    let mut occlusion = occlusion(teeth(), Some(FoodConfig { friction: 0.0, ..FoodConfig::default() }));
    let food = occlusion.food.as_mut().unwrap();
    food.columns.iter_mut().for_each(|column| column.thickness_m = food.collected_m);
    for compression_m in [0.0, 1e-3, 2e-3] {
        occlusion.push(&above(0.0, -0.01 + compression_m), &Twist::zeros(), 1e-4);
    }
    let of_36 = |message: Contact| message.teeth().find(|tooth| tooth.number == 36).unwrap();
    let mean = of_36(occlusion.take_mean());
    assert!((mean.force_n[2] + 3.5).abs() < 1e-9, "{mean:?}");
    assert!((Vec3::from(mean.place_m) - Vec3::new(0.0024, 0.0248, 0.0)).norm() < 1e-12, "{mean:?}");
    assert!(
        (of_36(occlusion.take_mean()).force_n[2] + 7.0).abs() < 1e-9,
        "the last step's, without a step since"
    );
}

#[test]
fn a_contact_too_stiff_for_the_step_is_refused_with_the_step_that_resolves_it() {
    let mass = Matrix6::from_diagonal(&Vector6::new(3.0, 3.0, MASS_KG, 7e-4, 7e-4, 1e-3));
    let stiff = occlusion(TeethConfig { stiff_n_per_m: 1e7, ..teeth() }, None);
    let refusal = stiff.check_step(&mass, 125_000).unwrap_err();
    let ContactError::Step { longest_ns, .. } = refusal else { panic!("{refusal}") };
    assert!(refusal.to_string().contains(&format!("use at most {longest_ns}")), "{refusal}");
    assert_eq!(stiff.check_step(&mass, longest_ns), Ok(()));
    assert!(stiff.check_step(&mass, longest_ns + 1).is_err());
    // 14 springs on the mass alone have this radian: the fastest oscillation is no slower.
    let heave_ns = 1e9 / (14.0 * 1e7 / MASS_KG).sqrt();
    assert!((0.5 * heave_ns..=heave_ns).contains(&(longest_ns as f64)), "{longest_ns} of {heave_ns} ns");
    let light = Matrix6::from_diagonal_element(1e-5);
    assert!(matches!(stiff.check_step(&light, 125_000), Err(ContactError::Stiff { .. })));
    assert_eq!(
        occlusion(teeth(), None).check_step(&mass, 125_000),
        Ok(()),
        "the default needs no shorter step"
    );
}
