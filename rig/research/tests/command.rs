//! `masseter-research` as a user has it: the folder of a study, proofs and searches, and what is refused.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Output};

/// The executable under test.
const RESEARCH: &str = env!("CARGO_BIN_EXE_masseter-research");

const FIGURES: [&str; 16] = [
    "fig3_diverging",
    "fig4_oscillating",
    "fig3b_stalling",
    "fig5_speed",
    "fig6_assemblies",
    "fig8_solutions",
    "multiplicity",
    "basins",
    "success",
    "workspace_translation",
    "workspace_orientation",
    "workspace_singularity",
    "workspace_separation",
    "forces",
    "bites",
    "pressure",
];
/// Where guesses are drawn from: within so many degrees of the true angles, and anywhere above the base.
const ORIGINS_OF_GUESSES: usize = 8;
const TABLES: [(&str, &str); 15] = [
    ("fig3_diverging", "solver,iteration,error_cm2,d1_m,"),
    ("fig4_oscillating", "solver,iteration,error_cm2,d1_m,"),
    ("fig3b_stalling", "solver,iteration,error_cm2,d1_m,"),
    ("success", "guesses,solver,trials,reached_true,reached_other,stalled,"),
    ("iterations", "solver,iterations,trials"),
    ("cost", "guesses,solver,solved_by_both,iterations_median,"),
    ("speed", "start,solver,cases,median_ns,p99_ns,"),
    ("fig8_solutions", "theta1_deg,theta2_deg,theta3_deg,above_base,"),
    ("multiplicity", "counted,solutions,inputs"),
    ("basins", "guess1_deg,guess2_deg,guess3_deg,published_reaches,"),
    ("motions", "motion,within_limits,least_slide_margin_m,"),
    ("workspace_x_z", "x_mm,z_mm,condition,determinant,regular_within_deg,separation_deg"),
    ("workspace_y_z", "y_mm,z_mm,condition,"),
    ("workspace_roll_pitch", "roll_deg,pitch_deg,condition,"),
    ("workspace_yaw_pitch", "yaw_deg,pitch_deg,condition,"),
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

/// A figure has data and text, and all of it lies on the page: a coordinate that is no number, or a curve beside the
/// page, fails.
fn check_figure(name: &str, svg: &str) {
    let attributes = |key: &str| {
        let values: Vec<_> = svg.split(&format!(" {key}=\"")).skip(1).collect();
        values.into_iter().map(|rest| rest.split('"').next().unwrap().to_owned()).collect::<Vec<_>>()
    };
    let number = |text: &str| text.parse::<f64>().unwrap_or_else(|_| panic!("{name}: `{text}` is no number"));
    let size = ["width", "height"].map(|key| number(&attributes(key)[0]));
    assert!(svg.starts_with("<svg") && size[0] >= 700.0, "{name}: {size:?}");
    for (key, end) in [("x", size[0]), ("cx", size[0]), ("y", size[1]), ("cy", size[1])] {
        for value in attributes(key) {
            assert!((0.0..=end).contains(&number(&value)), "{name}: {key} = {value} is off the page");
        }
    }
    let points = attributes("points");
    for point in points.iter().flat_map(|points| points.split_whitespace()) {
        let (x, y) = point.split_once(',').unwrap();
        let is_on_page = (0.0..=size[0]).contains(&number(x)) && (0.0..=size[1]).contains(&number(y));
        assert!(is_on_page, "{name}: point {point} is off the page");
    }
    let shapes = svg.matches("<rect").count() + svg.matches("<circle").count() + points.len();
    let texts = svg.matches("<text").count();
    assert!(shapes >= 15 && texts >= 15, "{name}: {shapes} shapes, {texts} texts");
}

#[test]
fn the_folder_holds_every_figure_every_table_and_a_verdict_on_every_claim() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("study");
    let output = study(&folder, &[]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));

    let page = read(&folder, "claims.md");
    for figure in FIGURES {
        check_figure(figure, &read(&folder, &format!("{figure}.svg")));
        assert!(page.contains(&format!("![{figure}]({figure}.svg)")), "{figure} is not on the page");
    }
    for (table, header) in TABLES {
        let text = read(&folder, &format!("{table}.csv"));
        let mut lines = text.lines();
        let columns = lines.next().unwrap();
        assert!(columns.starts_with(header), "{table}: {columns}");
        // The examples of Figs. 3 and 4 need not occur among few guesses.
        assert!(lines.next().is_some() || table.starts_with("fig3") || table.starts_with("fig4"), "{table}");
    }

    let verdicts = ["**holds**", "**holds partly**", "**does not hold**"];
    let claims: Vec<_> = page.lines().filter(|line| line.split('|').count() == 8).skip(2).collect();
    assert_eq!(claims.len(), 18);
    for claim in &claims {
        assert!(verdicts.iter().any(|verdict| claim.contains(verdict)), "{claim}");
        assert!(!claim.contains("NaN"), "{claim}");
    }
    assert_eq!(stdout(&output).lines().count(), claims.len() + 1);
}

