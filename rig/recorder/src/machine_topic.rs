//! The topic `machine`: the kernel's counters of the machine and of both loops, ten times a second.

use masseter_runtime::messages::{LAYOUT_VERSION, Machine};

use masseter_machine::sampler::Sample;

/// Time between two messages, ns.
pub(super) const INTERVAL_NS: u64 = 100_000_000;

/// The message of a sample of controller and plant; none once one of them has ended.
pub(super) fn message(seq: u64, sample: &Sample) -> Option<Machine> {
    let [Some(controller), Some(plant)] = sample.processes[..] else { return None };
    let loops = [controller, plant];
    Some(Machine {
        seq,
        published_ns: sample.time_ns,
        version: LAYOUT_VERSION,
        time_ns: sample.time_ns,
        stolen_ns: sample.stolen_ns.unwrap_or(0),
        involuntary_switches: loops.map(|counters| counters.involuntary_switches),
        page_faults: loops.map(|counters| counters.minor_faults + counters.major_faults),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use masseter_machine::counters::ProcessCounters;

    #[test]
    fn a_message_holds_the_counters_of_both_loops_while_both_run() {
        let counters = |involuntary_switches, minor_faults| ProcessCounters {
            cpu_ns: 5,
            voluntary_switches: 9,
            involuntary_switches,
            minor_faults,
            major_faults: 1,
        };
        let processes = vec![Some(counters(3, 100)), Some(counters(4, 200))];
        let mut sample = Sample { time_ns: 1000, stolen_ns: Some(25), processes };
        let machine = message(2, &sample).unwrap();
        assert_eq!((machine.seq, machine.time_ns, machine.stolen_ns), (2, 1000, 25));
        assert_eq!((machine.involuntary_switches, machine.page_faults), ([3, 4], [101, 201]));
        sample.processes[1] = None;
        assert_eq!(message(3, &sample), None);
    }
}
