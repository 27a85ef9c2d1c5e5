//! Scenarios of the master with scripted drives.

mod boot;
mod enabling;
mod logs;
mod lost;
mod peer;
mod recovery;
mod stops;
mod targets;

use masseter_can::canopen::NodeId;
use masseter_can::cia402::DriveState;
use masseter_model::geometry::AXES;
use masseter_runtime::messages::codes::{BootPhase, Cause, DriveRequest, EventKind, NO_DRIVE_STATE, Source};
use masseter_runtime::messages::{Command, Event, LAYOUT_VERSION, Reading};
use masseter_runtime::realtime::Wake;
use masseter_scenario::Scenario;
use peer::{Peer, Wires};

use super::Master;

const PERIOD_NS: u64 = 1_000_000;
/// Time of the rig's switch-on, ns: not 0, because time does not begin with the rig.
const EPOCH_NS: u64 = 1_000_000_000;

/// A master and six scripted drives on two wires.
struct Bench {
    master: Master,
    wires: Wires,
    reading: Reading,
    events: Vec<Event>,
    cycle: u64,
    /// How far the targets of its commands are beyond the measured positions, m.
    offset_m: f64,
}

impl Bench {
    /// All parts switched on, with drives by the master's expectations.
    fn new() -> Self {
        Self::of(Scenario::default())
    }

    /// The same with a scenario of its own.
    fn of(mut scenario: Scenario) -> Self {
        scenario.mechanism.strokes.leg_m = scenario.mechanism.strokes.slide_m;
        let ids = scenario.can.node_ids.map(|id| NodeId::new(id).unwrap());
        Self {
            master: Master::new(&scenario, EPOCH_NS).unwrap(),
            wires: Wires::new(ids.map(|id| Peer::new(id, &scenario.profile(0).identity))),
            reading: Reading::default(),
            events: Vec::new(),
            cycle: 0,
            offset_m: 0.0,
        }
    }

    /// The drive of an axis.
    fn drive(&mut self, axis: usize) -> &mut Peer {
        self.wires.peer(axis)
    }

    fn now_ns(&self) -> u64 {
        EPOCH_NS + self.cycle * PERIOD_NS
    }

    /// A cycle with that request, or without any command.
    fn cycle(&mut self, request: Option<DriveRequest>) {
        self.cycle_with(|command| Some(Command { request: request?.code(), ..command }));
    }

    /// A cycle with the command that `make` makes of one without a request.
    fn cycle_with(&mut self, make: impl FnOnce(Command) -> Option<Command>) {
        self.cycle += 1;
        let sync_ns = self.now_ns();
        let wake = Wake::on_time(self.cycle, sync_ns);
        self.wires.begin(sync_ns);
        self.master.begin_cycle(wake, &mut self.wires);
        self.master.collect(sync_ns + 500_000, &mut self.wires);
        self.master.fill_reading(&mut self.reading);
        let target_m = self.reading.position_m.map(|position_m| position_m + self.offset_m);
        let cycle = self.cycle;
        let command = make(Command { cycle, target_m, version: LAYOUT_VERSION, ..Command::default() });
        self.master.apply(sync_ns + 550_000, command.as_ref(), &mut self.wires);
        self.master.drain_events(&mut |event| self.events.push(event));
    }

    fn cycles(&mut self, count: u64, request: DriveRequest) {
        (0..count).for_each(|_| self.cycle(Some(request)));
    }

    /// Cycles without motion, until the boot of an axis is in that phase.
    fn cycles_until(&mut self, axis: usize, phase: BootPhase) {
        for _ in 0..5000 {
            if self.master.drives[axis].boot.phase == phase {
                return;
            }
            self.cycle(Some(DriveRequest::Off));
        }
        panic!("{phase} was not reached, but {}", self.master.drives[axis].boot.phase);
    }

    /// Boots and enables all drives.
    fn enabled() -> Self {
        let mut bench = Self::new();
        bench.cycles(400, DriveRequest::Enable);
        assert!(bench.all_are(DriveState::OperationEnabled), "{:?}", bench.events);
        bench
    }

    fn all_are(&mut self, state: DriveState) -> bool {
        (0..AXES).all(|axis| self.drive(axis).power == state)
    }

    fn nobody_is_enabled(&mut self) -> bool {
        (0..AXES).all(|axis| self.drive(axis).power != DriveState::OperationEnabled)
    }

    fn events_of(&self, kind: EventKind) -> impl Iterator<Item = &Event> {
        self.events.iter().filter(move |event| event.kind == kind.code())
    }

    fn causes(&self, kind: EventKind) -> Vec<Cause> {
        self.events_of(kind).map(|event| Cause::try_from(event.cause).unwrap()).collect()
    }
}
