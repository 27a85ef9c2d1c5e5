//! What came out: verdict, checks, requirements, events, the controller's signals and parameters; and a run that goes on.

use masseter_judge::requirements::{RequirementFigures, RequirementPlot};
use masseter_judge::{
    Check, CheckResult, Code, EventRecord, Figures, ParameterFigures, SignalFigures, TimingWord, Verdict,
};
use masseter_page::{
    Block, Cell, Chart, Column, Content, EventRow, Events, LevelKind, Life, Live, Moment, MomentKind, Points,
    Section, Series, Style, Table, Tone,
};
use masseter_recording::Manifest;
use masseter_runtime::messages::codes::{ControllerState, EventKind, Source};
use masseter_terminal::Exit;

use super::stop::{chain, moments, stop};
use super::times::{level, limit, motion_s, plain, since_s};
use crate::text::{mm, or_dash};

pub(super) fn result_section(manifest: &Manifest, figures: &Figures, verdict: &Verdict) -> Section {
    let mut blocks = vec![Block::new("verdict", Content::Verdict(panel(manifest, figures, verdict)))];
    blocks.extend(chain(figures, &moments(&manifest.scenario, figures)));
    blocks.push(Block::table("checks", checks(figures, verdict.checks.iter().collect())));
    blocks.extend(warning_blocks(manifest));
    Section::new("result", "Result", blocks)
}

/// Checks and requirements, what is not as it should be first.
fn checks(figures: &Figures, mut checks: Vec<&Check>) -> Table {
    checks.sort_by_key(|check| match check.result {
        CheckResult::Failed => 0,
        CheckResult::Excused | CheckResult::Untested => 1,
        CheckResult::Passed => 2,
        CheckResult::NotJudged => 3,
    });
    let worst_ns = |check: &Check| {
        let mut required = figures.requirements.iter().filter(|_| check.is_requirement());
        required.find(|found| found.name == check.name).and_then(|found| found.worst_ns)
    };
    let has_times = checks.iter().any(|check| worst_ns(check).is_some());
    let row = |check: &Check| {
        let at = worst_ns(check).map_or_else(|| "".into(), |ns| Cell::Time { at_s: since_s(figures, ns) });
        let Check { name, finding, result, .. } = check;
        let cells: [Cell; 3] = [name.to_string().into(), mark(*result), finding.clone().into()];
        cells.into_iter().chain(has_times.then_some(at)).collect::<Vec<_>>()
    };
    let times = if has_times { Column::texts(&["least margin at"]) } else { Vec::new() };
    let columns = [Column::texts(&["check", "result", "found"]), times];
    Table::new("Checks and requirements", columns, checks.into_iter().map(row))
}

/// What the plan of the run warns of.
fn warning_blocks(manifest: &Manifest) -> impl Iterator<Item = Block> {
    let block = |(number, text)| Block::text(format!("warning-{number}"), format!("Warning: {text}"));
    manifest.warnings.iter().enumerate().map(block)
}

/// The word for a result as a cell.
pub(crate) fn mark(result: CheckResult) -> Cell {
    let tone = match result {
        CheckResult::Passed => Tone::Good,
        CheckResult::Failed => Tone::Bad,
        CheckResult::Excused | CheckResult::Untested => Tone::Doubtful,
        CheckResult::NotJudged => Tone::Plain,
    };
    Cell::Mark { mark: result.mark().to_owned(), tone }
}

/// How far the recording of a run goes that did not come to its end.
fn played_until(figures: &Figures) -> String {
    match motion_s(figures).map(|began_s| figures.over_time.duration_s - began_s) {
        Some(since_s) => format!("; the recording ends {since_s:.3} s after the motion began"),
        None => "; the motion had not begun".to_owned(),
    }
}

