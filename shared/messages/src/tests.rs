use proptest::prelude::*;

use super::codes::{BootPhase, ControllerState, DriveRequest, DriveState, NoPose};
use super::*;

/// FNV-1a, 64 bits.
fn hash(text: &str) -> u64 {
    text.bytes()
        .fold(0xCBF2_9CE4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3))
}

/// Schema, version and codes; [`Pod`] excludes padding, so the schema fixes every offset.
fn layout<M: Message>() -> String {
    macro_rules! codes {
        ($($name:ident),*) => {
            [$($name::ALL.map(|value| format!("{value}={}", value.code())).join(" ")),*].join("\n")
        };
    }
    let codes =
        codes!(DriveState, DriveRequest, ControllerState, BootPhase, Source, EventKind, NoPose, Cause);
    format!("{} v{LAYOUT_VERSION}\n{}{codes}", M::TYPE_NAME, M::schema())
}

fn check<M: Message>() {
    let expected = format!("{}/{:016x}", M::TYPE_NAME, hash(&layout::<M>()));
    assert_eq!(M::SHARED_MEMORY_NAME, expected, "name the new layout so: {}", layout::<M>());
}

#[test]
fn names_in_shared_memory_carry_the_hash_of_the_layout() {
    check::<Command>();
    check::<Reading>();
    check::<State>();
    check::<Signals>();
    check::<Parameters>();
    check::<Truth>();
    check::<Contact>();
    check::<FrameTap>();
    check::<Machine>();
    check::<Event>();
}

#[test]
fn the_hash_covers_version_fields_data_bytes_and_codes() {
    let layout = layout::<FrameTap>();
    for (found, other) in
        [("v15", "v16"), ("queued_ns", "waiting_ns"), ("[<=64]", "[<=8]"), ("fault=8", "fault=9")]
    {
        let changed = layout.replace(found, other);
        assert_ne!((hash(&layout), &layout), (hash(&changed), &changed));
    }
}

/// Sets every figure to 0.1, rounds, and checks that the lowest bits are zero, except in exact figures.
fn check_rounding<M: Message>(round: fn(&mut M), exact: &[&str]) {
    let mut message = M::zeroed();
    let fields = M::fields();
    let is_figure = |field: &&Field| field.ros_type.starts_with("float64");
    let of_figures = |field: &Field| {
        let figures = match field.ros_type.trim_start_matches("float64").trim_matches(['[', ']']) {
            "" => 1,
            number => number.parse().unwrap(),
        };
        (0..figures).map(|place| field.offset + 8 * place).collect::<Vec<_>>()
    };
    for at in fields.iter().filter(is_figure).flat_map(of_figures) {
        bytes_of_mut(&mut message)[at..at + 8].copy_from_slice(&0.1_f64.to_le_bytes());
    }
    round(&mut message);
    for field in fields.iter().filter(is_figure) {
        for at in of_figures(field) {
            let figure = u64::from_le_bytes(bytes_of(&message)[at..at + 8].try_into().unwrap());
            let is_rounded = figure % (1 << ZERO_BITS) == 0;
            assert_eq!(is_rounded, !exact.contains(&field.name), "{} {}", M::TYPE_NAME, field.name);
        }
    }
}

#[test]
fn every_figure_of_state_truth_and_contact_is_rounded_but_for_the_time() {
    check_rounding(State::round, &["motion_time_s"]);
    check_rounding(Truth::round, &[]);
    check_rounding(Contact::round, &[]);
}

fn rounded(value: f64) -> f64 {
    let mut values = [value];
    round_figures(&mut values);
    values[0]
}

proptest! {
    #[test]
    fn the_nearest_number_of_nine_digits(value in prop::num::f64::NORMAL) {
        let rounded = rounded(value);
        prop_assume!(value.abs() < f64::MAX / 2.0);
        prop_assert_eq!(rounded.to_bits() % (1 << ZERO_BITS), 0);
        prop_assert!((rounded - value).abs() <= value.abs() * 2.0_f64.powi(-31));
    }
}

#[test]
fn what_is_exact_or_no_number_stays() {
    for value in [0.0, -0.0, 1.0, -0.25, 1e9, f64::MAX, f64::MIN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(rounded(value).to_bits(), value.to_bits());
    }
    for nan in [u64::MAX, i64::MAX as u64, f64::NAN.to_bits(), f64::INFINITY.to_bits() + 1] {
        assert_eq!(rounded(f64::from_bits(nan)).to_bits(), nan);
    }
    assert_eq!(rounded(2.0 - f64::EPSILON).to_bits(), 2.0_f64.to_bits(), "a carry into the exponent");
}
