//! Faults of commands.

use super::*;

/// The master judges a bad command like that of any controller.
#[test]
fn a_bad_command_stops_the_rig_by_the_path_that_refuses_it() {
    for (kind, size, cause, axis) in [
        (Kind::Command(CommandFault::Nan), None, Cause::BadMessage, 0),
        (Kind::Command(CommandFault::Version), None, Cause::BadMessage, NO_AXIS),
        (Kind::Command(CommandFault::Jump), Some("2 mm"), Cause::VelocityLimit, 4),
        (Kind::Command(CommandFault::ControllerStall), Some("100 ms"), Cause::CommandLost, NO_AXIS),
    ] {
        let mut bench = bench_with(on_l2(kind, size));
        hold_until(&mut bench, 0.7);
        assert_eq!(first_failure(&bench), Some((cause, axis)), "{kind}");
        assert!(bench.plant.master.drives_are_off());
    }
}

/// The controller detects this one: a reading answers a cycle that it has not reached.
#[test]
fn a_foreign_command_shows_in_the_readings() {
    let mut bench = bench_with(on_l2(CommandFault::Foreign, None));
    hold_until(&mut bench, 0.55);
    assert!(bench.reading.answers_cycle > bench.cycle);
}
