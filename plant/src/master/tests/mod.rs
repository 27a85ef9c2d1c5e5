//! Scenarios of the master with scripted drives.

mod boot;
mod peer;
mod recovery;

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
/// When the rig is switched on: time does not begin with it.
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
    /// Everything switched on, the drives as the master expects them.
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

mod enabling {
    //! The way of all drives to "operation enabled": together, within a time, or not at all.

    use masseter_can::canopen::{Emergency, EmergencyCode};
    use masseter_can::cia402::Statusword;

    use super::*;

    /// The axis l2.
    const L2: usize = 4;

    /// The bench with a drive that does not leave a state once it is ready, until the others wait for it.
    fn stuck(state: DriveState) -> Bench {
        let mut bench = Bench::new();
        bench.cycles(400, DriveRequest::Off);
        bench.drive(L2).get_stuck_in(state);
        bench
    }

    /// Every state that a drive had from now on, during these cycles.
    fn states(bench: &mut Bench, axis: usize, cycles: u64) -> Vec<DriveState> {
        let mut states = Vec::new();
        for _ in 0..cycles {
            bench.cycle(Some(DriveRequest::Enable));
            states.push(bench.drive(axis).power);
        }
        states.dedup();
        states
    }

    #[test]
    fn nobody_is_switched_on_while_one_has_safe_torque_off_and_all_are_once_it_is_back() {
        use DriveState::{OperationEnabled, ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn};
        let mut bench = stuck(SwitchOnDisabled);
        assert_eq!(states(&mut bench, 0, 4000), [SwitchOnDisabled, ReadyToSwitchOn]);
        assert_eq!(bench.causes(EventKind::Fault), []);
        let told = *bench.events_of(EventKind::Notice).next().unwrap();
        assert_eq!((told.cause, told.axis), (Cause::WaitsForDrive.code(), L2 as u32));
        assert_eq!(told.value as u16, Statusword::for_state(SwitchOnDisabled).0);
        bench.drive(L2).be_free();
        assert_eq!(states(&mut bench, 0, 10), [ReadyToSwitchOn, SwitchedOn, OperationEnabled]);
        bench.cycles(5000, DriveRequest::Enable);
        assert!(bench.all_are(OperationEnabled));
        assert_eq!(bench.causes(EventKind::Notice).len(), 1, "the drive is named once");
    }

    #[test]
    fn a_drive_that_does_not_become_ready_in_time_ends_the_start() {
        let mut bench = stuck(DriveState::SwitchOnDisabled);
        bench.cycles(5100, DriveRequest::Enable);
        assert_eq!(bench.causes(EventKind::Fault), [Cause::NotReady]);
        assert!((0..AXES).all(|axis| !bench.drive(axis).power.is_powered()));
        bench.cycles(10, DriveRequest::Off);
        bench.drive(L2).be_free();
        bench.cycles(100, DriveRequest::Enable);
        assert!(bench.nobody_is_enabled(), "for good");
    }

    #[test]
    fn all_are_off_and_each_late_drive_is_named_with_its_state_and_emergency() {
        let mut bench = stuck(DriveState::SwitchedOn);
        bench.drive(L2).power = DriveState::SwitchOnDisabled;
        bench.drive(1).get_stuck_in(DriveState::SwitchedOn);
        bench.drive(1).power = DriveState::SwitchOnDisabled;
        bench.cycles(1000, DriveRequest::Enable);
        assert_eq!(bench.drive(0).power, DriveState::OperationEnabled);
        let (id, now_ns) = (bench.drive(L2).id, bench.now_ns());
        let low = Emergency { code: EmergencyCode::LOGIC_SUPPLY, register: 0x05, vendor: [0; 5] };
        bench.wires.wire(1).arrive(now_ns, low.frame(id));
        bench.cycles(502, DriveRequest::Enable);
        let late: Vec<_> = bench
            .events_of(EventKind::Fault)
            .filter(|event| event.cause == Cause::NotEnabled.code())
            .map(|event| (event.axis, event.value as u16, event.limit as u16))
            .collect();
        let on = Statusword::for_state(DriveState::SwitchedOn).0;
        assert_eq!(late, [(1, on, 0), (4, on, 0x5112)]);
        (0..AXES).for_each(|axis| bench.drive(axis).be_free());
        bench.cycles(10, DriveRequest::Enable);
        assert!(bench.all_are(DriveState::SwitchOnDisabled));
        assert_eq!(bench.reading.master_fault, 1);
    }

