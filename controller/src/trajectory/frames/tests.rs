//! Recordings in all 24 right-handed frames and in three units: the right frame is the best, or among equals.
//!
//! The made-up recordings of the examples are always judged. MASSETER_RECORDINGS names a folder with real ones that the
//! project does not contain (patient_jaws3d.csv, jma_markers.csv); without it they are skipped.

use std::fs;
use std::path::{Path, PathBuf};

use masseter_scenario::LengthUnit;
use nalgebra::{Quaternion, UnitQuaternion};

use super::super::columns::Unit;
use super::super::plausible::import;
use super::super::survey::survey;
use super::*;

/// A recording with the axes that are right as it stands.
fn recordings() -> Vec<(PathBuf, [&'static str; 3])> {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples");
    let mut found = vec![
        (examples.join("patient.csv"), ["+x", "+y", "+z"]),
        (examples.join("jaw.csv"), ["+x", "+y", "+z"]),
        (examples.join("tracker.csv"), ["+y", "-x", "+z"]),
        (examples.join("markers.csv"), ["+y", "-x", "+z"]),
    ];
    match std::env::var_os("MASSETER_RECORDINGS").map(PathBuf::from) {
        Some(folder) => found.extend([
            (folder.join("patient_jaws3d.csv"), ["+x", "+y", "+z"]),
            (folder.join("jma_markers.csv"), ["+y", "-x", "+z"]),
        ]),
        None => println!("skipped: patient_jaws3d.csv and jma_markers.csv (MASSETER_RECORDINGS is not set)"),
    }
    found
}

fn mm_in(unit: LengthUnit) -> f64 {
    match unit {
        LengthUnit::Um => 1e-3,
        LengthUnit::Mm => 1.0,
        LengthUnit::Cm => 10.0,
        LengthUnit::M => 1000.0,
    }
}

/// The text of a recording in other axes and in another unit.
fn turned(text: &str, right: &Axes, axes: &Axes, unit: LengthUnit) -> String {
    let to_file = axes.matrix().transpose() * right.matrix();
    let is_of_markers = text.contains("m1_x_mm");
    let turn = |row: &str| -> String {
        let numbers: Vec<f64> = row.split(',').map(|number| number.parse().unwrap()).collect();
        let lengths = if is_of_markers { 10 } else { 4 };
        let mut turned = vec![numbers[0]];
        for length in numbers[1..lengths].chunks(3) {
            turned.extend((to_file * Vec3::from_column_slice(length) / mm_in(unit)).iter());
        }
        if let &[w, x, y, z] = &numbers[lengths..] {
            let vector = to_file * UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)).scaled_axis();
            let turned_by = UnitQuaternion::from_scaled_axis(vector);
            turned.extend([turned_by.w, turned_by.i, turned_by.j, turned_by.k]);
        }
        turned.iter().map(f64::to_string).collect::<Vec<_>>().join(",")
    };
    let is_row = |line: &&str| line.starts_with(|first: char| first.is_ascii_digit() || first == '-');
    let header = text.lines().find(|line| line.starts_with("time_s")).unwrap();
    let rows: Vec<_> = text.lines().filter(is_row).map(turn).collect();
    format!("{header}\n{}\n", rows.join("\n"))
}

#[test]
fn the_right_frame_of_24_is_the_best_or_among_equals_in_every_unit() {
    let folder = std::env::temp_dir().join(format!("masseter-frames-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let jaw = JawConfig::default();
    for (path, right) in recordings() {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let text = fs::read_to_string(&path).unwrap();
        let right = Axes::parse(&right.map(String::from)).unwrap();
        let (mut alone, mut first, mut margins) = (0, 0, Vec::new());
        for (names, axes) in right_handed() {
            for unit in [LengthUnit::Mm, LengthUnit::Cm, LengthUnit::M] {
                let file = folder.join(&name);
                fs::write(&file, turned(&text, &right, &axes, unit)).unwrap();
                let config = FileConfig::new(&file);
                let found = survey(&config, &jaw).unwrap();
                let frames = found.frames.unwrap_or_else(|| panic!("{name}: no opening"));
                let likely: Vec<_> = frames.likely().map(|frame| frame.axes.clone()).collect();
                assert!(likely.contains(&names), "{name} {names:?}: {frames:#?}");
                let is_alone = likely.len() == 1;
                assert!(is_alone || frames.is_ambiguous());
                let stated = ["+x", "+y", "+z"].map(String::from);
                let played = import(&config, &jaw).map(|_| ()).map_err(|error| error.to_string());
                if unit == LengthUnit::Mm {
                    assert_eq!(found.implausible, []);
                    alone += u32::from(is_alone);
                    first += u32::from(frames.best[0].axes == names);
                    let is_right = |frame: &&Frame| frame.axes == names;
                    let misfit = |frame: Option<&Frame>| frame.unwrap().misfit;
                    let other = misfit(frames.best.iter().find(|frame| !is_right(frame)));
                    margins.push(other - misfit(frames.best.iter().find(is_right)));
                    assert!(played.is_ok() || !likely.contains(&stated), "{name} {names:?}: {played:?}");
                } else {
                    assert!(played.unwrap_err().contains(&format!("motion.{}", Unit::Length(unit))));
                    assert_eq!(found.likely_unit, Some(Unit::Length(unit)));
                }
            }
        }
        margins.sort_by(f64::total_cmp);
        println!("| {name} | {first} | {alone} | {:.1} to {:.1} |", margins[0], margins[23]);
    }
    fs::remove_dir_all(&folder).unwrap();
}
