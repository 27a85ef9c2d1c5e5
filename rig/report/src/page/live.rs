//! A run that goes on: its state, and the parameters that can be changed.

use masseter_analysis::{Code, Figures, ParameterFigures};
use masseter_page::{Block, Content, Live, Parameter, Section, Tone};
use masseter_recording::Manifest;
use masseter_runtime::messages::codes::ControllerState;

use super::times::since_s;
use crate::text::{decimals, or_dash};

pub(super) fn sections(manifest: &Manifest, figures: &Figures, number: u64, left_out: u64) -> Vec<Section> {
    let now = Block::new("now", Content::Live(now(manifest, figures, number, left_out)));
    let mut sections = vec![Section::new("now", "Now", vec![now])];
    if !figures.parameters.is_empty() {
        let parameters = figures.parameters.iter().map(parameter).collect();
        let block = Block::new("set-parameters", Content::Parameters(parameters));
        sections.push(Section::new("set", "Change parameters", vec![block]));
    }
    sections
}

fn now(manifest: &Manifest, figures: &Figures, number: u64, left_out: u64) -> Live {
    let state = figures.final_state.map_or_else(|| "starting".to_owned(), |state: Code<_>| state.to_string());
    let tone = match state.as_str() {
        name if name == ControllerState::SafeStop.name() => Tone::Bad,
        name if name == ControllerState::Running.name() || name == ControllerState::Finished.name() => {
            Tone::Good
        }
        _ => Tone::Plain,
    };
    let over_time = &figures.over_time;
    let began_s = over_time.motion_began_ns.map(|began_ns| since_s(figures, began_ns));
    let progress = match began_s {
        Some(began_s) => {
            let gone_s = (over_time.duration_s - began_s).clamp(0.0, manifest.motion_s);
            format!("{gone_s:.1} s of {:.1} s of the motion", manifest.motion_s)
        }
        None => "The motion has not begun.".to_owned(),
    };
    let errors = figures.tracking.actual;
    let mm = |value: Option<f64>| or_dash(value, |mm| format!("{} mm", decimals(mm)));
    let missed = figures.controller_skips.skipped + figures.plant_skips.skipped;
    let mut shown = vec![
        ["incisal point from desired, rms".to_owned(), mm(errors.incisal_rms_mm)],
        ["the same, greatest".to_owned(), mm(errors.incisal_max_mm)],
        ["cycles".to_owned(), figures.cycles.to_string()],
        ["missed".to_owned(), missed.to_string()],
    ];
    if left_out > 0 {
        shown.push(["messages left out of this page".to_owned(), left_out.to_string()]);
    }
    Live { number, state: state.replace('_', " "), tone, progress, figures: shown }
}

fn parameter(figures: &ParameterFigures) -> Parameter {
    let ParameterFigures { parameter, last, .. } = figures;
    Parameter {
        name: parameter.name.clone(),
        unit: parameter.unit.clone(),
        about: parameter.about.clone(),
        value: *last,
        range: parameter.range,
    }
}
