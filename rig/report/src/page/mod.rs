//! `report.html`: one page that needs no network. Each module fills a section of it; `masseter-page` draws them.

mod actuators;
mod animation;
mod buses;
mod charts;
mod circumstances;
mod events;
mod live;
mod motion;
mod named;
mod requirements;
mod result;
mod timing;

use masseter_analysis::{Curve, EventRecord, FaultFigures, Figures};
use masseter_page::{Life, Moment, MomentKind, Page, PageError, Phase, Section, Time};
use masseter_recording::Manifest;
use masseter_shared::config::Scenario;
use masseter_shared::messages::codes::Source;

use crate::verdict::Verdict;

/// The page.
pub(crate) fn html(manifest: &Manifest, figures: &Figures, verdict: &Verdict) -> Result<String, PageError> {
    let first = vec![result::section(manifest, figures, verdict)];
    page(Life::Finished, first, manifest, figures, verdict).to_html()
}

/// The page of a run that goes on, with the figures so far; `number` is that of the page's update. `left_out`: messages that are
/// not in the figures.
pub fn so_far(manifest: &Manifest, figures: &Figures, number: u64, left_out: u64) -> Page {
    let verdict = Verdict::new(manifest, figures);
    let first = live::sections(manifest, figures, number, left_out);
    page(Life::Live, first, manifest, figures, &verdict)
}

fn page(life: Life, first: Vec<Section>, manifest: &Manifest, figures: &Figures, verdict: &Verdict) -> Page {
    let scenario = &manifest.scenario;
    let others: [Option<Section>; 10] = [
        requirements::section(figures, verdict),
        motion::mechanism(scenario, figures),
        Some(motion::section(scenario, figures)),
        motion::pressure(figures),
        Some(actuators::section(scenario, figures)),
        named::section(figures),
        Some(timing::section(scenario, figures)),
        Some(buses::section(figures)),
        Some(events::section(figures)),
        Some(circumstances::section(manifest)),
    ];
    Page {
        about: about(manifest, figures),
        moments: moments(scenario, figures),
        phases: phases(figures),
        sections: first.into_iter().chain(others.into_iter().flatten()).collect(),
        ..Page::new(&scenario.name, life, time(manifest, figures))
    }
}

/// A line of what the run was.
fn about(manifest: &Manifest, figures: &Figures) -> String {
    let scenario = &manifest.scenario;
    format!(
        "{} UTC · {:.1} s of motion at {} Hz · {} clock · seed {} · digest {}",
        manifest.began.trim_end_matches('Z').replace('T', " "),
        manifest.motion_s,
        scenario.rate_hz,
        manifest.clock,
        scenario.seed,
        figures.digest
    )
}

fn time(manifest: &Manifest, figures: &Figures) -> Time {
    let over_time = &figures.over_time;
    let last_s = figures.events.last().map_or(0.0, |event| since_s(figures, event.time_ns));
    Time {
        motion_s: over_time.motion_began_ns.map(|began_ns| since_s(figures, began_ns)),
        end_s: over_time.duration_s.max(last_s),
        period_s: manifest.scenario.period_ns() as f64 / 1e9,
        wall_s: manifest.wall_ahead_ns.map(|ahead_ns| (over_time.began_ns as f64 + ahead_ns as f64) / 1e9),
    }
}

/// An instant of the run's clock as a time of the page, s since the first SYNC.
fn since_s(figures: &Figures, time_ns: u64) -> f64 {
    time_ns.saturating_sub(figures.over_time.began_ns) as f64 / 1e9
}

