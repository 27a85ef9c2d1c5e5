//! Allocations of a cycle: none for waiting, receiving and dynamics, and iceoryx2's one small counter of a loan for
//! each sent message. Alone in its file: the allocator is that of the whole program.
#![allow(unsafe_code)] // A global allocator is an unsafe trait; this one only counts and passes on.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::hint::black_box;

use masseter_model::dynamics::DynamicsConfig;
use masseter_model::dynamics::{Bodies, Equations, Motion, Reactions};
use masseter_model::geometry::{Mechanism, MechanismConfig, Pose, Twist};
use masseter_runtime::clock;
use masseter_runtime::messages::{Command, Contact, Event, FrameTap, Reading, State, Truth};
use masseter_runtime::realtime::Cycle;
use masseter_runtime::transport::{
    FramePublisher, FrameSubscriber, Node, Publisher, ScratchDomain, Subscriber, Topic,
};
use nalgebra::Vector6;

struct Counting;

thread_local! {
    /// Counts of this thread alone: the test harness allocates in its own threads.
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
    static LARGEST: Cell<u64> = const { Cell::new(0) };
}

#[global_allocator]
static COUNTING: Counting = Counting;

// SAFETY: every call goes to the system's allocator unchanged, so its guarantees hold.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        LARGEST.set(LARGEST.get().max(layout.size() as u64));
        // SAFETY: the caller's promises about `layout` go to the system's allocator.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: `pointer` came from `alloc` above, that is, from `System`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// Number and largest size of the allocations of `work`.
fn allocations_of(work: impl FnOnce()) -> (u64, u64) {
    LARGEST.set(0);
    let before = ALLOCATIONS.get();
    work();
    (ALLOCATIONS.get() - before, LARGEST.get())
}

/// Messages sent and received a measurement.
const MESSAGES: u64 = 1000;
/// iceoryx2's counter of a loan, bytes.
const LOAN_BYTES: u64 = 48;
const PERIOD_NS: u64 = 200_000;

fn check_topic<M: Topic>(node: &Node) {
    let subscriber = Subscriber::<M>::open(node).unwrap();
    let mut publisher = Publisher::<M>::open(node).unwrap();
    publisher.warm_up().unwrap();
    publisher.connect().unwrap();
    subscriber.connect().unwrap();

    let (count, largest_bytes) = allocations_of(|| {
        for _ in 0..MESSAGES {
            publisher.publish_by(clock::now_ns, |_| {}).unwrap();
        }
    });
    assert!(count <= MESSAGES && largest_bytes <= LOAN_BYTES, "{}: {count} of {largest_bytes}", M::TOPIC);

    let mut received = 0;
    let receiving = allocations_of(|| {
        while let Some(message) = black_box(subscriber.receive().unwrap()) {
            received += u64::from(!message.body().is_empty());
        }
        assert!(subscriber.receive().unwrap().is_none());
    });
    assert_eq!((receiving, received), ((0, 0), MESSAGES), "{}", M::TOPIC);
}

fn check_batches(node: &Node) {
    let subscriber = FrameSubscriber::open(node).unwrap();
    let mut publisher = FramePublisher::open(node).unwrap();
    let frames = [FrameTap::default(); 14];
    publisher.warm_up().unwrap();
    publisher.connect().unwrap();
    assert!(subscriber.receive().unwrap().is_none());

    let (count, largest_bytes) = allocations_of(|| {
        for _ in 0..MESSAGES {
            publisher.publish_by(clock::now_ns, frames).unwrap();
        }
    });
    assert!(count <= MESSAGES && largest_bytes <= LOAN_BYTES, "{count} of {largest_bytes}");

    let mut received = 0;
    let receiving = allocations_of(|| {
        while let Some(batch) = black_box(subscriber.receive().unwrap()) {
            received += batch.len();
        }
    });
    assert_eq!((receiving, received), ((0, 0), MESSAGES as usize * frames.len()));
}

fn check_dynamics() {
    let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
    let bodies = Bodies::from(&DynamicsConfig::default());
    let allocations = allocations_of(|| {
        let motion =
            Motion::new(&mechanism, &Pose::translation(0.0, 0.0, 0.27), &Twist::repeat(0.1)).unwrap();
        let equations = Equations::new(&bodies, &motion);
        let acceleration = equations.forward(&Vector6::repeat(1.0), &Vector6::zeros()).unwrap();
        let force_n = equations.inverse(&acceleration, &Vector6::zeros()).unwrap();
        black_box(Reactions::new(&bodies, &motion, &acceleration, &force_n));
    });
    assert_eq!(allocations, (0, 0));
}

#[test]
fn waiting_receiving_and_dynamics_allocate_nothing_and_sending_one_small_counter() {
    let domain = ScratchDomain::claim("test-allocations").unwrap();
    let node = Node::join(&domain).unwrap();
    check_topic::<Command>(&node);
    check_topic::<Reading>(&node);
    check_topic::<State>(&node);
    check_topic::<Truth>(&node);
    check_topic::<Contact>(&node);
    check_batches(&node);
    check_topic::<Event>(&node);
    check_dynamics();

    let subscriber = Subscriber::<Command>::open(&node).unwrap();
    let mut cycle = Cycle::new(clock::now_ns() + PERIOD_NS, PERIOD_NS);
    let waiting = allocations_of(|| {
        for _ in 0..20 {
            let wake = cycle.wait();
            let deadline_ns = wake.woke_ns + PERIOD_NS / 10;
            assert!(subscriber.latest_by(deadline_ns, cycle.waiter(), |_| true).unwrap().is_none());
        }
    });
    assert_eq!(waiting, (0, 0));
    assert!(allocations_of(|| drop(black_box(vec![1u8]))).0 > 0, "the counter counts");
}
