//! The behaviour of foods, bite after bite.

use super::*;

const STEP_S: f64 = 1e-5;
/// Period of a chew, s, and how far it opens the teeth, m.
const CHEW_S: f64 = 0.7;
const OPEN_M: f64 = 0.012;

fn touch(gap_m: f64, closing_m_s: f64) -> Touch {
    Touch {
        arm: Vec3::zeros(),
        place_m: Vec3::new(0.0, 0.0, -gap_m),
        normal: Vec3::z(),
        gap_m,
        closing_m_s,
        slide_m: Vec3::zeros(),
        step_s: STEP_S,
    }
}

/// A piece that is bitten by a tooth.
struct Bite {
    food: Food,
    broke: Vec<FoodBreak>,
}

impl Bite {
    fn new(config: &FoodConfig) -> Self {
        Self { food: Food::new(config, &[36]), broke: Vec::new() }
    }

    /// The force at a gap while the gap shrinks at a speed, N.
    fn at(&mut self, gap_m: f64, closing_m_s: f64) -> f64 {
        let mut forces_n = [Vec3::zeros()];
        self.broke.extend(self.food.bite(&[touch(gap_m, closing_m_s)], &mut forces_n));
        -forces_n[0].z
    }

    /// The forces of slow bites at these gaps, mm and N.
    fn slowly(&mut self, gaps_mm: &[f64]) -> Vec<f64> {
        gaps_mm.iter().map(|gap_mm| self.at(gap_mm * 1e-3, 0.0)).collect()
    }

    /// Chews once, from open to open; returns the gap (m) and the force (N) of every step.
    fn chew(&mut self) -> Vec<[f64; 2]> {
        let steps = (CHEW_S / STEP_S) as usize;
        let turn = std::f64::consts::TAU / CHEW_S;
        let step = |place: usize| {
            let (sin, cos) = (turn * place as f64 * STEP_S).sin_cos();
            let gap_m = OPEN_M * (1.0 + cos) / 2.0;
            [gap_m, self.at(gap_m, OPEN_M / 2.0 * turn * sin)]
        };
        (0..steps).map(step).collect()
    }
}

fn kind(name: &str) -> FoodConfig {
    FoodConfig::of_kind(name).unwrap()
}

fn undamped(name: &str) -> FoodConfig {
    FoodConfig { damping_s_per_m: 0.0, ..kind(name) }
}

fn assert_forces(found_n: &[f64], expected_n: &[f64]) {
    for (found_n, expected_n) in found_n.iter().zip(expected_n) {
        assert!((found_n - expected_n).abs() < 1e-9, "{found_n} N, expected {expected_n} N");
    }
}

#[test]
fn soft_food_resists_flows_stays_flat_and_is_collected_thinner() {
    let config =
        FoodConfig { strength_n: 20.0, stiffness_n_per_m: 4000.0, left_by_chew: 0.5, ..undamped("soft") };
    let mut bite = Bite::new(&config);
    let found_n = bite.slowly(&[15.0, 10.0, 8.0, 5.0, 3.0, 4.0, 9.0, 10.0, 6.0, 4.0]);
    // In the second bite the piece is 5 mm thick.
    assert_forces(&found_n, &[0.0, 0.0, 8.0, 20.0, 20.0, 16.0, 0.0, 0.0, 0.0, 4.0]);
}

#[test]
fn a_bite_begins_without_a_jump_at_any_speed() {
    for name in ["soft", "hazelnut", "gum"] {
        let mut bite = Bite::new(&kind(name));
        let fresh_m = bite.food.config.thickness_m;
        bite.at(fresh_m, 5.0);
        let first_n = bite.at(fresh_m - 1e-9, 5.0);
        assert!((0.0..1e-2).contains(&first_n), "{name}: {first_n} N");
    }
}

#[test]
fn a_nut_bears_its_strength_and_drops_to_18_to_25_percent_of_it_at_once() {
    for (name, strength_n) in [("peanut", 76.0), ("hazelnut", 431.0), ("almond", 895.0)] {
        let mut bite = Bite::new(&undamped(name));
        let course = bite.chew();
        let (before, after) = (0..course.len() - 1)
            .map(|place| (course[place][1], course[place + 1][1]))
            .max_by(|a, b| (a.0 - a.1).total_cmp(&(b.0 - b.1)))
            .unwrap();
        assert!((0.99 * strength_n..strength_n).contains(&before), "{name}: {before} N");
        assert!((0.18..0.25).contains(&(after / strength_n)), "{name}: {after} N of {before} N");
        let [broke] = bite.broke[..] else { panic!("{name}: {:?}", bite.broke) };
        assert_eq!((broke.tooth, broke.strength_n), (36, strength_n));
        assert!((broke.force_n - strength_n).abs() < 0.01 * strength_n, "{broke:?}");
        bite.chew();
        assert_eq!(bite.broke.len(), 1, "fragments do not break again");
    }
}

