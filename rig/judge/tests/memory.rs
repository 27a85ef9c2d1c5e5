//! What the analysis of a run without a report holds. Alone in its file: the allocator is that of the whole
//! program.
#![allow(unsafe_code)] // A global allocator is an unsafe trait; this one only counts and passes on.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use masseter_can::canopen::sync;
use masseter_can::{Tapped, TappedFrame};
use masseter_judge::Analysis;
use masseter_recording::Recorded;
use masseter_runtime::messages::codes::ControllerState;
use masseter_runtime::messages::{Command, Reading, State, Truth, tap};
use masseter_runtime::named::Declared;
use masseter_scenario::Scenario;

struct Counting;

thread_local! {
    /// Of this thread alone: the test harness allocates in its own.
    static HELD: Cell<i64> = const { Cell::new(0) };
}

#[global_allocator]
static COUNTING: Counting = Counting;

// SAFETY: every call goes to the system's allocator unchanged, so its guarantees are this one's.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        HELD.set(HELD.get() + layout.size() as i64);
        // SAFETY: the caller's promises about `layout` are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HELD.set(HELD.get() - layout.size() as i64);
        // SAFETY: `pointer` came from `alloc` above, that is, from `System`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// Takes the messages of a motion's cycle of 1 ms.
fn take_cycle(analysis: &mut Analysis, cycle: u64) {
    let (sampled_ns, quaternion) = (cycle * 1_000_000, [1.0, 0.0, 0.0, 0.0]);
    let (frame, queued_ns) = (sync::frame(), Some(sampled_ns));
    let tapped = Tapped::Frame(TappedFrame { frame, time_ns: sampled_ns, queued_ns });
    let messages: [Recorded; 5] = [
        Reading { seq: cycle, cycle, sampled_ns, ..Reading::default() }.into(),
        Truth { seq: cycle, cycle, sampled_ns, quaternion_wxyz: quaternion, ..Truth::default() }.into(),
        Command { seq: cycle, cycle, ..Command::default() }.into(),
        State {
            seq: cycle,
            cycle,
            reading_cycle: cycle,
            sampled_ns,
            controller_state: ControllerState::Running.code(),
            desired_quaternion_wxyz: quaternion,
            estimated_quaternion_wxyz: quaternion,
            ..State::default()
        }
        .into(),
        tap::encode(0, &tapped).into(),
    ];
    for message in &messages {
        analysis.take(message).unwrap();
    }
}

#[test]
fn without_a_report_it_holds_a_megabyte_and_grows_by_eight_bytes_a_second() {
    const SECOND: u64 = 1000;
    let before = HELD.get();
    let mut analysis = Analysis::without_report(&Scenario::default(), &Declared::default());
    let mut held_after = |from_s, until_s| {
        (from_s * SECOND..until_s * SECOND).for_each(|cycle| take_cycle(&mut analysis, cycle));
        HELD.get() - before
    };
    let early = held_after(0, 20);
    assert!((500_000..1_500_000).contains(&early), "{early} bytes");
    let grown = held_after(20, 120) - early;
    // A list has room for up to twice what it holds.
    assert!((0..=2 * 8 * 120).contains(&grown), "{grown} bytes in 100 s");
    assert!(analysis.finish(false, &[]).tracking.rms_noise_mm.is_some(), "it has measured each second");
}
