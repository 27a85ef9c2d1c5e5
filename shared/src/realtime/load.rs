//! What share of its core a task uses, looked at fifty times a second.
//!
//! The kernel's count decides, since it is what the kernel throttles by: what a sleep costs is in it, 20 to 40 µs on some
//! virtual machines. As asking for it is a system call, it is asked only where so many sleeps could make the task too
//! busy.

use crate::clock;

/// Share of its core that a task may use. Well below the 95 % at which the kernel throttles real-time tasks.
pub(super) const MOST_USED: f64 = 0.85;
/// How long a look averages: a small part of the second in which the kernel grants real-time tasks 95 %, ns.
const WINDOW_NS: u64 = 20_000_000;
/// What a sleep costs at the dearest, ns (`masseter doctor` measures it).
const DEAREST_SLEEP_NS: u64 = 40_000;

/// The looks.
#[derive(Debug, Default)]
pub(super) struct Load {
    sleeps: u64,
    last: Option<Look>,
}

/// What a look saw.
#[derive(Debug)]
struct Look {
    at_ns: u64,
    /// For how long the task had been awake in all, ns.
    awake_ns: u64,
    sleeps: u64,
    /// The kernel's count, ns, if it was asked.
    used_ns: Option<u64>,
}

impl Load {
    /// The task sleeps once more.
    pub(super) fn count_sleep(&mut self) {
        self.sleeps += 1;
    }

    /// The share used since the last look, when it is time for one, of a task that has been awake for `awake_ns` in all.
    pub(super) fn look(&mut self, now_ns: u64, awake_ns: u64) -> Option<f64> {
        let sleeps = self.sleeps;
        let last = self.last.get_or_insert(Look { at_ns: now_ns, awake_ns, sleeps, used_ns: None });
        let passed_ns = now_ns.saturating_sub(last.at_ns);
        if passed_ns < WINDOW_NS {
            return None;
        }
        let share = |ns: u64| ns as f64 / passed_ns as f64;
        let awake_ns_since = awake_ns - last.awake_ns;
        let at_most = share(awake_ns_since + (sleeps - last.sleeps) * DEAREST_SLEEP_NS);
        let used_ns = (at_most > MOST_USED).then(clock::thread_cpu_ns);
        let used = used_ns.zip(last.used_ns).map(|(now_ns, before_ns)| share(now_ns - before_ns));
        *last = Look { at_ns: now_ns, awake_ns, sleeps, used_ns };
        Some(used.unwrap_or(share(awake_ns_since)))
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
    fn a_task_whose_few_sleeps_cannot_make_it_too_busy_is_not_asked_about() {
        let mut load = Load::default();
        load.count_sleep();
        let awake_ns = WINDOW_NS * 4 / 5;
        let looks = [(0, 0), (WINDOW_NS - 1, 100), (WINDOW_NS, awake_ns), (WINDOW_NS + 1, awake_ns)];
        assert_eq!(
            looks.map(|(now_ns, awake_ns)| load.look(now_ns, awake_ns)),
            [None, None, Some(0.8), None]
        );
        assert_eq!(load.last.unwrap().used_ns, None);
    }

    #[test]
    fn for_one_that_sleeps_often_the_kernels_count_decides_from_the_second_look_on() {
        let mut load = Load::default();
        let mut look = |number: u64| {
            let looked = load.look(WINDOW_NS * number, WINDOW_NS / 2 * number);
            (0..400).for_each(|_| load.count_sleep());
            looked
        };
        assert_eq!([0, 1].map(&mut look), [None, Some(0.5)]);
        spin(WINDOW_NS * 3 / 4);
        let used = look(2).unwrap();
        assert!((0.75..1.0).contains(&used), "{used}");
    }
}