    #[test]
    fn a_fault_on_the_way_to_operation_is_not_reset() {
        let mut bench = stuck(DriveState::SwitchOnDisabled);
        bench.cycles(10, DriveRequest::Enable);
        bench.drive(L2).power = DriveState::Fault;
        bench.cycles(100, DriveRequest::Enable);
        assert_eq!(bench.causes(EventKind::Fault), [Cause::DriveFault]);
        assert_eq!(bench.drive(L2).power, DriveState::Fault);
        assert!(bench.nobody_is_enabled());
    }
}

mod lost {
    //! Drives that are lost, or restart, before they are started.

    use super::*;

    #[test]
    fn a_drive_that_falls_silent_after_its_configuration_is_lost_before_any_is_started() {
        let mut bench = Bench::new();
        // The one that is missing keeps the others from being started.
        bench.drive(0).is_dead = true;
        bench.cycles_until(5, BootPhase::Configured);
        bench.drive(5).is_dead = true;
        bench.cycles(145, DriveRequest::Off);
        assert_eq!(bench.causes(EventKind::Fault), []);
        bench.cycles(10, DriveRequest::Off);
        let fault = *bench.events_of(EventKind::Fault).next().unwrap();
        assert_eq!((fault.cause, fault.axis, fault.limit), (Cause::HeartbeatLost.code(), 5, 150.0));
        assert!((150.0..152.0).contains(&fault.value), "{} ms", fault.value);
        assert_eq!(bench.master.drives[5].boot.phase, BootPhase::Waiting);
        bench.cycles(400, DriveRequest::Off);
        assert_eq!(bench.causes(EventKind::Fault), [Cause::HeartbeatLost], "once");
        (bench.drive(0).is_dead, bench.drive(5).is_dead) = (false, false);
        bench.cycles(1500, DriveRequest::Off);
        bench.cycles(30, DriveRequest::Enable);
        assert!(bench.all_are(DriveState::OperationEnabled), "{:?}", bench.events);
    }

    impl Bench {
        /// Restarts a drive so many times in the midst of its boot.
        fn interrupt_boot(&mut self, axis: usize, times: usize) {
            for _ in 0..times {
                self.cycles_until(axis, BootPhase::Configuring);
                self.cycles(5, DriveRequest::Off);
                self.drive(axis).cycle_power();
                self.cycles(2, DriveRequest::Off);
            }
        }
    }

    #[test]
    fn a_drive_may_restart_three_times_while_it_boots_and_is_given_up_at_the_fourth() {
        let mut bench = Bench::new();
        bench.interrupt_boot(3, 3);
        bench.cycles(600, DriveRequest::Enable);
        assert!(bench.all_are(DriveState::OperationEnabled), "{:?}", bench.events);
        assert_eq!(bench.causes(EventKind::Fault), []);

        let mut bench = Bench::new();
        bench.interrupt_boot(3, 4);
        let fault = *bench.events_of(EventKind::Fault).next().unwrap();
        assert_eq!((fault.cause, fault.axis), (Cause::NodeRestarted.code(), 3));
        assert_eq!(bench.master.drives[3].boot.phase, BootPhase::Failed);
        bench.cycles(600, DriveRequest::Enable);
        assert!(bench.nobody_is_enabled());
        assert_eq!(bench.causes(EventKind::Fault), [Cause::NodeRestarted]);
    }

    /// With the fourth cycle without process data, and before its heartbeat is overdue.
    #[test]
    fn a_running_drive_may_owe_its_process_data_for_three_cycles() {
        let mut bench = Bench::enabled();
        bench.drive(1).is_dead = true;
        bench.cycles(3, DriveRequest::Enable);
        assert_eq!(bench.reading.fresh_axes, 0b11_1101);
        bench.drive(1).is_dead = false;
        bench.cycles(3, DriveRequest::Enable);
        assert_eq!(bench.reading.fresh_axes, 0b11_1111);
        assert_eq!(bench.causes(EventKind::Fault), []);
        bench.drive(1).is_dead = true;
        bench.cycles(4, DriveRequest::Enable);
        let fault = *bench.events_of(EventKind::Fault).next().unwrap();
        assert_eq!((fault.cause, fault.axis), (Cause::ProcessDataLost.code(), 1));
        assert_eq!((fault.value, fault.limit), (4.0, 3.0));
    }

