//! Each quantity by itself, on an opening of 12° and its faults.

use std::f64::consts::TAU;

use super::super::survey::survey;
use super::*;

/// Four seconds of opening at half a hertz; `change` gets the numbers of a row.
fn opening(change: impl Fn(&mut [f64; 8])) -> FileConfig {
    use std::hash::{DefaultHasher, Hash, Hasher};
    let mut text = "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n".to_owned();
    for row in 0..400 {
        let time_s = f64::from(row) / 100.0;
        let share = (1.0 - (TAU * time_s / 2.0).cos()) / 2.0;
        let half = 12_f64.to_radians() * share / 2.0;
        let mut numbers = [time_s, 4.0 * share, 0.0, -3.0 * share, half.cos(), 0.0, half.sin(), 0.0];
        change(&mut numbers);
        text += &(numbers.map(|number| number.to_string()).join(",") + "\n");
    }
    let mut hasher = DefaultHasher::new();
    text.hash(&mut hasher);
    // Tests run in threads of one process, and some make the same text.
    let owner = (std::process::id(), std::thread::current().id());
    let path = std::env::temp_dir().join(format!("masseter-{owner:?}-{}.csv", hasher.finish()));
    std::fs::write(&path, text).unwrap();
    FileConfig::new(path)
}

/// Turns by `factor` times the angle.
fn turned(numbers: &mut [f64; 8], factor: f64) {
    let half = numbers[6].atan2(numbers[4]) * factor;
    (numbers[4], numbers[6]) = (half.cos(), half.sin());
}

#[test]
fn what_no_jaw_does_is_refused_with_its_quantity_and_the_key() {
    let scaled = |factor: f64| opening(move |row| row[1..4].iter_mut().for_each(|mm| *mm *= factor));
    let timed = |factor: f64| opening(move |row| row[0] *= factor);
    let still = opening(|row| {
        row[1..4].iter_mut().for_each(|mm| *mm /= 1000.0);
        turned(row, 0.0);
    });
    let cases = [
        (scaled(0.001), "way of the followed point to the turn", "motion.length_unit = \"m\""),
        (scaled(0.1), "way of the followed point to the turn", "motion.length_unit = \"cm\""),
        (scaled(9.0), "way of the condyles", "motion.reference_point_mm"),
        (scaled(1000.0), "way of the incisal point", "check motion.length_unit"),
        (still, "way of the incisal point", "motion.length_unit = \"m\""),
        (opening(|row| turned(row, 6.0)), "turn from the closed jaw", "qw,qx,qy,qz"),
        (
            opening(|row| {
                row[3] *= 7.0;
                turned(row, 0.01);
            }),
            "turn of a jaw",
            "angles the right unit",
        ),
        (timed(0.001), "speed of the incisal point", "check motion.time_unit"),
    ];
    for (mut config, quantity, remedy) in cases {
        let refused = import(&config, &JawConfig::default()).unwrap_err().to_string();
        let found = survey(&config, &JawConfig::default()).unwrap();
        assert!(refused.contains(remedy), "{quantity}: {refused}");
        assert!(
            found.implausible.iter().any(|one| one.quantity.contains(quantity)),
            "{quantity}: {:?}",
            found.implausible
        );
        config.if_implausible = IfImplausible::Warn;
        let played = import(&config, &JawConfig::default()).unwrap();
        assert!(played.doubts.iter().any(|doubt| doubt.contains(quantity)), "{:?}", played.doubts);
    }
}

#[test]
fn the_likely_unit_is_one_with_which_the_motion_plays() {
    for (unit, factor) in [(LengthUnit::Cm, 0.1), (LengthUnit::M, 0.001)] {
        let mut config = opening(|row| row[1..4].iter_mut().for_each(|length| *length *= factor));
        let found = survey(&config, &JawConfig::default()).unwrap();
        assert_eq!(found.likely_unit, Some(Unit::Length(unit)));
        config.length_unit = Some(unit);
        assert!(import(&config, &JawConfig::default()).unwrap().doubts.is_empty());
    }
    let mut config = opening(|row| row[0] *= 1000.0);
    let refused = survey(&config, &JawConfig::default()).unwrap_err().to_string();
    assert!(refused.contains("motion.time_unit = \"ms\""), "{refused}");
    config.time_unit = Some(TimeUnit::Ms);
    assert!(import(&config, &JawConfig::default()).unwrap().doubts.is_empty());
}

#[test]
fn one_glitch_is_no_wrong_unit() {
    let config = opening(|row| row[3] -= if (row[0] - 1.0).abs() < 1e-9 { 200.0 } else { 0.0 });
    assert_eq!(survey(&config, &JawConfig::default()).unwrap().implausible, []);
}

/// Axes under which the condyles rise are refused, those of the fossa are named.
#[test]
fn axes_that_make_the_condyles_rise_are_refused() {
    let config = opening(|row| (row[1], row[3]) = (-row[1], -row[3]));
    let refused = import(&config, &JawConfig::default()).unwrap_err().to_string();
    assert!(refused.contains("3.0 mm up") && refused.contains("with [\"-x\", \"+y\", \"-z\"]"), "{refused}");
}
