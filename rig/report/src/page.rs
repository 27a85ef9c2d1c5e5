//! `report.html`: one page that needs no network.
//!
//! The template `templates/report.html` holds the markup and formats single numbers. This module draws the plots.

use askama::Template;
use masseter_analysis::requirements::RequirementFigures;
use masseter_analysis::{EventRecord, Figures, Track};
use masseter_charts::Drawn;
use masseter_recording::Manifest;
use masseter_shared::config::{MotionConfig, Scenario};
use masseter_shared::messages::codes::ControllerState;
use masseter_shared::wording::counted;

use crate::pressure::Pressure;
use crate::text::{microseconds, or_dash, significant};
use crate::verdict::Verdict;
use crate::{animation, charts, time_line};

#[derive(Template)]
#[template(path = "report.html")]
struct Page<'a> {
    manifest: &'a Manifest,
    figures: &'a Figures,
    verdict: &'a Verdict,
    animation: Option<String>,
    motions: [(&'static str, Option<Drawn>); 2],
    pressure: Option<Pressure>,
    actuators: [(&'static str, Option<Drawn>); 4],
    signals: Vec<(String, Option<Drawn>)>,
    requirements: Vec<(String, Option<Drawn>)>,
    percentiles: Option<Drawn>,
    jitter: Option<Drawn>,
    bus_load: Option<Drawn>,
    time_line: Option<String>,
}

/// The page.
pub(crate) fn html(manifest: &Manifest, figures: &Figures, verdict: &Verdict) -> askama::Result<String> {
    let scenario = &manifest.scenario;
    let page = Page {
        manifest,
        figures,
        verdict,
        animation: animation::json(scenario, figures),
        motions: charts::motion(scenario, figures),
        pressure: Pressure::draw(figures),
        actuators: charts::actuators(scenario, figures),
        signals: charts::signals(scenario, figures),
        requirements: requirements(scenario, figures),
        percentiles: charts::percentiles(scenario, figures),
        jitter: charts::jitter(scenario, figures),
        bus_load: charts::bus_load(scenario, figures),
        time_line: time_line::svg(figures),
    };
    page.render()
}

/// The plots of the requirements that have one.
fn requirements(scenario: &Scenario, figures: &Figures) -> Vec<(String, Option<Drawn>)> {
    let of = |requirement: &RequirementFigures| {
        let drawn = charts::requirement(scenario, figures, requirement);
        requirement.plot.as_ref().map(|_| (requirement.name.clone(), drawn))
    };
    figures.requirements.iter().filter_map(of).collect()
}

/// Numbers one after the other.
fn values(values: &[f64]) -> String {
    values.iter().map(|value| significant(*value)).collect::<Vec<_>>().join(", ")
}

/// The events until the controller first moves the jaw, and those from then on.
fn phases(events: &[EventRecord]) -> (&[EventRecord], &[EventRecord]) {
    let moves = |event: &EventRecord| {
        event.transition.as_ref().is_some_and(|[_, to]| to == ControllerState::Easing.name())
    };
    events.split_at(events.iter().position(moves).unwrap_or(0))
}

fn events_in_words(events: &[EventRecord]) -> String {
    counted(events.len() as u64, "event")
}

/// When an event came, on the time of the charts.
fn seconds(figures: &Figures, event: &EventRecord) -> String {
    format!("{:.3} s", in_unit(event.time_ns.saturating_sub(figures.over_time.began_ns), 1e9))
}

/// The part of the motion that the animation shows, if it does not show all.
fn extent(track: &Track) -> String {
    let (Some(first), Some(last)) = (track.samples.first(), track.samples.last()) else {
        return String::new();
    };
    let shown_s = last.sampled_ns.saturating_sub(first.sampled_ns) as f64 / 1e9;
    // The last sample of a complete animation may lie some cycles before the end.
    if track.duration_s - shown_s < 0.1 {
        return String::new();
    }
    format!("The first {shown_s:.1} s of {:.1} s. ", track.duration_s)
}

fn us(ns: Option<u64>) -> String {
    or_dash(ns, microseconds)
}

fn value(value: Option<f64>) -> String {
    or_dash(value, |value| format!("{value:.6}").trim_end_matches('0').trim_end_matches('.').to_owned())
}

fn count(count: Option<u64>) -> String {
    or_dash(count, |count| count.to_string())
}

/// Nanoseconds in another unit.
fn in_unit(ns: u64, unit_ns: f64) -> f64 {
    ns as f64 / unit_ns
}

#[cfg(test)]
mod tests {
    use masseter_analysis::{Analysis, TrackingSample};
    use masseter_recording::MachineInfo;
    use masseter_shared::config::Scenario;
    use masseter_shared::geometry::Pose;
    use masseter_shared::named::Declared;

    use super::*;

    /// The page of a run on these interfaces, with a motion of one sample.
    fn page(interfaces: &[&str]) -> String {
        let mut scenario = Scenario::default();
        scenario.can.interfaces = interfaces.iter().map(|name| (*name).to_owned()).collect();
        let mut figures = Analysis::new(&scenario, &Declared::default()).finish(false, &[]);
        let still = Pose::identity();
        figures.track.samples =
            vec![TrackingSample { sampled_ns: 0, desired: still, estimated: still, actual: still }];
        scenario.name = "a <b>".to_owned();
        let machine = MachineInfo { cpu: String::new(), cores: 2, kernel: String::new(), is_virtual: false };
        let manifest = Manifest::new(scenario, 1.0, "rt", machine);
        html(&manifest, &figures, &Verdict::new(&manifest, &figures)).unwrap()
    }

    #[test]
    fn without_truth_nothing_is_called_true() {
        let (emulated, robot) = (page(&[]), page(&["can0", "can1"]));
        assert!(emulated.contains(">true</span>, <span") && emulated.contains("Platform, true against"));
        assert!(!robot.contains(">true<") && robot.contains(">estimated</span>, <span"));
        assert!(robot.contains("Platform, estimated against"));
    }

    #[test]
    fn names_in_the_page_are_escaped() {
        assert!(!page(&[]).contains("a <b>"));
    }
}