/// The first strike of every fault, and the event that began the first safe stop.
fn moments(scenario: &Scenario, figures: &Figures) -> Vec<Moment> {
    let strike = |fault: &FaultFigures| {
        let declared = scenario.faults.get(fault.number - 1)?;
        Some(Moment {
            at_s: since_s(figures, fault.struck_ns?),
            kind: MomentKind::Fault,
            name: format!("fault {}", fault.number),
            text: format!("fault {}: {declared}", fault.number),
        })
    };
    let stop = figures.events.iter().find(|event| event.begins_stop());
    let detection = |EventRecord { source, cause, time_ns, .. }: &EventRecord| Moment {
        at_s: since_s(figures, *time_ns),
        kind: MomentKind::Detection,
        name: "safe stop".to_owned(),
        text: format!("safe stop: {source}, {cause}"),
    };
    figures.faults.iter().filter_map(strike).chain(stop.map(detection)).collect()
}

/// The states of the controller, one after the other.
fn phases(figures: &Figures) -> Vec<Phase> {
    let mut phases: Vec<Phase> = Vec::new();
    for event in figures.events.iter().filter(|event| event.source == Source::Controller) {
        let Some([from, to]) = &event.transition else { continue };
        let at_s = since_s(figures, event.time_ns);
        match phases.last_mut() {
            Some(last) => last.to_s = at_s,
            None => phases.push(Phase { from_s: 0.0, to_s: at_s, name: from.clone() }),
        }
        phases.push(Phase { from_s: at_s, to_s: at_s, name: to.clone() });
    }
    if let Some(last) = phases.last_mut() {
        last.to_s = figures.over_time.duration_s.max(last.from_s);
    }
    phases
}

/// A curve in another unit, from another zero.
fn in_unit(curve: &Curve, zero: f64, unit: f64) -> Vec<(f64, f64)> {
    curve.iter().map(|&(at_s, value)| (at_s, (value - zero) * unit)).collect()
}

#[cfg(test)]
mod tests {
    use masseter_analysis::{Analysis, TrackingSample};
    use masseter_recording::MachineInfo;
    use masseter_shared::geometry::Pose;
    use masseter_shared::named::Declared;
    use serde_json::Value;

    use super::*;

    /// The data of the page of a run on these interfaces, with a motion of one sample.
    fn data(interfaces: &[&str]) -> Value {
        let mut scenario = Scenario::default();
        scenario.can.interfaces = interfaces.iter().map(|name| (*name).to_owned()).collect();
        let mut figures = Analysis::new(&scenario, &Declared::default()).finish(false, &[]);
        let still = Pose::identity();
        figures.track.samples =
            vec![TrackingSample { sampled_ns: 0, desired: still, estimated: still, actual: still }];
        let machine = MachineInfo { cpu: String::new(), cores: 2, kernel: String::new(), is_virtual: false };
        let manifest = Manifest::new(scenario, 1.0, "rt", machine);
        let page = html(&manifest, &figures, &Verdict::new(&manifest, &figures)).unwrap();
        let (_, from) = page.split_once("id=\"data\">").unwrap();
        serde_json::from_str(from.split_once("</script>").unwrap().0).unwrap()
    }

    fn block(page: &Value, id: &str) -> Value {
        let sections = page["sections"].as_array().unwrap().iter();
        let mut blocks = sections.flat_map(|section| section["blocks"].as_array().unwrap());
        blocks.find(|block| block["id"] == id).unwrap()["data"].clone()
    }

    #[test]
    fn without_truth_nothing_is_called_true() {
        let names = |page: &Value| -> Vec<String> {
            let series = block(page, "motion-z")["series"].as_array().unwrap().clone();
            series.iter().map(|series| series["name"].as_str().unwrap().to_owned()).collect()
        };
        let (emulated, robot) = (data(&[]), data(&["can0", "can1"]));
        assert_eq!(names(&emulated), ["desired", "true", "estimated"]);
        assert_eq!(names(&robot), ["desired", "estimated"]);
        assert_eq!(
            [&emulated, &robot].map(|page| block(page, "scene")["actual_name"].clone()),
            ["true", "estimated"]
        );
    }

    #[test]
    fn a_run_that_never_moved_has_no_time_of_its_motion() {
        let page = data(&[]);
        assert!(page["time"]["motion_s"].is_null() && page["moments"].as_array().unwrap().is_empty());
    }
}