    /// From its boot-up message on: nothing of before counts for it.
    #[test]
    fn a_drive_that_has_restarted_is_unknown_at_once() {
        let mut bench = Bench::enabled();
        bench.drive(4).cycle_power();
        bench.drive(4).targets.clear();
        bench.cycle(Some(DriveRequest::Enable));
        assert_eq!(bench.reading.drive_state[4], NO_DRIVE_STATE);
        assert_eq!(bench.reading.fresh_axes, 0b10_1111);
        assert_eq!(bench.master.drives[4].boot.phase, BootPhase::Waiting);
        assert_eq!(bench.drive(4).targets, []);
    }
}

mod stops {
    //! Permanent stops: neither switching off nor a new demand for motion ends them.

    use masseter_can::canopen::{Nmt, NmtCommand, NmtTarget, sync};

    use super::*;

    type Trigger = fn(&mut Bench);

    /// What stops the drives permanently, and the cause that is reported.
    const PERMANENT: [(Cause, Trigger); 14] = [
        (Cause::CommandLost, |bench| (0..=TIMEOUT_CYCLES).for_each(|_| bench.cycle(None))),
        (Cause::CommandLost, |bench| {
            let stale_cycle = bench.cycle;
            (0..=TIMEOUT_CYCLES).for_each(|_| bench.spoil(|command| command.cycle = stale_cycle));
        }),
        (Cause::BadMessage, |bench| bench.spoil(|command| command.target_m[0] = f64::NAN)),
        (Cause::BadMessage, |bench| bench.spoil(|command| command.request = 99)),
        (Cause::BadMessage, |bench| bench.spoil(|command| command.version += 1)),
        (Cause::StrokeLimit, |bench| bench.spoil(|command| command.target_m[2] = 0.031)),
        (Cause::VelocityLimit, |bench| bench.spoil(|command| command.target_m[4] += 5e-4)),
        (Cause::AccelerationLimit, |bench| bench.spoil(|command| command.target_m[5] -= 1e-4)),
        (Cause::FollowingError, |bench| {
            let drive = bench.drive(4);
            (drive.may_move, drive.position) = (true, drive.position + 100);
        }),
        (Cause::DriveFault, |bench| bench.drive(2).power = DriveState::SwitchOnDisabled),
        (Cause::DriveFault, |bench| bench.drive(5).power = DriveState::Fault),
        (Cause::DriveFault, |bench| bench.drive(0).power = DriveState::QuickStopActive),
        (Cause::SecondMaster, |bench| {
            let now_ns = bench.now_ns();
            bench.wires.wire(1).arrive(now_ns, sync::frame());
            bench.cycle(Some(DriveRequest::Enable));
        }),
        (Cause::SecondMaster, |bench| {
            let (now_ns, target) = (bench.now_ns(), NmtTarget::All);
            bench.wires.wire(0).arrive(now_ns, Nmt { command: NmtCommand::ResetNode, target }.frame());
            bench.cycle(Some(DriveRequest::Enable));
        }),
    ];

    /// Default of `can.command_timeout_cycles`.
    const TIMEOUT_CYCLES: u32 = 20;

    impl Bench {
        /// A cycle with a demand for motion that something is wrong with.
        fn spoil(&mut self, spoil: impl FnOnce(&mut Command)) {
            self.cycle_with(|command| {
                let mut command = Command { request: DriveRequest::Enable.code(), ..command };
                spoil(&mut command);
                Some(command)
            });
        }
    }

    #[test]
    fn a_permanent_stop_ends_with_no_request() {
        for (cause, trigger) in PERMANENT {
            let mut bench = Bench::enabled();
            trigger(&mut bench);
            bench.cycles(3, DriveRequest::Enable);
            for request in [DriveRequest::Enable, DriveRequest::Off, DriveRequest::Enable, DriveRequest::Off]
            {
                for _ in 0..100 {
                    assert_eq!(bench.reading.master_fault, 1, "{cause}");
                    assert!(bench.nobody_is_enabled(), "{cause}");
                    bench.cycle(Some(request));
                }
            }
            assert_eq!(bench.causes(EventKind::Fault), [cause]);
            assert_eq!(bench.causes(EventKind::Notice), [], "{cause}");
        }
    }

