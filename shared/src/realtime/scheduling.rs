//! What a process asks of the kernel, and what it got, read back.
//!
//! Nothing here fails a run: a refusal is a fact that screen, manifest and `--require-rt` judge.

use std::{fs, thread};

use rustix::io::Errno;
use rustix::mm::{MlockAllFlags, mlockall};
use rustix::process::getpid;
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use serde::{Deserialize, Serialize};

/// What a process asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Wanted {
    /// The core to stay on; none leaves the choice to the kernel.
    pub core: Option<usize>,
    /// SCHED_FIFO priority, 1 to 99; none keeps the ordinary policy.
    pub fifo_priority: Option<u8>,
    /// Whether all memory is to be locked into RAM.
    pub locked_memory: bool,
}

/// What it has, as the kernel reports it, and why anything was refused.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Obtained {
    /// The request.
    pub wanted: Wanted,
    /// The only core the process may run on, if there is only one.
    pub core: Option<usize>,
    /// Its SCHED_FIFO priority, if it has that policy.
    pub fifo_priority: Option<u8>,
    /// Whether its memory is locked.
    pub locked_memory: bool,
    /// One line a refusal, with what helps.
    pub refusals: Vec<String>,
}

/// Asks for `wanted` on behalf of the calling thread (memory: of the process), then reads back.
pub fn obtain(wanted: Wanted) -> Obtained {
    // What the kernel says of each; where it agrees without effect, what is read back tells.
    let core = wanted.core.map(|core| pin(core).map_err(|error| error.to_string()));
    let fifo = wanted.fifo_priority.map(|priority| fifo::set(priority).map_err(|error| error.to_string()));
    let locked = wanted
        .locked_memory
        .then(|| mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE).map_err(|error| error.to_string()));
    let mut obtained = Obtained {
        wanted,
        core: pinned_core(),
        fifo_priority: fifo::get(),
        locked_memory: is_locked(),
        refusals: Vec::new(),
    };
    let pinned = refusal(core, obtained.core == wanted.core);
    let fifo = refusal(fifo, obtained.fifo_priority == wanted.fifo_priority);
    let locked = refusal(locked, obtained.locked_memory);
    obtained
        .refusals
        .extend(pinned.zip(wanted.core).map(|(why, core)| refused_core(core, &why, &usable_cores())));
    obtained.refusals.extend(fifo.zip(wanted.fifo_priority).map(|(why, priority)| {
        format!("SCHED_FIFO {priority} refused ({why}): `masseter doctor` tells how to allow it")
    }));
    obtained.refusals.extend(
        locked.map(|why| format!("locked memory refused ({why}): `masseter doctor` tells how to allow it")),
    );
    obtained
}

/// Why something asked for was not granted, if it was not.
fn refusal(asked: Option<Result<(), String>>, is_granted: bool) -> Option<String> {
    match asked? {
        Err(error) => Some(error),
        Ok(()) if !is_granted => Some("without effect".to_owned()),
        Ok(()) => None,
    }
}

fn refused_core(core: usize, why: &str, choice: &[usize]) -> String {
    let choice: Vec<_> = choice.iter().map(usize::to_string).collect();
    let remedy = match &choice[..] {
        [only] => format!(
            "only core {only} may be used, on which controller and plant keep each other waiting: `masseter doctor` \
             tells how to allow two"
        ),
        choice => format!("choose two among {} with --cores", choice.join(", ")),
    };
    format!("core {core} refused ({why}): {remedy}")
}

/// The cores that the calling thread may run on.
pub fn allowed_cores() -> Vec<usize> {
    let Ok(set) = sched_getaffinity(None) else { return Vec::new() };
    (0..CpuSet::MAX_CPU).filter(|&core| set.is_set(core)).collect()
}

/// The cores on which a thread of this process can be made to stay. An affinity mask that was inherited is no bound, nor
/// is `isolcpus=`, which takes cores out of every mask; a cpuset is.
pub fn usable_cores() -> Vec<usize> {
    let stays_on = |core: &usize| pin(*core).is_ok() && pinned_core() == Some(*core);
    // In a thread of its own, which takes the mask along when it ends.
    let tried = thread::spawn(move || (0..CpuSet::MAX_CPU).filter(stays_on).collect());
    tried.join().expect("asking the kernel does not panic")
}

fn pin(core: usize) -> Result<(), Errno> {
    if core >= CpuSet::MAX_CPU {
        return Err(Errno::INVAL);
    }
    stay_on(&[core])
}

fn stay_on(cores: &[usize]) -> Result<(), Errno> {
    let mut set = CpuSet::new();
    for &core in cores {
        set.set(core);
    }
    sched_setaffinity(None, &set)
}

/// Keeps the calling thread, and those that it starts, off the cores of real-time tasks: off all of them, or off the
/// last ones where nothing else is left. On the only core it stays.
pub fn keep_off(cores: &[usize]) {
    if let Some(left) = cores_beside(&allowed_cores(), cores) {
        // They are some of those that it runs on; if they are refused all the same, it runs on as before.
        let _ = stay_on(&left);
    }
}

/// Those of the allowed ones that are none of these, or of as many of the last of these as possible.
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
    let status =
        fs::read_to_string(format!("/proc/{}/status", getpid().as_raw_nonzero())).unwrap_or_default();
    let locked_kb = status.lines().find_map(|line| line.strip_prefix("VmLck:"));
    locked_kb.is_some_and(|kb| !kb.trim().starts_with("0 "))
}

/// The one file section with `unsafe`: no kept crate wraps the scheduling policy of a thread.
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
    fn a_core_that_does_not_exist_is_refused_and_said() {
        let wanted = Wanted { core: Some(4096), fifo_priority: None, locked_memory: false };
        let obtained = std::thread::spawn(move || obtain(wanted)).join().unwrap();
        assert!(obtained.refusals[0].starts_with("core 4096 refused"), "{:?}", obtained.refusals);
    }

    #[test]
    fn pinning_is_read_back() {
        let core = allowed_cores()[0];
        let wanted = Wanted { core: Some(core), fifo_priority: None, locked_memory: false };
        let obtained = std::thread::spawn(move || obtain(wanted)).join().unwrap();
        assert_eq!((obtained.core, obtained.refusals), (Some(core), Vec::new()));
    }

    #[test]
    fn a_mask_that_was_inherited_is_no_bound() {
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
    fn who_has_no_core_of_his_own_leaves_the_last_one_alone_longest() {
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
    fn what_is_granted_without_effect_is_refused() {
        let cases = [
            (None, false, None),
            (Some(Ok(())), true, None),
            (Some(Ok(())), false, Some("without effect")),
            (Some(Err("no".to_owned())), false, Some("no")),
        ];
        for (asked, is_granted, expected) in cases {
            assert_eq!(refusal(asked, is_granted).as_deref(), expected);
        }
    }

    #[test]
    fn a_refused_core_is_told_with_what_helps() {
        assert!(refused_core(4, "EINVAL", &[0, 2]).contains("choose two among 0, 2 with --cores"));
        assert!(refused_core(1, "EINVAL", &[0]).contains("`masseter doctor` tells how to allow two"));
    }
}
