//! The cores and what the kernel grants on them: number, frequency governor, idle states, virtualisation; SCHED_FIFO
//! and locked memory, which are requested from the kernel as a run does.

use masseter_machine::{SystemRoot, dma_latency, is_virtual};
use masseter_runtime::realtime::scheduling::{Obtained, SchedulingRequest, obtain};

use super::finding::{Finding, on_host, start_with};

/// Longest exit latency of an idle state that the loops' spin covers, µs.
const LATEST_EXIT_US: i64 = 200;
/// Raises both limits for this user, from the next login on.
const RAISE_LIMITS: &str = "printf '%s - rtprio 95\\n%s - memlock unlimited\\n' \"$USER\" \"$USER\" \
                            | sudo tee /etc/security/limits.d/masseter.conf  # then log in again";

/// Whether a virtual machine wakes earlier without idle states depends on its host.
const HOLD_AND_COMPARE: &str = "masseter run --set realtime.cpu_dma_latency=hold  \
     # masseter report A B compares its wake-ups with those of a run without";
const SET_GOVERNOR: &str =
    "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor";

/// Requests scheduling in a thread of its own, so that this one keeps its priority.
pub(super) fn try_out(request: SchedulingRequest) -> Obtained {
    std::thread::spawn(move || obtain(request)).join().expect("asking the kernel does not panic")
}

pub(super) fn fifo(root: &SystemRoot, priority: u8, obtained: &Obtained) -> Finding {
    if obtained.fifo_priority == Some(priority) {
        return Finding::ok(format!("priority {priority} granted"));
    }
    let cost = "every ordinary task can delay a cycle by milliseconds";
    Finding::bad(format!("priority {priority} refused"), cost).with_remedy(grant_command(root))
}

/// The command that lets this user have SCHED_FIFO.
pub(super) fn grant_command(root: &SystemRoot) -> String {
    start_with(root, "--cap-add SYS_NICE --ulimit rtprio=95", RAISE_LIMITS)
}

pub(super) fn locked_memory(root: &SystemRoot, obtained: &Obtained) -> Finding {
    if obtained.locked_memory {
        return Finding::ok("granted");
    }
    Finding::bad("refused", "a page fault in a cycle takes microseconds, from disk milliseconds")
        .with_remedy(start_with(root, "--ulimit memlock=-1", RAISE_LIMITS))
}

pub(super) fn number(root: &SystemRoot, usable: usize, online: &[usize]) -> Finding {
    let found = format!("{usable} of {} usable", online.len());
    match (usable, online) {
        (2.., _) => Finding::ok(found),
        (_, [one, other, ..]) => {
            Finding::bad(found, "controller and plant share a core and delay each other")
                .with_remedy(start_with(root, &format!("--cpuset-cpus {one},{other}"), leave_cpuset()))
        }
        _ => Finding::bad(found, "controller and plant share the only core and delay each other"),
    }
}

/// The command that runs outside the cpuset of the session's control group.
fn leave_cpuset() -> String {
    // An absolute path and this user's id: sudo has another search path, and files of the run belong to its user.
    let masseter = std::env::current_exe().unwrap_or_else(|_| "masseter".into());
    format!("sudo systemd-run --scope --uid=\"$(id -u)\" '{}' run", masseter.display())
}

pub(super) fn governor(root: &SystemRoot) -> Finding {
    let path = |core| format!("sys/devices/system/cpu/cpu{core}/cpufreq/scaling_governor");
    let mut governors: Vec<_> =
        root.online_cores().into_iter().filter_map(|core| root.text(&path(core))).collect();
    governors.sort();
    governors.dedup();
    let found = governors.join(", ");
    match governors.as_slice() {
        [] => Finding::ok("none: this system cannot change the frequency"),
        [only] if only == "performance" => Finding::ok(found),
        _ => Finding::warn(found, "after a sleep the core computes up to several times slower")
            .with_remedy(on_host(root, SET_GOVERNOR)),
    }
}

