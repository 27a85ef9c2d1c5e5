//! The report's page as a run leaves it: in a real browser nothing fails, nothing is fetched, everything is there; on a phone
//! it fits. All its times count from the first SYNC, the motion's beginning is known, and the start of the drives is folded.
//! `tests/browser/page.py` uses the page as a hand does.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use masseter_runtime::messages::Event;
use masseter_runtime::messages::codes::{ControllerState, Source};

use crate::common::{Cores, LENIENT, Workspace, skip, stderr};
use masseter_recording::{Reader, Recorded};
use serde_json::Value;

const BROWSERS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];
/// What every report of a run that moved shows.
const ELEMENTS: [&str; 19] = [
    "verdict",
    "checks",
    "scene",
    "jaw",
    "motion-x",
    "motion-y",
    "motion-z",
    "error",
    "angle",
    "slides",
    "legs",
    "velocity-slides",
    "velocity-legs",
    "force-slides",
    "force-legs",
    "percentiles",
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

/// What the page of a run shows, as its scripts read it.
fn data(workspace: &Workspace) -> Value {
    let page = std::fs::read_to_string(workspace.run_folder().join("report.html")).unwrap();
    let (_, from) =
        page.split_once("<script type=\"application/json\" id=\"data\">").expect("the page has data");
    serde_json::from_str(from.split_once("</script>").expect("the data end").0).unwrap()
}

/// The content of a block.
fn block<'a>(page: &'a Value, id: &str) -> &'a Value {
    let sections = page["sections"].as_array().unwrap().iter();
    let mut blocks = sections.flat_map(|section| section["blocks"].as_array().unwrap());
    &blocks.find(|block| block["id"] == id).unwrap_or_else(|| panic!("there is no block {id}"))["data"]
}

/// The packed points of a curve, unpacked as `masseter-page` documents them.
fn points(series: &Value) -> Vec<(f64, f64)> {
    let points = &series["points"];
    let bytes = data_encoding::BASE64.decode(points["packed"].as_str().expect("packed").as_bytes()).unwrap();
    let [x_step, y_step, y_from] = ["x_step", "y_step", "y_from"].map(|name| points[name].as_f64().unwrap());
    let (mut differences, mut number, mut shift) = (Vec::new(), 0_u64, 0);
    for byte in bytes {
        number |= u64::from(byte & 0x7f) << shift;
        shift += 7;
        if byte & 0x80 == 0 {
            differences.push((number >> 1) as i64 ^ -((number & 1) as i64));
            (number, shift) = (0, 0);
        }
    }
    let mut at = [0_i64; 2];
    let point = |pair: &[i64]| {
        at = [at[0] + pair[0], at[1] + pair[1]];
        (at[0] as f64 * x_step, y_from + at[1] as f64 * y_step)
    };
    differences.chunks(2).map(point).collect()
}

/// Where the curves of a chart begin and end, s.
fn curves_s(chart: &Value) -> Vec<[f64; 2]> {
    let ends = |series: &Value| {
        let points = points(series);
        [points[0].0, points[points.len() - 1].0]
    };
    chart["series"].as_array().unwrap().iter().map(ends).collect()
}

#[test]
fn the_page_works_in_a_browser() {
    let Some(browser) = browser() else { return };
    let workspace = Workspace::new("duration_s = 2.0");
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(0));
    let page = workspace.run_folder().join("report.html");
    let output = open(&browser, &page, &workspace.file("profile"));
    let document = String::from_utf8_lossy(&output.stdout);
    assert!(document.contains("data-ready=\"yes\""), "the page is not built: {}", stderr(&output));
    for id in ELEMENTS {
        assert!(document.contains(&format!("id=\"{id}\"")), "{id} is missing: {}", stderr(&output));
    }
    let curves = document.split("<path class=\"curve").filter(|path| path.contains("d=\"M")).count();
    assert!(curves > 30, "{curves} curves are drawn");
    assert!(!stderr(&output).contains("CONSOLE"), "{}", stderr(&output));
    let offline = document.replace("http://www.w3.org/2000/svg", "");
    for outside in ["http://", "https://", "src=", "<link", "@import"] {
        assert!(!offline.contains(outside), "the page refers to {outside}");
    }
}

