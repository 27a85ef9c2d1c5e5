//! The report's page as a run leaves it: in a real browser nothing fails, nothing is fetched, everything is there; on a phone
//! it fits. Its charts have the time of the recording, and the start of the drives is folded.

mod common;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use common::{Cores, LENIENT, Workspace, skip, stderr};
use masseter_recording::{Reader, Recorded};
use masseter_shared::messages::Event;
use masseter_shared::messages::codes::{ControllerState, Source};

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

/// Width of a phone's screen, px.
const PHONE: f64 = 390.0;

#[test]
fn on_a_phone_the_page_is_as_wide_as_the_screen() {
    let workspace = Workspace::new("duration_s = 0.5");
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(0));
    let page = std::fs::read_to_string(workspace.run_folder().join("report.html")).unwrap();
    // Without it a phone draws the page for a desk, and makes it smaller.
    let viewport = page.split("<meta ").find(|tag| tag.starts_with("name=\"viewport\"")).expect("a viewport");
    let content = viewport.split("content=\"").nth(1).unwrap().split('"').next().unwrap();
    let settings: Vec<_> = content.split(',').map(str::trim).collect();
    assert!(settings.contains(&"width=device-width") && settings.contains(&"initial-scale=1"), "{content}");

    let Some(browser) = browser() else { return };
    let text = page.replace('&', "&amp;").replace('"', "&quot;");
    let framed = format!(
        "<!doctype html><title></title><iframe id=phone style='width:{PHONE}px;height:800px;border:0' \
         srcdoc=\"{text}\"></iframe><script>onload = () => \
         document.title = phone.contentDocument.documentElement.scrollWidth</script>"
    );
    let probe = workspace.write("probe.html", &framed);
    let output = open(&browser, &probe, &workspace.file("profile"));
    let document = String::from_utf8_lossy(&output.stdout);
    let title = document.split("<title>").nth(1).and_then(|title| title.split('<').next());
    let width: f64 = title.and_then(|width| width.parse().ok()).expect("the page was measured");
    assert!(width > 100.0 && width <= PHONE, "the page is {width} px wide on a screen of {PHONE} px");
}

/// What the recording of a run says about time.
struct Times {
    /// Deadline of the first cycle, ns.
    zero_ns: u64,
    /// When the first message was recorded, ns.
    first_ns: u64,
    /// The last true position, s.
    end_s: f64,
    events: Vec<Event>,
}

impl Times {
    fn of(workspace: &Workspace) -> Self {
        let mut reader = Reader::open(&workspace.run_folder().join("recording.mcap")).unwrap();
        let (mut zero_ns, mut first_ns, mut end_ns, mut events) = (u64::MAX, u64::MAX, 0, Vec::new());
        while let Some(entry) = reader.next_entry().unwrap() {
            first_ns = first_ns.min(entry.header.log_time);
            match entry.recorded() {
                Some(Ok(Recorded::Reading(reading))) => zero_ns = zero_ns.min(reading.due_ns),
                Some(Ok(Recorded::Truth(truth))) => end_ns = end_ns.max(truth.sampled_ns),
                Some(Ok(Recorded::Event(event))) => events.push(event),
                _ => {}
            }
        }
        Self { zero_ns, first_ns, end_s: (end_ns - zero_ns) as f64 / 1e9, events }
    }

    fn since_s(&self, event: &Event) -> f64 {
        (event.time_ns as f64 - self.zero_ns as f64) / 1e9
    }

    /// When the controller first entered this state, s.
    fn entered_s(&self, state: ControllerState) -> f64 {
        let enters = |event: &&Event| {
            event.source == Source::Controller as u32 && event.from != event.to && event.to == state as u32
        };
        self.since_s(self.events.iter().find(enters).expect("the controller entered the state"))
    }
}

/// The values of an attribute in every element of that name, in a drawing.
fn attribute<'a>(drawing: &'a str, element: &str, name: &str) -> Vec<&'a str> {
    let (opening, assignment) = (format!("<{element}"), format!(" {name}=\""));
    let elements = drawing.split(opening.as_str()).skip(1);
    elements.filter_map(|rest| rest.split('>').next()?.split(&assignment).nth(1)?.split('"').next()).collect()
}

/// A time axis: the place of time zero, px, and of a second, px/s. By the numbers below the axis.
fn time_axis(drawing: &str) -> (f64, f64) {
    let below = drawing.split("<text ").skip(1).filter(|text| text.contains("dy=\"0.76em\""));
    let ticks: Vec<(f64, f64)> = below
        .filter_map(|text| {
            let x = text.strip_prefix("x=\"")?.split('"').next()?.parse().ok()?;
            let label = text.split('>').nth(1)?.split('<').next()?;
            Some((x, label.trim().parse().ok()?))
        })
        .collect();
    let [(first, from_s), .., (last, to_s)] = ticks[..] else { panic!("no time axis: {ticks:?}") };
    let second = (last - first) / (to_s - from_s);
    (first - from_s * second, second)
}