#[test]
fn food_is_comminuted_swallowed_after_15_chews_and_followed_by_a_fresh_piece() {
    let mut bite = Bite::new(&kind("soft"));
    let begins_m = |course: &[[f64; 2]]| course.iter().find(|[_, force_n]| *force_n > 0.0).unwrap()[0];
    let thickness_m: Vec<_> = (0..18).map(|_| begins_m(&bite.chew())).collect();
    for (chew, found_m) in thickness_m[..16].iter().enumerate() {
        let expected_m = 0.010 * 0.9_f64.powi(chew as i32);
        assert!((found_m - expected_m).abs() < 2e-6, "chew {chew}: {found_m} m");
    }
    assert!((thickness_m[16] - 0.010).abs() < 2e-6, "{thickness_m:?}");
}

#[test]
fn the_force_of_a_chew_rises_to_the_strength_falls_and_ends_with_the_contact() {
    let course = Bite::new(&undamped("soft")).chew();
    let bitten: Vec<_> = course.iter().filter(|[_, force_n]| *force_n > 0.0).collect();
    let peak = (0..bitten.len()).max_by(|a, b| bitten[*a][1].total_cmp(&bitten[*b][1])).unwrap();
    assert!((bitten[peak][1] - 35.0).abs() < 1e-3, "{:?}", bitten[peak]);
    let (rising, falling) = bitten.split_at(peak);
    assert!(rising.is_sorted_by(|a, b| a[1] <= b[1]) && falling.is_sorted_by(|a, b| a[1] >= b[1]));
    let contact_s = bitten.len() as f64 * STEP_S;
    // A cosine is below 10 of 12 mm for 73 % of its period.
    assert!((contact_s / CHEW_S - 0.73).abs() < 0.01, "{contact_s} s");
}

#[test]
fn gum_bears_about_220_n_relaxes_and_regains_its_shape() {
    let mut bite = Bite::new(&kind("gum"));
    let peak_n =
        |course: &[[f64; 2]]| course.iter().fold(0.0, |most_n: f64, [_, force_n]| most_n.max(*force_n));
    let peaks_n = [(); 3].map(|()| peak_n(&bite.chew()));
    assert!(peaks_n.iter().all(|peak_n| (190.0..250.0).contains(peak_n)), "{peaks_n:?}");
    assert!((peaks_n[1] - peaks_n[2]).abs() < 1e-6, "{peaks_n:?}");
    // Held at half of its thickness, it keeps the force of the spring that does not relax.
    let mut bite = Bite::new(&undamped("gum"));
    bite.at(0.006, 0.0);
    let held_n: Vec<_> = (0..200_000).map(|_| bite.at(0.003, 0.0)).collect();
    assert!((held_n[0] - 135.0).abs() < 0.1 && (held_n[199_999] - 75.0).abs() < 0.1, "{}", held_n[0]);
    assert!((held_n[10_000] - (75.0 + 60.0 * (-1.0_f64).exp())).abs() < 0.1);
}

#[test]
fn no_chew_of_any_food_gives_more_work_than_it_takes() {
    for name in ["soft", "peanut", "hazelnut", "almond", "gum"] {
        let mut bite = Bite::new(&kind(name));
        for chew in 0..20 {
            let course = bite.chew();
            let work = |pair: &[[f64; 2]]| (pair[0][0] - pair[1][0]) * (pair[0][1] + pair[1][1]) / 2.0;
            let work_j: f64 = course.windows(2).map(work).sum();
            assert!(work_j > 0.0, "{name}, chew {chew}: {work_j} J");
        }
    }
}

#[test]
fn several_teeth_share_a_piece_by_place() {
    let config = FoodConfig { teeth: vec![36, 37], ..undamped("soft") };
    let mut food = Food::new(&config, &[36, 37]);
    food.columns.iter_mut().for_each(|column| column.thickness_m = food.collected_m);
    let mut forces_n = [Vec3::zeros(); 2];
    food.bite(&[touch(0.008, 0.0), touch(0.006, 0.0)], &mut forces_n);
    assert_forces(&forces_n.map(|force_n| -force_n.z), &[3.5, 7.0]);
}