    /// Each drive was reset, and is off: only the memory of the stop keeps the drives from moving.
    #[test]
    fn a_permanent_stop_outlasts_a_restart_of_every_drive() {
        for (cause, trigger) in PERMANENT {
            let mut bench = Bench::enabled();
            trigger(&mut bench);
            bench.cycles(3, DriveRequest::Enable);
            (0..AXES).for_each(|axis| bench.drive(axis).cycle_power());
            bench.cycles(600, DriveRequest::Off);
            bench.cycles(50, DriveRequest::Enable);
            assert!(bench.nobody_is_enabled(), "{cause}");
            assert_eq!(bench.causes(EventKind::Fault), [cause]);
            assert!(!bench.causes(EventKind::Notice).contains(&Cause::Recovered), "{cause}");
        }
    }

    #[test]
    fn silence_is_borne_as_long_as_declared_and_only_while_motion_is_demanded() {
        assert_eq!(Scenario::default().can.command_timeout_cycles, TIMEOUT_CYCLES);
        let mut bench = Bench::enabled();
        (0..TIMEOUT_CYCLES).for_each(|_| bench.cycle(None));
        assert_eq!(bench.causes(EventKind::Fault), []);
        bench.cycle(None);
        let fault = *bench.events_of(EventKind::Fault).next().unwrap();
        assert_eq!((fault.cause, fault.value, fault.limit), (Cause::CommandLost.code(), 21.0, 20.0));
        assert_eq!(bench.master.silent_cycles(), 21);

        let mut bench = Bench::enabled();
        bench.cycles(5, DriveRequest::Off);
        (0..100).for_each(|_| bench.cycle(None));
        assert_eq!(bench.causes(EventKind::Fault), []);
        assert_eq!(bench.master.silent_cycles(), 100);
        bench.cycles(20, DriveRequest::Enable);
        assert!(bench.all_are(DriveState::OperationEnabled));
        assert_eq!(bench.master.silent_cycles(), 0);
    }

    #[test]
    fn a_repeated_cycle_is_silence_unless_it_asks_to_stop() {
        for (request, silent_cycles) in
            [(DriveRequest::Enable, 1), (DriveRequest::QuickStop, 0), (DriveRequest::Off, 0)]
        {
            let mut bench = Bench::enabled();
            let stale_cycle = bench.cycle;
            bench.spoil(|command| (command.cycle, command.request) = (stale_cycle, request.code()));
            assert_eq!(bench.master.silent_cycles(), silent_cycles, "{request}");
            bench.cycle(None);
            assert_eq!(bench.nobody_is_enabled(), request != DriveRequest::Enable, "{request}");
            assert_eq!(bench.causes(EventKind::Fault), [], "{request}");
        }
    }

    #[test]
    fn a_command_in_time_begins_the_silence_anew() {
        let mut bench = Bench::enabled();
        for _ in 0..10 {
            (0..TIMEOUT_CYCLES).for_each(|_| bench.cycle(None));
            bench.cycle(Some(DriveRequest::Enable));
        }
        assert_eq!(bench.causes(EventKind::Fault), []);
        assert!(bench.all_are(DriveState::OperationEnabled));
    }

    #[test]
    fn the_end_stops_the_drives_without_a_fault() {
        let mut bench = Bench::enabled();
        assert!(!bench.master.drives_are_off());
        bench.master.stop();
        bench.cycles(20, DriveRequest::Enable);
        assert!(bench.nobody_is_enabled() && bench.master.drives_are_off());
        assert_eq!(bench.causes(EventKind::Fault), []);
        assert_eq!(bench.reading.master_fault, 0);
    }
}

mod targets {
    //! The targets that the drives get: those of the command only while they are enabled and are to be; and the readings that
    //! the controller gets.

    use super::peer::POSITION;
    use super::*;

    /// The targets' distance from the drives, less than a following error; and in increments.
    const OFFSET_M: f64 = 5e-5;
    const OFFSET: i32 = 50;

