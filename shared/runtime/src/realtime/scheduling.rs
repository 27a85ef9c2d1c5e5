//! Core, real-time priority and locked memory of a process: the request, and the kernel's grant, read back.
//!
//! A refusal is reported and never ends a run: screen, manifest and `--require-rt` judge it.

use std::{fs, io, thread};

use masseter_scenario::wording::listed;
use rustix::io::Errno;
use rustix::mm::{MlockAllFlags, mlockall};
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use serde::{Deserialize, Serialize};

/// The scheduling that a process requests.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct SchedulingRequest {
    /// The only core to run on; none leaves the choice to the kernel.
    pub core: Option<usize>,
    /// SCHED_FIFO priority, 1 to 99; none keeps the ordinary policy.
    pub fifo_priority: Option<u8>,
    /// Whether all memory is to be locked into RAM.
    pub locked_memory: bool,
}

/// The scheduling of a process by the kernel's report, and the reasons for refusals.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Obtained {
    /// The request.
    #[serde(alias = "wanted")]
    pub requested: SchedulingRequest,
    /// The only core the process may run on, if there is only one.
    pub core: Option<usize>,
    /// Its SCHED_FIFO priority, if it has that policy.
    pub fifo_priority: Option<u8>,
    /// Whether its memory is locked.
    pub locked_memory: bool,
    /// One line for each refusal, with the remedy.
    pub refusals: Vec<String>,
}

/// Requests `request`, then reads back the granted scheduling. The lock of memory holds for the whole process, the rest
/// for the calling thread.
///
/// ```
/// use masseter_runtime::realtime::scheduling::{SchedulingRequest, obtain};
///
/// let request = SchedulingRequest { core: None, fifo_priority: Some(80), locked_memory: false };
/// let obtained = std::thread::spawn(move || obtain(request)).join().expect("obtain does not panic");
/// assert_eq!(obtained.fifo_priority == Some(80), obtained.refusals.is_empty());
/// ```
pub fn obtain(request: SchedulingRequest) -> Obtained {
    let pinned = request.core.map_or(Ok(()), |core| stay_on(&[core]));
    let fifo = request.fifo_priority.map_or(Ok(()), fifo::set);
    let lock = || mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE).map_err(io::Error::from);
    let locked = if request.locked_memory { lock() } else { Ok(()) };
    let (core, fifo_priority, locked_memory) = (pinned_core(), fifo::get(), is_locked());
    let of_core = request.core.zip(refusal(pinned, core == request.core));
    let of_core = of_core.map(|(requested, why)| refused_core(requested, &why, &usable_cores()));
    let refused =
        |what: String, why| format!("{what} refused ({why}): 'masseter doctor' shows how to allow it");
    let of_fifo = request.fifo_priority.zip(refusal(fifo, fifo_priority == request.fifo_priority));
    let of_fifo = of_fifo.map(|(requested, why)| refused(format!("SCHED_FIFO {requested}"), why));
    let of_memory = refusal(locked, locked_memory || !request.locked_memory);
    let of_memory = of_memory.map(|why| refused("locked memory".to_owned(), why));
    let refusals = of_core.into_iter().chain(of_fifo).chain(of_memory).collect();
    Obtained { requested: request, core, fifo_priority, locked_memory, refusals }
}

/// The reason for a refused request, if any. The kernel may accept a request without effect: the value read back
/// counts.
fn refusal(asked: io::Result<()>, is_granted: bool) -> Option<String> {
    match asked {
        Err(error) => Some(error.to_string()),
        Ok(()) => (!is_granted).then(|| "without effect".to_owned()),
    }
}

fn refused_core(core: usize, why: &str, choice: &[usize]) -> String {
    let remedy = match choice {
        [only] => format!(
            "only core {only} may be used, and controller and plant delay each other there: 'masseter doctor' shows how \
             to allow two"
        ),
        choice => format!("choose two with --cores, of {}", listed(choice)),
    };
    format!("core {core} refused ({why}): {remedy}")
}

/// The cores that the calling thread may run on.
pub fn allowed_cores() -> Vec<usize> {
    let Ok(set) = sched_getaffinity(None) else { return Vec::new() };
    (0..CpuSet::MAX_CPU).filter(|&core| set.is_set(core)).collect()
}

/// The cores to which a thread of this process can be pinned. A cpuset limits these cores. An inherited affinity mask
/// and `isolcpus=`, which takes cores out of every mask, do not.
pub fn usable_cores() -> Vec<usize> {
    let stays_on = |core: &usize| stay_on(&[*core]).is_ok() && pinned_core() == Some(*core);
    // A thread of its own, so that the caller keeps its mask.
    let tried = thread::spawn(move || (0..CpuSet::MAX_CPU).filter(stays_on).collect());
    tried.join().expect("asking the kernel does not panic")
}

fn stay_on(cores: &[usize]) -> io::Result<()> {
    let mut set = CpuSet::new();
    for &core in cores {
        if core >= CpuSet::MAX_CPU {
            return Err(Errno::INVAL.into());
        }
        set.set(core);
    }
    Ok(sched_setaffinity(None, &set)?)
}

