//! Clocks and timers: clock source, timer resolution, cost of a sleep, and access to `/dev/cpu_dma_latency`.

use std::fs::OpenOptions;
use std::io;

use masseter_shared::clock;
use rustix::time::{ClockId, clock_getres};

use super::finding::Finding;
use super::{boot_options, container};
use crate::machine::SystemRoot;
use crate::machine::dma_latency;

/// Clock sources that are read in tens of nanoseconds, without a system call.
const FAST_SOURCES: [&str; 4] = ["tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page"];

/// Number and length, ns, of the measured sleeps.
const SLEEPS: u64 = 200;
const SLEEP_NS: u64 = 200_000;
/// Largest CPU time of a sleep without a warning, ns.
const CHEAP_SLEEP_NS: u64 = 10_000;
/// The rate for which a warning gives the share of sleeping, Hz.
const FAST_RATE_HZ: u64 = 10_000;

/// All findings of this family.
pub(super) fn examine(root: &SystemRoot) -> Vec<Finding> {
    let resolution = clock_getres(ClockId::Monotonic);
    let resolution_ns = resolution.tv_sec * 1_000_000_000 + resolution.tv_nsec;
    vec![
        clock_source(root),
        timers(root, resolution_ns),
        sleeping(cost_of_a_sleep_ns()),
        dma_latency_access(root, &open_latency_device()),
    ]
}

/// Whether runs may disable idle states.
pub(super) fn open_latency_device() -> io::Result<()> {
    OpenOptions::new().write(true).open(dma_latency::DEVICE).map(drop)
}

/// The command that grants this.
pub(super) fn grant_latency_device(root: &SystemRoot) -> String {
    let device = dma_latency::DEVICE;
    container::start_with(
        root,
        &format!("--device {device}"),
        format!("sudo setfacl -m u:\"$USER\":rw {device}"),
    )
}

fn clock_source(root: &SystemRoot) -> Finding {
    const CHECK: &str = "clock source";
    let folder = "sys/devices/system/clocksource/clocksource0";
    let Some(current) = root.text(&format!("{folder}/current_clocksource")) else {
        return Finding::ok(CHECK, "unknown to this kernel");
    };
    if FAST_SOURCES.contains(&current.as_str()) {
        return Finding::ok(CHECK, current);
    }
    let available = root.text(&format!("{folder}/available_clocksource")).unwrap_or_default();
    let better = available.split_whitespace().find(|source| FAST_SOURCES.contains(source));
    let finding = Finding::warn(CHECK, current, "reading the clock takes a microsecond or more");
    match better {
        Some(source) => finding.mended_by(container::on_host(
            root,
            format!("echo {source} | sudo tee /{folder}/current_clocksource"),
        )),
        None => finding,
    }
}

fn timers(root: &SystemRoot, resolution_ns: i64) -> Finding {
    const CHECK: &str = "timer resolution";
    if resolution_ns <= 1000 {
        return Finding::ok(CHECK, format!("{resolution_ns} ns"));
    }
    let finding = Finding::bad(
        CHECK,
        format!("{resolution_ns} ns"),
        "cycles begin at timer ticks only; the kernel needs CONFIG_HIGH_RES_TIMERS and no `highres=off`",
    );
    let options = root.text("proc/cmdline").unwrap_or_default();
    if options.split_whitespace().any(|option| option == "highres=off") {
        // The kernel uses the last of two.
        return finding.mended_by(boot_options::add(root, "highres=on"));
    }
    finding
}

/// CPU time of a sleep and its wake-up, ns.
fn cost_of_a_sleep_ns() -> u64 {
    let before_ns = clock::thread_cpu_ns();
    for _ in 0..SLEEPS {
        clock::sleep_until(clock::now_ns() + SLEEP_NS);
    }
    (clock::thread_cpu_ns() - before_ns) / SLEEPS
}

