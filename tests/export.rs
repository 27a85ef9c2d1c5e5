//! `masseter export`: what users find in the tables of a recording.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use crate::common::{self, Workspace, masseter, stderr, stdout};
use masseter_recording::{Reader, Recorded};

fn virtual_run(scenario: &str) -> Workspace {
    let workspace = Workspace::new(scenario);
    let output = workspace.run_virtual(&[]);
    assert!(output.status.code().is_some(), "{}", stderr(&output));
    workspace
}

fn export(recording: &Path, out: &Path, more: &[&str]) -> Output {
    let [recording, out] = [recording, out].map(|path| path.to_str().unwrap());
    masseter(&[&["export", recording, "--format", "csv", "--out", out], more].concat())
}

/// A CSV file with its header.
struct Rows {
    header: Vec<String>,
    rows: Vec<csv::StringRecord>,
}

impl Rows {
    fn read(path: &Path) -> Self {
        let mut table = csv::Reader::from_path(path).unwrap();
        let header = table.headers().unwrap().iter().map(str::to_owned).collect();
        Self { header, rows: table.records().map(Result::unwrap).collect() }
    }

    fn column(&self, name: &str) -> impl Iterator<Item = &str> {
        let place = self.header.iter().position(|header| header == name);
        let place = place.unwrap_or_else(|| panic!("no column {name}: {:?}", self.header));
        self.rows.iter().map(move |row| &row[place])
    }

    fn numbers(&self, name: &str) -> Vec<f64> {
        self.column(name).map(|text| text.parse().unwrap()).collect()
    }
}

#[test]
fn the_table_of_a_topic_holds_its_messages_with_words_for_codes() {
    let workspace = virtual_run("duration_s = 1.0");
    let out = workspace.file("tables");
    let output = export(&workspace.run_folder(), &out, &[]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));

    let table = Rows::read(&out.join("reading.csv"));
    let mut reader = Reader::open(&workspace.run_folder().join("recording.mcap")).unwrap();
    let mut readings = Vec::new();
    while let Some(message) = reader.next_message().unwrap() {
        if let Recorded::Reading(reading) = message {
            readings.push(reading);
        }
    }
    assert_eq!(table.rows.len(), readings.len());
    let (cycles, lengths) = (table.numbers("cycle"), table.numbers("position_m_3"));
    for (at, reading) in readings.iter().enumerate() {
        assert_eq!((cycles[at], lengths[at]), (reading.cycle as f64, reading.position_m[3]));
    }
    let states: BTreeSet<_> = table.column("drive_state_0").collect();
    assert!(states.contains("operation_enabled") && states.contains("unknown"), "{states:?}");
    let frames = fs::read_to_string(out.join("can0.log")).unwrap();
    assert!(frames.lines().count() > 1000);
    assert_eq!(frames, fs::read_to_string(workspace.run_folder().join("can0.log")).unwrap());
    assert!(!out.join("machine.csv").exists(), "simulated time has no counters of a kernel");
}

#[test]
fn times_count_from_the_motion_in_every_table() {
    let workspace = virtual_run("duration_s = 1.0");
    let out = workspace.file("tables");
    assert_eq!(export(&workspace.run_folder(), &out, &[]).status.code(), Some(0));
    let states = Rows::read(&out.join("state.csv"));
    let running: Vec<_> = states.column("controller_state").map(|state| state == "running").collect();
    let times_s = states.numbers("time_s");
    let first = running.iter().position(|running| *running).unwrap();
    assert!(times_s[first].abs() < 1e-12 && times_s[first - 1] < 0.0, "{}", times_s[first]);
    let cycles = Rows::read(&out.join("cycles.csv"));
    let at_start = cycles.numbers("time_s").iter().position(|time_s| *time_s >= 0.0).unwrap();
    assert_eq!(cycles.column("controller_state").nth(at_start), Some("running"));
    assert_eq!(cycles.column("controller_state").nth(at_start - 1), Some("easing"));
    let events = Rows::read(&out.join("event.csv"));
    let begun = events.column("state_after").position(|state| state == "running").unwrap();
    assert!(events.numbers("time_s")[begun].abs() < 0.002);
}

