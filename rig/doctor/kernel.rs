//! The kernel's scheduling: preemption, real-time throttling, isolated cores.

use super::finding::Finding;
use super::{boot_options, container, cores, realtime_kernel};
use crate::machine::SystemRoot;

/// All findings of this family.
pub(super) fn examine(root: &SystemRoot) -> Vec<Finding> {
    vec![preemption(root), throttling(root), isolation(root)]
}

fn preemption(root: &SystemRoot) -> Finding {
    const CHECK: &str = "preemption model";
    let release = root.text("proc/sys/kernel/osrelease").unwrap_or_default();
    let version = root.text("proc/sys/kernel/version").unwrap_or_default();
    let has = |word: &str| version.split_whitespace().any(|found| found == word);
    if root.number("sys/kernel/realtime") == Some(1) || has("PREEMPT_RT") {
        return Finding::ok(CHECK, format!("{release}: fully preemptible (PREEMPT_RT)"));
    }
    let cost = "a system call of another task may occupy a core for up to a millisecond";
    let install = |finding: Finding| match realtime_kernel::installation(root) {
        Some(command) => finding.mended_by(command),
        None => finding,
    };
    if !has("PREEMPT_DYNAMIC") {
        let model = if has("PREEMPT") { "preemptible (PREEMPT)" } else { "not preemptible in the kernel" };
        return install(Finding::warn(CHECK, format!("{release}: {model}"), cost));
    }
    match root.text("sys/kernel/debug/sched/preempt") {
        // The current mode is in brackets: `none voluntary (full) lazy`.
        Some(modes) if modes.contains("(full)") => {
            install(Finding::warn(CHECK, format!("{release}: preemptible (PREEMPT_DYNAMIC, full)"), cost))
        }
        Some(modes) => Finding::warn(CHECK, format!("{release}: PREEMPT_DYNAMIC, modes {modes}"), cost)
            .mended_by(container::on_host(root, "echo full | sudo tee /sys/kernel/debug/sched/preempt")),
        None => Finding::warn(CHECK, format!("{release}: PREEMPT_DYNAMIC, mode not readable"), cost)
            .mended_by(container::on_host(
                root,
                "sudo mount -t debugfs debugfs /sys/kernel/debug; \
                 echo full | sudo tee /sys/kernel/debug/sched/preempt",
            )),
    }
}

fn throttling(root: &SystemRoot) -> Finding {
    const CHECK: &str = "real-time throttling";
    let runtime_us = root.number("proc/sys/kernel/sched_rt_runtime_us");
    let period_us = root.number("proc/sys/kernel/sched_rt_period_us");
    let (Some(runtime_us), Some(period_us)) = (runtime_us, period_us) else {
        return Finding::ok(CHECK, "none in this kernel");
    };
    // The kernel's default share of the current period. Setting both values fails in one order or the other.
    let restored_us = period_us - period_us / 20;
    let restore = container::on_host(root, format!("sudo sysctl kernel.sched_rt_runtime_us={restored_us}"));
    let found = format!("{runtime_us} of every {period_us} µs");
    match runtime_us {
        ..0 => Finding::warn(CHECK, "off", "a real-time task that never waits blocks its core")
            .mended_by(restore),
        // The kernel's default; the loops limit their spinning to stay below it.
        _ if runtime_us * 100 >= period_us * 95 => Finding::ok(CHECK, found),
        0 => Finding::bad(CHECK, found, "real-time tasks get no CPU time").mended_by(restore),
        _ => Finding::warn(CHECK, found, "the kernel stops fast loops for the rest of the period")
            .mended_by(restore),
    }
}

fn isolation(root: &SystemRoot) -> Finding {
    const CHECK: &str = "isolated cores";
    let list = |path: &str| root.text(path).filter(|list| !list.is_empty() && list != "(null)");
    let isolated = list("sys/devices/system/cpu/isolated");
    let tickless = list("sys/devices/system/cpu/nohz_full");
    let cores = root.online_cores().len();
    match (isolated, tickless) {
        (Some(isolated), Some(tickless)) => {
            Finding::ok(CHECK, format!("isolcpus={isolated}, nohz_full={tickless}; choose them with --cores"))
        }
        (Some(isolated), None) => {
            Finding::ok(CHECK, format!("isolcpus={isolated}, ticking; choose them with --cores"))
        }
        (None, _) if cores <= 2 => Finding::ok(CHECK, format!("none; with {cores} cores none can be spared")),
        (None, _) => {
            let finding =
                Finding::warn(CHECK, "none", "other tasks and interrupts also run on the rig's cores");
            match cores::to_spare(root) {
                Some([one, other]) => finding.mended_by(isolate(root, &format!("{one},{other}"))),
                None => finding,
            }
        }
    }
}

fn isolate(root: &SystemRoot, list: &str) -> String {
    let options = format!("isolcpus={list} nohz_full={list}");
    format!("{}  # then: masseter run --cores {list}", boot_options::add(root, &options))
}

#[cfg(test)]
mod tests {
    use super::super::finding::Level::{self, Bad, Ok, Warn};
    use super::*;
    use crate::machine::fixture::Fixture;

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
            ("etc/os-release", "ID=debian"),
            ("proc/sys/kernel/version", "#1 SMP PREEMPT_DYNAMIC"),
            ("proc/sys/kernel/sched_rt_runtime_us", "0"),
            ("proc/sys/kernel/sched_rt_period_us", "1000000"),
            ("sys/devices/system/cpu/online", "0-7"),
        ];
        for finding in examine(&Fixture::with_files(&files).root()) {
            assert!(finding.mend.unwrap().starts_with("on the host: "), "{}", finding.check);
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
            let mend = throttled("0", period_us).mend.unwrap();
            assert_eq!(mend, format!("sudo sysctl kernel.sched_rt_runtime_us={restored_us}"));
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
        assert!(shared.mend.unwrap().contains("isolcpus=6,7 nohz_full=6,7"));
    }
}
