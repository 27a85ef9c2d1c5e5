//! Events over time as SVG: a row for each source, a mark for each event.

use std::fmt::Write;

use masseter_shared::messages::codes::{EventKind, Source};

use crate::text::{escape, event_with_cycle};
use masseter_analysis::{Code, EventRecord, Figures};

const WIDTH: f64 = 960.0;
const LEFT: f64 = 90.0;
const ROW: f64 = 26.0;
/// Most marks that are drawn; more of them cannot be distinguished.
const MOST: usize = 2000;

/// The time line; none without events.
pub(crate) fn svg(figures: &Figures) -> Option<String> {
    let events = &figures.events[..figures.events.len().min(MOST)];
    let began_ns = figures.over_time.began_ns;
    let seconds = |event: &EventRecord| event.time_ns.saturating_sub(began_ns) as f64 / 1e9;
    let mut sources: Vec<_> = events.iter().map(|event| event.source).collect();
    sources.sort_by_cached_key(Code::to_string);
    sources.dedup();
    let end_s = events.iter().map(seconds).fold(figures.duration_s, f64::max).max(1e-3);
    (!sources.is_empty()).then(|| {
        let mut svg = String::new();
        write_svg(&mut svg, events, &sources, end_s, &seconds).expect("a string takes any text");
        svg
    })
}

fn write_svg(
    svg: &mut String,
    events: &[EventRecord],
    sources: &[Code<Source>],
    end_s: f64,
    seconds: &dyn Fn(&EventRecord) -> f64,
) -> std::fmt::Result {
    let height = ROW * (sources.len() as f64 + 1.0);
    let x = |at_s: f64| LEFT + at_s / end_s * (WIDTH - LEFT - 20.0);
    write!(svg, "<svg viewBox=\"0 0 {WIDTH} {height}\" font-size=\"13\">")?;
    for (row, source) in sources.iter().enumerate() {
        let y = ROW * (row as f64 + 0.5);
        write!(
            svg,
            "<text x=\"0\" y=\"{}\">{}</text><path d=\"M{LEFT} {y}H{WIDTH}\" stroke=\"#ddd\"/>",
            y + 4.0,
            escape(&source.to_string())
        )?;
    }
    for event in events {
        let row = sources.iter().position(|source| *source == event.source).unwrap_or(0);
        let colour = if event.kind == EventKind::Fault { "#b00020" } else { "#0072b2" };
        write!(
            svg,
            "<circle cx=\"{:.1}\" cy=\"{}\" r=\"5\" fill=\"{colour}\" fill-opacity=\".6\"><title>{:.3} s: {}</title></circle>",
            x(seconds(event)),
            ROW * (row as f64 + 0.5),
            seconds(event),
            escape(&event_with_cycle(event))
        )?;
    }
    for tick in 0..=5 {
        let at_s = end_s * f64::from(tick) / 5.0;
        write!(
            svg,
            "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{at_s:.1} s</text>",
            x(at_s),
            height - 6.0
        )?;
    }
    svg.push_str("</svg>\n");
    Ok(())
}