/// Whatever this sample gives: these follow from the mechanism.
#[test]
fn what_is_certain_is_found() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("study");
    assert_eq!(study(&folder, &[]).status.code(), Some(0));
    assert_eq!(read(&folder, "fig8_solutions.csv").lines().count(), 1 + 16);
    assert_eq!(read(&folder, "basins.csv").lines().count(), 1 + 6 * 6);
    let page = read(&folder, "claims.md");
    let verdict = |claim: &str| {
        let line = page.lines().find(|line| line.contains(claim)).unwrap();
        line.rsplit('|').nth(1).unwrap().trim().to_owned()
    };
    assert_eq!(verdict("10⁻¹⁰ s on a Pentium"), "**does not hold**");
    assert_eq!(verdict("A₁ has two positions"), "**holds**");
    assert_eq!(verdict("several sets of leg angles"), "**holds**");
    assert_ne!(verdict("whatever the initial guess"), "**holds**");
    let success = read(&folder, "success.csv");
    let controllers: Vec<_> = success.lines().filter(|line| line.contains(",controller,")).collect();
    assert_eq!(controllers.len(), ORIGINS_OF_GUESSES, "{success}");
    for line in controllers {
        assert!(line.contains(",controller,80,80,0,0,0,0,0,"), "{line}");
    }
}

#[test]
fn the_same_seed_gives_the_same_data_and_figures_and_another_seed_others() {
    let place = tempfile::tempdir().unwrap();
    let folders = ["a", "b", "c"].map(|name| place.path().join(name));
    for (folder, seed) in folders.iter().zip(["5", "5", "6"]) {
        assert_eq!(study(folder, &["--seed", seed]).status.code(), Some(0));
    }
    let timed = BTreeSet::from(["speed.csv", "fig5_speed.svg", "claims.md"]);
    let mut compared = 0;
    for entry in fs::read_dir(&folders[0]).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if !timed.contains(name.as_str()) {
            let [a, b] = [0, 1].map(|folder| fs::read(folders[folder].join(&name)).unwrap());
            assert!(a == b, "{name} differs");
            compared += 1;
        }
    }
    assert_eq!(compared, FIGURES.len() + TABLES.len() + 1 - timed.len());
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
    let file = "[motion]\nkind = 'file'\npath = 'other.csv'\naxes = ['+y', '-x', '+z']\n";
    let forward = write("forward.toml", &format!("{file}[jaw]\nclosed_offset_m = [0.012, 0.0, 0.0]"));
    let own_axes = write("own-axes.toml", "[jaw]\nclosed_offset_m = [0.012, 0.0, 0.0]");
    let slow = write("slow.toml", &format!("{file}[limits]\nslide_velocity_m_s = 0.001"));
    let builders = write("builder.toml", "[mechanism]\nplatform_sides_m = [0.06, 0.06, 0.06]");

    let within_limits = |name: &str, scenario: &str| {
        let folder = place.path().join(name);
        let output = study(&folder, &["--trajectory", &recording, "--scenario", scenario]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        assert!(read(&folder, "claims.md").contains(&format!(" --scenario {scenario}")));
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
    assert!(stderr(&output).contains("cannot create"), "{}", stderr(&output));
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
