//! `report.html`: one page, no network needed.

use std::fmt::Write;

use masseter_shared::config::MotionConfig;

use crate::checks::CheckResult;
use crate::outcome::Outcome;
use crate::text::{escape, event_with_cycle, microseconds, or_dash};
use crate::verdict::Verdict;
use crate::{animation, charts, table, time_line, usage};
use masseter_analysis::{BusResponse, Figures, PoseSource, Track};
use masseter_charts::Drawn;
use masseter_recording::Manifest;

const STYLE: &str = include_str!("page/style.css");
const MECHANISM: &str = include_str!("page/mechanism.js");

/// How values are shown that change faster than a chart can tell.
const BANDS: &str = "Each curve touches the lowest and the highest value of every stretch of time.";

/// The page.
pub(crate) fn html(manifest: &Manifest, figures: &Figures, verdict: &Verdict) -> String {
    let mut page = String::new();
    write_page(&mut page, manifest, figures, verdict).expect("a string takes any text");
    page
}

fn write_page(
    page: &mut String,
    manifest: &Manifest,
    figures: &Figures,
    verdict: &Verdict,
) -> std::fmt::Result {
    let name = escape(&manifest.scenario.name);
    let class = if verdict.outcome == Outcome::Pass { "pass" } else { "" };
    write!(
        page,
        "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>Masseter: {name}</title>\
         <style>{STYLE}</style>\n<h1>{name}</h1>\n<p id=\"verdict\" class=\"{class}\"><strong>{}</strong>: {}</p>\n",
        verdict.outcome.word(),
        escape(&verdict.reason)
    )?;
    checks(page, verdict)?;
    mechanism(page, manifest, figures)?;
    motion(page, figures)?;
    actuators(page, manifest, figures)?;
    latencies(page, manifest, figures)?;
    worst_cycles(page, figures)?;
    messages(page, figures)?;
    events(page, figures)?;
    circumstances(page, manifest)
}

fn checks(page: &mut String, verdict: &Verdict) -> std::fmt::Result {
    page.push_str("<h2>Checks</h2>\n<table id=\"checks\">\n");
    for check in &verdict.checks {
        let class = if check.result == CheckResult::Failed { "failed" } else { "" };
        let finding = escape(&check.finding);
        writeln!(page, "<tr><td>{}<td class=\"{class}\">{}<td>{finding}", check.name, check.result.mark())?;
    }
    page.push_str("</table>\n");
    Ok(())
}

/// The 3-D view with its data and its program.
fn mechanism(page: &mut String, manifest: &Manifest, figures: &Figures) -> std::fmt::Result {
    let Some(animation) = animation::json(&manifest.scenario, figures) else { return Ok(()) };
    let outlines = outlines(figures.tracking.actual_source);
    let extent = extent(&figures.track);
    // JSON of numbers and fixed names holds no `<` that could end the element.
    writeln!(
        page,
        "<h2>Mechanism</h2>\n<canvas id=\"mechanism\" width=\"1200\" height=\"640\"></canvas>\n\
         <p><button id=\"play\">pause</button> <input id=\"time\" type=\"range\" min=\"0\" max=\"1\" step=\"any\" value=\"0\"> \
         <span id=\"clock\"></span><br>Platform: {outlines}; \
         <span style=\"color:#b00020\">incisal point and condyles</span>. {extent}Drag to turn.</p>\n\
         <script type=\"application/json\" id=\"film\">{animation}</script>\n<script>\n{MECHANISM}</script>"
    )
}

/// How much of a motion the film shows, where that is not all.
fn extent(track: &Track) -> String {
    let (Some(first), Some(last)) = (track.samples.first(), track.samples.last()) else {
        return String::new();
    };
    let shown_s = last.sampled_ns.saturating_sub(first.sampled_ns) as f64 / 1e9;
    // The last sample of a whole film may stand some cycles before the end.
    if track.duration_s - shown_s < 0.1 {
        return String::new();
    }
    format!("The first {shown_s:.1} s of {:.1} s. ", track.duration_s)
}

/// What the platform's outlines stand for.
fn outlines(source: PoseSource) -> String {
    let found = format!("<span style=\"color:#0072b2\">{}</span>", source.adjective());
    let estimated = match source {
        PoseSource::Truth => ", <span style=\"color:#d55e00\">estimated (dashed)</span>",
        PoseSource::Estimate => "",
    };
    format!("{found}{estimated}, <span style=\"color:#009e73\">wanted (dotted)</span>")
}

