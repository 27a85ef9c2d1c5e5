//! CiA 402: homing, and the axis after homing has moved its origin.

use super::*;

#[test]
fn homing_on_the_actual_position_only_renames_it() {
    for method in [35, 37] {
        let mut bench = Bench::enabled(HOMING);
        bench.write((0x6098, 0), &[method]).unwrap();
        bench.write((0x607C, 0), &1234_i32.to_le_bytes()).unwrap();
        let before_m = bench.position_m;
        bench.control(0x1F);
        assert!(bench.has(StatusBit::HOMING_ATTAINED) && bench.has(StatusBit::TargetReached));
        assert!(bench.is_near(-1234), "zero lies the offset beyond home");
        bench.run_ms(20);
        assert!((bench.position_m - before_m).abs() < 2e-5);
    }
}

#[test]
fn homing_to_a_reference_mark_moves_there_and_puts_zero_the_offset_beyond() {
    for (method, mark) in [(33, 270_000), (34, 272_000)] {
        let mut bench = Bench::enabled(HOMING);
        bench.write((0x6098, 0), &[method]).unwrap();
        bench.write((0x607C, 0), &50_i32.to_le_bytes()).unwrap();
        bench.control(0x1F);
        bench.run_ms(50);
        assert!(!bench.has(StatusBit::HOMING_ATTAINED) && !bench.has(StatusBit::TargetReached));
        assert_eq!(bench.write((0x6098, 0), &[35]), Err(AbortCode::DEVICE_STATE));
        bench.run_ms(500);
        assert!(bench.has(StatusBit::HOMING_ATTAINED) && bench.has(StatusBit::TargetReached));
        let counts = (bench.position_m / 1e-6).round() as i32;
        assert!((bench.position() - (counts - mark - 50)).abs() <= 1, "method {method}");
        assert!((counts - mark).abs() < 50, "it stopped soon behind the mark");
    }
}

#[test]
fn software_limits_count_from_the_home_position() {
    let mut bench = Bench::enabled(HOMING);
    bench.write((0x607C, 0), &1000_i32.to_le_bytes()).unwrap();
    bench.write((0x607D, 1), &(-6000_i32).to_le_bytes()).unwrap();
    bench.write((0x607D, 2), &6000_i32.to_le_bytes()).unwrap();
    bench.control(0x1F);
    let home_m = bench.position_m;
    bench.control(0x00);
    bench.write(MODE, &[PROFILE_POSITION as u8]).unwrap();
    bench.enable();
    bench.set_point(100_000, 0);
    bench.run_ms(1000);
    assert!(bench.is_near(5000));
    assert!((bench.position_m - home_m - 6000.0 * 1e-6).abs() < 2e-5);
}

#[test]
fn a_home_that_was_attained_stays_so_until_a_restart_or_another_homing() {
    let mut bench = Bench::enabled(HOMING);
    bench.control(0x1F);
    bench.control(0x00);
    bench.write(MODE, &[CYCLIC_POSITION as u8]).unwrap();
    bench.write(MODE, &[HOMING as u8]).unwrap();
    assert!(bench.has(StatusBit::HOMING_ATTAINED) && bench.has(StatusBit::TargetReached));
    bench.write((0x6098, 0), &[34]).unwrap();
    bench.enable();
    bench.control(0x1F);
    assert!(!bench.has(StatusBit::HOMING_ATTAINED), "searching anew");

    let mut bench = Bench::enabled(HOMING);
    bench.control(0x1F);
    bench.nmt(NmtCommand::ResetNode);
    bench.run_ms(25);
    bench.write(MODE, &[HOMING as u8]).unwrap();
    assert!(!bench.has(StatusBit::HOMING_ATTAINED));
}

#[test]
fn homing_fails_without_a_mark_before_the_limit_and_ends_on_command() {
    let mut bench = Bench::enabled(HOMING);
    bench.write((0x6098, 0), &[34]).unwrap();
    bench.write((0x607D, 2), &(START + 500).to_le_bytes()).unwrap();
    bench.control(0x1F);
    bench.run_ms(500);
    assert!(bench.has(StatusBit::HOMING_ERROR) && !bench.has(StatusBit::HOMING_ATTAINED));
    let mut bench = Bench::enabled(HOMING);
    bench.write((0x6098, 0), &[34]).unwrap();
    bench.control(0x1F);
    bench.run_ms(50);
    bench.control(0x0F);
    bench.run_ms(500);
    assert!(!bench.has(StatusBit::HOMING_ERROR) && !bench.has(StatusBit::HOMING_ATTAINED));
    assert!(bench.has(StatusBit::TargetReached), "interrupted");
}

