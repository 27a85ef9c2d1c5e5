//! Numbers and events as text, for the table, the checks and the page.

use masseter_analysis::{Code, EventRecord};
use masseter_shared::messages::codes::Cause;

/// A dash where there is no such figure.
pub(crate) fn or_dash<T>(figure: Option<T>, format: impl Fn(T) -> String) -> String {
    figure.map_or_else(|| "–".to_owned(), format)
}

/// Millimetres or degrees, with four decimals.
pub(crate) fn decimals(value: f64) -> String {
    format!("{value:.4}")
}

/// Nanoseconds as microseconds with two decimals.
pub(crate) fn microseconds(ns: u64) -> String {
    format!("{:.2}", ns as f64 / 1e3)
}

/// An event with its cycle.
pub(crate) fn event_with_cycle(record: &EventRecord) -> String {
    format!("cycle {:>6} {}", record.cycle, event(record))
}

/// An event without its time.
pub(crate) fn event(event: &EventRecord) -> String {
    let EventRecord { source, cause, .. } = event;
    if let Some(text) = &event.text {
        return format!("{source}: {cause} ({text})");
    }
    let axis = event.axis.map_or_else(String::new, |axis| format!(" {axis}"));
    let transition = event.transition.as_ref().map(|[from, to]| format!("{from} → {to}")).unwrap_or_default();
    let text = match cause {
        Code::Known(Cause::Sequence) => return format!("{source}{axis}: {transition}"),
        Code::Known(Cause::StopRequested) => format!("{source}{axis}: {cause} {transition}"),
        _ => format!("{source}{axis}: {cause} (value {}, limit {}) {transition}", event.value, event.limit),
    };
    text.trim_end().to_owned()
}
