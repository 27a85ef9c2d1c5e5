//! SCHED_FIFO and locked memory: requests both from the kernel, as a run does.

use std::thread;

use masseter_runtime::realtime::scheduling::{Obtained, SchedulingRequest, obtain};
use masseter_scenario::RealtimeConfig;

use super::container;
use super::finding::Finding;
use masseter_machine::SystemRoot;

/// Raises both limits for this user, from the next login on.
const RAISE_LIMITS: &str = "printf '%s - rtprio 95\\n%s - memlock unlimited\\n' \"$USER\" \"$USER\" \
                            | sudo tee /etc/security/limits.d/masseter.conf  # then log in again";

/// All findings of this family.
pub(super) fn examine(root: &SystemRoot) -> Vec<Finding> {
    let nothing = SchedulingRequest { core: None, fifo_priority: None, locked_memory: false };
    let priority = RealtimeConfig::default().priority;
    vec![
        fifo(root, priority, &try_out(SchedulingRequest { fifo_priority: Some(priority), ..nothing })),
        locked_memory(root, &try_out(SchedulingRequest { locked_memory: true, ..nothing })),
    ]
}

/// Requests scheduling in a thread of its own, so that this one keeps its priority.
fn try_out(request: SchedulingRequest) -> Obtained {
    thread::spawn(move || obtain(request)).join().expect("asking the kernel does not panic")
}

fn fifo(root: &SystemRoot, priority: u8, obtained: &Obtained) -> Finding {
    const CHECK: &str = "SCHED_FIFO";
    if obtained.fifo_priority == Some(priority) {
        return Finding::ok(CHECK, format!("priority {priority} granted"));
    }
    Finding::bad(
        CHECK,
        format!("priority {priority} refused"),
        "every ordinary task can delay a cycle by milliseconds",
    )
    .with_remedy(grant_command(root))
}

/// The command that lets this user have SCHED_FIFO.
pub(super) fn grant_command(root: &SystemRoot) -> String {
    container::start_with(root, "--cap-add SYS_NICE --ulimit rtprio=95", RAISE_LIMITS)
}

fn locked_memory(root: &SystemRoot, obtained: &Obtained) -> Finding {
    const CHECK: &str = "locked memory";
    if obtained.locked_memory {
        return Finding::ok(CHECK, "granted");
    }
    Finding::bad(CHECK, "refused", "a page fault in a cycle takes microseconds, from disk milliseconds")
        .with_remedy(container::start_with(root, "--ulimit memlock=-1", RAISE_LIMITS))
}

#[cfg(test)]
mod tests {
    use super::super::finding::Level;
    use super::*;
    use masseter_machine::fixture::Fixture;

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
        for (granted, level) in [(Some(80), Level::Ok), (Some(10), Level::Bad), (None, Level::Bad)] {
            assert_eq!(fifo(&machine.root(), 80, &obtained(granted, false)).level, level);
        }
        assert_eq!(locked_memory(&machine.root(), &obtained(None, true)).level, Level::Ok);
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
}
