//! Scenarios whose plant cannot work.

use super::*;

#[test]
fn what_cannot_work_is_refused_with_its_key() {
    let default = Scenario::default;
    let with = |change: fn(&mut Scenario)| {
        let mut scenario = default();
        change(&mut scenario);
        check_scenario(&scenario).unwrap_err().to_string()
    };
    let slow = "can.heartbeat_consumer_ms = 199: use at least can.heartbeat_producer_ms and two cycles";
    let too_fine = "drives.leg.encoder_resolution_m = 0.000000000001: use more";
    let cases: [(String, &str); 14] = [
        (with(|s| s.can.heartbeat_consumer_ms = 50), "can.heartbeat_consumer_ms = 50: use at least"),
        (with(|s| s.can.heartbeat_consumer_ms = 51), "can.heartbeat_consumer_ms = 51: use at least"),
        (with(|s| (s.rate_hz, s.can.heartbeat_consumer_ms) = (10, 199)), slow),
        (with(|s| s.can.rpdo_timeout_ms = Some(2)), "can.rpdo_timeout_ms = 2: use 0 for none, or more"),
        (with(|s| s.can.node_ids[3] = 1), "node 1 is listed twice"),
        (with(|s| s.can.node_ids[3] = 0), "node id"),
        (with(|s| s.can.node_ids[3] = 127), "master"),
        (with(|s| s.can.buses = vec![vec![0, 1, 2], vec![3, 4]]), "axis 5 is named 0 times"),
        (with(|s| s.can.buses = vec![vec![0, 1, 2], vec![3, 4, 5, 0]]), "axis 0 is named 2 times"),
        (with(|s| s.can.buses = vec![vec![0, 1, 2], vec![3, 4, 5, 6]]), "axis 6"),
        (with(|s| s.can.buses.push(Vec::new())), "bus 2 has no drive"),
        (with(|s| s.drives.leg.encoder_resolution_m = 1e-12), too_fine),
        (with(|s| s.dynamics.initial_leg_m = 0.4), "dynamics.initial_leg_m = 0.4: "),
        (with(|s| s.mechanism.strokes.slide_m = [0.001, 0.03]), "initial_leg_m = 0.29: axis d1 at"),
    ];
    for (error, expected) in cases {
        assert!(error.contains(expected), "{error}");
    }
    assert_eq!(check_scenario(&default()), Ok(()));
    let mut least = default();
    least.can.heartbeat_consumer_ms = 52;
    assert_eq!(check_scenario(&least), Ok(()));
    let boots_within = |start_timeout_s: f64| {
        let mut scenario = Scenario { rate_hz: 10, ..default() };
        scenario.can.heartbeat_consumer_ms = 200;
        scenario.controller.start_timeout_s = start_timeout_s;
        check_scenario(&scenario)
    };
    assert!(boots_within(5.0).unwrap_err().to_string().contains("the drives take 20.8 s to boot"));
    assert_eq!(boots_within(20.9), Ok(()));
}

#[test]
fn the_rig_may_be_switched_on_with_its_legs_at_either_end() {
    for initial_leg_m in Scenario::default().mechanism.strokes.leg_m {
        let mut scenario = Scenario::default();
        scenario.dynamics.initial_leg_m = initial_leg_m;
        assert_eq!(check_scenario(&scenario), Ok(()), "{initial_leg_m}");
    }
}
