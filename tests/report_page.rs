//! The report's page in a real browser: nothing fails, nothing is fetched, everything is there.

mod common;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use common::{Workspace, skip, stderr};

const BROWSERS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];
/// What every report of a run that moved shows.
const ELEMENTS: [&str; 15] = [
    "verdict",
    "checks",
    "mechanism",
    "animation",
    "motion",
    "error",
    "slides",
    "legs",
    "velocities",
    "forces",
    "percentiles",
    "jitter",
    "worst",
    "buses",
    "events",
];

fn browser() -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let found = std::env::split_paths(&path)
        .flat_map(|folder| BROWSERS.map(|name| folder.join(name)))
        .find(|candidate| candidate.is_file());
    if found.is_none() {
        skip(&format!("no browser among {BROWSERS:?}"));
    }
    found
}

/// Loads the page with its scripts running, and writes the document as it is then to standard output.
fn open(browser: &Path, page: &Path, profile: &Path) -> Output {
    Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr"])
        .args(["--virtual-time-budget=2000", "--dump-dom"])
        .arg(format!("--user-data-dir={}", profile.display()))
        .arg(format!("file://{}", page.display()))
        .output()
        .expect("the browser starts")
}

/// The time that the animation shows in a document, s.
fn clock_s(output: &Output) -> Option<f64> {
    let document = String::from_utf8_lossy(&output.stdout);
    document.split("id=\"clock\">").nth(1)?.split(' ').next()?.parse().ok()
}

#[test]
fn the_page_works_in_a_browser() {
    let Some(browser) = browser() else { return };
    let workspace = Workspace::new("duration_s = 2.0");
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(0));
    let page = workspace.run_folder().join("report.html");
    // The animation plays: its clock has left the beginning. A browser beside much other work may draw no frame.
    let mut openings = (0..5).map(|_| open(&browser, &page, &workspace.file("profile")));
    let output = openings.find(|output| clock_s(output) > Some(0.0)).expect("the animation plays");
    let document = String::from_utf8_lossy(&output.stdout);
    for id in ELEMENTS {
        assert!(document.contains(&format!("id=\"{id}\"")), "{id} is missing: {}", stderr(&output));
    }
    assert!(!stderr(&output).contains("CONSOLE"), "{}", stderr(&output));
    let offline = document.replace("http://www.w3.org/2000/svg", "");
    for outside in ["http://", "https://", "src=", "<link", "@import"] {
        assert!(!offline.contains(outside), "the page refers to {outside}");
    }
}

/// The drawing of a part of the page.
fn drawing<'a>(page: &'a str, id: &str) -> &'a str {
    let (_, from) = page.split_once(&format!("<div id=\"{id}\">")).expect("the part is there");
    from.split_once("</svg>").expect("it is a drawing").0
}

/// The right end of the thin lines of a drawing, px.
fn last_x(drawing: &str) -> f64 {
    let lines = drawing.split("<polyline").skip(1).filter(|line| line.contains("stroke-width=\"2\""));
    let points = lines.filter_map(|line| line.split("points=\"").nth(1)?.split('"').next());
    points
        .flat_map(str::split_whitespace)
        .filter_map(|point| point.split(',').next()?.parse().ok())
        .fold(0.0, f64::max)
}

#[test]
fn after_a_safe_stop_the_charts_go_on_and_show_the_fault_and_its_detection() {
    let workspace = Workspace::new(
        "duration_s = 4.0\n[[faults]]\nkind = 'disconnect'\nbus = 1\nnode = 5\nfrom_s = 2.2\n",
    );
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(5));
    let page = std::fs::read_to_string(workspace.run_folder().join("report.html")).unwrap();
    for id in ["motion", "error", "slides", "legs", "velocities", "forces", "buses"] {
        let drawing = drawing(&page, id);
        assert!(drawing.contains("fault 1: disconnect (bus 1, node 5), 2.2"), "{id}");
        assert!(drawing.contains("safe stop: master, "), "{id}");
    }
    // The jaw is followed for as long as the axes are.
    let [motion, legs] = ["motion", "legs"].map(|id| last_x(drawing(&page, id)));
    assert!(motion > 0.0 && (motion - legs).abs() < 2.0, "{motion} and {legs}");
}
