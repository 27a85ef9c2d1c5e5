//! The law against food in a world without turns: drives two cycles late, and a low-pass as the observer.

use masseter_runtime::messages::codes::ControllerState;
use masseter_scenario::{BiteProfile, ForceSource, LateralForceConfig, LoadCellConfig, ProbeConfig};

use super::bite::{FULL_CYCLES, desired_n};
use super::*;
use crate::pose_law::ExternalForce;
use crate::trajectory::minimum_jerk;

const PERIOD_S: f64 = 1e-3;
const LEAD_CYCLES: usize = 2;
const OBSERVER_S: f64 = 0.003;
/// Time of the mouth's closing and opening by 15 mm, and time closed, longer than a bite, s.
const OPENING_M: f64 = 0.015;
const MOVE_S: f64 = 0.25;
const CLOSED_S: f64 = 0.8;
const END_S: f64 = 2.0 * MOVE_S + CLOSED_S;

/// A bite on food.
struct World {
    law: ForceControl,
    state: ControllerState,
    cycle: u64,
    /// Requested positions, the newest last, m; the closed mouth is at 0.
    asked_m: Vec<Vec3>,
    /// True bite force, N, cycle by cycle.
    bites_n: Vec<f64>,
    /// Estimated force on the food, N.
    estimate_n: Vec3,
    /// Direction in which the food is pressed.
    normal: Vec3,
    stiffness_n_per_m: f64,
    thickness_m: f64,
    /// Depth at which the food breaks, m.
    breaks_at_m: f64,
    /// Ends of the load cell's range, N.
    cell_ends_n: [f64; 2],
}

impl World {
    fn new(config: ForceControlConfig) -> Self {
        Self {
            law: ForceControl::new(&Scenario::default(), config, 0.0),
            state: ControllerState::Running,
            cycle: 0,
            asked_m: vec![-OPENING_M * Vec3::z(); LEAD_CYCLES],
            bites_n: Vec::new(),
            estimate_n: Vec3::zeros(),
            normal: Vec3::z(),
            stiffness_n_per_m: 3500.0,
            thickness_m: 0.01,
            breaks_at_m: f64::INFINITY,
            cell_ends_n: [f64::NEG_INFINITY, f64::INFINITY],
        }
    }

    fn motion_m(time_s: f64) -> f64 {
        let opening =
            1.0 - minimum_jerk(time_s / MOVE_S) + minimum_jerk((time_s - MOVE_S - CLOSED_S) / MOVE_S);
        -OPENING_M * opening
    }

    fn step(&mut self) -> Result<(), LawFailed> {
        let place_m = self.asked_m[self.asked_m.len() - LEAD_CYCLES];
        let compression_m = (place_m + self.thickness_m * Vec3::z()).dot(&self.normal);
        if compression_m > self.breaks_at_m {
            self.stiffness_n_per_m = 0.0;
        }
        let force_n = self.stiffness_n_per_m * compression_m.max(0.0) * self.normal;
        let bite_n = force_n.z;
        self.bites_n.push(bite_n);
        self.estimate_n += (force_n - self.estimate_n) * (PERIOD_S / (PERIOD_S + OBSERVER_S));
        let time_s = self.cycle as f64 * PERIOD_S;
        self.cycle += 1;
        let pose = |time_s| Pose::translation(0.0, 0.0, Self::motion_m(time_s));
        let external =
            ExternalForce { force_n: (-self.estimate_n).into(), moment_nm: [0.0; 3], uncertainty_n: 0.5 };
        let asked = self.law.command(&Demand {
            cycle: self.cycle,
            period_s: PERIOD_S,
            state: self.state,
            motion_time_s: time_s,
            desired: pose(time_s),
            estimated: None,
            ahead: pose(time_s + LEAD_CYCLES as f64 * PERIOD_S),
            desired_twist: None,
            measured: None,
            external: Some(external),
            load_cell_n: Some(bite_n.clamp(self.cell_ends_n[0], self.cell_ends_n[1])),
        })?;
        self.asked_m.push(asked.translation.vector);
        Ok(())
    }

