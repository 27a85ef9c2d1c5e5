//! `report.html`: one page that needs no network. Each module fills a section of it; `masseter-page` draws them.

mod motion;
mod result;
mod rig;
mod stop;
mod times;

use masseter_judge::{Figures, Verdict};
use masseter_page::{Life, Page, PageError, Section};
use masseter_recording::Manifest;

use self::motion::{actuators_section, jaw_section, mechanism_section, motion_section, pressure_section};
use self::result::{events_section, live_sections, named_section, requirements_section, result_section};
use self::rig::{buses_section, circumstances_section, timing_section};
use self::stop::{moments, stop_section, window};
use self::times::{phases, time};
use crate::why::{Why, why_section};

pub(crate) use self::result::mark;

/// The page; of a failed run also with the last way back, where it is known.
pub(crate) fn html(
    manifest: &Manifest,
    figures: &Figures,
    verdict: &Verdict,
    why: Option<&Why>,
) -> Result<String, PageError> {
    let why = why.map(|why| why_section(why, manifest.scenario.period_s()));
    let first = [result_section(manifest, figures, verdict)].into_iter().chain(why).collect();
    page(Life::Finished, first, manifest, figures, verdict).to_html()
}

/// The page of a run that goes on, with the figures so far; `number` is that of the page's update. `left_out`: messages that are
/// not in the figures.
pub fn so_far(manifest: &Manifest, figures: &Figures, number: u64, left_out: u64) -> Page {
    let verdict = Verdict::new(manifest, figures);
    let first = live_sections(manifest, figures, number, left_out);
    page(Life::Live, first, manifest, figures, &verdict)
}

fn page(life: Life, first: Vec<Section>, manifest: &Manifest, figures: &Figures, verdict: &Verdict) -> Page {
    let scenario = &manifest.scenario;
    let mechanism = mechanism_section(scenario, figures);
    // The jaw's views take the poses from the mechanism's.
    let jaw = mechanism.as_ref().and_then(|_| jaw_section(figures));
    let others: [Option<Section>; 12] = [
        stop_section(figures),
        requirements_section(figures, verdict, life),
        mechanism,
        jaw,
        Some(motion_section(scenario, figures)),
        pressure_section(figures),
        Some(actuators_section(scenario, figures)),
        named_section(figures),
        Some(timing_section(manifest, figures)),
        Some(buses_section(figures)),
        Some(events_section(figures)),
        Some(circumstances_section(manifest)),
    ];
    Page {
        about: about(manifest, figures),
        moments: moments(scenario, figures),
        window: window(figures),
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

#[cfg(test)]
mod tests {
    use masseter_judge::{Analysis, TrackingSample};
    use masseter_model::geometry::Pose;
    use masseter_recording::MachineInfo;
    use masseter_runtime::named::Declared;
    use masseter_scenario::Scenario;
    use serde_json::Value;

    use super::*;

    /// The data of the page of a run on these interfaces, with a motion of one sample.
    fn data(interfaces: &[&str]) -> Value {
        let mut scenario = Scenario::default();
        scenario.can.interfaces = interfaces.iter().map(|name| (*name).to_owned()).collect();
        let mut figures = Analysis::new(&scenario, &Declared::default()).finish(false, &[]);
        let still = Pose::identity();
        figures.track =
            vec![TrackingSample { sampled_ns: 0, desired: still, estimated: still, actual: still }];
        let machine = MachineInfo { cpu: String::new(), cores: 2, kernel: String::new(), is_virtual: false };
        let manifest = Manifest::new("0.1.0", scenario, 1.0, "rt", machine);
        let page = html(&manifest, &figures, &Verdict::new(&manifest, &figures), None).unwrap();
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
