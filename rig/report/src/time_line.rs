//! Events along the run's time: a row for each source, a mark for each event.

use masseter_analysis::{Code, EventRecord, Figures};
use masseter_charts::palette::{BLUE, RED};
use masseter_charts::{Axis, Error, Scale, chart, marks};
use masseter_shared::messages::codes::EventKind;

const WIDTH: u32 = 960;
const ROW: u32 = 30;
/// Room for the time axis, px.
const BELOW: u32 = 70;
const RADIUS: u32 = 5;
/// Most marks; more of them cover each other.
const MOST: usize = 2000;

/// The time line as SVG; none without events.
pub(crate) fn svg(figures: &Figures) -> Option<String> {
    let events = &figures.events[..figures.events.len().min(MOST)];
    draw(events, figures.over_time.began_ns, figures.duration_s).ok().filter(|_| !events.is_empty())
}

fn draw(events: &[EventRecord], began_ns: u64, duration_s: f64) -> Result<String, Error> {
    let mut sources: Vec<_> = events.iter().map(|event| event.source).collect();
    sources.sort_by_cached_key(Code::to_string);
    sources.dedup();
    let row = |event: &EventRecord| sources.iter().position(|source| *source == event.source).unwrap_or(0);
    let point =
        |event: &EventRecord| (event.time_ns.saturating_sub(began_ns) as f64 / 1e9, row(event) as f64);
    let end_s = events.iter().map(|event| point(event).0).fold(duration_s, f64::max);
    masseter_charts::svg((WIDTH, ROW * sources.len() as u32 + BELOW), |area| {
        let x = Axis::new("time, s", Scale::Linear, [0.0, end_s]);
        let y = Axis::of_names("", sources.iter().map(ToString::to_string).collect());
        let mut chart = chart(area, "", x, y)?;
        let (faults, others): (Vec<&EventRecord>, Vec<_>) =
            events.iter().partition(|event| event.kind == EventKind::Fault);
        for (events, colour) in [(others, BLUE), (faults, RED)] {
            marks(&mut chart, events.into_iter().map(point), RADIUS, colour)?;
        }
        Ok(())
    })
}
