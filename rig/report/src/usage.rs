//! CPU time, page faults and stolen time, as a line of the table and as a table of the page.

use std::fmt::Write;

use masseter_recording::{RunUsage, Usage};

/// A line for the terminal; nothing under virtual time, which has no processes.
pub(crate) fn line(text: &mut String, usage: &RunUsage) -> std::fmt::Result {
    if usage.processes.is_empty() {
        return Ok(());
    }
    let process = |(name, usage): (&String, &Usage)| {
        let faults = usage.minor_faults + usage.major_faults;
        format!("{name} {:.0} % of a core, {faults} page faults", share(usage) * 100.0)
    };
    let processes: Vec<_> = usage.processes.iter().map(process).collect();
    writeln!(text, "usage: {}; stolen from the machine {:.2} s", processes.join("; "), usage.stolen_s)
}

/// Rows of the page's table; none under virtual time.
pub(crate) fn rows(usage: &RunUsage) -> Vec<[String; 6]> {
    let row = |(name, usage): (&String, &Usage)| {
        let Usage { voluntary_switches, involuntary_switches, minor_faults, major_faults, .. } = usage;
        let [waits, taken, memory, disk] =
            [voluntary_switches, involuntary_switches, minor_faults, major_faults].map(u64::to_string);
        [name.clone(), format!("{:.1}", share(usage) * 100.0), waits, taken, memory, disk]
    };
    usage.processes.iter().map(row).collect()
}

/// CPU time over the time observed; 0 when nothing was.
fn share(usage: &Usage) -> f64 {
    if usage.observed_s > 0.0 { usage.cpu_s / usage.observed_s } else { 0.0 }
}