    impl Bench {
        /// Enables drives that stand still, with targets beyond their positions.
        fn enabled_with_an_offset() -> Self {
            let mut bench = Self::new();
            bench.offset_m = OFFSET_M;
            (0..AXES).for_each(|axis| bench.drive(axis).may_move = true);
            bench.cycles(400, DriveRequest::Enable);
            assert!(bench.all_are(DriveState::OperationEnabled), "{:?}", bench.events);
            bench
        }
    }

    #[test]
    fn until_a_drive_is_enabled_its_target_is_its_position() {
        let mut bench = Bench::enabled_with_an_offset();
        for axis in 0..AXES {
            let targets = &bench.drive(axis).targets;
            assert!(targets.iter().any(|(state, _)| *state == DriveState::SwitchedOn));
            for &(state, target) in targets {
                let follows = state == DriveState::OperationEnabled;
                assert_eq!(target, POSITION + if follows { OFFSET } else { 0 }, "axis {axis}, {state}");
            }
        }
    }

    /// The commands cease before the drives follow, so that nobody has judged their targets.
    #[test]
    fn a_target_from_before_a_drive_follows_is_never_sent() {
        let mut bench = Bench::new();
        (0..AXES).for_each(|axis| bench.drive(axis).may_move = true);
        bench.offset_m = 9.0;
        while !bench.all_are(DriveState::SwitchedOn) {
            bench.cycle(Some(DriveRequest::Enable));
        }
        (0..20).for_each(|_| bench.cycle(None));
        assert!(bench.all_are(DriveState::OperationEnabled));
        for axis in 0..AXES {
            assert!(bench.drive(axis).targets.iter().all(|(_, target)| *target == POSITION), "axis {axis}");
        }
        assert_eq!(bench.causes(EventKind::Fault), []);
    }

    /// The drive of `l1` takes a torque offset, counts backwards, and may have 60 % of its force.
    #[test]
    fn a_force_offset_is_sent_where_it_is_mapped_and_within_the_force_limit() {
        let text = "[[drive_profile]]\naxes = ['l1']\nreversed = ['l1']\npdos.rpdo1 = ['6040h', '607Ah', '60B2h']\n\
                [drives.leg]\nrated_force_n = 100.0\nmax_force_n = 60.0";
        let scenario = Scenario::parse(std::path::Path::new("robot.toml"), text).unwrap();
        let mut bench = Bench::of(scenario.clone());
        let drive = bench.drive(3);
        drive.rpdo1 = scenario.profile(3).pdos.rpdo1();
        drive.objects.insert((0x1600, 0), vec![3]);
        drive.objects.insert((0x1600, 3), 0x60B2_0010_u32.to_le_bytes().to_vec());
        bench.cycles(400, DriveRequest::Enable);
        assert!(bench.all_are(DriveState::OperationEnabled), "{:?}", bench.events);
        for (force_offset_n, permille) in [(25.0, -250), (-7.0, 70), (1e6, -600), (-1e6, 600), (0.0, 0)] {
            bench.cycle_with(|command| {
                let request = DriveRequest::Enable.code();
                Some(Command { request, force_offset_n: [force_offset_n; AXES], ..command })
            });
            assert_eq!(bench.drive(3).torque_offset_permille, permille, "{force_offset_n} N");
        }
        bench.cycle_with(|command| {
            Some(Command { request: DriveRequest::QuickStop.code(), force_offset_n: [9.0; AXES], ..command })
        });
        assert_eq!(bench.drive(3).torque_offset_permille, 0, "a drive that follows nothing gets no force");
        bench.cycle_with(|command| Some(Command { force_offset_n: [f64::INFINITY; AXES], ..command }));
        assert_eq!(bench.causes(EventKind::Fault), [Cause::BadMessage]);
    }

    #[test]
    fn a_refused_command_counts_as_none() {
        let mut bench = Bench::enabled();
        bench.cycles(1, DriveRequest::Off);
        bench.cycle_with(|command| Some(Command { request: 77, ..command }));
        assert_eq!(bench.master.silent_cycles(), 1);
    }