#[test]
fn a_row_of_cycles_has_the_points_of_the_jaw_in_millimetres() {
    let workspace = virtual_run("duration_s = 1.0");
    let out = workspace.file("tables");
    let output = export(&workspace.run_folder().join("recording.mcap"), &out, &["--table", "cycles"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let cycles = Rows::read(&out.join("cycles.csv"));
    let names = [
        "incisal_x_mm",
        "condyle_left_z_mm",
        "condyle_right_y_mm",
        "jaw_opening_mm",
        "l1_position_mm",
        "fk_residual_um",
    ];
    for name in names {
        assert!(cycles.column(name).any(|text| text.parse::<f64>().is_ok_and(f64::is_finite)), "{name}");
    }
    let opening =
        cycles.column("jaw_opening_mm").filter_map(|text| text.parse::<f64>().ok()).fold(0.0, f64::max);
    let summary = workspace.summary();
    assert!((5.0..60.0).contains(&opening), "{opening} mm; {}", summary["verdict"]);
    assert!(!out.join("reading.csv").exists() && !out.join("can0.log").exists());
}

#[test]
fn the_codebook_names_every_column_of_every_table_with_its_meaning() {
    let workspace = virtual_run("duration_s = 0.5");
    let out = workspace.file("tables");
    assert_eq!(export(&workspace.run_folder(), &out, &[]).status.code(), Some(0));
    let codebook = Rows::read(&out.join("codebook.csv"));
    let described: BTreeSet<_> = codebook.column("table").zip(codebook.column("column")).collect();
    assert!(codebook.column("meaning").all(|meaning| !meaning.is_empty()));
    let mut columns = 0;
    for entry in fs::read_dir(&out).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        if path.extension().is_none_or(|extension| extension != "csv") || name == "codebook" {
            continue;
        }
        for column in Rows::read(&path).header {
            assert!(described.contains(&(name.as_str(), column.as_str())), "{name}: {column}");
            columns += 1;
        }
    }
    assert_eq!(columns, described.len());
    let unit =
        codebook.column("column").zip(codebook.column("unit")).find(|(name, _)| *name == "joint_m_s_0");
    assert_eq!(unit, Some(("joint_m_s_0", "m/s")));
}

#[test]
fn a_signal_of_the_controller_is_a_column_with_its_unit() {
    let workspace = virtual_run("duration_s = 0.5");
    let out = workspace.file("tables");
    assert_eq!(export(&workspace.run_folder(), &out, &["--table", "cycles"]).status.code(), Some(0));
    let cycles = Rows::read(&out.join("cycles.csv"));
    let declared = workspace.manifest()["declared"]["parameters"].as_array().unwrap().clone();
    assert!(!declared.is_empty());
    for parameter in declared {
        let name = format!("parameter_{}", parameter["name"].as_str().unwrap());
        assert!(cycles.column(&name).any(|text| !text.is_empty()), "{name}");
    }
}

#[test]
fn the_formats_hold_the_same_rows() {
    common::demand_parquet();
    let workspace = virtual_run("duration_s = 0.5");
    let (csv, parquet) = (workspace.file("csv"), workspace.file("parquet"));
    assert_eq!(export(&workspace.run_folder(), &csv, &[]).status.code(), Some(0));
    let [run, out] = [&workspace.run_folder(), &parquet].map(|path| path.to_str().unwrap().to_owned());
    let output = masseter(&["export", &run, "--out", &out]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let rows = |text: String| text.replace(".parquet", "").replace(".csv", "").replace("parquet", "csv");
    let expected = masseter(&["export", &run, "--format", "csv", "--out", &format!("{out}-csv")]);
    assert_eq!(rows(stdout(&output)), rows(stdout(&expected)).replace("csv-csv", "csv"));
    assert!(fs::read(parquet.join("cycles.parquet")).unwrap().starts_with(b"PAR1"));
}

#[test]
fn without_the_program_that_writes_parquet_the_default_is_refused_before_any_work_and_csv_is_written() {
    let workspace = virtual_run("duration_s = 0.5");
    let (lone, out) = (workspace.file("masseter"), workspace.file("tables"));
    common::copy_program(&lone);
    let export = |more: &[&str]| {
        let mut command = Command::new(&lone);
        command.arg("export").arg(workspace.run_folder()).arg("--out").arg(&out).args(more).output().unwrap()
    };
    let refused = export(&[]);
    assert_eq!(refused.status.code(), Some(2));
    let said = stderr(&refused);
    let program = workspace.file("masseter-parquet").display().to_string();
    let names = [
        program.as_str(),
        "`cargo build --release`",
        "`cargo install --path rig/record/parquet`",
        "--format csv",
    ];
    assert!(names.iter().all(|name| said.contains(name)) && said.lines().count() == 1, "{said}");
    assert!(!out.exists());
    let written = export(&["--format", "csv"]);
    assert_eq!(written.status.code(), Some(0), "{}", stderr(&written));
    assert!(out.join("cycles.csv").is_file());
}

#[test]
fn an_existing_folder_and_an_unknown_table_are_exit_2_and_nothing_is_written() {
    let workspace = virtual_run("duration_s = 0.5");
    let out = workspace.file("tables");
    let unknown = export(&workspace.run_folder(), &out, &["--table", "raeding"]);
    assert_eq!(unknown.status.code(), Some(2));
    let said = stderr(&unknown);
    assert!(
        said.contains("no table 'raeding'") && said.contains("cycles, ") && said.contains(", reading, "),
        "{said}"
    );
    assert!(said.contains("did you mean 'reading'?") && !out.exists(), "{said}");
    fs::create_dir(&out).unwrap();
    let existing = export(&workspace.run_folder(), &out, &[]);
    assert_eq!(existing.status.code(), Some(2));
    assert!(stderr(&existing).contains("exists and is not overwritten"), "{}", stderr(&existing));
    assert_eq!(fs::read_dir(&out).unwrap().count(), 0);
}

#[test]
fn a_cut_recording_gives_its_rows_and_exit_6() {
    let workspace = virtual_run("duration_s = 1.0");
    let whole = workspace.recording();
    let (cut, out) = (workspace.file("cut.mcap"), workspace.file("tables"));
    fs::write(&cut, &whole[..whole.len() * 2 / 3]).unwrap();
    let output = export(&cut, &out, &[]);
    assert_eq!(output.status.code(), Some(6), "{}", stderr(&output));
    assert!(stdout(&output).contains("the file lacks its end"), "{}", stdout(&output));
    assert!(Rows::read(&out.join("truth.csv")).rows.len() > 100);
}

#[test]
fn a_recording_without_a_motion_has_tables_without_times_and_says_so() {
    let workspace = virtual_run("duration_s = 1.0");
    let whole = workspace.recording();
    let (boot, out) = (workspace.file("boot.mcap"), workspace.file("tables"));
    fs::write(&boot, &whole[..whole.len() / 4]).unwrap();
    let output = export(&boot, &out, &["--table", "state"]);
    assert_eq!(output.status.code(), Some(6), "{}", stderr(&output));
    assert!(stdout(&output).contains("the recording has no motion"), "{}", stdout(&output));
    let states = Rows::read(&out.join("state.csv"));
    assert!(!states.rows.is_empty() && states.column("time_s").all(str::is_empty));
}
