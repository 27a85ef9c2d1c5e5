//! The solvers allocate nothing, whichever way they go. Alone in its file: the allocator counts for
//! the whole process.
#![allow(unsafe_code)] // A global allocator is an unsafe trait; this one only counts and passes on.

use std::alloc::{GlobalAlloc, Layout, System};
use std::hint::black_box;
use std::sync::atomic::{AtomicU64, Ordering};

use masseter_controller::kinematics::{ForwardTracker, Options, Solutions, solve_newton, solve_seed};
use masseter_shared::geometry::{Actuators, LEGS, Mechanism, MechanismConfig};

struct Counting;

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

#[global_allocator]
static COUNTING: Counting = Counting;

// SAFETY: every call goes to the system's allocator unchanged, so its guarantees are this one's.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promises about `layout` are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: `pointer` came from `alloc` above, that is, from `System`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

fn allocations_of(work: impl FnOnce()) -> u64 {
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    work();
    ALLOCATIONS.load(Ordering::Relaxed) - before
}

#[test]
fn no_path_of_the_forward_kinematics_allocates() {
    let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
    let mut tracker = ForwardTracker::new(mechanism.clone());
    let neutral = Actuators { slide_m: [0.0; LEGS], leg_m: [0.27; LEGS] };
    let nearby = Actuators { leg_m: [0.2701, 0.27, 0.2699], ..neutral };
    let unassemblable = Actuators { leg_m: [0.30, 0.30, 0.20], ..neutral };
    let options = Options::default();
    let solving = allocations_of(|| {
        for input in [neutral, nearby, neutral] {
            assert!(black_box(tracker.update(&input)).is_ok());
        }
        let mut guessing = ForwardTracker::with_guess(mechanism.clone(), [0.3, 2.9, 1.0]);
        assert!(black_box(guessing.update(&nearby)).is_ok());
        assert!(black_box(tracker.update(&unassemblable)).is_err());
        assert_eq!(Solutions::new(&mechanism, &neutral).map(|all| all.count()), Ok(16));
        assert!(black_box(solve_seed(&mechanism, &nearby, &[1.4; LEGS], &options)).is_ok());
        assert!(black_box(solve_newton(&mechanism, &nearby, &[1.4; LEGS], &options)).is_ok());
    });
    assert_eq!(solving, 0);
    assert!(allocations_of(|| drop(black_box(vec![1u8]))) > 0, "the counter counts");
}