    /// Whatever stops the drives, which have moved meanwhile.
    #[test]
    fn from_the_first_cycle_of_a_stop_the_target_is_the_position() {
        type Stop = fn(&mut Bench);
        let stops: [Stop; 4] = [
            |bench| bench.cycle(Some(DriveRequest::Off)),
            |bench| bench.cycle(Some(DriveRequest::QuickStop)),
            |bench| bench.cycle_with(|command| Some(Command { request: 99, ..command })),
            |bench| {
                bench.master.stop();
                bench.cycle(Some(DriveRequest::Enable));
            },
        ];
        for (case, stop) in stops.into_iter().enumerate() {
            let mut bench = Bench::enabled_with_an_offset();
            for axis in 0..AXES {
                let drive = bench.drive(axis);
                drive.position += 20 + axis as i32;
                drive.targets.clear();
            }
            stop(&mut bench);
            bench.cycles(30, DriveRequest::Off);
            for axis in 0..AXES {
                let targets = &bench.drive(axis).targets;
                assert_eq!(targets[0].0, DriveState::OperationEnabled, "case {case}");
                let position = POSITION + 20 + axis as i32;
                assert!(targets.iter().all(|&(_, target)| target == position), "case {case}: {targets:?}");
            }
        }
    }

    #[test]
    fn a_reading_carries_position_force_and_state_of_every_drive() {
        let mut bench = Bench::new();
        for axis in 0..AXES {
            bench.drive(axis).position = 1000 * (axis as i32 + 1);
            bench.drive(axis).torque_permille = -100 * (axis as i16 + 1);
        }
        bench.cycles(400, DriveRequest::Enable);
        let drives = Scenario::default().drives;
        for axis in 0..AXES {
            let share = (axis + 1) as f64;
            assert!((bench.reading.position_m[axis] - share * 1e-3).abs() < 1e-12);
            let rated_n = drives.of_axis(axis).rated_force_n;
            assert!((bench.reading.force_n[axis] + 0.1 * share * rated_n).abs() < 1e-9);
            assert_eq!(bench.reading.drive_state[axis], DriveState::OperationEnabled.code());
        }
    }

    /// Of frames that answer an earlier SYNC of that bus, which was sent late.
    #[test]
    fn process_data_before_this_cycles_sync_on_the_wire_are_none_of_this_cycle() {
        let mut bench = Bench::enabled();
        bench.cycle += 1;
        let sync_ns = bench.now_ns();
        bench.wires.begin(sync_ns);
        bench.master.begin_cycle(Wake::on_time(bench.cycle, sync_ns), &mut bench.wires);
        bench.master.note_sync(1, sync_ns + 2000);
        assert!(!bench.master.collect(sync_ns + 500_000, &mut bench.wires));
        bench.master.fill_reading(&mut bench.reading);
        assert_eq!(bench.reading.fresh_axes, 0b00_0111);
    }

    #[test]
    fn each_change_of_a_drives_state_is_reported_once() {
        let mut bench = Bench::enabled();
        bench.cycles(50, DriveRequest::Enable);
        for axis in 0..AXES {
            let changes = bench.events_of(EventKind::Transition);
            let changes =
                changes.filter(|event| event.source == Source::Drive.code() && event.axis == axis as u32);
            let states: Vec<_> = changes.map(|event| [event.from, event.to]).collect();
            assert!(states.windows(2).all(|pair| pair[0][1] == pair[1][0]), "{states:?}");
            assert!(states.iter().all(|[from, to]| from != to), "{states:?}");
            assert_eq!(
                (states[0][0], states[states.len() - 1][1]),
                (NO_DRIVE_STATE, DriveState::OperationEnabled.code())
            );
        }
    }

    #[test]
    fn a_reading_names_the_command_that_it_answers() {
        let mut bench = Bench::new();
        bench.cycle(None);
        assert_eq!((bench.reading.answers_cycle, bench.reading.command_received_ns), (0, 0));
        bench.cycle(Some(DriveRequest::Off));
        let received_ns = bench.now_ns() + 550_000;
        for _ in 0..3 {
            bench.cycle(None);
            assert_eq!((bench.reading.answers_cycle, bench.reading.command_received_ns), (2, received_ns));
        }
    }

    #[test]
    fn an_event_has_the_cycle_in_which_it_happened() {
        let mut bench = Bench::enabled();
        bench.drive(2).power = DriveState::Fault;
        bench.cycle(Some(DriveRequest::Enable));
        let fault = *bench.events_of(EventKind::Fault).next().unwrap();
        assert_eq!((fault.cycle, fault.axis, fault.node, fault.bus), (bench.cycle, 2, 3, 0));
    }
}
