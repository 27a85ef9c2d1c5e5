//! The plant allocates nothing in a cycle, not even while it boots its drives.
#![allow(unsafe_code)] // A global allocator is an unsafe trait; this one only counts and passes on.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::hint::black_box;
use std::path::{Path, PathBuf};

use masseter_model::geometry::AXIS_NAMES;
use masseter_plant::core::PlantCore;
use masseter_runtime::messages::codes::{DriveRequest, DriveState};
use masseter_runtime::messages::{Command, LAYOUT_VERSION, Reading};
use masseter_runtime::realtime::Wake;
use masseter_scenario::{
    CommandFault, FaultConfig, FaultKindConfig, FoodConfig, Scenario, StimulusConfig, TeethConfig,
};

struct Counting;

thread_local! {
    /// Counts of this thread alone: the test harness allocates in its own threads.
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

#[global_allocator]
static COUNTING: Counting = Counting;

// SAFETY: every call goes to the system's allocator unchanged, so its guarantees hold.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller's promises about `layout` go to the system's allocator.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: `pointer` came from `alloc` above, that is, from `System`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

fn allocations_of(work: impl FnOnce()) -> u64 {
    let before = ALLOCATIONS.get();
    work();
    ALLOCATIONS.get() - before
}

/// One cycle with a request to the drives to hold their places.
fn cycle(plant: &mut PlantCore, cycle: u64, reading: &mut Reading) {
    let sync_ns = cycle * 1_000_000;
    let wake = Wake::on_time(cycle, sync_ns);
    plant.begin_cycle(wake).unwrap();
    plant.collect(sync_ns + 525_000).unwrap();
    plant.fill_reading(reading);
    let request = DriveRequest::Enable.code();
    let command = Command {
        cycle,
        target_m: reading.position_m,
        request,
        version: LAYOUT_VERSION,
        ..Command::default()
    };
    plant.apply(sync_ns + 545_000, Some(&command)).unwrap();
    for frame in plant.drain_frames() {
        black_box(frame);
    }
    plant.drain_events(&mut |event| {
        black_box(event);
    });
}

fn table() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/suite/push.csv")
}

/// One of every kind of the plant, each for a while, on the axes in turn, and stimuli.
fn injected() -> Scenario {
    let mut scenario = Scenario { teeth: Some(TeethConfig::default()), ..Scenario::default() };
    let of_plant = |kind: &FaultKindConfig| {
        use FaultKindConfig::{Bus, Command, Process};
        !matches!(kind, Bus(_) | Process(_) | Command(_))
    };
    for (place, &kind) in FaultKindConfig::ALL.iter().filter(|kind| of_plant(kind)).enumerate() {
        let size = kind.declared().size;
        let size = size.map(|size| size.dimension.si_unit().text(size.min.max(0.001).min(size.max)));
        scenario.faults.push(FaultConfig {
            name: Some(format!("fault_{place}")),
            from_s: Some(0.4 + 0.005 * place as f64),
            for_s: Some(0.1),
            axis: kind.takes("axis").then(|| AXIS_NAMES[place % AXIS_NAMES.len()].to_owned()),
            size: size.map(|text| text.parse().unwrap()),
            ..FaultConfig::new(kind)
        });
    }
    scenario.faults.push(FaultConfig {
        at_s: Some(0.1),
        after: Some("fault.fault_1".to_owned()),
        ..FaultConfig::new(CommandFault::Nan)
    });
    let at = |after: &str| StimulusConfig {
        after: Some(after.to_owned()),
        for_s: Some(0.1),
        ..StimulusConfig::at(0.0)
    };
    scenario.stimulus = vec![
        StimulusConfig {
            push_n: Some([1.0, 2.0, 3.0]),
            torque_n_m: Some([0.1, 0.0, 0.0]),
            ..at("fault.fault_0")
        },
        StimulusConfig { push_table: Some(table()), name: Some("table".to_owned()), ..at("fault.fault_0") },
        StimulusConfig { food: Some(FoodConfig::default()), ..at("fault.fault_0") },
        StimulusConfig { payload: Some("0.1 kg".parse().unwrap()), ..at("fault.fault_1") },
    ];
    scenario
}

#[test]
fn no_cycle_with_faults_and_stimuli_allocates() {
    let scenario = injected();
    scenario.validate().unwrap();
    let mut plant = PlantCore::new(&scenario, 0).unwrap();
    let mut reading = Reading::default();
    let running = allocations_of(|| (1..1000).for_each(|number| cycle(&mut plant, number, &mut reading)));
    assert_eq!(running, 0);
}

#[test]
fn no_cycle_of_the_plant_allocates() {
    let mut plant = PlantCore::new(&Scenario::default(), 0).unwrap();
    let mut reading = Reading::default();
    let running = allocations_of(|| (1..1000).for_each(|number| cycle(&mut plant, number, &mut reading)));
    assert_eq!(reading.drive_state, [DriveState::OperationEnabled.code(); 6], "it booted and was enabled");
    assert_eq!(running, 0);
    assert!(allocations_of(|| drop(black_box(vec![1u8]))) > 0, "the counter counts");
}
