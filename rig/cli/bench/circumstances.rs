//! The machine of a bench, its two cores, and the scheduling that the kernel grants there.

use std::collections::BTreeSet;

use anyhow::ensure;
use masseter_recording::MachineInfo;
use masseter_runtime::realtime::scheduling::{Obtained, usable_cores};
use masseter_terminal::status;
use serde::Serialize;

use super::args::Kind;
use super::durations::realtime_on;

/// Written with the results.
#[derive(Debug, Serialize)]
pub(super) struct Circumstances {
    machine: MachineInfo,
    cores: [usize; 2],
    /// Of a thread on each core.
    scheduling: [Obtained; 2],
}

impl Circumstances {
    /// Asks the kernel as every round does, and prints its refusals.
    pub(super) fn on(cores: [usize; 2]) -> Self {
        let scheduling = cores.map(|core| {
            std::thread::spawn(move || realtime_on(core)).join().expect("asking the kernel does not panic")
        });
        let refusals: BTreeSet<_> = scheduling.iter().flat_map(|obtained| &obtained.refusals).collect();
        for refusal in refusals {
            status!("  {refusal}");
        }
        Self { machine: masseter_machine::describe(), cores, scheduling }
    }
}

/// Refuses cores on which a bench could not end: two threads that poll at real-time priority need a core each.
pub(super) fn check_cores(kinds: &[Kind], cores: [usize; 2]) -> anyhow::Result<()> {
    check(kinds, cores, &usable_cores())
}

fn check(kinds: &[Kind], [own, peer]: [usize; 2], allowed: &[usize]) -> anyhow::Result<()> {
    let named = allowed.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
    ensure!(
        kinds.iter().all(|kind| matches!(kind, Kind::Loop | Kind::Virtual))
            || own != peer && [own, peer].iter().all(|core| allowed.contains(core)),
        "bench rate and simulated need two cores: choose two among {named} with --cores; 'masseter doctor' shows how to allow \
         other cores. bench loop and virtual need one"
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_sides_need_two_cores_that_may_be_used() {
        let refusal =
            |kind, cores, allowed: &[usize]| check(&[kind], cores, allowed).err().map(|e| e.to_string());
        assert_eq!(refusal(Kind::Rate, [0, 1], &[0, 1]), None);
        for kind in [Kind::Loop, Kind::Virtual] {
            assert_eq!(refusal(kind, [0, 0], &[0]), None, "one side needs one");
        }
        for (kind, cores, allowed, choice) in [
            (Kind::Rate, [0, 1], &[3][..], "among 3 with"),
            (Kind::Rate, [1, 1], &[0, 1], "among 0, 1 with"),
            (Kind::Rate, [0, 4], &[0, 1], "among 0, 1 with"),
        ] {
            let refusal = refusal(kind, cores, allowed).unwrap();
            assert!(refusal.contains(choice), "{refusal}");
        }
    }
}