fn panel(manifest: &Manifest, figures: &Figures, verdict: &Verdict) -> masseter_page::Verdict {
    let timing = verdict.timing.to_string();
    let (word, more) = timing.split_once(" (").unwrap_or((&timing, ""));
    let more = more.trim_end_matches(')').to_owned();
    let reasons =
        [more].into_iter().filter(|more| !more.is_empty()).chain(verdict.advice().map(str::to_owned));
    let cause = stop(figures).filter(|_| verdict.is_by_checks());
    let cause = cause.map_or_else(String::new, |stop| format!("; safe stop: {}", stop.in_words()));
    let ended = match verdict.exit_code {
        Exit::Interrupted => played_until(figures),
        _ => String::new(),
    };
    masseter_page::Verdict {
        word: verdict.word.to_owned(),
        reason: verdict.in_words() + &cause + &ended,
        // The page lies in the run's folder, and is the report.
        next: verdict.next_step.as_ref().map(|step| {
            step.replace("`RUN/report.html`", "this page").replace("RUN/", "").replace("RUN", ".")
        }),
        tone: match verdict.exit_code {
            Exit::Passed => Tone::Good,
            Exit::Invalid | Exit::Interrupted => Tone::Doubtful,
            _ => Tone::Bad,
        },
        timing: word.to_owned(),
        timing_reason: reasons.collect::<Vec<_>>().join("; "),
        timing_tone: match verdict.timing.word {
            TimingWord::Held => Tone::Good,
            TimingWord::Disturbed | TimingWord::Stalled => Tone::Doubtful,
            TimingWord::Missed => Tone::Bad,
            TimingWord::Simulated | TimingWord::Unknown => Tone::Plain,
        },
        figures: figures_in_words(manifest, figures),
    }
}

/// None of a run that stopped: they would be those of the time before.
fn figures_in_words(manifest: &Manifest, figures: &Figures) -> Vec<[String; 2]> {
    if stop(figures).is_some() {
        return Vec::new();
    }
    // In simulated time every cycle takes as long.
    let longest = figures.worst_cycles.first().filter(|_| manifest.is_in_real_time());
    let mut all = distances(figures);
    if let Some(longest) = longest {
        all.push(["longest cycle".to_owned(), format!("{:.0} µs", longest.total_ns as f64 / 1e3)]);
    }
    if let Some(most_n) = figures.bite_force_max_n.filter(|most_n| *most_n > 0.0) {
        all.push(["greatest bite force".to_owned(), format!("{most_n:.1} N")]);
    }
    all
}

/// The distances of the incisal point from its path.
fn distances(figures: &Figures) -> Vec<[String; 2]> {
    let errors = figures.tracking.actual;
    vec![
        ["incisal point from desired, rms".to_owned(), mm(errors.incisal_rms_mm)],
        ["incisal point from desired, most".to_owned(), mm(errors.incisal_max_mm)],
    ]
}

/// The table of the requirements alone, for a page without a verdict, and the signal of each, what failed first. None where the
/// scenario requires nothing that has a signal.
pub(super) fn requirements_section(figures: &Figures, verdict: &Verdict, life: Life) -> Option<Section> {
    let required = verdict.checks.iter().filter(|check| check.is_requirement()).collect();
    let table = Block::table("requirements", checks(figures, required));
    let mut found: Vec<_> = figures.requirements.iter().enumerate().collect();
    found.sort_by_key(|(_, found)| found.result != CheckResult::Failed);
    let charts = found.into_iter().filter_map(|(place, found)| {
        Some(Block::chart(format!("requirement-{place}"), requirement_chart(figures, found)?))
    });
    let has_table = life == Life::Live && !figures.requirements.is_empty();
    let blocks: Vec<_> = has_table.then_some(table).into_iter().chain(charts).collect();
    (!blocks.is_empty()).then(|| Section::new("requirements", "Requirements", blocks))
}

/// The signal, its limits, and the moment of the smallest margin; none without a signal.
fn requirement_chart(figures: &Figures, of: &RequirementFigures) -> Option<Chart> {
    let RequirementPlot { signal, unit, began_ns, curve, limits, found } = of.plot.as_ref()?;
    let shift_s = since_s(figures, *began_ns);
    let points: Vec<_> = curve.iter().map(|&(at_s, value)| (at_s + shift_s, value)).collect();
    let smallest = of.worst_ns.map(|ns| Moment {
        at_s: since_s(figures, ns),
        kind: MomentKind::Note,
        name: "smallest margin".to_owned(),
        text: format!("smallest margin of {}", of.name),
    });
    let found = found.as_ref().map(|(name, values)| level(LevelKind::Found, name, values));
    let limits = (!limits.is_empty()).then(|| limit("limit", limits));
    Some(Chart {
        series: vec![Series::new(signal, Style::Plain, Points::over_time(&points))],
        limits: limits.into_iter().chain(found).collect(),
        is_shaded: true,
        moments: smallest.into_iter().collect(),
        otherwise: "The signal has no value.".to_owned(),
        ..Chart::over_time(format!("{}: {signal}", of.name), *unit)
    })
}

