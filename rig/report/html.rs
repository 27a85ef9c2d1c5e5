//! `report.html`: one page, no network needed.

use std::fmt::Write;

use super::junit::escape;
use super::plot;
use super::table::{self, in_words};
use crate::analysis::Figures;
use crate::report::verdict::Verdict;
use crate::run::manifest::Manifest;

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;max-width:62rem;margin:2rem auto;padding:0 1rem;color:#222}\
h1{font-size:1.5rem}h2{font-size:1.1rem;margin-top:2rem}table{border-collapse:collapse}\
td,th{padding:.15rem .8rem;border-bottom:1px solid #ddd;text-align:right}\
td:first-child,th:first-child{text-align:left;padding-left:0}\
.verdict{padding:.6rem 1rem;border-left:.5rem solid #b00020;background:#fbeaec}\
.verdict.pass{border-color:#1b7f3b;background:#e9f5ec}svg{max-width:100%;height:auto}code{background:#f3f3f3}";

/// The page.
pub(super) fn of_run(manifest: &Manifest, figures: &Figures, verdict: &Verdict) -> String {
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
    let class = if verdict.word == "PASS" { "verdict pass" } else { "verdict" };
    write!(
        page,
        "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>Masseter: {name}</title>\
         <style>{STYLE}</style>\n<h1>{name}</h1>\n<p class=\"{class}\"><strong>{}</strong>: {}</p>\n",
        verdict.word,
        escape(&verdict.reason)
    )?;
    checks(page, verdict)?;
    motion(page, figures)?;
    latencies(page, figures)?;
    happenings(page, figures)?;
    circumstances(page, manifest)
}

fn checks(page: &mut String, verdict: &Verdict) -> std::fmt::Result {
    page.push_str("<h2>Checks</h2>\n<table>\n");
    for check in &verdict.checks {
        let mark = if check.passed { "ok" } else { "FAILED" };
        writeln!(page, "<tr><td>{}<td>{mark}<td>{}", check.name, escape(&check.finding))?;
    }
    page.push_str("</table>\n");
    Ok(())
}

fn motion(page: &mut String, figures: &Figures) -> std::fmt::Result {
    let tracking = &figures.tracking;
    writeln!(
        page,
        "<h2>Motion</h2>\n<p>Platform, {} against wanted: rms {:.4} mm, max {:.4} mm; rms {:.4}°, max {:.4}°.",
        tracking.reference.adjective(),
        tracking.rms_mm,
        tracking.max_mm,
        tracking.rms_deg,
        tracking.max_deg
    )?;
    if let Some(rms_mm) = tracking.estimate_rms_mm {
        writeln!(page, "Estimated against true: rms {rms_mm:.4} mm.")?;
    }
    page.push_str("</p>\n");
    for svg in plot::of_track(&figures.track).into_iter().flatten() {
        page.push_str(&svg);
    }
    Ok(())
}

fn latencies(page: &mut String, figures: &Figures) -> std::fmt::Result {
    page.push_str("<h2>Latencies, µs</h2>\n<table>\n<tr><th>interval<th>n<th>p50<th>p99<th>p99.9<th>max\n");
    for interval in &figures.intervals {
        writeln!(
            page,
            "<tr><td>{}<td>{}<td>{}<td>{}<td>{}<td>{}",
            interval.name,
            interval.n,
            table::microseconds(interval.p50_ns),
            table::microseconds(interval.p99_ns),
            interval.p999_ns.map_or_else(|| "–".to_owned(), table::microseconds),
            table::microseconds(interval.max_ns),
        )?;
    }
    writeln!(
        page,
        "</table>\n<p>Skipped cycles: controller {}, plant {}; machine stood still: {:.2} ms of the controller's, {:.2} ms of the plant's waiting. \
         p99.9 stands only where there are 10,000 samples. No series is corrected for coordinated omission.</p>",
        figures.controller_skips.skipped,
        figures.plant_skips.skipped,
        figures.controller_skips.stalled_ns as f64 / 1e6,
        figures.plant_skips.stalled_ns as f64 / 1e6
    )?;
    page.push_str("<table>\n<tr><th>topic<th>messages<th>dropped\n");
    for topic in &figures.topics {
        writeln!(page, "<tr><td>{}<td>{}<td>{}", topic.topic, topic.messages, topic.missing)?;
    }
    page.push_str("</table>\n");
    Ok(())
}

fn happenings(page: &mut String, figures: &Figures) -> std::fmt::Result {
    page.push_str("<h2>Events</h2>\n<ul>\n");
    for event in &figures.events {
        writeln!(page, "<li><code>{}</code>", escape(&in_words(event)))?;
    }
    page.push_str("</ul>\n");
    Ok(())
}

fn circumstances(page: &mut String, manifest: &Manifest) -> std::fmt::Result {
    let machine = &manifest.machine;
    writeln!(
        page,
        "<h2>Circumstances</h2>\n<p>{} UTC, masseter {}, {} clock. {}, {} cores, {}.</p>\n\
         <p>The same run again: <code>masseter run scenario.toml --clock {}</code> with the scenario of this folder.</p>",
        escape(manifest.began.trim_end_matches('Z')),
        escape(&manifest.masseter),
        manifest.clock,
        escape(&machine.cpu),
        machine.cores,
        escape(&machine.kernel),
        manifest.clock,
    )?;
    for (name, obtained) in &manifest.scheduling {
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
    Ok(())
}