/// Idle states matter only if a run cannot disable them. Any core may be one of the run's, so the deepest state counts.
pub(super) fn idle(root: &SystemRoot, may_hold: bool) -> Finding {
    let deepest = root.online_cores().into_iter().filter_map(|core| deepest_state(root, core)).max();
    let Some((exit_us, name)) = deepest else { return Finding::ok("not managed by this system") };
    let found = format!("deepest {name}, {exit_us} µs to leave");
    if exit_us <= LATEST_EXIT_US {
        return Finding::ok(found);
    }
    let cost = "a loop that slept wakes after its deadline";
    match (is_virtual(root), may_hold) {
        (false, true) => Finding::ok(format!("{found}; a run disables it")),
        (false, false) => {
            let device = dma_latency::DEVICE;
            let grant = format!("sudo setfacl -m u:\"$USER\":rw {device}");
            Finding::warn(found, cost).with_remedy(start_with(root, &format!("--device {device}"), grant))
        }
        (true, _) => Finding::warn(found, cost).with_remedy(HOLD_AND_COMPARE),
    }
}

/// Exit latency, µs, and name of a core's deepest enabled idle state.
fn deepest_state(root: &SystemRoot, core: usize) -> Option<(i64, String)> {
    let folder = format!("sys/devices/system/cpu/cpu{core}/cpuidle");
    let enabled = root.names(&folder).into_iter().filter(|state| {
        state.starts_with("state") && root.number(&format!("{folder}/{state}/disable")) != Some(1)
    });
    let latencies = enabled.filter_map(|state| {
        let latency_us = root.number(&format!("{folder}/{state}/latency"))?;
        Some((latency_us, root.text(&format!("{folder}/{state}/name")).unwrap_or_default()))
    });
    latencies.max()
}

pub(super) fn hypervisor(root: &SystemRoot) -> Finding {
    if !is_virtual(root) {
        return Finding::ok("no");
    }
    let ticks = root.core_ticks().unwrap_or_default();
    let (total, [.., stolen]) = (ticks.iter().sum::<u64>(), ticks);
    let percent = 100.0 * stolen as f64 / total.max(1) as f64;
    let cost = "the hypervisor may stop a core for milliseconds; such runs are disturbed";
    Finding::warn(format!("yes; its host stole {percent:.3} % of the time since boot"), cost)
}

#[cfg(test)]
mod tests {
    use masseter_machine::fixture::Fixture;

    use super::super::finding::Level::{Bad, Ok, Warn};
    use super::*;

    #[test]
    fn what_counts_is_what_was_read_back() {
        let requested = SchedulingRequest { core: None, fifo_priority: Some(80), locked_memory: true };
        let obtained = |fifo_priority, locked_memory| Obtained {
            requested,
            core: None,
            fifo_priority,
            locked_memory,
            refusals: Vec::new(),
        };
        let machine = Fixture::with_files(&[]);
        for (granted, level) in [(Some(80), Ok), (Some(10), Bad), (None, Bad)] {
            assert_eq!(fifo(&machine.root(), 80, &obtained(granted, false)).level, level);
        }
        assert_eq!(locked_memory(&machine.root(), &obtained(None, true)).level, Ok);
        let remedies = |root: &SystemRoot| {
            [fifo(root, 80, &obtained(None, false)), locked_memory(root, &obtained(None, false))]
                .map(|finding| finding.remedy.unwrap())
        };
        assert!(remedies(&machine.root()).iter().all(|remedy| remedy.contains("limits.d")));
        let container = Fixture::with_files(&[(".dockerenv", "")]);
        assert_eq!(
            remedies(&container.root()),
            ["docker run --cap-add SYS_NICE --ulimit rtprio=95 …", "docker run --ulimit memlock=-1 …"]
        );
    }

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
        assert!(state("0", guest, true).remedy.unwrap().contains("cpu_dma_latency=hold"), "left alone there");
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