/// A plot under an id, with what did not fit into it; or why there is none.
fn plot(page: &mut String, id: &str, drawn: Option<Drawn>, otherwise: &str) -> std::fmt::Result {
    let Some(Drawn { svg, beyond }) = drawn else {
        return writeln!(page, "<p id=\"{id}\">{otherwise}</p>");
    };
    writeln!(page, "<div id=\"{id}\">{svg}</div>")?;
    if !beyond.is_empty() {
        let limits: Vec<_> =
            beyond.iter().map(|limit| format!("{} {:.0?}", limit.name, limit.values)).collect();
        writeln!(page, "<p>Limits far beyond the curves: {}.</p>", escape(&limits.join(", ")))?;
    }
    Ok(())
}

fn motion(page: &mut String, figures: &Figures) -> std::fmt::Result {
    let tracking = &figures.tracking;
    writeln!(page, "<h2>Motion</h2>\n<p>Platform, {}.", table::distances(tracking))?;
    if let Some(rms_mm) = tracking.estimate_rms_mm {
        writeln!(page, "Estimated against true: rms {rms_mm:.4} mm.")?;
    }
    if let Some(most_n) = figures.bite_force_max_n {
        writeln!(page, "Bite force: at most {most_n:.1} N.")?;
    }
    writeln!(page, "{BANDS}</p>")?;
    let [displacement, error] = charts::motion(figures);
    plot(page, "motion", displacement, "Nothing moved.")?;
    plot(page, "error", error, "Nothing moved.")
}

fn actuators(page: &mut String, manifest: &Manifest, figures: &Figures) -> std::fmt::Result {
    writeln!(page, "<h2>Actuators</h2>\n<p>{BANDS}</p>")?;
    let ids = ["slides", "legs", "velocities", "forces"];
    for (id, drawn) in ids.iter().zip(charts::actuators(&manifest.scenario, figures)) {
        plot(page, id, drawn, "The recording holds no truth.")?;
    }
    Ok(())
}

fn latencies(page: &mut String, manifest: &Manifest, figures: &Figures) -> std::fmt::Result {
    page.push_str("<h2>Latencies, µs</h2>\n<table>\n<tr><th>interval<th>n<th>p50<th>p99<th>p99.9<th>max\n");
    for interval in &figures.intervals {
        writeln!(
            page,
            "<tr><td>{}<td>{}<td>{}<td>{}<td>{}<td>{}",
            interval.name,
            interval.n,
            or_dash(interval.p50_ns, microseconds),
            or_dash(interval.p99_ns, microseconds),
            or_dash(interval.p999_ns, microseconds),
            or_dash(interval.max_ns, microseconds),
        )?;
    }
    writeln!(
        page,
        "</table>\n<p>Skipped cycles: controller {}, plant {}; machine stood still: {:.2} ms of the controller's, {:.2} ms of the plant's waiting. \
         Controller's {}.</p>\n\
         <p>p99.9 stands only where there are 10,000 samples. A skipped deadline has no sample, but in the two wake-ups \
         named corrected (for coordinated omission): there it counts with the time until the wake-up that skipped it.</p>",
        figures.controller_skips.skipped,
        figures.plant_skips.skipped,
        figures.controller_skips.stalled_ns as f64 / 1e6,
        figures.plant_skips.stalled_ns as f64 / 1e6,
        table::readings(&figures.readings),
    )?;
    plot(page, "percentiles", charts::percentiles(&manifest.scenario, figures), "No interval was measured.")?;
    plot(page, "jitter", charts::jitter(figures), "Under virtual time nobody is late.")
}

/// The longest cycles, with what made them so.
fn worst_cycles(page: &mut String, figures: &Figures) -> std::fmt::Result {
    page.push_str(
        "<h2>Longest cycles, µs</h2>\n<p>From the plant's deadline to the command on the wire, or to the first later one \
         where that was overtaken; the hop furthest above its median; and what the kernel counted between two looks, a \
         tenth of a second apart: time that the hypervisor took (in steps of 10 ms), times that a loop lost its core, and \
         page faults of both processes.</p>\n\
         <table id=\"worst\">\n<tr><th>cycle<th>at, s<th>took<th>hop to blame<th>it took<th>its median\
         <th>machine stood still<th>stolen around<th>preempted<th>page faults\n",
    );
    for worst in &figures.worst_cycles {
        writeln!(
            page,
            "<tr><td>{}<td>{:.3}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}",
            worst.cycle,
            worst.due_ns.saturating_sub(figures.over_time.began_ns) as f64 / 1e9,
            microseconds(worst.total_ns),
            worst.hop.name(),
            microseconds(worst.hop_ns),
            microseconds(worst.hop_p50_ns),
            microseconds(worst.stalled_ns),
            or_dash(worst.around.stolen_ns, microseconds),
            or_dash(worst.around.involuntary_switches, |count| count.to_string()),
            or_dash(worst.around.page_faults, |count| count.to_string()),
        )?;
    }
    page.push_str("</table>\n");
    Ok(())
}

