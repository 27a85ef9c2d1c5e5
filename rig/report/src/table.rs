//! The report as text for a terminal.

use std::fmt::Write;

use masseter_runtime::messages::codes::{Cause, EventKind};
use masseter_scenario::MotionConfig;
use masseter_scenario::wording::counted;

use crate::full_speed;
use crate::shortfall::whose_motion;
use crate::text::{decimals, event_with_cycle, microseconds, or_dash};
use crate::verdict::Verdict;
use masseter_analysis::{
    BusResponse, EventRecord, Figures, IntervalFigures, PoseErrors, ReadingFigures, ResponseFigures,
    TrackingFigures,
};
use masseter_recording::{Manifest, RunUsage, Usage};
use masseter_terminal::{Exit, Tone};

/// The words that judge.
pub(crate) const TONES: [(&str, Tone); 12] = [
    ("PASS", Tone::Good),
    ("FAIL", Tone::Bad),
    ("UNTESTED", Tone::Doubtful),
    ("INVALID", Tone::Doubtful),
    ("DIED", Tone::Bad),
    ("SAFE STOP", Tone::Bad),
    ("INCOMPLETE", Tone::Bad),
    ("INTERRUPTED", Tone::Doubtful),
    ("ok", Tone::Good),
    ("lost", Tone::Doubtful),
    ("timing: disturbed", Tone::Doubtful),
    ("timing: missed", Tone::Bad),
];

/// How much is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Detail {
    /// Verdict and checks, and the faults of a run that did not pass: at most fifteen lines of one that did.
    Brief,
    /// Every figure.
    Whole,
}

/// Verdict, checks and faults; with every detail also latencies and losses.
pub(crate) fn text(manifest: &Manifest, figures: &Figures, verdict: &Verdict, detail: Detail) -> String {
    let mut text = String::new();
    let mut write = || -> std::fmt::Result {
        write_verdict(&mut text, manifest, figures, verdict)?;
        if detail == Detail::Whole {
            write_figures(&mut text, manifest, figures)?;
        }
        full_speed::write(&mut text, manifest, figures)?;
        write_start(&mut text, figures)?;
        if detail == Detail::Whole || verdict.exit_code != Exit::Passed {
            write_faults(&mut text, figures)?;
        }
        Ok(())
    };
    write().expect("a string takes any text");
    text
}

fn write_verdict(
    text: &mut String,
    manifest: &Manifest,
    figures: &Figures,
    verdict: &Verdict,
) -> std::fmt::Result {
    let scenario = &manifest.scenario;
    writeln!(text, "{}: {}", verdict.word, verdict.reason)?;
    writeln!(text, "timing: {}", verdict.timing)?;
    if let Some(advice) = verdict.advice(manifest) {
        writeln!(text, "  {advice}")?;
    }
    writeln!(
        text,
        "{}{}: {:.1} s of motion at {} Hz ({} clock), {} in {:.1} s of cycle time, seed {}, digest {}",
        scenario.name,
        whose_motion(manifest),
        manifest.motion_s,
        scenario.rate_hz,
        manifest.clock,
        counted(figures.cycles, "cycle"),
        figures.duration_s,
        scenario.seed,
        figures.digest,
    )?;
    if let Some(controller) = &manifest.controller {
        writeln!(text, "controller: {controller}")?;
    }
    if let MotionConfig::File(file) = &scenario.motion {
        writeln!(text, "recording played: {}", file.path.display())?;
    }
    text.push('\n');
    let widest = verdict.checks.iter().map(|check| check.result.mark().len()).max().unwrap_or(0).max(4);
    let names =
        verdict.checks.iter().map(|check| check.name.chars().count()).max().unwrap_or(0).clamp(18, 40);
    for check in &verdict.checks {
        writeln!(text, "  {:<widest$} {:<names$}  {}", check.result.mark(), check.name, check.finding)?;
    }
    Ok(())
}

fn write_figures(text: &mut String, manifest: &Manifest, figures: &Figures) -> std::fmt::Result {
    let tracking = &figures.tracking;
    writeln!(text, "\nplatform, {}", distances(tracking))?;
    if let Some(rms_mm) = tracking.estimate_rms_mm {
        writeln!(text, "platform, estimated against true: rms {rms_mm:.4} mm")?;
    }
    if let Some(most_n) = figures.bite_force_max_n {
        writeln!(text, "bite force: at most {most_n:.1} N")?;
    }
    text.push('\n');
    latencies(text, &figures.intervals)?;
    responses(text, &figures.bus_response)?;
    writeln!(
        text,
        "\nskipped cycles: controller {}, plant {}; stalls of the machine while waiting: controller {:.2} ms, plant {:.2} ms",
        figures.controller_skips.skipped,
        figures.plant_skips.skipped,
        figures.controller_skips.stalled_ns as f64 / 1e6,
        figures.plant_skips.stalled_ns as f64 / 1e6
    )?;
    writeln!(text, "{}", readings(&figures.readings))?;
    usage(text, &manifest.usage)?;
    losses(text, figures)
}

