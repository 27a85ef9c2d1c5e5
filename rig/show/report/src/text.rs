//! Numbers and events as text, for the table, the checks and the page.

use std::fmt::Display;

use masseter_analysis::{Code, EventRecord};
use masseter_runtime::messages::codes::Cause;
use masseter_scenario::Dimension;

/// A dash where there is no such figure.
pub(crate) fn or_dash<T>(figure: Option<T>, format: impl Fn(T) -> String) -> String {
    figure.map_or_else(|| "–".to_owned(), format)
}

/// Millimetres or degrees, with four decimals.
pub(crate) fn decimals(value: f64) -> String {
    format!("{value:.4}")
}

/// A number with four significant digits.
pub(crate) fn significant(value: f64) -> String {
    Dimension::One.si_unit().text(value)
}

/// Nanoseconds as microseconds with two decimals.
pub(crate) fn microseconds(ns: u64) -> String {
    format!("{:.2}", ns as f64 / 1e3)
}

/// [`microseconds`], or a dash.
pub(crate) fn us(ns: Option<u64>) -> String {
    or_dash(ns, microseconds)
}

/// Millimetres with four decimals, or a dash.
pub(crate) fn mm(value: Option<f64>) -> String {
    or_dash(value, |mm| format!("{} mm", decimals(mm)))
}

/// A row of a table: the first cell to the left, the others to the right, each as wide as given.
pub(crate) fn columns<const N: usize>(widths: [usize; N], cells: [impl Display; N]) -> String {
    let cells = widths.into_iter().zip(cells).enumerate().map(|(place, (width, cell))| match place {
        0 => format!("{cell:<width$}"),
        _ => format!(" {cell:>width$}"),
    });
    cells.collect()
}

/// A number with its digits in groups of three.
pub(crate) fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let first = digits.len() % 3;
    let (head, rest) = digits.split_at(first);
    let groups = (0..rest.len() / 3).map(|group| &rest[3 * group..3 * group + 3]);
    [head].into_iter().filter(|head| !head.is_empty()).chain(groups).collect::<Vec<_>>().join(",")
}

/// An event with its cycle.
pub(crate) fn event_with_cycle(record: &EventRecord) -> String {
    format!("cycle {:>6} {}", record.cycle, event_in_words(record))
}

/// An event without its time.
pub(crate) fn event_in_words(event: &EventRecord) -> String {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_are_grouped_by_three() {
        let numbers = [0, 7, 999, 1000, 11_379, 1_234_567];
        assert_eq!(numbers.map(grouped), ["0", "7", "999", "1,000", "11,379", "1,234,567"]);
    }
}