impl Bench {
    /// Enabled in homing where its position is called 0, far below the software limits.
    fn homed_below_its_limits() -> Self {
        let mut bench = Self::enabled(HOMING);
        bench.write((0x6098, 0), &[37]).unwrap();
        bench.control(0x1F);
        assert!(bench.has(StatusBit::HOMING_ATTAINED) && bench.is_near(0));
        bench.control(0x0F);
        bench
    }
}

#[test]
fn homing_leaves_the_numbers_of_the_software_limits_which_count_from_home() {
    let mut bench = Bench::homed_below_its_limits();
    assert_eq!([1, 2].map(|end| bench.read((0x607D, end)).unwrap() as i32), LIMITS);
}

#[test]
fn an_axis_outside_its_software_limits_stays_on_command() {
    let mut bench = Bench::homed_below_its_limits();
    bench.write(MODE, &[CYCLIC_POSITION as u8]).unwrap();
    bench.nmt(NmtCommand::Start);
    (0..100).for_each(|_| bench.cycle(0x0F, 0));
    assert!(bench.is_near(0), "{}", bench.position());
}

#[test]
fn an_axis_outside_its_software_limits_may_come_nearer_but_not_go_further() {
    let mut bench = Bench::homed_below_its_limits();
    bench.write(MODE, &[PROFILE_POSITION as u8]).unwrap();
    bench.set_point(-5000, 0);
    bench.run_ms(300);
    assert!(bench.is_near(0) && bench.has(StatusBit::InternalLimit));
    bench.set_point(5000, 0);
    bench.run_ms(300);
    assert!(bench.is_near(5000) && !bench.has(StatusBit::InternalLimit));
    bench.set_point(4000, 0);
    bench.run_ms(300);
    assert!(bench.is_near(5000));
}

#[test]
fn a_search_never_goes_against_its_direction() {
    let mut bench = Bench::homed_below_its_limits();
    bench.write((0x6098, 0), &[33]).unwrap();
    bench.control(0x1F);
    bench.run_ms(100);
    assert!(bench.has(StatusBit::HOMING_ERROR) && bench.is_near(0));
}

/// Fast, so that the axis takes 40 ms to stop behind the mark. The controlword may come again meanwhile.
#[test]
fn a_home_is_attained_once_the_axis_stands_and_stays_so() {
    let mut bench = Bench::enabled(HOMING);
    bench.write((0x6098, 0), &[34]).unwrap();
    bench.write((0x6099, 2), &100_000_u32.to_le_bytes()).unwrap();
    bench.control(0x1F);
    let attained = (1..1000).find(|_| {
        bench.control(0x1F);
        bench.run_ms(1);
        bench.has(StatusBit::HOMING_ATTAINED)
    });
    assert!(attained.is_some() && bench.velocity_m_s.abs() < 5e-3, "{} m/s", bench.velocity_m_s);
    bench.control(0x0F);
    assert!(bench.has(StatusBit::HOMING_ATTAINED));
}

#[test]
fn homing_that_was_interrupted_reaches_its_target_only_at_rest() {
    let mut bench = Bench::enabled(HOMING);
    bench.write((0x6098, 0), &[34]).unwrap();
    bench.write((0x6099, 2), &50_000_u32.to_le_bytes()).unwrap();
    bench.control(0x1F);
    bench.run_ms(15);
    for word in [0x0F, 0x10F] {
        bench.control(word);
        assert!(!bench.has(StatusBit::TargetReached), "it slows down");
    }
    bench.run_ms(100);
    assert!(bench.has(StatusBit::TargetReached) && !bench.has(StatusBit::HOMING_ATTAINED));
}

/// Bit 8 (halt) beside bit 4.
#[test]
fn homing_does_not_start_while_it_is_halted_and_ends_at_a_halt() {
    let mut bench = Bench::enabled(HOMING);
    bench.write((0x6098, 0), &[34]).unwrap();
    bench.run_ms(20);
    let start = bench.position();
    bench.control(0x11F);
    bench.run_ms(100);
    assert!(bench.is_near(start), "{}", bench.position() - start);
    bench.control(0x1F);
    bench.run_ms(100);
    assert!(bench.position() > start + 100);
    bench.control(0x11F);
    bench.run_ms(20);
    let halted = bench.position();
    bench.run_ms(400);
    assert!(bench.is_near(halted), "{}", bench.position() - halted);
    assert!(!bench.has(StatusBit::HOMING_ATTAINED) && bench.has(StatusBit::TargetReached));
}
