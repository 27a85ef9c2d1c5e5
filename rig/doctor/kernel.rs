//! The kernel: preemption, real-time throttling, isolated cores, clock source.

use masseter_machine::SystemRoot;
use masseter_scenario::wording::counted;

use super::finding::{Finding, on_host};

/// Clock sources that are read in tens of nanoseconds, without a system call.
const FAST_SOURCES: [&str; 4] = ["tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page"];

const FULL_PREEMPTION: &str = "sudo mount -t debugfs debugfs /sys/kernel/debug; \
                               echo full | sudo tee /sys/kernel/debug/sched/preempt";
const REALTIME_KERNEL: &str = "install a kernel with PREEMPT_RT: on Debian 'sudo apt install \
     linux-image-rt-amd64', on Ubuntu 'sudo pro enable realtime-kernel'; then boot again";

pub(super) fn preemption(root: &SystemRoot) -> Finding {
    let release = root.text("proc/sys/kernel/osrelease").unwrap_or_default();
    let version = root.text("proc/sys/kernel/version").unwrap_or_default();
    let has = |word: &str| version.split_whitespace().any(|found| found == word);
    if root.number("sys/kernel/realtime") == Some(1) || has("PREEMPT_RT") {
        return Finding::ok(format!("{release}: fully preemptible (PREEMPT_RT)"));
    }
    // The current mode is in brackets: `none voluntary (full) lazy`.
    let modes = root.text("sys/kernel/debug/sched/preempt").unwrap_or_else(|| "not readable".to_owned());
    let (found, remedy) = if has("PREEMPT_DYNAMIC") && !modes.contains("(full)") {
        (format!("PREEMPT_DYNAMIC, modes {modes}"), FULL_PREEMPTION)
    } else if has("PREEMPT") || has("PREEMPT_DYNAMIC") {
        ("preemptible (full)".to_owned(), REALTIME_KERNEL)
    } else {
        ("not preemptible in the kernel".to_owned(), REALTIME_KERNEL)
    };
    let cost = "a system call of another task may occupy a core for up to a millisecond";
    Finding::warn(format!("{release}: {found}"), cost).with_remedy(on_host(root, remedy))
}

pub(super) fn throttling(root: &SystemRoot) -> Finding {
    let runtime_us = root.number("proc/sys/kernel/sched_rt_runtime_us");
    let period_us = root.number("proc/sys/kernel/sched_rt_period_us");
    let (Some(runtime_us), Some(period_us)) = (runtime_us, period_us) else {
        return Finding::ok("none in this kernel");
    };
    let found = format!("{runtime_us} of every {period_us} µs");
    let finding = match runtime_us {
        ..0 => Finding::warn("off", "a real-time task that never waits blocks its core"),
        0 => Finding::bad(found, "real-time tasks get no CPU time"),
        // The kernel's default; the loops limit their spinning to stay below it.
        _ if runtime_us * 100 >= period_us * 95 => return Finding::ok(found),
        _ => Finding::warn(found, "the kernel stops fast loops for the rest of the period"),
    };
    // The kernel's default share of the current period. Setting both values fails in one order or the other.
    let default_us = period_us - period_us / 20;
    finding.with_remedy(on_host(root, format!("sudo sysctl kernel.sched_rt_runtime_us={default_us}")))
}

pub(super) fn isolation(root: &SystemRoot) -> Finding {
    let list = |path: &str| root.text(path).filter(|list| !list.is_empty() && list != "(null)");
    if let Some(isolated) = list("sys/devices/system/cpu/isolated") {
        let tickless = list("sys/devices/system/cpu/nohz_full");
        let tickless = tickless.map_or_else(|| "ticking".to_owned(), |list| format!("nohz_full={list}"));
        return Finding::ok(format!("isolcpus={isolated}, {tickless}; choose them with --cores"));
    }
    let cores = root.online_cores().len();
    let Some([one, other]) = cores_to_spare(root).filter(|_| cores > 2) else {
        return Finding::ok(format!("none; with {} none can be spared", counted(cores as u64, "core")));
    };
    let remedy = format!(
        "add 'isolcpus={one},{other} nohz_full={one},{other}' to the kernel's command line (on Debian and Ubuntu: \
         GRUB_CMDLINE_LINUX_DEFAULT in /etc/default/grub, then 'sudo update-grub'), and boot again; then: masseter run \
         --cores {one},{other}"
    );
    Finding::warn("none", "other tasks and interrupts also run on the rig's cores")
        .with_remedy(on_host(root, remedy))
}