fn latencies(text: &mut String, intervals: &[IntervalFigures]) -> std::fmt::Result {
    writeln!(
        text,
        "{:<28} {:>8} {:>10} {:>10} {:>10} {:>10}",
        "interval, µs", "n", "p50", "p99", "p99.9", "max"
    )?;
    for interval in intervals {
        writeln!(
            text,
            "{:<28} {:>8} {:>10} {:>10} {:>10} {:>10}",
            interval.name,
            interval.n,
            or_dash(interval.p50_ns, microseconds),
            or_dash(interval.p99_ns, microseconds),
            or_dash(interval.p999_ns, microseconds),
            or_dash(interval.max_ns, microseconds),
        )?;
    }
    Ok(())
}

/// Which readings the controller's cycles used.
pub(crate) fn readings(readings: &ReadingFigures) -> String {
    let ReadingFigures { in_time, late, none, before_first } = readings;
    format!(
        "cycles by their reading: {in_time} in time, {late} late, {none} without a fresh one, {before_first} before the first"
    )
}

/// Of each kind of message the one that used most of its bound, or took longest where it has none.
fn responses(text: &mut String, response: &BusResponse) -> std::fmt::Result {
    let measured = response.messages.iter().filter(|message| message.frames > 0);
    let kind = |message: &ResponseFigures| {
        let name = message.message.split(' ').next().unwrap_or_default().to_owned();
        (message.bus, name)
    };
    let mut closest: Vec<&ResponseFigures> = Vec::new();
    for message in measured {
        let rank = |message: &ResponseFigures| (message.share(), message.max_ns);
        match closest.iter_mut().find(|other| kind(other) == kind(message)) {
            Some(other) if rank(message) > rank(other) => *other = message,
            Some(_) => {}
            None => closest.push(message),
        }
    }
    if closest.is_empty() {
        return Ok(());
    }
    writeln!(text, "\n{:<20} {:>4} {:>8} {:>10} {:>10}", "response, µs", "bus", "n", "max", "bound")?;
    for message in closest {
        writeln!(
            text,
            "{:<20} {:>4} {:>8} {:>10} {:>10}",
            message.message,
            message.bus,
            message.frames,
            or_dash(message.max_ns, microseconds),
            or_dash(message.bound_ns, microseconds)
        )?;
    }
    Ok(())
}

/// Distances between actual and desired pose.
pub(crate) fn distances(tracking: &TrackingFigures) -> String {
    let PoseErrors { rms_mm, max_mm, incisal_rms_mm, incisal_max_mm, rms_deg, max_deg } = tracking.actual;
    let [rms_mm, max_mm, incisal_rms_mm, incisal_max_mm, rms_deg, max_deg] =
        [rms_mm, max_mm, incisal_rms_mm, incisal_max_mm, rms_deg, max_deg]
            .map(|value| or_dash(value, decimals));
    format!(
        "{} against desired: rms {rms_mm} mm, max {max_mm} mm; rms {rms_deg}°, max {max_deg}°; incisal point rms \
         {incisal_rms_mm} mm, max {incisal_max_mm} mm",
        tracking.actual_source.adjective()
    )
}

/// CPU time, page faults and stolen time; nothing under virtual time, which has no processes.
fn usage(text: &mut String, usage: &RunUsage) -> std::fmt::Result {
    if usage.processes.is_empty() {
        return Ok(());
    }
    let process = |(name, usage): (&String, &Usage)| {
        let faults = usage.minor_faults + usage.major_faults;
        format!("{name} {:.0} % of a core, {faults} page faults", usage.share() * 100.0)
    };
    let processes: Vec<_> = usage.processes.iter().map(process).collect();
    writeln!(text, "usage: {}; stolen from the machine {:.2} s", processes.join("; "), usage.stolen_s)
}

fn losses(text: &mut String, figures: &Figures) -> std::fmt::Result {
    let topics: Vec<_> = figures
        .topics
        .iter()
        .map(|topic| format!("{} {} ({} dropped)", topic.topic, topic.messages, topic.missing))
        .collect();
    writeln!(text, "messages: {}", topics.join(", "))?;
    let Some(frames) = &figures.frames else {
        return writeln!(text, "frames: not recorded (recording.frames = false)");
    };
    let frames: Vec<_> = frames.iter().enumerate().map(|(bus, n)| format!("can{bus} {n}")).collect();
    writeln!(text, "frames: {}", frames.join(", "))
}

/// What somebody has to know of the start, also of a run that passed.
fn write_start(text: &mut String, figures: &Figures) -> std::fmt::Result {
    let is_of_start = |event: &&EventRecord| {
        [Cause::FaultReset, Cause::WaitsForDrive].into_iter().any(|cause| event.cause == cause)
    };
    let mut events = figures.events.iter().filter(is_of_start).peekable();
    if events.peek().is_some() {
        writeln!(text, "\nstart:")?;
    }
    events.try_for_each(|event| writeln!(text, "  {}", event_with_cycle(event)))
}

fn write_faults(text: &mut String, figures: &Figures) -> std::fmt::Result {
    let faults: Vec<_> = figures.events.iter().filter(|event| event.kind == EventKind::Fault).collect();
    if faults.is_empty() {
        return Ok(());
    }
    writeln!(text, "\nfaults:")?;
    for event in faults {
        writeln!(text, "  {}", event_with_cycle(event))?;
    }
    Ok(())
}
