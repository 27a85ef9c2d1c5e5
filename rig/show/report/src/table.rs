//! The report as text for a terminal.

use std::{fmt::Write, path::Path};

use masseter_judge::{
    AxisFigures, BiteEstimateFigures, BusResponse, EventRecord, Figures, IntervalFigures, PoseErrors,
    ReadingFigures, ResponseFigures, TopicFigures, TrackingFigures, Verdict, whose_motion,
};
use masseter_model::geometry::AXIS_NAMES;
use masseter_recording::{Manifest, RunUsage, Usage};
use masseter_runtime::messages::codes::{Cause, EventKind};
use masseter_scenario::{MotionConfig, wording::counted};
use masseter_terminal::{Exit, Tone};

use crate::text::{self, decimals, or_dash, us};

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

/// The verdict on function and timing, and what to do next with the run in this folder.
pub(crate) fn verdict_in_words(verdict: &Verdict, folder: &Path) -> String {
    let advice = verdict.advice().map_or_else(String::new, |advice| format!("  {advice}\n"));
    let next = verdict.next_step_in(&folder.display().to_string());
    let next = next.map_or_else(String::new, |next| format!("next: {next}\n"));
    format!("{}: {}\n{next}timing: {}\n{advice}", verdict.word, verdict.in_words(), verdict.timing)
}

/// Checks and faults; with every detail also latencies and losses.
pub(crate) fn table_in_words(
    manifest: &Manifest,
    figures: &Figures,
    verdict: &Verdict,
    detail: Detail,
) -> String {
    let mut text = String::new();
    let mut write = || -> std::fmt::Result {
        write_checks(&mut text, manifest, figures, verdict)?;
        if detail == Detail::Whole {
            write_figures(&mut text, manifest, figures)?;
        }
        write_full_speed(&mut text, manifest, figures)?;
        // What somebody has to know of the start, also of a run that passed.
        list_events(&mut text, figures, "start", |event| {
            [Cause::FaultReset, Cause::WaitsForDrive].into_iter().any(|cause| event.cause == cause)
        })?;
        if detail == Detail::Whole || verdict.exit_code != Exit::Passed {
            // The reason has the first fault.
            let is_told = |event: &EventRecord| verdict.reason.contains(&event.in_words());
            list_events(&mut text, figures, "faults", |event| {
                event.kind == EventKind::Fault && !is_told(event)
            })?;
        }
        Ok(())
    };
    write().expect("a string takes any text");
    text
}

fn write_checks(
    text: &mut String,
    manifest: &Manifest,
    figures: &Figures,
    verdict: &Verdict,
) -> std::fmt::Result {
    let scenario = &manifest.scenario;
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
    for warning in &verdict.warnings {
        writeln!(text, "warning: {warning}")?;
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
    if let Some(estimate) = &figures.bite_estimate {
        writeln!(text, "bite force, estimated: {}", estimated(estimate))?;
    }
    let heads = ["interval, µs", "n", "p50", "p99", "p99.9", "max"];
    let latencies = text::table([28, 8, 10, 10, 10, 10], heads, figures.intervals.iter().map(latency));
    write!(text, "\n{latencies}{}", responses(&figures.bus_response))?;
    writeln!(text, "\nskipped {}\n{}", skips(figures), readings(&figures.readings))?;
    usage(text, &manifest.usage)?;
    losses(text, figures)
}

/// The estimate of the bite force with its uncertainty.
pub(crate) fn estimated(estimate: &BiteEstimateFigures) -> String {
    let BiteEstimateFigures { error_rms_n, uncertainty_median_n, covered, phantom_n, .. } = estimate;
    let phantom = phantom_n.map_or_else(String::new, |most_n| {
        format!("; without contact below {most_n:.1} N in 95 % of the cycles")
    });
    let share = covered * 100.0;
    format!(
        "error {error_rms_n:.1} N rms, stated ± {uncertainty_median_n:.1} N (median), which covers {share:.1} % of the cycles{phantom}"
    )
}

/// Name, number of samples, median, 99 %, 99.9 % and greatest of an interval, µs.
pub(crate) fn latency(interval: &IntervalFigures) -> [String; 6] {
    let IntervalFigures { name, n, p50_ns, p99_ns, p999_ns, max_ns, .. } = interval;
    let [p50, p99, p999, max] = [*p50_ns, *p99_ns, *p999_ns, *max_ns].map(us);
    [(*name).to_owned(), n.to_string(), p50, p99, p999, max]
}

/// Cycles that the loops skipped, and stalls of the machine.
pub(crate) fn skips(figures: &Figures) -> String {
    let [controller, plant] = [&figures.controller_skips, &figures.plant_skips];
    format!(
        "cycles: controller {}, plant {}; stalls of the machine while waiting: controller {:.2} ms, plant {:.2} ms",
        controller.skipped,
        plant.skipped,
        controller.stalled_ns as f64 / 1e6,
        plant.stalled_ns as f64 / 1e6
    )
}

/// Which readings the controller's cycles used.
pub(crate) fn readings(readings: &ReadingFigures) -> String {
    let ReadingFigures { in_time, late, none, before_first } = readings;
    format!(
        "cycles by their reading: {in_time} in time, {late} late, {none} without a fresh one, {before_first} before the first"
    )
}

/// Of each kind of message the one that used most of its bound, or took longest where it has none; nothing without any.
fn responses(response: &BusResponse) -> String {
    const WIDTHS: [usize; 5] = [20, 4, 8, 10, 10];
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
        return String::new();
    }
    let rows = closest.into_iter().map(|ResponseFigures { bus, message, frames, max_ns, bound_ns }| {
        let [max, bound] = [*max_ns, *bound_ns].map(us);
        [message.clone(), bus.to_string(), frames.to_string(), max, bound]
    });
    "\n".to_owned() + &text::table(WIDTHS, ["response, µs", "bus", "n", "max", "bound"], rows)
}