    fn run_to(&mut self, time_s: f64) {
        while (self.cycle as f64) < time_s / PERIOD_S {
            self.step().unwrap();
        }
    }

    /// Largest bite force in a time, N.
    fn most_n(&self, [from_s, to_s]: [f64; 2]) -> f64 {
        let [from, to] = [from_s, to_s].map(|time_s| (time_s / PERIOD_S) as usize);
        self.bites_n[from..to].iter().copied().fold(0.0, f64::max)
    }

    fn least_n(&self, [from_s, to_s]: [f64; 2]) -> f64 {
        let [from, to] = [from_s, to_s].map(|time_s| (time_s / PERIOD_S) as usize);
        self.bites_n[from..to].iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Largest acceleration of the targets, m/s².
    fn most_acceleration_m_s2(&self) -> f64 {
        let bends = self.asked_m.windows(3).map(|at| (at[2] - 2.0 * at[1] + at[0]).norm() / PERIOD_S.powi(2));
        bends.fold(0.0, f64::max)
    }
}

fn hold() -> ForceControlConfig {
    ForceControlConfig { profile: BiteProfile::Hold, bite_s: 0.7, ..ForceControlConfig::default() }
}

#[test]
fn a_hold_on_soft_food_keeps_its_force_within_a_twentieth_and_overshoots_by_less_than_a_fifth() {
    let mut world = World::new(hold());
    world.run_to(END_S);
    let overshoot = world.most_n([0.0, END_S]) / 30.0 - 1.0;
    assert!(overshoot < 0.2, "{overshoot}");
    let steady = [0.5, 0.8];
    assert!(world.most_n(steady) < 31.5 && world.least_n(steady) > 28.5, "{}", world.least_n(steady));
}

#[test]
fn a_half_sine_comes_near_its_peak_and_back() {
    let mut world = World::new(ForceControlConfig::default());
    world.run_to(END_S);
    let peak_n = world.most_n([0.0, END_S]);
    assert!((22.0..33.0).contains(&peak_n), "{peak_n}");
}

/// The damping is that of the limit for a stated stiffness. In the worst case the real one is five times as large.
#[test]
fn a_stiffness_stated_wrong_by_up_to_five_makes_a_bite_slow_and_never_hard() {
    for stiffness_n_per_m in [3500.0, 35_000.0, 1.5e5] {
        for stated in [0.2, 0.5, 1.0, 2.0, 5.0] {
            let delay_s = ForceControlConfig::delay_s(LEAD_CYCLES as f64 * PERIOD_S, OBSERVER_S);
            let damping_n_s_per_m =
                ForceControlConfig::least_damping_n_s_per_m(stated * stiffness_n_per_m, delay_s);
            let config = ForceControlConfig {
                damping_n_s_per_m,
                tooth_damping_n_s_per_m: damping_n_s_per_m,
                reach_m: 0.05,
                closing_m_s: 10.0,
                ..hold()
            };
            // The teeth come together gently: contact is where the motion ends.
            let thickness_m = 11.0 / stiffness_n_per_m;
            let mut world = World { stiffness_n_per_m, thickness_m, ..World::new(config) };
            world.run_to(0.85);
            let swing_n = world.most_n([0.75, 0.85]) - world.least_n([0.75, 0.85]);
            let most_n = world.most_n([0.0, 0.85]);
            let case = format!("{stiffness_n_per_m} N/m, stated {stated} times: {swing_n} N, {most_n} N");
            println!("{case}");
            // A strongly shaking bite looks like a break of food.
            assert!(swing_n < 2.0 && world.law.bite.phase != Phase::Broken, "{case}");
            assert!(most_n < world.law.bite.config.limit_n(), "{case}");
        }
    }
}

#[test]
fn neither_contact_nor_opening_makes_the_targets_jump() {
    for config in [ForceControlConfig::default(), hold()] {
        let mut world = World::new(config);
        world.run_to(END_S);
        assert!(world.most_acceleration_m_s2() < 60.0, "{}", world.most_acceleration_m_s2());
    }
}

#[test]
fn after_the_bite_the_jaw_is_back_on_the_motion() {
    let mut world = World::new(ForceControlConfig::default());
    world.run_to(END_S);
    // The opening motion takes the jaw along, and ends before the jaw is back to the last micrometre.
    assert!(world.law.offsets_m[0].norm() < 1e-5, "{:?}", world.law);
    assert!(world.law.detour().at_sample_m.norm() < 1e-5);
}

/// The food breaks at 25 N, 2.9 mm before the mouth is closed.
#[test]
fn when_food_breaks_the_jaw_neither_slams_nor_closes_again() {
    let mut world = World { breaks_at_m: 25.0 / 3500.0, ..World::new(hold()) };
    let mut broke_at_m = None;
    while world.cycle < 1000 {
        world.step().unwrap();
        if world.stiffness_n_per_m == 0.0 {
            broke_at_m =
                broke_at_m.or(world.asked_m.get(world.asked_m.len() - 1 - LEAD_CYCLES).map(|at_m| at_m.z));
        }
    }
    let highest_m = world.asked_m.iter().map(|at_m| at_m.z).fold(f64::NEG_INFINITY, f64::max);
    let travelled_m = highest_m - broke_at_m.unwrap();
    assert_eq!(world.law.bite.phase, Phase::Broken);
    assert!((0.0..5e-4).contains(&travelled_m), "{travelled_m}");
    assert!(highest_m < -2e-3, "the mouth stays open until the motion opens it: {highest_m}");
    assert!(world.law.bite.desired_n <= 0.0);
}

#[test]
fn an_empty_mouth_closes_with_the_motion_and_a_wall_beyond_the_reach_ends_it() {
    let mut empty = World { stiffness_n_per_m: 0.0, ..World::new(hold()) };
    empty.run_to(END_S);
    assert_eq!(
        (empty.law.bite.phase, empty.law.offsets_m),
        (Phase::Free, [Vec3::zeros(); MOST_LEAD_CYCLES + 1])
    );
    let mut world = World {
        stiffness_n_per_m: 1.5e5,
        ..World::new(ForceControlConfig { reach_m: 0.003, damping_n_s_per_m: 1000.0, ..hold() })
    };
    let failed = (0..1000).find_map(|_| world.step().err());
    assert_eq!(failed, Some(LawFailed));
    assert!(world.law.offsets_m[0].z >= -0.003);
}

/// A law by a load cell of 50 N.
fn by_cell() -> World {
    let config = ForceControlConfig { source: ForceSource::LoadCell, ..hold() };
    let cell = LoadCellConfig { range_n: 50.0, ..LoadCellConfig::default() };
    let scenario = Scenario { load_cell: Some(cell), ..Scenario::default() };
    World { law: ForceControl::new(&scenario, config, 0.0), ..World::new(config) }
}

#[test]
fn a_load_cell_that_stays_at_the_end_of_its_range_ends_the_bite() {
    for (ends_n, fails) in
        [([-50.0, 50.0], false), ([50.0, 50.0], true), ([-50.0, -50.0], true), ([49.9, 49.9], false)]
    {
        let mut world = World { cell_ends_n: ends_n, ..by_cell() };
        let failed = (0..30).find(|_| world.step().is_err());
        assert_eq!(failed, fails.then_some(FULL_CYCLES - 1), "{ends_n:?}");
    }
    // One cycle below the end begins the count anew.
    let mut world = by_cell();
    for cycle in 0..30 {
        let shown_n = if cycle % FULL_CYCLES == 0 { 49.0 } else { 50.0 };
        world.cell_ends_n = [shown_n; 2];
        assert_eq!(world.step(), Ok(()));
    }
}

/// Nothing would begin force control at a contact after the motion.
#[test]
fn an_approach_that_is_not_at_its_end_when_the_motion_is_goes_no_further() {
    let mut world = World::new(ForceControlConfig { probe: Some(ProbeConfig::default()), ..hold() });
    world.run_to(MOVE_S + 0.05);
    let held_m = world.asked_m.last().unwrap().z;
    assert!((-0.012..-0.011).contains(&held_m), "the jaw is behind a closed motion: {held_m}");
    world.state = ControllerState::Holding;
    world.run_to(MOVE_S + CLOSED_S - 0.05);
    let now_m = world.asked_m.last().unwrap().z;
    assert!(now_m - held_m < 5e-5 && world.bites_n.iter().all(|bite_n| *bite_n == 0.0), "{held_m} {now_m}");
}

/// A held bite on food that leans: pressed, it pushes the jaw along x.
fn on_a_slope(lateral: Option<LateralForceConfig>) -> World {
    let normal = Vec3::new(0.2, 0.0, 1.0).normalize();
    World { normal, ..World::new(ForceControlConfig { lateral, ..hold() }) }
}

#[test]
fn only_with_lateral_control_does_the_jaw_give_way_to_a_side_and_then_it_comes_back() {
    let mut world = on_a_slope(None);
    world.run_to(0.8);
    assert!(world.asked_m.iter().all(|asked_m| asked_m.x == 0.0), "the jaw keeps to the motion");
    assert!(world.estimate_n.x > 5.0, "{}", world.estimate_n);
    // Nothing but the reach ends the way on a slope without friction.
    let lateral = LateralForceConfig { reach_m: 0.001, ..LateralForceConfig::default() };
    let mut world = on_a_slope(Some(lateral));
    world.run_to(0.8);
    let most_m = world.asked_m.iter().map(|asked_m| asked_m.xy().norm()).fold(0.0, f64::max);
    assert!((most_m - 0.001).abs() < 1e-9 && world.asked_m[800].x < 0.0, "{most_m}");
    world.run_to(END_S);
    assert!(world.law.offsets_m[0].norm() < 1e-5, "{:?}", world.law);
    assert!(world.most_acceleration_m_s2() < 60.0, "{}", world.most_acceleration_m_s2());
}

/// On a spring that leans along x, a side force along x moves the jaw until the spring gives that force.
#[test]
fn a_desired_lateral_force_goes_with_the_bite_force() {
    let lateral = LateralForceConfig { peak_n: [6.0, 0.0], reach_m: 0.01 };
    let mut world = on_a_slope(Some(lateral));
    world.run_to(0.5);
    // The spring turns 30 N of bite into 6 N to the side: this target moves nothing to the side.
    assert!((world.estimate_n.x - 6.0).abs() < 0.3, "{}", world.estimate_n);
    assert!((world.law.desired_lateral_n().x - 6.0).abs() < 1e-9);
    world.run_to(0.9);
    assert_eq!(world.law.desired_lateral_n(), Vector2::zeros(), "no bite");
}

#[test]
fn the_detour_at_a_sample_is_what_was_asked_for_lead_cycles_before() {
    let mut law = World::new(hold()).law;
    law.offsets_m[..4].copy_from_slice(&[3.0, 2.0, 1.0, 0.0].map(|z_m| z_m * Vec3::z()));
    for (lead_cycles, expected_m) in [(1.0, 3.0), (2.0, 2.0), (2.5, 1.5), (3.0, 1.0)] {
        law.lead_cycles = lead_cycles;
        assert!((law.detour().at_sample_m.z - expected_m).abs() < 1e-12, "{lead_cycles}");
    }
}

#[test]
fn a_bite_begins_with_the_force_of_contact_and_comes_to_its_peak() {
    let half_sine = ForceControlConfig { contact_n: 10.0, peak_n: 50.0, bite_s: 0.2, ..Default::default() };
    let hold = ForceControlConfig { profile: BiteProfile::Hold, ..half_sine };
    let table = [(half_sine, [10.0, 38.284, 50.0, 38.284]), (hold, [10.0, 50.0, 50.0, 50.0])];
    for (config, expected_n) in table {
        for (time_s, expected_n) in [0.0, 0.05, 0.1, 0.15].into_iter().zip(expected_n) {
            let found_n = desired_n(&config, time_s);
            assert!((found_n - expected_n).abs() < 0.01, "{time_s} s: {found_n}");
        }
    }
}
