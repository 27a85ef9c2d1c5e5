//! Looks at what the kernel counts of the machine and of both loops: what makes a cycle long is often not in the rig.

use masseter_shared::messages::{LAYOUT_VERSION, Machine};

use crate::machine::SystemRoot;
use crate::machine::counters::{ProcessCounters, stolen_ns};

/// From one look to the next, ns.
const EVERY_NS: u64 = 100_000_000;

/// Looks from time to time.
#[derive(Debug)]
pub(super) struct MachineWatch {
    root: SystemRoot,
    /// Process ids of controller and plant.
    loops: [u32; 2],
    next_ns: u64,
    looks: u64,
}

impl MachineWatch {
    /// Of these two processes, from `start_ns` on.
    pub(super) fn new(root: SystemRoot, loops: [u32; 2], start_ns: u64) -> Self {
        Self { root, loops, next_ns: start_ns, looks: 0 }
    }

    /// What the kernel tells, if it is time to look; nothing once one of the processes is gone.
    pub(super) fn look(&mut self, now_ns: u64) -> Option<Machine> {
        if now_ns < self.next_ns {
            return None;
        }
        self.next_ns = now_ns + EVERY_NS;
        let [controller, plant] = self.loops.map(|id| ProcessCounters::of(&self.root, id, now_ns));
        let loops = [controller?, plant?];
        self.looks += 1;
        Some(Machine {
            seq: self.looks,
            published_ns: now_ns,
            version: LAYOUT_VERSION,
            time_ns: now_ns,
            stolen_ns: stolen_ns(&self.root).unwrap_or(0),
            involuntary_switches: loops.map(|counters| counters.involuntary_switches),
            page_faults: loops.map(|counters| counters.minor_faults + counters.major_faults),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::fixture::Fixture;

    #[test]
    fn a_look_tells_what_the_kernel_counts_of_both_loops_until_one_is_gone() {
        let status =
            |switches| format!("voluntary_ctxt_switches:\t9\nnonvoluntary_ctxt_switches:\t{switches}\n");
        let stat = |id, faults| format!("{id} (masseter) S 1 7 7 0 -1 4194304 {faults} 0 1 0 11 5 0 0 20 0");
        let files = [
            ("proc/7/status", status(3)),
            ("proc/7/stat", stat(7, 100)),
            ("proc/8/status", status(4)),
            ("proc/8/stat", stat(8, 200)),
            ("proc/stat", "cpu  1 2 3 4 5 6 7 25 0 0\n".to_owned()),
        ];
        let files: Vec<_> = files.iter().map(|(path, text)| (*path, text.as_str())).collect();
        let fixture = Fixture::of(&files);
        let mut watch = MachineWatch::new(fixture.root(), [7, 8], 1000);
        assert_eq!(watch.look(999), None);
        let looked = watch.look(1000).unwrap();
        assert_eq!((looked.seq, looked.time_ns, looked.stolen_ns), (1, 1000, 250_000_000));
        assert_eq!((looked.involuntary_switches, looked.page_faults), ([3, 4], [101, 201]));
        assert_eq!(watch.look(1001), None);
        let mut watch = MachineWatch::new(fixture.root(), [7, 9], 0);
        assert_eq!(watch.look(1000), None);
    }
}