/// Distances between actual and desired pose.
pub(crate) fn distances(tracking: &TrackingFigures) -> String {
    let PoseErrors { rms_mm, max_mm, incisal_rms_mm, incisal_max_mm, rms_deg, max_deg, .. } = tracking.actual;
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
    let topic =
        |topic: &TopicFigures| format!("{} {} ({} dropped)", topic.topic, topic.messages, topic.missing);
    let topics: Vec<_> = figures.topics.iter().map(topic).collect();
    writeln!(text, "messages: {}", topics.join(", "))?;
    let Some(frames) = &figures.frames else {
        return writeln!(text, "frames: not recorded (recording.frames = false)");
    };
    let frames: Vec<_> = frames.iter().enumerate().map(|(bus, n)| format!("can{bus} {n}")).collect();
    writeln!(text, "frames: {}", frames.join(", "))
}

/// The events that `is_listed`, below a heading, by the time of the motion where it began; nothing without any.
fn list_events(
    text: &mut String,
    figures: &Figures,
    heading: &str,
    is_listed: impl Fn(&EventRecord) -> bool,
) -> std::fmt::Result {
    let mut events = figures.events.iter().filter(|event| is_listed(event)).peekable();
    if events.peek().is_some() {
        writeln!(text, "\n{heading}:")?;
    }
    let over_time = &figures.over_time;
    let zero_ns = over_time.motion_began_ns.unwrap_or_else(|| over_time.began_ns());
    events.try_for_each(|event| {
        let at_s = (event.time_ns as f64 - zero_ns as f64) / 1e9;
        writeln!(text, "  {at_s:>8.3} s  {}", event.in_words())
    })
}

/// The table; nothing of a run that is no dry one.
pub(crate) fn write_full_speed(
    text: &mut String,
    manifest: &Manifest,
    figures: &Figures,
) -> std::fmt::Result {
    const WIDTHS: [usize; 7] = [4, 15, 15, 17, 17, 11, 19];
    let scenario = &manifest.scenario;
    let (dry, Some(planned)) = (scenario.dry, manifest.full_speed) else { return Ok(()) };
    let limits = scenario.limits.within(&scenario.drives);
    let percent = dry.speed * 100.0;
    writeln!(text, "\nat full speed, predicted from this run at {percent:.0} % (limit in brackets):")?;
    let heads = [
        "axis",
        "velocity, m/s",
        "acc., m/s²",
        "following, µm",
        "force slow, N",
        "mass, kg",
        "TPDO1 here, µs",
    ];
    let rows = AXIS_NAMES.into_iter().enumerate().map(|(axis, name)| {
        let AxisFigures { following_error_m, force_n } = figures.axes[axis];
        let (velocity_m_s, acceleration_m_s2) = (planned.velocity_m_s[axis], planned.acceleration_m_s2[axis]);
        let most_n = scenario.drives.of_axis(axis).max_force_n;
        let most_m_s = limits.velocity_m_s(axis);
        let most_m_s2 = limits.acceleration_m_s2(axis);
        let following_um = following_error_m / dry.speed * 1e6;
        let most_um = scenario.can.following_limit_m * 1e6;
        [
            name.to_owned(),
            format!("{velocity_m_s:.3} ({most_m_s:.3})"),
            format!("{acceleration_m_s2:.2} ({most_m_s2:.1})"),
            format!("{following_um:.1} ({most_um:.1})"),
            format!("{force_n:.1} ({most_n:.0})"),
            format!("{:.1}", (most_n - force_n).max(0.0) / acceleration_m_s2),
            process_data(figures, scenario.can.node_ids[axis]),
        ]
    });
    text.push_str(&text::table(WIDTHS, heads, rows));
    writeln!(
        text,
        "  following: if it grows with the velocity; mass: what the rest of the force accelerates, compare it with what the \
         axis moves"
    )
}

/// Longest response of a drive's process data, and its bound by the plan of the bus. Neither depends on the speed.
fn process_data(figures: &Figures, node: u8) -> String {
    let name = format!("TPDO1 {node}");
    let response = figures.bus_response.messages.iter().find(|response| response.message == name);
    or_dash(response, |response| format!("{} ({})", us(response.max_ns), us(response.bound_ns)))
}