/// The last core, and the last other one on another physical core.
fn cores_to_spare(root: &SystemRoot) -> Option<[usize; 2]> {
    let mut cores = root.online_cores();
    let last = cores.pop()?;
    let siblings = root.cores(&format!("sys/devices/system/cpu/cpu{last}/topology/thread_siblings_list"));
    let other = cores.into_iter().rfind(|core| !siblings.contains(core))?;
    Some([other, last])
}

pub(super) fn clock_source(root: &SystemRoot) -> Finding {
    let folder = "sys/devices/system/clocksource/clocksource0";
    let Some(current) = root.text(&format!("{folder}/current_clocksource")) else {
        return Finding::ok("unknown to this kernel");
    };
    if FAST_SOURCES.contains(&current.as_str()) {
        return Finding::ok(current);
    }
    let available = root.text(&format!("{folder}/available_clocksource")).unwrap_or_default();
    let finding = Finding::warn(current, "reading the clock takes a microsecond or more");
    match available.split_whitespace().find(|source| FAST_SOURCES.contains(source)) {
        Some(better) => finding
            .with_remedy(on_host(root, format!("echo {better} | sudo tee /{folder}/current_clocksource"))),
        None => finding,
    }
}

#[cfg(test)]
mod tests {
    use masseter_machine::fixture::Fixture;

    use super::super::finding::Level::{self, Bad, Ok, Warn};
    use super::*;

    type Files<'a> = &'a [(&'a str, &'a str)];

    #[test]
    fn preemption_is_read_from_version_and_debugfs() {
        const VERSION: &str = "proc/sys/kernel/version";
        const MODES: &str = "sys/kernel/debug/sched/preempt";
        let cases: [(Files, Level, &str); 6] = [
            (&[(VERSION, "#1 SMP PREEMPT_RT Debian 6.12")], Ok, "PREEMPT_RT"),
            (&[("sys/kernel/realtime", "1"), (VERSION, "#1 SMP")], Ok, "PREEMPT_RT"),
            (&[(VERSION, "#1 SMP")], Warn, "not preemptible"),
            (&[(VERSION, "#1 SMP PREEMPT_DYNAMIC")], Warn, "not readable"),
            (&[(VERSION, "#1 SMP PREEMPT_DYNAMIC"), (MODES, "(none) voluntary full")], Warn, "(none)"),
            (&[(VERSION, "#1 SMP PREEMPT_DYNAMIC"), (MODES, "none voluntary (full)")], Warn, "full)"),
        ];
        for (files, level, found) in cases {
            let finding = preemption(&Fixture::with_files(files).root());
            assert_eq!(finding.level, level, "{finding:?}");
            assert!(finding.found.contains(found), "{finding:?}");
        }
    }

    #[test]
    fn in_a_container_the_remedy_is_on_the_host() {
        let files = [
            (".dockerenv", ""),
            ("proc/sys/kernel/version", "#1 SMP PREEMPT_DYNAMIC"),
            ("proc/sys/kernel/sched_rt_runtime_us", "0"),
            ("proc/sys/kernel/sched_rt_period_us", "1000000"),
            ("sys/devices/system/cpu/online", "0-7"),
        ];
        let fixture = Fixture::with_files(&files);
        let findings = [preemption, throttling, isolation, clock_source].map(|check| check(&fixture.root()));
        for finding in findings.iter().filter(|finding| finding.level != Ok) {
            assert!(finding.remedy.as_ref().unwrap().starts_with("on the host: "), "{finding:?}");
        }
    }

