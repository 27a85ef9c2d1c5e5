//! Objects that commissioning uses: switches, units, offsets, option codes, and homing on switches and stops.

use super::*;

/// The ends of the stroke, m, and home of each search.
const LOW_M: f64 = 0.22;
const HIGH_M: f64 = 0.36;
const HOMING_MS: u64 = 12_000;

impl Bench {
    /// A drive that has booted at a position.
    fn standing_at(position_m: f64) -> Self {
        let settings = settings();
        let drive = DriveNode::new(&settings, 0, position_m).unwrap();
        let mut bench = Self { drive, position_m, ..Self::switched_on(&settings) };
        bench.run_ms(25);
        bench
    }
}

#[test]
fn units_say_increments_and_take_no_others() {
    let mut bench = Bench::new();
    let table = [(0x60A8, 0x00B5_0000_u32), (0x60A9, 0x00B5_0300), (0x60AA, 0x00B5_5700)];
    for (index, unit) in table {
        assert_eq!(bench.read((index, 0)), Ok(unit));
        assert_eq!(bench.write((index, 0), &unit.to_le_bytes()), Ok(()));
        assert!(bench.write((index, 0), &(unit + 1).to_le_bytes()).is_err());
    }
    let ratios = [0x608F, 0x6091, 0x6092].map(|index| [1, 2].map(|sub| bench.read((index, sub)).unwrap()));
    assert_eq!(ratios, [[10_000, 1], [1, 1], [10_000, 1]]);
}

#[test]
fn digital_inputs_show_the_switches_and_the_encoder_its_own_counts() {
    let mut bench = Bench::enabled(HOMING);
    assert_eq!(bench.read((0x60FD, 0)), Ok(0));
    bench.control(0x1F);
    assert!(bench.is_near(0), "{}", bench.position());
    assert!((bench.read((0x6063, 0)).unwrap() as i32 - START).abs() < 40, "homing leaves the encoder");
    bench.control(0x00);
    for (position_m, inputs) in [(LOW_M + 0.5e-3, 1), (HIGH_M - 0.5e-3, 2), (0.29, 4)] {
        let mut bench = Bench::standing_at(position_m);
        assert_eq!(bench.read((0x60FD, 0)), Ok(inputs), "{position_m} m");
    }
}

/// Homes from the start; the machine's position of the home that was found, m, with the offset 50.
fn home_m(method: i8, stops_m: [f64; 2]) -> f64 {
    let mut bench = Bench::new();
    bench.stops_m = stops_m;
    bench.write(MODE, &[HOMING as u8]).unwrap();
    bench.write((0x6098, 0), &[method as u8]).unwrap();
    bench.write((0x607C, 0), &50_i32.to_le_bytes()).unwrap();
    bench.enable();
    bench.control(0x1F);
    bench.run_ms(HOMING_MS);
    assert!(bench.has(StatusBit::HOMING_ATTAINED), "method {method} at {} m", bench.position_m);
    assert_eq!(bench.emergencies(), [], "method {method}");
    bench.position_m - f64::from(bench.position() + 50) * 1e-6
}

#[test]
fn homing_finds_switches_stops_and_the_marks_behind_them() {
    let (switches_m, stops_m) = ([LOW_M + 1e-3, HIGH_M - 1e-3], [LOW_M - 2e-3, HIGH_M + 2e-3]);
    let table = [
        (17, switches_m[0], 5e-5),
        (18, switches_m[1], 5e-5),
        (1, 0.222, 2e-6),
        (2, 0.358, 2e-6),
        (-3, stops_m[1], 5e-4),
        (-4, stops_m[0], 5e-4),
        (-1, 0.362, 2e-6),
        (-2, 0.218, 2e-6),
    ];
    for (method, expected_m, tolerance_m) in table {
        let home_m = home_m(method, stops_m);
        assert!((home_m - expected_m).abs() <= tolerance_m, "method {method}: {home_m} m");
    }
}

#[test]
fn a_search_that_begins_on_its_switch_leaves_it() {
    let mut bench = Bench::standing_at(LOW_M + 0.4e-3);
    bench.write(MODE, &[HOMING as u8]).unwrap();
    bench.write((0x6098, 0), &[17]).unwrap();
    bench.enable();
    bench.control(0x1F);
    bench.run_ms(1000);
    assert!(bench.has(StatusBit::HOMING_ATTAINED));
    assert!((bench.position_m - f64::from(bench.position()) * 1e-6 - LOW_M - 1e-3).abs() < 5e-5);
}