fn messages(page: &mut String, figures: &Figures) -> std::fmt::Result {
    page.push_str("<h2>Messages and buses</h2>\n<table>\n<tr><th>topic<th>messages<th>dropped\n");
    for topic in &figures.topics {
        writeln!(page, "<tr><td>{}<td>{}<td>{}", topic.topic, topic.messages, topic.missing)?;
    }
    page.push_str("</table>\n");
    plot(page, "buses", charts::bus_load(figures), "No frame was recorded.")?;
    responses(page, &figures.bus_response)
}

/// Measured response times beside the bounds of the plan.
fn responses(page: &mut String, response: &BusResponse) -> std::fmt::Result {
    page.push_str(
        "<p>From being queued to the end of the frame, beside the worst case of the plan, µs.</p>\n\
         <table id=\"responses\">\n<tr><th>bus<th>message<th>n<th>max<th>bound\n",
    );
    for message in &response.messages {
        let [max, bound] = [message.max_ns, message.bound_ns].map(|ns| or_dash(ns, microseconds));
        let class = if message.exceeds() { "failed" } else { "" };
        writeln!(
            page,
            "<tr><td>{}<td>{}<td>{}<td class=\"{class}\">{max}<td>{bound}",
            message.bus, message.message, message.frames
        )?;
    }
    page.push_str("</table>\n");
    if let Some(why) = &response.unbounded {
        writeln!(page, "<p>No bounds hold for this run: {}.</p>", escape(why))?;
    }
    Ok(())
}

fn events(page: &mut String, figures: &Figures) -> std::fmt::Result {
    let time_line = time_line::svg(figures).unwrap_or_else(|| "Nothing happened.".to_owned());
    write!(page, "<h2>Events</h2>\n<div id=\"events\">{time_line}</div>\n<ul>\n")?;
    for event in &figures.events {
        writeln!(page, "<li><code>{}</code>", escape(&event_with_cycle(event)))?;
    }
    page.push_str("</ul>\n");
    Ok(())
}

fn circumstances(page: &mut String, manifest: &Manifest) -> std::fmt::Result {
    let machine = &manifest.machine;
    let clock = escape(&manifest.clock);
    writeln!(
        page,
        "<h2 id=\"circumstances\">Circumstances</h2>\n<p>{} UTC, masseter {}, {clock} clock. {}, {} cores, {}.</p>\n\
         <p>The same run again: <code>masseter run scenario.toml --clock {clock}</code> with the scenario of this folder.</p>",
        escape(manifest.began.trim_end_matches('Z')),
        escape(&manifest.masseter),
        escape(&machine.cpu),
        machine.cores,
        escape(&machine.kernel),
    )?;
    if let MotionConfig::File(file) = &manifest.scenario.motion {
        writeln!(
            page,
            "<p>Recording played: <code>{}</code>.</p>",
            escape(&file.path.display().to_string())
        )?;
    }
    for (name, obtained) in &manifest.scheduling {
        let name = escape(name);
        let core = obtained.core.map_or_else(|| "any core".to_owned(), |core| format!("core {core}"));
        let policy = obtained
            .fifo_priority
            .map_or_else(|| "ordinary scheduling".to_owned(), |priority| format!("SCHED_FIFO {priority}"));
        let memory = if obtained.locked_memory { "locked memory" } else { "pageable memory" };
        writeln!(page, "<p>{name}: {core}, {policy}, {memory}.</p>")?;
        for refusal in &obtained.refusals {
            writeln!(page, "<p>{name}: {}</p>", escape(refusal))?;
        }
    }
    usage::page_table(page, &manifest.usage)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_truth_nothing_is_called_true() {
        assert!(outlines(PoseSource::Truth).contains("true"));
        assert!(!outlines(PoseSource::Estimate).contains("true"));
    }
}