    fn throttled(runtime_us: &str, period_us: &str) -> Finding {
        let files = [
            ("proc/sys/kernel/sched_rt_runtime_us", runtime_us),
            ("proc/sys/kernel/sched_rt_period_us", period_us),
        ];
        throttling(&Fixture::with_files(&files).root())
    }

    #[test]
    fn throttling_is_judged_by_the_share_it_leaves() {
        let cases = [("950000", Ok), ("940000", Warn), ("-1", Warn), ("200000", Warn), ("0", Bad)];
        for (runtime_us, level) in cases {
            assert_eq!(throttled(runtime_us, "1000000").level, level, "{runtime_us}");
        }
        assert_eq!(throttling(&Fixture::with_files(&[]).root()).level, Ok);
    }

    #[test]
    fn the_default_share_is_asked_for_of_whatever_period_there_is() {
        for (period_us, restored_us) in [("1000000", "950000"), ("100000", "95000"), ("30", "29")] {
            let remedy = throttled("0", period_us).remedy.unwrap();
            assert_eq!(remedy, format!("sudo sysctl kernel.sched_rt_runtime_us={restored_us}"));
            assert_eq!(throttled(restored_us, period_us).level, Ok);
        }
    }

    #[test]
    fn isolation_is_recommended_only_with_cores_to_spare() {
        let cores = |online: &str, isolated: &str| {
            let files =
                [("sys/devices/system/cpu/online", online), ("sys/devices/system/cpu/isolated", isolated)];
            isolation(&Fixture::with_files(&files).root())
        };
        assert_eq!(cores("0-1", "\n").level, Ok);
        assert_eq!(cores("0-7", "6-7\n").level, Ok);
        let shared = cores("0-7", "\n");
        assert_eq!(shared.level, Warn);
        assert!(shared.remedy.unwrap().contains("isolcpus=6,7 nohz_full=6,7"));
    }

    #[test]
    fn cores_of_one_physical_core_are_not_taken_for_two() {
        let of = |siblings: &[&str]| {
            let online = format!("0-{}", siblings.len() - 1);
            let path = |core| format!("sys/devices/system/cpu/cpu{core}/topology/thread_siblings_list");
            let paths: Vec<_> = (0..siblings.len()).map(path).collect();
            let mut files: Vec<_> = paths.iter().map(String::as_str).zip(siblings.iter().copied()).collect();
            files.push(("sys/devices/system/cpu/online", &online));
            cores_to_spare(&Fixture::with_files(&files).root())
        };
        assert_eq!(of(&["0-1", "0-1", "2-3", "2-3"]), Some([1, 3]));
        assert_eq!(of(&["0,2", "1,3", "0,2", "1,3"]), Some([2, 3]));
        assert_eq!(of(&["", "", "", ""]), Some([2, 3]), "siblings not told");
        assert_eq!(of(&["0-1", "0-1"]), None);
    }

    #[test]
    fn cores_that_are_offline_are_not_spared() {
        let smt_off = [
            ("sys/devices/system/cpu/online", "0,2,4,6"),
            ("sys/devices/system/cpu/cpu6/topology/thread_siblings_list", "6"),
            ("sys/devices/system/cpu/cpu7/online", "0"),
        ];
        assert_eq!(cores_to_spare(&Fixture::with_files(&smt_off).root()), Some([4, 6]));
    }

    #[test]
    fn a_slow_clock_source_is_named_with_a_better_one_if_there_is_one() {
        let of = |current, available| {
            let folder = "sys/devices/system/clocksource/clocksource0";
            let (one, other) =
                (format!("{folder}/current_clocksource"), format!("{folder}/available_clocksource"));
            clock_source(&Fixture::with_files(&[(&one, current), (&other, available)]).root())
        };
        assert_eq!(of("tsc\n", "tsc hpet\n").level, Ok);
        assert!(of("hpet", "hpet tsc acpi_pm").remedy.unwrap().starts_with("echo tsc |"));
        assert_eq!((of("hpet", "hpet acpi_pm").level, of("hpet", "hpet acpi_pm").remedy), (Warn, None));
    }
}