#[test]
fn after_a_safe_stop_the_charts_go_on_and_show_the_fault_and_its_detection() {
    let workspace = Workspace::new(
        "duration_s = 4.0\n[[faults]]\nkind = 'disconnect'\nbus = 1\nnode = 5\nfrom_s = 2.2\n",
    );
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(5));
    let page = data(&workspace);
    let [fault, stop, reaction, standstill] = &page["moments"].as_array().unwrap()[..] else {
        panic!("{}", page["moments"])
    };
    let kinds = [fault, stop, reaction, standstill].map(|moment| moment["kind"].as_str().unwrap());
    assert_eq!(kinds, ["fault", "detection", "note", "note"]);
    assert_eq!(fault["text"], "fault 1: disconnect (bus 1, node 5)");
    assert!(stop["text"].as_str().unwrap().starts_with("safe stop: master, "), "{stop}");
    let [struck_s, stopped_s] = [fault, stop].map(|moment| moment["at_s"].as_f64().unwrap());
    assert!((struck_s - 2.2).abs() < 0.002 && stopped_s > struck_s, "{fault} {stop}");
    let [reacted_s, stands_s] = [reaction, standstill].map(|moment| moment["at_s"].as_f64().unwrap());
    assert!(stopped_s <= reacted_s && reacted_s <= stands_s && stands_s < stopped_s + 0.1, "{standstill}");
    // The page opens around the stop, with the axis whose process data are lost.
    let window_s = [0, 1].map(|end| page["window"][end].as_f64().unwrap() - stopped_s);
    assert!((window_s[0] + 0.05).abs() < 1e-6 && (window_s[1] - 0.5).abs() < 1e-6, "{window_s:?}");
    let axis = block(&page, "stop-axis");
    assert!(axis["title"].as_str().unwrap().contains("l2"), "{}", axis["title"]);
    let [[.., true_s], [.., reported_s]] = curves_s(axis)[..] else { panic!("{axis}") };
    assert!(true_s > stopped_s + 0.4 && reported_s < stopped_s, "{reported_s}: a lost drive reports nothing");
    let chain = block(&page, "moments")["rows"].as_array().unwrap();
    assert_eq!((chain.len(), &chain[0][2], &chain[0][4]), (4, &"0.0".into(), &"0.000".into()), "{chain:?}");
    let first = &block(&page, "checks")["rows"][0];
    assert_eq!((&first[0], &first[1]["mark"]), (&"sequence".into(), &"FAIL".into()), "{first}");
    // The jaw is followed for as long as the axes are.
    let [jaw, legs] = ["motion-z", "legs"].map(|id| curves_s(block(&page, id)));
    assert!((jaw[1][1] - legs[0][1]).abs() < 0.01, "{jaw:?} and {legs:?}");
    assert!(jaw[0][1] < jaw[1][1], "the desired motion ends with the stop");
}

