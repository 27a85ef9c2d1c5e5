//! The cores: number, frequency governor, idle states, virtualisation.

use std::env;
use std::fs::OpenOptions;

use masseter_runtime::realtime::scheduling::usable_cores;

use super::container::{on_host, start_with};
use super::finding::Finding;
use masseter_machine::{SystemRoot, dma_latency, is_virtual};

/// Longest exit latency of an idle state that the loops' spin covers, µs.
const LATEST_EXIT_US: i64 = 200;

/// All findings of this family.
pub(super) fn examine(root: &SystemRoot) -> Vec<Finding> {
    // Whether runs may disable idle states.
    let may_hold = OpenOptions::new().write(true).open(dma_latency::DEVICE).is_ok();
    vec![
        number(root, usable_cores().len(), &root.online_cores()),
        governor(root),
        idle(root, may_hold),
        hypervisor(root),
    ]
}

fn number(root: &SystemRoot, usable: usize, online: &[usize]) -> Finding {
    const CHECK: &str = "cores";
    let found = format!("{usable} of {} usable", online.len());
    match (usable, online) {
        (2.., _) => Finding::ok(CHECK, found),
        (_, [one, other, ..]) => {
            Finding::bad(CHECK, found, "controller and plant share a core and delay each other")
                .with_remedy(start_with(root, &format!("--cpuset-cpus {one},{other}"), leave_cpuset()))
        }
        _ => Finding::bad(CHECK, found, "controller and plant share the only core and delay each other"),
    }
}

/// The command that runs outside the cpuset of the session's control group.
fn leave_cpuset() -> String {
    // An absolute path and this user's id: sudo has another search path, and files of the run belong to its user.
    let masseter = env::current_exe().unwrap_or_else(|_| "masseter".into());
    format!("sudo systemd-run --scope --uid=\"$(id -u)\" '{}' run", masseter.display())
}

fn governor(root: &SystemRoot) -> Finding {
    const CHECK: &str = "frequency governor";
    let path = |core| format!("sys/devices/system/cpu/cpu{core}/cpufreq/scaling_governor");
    let mut governors: Vec<_> =
        root.online_cores().into_iter().filter_map(|core| root.text(&path(core))).collect();
    governors.sort();
    governors.dedup();
    let found = governors.join(", ");
    match governors.as_slice() {
        [] => Finding::ok(CHECK, "none: this system cannot change the frequency"),
        [only] if only == "performance" => Finding::ok(CHECK, found),
        _ => Finding::warn(CHECK, found, "after a sleep the core computes up to several times slower")
            .with_remedy(on_host(
                root,
                "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor",
            )),
    }
}

/// Idle states matter only if a run cannot disable them. Any core may be one of the run's, so the deepest state counts.
fn idle(root: &SystemRoot, may_hold: bool) -> Finding {
    const CHECK: &str = "idle states";
    let deepest = root.online_cores().into_iter().filter_map(|core| deepest_state(root, core)).max();
    let Some((exit_us, name)) = deepest else {
        return Finding::ok(CHECK, "not managed by this system");
    };
    let found = format!("deepest {name}, {exit_us} µs to leave");
    if exit_us <= LATEST_EXIT_US {
        return Finding::ok(CHECK, found);
    }
    let cost = "a loop that slept wakes after its deadline";
    match (is_virtual(root), may_hold) {
        (false, true) => Finding::ok(CHECK, format!("{found}; a run disables it")),
        (false, false) => {
            let device = dma_latency::DEVICE;
            let grant = format!("sudo setfacl -m u:\"$USER\":rw {device}");
            Finding::warn(CHECK, found, cost).with_remedy(start_with(
                root,
                &format!("--device {device}"),
                grant,
            ))
        }
        (true, _) => Finding::warn(CHECK, found, cost)
            .with_remedy("masseter bench loop  # measures whether realtime.cpu_dma_latency = 'hold' helps"),
    }
}

/// Exit latency, µs, and name of a core's deepest enabled idle state.
fn deepest_state(root: &SystemRoot, core: usize) -> Option<(i64, String)> {
    let folder = format!("sys/devices/system/cpu/cpu{core}/cpuidle");
    let states = root.names(&folder);
    let states = states.iter().filter(|state| {
        state.starts_with("state") && root.number(&format!("{folder}/{state}/disable")) != Some(1)
    });
    let latencies = states.filter_map(|state| {
        let latency_us = root.number(&format!("{folder}/{state}/latency"))?;
        Some((latency_us, root.text(&format!("{folder}/{state}/name")).unwrap_or_default()))
    });
    latencies.max()
}

fn hypervisor(root: &SystemRoot) -> Finding {
    const CHECK: &str = "virtual machine";
    if !is_virtual(root) {
        return Finding::ok(CHECK, "no");
    }
    let ticks = root.core_ticks().unwrap_or_default();
    let (total, [.., stolen]) = (ticks.iter().sum::<u64>(), ticks);
    let percent = 100.0 * stolen as f64 / total.max(1) as f64;
    let cost = "the hypervisor may stop a core for milliseconds; such runs are disturbed";
    Finding::warn(CHECK, format!("yes; its host stole {percent:.3} % of the time since boot"), cost)
}

