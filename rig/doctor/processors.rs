//! The cores: number, frequency governor, idle states, virtualisation and steal time.

use std::env;

use masseter_shared::realtime::scheduling::usable_cores;

use super::finding::Finding;
use super::{container, timing};
use crate::machine::SystemRoot;

/// Longest exit latency of an idle state that the loops' spin covers, µs.
const LATEST_EXIT_US: i64 = 200;
/// Largest share of steal time since boot without a warning.
const STEAL_SHARE: f64 = 0.001;

/// All findings of this family.
pub(super) fn examine(root: &SystemRoot) -> Vec<Finding> {
    let may_hold = timing::open_latency_device().is_ok();
    vec![
        number(root, usable_cores().len(), &root.online_cores()),
        governor(root),
        idle(root, may_hold),
        hypervisor(root),
        steal(root),
    ]
}

fn number(root: &SystemRoot, usable: usize, online: &[usize]) -> Finding {
    const CHECK: &str = "cores";
    let found = format!("{usable} of {} usable", online.len());
    match (usable, online) {
        (2.., _) => Finding::ok(CHECK, found),
        (_, [one, other, ..]) => {
            Finding::bad(CHECK, found, "controller and plant share a core and delay each other").mended_by(
                container::start_with(root, &format!("--cpuset-cpus {one},{other}"), leave_cpuset()),
            )
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
            .mended_by(container::on_host(
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
    match (root.is_virtual(), may_hold) {
        (false, true) => Finding::ok(CHECK, format!("{found}; a run disables it")),
        (false, false) => Finding::warn(CHECK, found, cost).mended_by(timing::grant_latency_device(root)),
        (true, _) => Finding::warn(CHECK, found, cost)
            .mended_by("masseter bench loop  # measures whether `realtime.cpu_dma_latency = \"hold\"` helps"),
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
    if root.is_virtual() {
        Finding::warn(CHECK, "yes", "the hypervisor may stop a core for milliseconds; such runs are INVALID")
    } else {
        Finding::ok(CHECK, "no")
    }
}

fn steal(root: &SystemRoot) -> Finding {
    const CHECK: &str = "steal time";
    let ticks = root.core_ticks().unwrap_or_default();
    let (total, [.., stolen]) = (ticks.iter().sum::<u64>(), ticks);
    let share = if total == 0 { 0.0 } else { stolen as f64 / total as f64 };
    let found = format!("{:.3} % since boot", share * 100.0);
    if share <= STEAL_SHARE {
        return Finding::ok(CHECK, found);
    }
    Finding::warn(CHECK, found, "other guests of the host take CPU time; such runs are INVALID")
}

#[cfg(test)]
mod tests {
    use super::super::finding::Level::{Bad, Ok, Warn};
    use super::*;
    use crate::machine::fixture::Fixture;

    #[test]
    fn two_cores_are_needed_and_a_cpuset_that_hides_them_is_left() {
        let machine = Fixture::with_files(&[]);
        let of = |usable, online: &[usize]| number(&machine.root(), usable, online);
        assert_eq!(of(2, &[0, 1]).level, Ok);
        let hidden = of(1, &[0, 1, 2, 3]);
        assert_eq!((hidden.level, hidden.found.as_str()), (Bad, "1 of 4 usable"));
        assert!(hidden.mend.unwrap().contains("systemd-run --scope --uid=\"$(id -u)\" '/"));
        assert_eq!((of(1, &[0]).level, of(1, &[0]).mend), (Bad, None));
        let container = Fixture::with_files(&[(".dockerenv", "")]);
        assert_eq!(
            number(&container.root(), 1, &[0, 2, 3]).mend.as_deref(),
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
        assert!(refused.found.contains("C6, 890") && refused.mend.unwrap().contains("setfacl"));
        assert!(state("0", guest, true).mend.unwrap().contains("bench loop"), "left alone there");
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
    fn steal_is_a_share_of_all_time() {
        let of = |line: &str| steal(&Fixture::with_files(&[("proc/stat", line)]).root());
        assert_eq!(of("cpu  500 0 100 9390 0 0 0 10 7 7\ncpu0 1 1 1 1").level, Ok);
        let stolen = of("cpu  500 0 100 9000 0 0 0 400 0 0\n");
        assert_eq!((stolen.level, stolen.found.as_str()), (Warn, "4.000 % since boot"));
    }
}