/// Keeps the calling thread, and its later threads, off the cores of real-time tasks. If no other core is allowed, only
/// as many of the last cores are excluded as leave one.
pub fn keep_off(cores: &[usize]) {
    if let Some(left) = cores_beside(&allowed_cores(), cores) {
        // These cores are allowed already. The thread keeps its mask if the kernel refuses.
        let _ = stay_on(&left);
    }
}

/// The allowed cores without `cores`; without the last ones of `cores`, if no other core is left.
fn cores_beside(allowed: &[usize], cores: &[usize]) -> Option<Vec<usize>> {
    (0..cores.len()).find_map(|first| {
        let left: Vec<_> = allowed.iter().copied().filter(|core| !cores[first..].contains(core)).collect();
        (!left.is_empty()).then_some(left)
    })
}

fn pinned_core() -> Option<usize> {
    match allowed_cores()[..] {
        [only] => Some(only),
        _ => None,
    }
}

fn is_locked() -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let locked_kb = status.lines().find_map(|line| line.strip_prefix("VmLck:"));
    locked_kb.is_some_and(|kb| !kb.trim().starts_with("0 "))
}

/// The only `unsafe` here: no maintained crate wraps the scheduling policy of a thread.
#[allow(unsafe_code)]
mod fifo {
    use std::io;

    /// Gives the calling thread SCHED_FIFO at `priority`.
    pub(super) fn set(priority: u8) -> io::Result<()> {
        let parameters = libc::sched_param { sched_priority: i32::from(priority) };
        // SAFETY: `parameters` outlives the call, which only reads it; 0 names the calling thread.
        match unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) } {
            0 => Ok(()),
            _ => Err(io::Error::last_os_error()),
        }
    }

    /// The calling thread's SCHED_FIFO priority, if it has that policy.
    pub(super) fn get() -> Option<u8> {
        let mut parameters = libc::sched_param { sched_priority: 0 };
        // SAFETY: `parameters` outlives both calls; the second only writes it; 0 names the calling thread.
        let (policy, result) =
            unsafe { (libc::sched_getscheduler(0), libc::sched_getparam(0, &raw mut parameters)) };
        (policy == libc::SCHED_FIFO && result == 0).then_some(parameters.sched_priority as u8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_core_that_does_not_exist_is_refused_by_its_number() {
        let request = SchedulingRequest { core: Some(4096), fifo_priority: None, locked_memory: false };
        let obtained = std::thread::spawn(move || obtain(request)).join().unwrap();
        assert!(obtained.refusals[0].starts_with("core 4096 refused"), "{:?}", obtained.refusals);
    }

    #[test]
    fn pinning_is_read_back() {
        let core = allowed_cores()[0];
        let request = SchedulingRequest { core: Some(core), fifo_priority: None, locked_memory: false };
        let obtained = std::thread::spawn(move || obtain(request)).join().unwrap();
        assert_eq!((obtained.core, obtained.refusals), (Some(core), Vec::new()));
    }

    #[test]
    fn an_inherited_mask_does_not_limit_the_usable_cores() {
        let usable = usable_cores();
        let within = thread::spawn(move || {
            let before = allowed_cores();
            stay_on(&before[..1]).unwrap();
            (before, usable_cores(), allowed_cores().len())
        });
        let (before, usable_within, allowed_within) = within.join().unwrap();
        assert!(before.iter().all(|core| usable.contains(core)), "{before:?} of {usable:?}");
        assert_eq!((usable_within, allowed_within), (usable, 1));
    }

    #[test]
    fn without_a_free_core_the_last_real_time_core_stays_free_longest() {
        let cases: [(&[usize], Option<&[usize]>); 5] = [
            (&[0, 1, 2, 3], Some(&[2, 3])),
            (&[0, 1], Some(&[0])),
            (&[0], Some(&[0])),
            (&[1], None),
            (&[5], Some(&[5])),
        ];
        for (allowed, expected) in cases {
            assert_eq!(cores_beside(allowed, &[0, 1]).as_deref(), expected, "{allowed:?}");
        }
    }

    #[test]
    fn a_grant_without_effect_counts_as_a_refusal() {
        let no = || Err(io::Error::other("no"));
        let cases = [
            (Ok(()), true, None),
            (Ok(()), false, Some("without effect")),
            (no(), false, Some("no")),
            (no(), true, Some("no")),
        ];
        for (asked, is_granted, expected) in cases {
            assert_eq!(refusal(asked, is_granted).as_deref(), expected);
        }
    }

    #[test]
    fn a_refused_core_comes_with_its_remedy() {
        assert!(refused_core(4, "EINVAL", &[0, 2]).contains("choose two with --cores, of 0, 2"));
        assert!(refused_core(1, "EINVAL", &[0]).contains("'masseter doctor' shows how to allow two"));
    }
}