fn sleeping(cost_ns: u64) -> Finding {
    const CHECK: &str = "sleeping";
    let found = format!("{} µs of CPU time each", cost_ns.div_ceil(1000));
    if cost_ns <= CHEAP_SLEEP_NS {
        return Finding::ok(CHECK, found);
    }
    let share_percent = 100 * cost_ns * FAST_RATE_HZ / clock::SECOND_NS;
    let cost = format!(
        "at {} kHz, one sleep per cycle takes {share_percent} % of each loop's core; setting a timer is slow, \
         as in many virtual machines",
        FAST_RATE_HZ / 1000
    );
    Finding::warn(CHECK, found, cost)
}

fn dma_latency_access(root: &SystemRoot, opened: &io::Result<()>) -> Finding {
    const CHECK: &str = "cpu_dma_latency";
    match (opened, root.is_virtual()) {
        (_, true) => Finding::ok(
            CHECK,
            "not used in virtual machines; `masseter bench loop` measures whether \
             `realtime.cpu_dma_latency = \"hold\"` helps here",
        ),
        (Ok(()), false) => Finding::ok(CHECK, "usable"),
        (Err(error), false) => Finding::warn(
            CHECK,
            format!("not usable ({error})"),
            "cores enter deep idle states between cycles",
        )
        .mended_by(grant_latency_device(root)),
    }
}

#[cfg(test)]
mod tests {
    use super::super::finding::Level::{Bad, Ok as Fine, Warn};
    use super::*;
    use crate::machine::fixture::Fixture;

    #[test]
    fn a_slow_clock_source_is_named_with_a_better_one_if_there_is_one() {
        let of = |current, available| {
            let folder = "sys/devices/system/clocksource/clocksource0";
            let (one, other) =
                (format!("{folder}/current_clocksource"), format!("{folder}/available_clocksource"));
            clock_source(&Fixture::with_files(&[(&one, current), (&other, available)]).root())
        };
        assert_eq!(of("tsc\n", "tsc hpet\n").level, Fine);
        assert!(of("hpet", "hpet tsc acpi_pm").mend.unwrap().starts_with("echo tsc |"));
        assert_eq!((of("hpet", "hpet acpi_pm").level, of("hpet", "hpet acpi_pm").mend), (Warn, None));
    }

    #[test]
    fn ticks_are_too_coarse_for_cycles() {
        let machine = Fixture::with_files(&[]);
        assert_eq!([1, 4_000_000].map(|ns| timers(&machine.root(), ns).level), [Fine, Bad]);
    }

    #[test]
    fn fine_timers_are_asked_for_where_they_were_declined() {
        let mend =
            |options| timers(&Fixture::with_files(&[("proc/cmdline", options)]).root(), 4_000_000).mend;
        assert!(mend("root=/dev/sda1 highres=off quiet").unwrap().contains("highres=on"));
        assert_eq!(mend("root=/dev/sda1 quiet"), None, "the kernel has none");
    }

    #[test]
    fn a_slow_sleep_is_reported_with_its_share_of_a_fast_loops_core() {
        assert_eq!(sleeping(10_000).level, Fine);
        let dear = sleeping(33_200);
        assert_eq!((dear.level, dear.found.as_str()), (Warn, "34 µs of CPU time each"));
        assert!(dear.cost.unwrap().contains("at 10 kHz, one sleep per cycle takes 33 %"));
    }

    #[test]
    fn sleeping_costs_something() {
        assert!(cost_of_a_sleep_ns() > 0);
    }

    #[test]
    fn the_latency_device_matters_on_real_machines_only() {
        let refused = || Err(io::Error::from(io::ErrorKind::PermissionDenied));
        let guest = Fixture::with_files(&[("sys/hypervisor/type", "xen")]);
        assert_eq!(dma_latency_access(&guest.root(), &refused()).level, Fine);
        let real = Fixture::with_files(&[]);
        assert_eq!(dma_latency_access(&real.root(), &refused()).level, Warn);
        assert_eq!(dma_latency_access(&real.root(), &Ok(())).level, Fine);
    }
}
