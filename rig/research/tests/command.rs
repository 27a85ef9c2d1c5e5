//! `masseter-research` as a user has it: the folder of a study, proofs, searches and refusals.

use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Output};

/// The executable under test.
const RESEARCH: &str = env!("CARGO_BIN_EXE_masseter-research");

/// Inputs and their guesses, and the numbers of iterations that are allowed.
const ORIGINS_AND_CAPS: usize = 10 * 5;
/// Six readings of the paper, Newton–Raphson with two residuals, and the controller's.
const SOLVERS: usize = 9;
const TABLES: [(&str, &str); 23] = [
    ("fig3_diverging", "solver,iteration,error_cm2,d1_m,"),
    ("fig4_oscillating", "solver,iteration,error_cm2,d1_m,"),
    ("fig3b_stalling", "solver,iteration,error_cm2,d1_m,"),
    ("success", "inputs,guesses,solver,most_iterations,trials,reached_true,reached_other,"),
    ("iterations", "solver,iterations,trials"),
    ("speed", "start,solver,cases,median_ns,p99_ns,"),
    ("fig8_solutions", "theta1_deg,theta2_deg,theta3_deg,above_base,"),
    ("multiplicity", "counted,solutions,inputs"),
    ("basins", "guess1_deg,guess2_deg,guess3_deg,solver,reaches,iterations"),
    ("motions", "motion,within_limits,least_slide_margin_m,"),
    ("workspace_x_z", "x_mm,z_mm,condition,determinant,regular_within_deg,separation_deg"),
    ("workspace_y_z", "y_mm,z_mm,condition,"),
    ("workspace_roll_pitch", "roll_deg,pitch_deg,condition,"),
    ("workspace_yaw_pitch", "yaw_deg,pitch_deg,condition,"),
    ("mechanism", "leg,slide,x_m,y_m,z_m"),
    ("motion_paths", "motion,x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg"),
    ("forces", "friction,axis,time_s,force_n"),
    ("bites", "food,force,time_s,force_n"),
    ("pressed", "time_s,teeth_n,bite_n"),
    ("disagreements", "disagreement,trials,of"),
    ("settings", "version,seed,samples,command"),
    ("pressure", "tooth,right_mm,forward_mm,force_n,greatest_n,area_mm2,mean_mpa,peak_mpa"),
    ("pressures", "run,tooth,time_s,area_mm2,mean_mpa,peak_mpa"),
];

