//! CPU time, page faults and stolen time, as a line of the table and as a table of the page.

use std::fmt::Write;

use crate::text::escape;
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

/// A table for the page.
pub(crate) fn page_table(page: &mut String, usage: &RunUsage) -> std::fmt::Result {
    if usage.processes.is_empty() {
        return Ok(());
    }
    page.push_str(
        "<table id=\"usage\">\n<tr><th>process, in its steady state<th>CPU, % of a core\
         <th>waits<th>times its core was taken<th>page faults, memory<th>page faults, disk\n",
    );
    for (name, usage) in &usage.processes {
        let Usage { voluntary_switches, involuntary_switches, minor_faults, major_faults, .. } = usage;
        let (name, share) = (escape(name), share(usage) * 100.0);
        writeln!(
            page,
            "<tr><td>{name}<td>{share:.1}<td>{voluntary_switches}<td>{involuntary_switches}<td>{minor_faults}\
             <td>{major_faults}"
        )?;
    }
    writeln!(
        page,
        "</table>\n<p>Stolen from the machine by its hypervisor, as far as it tells: {:.2} s.</p>",
        usage.stolen_s
    )
}

/// CPU time over the time observed; 0 when nothing was.
fn share(usage: &Usage) -> f64 {
    if usage.observed_s > 0.0 { usage.cpu_s / usage.observed_s } else { 0.0 }
}
