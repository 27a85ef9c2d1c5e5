use masseter_can::canopen::sync;
use masseter_can::cia402::DriveState;

use super::*;

#[test]
fn truth_is_sampled_with_the_first_sync_of_a_cycle_on_whichever_wire() {
    let mut emulation = Emulation::new(&Scenario::default(), 0).unwrap();
    let mut sampled_ns = |axes: [usize; 3], at_ns: u64| {
        for axis in axes {
            emulation.deliver(axis, &sync::frame(), at_ns).unwrap();
        }
        emulation.truth().sampled_ns
    };
    let (first, second) = ([0, 1, 2], [3, 4, 5]);
    assert_eq!(sampled_ns(first, 1000), 1000);
    assert_eq!(sampled_ns(second, 1000), 1000);
    assert_eq!(sampled_ns(second, 2000), 2000, "the first wire is busy");
    assert_eq!(sampled_ns(first, 2300), 2000);
    assert_eq!(sampled_ns(second, 3000), 3000);
    assert_eq!(sampled_ns(second, 4000), 4000, "and does not get through at all");
    assert_eq!(sampled_ns(first, 4500), 4000);
    assert_eq!(sampled_ns(first, 5000), 5000, "the second wire is dead");
}

#[test]
fn time_left_out_is_counted_in_whole_steps_and_moves_nothing() {
    let scenario = Scenario::default();
    let step_ns = scenario.dynamics.step_ns;
    let mut emulation = Emulation::new(&scenario, 0).unwrap();
    let first_ns = emulation.next_step_ns;
    (0..10).for_each(|_| emulation.step().unwrap());
    let (moved_to_ns, positions_m) = (emulation.moved_to_ns, emulation.dynamics.state.positions_m());

    assert_eq!(emulation.skip_to(emulation.next_step_ns + 3 * step_ns + 1), 3 * step_ns);
    assert_eq!(emulation.next_step_ns, first_ns + 13 * step_ns);
    assert_eq!(emulation.moved_to_ns, moved_to_ns + 3 * step_ns);
    assert!(emulation.dynamics.state.positions_m().iter().eq(&positions_m));
    assert_eq!(emulation.skip_to(0), 0);
}

/// The drives in fault 0.2 s after power-on, with a second encoder at each joint and a fault at that of l1.
fn faults_by_second_encoders(limit: &str, kind: &str) -> [bool; AXES] {
    let fault = if kind.is_empty() {
        String::new()
    } else {
        format!("[[faults]]\naxis = 'l1'\nfrom_s = 0.05\n{kind}\n")
    };
    let text = format!("[[drives.quirk]]\nkind = 'second_encoder'\n{limit}\n{fault}");
    let scenario = Scenario::parse(std::path::Path::new("second_encoder.toml"), &text).unwrap();
    scenario.validate().unwrap();
    let mut emulation = Emulation::new(&scenario, 0).unwrap();
    while emulation.next_step_ns < 200_000_000 {
        emulation.step().unwrap();
    }
    std::array::from_fn(|axis| emulation.drives[axis].state() == DriveState::Fault)
}

#[test]
fn a_second_encoder_finds_an_encoder_that_leaves_its_joint_and_nothing_else() {
    let (none, l1) = ([false; AXES], std::array::from_fn(|axis| axis == 3));
    let table = [
        ("", "", none),
        ("", "kind = 'encoder_offset'\nsize = '0.09 mm'", none),
        ("", "kind = 'encoder_offset'\nsize = '0.11 mm'", l1),
        ("limit_m = 0.001", "kind = 'encoder_offset'\nsize = '0.11 mm'", none),
        // 0.15 mm in 0.15 s.
        ("", "kind = 'encoder_drift'\nsize = '1 mm/s'", l1),
        ("", "kind = 'encoder_drift'\nsize = '0.5 mm/s'", none),
        // Nothing moves behind the closed brake.
        ("", "kind = 'encoder_stuck'", none),
        ("", "kind = 'drive_scale'\nsize = '1.05'", none),
    ];
    for (limit, kind, expected) in table {
        assert_eq!(faults_by_second_encoders(limit, kind), expected, "{limit} {kind}");
    }
}
