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

#[test]
fn the_page_works_in_a_browser() {
    let Some(browser) = browser() else { return };
    let workspace = Workspace::new("duration_s = 2.0");
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(0));
    let page = workspace.run_folder().join("report.html");
    let output = open(&browser, &page, &workspace.file("profile"));
    let document = String::from_utf8_lossy(&output.stdout);
    for id in ELEMENTS {
        assert!(document.contains(&format!("id=\"{id}\"")), "{id} is missing: {}", stderr(&output));
    }
    // The animation plays: its clock has left the beginning.
    let clock = document.split("id=\"clock\">").nth(1).and_then(|rest| rest.split(' ').next()).unwrap();
    assert!(clock.parse::<f64>().unwrap() > 0.0, "{clock}");
    assert!(!stderr(&output).contains("CONSOLE"), "{}", stderr(&output));
    let offline = document.replace("http://www.w3.org/2000/svg", "");
    for outside in ["http://", "https://", "src=", "<link", "@import"] {
        assert!(!offline.contains(outside), "the page refers to {outside}");
    }
}