pub(super) fn events_section(figures: &Figures) -> Section {
    let row = |event: &EventRecord| EventRow {
        at_s: since_s(figures, event.time_ns),
        is_fault: event.kind == EventKind::Fault,
        text: without_source(event),
        source: event.source.to_string(),
    };
    let (start, rest) = phases(&figures.events);
    let events = Events { start: start.iter().map(row).collect(), rest: rest.iter().map(row).collect() };
    let all = Block::new("events", Content::Events(events));
    Section::new("what-happened", "Events", first_faults(figures).into_iter().chain([all]).collect())
}

/// An event in words, where its source stands beside.
fn without_source(event: &EventRecord) -> String {
    let (source, text) = (event.source.to_string(), event.in_words());
    text.strip_prefix(&source).map_or(&*text, |rest| rest.trim_start_matches([':', ' '])).to_owned()
}

/// The first fault that each drive and each other source reports; none where there is no fault.
fn first_faults(figures: &Figures) -> Option<Block> {
    let who = |event: &EventRecord| match event.axis.filter(|_| event.source == Source::Drive) {
        Some(axis) => format!("drive {axis}"),
        None => event.source.to_string(),
    };
    let mut first: Vec<(String, &EventRecord)> = Vec::new();
    for event in figures.events.iter().filter(|event| event.kind == EventKind::Fault) {
        let name = who(event);
        if !first.iter().any(|(other, _)| *other == name) {
            first.push((name, event));
        }
    }
    let row = |(name, event): (String, &EventRecord)| -> [Cell; 3] {
        [name.into(), Cell::Time { at_s: since_s(figures, event.time_ns) }, without_source(event).into()]
    };
    let columns = [Column::texts(&["reported by", "at", "first fault"])];
    let table = Table::new("The first fault that each part reports", columns, first.into_iter().map(row));
    (!table.rows.is_empty()).then(|| Block::table("first-faults", table))
}

/// The events until the controller first moves the jaw, and those from then on.
fn phases(events: &[EventRecord]) -> (&[EventRecord], &[EventRecord]) {
    let moves = events.iter().position(|event| event.enters(ControllerState::Easing));
    events.split_at(moves.unwrap_or(0))
}

/// None where the controller declares nothing.
pub(super) fn named_section(figures: &Figures) -> Option<Section> {
    let mut blocks = Vec::new();
    if !figures.signals.is_empty() {
        blocks.push(Block::table("signals", signals(&figures.signals)));
        blocks.extend(signal_charts(figures));
    }
    if !figures.parameters.is_empty() {
        blocks.push(Block::table("parameters", parameters(&figures.parameters)));
    }
    let title = match (figures.signals.is_empty(), figures.parameters.is_empty()) {
        (false, true) => "Signals of the controller",
        (true, false) => "Parameters of the controller",
        _ => "Signals of the controller and its parameters",
    };
    (!blocks.is_empty()).then(|| Section::new("named", title, blocks))
}

fn signals(signals: &[SignalFigures]) -> Table {
    let row = |named: &SignalFigures| {
        let [min, mean, max, last] = [named.min, named.mean, named.max, named.last].map(value_in_words);
        let not_finite = match named.not_finite {
            0 => String::new(),
            count => format!(" ({count} values were no finite numbers)"),
        };
        let about = format!("{}{not_finite}", named.signal.about);
        [named.signal.name.clone(), named.signal.unit.clone(), min, mean, max, last, about]
    };
    let columns = [
        Column::texts(&["signal", "unit"]),
        Column::numbers(&["smallest", "mean", "largest", "last"]),
        Column::texts(&["meaning"]),
    ];
    Table::new("Signals of the controller", columns, signals.iter().map(row))
}

/// One chart for each unit, in the order of the signals' declaration.
fn signal_charts(figures: &Figures) -> Vec<Block> {
    let mut units: Vec<(&str, Vec<Series>)> = Vec::new();
    for (SignalFigures { signal, .. }, band) in figures.signals.iter().zip(&figures.over_time.signals) {
        let series = plain(&signal.name, &band.curve(), 1.0);
        match units.iter_mut().find(|(unit, _)| *unit == signal.unit) {
            Some((_, all)) => all.push(series),
            None => units.push((&signal.unit, vec![series])),
        }
    }
    let chart = |(number, (unit, series)): (usize, (&str, Vec<Series>))| {
        let title = if let [only] = &series[..] { only.name.clone() } else { "Signals".to_owned() };
        let otherwise = "No finite value came.".to_owned();
        let chart = Chart { series, otherwise, ..Chart::over_time(title, unit) };
        Block::chart(format!("signals-{number}"), chart)
    };
    units.into_iter().enumerate().map(chart).collect()
}