fn research(arguments: &[&str]) -> Output {
    Command::new(RESEARCH).args(arguments).output().expect("masseter-research starts")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn study(out: &Path, extra: &[&str]) -> Output {
    let few = ["study", "--samples", "80", "--cells", "6", "--out", out.to_str().unwrap()];
    research(&[&few, extra].concat())
}

fn read(folder: &Path, name: &str) -> String {
    fs::read_to_string(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

#[test]
fn the_folder_holds_every_table() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("study");
    let output = study(&folder, &[]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(stdout(&output), format!("{}\n", folder.display()));
    for (table, header) in TABLES {
        let text = read(&folder, &format!("{table}.csv"));
        let mut lines = text.lines();
        let columns = lines.next().unwrap();
        assert!(columns.starts_with(header), "{table}: {columns}");
        // The examples of Figs. 3 and 4 need not occur among few guesses.
        assert!(lines.next().is_some() || table.starts_with("fig3") || table.starts_with("fig4"), "{table}");
    }
}

/// Whatever this sample gives: these follow from the mechanism.
#[test]
fn what_is_certain_is_found() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("study");
    assert_eq!(study(&folder, &[]).status.code(), Some(0));
    assert_eq!(read(&folder, "fig8_solutions.csv").lines().count(), 1 + 16);
    assert_eq!(read(&folder, "basins.csv").lines().count(), 1 + 6 * 6 * SOLVERS);
    let success = read(&folder, "success.csv");
    let controllers: Vec<_> = success.lines().filter(|line| line.contains(",controller,")).collect();
    assert_eq!(controllers.len(), ORIGINS_AND_CAPS, "{success}");
    for line in controllers {
        assert!(line.split(',').skip(4).take(3).eq(["80", "80", "0"]), "{line}");
    }
    // A time step of 0.1 leaves nine tenths of the residual: more iterations than 100, whatever the guess.
    let stepped = success.lines().filter(|line| line.contains("\"time steps, distances\",100,80,"));
    assert!(stepped.clone().count() == 10 && stepped.clone().all(|line| line.contains(",100,80,0,0,0,0,")));
}

#[test]
fn the_same_seed_gives_the_same_data_and_another_seed_others() {
    let place = tempfile::tempdir().unwrap();
    let folders = ["a", "b", "c"].map(|name| place.path().join(name));
    for (folder, seed) in folders.iter().zip(["5", "5", "6"]) {
        assert_eq!(study(folder, &["--seed", seed]).status.code(), Some(0));
    }
    let mut compared = 0;
    for entry in fs::read_dir(&folders[0]).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if !["speed.csv", "settings.csv"].contains(&name.as_str()) {
            let [a, b] = [0, 1].map(|folder| fs::read(folders[folder].join(&name)).unwrap());
            assert!(a == b, "{name} differs");
            compared += 1;
        }
    }
    assert_eq!(compared, TABLES.len() - 2);
    assert_ne!(read(&folders[0], "success.csv"), read(&folders[2], "success.csv"));
}

/// Its anterior is the tracker's y, and its left −x: along the tracker's own axes it would leave the strokes.
#[test]
fn a_recording_is_judged_by_the_axes_the_jaw_and_the_limits_of_its_scenario() {
    let place = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = place.path().join(name);
        fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let row = |i: u32| format!("{0},0,{1},0,1,0,0,0\n", f64::from(i) / 50.0, -0.3 * f64::from(i));
    let rows: String = (0..=100).map(row).collect();
    let recording = write("jaw.csv", &format!("time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n{rows}"));
    // No jaw moves so far without a turn.
    let any_axes = "[motion]\nkind = 'file'\npath = 'other.csv'\nif_implausible = 'warn'\n";
    let file = format!("{any_axes}axes = ['+y', '-x', '+z']\n");
    let forward = write("forward.toml", &format!("{file}[jaw]\nclosed_offset_m = [0.012, 0.0, 0.0]"));
    let own_axes = write("own-axes.toml", &format!("{any_axes}[jaw]\nclosed_offset_m = [0.012, 0.0, 0.0]"));
    let slow = write("slow.toml", &format!("{file}[limits]\nslide_velocity_m_s = 0.001"));
    let builders = write("builder.toml", "[mechanism]\nplatform_sides_m = [0.06, 0.06, 0.06]");

    let within_limits = |name: &str, scenario: &str| {
        let folder = place.path().join(name);
        let output = study(&folder, &["--trajectory", &recording, "--scenario", scenario]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        assert!(read(&folder, "settings.csv").contains(&format!(" --scenario {scenario}")));
        let motions = read(&folder, "motions.csv");
        let line = motions.lines().find(|line| line.starts_with("recording,")).unwrap();
        line.split(',').nth(1).unwrap() == "1"
    };
    assert!(within_limits("forward", &forward));
    assert!(!within_limits("own-axes", &own_axes));
    assert!(!within_limits("slow", &slow));
    let output = study(&place.path().join("builder"), &["--scenario", &builders]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("published mechanism"), "{}", stderr(&output));
}

#[test]
fn folders_and_values_that_cannot_be_used_are_refused() {
    let place = tempfile::tempdir().unwrap();
    let output = study(place.path(), &[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("exists and is not overwritten"), "{}", stderr(&output));
    let file = place.path().join("file");
    fs::write(&file, "").unwrap();
    let output = study(&file.join("below"), &[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("is no folder"), "{}", stderr(&output));
    assert!(!stderr(&output).contains("random guesses"), "the work had begun: {}", stderr(&output));
    let free = place.path().join("free");
    for wrong in [["--samples", "0"], ["--cells", "1"], ["--trajectory", "/nowhere.csv"]] {
        assert_eq!(study(&free, &wrong).status.code(), Some(2), "{wrong:?}");
        assert!(!free.exists());
    }
}

#[test]
fn a_margin_that_is_no_determinant_is_refused() {
    for margin in ["nan", "inf", "-inf", "-1"] {
        let output = research(&["uniqueness", "prove", "--boxes", "10", &format!("--margin={margin}")]);
        assert_eq!(output.status.code(), Some(2), "{margin}: {}", stderr(&output));
        assert!(stderr(&output).contains("use a finite determinant, 0 or above"), "{}", stderr(&output));
    }
}

#[test]
fn a_file_that_is_there_already_is_never_overwritten_with_inputs() {
    let place = tempfile::tempdir().unwrap();
    let mine = place.path().join("mine.csv");
    fs::write(&mine, "mine\n").unwrap();
    for verb in [&["search", "--inputs", "10"][..], &["prove", "--boxes", "10"]] {
        let output = research(&[&["uniqueness"], verb, &["--out", mine.to_str().unwrap()]].concat());
        assert_eq!(output.status.code(), Some(2), "{verb:?}: {}", stderr(&output));
        assert!(stderr(&output).contains("mine.csv exists and is not overwritten"), "{}", stderr(&output));
        assert!(stdout(&output).is_empty(), "{verb:?} had begun: {}", stdout(&output));
        assert_eq!(fs::read_to_string(&mine).unwrap(), "mine\n");
    }
}

/// Proofs are made at a desk, for a robot elsewhere.
#[test]
fn a_proof_around_a_motion_needs_no_interface_of_its_robot() {
    let place = tempfile::tempdir().unwrap();
    let scenario = place.path().join("robot.toml");
    fs::write(&scenario, "duration_s = 0.2\n[can]\ninterfaces = ['no-such-a', 'no-such-b']").unwrap();
    let prove = ["uniqueness", "prove", "--around-mm", "1", "--boxes", "1", "--scenario"];
    let output = research(&[&prove[..], &[scenario.to_str().unwrap()]].concat());
    assert!(stdout(&output).contains("boxes around its inputs"), "{}", stderr(&output));
    assert_ne!(output.status.code(), Some(2), "{}", stderr(&output));
}

/// A limit on the size of files stands for the full disk.
#[test]
fn a_full_disk_is_exit_6_and_with_room_the_same_passes() {
    let place = tempfile::tempdir().unwrap();
    let verbs = [
        &["uniqueness", "search", "--inputs", "10", "--out"][..],
        &["study", "--samples", "10", "--cells", "2", "--out"],
    ];
    for (number, verb) in verbs.into_iter().enumerate() {
        let run = |limit: &str| {
            let out = place.path().join(format!("{number}-{}", limit.len()));
            let script = format!("trap '' XFSZ; ulimit -f {limit}; exec \"$@\"");
            let mut shell = Command::new("sh");
            shell.args(["-c", &script, "sh", RESEARCH]).args(verb).arg(out).output().expect("a shell starts")
        };
        let output = run("0");
        assert_eq!(output.status.code(), Some(6), "{verb:?}: {}", stderr(&output));
        assert!(stderr(&output).contains("File too large"), "{verb:?}: {}", stderr(&output));
        let output = run("unlimited");
        assert_eq!(output.status.code(), Some(0), "{verb:?}: {}", stderr(&output));
    }
    let full = File::options().write(true).open("/dev/full").unwrap();
    let mut search = Command::new(RESEARCH);
    let output = search.args(["uniqueness", "search", "--inputs", "10"]).stdout(full).output().unwrap();
    assert_eq!(output.status.code(), Some(6), "{}", stderr(&output));
}
