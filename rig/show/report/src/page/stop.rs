//! The stop of a run: the chain from the fault to the standstill, and axis and buses around the stop. Judges nothing.

use masseter_judge::{Band, Curve, EventRecord, FaultFigures, Figures};
use masseter_model::geometry::AXIS_NAMES;
use masseter_page::{Block, Cell, Chart, Column, Moment, MomentKind, Points, Section, Series, Style, Table};
use masseter_runtime::messages::codes::Source;
use masseter_scenario::Scenario;

use super::times::since_s;
use crate::text::or_dash;

/// What the page shows of a stop at first: from so long before the stop, to so long after, s.
const AROUND_S: [f64; 2] = [0.05, 0.5];
/// An axis stands while the axis is no further than this from where the recording leaves it, m.
const STANDS_M: f64 = 5e-5;
/// An axis that moves so shortly before the end of the recording shows no standstill, s.
const LEAST_STANDSTILL_S: f64 = 0.1;

/// The event that began the first safe stop.
pub(super) fn stop(figures: &Figures) -> Option<&EventRecord> {
    figures.events.iter().find(|event| event.begins_stop())
}

/// The window around the first safe stop, s since the first SYNC; none without one.
pub(super) fn window(figures: &Figures) -> Option<[f64; 2]> {
    let at_s = since_s(figures, stop(figures)?.time_ns);
    Some([at_s - AROUND_S[0], at_s + AROUND_S[1]])
}

/// The chain, as far as there is one: the first strike of every fault, the event that began the first safe stop, the first
/// drive that left operation, and the standstill of the last axis, in the order of time.
pub(super) fn moments(scenario: &Scenario, figures: &Figures) -> Vec<Moment> {
    let strike = |fault: &FaultFigures| {
        let name = format!("fault {}", fault.number);
        let text = format!("{name}: {}", scenario.faults.get(fault.number - 1)?);
        Some(moment(since_s(figures, fault.struck_ns?), MomentKind::Fault, &name, text))
    };
    let strikes = figures.faults.iter().filter_map(strike);
    let mut moments: Vec<_> = strikes.chain(moments_of_stop(figures)).collect();
    moments.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
    moments
}

fn moment(at_s: f64, kind: MomentKind, name: &str, text: String) -> Moment {
    Moment { at_s, kind, name: name.to_owned(), text }
}

fn moments_of_stop(figures: &Figures) -> Vec<Moment> {
    let Some(EventRecord { source, cause, time_ns, .. }) = stop(figures) else { return Vec::new() };
    let text = format!("safe stop: {source}, {cause}");
    let mut moments = vec![moment(since_s(figures, *time_ns), MomentKind::Detection, "safe stop", text)];
    let leaves = |event: &&EventRecord| {
        let is_from = |[from, _]: &[String; 2]| from == "operation_enabled";
        event.time_ns >= *time_ns
            && event.source == Source::Drive
            && event.transition.as_ref().is_some_and(is_from)
    };
    if let Some(event) = figures.events.iter().find(leaves) {
        let text = format!("reaction: {}", event.in_words());
        moments.push(moment(since_s(figures, event.time_ns), MomentKind::Note, "reaction", text));
    }
    // What stands already has stopped by the reaction.
    let reacted_s = moments.last().map_or(0.0, |moment| moment.at_s);
    if let Some(at_s) = standstill_s(figures, reacted_s) {
        moments.push(moment(at_s, MomentKind::Note, "standstill", "standstill of every axis".to_owned()));
    }
    moments
}

/// When the last axis came to where it stands; none where one moves until its last position, or has none after the stop.
fn standstill_s(figures: &Figures, reacted_s: f64) -> Option<f64> {
    let stands_s = |band: &Band| {
        let curve = band.curve();
        let (end_s, end_m) = *curve.last()?;
        let moves = curve.iter().rev().find(|(_, position_m)| (position_m - end_m).abs() > STANDS_M);
        let at_s = moves.map_or(reacted_s, |(at_s, _)| at_s.max(reacted_s));
        (end_s - at_s > LEAST_STANDSTILL_S).then_some(at_s)
    };
    let axes = figures.over_time.position_m.iter().map(stands_s).collect::<Option<Vec<_>>>()?;
    axes.into_iter().reduce(f64::max)
}