#[test]
fn offsets_of_the_cyclic_modes_come_with_the_next_target() {
    let (mut bench, target) = Bench::cycling();
    (0..100).for_each(|_| bench.cycle(0x0F, target));
    bench.write((0x60B0, 0), &300_i32.to_le_bytes()).unwrap();
    bench.run_ms(20);
    assert!(bench.is_near(target), "not without a target");
    (0..100).for_each(|_| bench.cycle(0x0F, target));
    assert!(bench.is_near(target + 300));
    bench.write((0x60B0, 0), &[0; 4]).unwrap();
    bench.write((0x60B2, 0), &100_i16.to_le_bytes()).unwrap();
    bench.cycle(0x0F, target + 300);
    let pushed = bench.position();
    bench.cycle(0x0F, target + 300);
    assert!(bench.position() > pushed + 10, "50 N push at once");
    (0..200).for_each(|_| bench.cycle(0x0F, target + 300));
    assert!(bench.is_near(target + 300), "and the loops take it back");
}

#[test]
fn a_velocity_offset_leads_the_axis_away_until_the_position_loop_balances_it() {
    let (mut bench, target) = Bench::cycling();
    bench.write((0x60B1, 0), &10_000_i32.to_le_bytes()).unwrap();
    (0..300).for_each(|_| bench.cycle(0x0F, target));
    // 10 mm/s at a position gain of 100/s.
    assert!((bench.position() - target - 100).abs() <= 3, "{}", bench.position() - target);
}

#[test]
fn a_torque_offset_adds_to_the_target_torque() {
    let mut bench = Bench::enabled(CYCLIC_TORQUE);
    bench.nmt(NmtCommand::Start);
    bench.write((0x60B2, 0), &4_i16.to_le_bytes()).unwrap();
    bench.write((0x6071, 0), &6_i16.to_le_bytes()).unwrap();
    bench.sync();
    bench.run_ms(20);
    // 10 ‰ of 500 N carry the load.
    assert!(bench.velocity_m_s.abs() < 1e-3, "{} m/s", bench.velocity_m_s);
}

#[test]
fn shutdown_and_disable_operation_slow_down_where_their_options_say_so() {
    let table = [(0x605B, 0x06, DriveState::ReadyToSwitchOn), (0x605C, 0x07, DriveState::SwitchedOn)];
    for (option, word, state) in table {
        for slows_down in [false, true] {
            let (mut bench, _) = Bench::cycling();
            bench.write((option, 0), &[u8::from(slows_down), 0]).unwrap();
            bench.control(word);
            bench.run_ms(2);
            let expected = if slows_down { DriveState::OperationEnabled } else { state };
            assert_eq!(bench.drive.state(), expected, "{option:X}h");
            let before_m = bench.position_m;
            bench.run_ms(100);
            assert_eq!(bench.drive.state(), state, "{option:X}h");
            // 0.1 m/s at 2.5 m/s² take 2 mm, of which 2 ms are over.
            let way_m = bench.position_m - before_m;
            assert!(if slows_down { (way_m - 1.8e-3).abs() < 2e-4 } else { way_m < 2e-4 }, "{way_m} m");
        }
    }
}

#[test]
fn a_command_to_enable_ends_a_shutdown_that_slows_down() {
    let (mut bench, _) = Bench::cycling();
    bench.write((0x605B, 0), &[1, 0]).unwrap();
    bench.control(0x06);
    bench.run_ms(2);
    bench.control(0x0F);
    bench.run_ms(100);
    assert_eq!(bench.drive.state(), DriveState::OperationEnabled);
}

/// 0.1 m/s at 2.5 m/s² (6084h) take 2 mm, at 10 m/s² (6085h) 0.5 mm.
#[test]
fn a_halt_takes_the_ramp_of_its_option() {
    for (option, way_m) in [(1, 2e-3), (2, 0.5e-3)] {
        let mut bench = Bench::enabled(PROFILE_POSITION);
        bench.write((0x605D, 0), &[option, 0]).unwrap();
        bench.set_point(START + 50_000, 0);
        bench.run_ms(150);
        let before_m = bench.position_m;
        bench.control(0x10F);
        bench.run_ms(100);
        assert!((bench.position_m - before_m - way_m).abs() < 2e-4, "{} m", bench.position_m - before_m);
        assert!(bench.has(StatusBit::TargetReached));
    }
}
