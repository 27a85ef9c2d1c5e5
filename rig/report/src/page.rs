//! `report.html`: one page that needs no network.
//!
//! The markup is the template `templates/report.html`. This module computes the texts and plots in it.

use askama::Template;
use masseter_analysis::{Figures, IntervalFigures, PoseSource, ResponseFigures, Track, WorstCycle};
use masseter_charts::Drawn;
use masseter_recording::Manifest;
use masseter_shared::config::MotionConfig;

use crate::outcome::Outcome;
use crate::text::{event_with_cycle, microseconds, or_dash};
use crate::verdict::Verdict;
use crate::{animation, charts, table, time_line, usage};

#[derive(Template)]
#[template(path = "report.html")]
struct Page<'a> {
    manifest: &'a Manifest,
    figures: &'a Figures,
    verdict: &'a Verdict,
    is_passed: bool,
    animation: Option<String>,
    source: PoseSource,
    extent: String,
    distances: String,
    estimate_rms_mm: Option<String>,
    bite_force_max_n: Option<String>,
    motions: [Plot; 2],
    actuators: [Plot; 4],
    latencies: Vec<[String; 6]>,
    controller_stalled_ms: String,
    plant_stalled_ms: String,
    readings: String,
    percentiles: Plot,
    jitter: Plot,
    worst_cycles: Vec<[String; 10]>,
    buses: Plot,
    responses: Vec<(&'a ResponseFigures, [String; 2])>,
    time_line: String,
    events: Vec<String>,
    began: &'a str,
    recording_played: Option<String>,
    usage: Vec<[String; 6]>,
    stolen_s: String,
}

/// A plot under an id, or the reason why there is none.
struct Plot {
    id: &'static str,
    drawn: Option<Drawn>,
    otherwise: &'static str,
}

impl Plot {
    /// The limits that did not fit into the plot.
    fn limits_beyond(&self) -> String {
        let beyond = self.drawn.iter().flat_map(|drawn| &drawn.beyond);
        let limits: Vec<_> = beyond.map(|limit| format!("{} {:.0?}", limit.name, limit.values)).collect();
        limits.join(", ")
    }
}

/// The page.
pub(crate) fn html(manifest: &Manifest, figures: &Figures, verdict: &Verdict) -> askama::Result<String> {
    let scenario = &manifest.scenario;
    let plot = |id, drawn, otherwise| Plot { id, drawn, otherwise };
    let [displacement, error] = charts::motion(figures);
    let [slides, legs, velocities, forces] = charts::actuators(scenario, figures)
        .map(|drawn| move |id| plot(id, drawn, "The recording holds no truth."));
    let stalled_ms = |ns: u64| format!("{:.2}", ns as f64 / 1e6);
    let page = Page {
        manifest,
        figures,
        verdict,
        is_passed: verdict.outcome == Outcome::Pass,
        animation: animation::json(scenario, figures),
        source: figures.tracking.actual_source,
        extent: extent(&figures.track),
        distances: table::distances(&figures.tracking),
        estimate_rms_mm: figures.tracking.estimate_rms_mm.map(|rms_mm| format!("{rms_mm:.4}")),
        bite_force_max_n: figures.bite_force_max_n.map(|most_n| format!("{most_n:.1}")),
        motions: [plot("motion", displacement, "Nothing moved."), plot("error", error, "Nothing moved.")],
        actuators: [slides("slides"), legs("legs"), velocities("velocities"), forces("forces")],
        latencies: latencies(figures),
        controller_stalled_ms: stalled_ms(figures.controller_skips.stalled_ns),
        plant_stalled_ms: stalled_ms(figures.plant_skips.stalled_ns),
        readings: table::readings(&figures.readings),
        percentiles: plot("percentiles", charts::percentiles(scenario, figures), "No interval was measured."),
        jitter: plot("jitter", charts::jitter(figures), "Under virtual time nobody is late."),
        worst_cycles: worst_cycles(figures),
        buses: plot("buses", charts::bus_load(figures), "No frame was recorded."),
        responses: responses(figures),
        time_line: time_line::svg(figures).unwrap_or_else(|| "Nothing happened.".to_owned()),
        events: figures.events.iter().map(event_with_cycle).collect(),
        began: manifest.began.trim_end_matches('Z'),
        recording_played: match &scenario.motion {
            MotionConfig::File(file) => Some(file.path.display().to_string()),
            _ => None,
        },
        usage: usage::rows(&manifest.usage),
        stolen_s: format!("{:.2}", manifest.usage.stolen_s),
    };
    page.render()
}

impl Page<'_> {
    fn style(&self) -> &'static str {
        include_str!("../templates/style.css")
    }

    fn mechanism_program(&self) -> &'static str {
        include_str!("../templates/mechanism.js")
    }
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

fn latencies(figures: &Figures) -> Vec<[String; 6]> {
    let row = |interval: &IntervalFigures| {
        let [p50, p99, p999, max] = [interval.p50_ns, interval.p99_ns, interval.p999_ns, interval.max_ns]
            .map(|ns| or_dash(ns, microseconds));
        [interval.name.to_owned(), interval.n.to_string(), p50, p99, p999, max]
    };
    figures.intervals.iter().map(row).collect()
}

fn worst_cycles(figures: &Figures) -> Vec<[String; 10]> {
    let count = |count: Option<u64>| or_dash(count, |count| count.to_string());
    let began_ns = figures.over_time.began_ns;
    let row = |worst: &WorstCycle| {
        [
            worst.cycle.to_string(),
            format!("{:.3}", worst.due_ns.saturating_sub(began_ns) as f64 / 1e9),
            microseconds(worst.total_ns),
            worst.hop.name().to_owned(),
            microseconds(worst.hop_ns),
            microseconds(worst.hop_p50_ns),
            microseconds(worst.stalled_ns),
            or_dash(worst.around.stolen_ns, microseconds),
            count(worst.around.involuntary_switches),
            count(worst.around.page_faults),
        ]
    };
    figures.worst_cycles.iter().map(row).collect()
}

/// Each message with its longest response time and its bound.
fn responses(figures: &Figures) -> Vec<(&ResponseFigures, [String; 2])> {
    let messages = figures.bus_response.messages.iter();
    messages
        .map(|message| (message, [message.max_ns, message.bound_ns].map(|ns| or_dash(ns, microseconds))))
        .collect()
}

#[cfg(test)]
mod tests {
    use masseter_analysis::{Analysis, TrackingSample};
    use masseter_recording::MachineInfo;
    use masseter_shared::config::Scenario;
    use masseter_shared::geometry::Pose;

    use super::*;

    /// The page of a run on these interfaces, with a motion of one sample.
    fn page(interfaces: &[&str]) -> String {
        let mut scenario = Scenario::default();
        scenario.can.interfaces = interfaces.iter().map(|name| (*name).to_owned()).collect();
        let mut figures = Analysis::new(&scenario).finish(false, &[]);
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
