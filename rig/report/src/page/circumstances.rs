//! Machine, scheduling and what else a run happened under.

use masseter_page::{Block, Cell, Column, Section, Table};
use masseter_recording::{Manifest, Usage};
use masseter_runtime::realtime::scheduling::Obtained;
use masseter_scenario::MotionConfig;

pub(super) fn section(manifest: &Manifest) -> Section {
    let text = |id: &str, text: String| Block::text(id, text);
    let machine = &manifest.machine;
    let mut blocks = vec![
        text(
            "machine",
            format!(
                "{} UTC, masseter {}, {} clock. {}, {} cores, {}.",
                manifest.began.trim_end_matches('Z').replace('T', " "),
                manifest.masseter,
                manifest.clock,
                machine.cpu,
                machine.cores,
                machine.kernel
            ),
        ),
        text(
            "again",
            format!(
                "The same run again: `masseter run scenario.toml --clock {}` with the scenario of this folder.",
                manifest.clock
            ),
        ),
    ];
    if let MotionConfig::File(file) = &manifest.scenario.motion {
        blocks.push(text("played", format!("Recording played: `{}`.", file.path.display())));
    }
    for (process, obtained) in &manifest.scheduling {
        blocks.push(text(&format!("scheduling-{process}"), scheduling(process, obtained)));
    }
    if !manifest.usage.processes.is_empty() {
        blocks.push(Block::table("usage", usage(manifest)));
        blocks.push(text(
            "stolen",
            format!(
                "Stolen from the machine by its hypervisor, as far as it reports that: {:.2} s.",
                manifest.usage.stolen_s
            ),
        ));
    }
    Section::new("circumstances", "Circumstances", blocks)
}

fn scheduling(process: &str, obtained: &Obtained) -> String {
    let core = obtained.core.map_or_else(|| "any core".to_owned(), |core| format!("core {core}"));
    let policy = obtained
        .fifo_priority
        .map_or_else(|| "ordinary scheduling".to_owned(), |priority| format!("SCHED_FIFO {priority}"));
    let memory = if obtained.locked_memory { "locked" } else { "pageable" };
    let refusals = obtained.refusals.iter().map(|refusal| format!(" {refusal}"));
    format!("{process}: {core}, {policy}, {memory} memory.{}", refusals.collect::<String>())
}

fn usage(manifest: &Manifest) -> Table {
    let row = |(process, usage): (&String, &Usage)| -> Vec<Cell> {
        let cells = [
            process.clone(),
            format!("{:.1}", usage.share() * 100.0),
            usage.voluntary_switches.to_string(),
            usage.involuntary_switches.to_string(),
            usage.minor_faults.to_string(),
            usage.major_faults.to_string(),
        ];
        cells.map(Cell::from).into()
    };
    let numbers =
        ["CPU, % of a core", "waits", "times its core was taken", "page faults, memory", "page faults, disk"];
    Table {
        label: "Resources of the processes in their steady state".to_owned(),
        columns: [Column::text("process, in its steady state")]
            .into_iter()
            .chain(numbers.map(Column::number))
            .collect(),
        rows: manifest.usage.processes.iter().map(row).collect(),
    }
}
