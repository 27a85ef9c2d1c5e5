//! `masseter compare` finds known differences between made-up sessions, with intervals that cover them.

use std::fs;
use std::process::Command;

use crate::common::{MASSETER, Workspace};

/// Person, and opening before and after, mm.
const PERSONS: [(&str, [f64; 2]); 3] = [("P1", [18.0, 15.0]), ("P2", [20.0, 17.5]), ("P3", [16.0, 12.5])];

/// A row of a table.
struct Row<'a>(Vec<(&'a str, &'a str)>);

impl Row<'_> {
    fn cell(&self, name: &str) -> &str {
        self.0.iter().find(|(column, _)| *column == name).unwrap().1
    }
}

/// The rows of a table whose cells have no commas.
fn rows(text: &str) -> impl Iterator<Item = Row<'_>> {
    let (head, rows) = text.split_once('\n').unwrap();
    rows.lines().map(move |row| Row(head.split(',').zip(row.split(',')).collect()))
}

#[test]
fn known_differences_between_six_sessions_are_found_and_covered() {
    let workspace = Workspace::new("name = 'a-name-that-is-nobodys'\nduration_s = 5.0");
    let run = |words: &[&str]| {
        let output = Command::new(MASSETER).args(words).current_dir(workspace.file("")).output().unwrap();
        assert!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let mut runs = Vec::new();
    for (person, openings) in PERSONS {
        for (session, opening_mm) in ["before", "after"].into_iter().zip(openings) {
            let out = format!("{person}-{session}");
            let set = [
                format!("study.patient={person}"),
                format!("study.session={session}"),
                format!("motion.vertical_mm={opening_mm}"),
            ];
            let set: Vec<_> = set.iter().flat_map(|set| ["--set", set.as_str()]).collect();
            let words = ["run", "scenario.toml", "--clock", "virtual", "--quiet", "--out", &out];
            run(&[&words[..], &set].concat());
            runs.push(out);
        }
    }
    let runs: Vec<_> = runs.iter().map(String::as_str).collect();
    let log = workspace.file("P1-before").join("can0.log");
    fs::remove_file(&log).unwrap();
    let said = run(&[&["compare", "--out", "study"][..], &runs].concat());
    assert!(!log.exists(), "a comparison writes nothing into the folders of runs");
    assert!(said.contains("before to after") && said.contains("opening, mm"), "{said}");

    run(&[&["compare", "--set", "study.leave_out=[1]", "--out", "chosen"][..], &runs].concat());
    let chosen = fs::read_to_string(workspace.file("chosen").join("cycles.csv")).unwrap();
    let by_hand = rows(&chosen).filter(|row| row.cell("left_out") == "by_hand");
    assert_eq!(by_hand.map(|row| row.cell("cycle").to_owned()).collect::<Vec<_>>(), ["1"; 6]);

    let read = |name: &str| fs::read_to_string(workspace.file("study").join(name)).unwrap();
    let differences = read("differences.csv");
    let found = |quantity: &str| -> Vec<f64> {
        let row = rows(&differences).find(|row| row.cell("quantity") == quantity).unwrap();
        assert_eq!(
            (row.cell("group"), row.cell("from"), row.cell("to"), row.cell("n")),
            ("chew left", "before", "after", "3")
        );
        ["mean", "mean_low", "mean_high"].map(|column| row.cell(column).parse().unwrap()).to_vec()
    };
    let [mean, low, high] = found("opening_mm")[..] else { unreachable!() };
    assert!((mean + 3.0).abs() < 0.05, "{mean}");
    // 4.303 · 0.5 / √3 on both sides of −3 mm.
    assert!((low + 4.24).abs() < 0.1 && (high + 1.76).abs() < 0.1, "{low} to {high}");
    let [_, low, high] = found("lateral_mm")[..] else { unreachable!() };
    assert!((low..=high).contains(&0.0) || high - low < 0.1, "the width did not change: {low} to {high}");

    let cycles = read("cycles.csv");
    let counted = rows(&cycles).filter(|row| row.cell("left_out").is_empty()).count();
    assert!(counted >= 6 * 3, "{counted}");
    for name in ["cycles.csv", "means.csv", "courses.csv", "differences.csv", "compare.html", "caption.txt"] {
        assert!(!read(name).contains("a-name-that-is-nobodys"), "{name}");
    }
    assert!(read("caption.txt").contains("n = before: 3 persons, 3 recordings"), "{}", read("caption.txt"));
    for name in
        ["cycles-chew-left-85mm.svg", "cycles-chew-left-170mm.svg", "paths-85mm.svg", "paths-170mm.svg"]
    {
        assert!(read(name).starts_with("<svg"), "{name}");
    }

    let recording = workspace.file("P1-before").join("recording.mcap");
    let bytes = fs::read(&recording).unwrap();
    fs::write(&recording, &bytes[..bytes.len() / 2]).unwrap();
    let words = [&["compare", "--out", "cut"][..], &runs].concat();
    let output = Command::new(MASSETER).args(words).current_dir(workspace.file("")).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.code() == Some(2) && said.contains("P1-before: ") && said.contains("leave the run out"),
        "{said}"
    );
}
