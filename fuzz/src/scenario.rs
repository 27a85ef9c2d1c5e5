//! Any file is a scenario or refused with the reason; a scenario written out reads and is judged as the same
//! one, and what is valid has a cycle, and a mechanism and a motion or the reason why not.

use std::fs;
use std::path::Path;

use crate::{assert_proper, file_of};
use arbitrary::{Result, Unstructured};
use masseter_controller::trajectory::Trajectory;
use masseter_model::geometry::Mechanism;
use masseter_scenario::{
    BusFault, FaultConfig, LateralConfig, MotionConfig, OpeningConfig, ProtrusionConfig, Scenario,
};

/// Feeds the target with these bytes.
///
/// # Panics
/// If what the head of this file says does not hold.
pub fn feed(data: &[u8]) {
    // As somebody's file, which the examples are, and as a source of edits.
    read(&file_of(data));
    let edited = edited(&mut Unstructured::new(data)).unwrap_or_default();
    read(&file_of(edited.as_bytes()));
}

fn read(path: &Path) {
    let scenario = match Scenario::read(path) {
        Ok(scenario) => scenario,
        Err(error) => return assert!(!error.to_string().is_empty()),
    };
    let written = scenario.to_toml();
    fs::write(path, &written).expect("it could be written before");
    let again = Scenario::read(path).expect("what was written out can be read");
    assert_eq!(again.to_toml(), written);
    let judged = |scenario: &Scenario| scenario.validate().map_err(|error| error.to_string());
    assert_eq!(judged(&again), judged(&scenario));
    if judged(&scenario).is_ok() {
        play(&scenario);
    }
}

fn play(scenario: &Scenario) {
    assert!(scenario.period_ns() > 0 && scenario.period_s() > 0.0);
    scenario.can.bitrate().expect("a valid scenario has a bit rate");
    if matches!(scenario.motion, MotionConfig::File(_)) {
        return;
    }
    let Ok(mechanism) = Mechanism::new(&scenario.mechanism) else { return };
    match Trajectory::new(&scenario.motion, &scenario.jaw, &mechanism, scenario.duration_s) {
        Ok(trajectory) => assert_proper(&trajectory),
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}

/// A scenario with every key there is, some of whose values have become others.
fn edited(bytes: &mut Unstructured<'_>) -> Result<String> {
    let text = any_kind(bytes)?.to_toml();
    let mut lines: Vec<_> = text.lines().map(str::to_owned).collect();
    while !bytes.is_empty() {
        let line = bytes.choose_index(lines.len())?;
        let value = value(bytes)?;
        lines[line] = match lines[line].split_once(" = ") {
            Some((key, _)) => format!("{key} = {value}"),
            None if lines[line].starts_with(' ') => format!("{value},"),
            None => continue,
        };
    }
    Ok(lines.join("\n"))
}

fn any_kind(bytes: &mut Unstructured<'_>) -> Result<Scenario> {
    let motion = match bytes.int_in_range(0..=3)? {
        0 => MotionConfig::default(),
        1 => MotionConfig::Opening(OpeningConfig::default()),
        2 => MotionConfig::Protrusion(ProtrusionConfig::default()),
        _ => MotionConfig::Lateral(LateralConfig::default()),
    };
    let fault = FaultConfig {
        bus: Some(0),
        from_s: Some(1.0),
        until_s: Some(2.0),
        node: Some(1),
        id: Some(0x181),
        probability: 0.5,
        count: Some(3),
        size: Some("100 us".parse().expect("a time")),
        ..FaultConfig::new(BusFault::Delay)
    };
    let faults = if bytes.arbitrary()? { vec![fault] } else { Vec::new() };
    let duration_s = bytes.arbitrary::<bool>()?.then_some(3.0);
    Ok(Scenario { motion, faults, duration_s, ..Scenario::default() })
}

fn value(bytes: &mut Unstructured<'_>) -> Result<String> {
    Ok(match bytes.int_in_range(0..=5)? {
        0 => bytes.arbitrary::<u8>()?.to_string(),
        1 => bytes.arbitrary::<i64>()?.to_string(),
        2 => bytes.arbitrary::<u64>()?.to_string(),
        3 => format!("{:?}", f64::from(bytes.arbitrary::<i16>()?) / 100.0),
        4 => format!("{:?}", bytes.arbitrary::<f64>()?).to_lowercase(),
        _ => bytes.arbitrary::<&str>()?.to_owned(),
    })
}