fn parameters(parameters: &[ParameterFigures]) -> Table {
    let row = |named: &ParameterFigures| {
        let parameter = &named.parameter;
        let [low, high] = parameter.range;
        [
            parameter.name.clone(),
            parameter.unit.clone(),
            parameter.value.to_string(),
            named.last.to_string(),
            named.changes.to_string(),
            format!("{low} to {high}"),
            parameter.about.clone(),
        ]
    };
    let columns = [
        Column::texts(&["parameter", "unit"]),
        Column::numbers(&["at the start", "at the end", "changes", "range"]),
        Column::texts(&["meaning"]),
    ];
    Table::new("Parameters of the controller", columns, parameters.iter().map(row))
}

fn value_in_words(value: Option<f64>) -> String {
    or_dash(value, |value| format!("{value:.6}").trim_end_matches('0').trim_end_matches('.').to_owned())
}

pub(super) fn live_sections(
    manifest: &Manifest,
    figures: &Figures,
    number: u64,
    left_out: u64,
) -> Vec<Section> {
    let now = Block::new("now", Content::Live(now(manifest, figures, number, left_out)));
    let blocks = [now].into_iter().chain(warning_blocks(manifest)).collect();
    let mut sections = vec![Section::new("now", "Now", blocks)];
    if !figures.parameters.is_empty() {
        let parameters = serde_json::to_value(&figures.parameters).unwrap_or_default();
        let block = Block::new("set-parameters", Content::Parameters(parameters));
        sections.push(Section::new("set", "Change parameters", vec![block]));
    }
    sections
}

fn now(manifest: &Manifest, figures: &Figures, number: u64, left_out: u64) -> Live {
    let state = figures.final_state.map_or_else(|| "starting".to_owned(), |state: Code<_>| state.to_string());
    let tone = match figures.final_state {
        Some(Code::Known(ControllerState::SafeStop)) => Tone::Bad,
        // The verdict judges whether an end is good.
        Some(Code::Known(ControllerState::Running)) => Tone::Good,
        _ => Tone::Plain,
    };
    let progress = match motion_s(figures) {
        Some(began_s) => {
            let gone_s = (figures.over_time.duration_s - began_s).clamp(0.0, manifest.motion_s);
            format!("{gone_s:.1} s of {:.1} s of the motion", manifest.motion_s)
        }
        None => "The motion has not begun.".to_owned(),
    };
    let missed = figures.controller_skips.skipped + figures.plant_skips.skipped;
    let mut shown = distances(figures);
    shown.push(["cycles".to_owned(), figures.cycles.to_string()]);
    shown.push(["missed".to_owned(), missed.to_string()]);
    if left_out > 0 {
        shown.push(["messages left out of this page".to_owned(), left_out.to_string()]);
    }
    Live { number, state: state.replace('_', " "), tone, progress, figures: shown }
}

#[cfg(test)]
mod tests {
    use masseter_runtime::messages::Event;
    use masseter_runtime::messages::codes::Cause;

    use super::*;

    #[test]
    fn of_each_drive_and_source_the_first_fault_is_told() {
        let fault = |time_ns, source, axis, value| {
            let event = Event::new(source, EventKind::Fault, Cause::ProcessDataLost);
            EventRecord::from(&Event { time_ns, axis, node: axis as u16 + 1, value, ..event })
        };
        let events = vec![
            fault(1_000_000_000, Source::Master, 0, 4.0),
            fault(2_000_000_000, Source::Drive, 0, 5.0),
            fault(3_000_000_000, Source::Drive, 1, 6.0),
            fault(4_000_000_000, Source::Master, 1, 7.0),
            fault(5_000_000_000, Source::Drive, 0, 8.0),
        ];
        let told = first_faults(&Figures { events, ..Figures::default() }).unwrap();
        let Content::Table(Table { rows, .. }) = told.content else { panic!("no table") };
        let row = |name: &str, at_s, words: &str| vec![name.into(), Cell::Time { at_s }, words.into()];
        let words = |axis, node, cycles| {
            format!(
                "process_data_lost (axis {axis} (node {node} on bus 0): process data missing for {cycles} cycles)"
            )
        };
        let expected = [
            row("master", 1.0, &words("d1", 1, 4)),
            row("drive d1", 2.0, &words("d1", 1, 5)),
            row("drive d2", 3.0, &words("d2", 2, 6)),
        ];
        assert_eq!(rows, expected);
        assert_eq!(first_faults(&Figures::default()), None);
    }
}