/// Where the curves of a chart begin and end, s. Curves are wider than axes.
fn curves_s(drawing: &str) -> Vec<[f64; 2]> {
    let (zero, second) = time_axis(drawing);
    let lines = drawing.split("<polyline").skip(1).filter(|line| !line.contains("stroke-width=\"1\""));
    let at = |point: &str| (point.split(',').next().unwrap().parse::<f64>().unwrap() - zero) / second;
    let ends = lines.filter_map(|line| {
        let points: Vec<_> = line.split("points=\"").nth(1)?.split('"').next()?.split_whitespace().collect();
        // The keys of the legend have two points.
        let [first, _, .., last] = points[..] else { return None };
        Some([at(first), at(last)])
    });
    ends.collect()
}

/// Steps of decimation and of the drawing, and the time of a chunk of bus load, s.
const CLOSE_S: f64 = 0.05;

/// Judges every chart over time: curves of what is there from the first cycle on begin at zero and end with the recording.
fn assert_one_zero(workspace: &Workspace, charts: &[&str]) {
    let times = Times::of(workspace);
    let page = std::fs::read_to_string(workspace.run_folder().join("report.html")).unwrap();
    for id in charts {
        let curves = curves_s(drawing(&page, id));
        assert!(!curves.is_empty(), "{id}");
        for [from_s, to_s] in curves {
            // The path begins with the first move.
            let begins_s = [0.0, times.entered_s(ControllerState::Easing)];
            let is_begin = begins_s.iter().any(|begin_s| (from_s - begin_s).abs() < CLOSE_S);
            assert!(is_begin, "{id}: a curve begins at {from_s} s, not at any of {begins_s:?}");
            assert!(to_s < times.end_s + CLOSE_S, "{id}: a curve ends at {to_s} s, after {} s", times.end_s);
        }
    }
    for id in ["slides", "legs", "velocities", "forces"] {
        for [from_s, to_s] in curves_s(drawing(&page, id)) {
            assert!(
                from_s.abs() < CLOSE_S && (to_s - times.end_s).abs() < CLOSE_S,
                "{id}: {from_s} to {to_s} s"
            );
        }
    }
    let time_line = drawing(&page, "events");
    let (zero, second) = time_axis(time_line);
    let mut marks: Vec<f64> =
        attribute(time_line, "circle", "cx").iter().map(|x| x.parse().unwrap()).collect();
    let mut expected: Vec<f64> =
        times.events.iter().map(|event| zero + times.since_s(event) * second).collect();
    marks.sort_by(f64::total_cmp);
    expected.sort_by(f64::total_cmp);
    assert_eq!(marks.len(), expected.len());
    for (mark, expected) in marks.iter().zip(expected) {
        assert!((mark - expected).abs() < 2.0, "an event is drawn at {mark} px, and came at {expected} px");
    }
}

const OVER_TIME: [&str; 7] = ["motion", "error", "slides", "legs", "velocities", "forces", "buses"];

#[test]
fn every_chart_over_time_has_the_zero_of_the_recording() {
    let workspace = Workspace::new("duration_s = 1.0");
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(0));
    assert_one_zero(&workspace, &OVER_TIME);
    // In real time the recorder may begin later.
    let times = Times::of(&workspace);
    let later_ns = times.first_ns - times.zero_ns;
    assert!(later_ns < 1_000_000, "the first message was recorded {later_ns} ns after the charts' zero");

    let workspace = Workspace::new(&format!("duration_s = 1.0\n{LENIENT}"));
    let output = workspace.run(&Cores::take(), &[]);
    assert!(workspace.run_folder().join("report.html").exists(), "{}", stderr(&output));
    // Only in real time are there late wake-ups.
    assert_one_zero(&workspace, &[&OVER_TIME[..], &["jitter"]].concat());
}

#[test]
fn the_start_of_the_drives_is_folded_and_every_event_is_there_with_its_time() {
    let workspace = Workspace::new("duration_s = 0.5");
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(0));
    let times = Times::of(&workspace);
    let page = std::fs::read_to_string(workspace.run_folder().join("report.html")).unwrap();
    let (_, list) = page.split_once("<div id=\"events\">").unwrap();
    let (folded, shown) = list.split_once("</details>").expect("a part that is folded");
    let (_, folded) = folded.split_once("<details>").expect("it is folded at first");
    let listed_s = |text: &str| -> Vec<f64> {
        let items = text.split("<li>").skip(1).map(|item| item.split(" s ").next().unwrap());
        items.map(|seconds| seconds.parse().unwrap()).collect()
    };
    let moves_s = times.entered_s(ControllerState::Easing);
    let (boot_s, rest_s) = (listed_s(folded), listed_s(shown));
    assert!(boot_s.len() > 20 && rest_s.len() > 2, "{boot_s:?} and {rest_s:?}");
    assert!(boot_s.iter().all(|at_s| *at_s <= moves_s + 0.001), "{boot_s:?}");
    assert!(rest_s.iter().all(|at_s| *at_s >= moves_s - 0.001), "{rest_s:?}");
    assert_eq!(boot_s.len() + rest_s.len(), times.events.len());
    for (listed_s, event) in boot_s.iter().chain(&rest_s).zip(&times.events) {
        let came_s = times.since_s(event);
        assert!((listed_s - came_s).abs() < 0.002, "{listed_s} s instead of {came_s} s");
    }
}
