//! What share of its core a task uses, looked at a few dozen times a second.
//!
//! The kernel's count decides, since it is what the kernel throttles by: what a sleep costs is in it, 20 to 40 µs on some
//! virtual machines. As asking for it is a system call, it is asked only while the task is awake for much of the time.

use crate::clock;

/// How long a look averages: a small part of the second in which the kernel grants real-time tasks 95 %, ns.
const WINDOW_NS: u64 = 20_000_000;
/// A task that is awake for less is not asked about: its sleeps would have to cost as much again.
const WORTH_ASKING: f64 = 0.4;

/// The looks.
#[derive(Debug, Default)]
pub(super) struct Load {
    last: Option<Look>,
}

/// What a look saw.
#[derive(Debug)]
#[allow(clippy::struct_field_names, reason = "the unit")]
struct Look {
    at_ns: u64,
    /// For how long the task had been awake in all, ns.
    awake_ns: u64,
    /// The kernel's count, ns, if it was asked.
    used_ns: Option<u64>,
}

impl Load {
    /// The share used since the last look, when it is time for one, of a task that has been awake for `awake_ns` in all.
    pub(super) fn look(&mut self, now_ns: u64, awake_ns: u64) -> Option<f64> {
        let last = self.last.get_or_insert(Look { at_ns: now_ns, awake_ns, used_ns: None });
        let passed_ns = now_ns.saturating_sub(last.at_ns);
        if passed_ns < WINDOW_NS {
            return None;
        }
        let share = |ns: u64| ns as f64 / passed_ns as f64;
        let awake = share(awake_ns - last.awake_ns);
        let used_ns = (awake > WORTH_ASKING).then(clock::thread_cpu_ns);
        let used = used_ns.zip(last.used_ns).map(|(now_ns, before_ns)| share(now_ns - before_ns));
        *last = Look { at_ns: now_ns, awake_ns, used_ns };
        Some(used.unwrap_or(awake))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spin(for_ns: u64) {
        let until_ns = clock::thread_cpu_ns() + for_ns;
        while clock::thread_cpu_ns() < until_ns {}
    }

    #[test]
    fn a_task_that_sleeps_is_not_asked_about() {
        let mut load = Load::default();
        let looks =
            [(0, 0), (WINDOW_NS - 1, 100), (WINDOW_NS, WINDOW_NS / 4), (WINDOW_NS + 1, WINDOW_NS / 4)];
        assert_eq!(
            looks.map(|(now_ns, awake_ns)| load.look(now_ns, awake_ns)),
            [None, None, Some(0.25), None]
        );
        assert_eq!(load.last.unwrap().used_ns, None);
    }

    #[test]
    fn for_one_that_is_awake_the_kernels_count_decides_from_the_second_look_on() {
        let mut load = Load::default();
        let half = |look: u64| WINDOW_NS / 2 * look;
        assert_eq!([0, 1].map(|look| load.look(WINDOW_NS * look, half(look))), [None, Some(0.5)]);
        spin(WINDOW_NS * 3 / 4);
        let used = load.look(WINDOW_NS * 2, half(2)).unwrap();
        assert!((0.75..1.0).contains(&used), "{used}");
    }
}