/// When the motion began, by the page, s since the first SYNC.
fn motion_s(page: &Value) -> f64 {
    page["time"]["motion_s"].as_f64().expect("the motion began")
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
            for message in entry.messages().unwrap() {
                match message {
                    Recorded::Reading(reading) => zero_ns = zero_ns.min(reading.due_ns),
                    Recorded::Truth(truth) => end_ns = end_ns.max(truth.sampled_ns),
                    Recorded::Event(event) => events.push(event),
                    _ => {}
                }
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

/// Steps of decimation, and the time that a smoothed value and a load stand for, s.
const CLOSE_S: f64 = 0.05;

/// Judges every chart over time: curves of what is there from the first cycle on begin at zero and end with the recording.
fn assert_one_zero(workspace: &Workspace, charts: &[&str]) {
    let times = Times::of(workspace);
    let page = data(workspace);
    let running_s = times.entered_s(ControllerState::Running);
    assert!((motion_s(&page) - running_s).abs() < 0.002, "{} instead of {running_s}", motion_s(&page));
    for id in charts {
        let curves = curves_s(block(&page, id));
        assert!(!curves.is_empty(), "{id}");
        for [from_s, to_s] in curves {
            // The path begins with the first move, and the estimate with the first readings.
            let states = [ControllerState::Easing, ControllerState::Enabling];
            let mut begins_s = states.map(|state| times.entered_s(state)).into_iter().chain([0.0]);
            let is_begin = begins_s.any(|begin_s| (from_s - begin_s).abs() < CLOSE_S);
            assert!(is_begin, "{id}: a curve begins at {from_s} s");
            assert!(to_s < times.end_s + CLOSE_S, "{id}: a curve ends at {to_s} s, after {} s", times.end_s);
        }
    }
    for id in ["slides", "legs", "velocity-legs", "force-legs"] {
        for [from_s, to_s] in curves_s(block(&page, id)) {
            assert!(
                from_s.abs() < CLOSE_S && (to_s - times.end_s).abs() < CLOSE_S,
                "{id}: {from_s} to {to_s} s"
            );
        }
    }
}

const OVER_TIME: [&str; 7] = ["motion-x", "motion-z", "error", "slides", "legs", "force-slides", "buses"];

#[test]
fn every_chart_over_time_has_the_zero_of_the_recording() {
    let workspace = Workspace::new("duration_s = 1.0");
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(0));
    assert_one_zero(&workspace, &OVER_TIME);
    assert!(data(&workspace)["time"]["wall_s"].is_null(), "simulated time has no date");
    // In real time the recorder may begin later.
    let times = Times::of(&workspace);
    let later_ns = times.first_ns - times.zero_ns;
    assert!(later_ns < 1_000_000, "the first message was recorded {later_ns} ns after the charts' zero");

    let workspace = Workspace::new(&format!("duration_s = 1.0\n{LENIENT}"));
    let before_s = masseter_runtime::clock::wall_time().as_secs_f64();
    let output = workspace.run(&Cores::take(), &[]);
    let after_s = masseter_runtime::clock::wall_time().as_secs_f64();
    assert!(workspace.run_folder().join("report.html").exists(), "{}", stderr(&output));
    // Only in real time are there late wake-ups.
    assert_one_zero(&workspace, &[&OVER_TIME[..], &["jitter"]].concat());
    let wall_s = data(&workspace)["time"]["wall_s"].as_f64().expect("a date");
    assert!((before_s..after_s).contains(&wall_s), "{wall_s} is not between {before_s} and {after_s}");
}

#[test]
fn the_start_of_the_drives_is_folded_and_every_event_is_there_with_its_time() {
    let workspace = Workspace::new("duration_s = 0.5");
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(0));
    let times = Times::of(&workspace);
    let page = data(&workspace);
    let listed_s = |part: &str| -> Vec<f64> {
        let events = block(&page, "events")[part].as_array().unwrap();
        events.iter().map(|event| event["at_s"].as_f64().unwrap()).collect()
    };
    let moves_s = times.entered_s(ControllerState::Easing);
    let (start_s, rest_s) = (listed_s("start"), listed_s("rest"));
    assert!(start_s.len() > 20 && rest_s.len() > 2, "{start_s:?} and {rest_s:?}");
    assert!(start_s.iter().all(|at_s| *at_s <= moves_s + 0.001), "{start_s:?}");
    assert!(rest_s.iter().all(|at_s| *at_s >= moves_s - 0.001), "{rest_s:?}");
    assert_eq!(start_s.len() + rest_s.len(), times.events.len());
    for (listed_s, event) in start_s.iter().chain(&rest_s).zip(&times.events) {
        let came_s = times.since_s(event);
        assert!((listed_s - came_s).abs() < 0.002, "{listed_s} s instead of {came_s} s");
    }
}