#[cfg(test)]
mod tests {
    use super::super::finding::Level::{Bad, Ok, Warn};
    use super::*;
    use masseter_machine::fixture::Fixture;

    #[test]
    fn two_cores_are_needed_and_a_cpuset_that_hides_them_is_left() {
        let machine = Fixture::with_files(&[]);
        let of = |usable, online: &[usize]| number(&machine.root(), usable, online);
        assert_eq!(of(2, &[0, 1]).level, Ok);
        let hidden = of(1, &[0, 1, 2, 3]);
        assert_eq!((hidden.level, hidden.found.as_str()), (Bad, "1 of 4 usable"));
        assert!(hidden.remedy.unwrap().contains("systemd-run --scope --uid=\"$(id -u)\" '/"));
        assert_eq!((of(1, &[0]).level, of(1, &[0]).remedy), (Bad, None));
        let container = Fixture::with_files(&[(".dockerenv", "")]);
        assert_eq!(
            number(&container.root(), 1, &[0, 2, 3]).remedy.as_deref(),
            Some("docker run --cpuset-cpus 0,2 …")
        );
    }

    #[test]
    fn one_core_of_another_governor_is_enough_to_warn() {
        let cases = [
            (&["performance", "performance"][..], Ok),
            (&["performance", "powersave"], Warn),
            (&["schedutil", "schedutil"], Warn),
            (&[], Ok),
        ];
        for (governors, level) in cases {
            let paths: Vec<_> = (0..governors.len())
                .map(|core| format!("sys/devices/system/cpu/cpu{core}/cpufreq/scaling_governor"))
                .collect();
            let mut files: Vec<_> = paths.iter().map(String::as_str).zip(governors.iter().copied()).collect();
            files.push(("sys/devices/system/cpu/online", "0-1"));
            assert_eq!(governor(&Fixture::with_files(&files).root()).level, level, "{governors:?}");
        }
    }

    #[test]
    fn the_deepest_state_that_is_not_disabled_counts_where_the_cores_are_not_held_awake() {
        let state = |disable: &str, hypervisor: &str, may_hold| {
            let folder = "sys/devices/system/cpu/cpu0/cpuidle";
            let paths = ["state0/latency", "state0/name", "state1/latency", "state1/name", "state1/disable"]
                .map(|path| format!("{folder}/{path}"));
            let texts = ["1", "POLL", "890", "C6", disable];
            let mut files: Vec<_> = paths.iter().map(String::as_str).zip(texts).collect();
            files.extend([("proc/cpuinfo", hypervisor), ("sys/devices/system/cpu/online", "0")]);
            idle(&Fixture::with_files(&files).root(), may_hold)
        };
        let [real, guest] = ["flags : fpu", "flags : hypervisor"];
        assert_eq!(state("1", real, false).level, Ok);
        assert_eq!(state("0", real, true).level, Ok);
        let refused = state("0", real, false);
        assert_eq!(refused.level, Warn);
        assert!(refused.found.contains("C6, 890") && refused.remedy.unwrap().contains("setfacl"));
        assert!(state("0", guest, true).remedy.unwrap().contains("bench loop"), "left alone there");
    }

    #[test]
    fn one_core_that_sleeps_deeper_than_the_others_is_enough_to_warn() {
        let state = |core, disable| {
            let folder = format!("sys/devices/system/cpu/cpu{core}/cpuidle/state1");
            [("latency", "890"), ("name", "C6"), ("disable", disable)]
                .map(|(name, text)| (format!("{folder}/{name}"), text))
        };
        let of = |online| {
            let states = [state(0, "1"), state(1, "0")].concat();
            let mut files: Vec<_> = states.iter().map(|(path, text)| (path.as_str(), *text)).collect();
            files.push(("sys/devices/system/cpu/online", online));
            idle(&Fixture::with_files(&files).root(), false)
        };
        assert_eq!((of("0").level, of("0-1").level), (Ok, Warn));
        assert!(of("0-1").found.contains("C6, 890"));
    }

    #[test]
    fn a_virtual_machine_is_named_with_the_share_of_its_time_that_was_stolen() {
        let of = |files: &[(&str, &str)]| hypervisor(&Fixture::with_files(files).root());
        let stat = ("proc/stat", "cpu  500 0 100 9000 0 0 0 400 7 7\ncpu0 1 1 1 1");
        assert_eq!(of(&[stat]).level, Ok);
        let guest = of(&[("proc/cpuinfo", "flags : hypervisor"), stat]);
        assert_eq!(guest.level, Warn);
        assert!(guest.found.contains("4.000 %"), "{}", guest.found);
    }
}