/// The chain with the times and ways between its links; nothing without a link.
pub(super) fn chain(figures: &Figures, moments: &[Moment]) -> Option<Block> {
    let over_time = &figures.over_time;
    let first_s = moments.first()?.at_s;
    let (incisal_m, distance_m) =
        (over_time.actual_incisal_m.each_ref().map(Band::curve), over_time.distance_m.highest());
    let place_mm = |at_s: f64| {
        let [x, y, z] = incisal_m.each_ref().map(|curve| value_at(curve, at_s));
        Some([x?, y?, z?].map(|m| m * 1e3))
    };
    let row = |Moment { at_s, text, .. }: &Moment| -> [Cell; 5] {
        let moved_mm = place_mm(first_s).zip(place_mm(*at_s)).map(|(from, to)| {
            from.into_iter().zip(to).map(|(from, to)| (to - from).powi(2)).sum::<f64>().sqrt()
        });
        let away_mm = value_at(&distance_m, *at_s).map(|m| m * 1e3);
        let [away, moved] = [away_mm, moved_mm].map(|mm| or_dash(mm, |mm| format!("{mm:.3}")));
        let after_ms = format!("{:.1}", (at_s - first_s) * 1e3);
        [Cell::Time { at_s: *at_s }, text.clone().into(), after_ms.into(), away.into(), moved.into()]
    };
    let numbers = ["after the first, ms", "incisal point from its path, mm", "moved since the first, mm"];
    let columns = [Column::texts(&["at", "what"]), Column::numbers(&numbers)];
    Some(Block::table(
        "moments",
        Table::new("From the fault to the standstill", columns, moments.iter().map(row)),
    ))
}

/// The axis that stopped the run and the load of the buses, around the stop; none without a stop.
pub(super) fn stop_section(figures: &Figures) -> Option<Section> {
    let around_s = window(figures)?;
    let over_time = &figures.over_time;
    let series = |name: &str, style: Style, curve: &Curve, unit: f64| {
        let is_around = |(at_s, _): &&(f64, f64)| *at_s >= around_s[0] && *at_s <= around_s[1];
        let points: Vec<_> =
            curve.iter().filter(is_around).map(|(at_s, value)| (*at_s, value * unit)).collect();
        Series::new(name, style, Points::over_time(&points))
    };
    let axis = stop(figures)?.axis.and_then(|name| AXIS_NAMES.iter().position(|axis| *axis == name));
    let axis = axis.map(|axis| {
        let mut both = vec![series("true", Style::True, &over_time.position_m[axis].curve(), 1e3)];
        let reported = over_time.reported_m[axis].curve();
        if reported.is_empty() {
            "reported".clone_into(&mut both[0].name);
        } else {
            both.push(series("reported", Style::Estimated, &reported, 1e3));
        }
        let title = format!("Position of {} around the stop", AXIS_NAMES[axis]);
        Block::chart("stop-axis", Chart { series: both, ..Chart::over_time(title, "mm") }).half()
    });
    let loads = over_time.bus_load().enumerate();
    let loads: Vec<_> =
        loads.map(|(bus, load)| series(&format!("can{bus}"), Style::Plain, &load, 100.0)).collect();
    let buses = Chart { series: loads, ..Chart::over_time("Load of the buses around the stop", "%") };
    let buses = figures.frames.is_some().then(|| Block::chart("stop-buses", buses).half());
    let blocks: Vec<_> = axis.into_iter().chain(buses).collect();
    (!blocks.is_empty()).then(|| Section::new("stop", "Around the stop", blocks))
}

/// The value of a curve at a time, on the line between its points; none outside of the curve.
fn value_at(curve: &Curve, at_s: f64) -> Option<f64> {
    let after = curve.partition_point(|(point_s, _)| *point_s < at_s);
    let ((from_s, from), (to_s, to)) = (*curve.get(after.checked_sub(1)?)?, *curve.get(after)?);
    Some(from + (to - from) * (at_s - from_s) / (to_s - from_s))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_chain_is_in_the_order_of_time_whatever_the_order_of_the_faults() {
        let fault = "kind = 'encoder_stuck'\naxis = 'l2'\nat_s = 1.0\n";
        let faults = format!("[[faults]]\n{fault}[[faults]]\n{fault}");
        let scenario = Scenario::parse("scenario.toml".as_ref(), &faults).unwrap();
        let strike = |number, struck_ns| FaultFigures { number, struck_ns, ..FaultFigures::default() };
        let faults = vec![strike(1, Some(3_000_000_000)), strike(2, Some(1_000_000_000))];
        let figures = Figures { faults, ..Figures::default() };
        let moments = moments(&scenario, &figures);
        assert_eq!(moments.iter().map(|moment| moment.at_s).collect::<Vec<_>>(), [1.0, 3.0]);
        assert_eq!(moments[0].name, "fault 2");
    }
}
