//! Recordings in all 24 right-handed frames and in three units: the right frame is the best, or among equals.
//! docs/motions.md has the table of the examples.
//!
//! The made-up recordings of the examples are always judged. MASSETER_RECORDINGS names a folder with real ones that the
//! project does not contain (patient_jaws3d.csv, jma_markers.csv); without it they are skipped.

use std::fs;
use std::path::{Path, PathBuf};

use masseter_scenario::LengthUnit;
use nalgebra::{Quaternion, UnitQuaternion};

use super::super::c3d::tests::{Numbers, file as c3d};
use super::super::plausible::import;
use super::super::survey::survey;
use super::super::units::Unit;
use super::*;

/// A recording with the axes that are right as it stands.
fn recordings() -> Vec<(PathBuf, [&'static str; 3])> {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
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

/// How a recording is written.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Form {
    Csv,
    C3d,
}

/// A recording's rows of numbers under a header.
struct Rows {
    header: String,
    numbers: Vec<Vec<f64>>,
    are_of_markers: bool,
}

impl Rows {
    fn read(path: &Path) -> Self {
        let text = fs::read_to_string(path).unwrap();
        let is_row = |line: &&str| line.starts_with(|first: char| first.is_ascii_digit() || first == '-');
        let row = |row: &str| row.split(',').map(|number| number.parse().unwrap()).collect();
        let header = text.lines().find(|line| line.starts_with("time_s")).unwrap().to_owned();
        let are_of_markers = header.contains("m1_x_mm");
        Self { header, numbers: text.lines().filter(is_row).map(row).collect(), are_of_markers }
    }

    /// The recording in other axes and in another unit.
    fn turned(&self, right: &Axes, axes: &Axes, unit: LengthUnit, form: Form) -> Vec<u8> {
        let to_file = axes.matrix().transpose() * right.matrix();
        let turn = |numbers: &Vec<f64>| {
            let lengths = if self.are_of_markers { 10 } else { 4 };
            let mut turned = vec![numbers[0]];
            for length in numbers[1..lengths].chunks(3) {
                turned.extend((to_file * Vec3::from_column_slice(length) / mm_in(unit)).iter());
            }
            if let &[w, x, y, z] = &numbers[lengths..] {
                let vector =
                    to_file * UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)).scaled_axis();
                let turned_by = UnitQuaternion::from_scaled_axis(vector);
                turned.extend([turned_by.w, turned_by.i, turned_by.j, turned_by.k]);
            }
            turned
        };
        let rows: Vec<Vec<f64>> = self.numbers.iter().map(turn).collect();
        if form == Form::C3d {
            let rate_hz = (rows.len() - 1) as f64 / (rows[rows.len() - 1][0] - rows[0][0]);
            let places: Vec<_> = rows.iter().map(|row| row[1..].to_vec()).collect();
            return c3d(&["m1", "m2", "m3"], rate_hz as f32, &places, Numbers::Floats);
        }
        let text = |row: &Vec<f64>| row.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        let rows: Vec<_> = rows.iter().map(text).collect();
        format!("{}\n{}\n", self.header, rows.join("\n")).into_bytes()
    }
}

/// What the 24 frames gave.
#[derive(Debug, Default)]
struct Counts {
    alone: u32,
    among: u32,
    wrong_alone: u32,
    margins: Vec<f64>,
}

impl Counts {
    fn add(&mut self, frames: &Frames, right: &[String; 3]) {
        let is_right = |frame: &&Frame| frame.axes == *right;
        let likely: Vec<_> = frames.likely().filter(|frame| is_right(frame)).collect();
        match (frames.likely().count(), likely.len()) {
            (1, 1) => self.alone += 1,
            (_, 1) if frames.is_ambiguous() => self.among += 1,
            _ => self.wrong_alone += 1,
        }
        let misfit = |frame: Option<&Frame>| frame.map_or(f64::NAN, |frame| frame.misfit);
        let other = misfit(frames.best.iter().find(|frame| !is_right(frame)));
        self.margins.push(other - misfit(frames.best.iter().find(is_right)));
    }
}

#[test]
fn the_right_frame_of_24_is_the_best_or_among_equals_in_every_unit() {
    let folder = std::env::temp_dir().join(format!("masseter-frames-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let (jaw, mut table) = (JawConfig::default(), Vec::new());
    for (path, right) in recordings() {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let rows = Rows::read(&path);
        let right = Axes::parse(&right.map(String::from)).unwrap();
        let forms = if rows.are_of_markers { &[Form::Csv, Form::C3d][..] } else { &[Form::Csv] };
        let cases = forms
            .iter()
            .flat_map(|form| [LengthUnit::Mm, LengthUnit::Cm, LengthUnit::M].map(|unit| (*form, unit)));
        for (form, unit) in cases {
            let mut counts = Counts::default();
            for (names, axes) in right_handed() {
                let file = folder.join(&name);
                fs::write(&file, rows.turned(&right, &axes, unit, form)).unwrap();
                let config = FileConfig::new(&file);
                let found = survey(&config, &jaw).unwrap();
                let frames = found.frames.unwrap_or_else(|| panic!("{name}: no opening"));
                counts.add(&frames, &names);
                let played = import(&config, &jaw).map(|_| ()).map_err(|error| error.to_string());
                if unit == LengthUnit::Mm {
                    assert_eq!(found.implausible, []);
                    let stated = ["+x", "+y", "+z"].map(String::from);
                    let is_likely = frames.likely().any(|frame| frame.axes == stated);
                    assert!(played.is_ok() || !is_likely, "{name} {names:?}: {played:?}");
                } else {
                    assert!(played.unwrap_err().contains(&format!("motion.{}", Unit::Length(unit))));
                    assert_eq!(found.likely_unit, Some(Unit::Length(unit)));
                }
            }
            let Counts { alone, among, wrong_alone, mut margins } = counts;
            assert_eq!(wrong_alone, 0, "{name} {form:?} {unit:?}");
            margins.sort_by(f64::total_cmp);
            let form = if form == Form::C3d { "C3D" } else { "CSV" };
            let margins = format!("{:.1} to {:.1}", margins[0], margins[23]);
            let row = format!("| `{name}` | {form} | {alone} | {among} | {wrong_alone} | {margins} |");
            // The units make no difference.
            if !table.contains(&row) {
                table.push(row);
            }
        }
    }
    fs::remove_dir_all(&folder).unwrap();
    println!("{}", table.join("\n"));
    let shown =
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/motions.md")).unwrap();
    // The recordings of a person are no part of the project, but their rows are.
    let absent: Vec<_> = table.iter().filter(|row| !shown.contains(*row)).collect();
    assert!(absent.is_empty(), "docs/motions.md lacks {absent:#?}");
}
