//! What sections of the page have in common: times as seconds since the run's first SYNC, and curves.

use masseter_judge::{Curve, Figures};
use masseter_page::{LevelKind, Limit, Phase, Points, Series, Style, Time};
use masseter_recording::Manifest;
use masseter_runtime::messages::codes::Source;

/// What the page's times count from.
pub(super) fn time(manifest: &Manifest, figures: &Figures) -> Time {
    let over_time = &figures.over_time;
    let last_s = figures.events.last().map_or(0.0, |event| since_s(figures, event.time_ns));
    Time {
        motion_s: motion_s(figures),
        end_s: over_time.duration_s.max(last_s),
        period_s: manifest.scenario.period_ns() as f64 / 1e9,
        wall_s: manifest.wall_ahead_ns.map(|ahead_ns| (over_time.began_ns() as f64 + ahead_ns as f64) / 1e9),
    }
}

/// An instant of the run's clock as a time of the page, s since the first SYNC.
pub(super) fn since_s(figures: &Figures, time_ns: u64) -> f64 {
    time_ns.saturating_sub(figures.over_time.began_ns()) as f64 / 1e9
}

/// The states of the controller, one after the other.
pub(super) fn phases(figures: &Figures) -> Vec<Phase> {
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

/// When the motion began; none where it did not.
pub(super) fn motion_s(figures: &Figures) -> Option<f64> {
    figures.over_time.motion_began_ns.map(|began_ns| since_s(figures, began_ns))
}

/// A curve of several alike, in another unit.
pub(super) fn plain(name: &str, curve: &Curve, unit: f64) -> Series {
    Series::new(name, Style::Plain, Points::over_time(&in_unit(curve, 0.0, unit)))
}

pub(super) fn limit(name: &str, values: &[f64]) -> Limit {
    level(LevelKind::Limit, name, values)
}

pub(super) fn level(kind: LevelKind, name: &str, values: &[f64]) -> Limit {
    Limit { name: name.to_owned(), kind, values: values.to_vec() }
}

/// A curve in another unit, from another zero.
pub(super) fn in_unit(curve: &Curve, zero: f64, unit: f64) -> Vec<(f64, f64)> {
    curve.iter().map(|&(at_s, value)| (at_s, (value - zero) * unit)).collect()
}
