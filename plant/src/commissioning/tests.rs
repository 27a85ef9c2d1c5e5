//! Jog and home on emulated drives.

use std::path::Path;

use masseter_can::canopen::{NodeId, ObjectAddress};
use masseter_can::cia402::Controlword;
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_runtime::clock::{MILLISECOND_NS, SECOND_NS};
use masseter_scenario::{ObjectKey, Scenario};

use super::*;

const L1: usize = 3;

struct Bench {
    scenario: Scenario,
    line: Line,
    log: Log,
}

impl Bench {
    fn new(text: &str) -> Self {
        let scenario = Scenario::parse(Path::new("robot.toml"), text).unwrap();
        scenario.validate().unwrap();
        let log = Log::default();
        let mut line = Line::open(&scenario, Box::new(log.clone())).unwrap();
        line.listen(100 * MILLISECOND_NS).unwrap();
        Self { scenario, line, log }
    }

    /// A default rig with a fault on an axis.
    fn with_fault(kind: &str, axis: usize, from_s: f64) -> Self {
        Self::new(&format!("[[faults]]\nkind = '{kind}'\naxis = '{}'\nfrom_s = {from_s:?}", AXIS_NAMES[axis]))
    }

    fn jog(&mut self, by_m: f64) -> Result<JogReport, MotionError> {
        let order = JogOrder::usual(&self.scenario, L1, by_m);
        jog(&mut self.line, &self.scenario, &order, &mut |_| Wish::Move)
    }

    fn home(&mut self) -> Result<HomeReport, MotionError> {
        home(&mut self.line, &self.scenario, L1, &mut |_| Wish::Move)
    }

    /// What stopped a jog. All drives are off afterwards.
    fn stopped(&mut self, by_m: f64) -> StopCause {
        let error = self.jog(by_m).unwrap_err();
        let MotionError::Stopped { axis: L1, cause } = error else { panic!("{error}") };
        self.assert_off();
        cause
    }

    /// What stopped a jog. Another drive has power.
    fn stopped_beside(&mut self, by_m: f64) -> StopCause {
        let error = self.jog(by_m).unwrap_err();
        let MotionError::Stopped { axis: L1, cause } = error else { panic!("{error}") };
        assert!(!stand(&mut self.line, &self.scenario, 0).unwrap().states[L1].is_powered());
        cause
    }

    fn assert_off(&mut self) {
        let stand = stand(&mut self.line, &self.scenario, 0).unwrap();
        assert!(stand.states.iter().all(|state| !state.is_powered()), "{:?}", stand.states);
    }

    fn objects(&mut self) -> Vec<u32> {
        let objects = [
            (0x1016, 1),
            (0x6007, 0),
            (0x605A, 0),
            (0x6060, 0),
            (0x6065, 0),
            (0x6072, 0),
            (0x607D, 1),
            (0x607D, 2),
            (0x6081, 0),
            (0x6083, 0),
            (0x6084, 0),
            (0x6098, 0),
            (0x6099, 1),
            (0x6099, 2),
            (0x609A, 0),
        ];
        let read =
            |(index, subindex)| self.line.read_number(L1, ObjectAddress::new(index, subindex)).unwrap();
        objects.into_iter().map(read).collect()
    }
}

#[test]
fn a_jog_goes_there_and_back_with_one_drive_powered_and_restores_every_object() {
    for by_m in [0.001, -0.001] {
        let mut bench = Bench::new("");
        let before = bench.objects();
        let report = bench.jog(by_m).unwrap();
        assert!((report.moved_m() - by_m).abs() < 1e-5, "{report:?}");
        assert!((report.positions_m[2] - report.positions_m[0]).abs() < 1e-5, "{report:?}");
        assert!(report.noise_m < 5e-6 && report.drop_m.abs() < 1e-4, "{report:?}");
        for way in report.ways {
            assert!((0.7..0.9).contains(&way.rise_s) && way.overshoot_m < 2e-5, "{way:?}");
        }
        let [friction_n, load_n] = report.friction_and_load_n().unwrap();
        // A quarter of 8 N, and 20 N s/m at 1 mm/s.
        assert!((1.0..4.0).contains(&friction_n) && load_n.abs() < 50.0, "{friction_n} N, {load_n} N");
        assert_eq!(bench.objects(), before);
        bench.assert_off();
        let l1 = NodeId::new(bench.scenario.can.node_ids[L1]).unwrap().get();
        let words = bench.log.controlwords();
        assert!(words.len() > 8 && words.iter().all(|&(node, _)| node == l1), "{words:?}");
    }
}

#[test]
fn a_reversed_profile_reverses_the_numbers_of_the_drive_alone() {
    let mut bench = Bench::new("[[drive_profile]]\nreversed = ['l1']");
    let report = bench.jog(0.001).unwrap();
    assert!((report.moved_m() - 0.001).abs() < 1e-5);
    assert!(report.positions_m[0] < 0.0, "what a ruler or homing finds: {report:?}");
    let error = bench.home().unwrap_err();
    assert!(matches!(error, MotionError::BeyondStroke { axis: L1, .. }), "{error}");
}

#[test]
fn a_released_key_halts_and_a_stop_switches_off() {
    let mut bench = Bench::new("");
    let order = JogOrder::usual(&bench.scenario, L1, 0.002);
    // Held, released for a second in the middle of the way, held again, and let go for good.
    let wish = |now_ns: u64| match now_ns as f64 / SECOND_NS as f64 {
        ..1.8 => Wish::Move,
        1.8..3.0 => Wish::Halt,
        3.0..3.4 => Wish::Move,
        _ => Wish::Stop,
    };
    let mut at_ns = Vec::new();
    let error = jog(&mut bench.line, &bench.scenario, &order, &mut |now_ns| {
        at_ns.push(now_ns);
        wish(now_ns)
    });
    assert!(matches!(error, Err(MotionError::Stopped { cause: StopCause::Requested, .. })), "{error:?}");
    assert!(at_ns.last().unwrap() < &(4 * SECOND_NS));
    bench.assert_off();
    let words = bench.log.controlwords();
    let halts = words.iter().filter(|(_, word)| word.halts()).count();
    assert_eq!(halts, 1, "at the release: {words:?}");
    let end: Vec<_> = words[words.len() - 2..].iter().map(|(_, word)| *word).collect();
    assert_eq!(end, [Controlword::QUICK_STOP, Controlword::DISABLE_VOLTAGE]);
}

/// A person who lets go before the motion begins, and then ends it, sees no motion.
#[test]
fn a_stop_while_the_axis_waits_starts_nothing() {
    let mut bench = Bench::new("");
    let order = JogOrder::usual(&bench.scenario, L1, 0.002);
    let wish = |now_ns: u64| if now_ns < 3 * SECOND_NS { Wish::Halt } else { Wish::Stop };
    let error = jog(&mut bench.line, &bench.scenario, &order, &mut |now_ns| wish(now_ns));
    assert!(matches!(error, Err(MotionError::Stopped { cause: StopCause::Requested, .. })), "{error:?}");
    bench.assert_off();
    let words = bench.log.controlwords();
    assert!(words.iter().any(|(_, word)| *word == Controlword::ENABLE_OPERATION), "it had power: {words:?}");
    assert!(!words.iter().any(|(_, word)| word.starts()), "{words:?}");
}

#[test]
fn the_drive_stops_by_itself_without_the_heartbeat() {
    let mut bench = Bench::new("");
    let order = JogOrder::usual(&bench.scenario, L1, 0.005);
    let died = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        jog(&mut bench.line, &bench.scenario, &order, &mut |now_ns| {
            assert!(now_ns < 2 * SECOND_NS, "the program dies in the middle of the way");
            Wish::Move
        })
    }));
    assert!(died.is_err());
    bench.line.beat_every(u16::MAX);
    bench.line.listen(SECOND_NS).unwrap();
    bench.assert_off();
}

#[test]
fn ways_beyond_a_jog_are_refused_before_anything_is_sent() {
    let mut bench = Bench::new("");
    for by_m in [0.0, 0.021, f64::NAN] {
        let error = bench.jog(by_m).unwrap_err();
        assert!(matches!(error, MotionError::Way { .. }), "{error}");
    }
    assert!(bench.log.controlwords().is_empty());
}

fn homing(method: i8, keys: &str) -> Bench {
    Bench::new(&format!("[[drive_profile]]\nhoming = {{ method = {method}, absolute = false, {keys} }}"))
}

#[test]
fn every_method_homes_twice_at_the_same_place() {
    for method in [33, 34, 35, 37] {
        let mut bench = homing(method, "home_position_m = 0.27");
        let before = bench.objects();
        let report = bench.home().unwrap();
        assert!((report.position_m - 0.27).abs() < 2e-4, "{method}: {report:?}");
        assert!(report.spread_m.unwrap() < 5e-5, "{method}: {report:?}");
        assert_eq!(report.way_m.abs() > 1e-5, method < 35, "{method}: {report:?}");
        assert_eq!(bench.objects(), before, "{method}");
        bench.assert_off();
        let l1 = bench.scenario.can.node_ids[L1];
        assert!(bench.log.controlwords().iter().all(|&(node, _)| node == l1));
    }
}

#[test]
fn a_wrong_sign_of_the_home_offset_is_found() {
    let error = homing(37, "home_position_m = 0.27, home_sign = 1").home().unwrap_err();
    let MotionError::HomePosition { axis: L1, found_m, .. } = error else { panic!("{error}") };
    assert!((found_m + 0.27).abs() < 1e-4, "{found_m}");
}

#[test]
fn homing_needs_the_position_of_home_and_an_absolute_encoder_does_not_move() {
    assert!(matches!(homing(37, "").home(), Err(MotionError::NoHomePosition { axis: L1 })));
    let mut bench = Bench::new("");
    let report = bench.home().unwrap();
    assert!((report.position_m - 0.29).abs() < 1e-4 && report.spread_m.is_none(), "{report:?}");
    assert!(bench.log.controlwords().is_empty());
}

#[test]
fn the_stand_shows_every_axis_and_writes_nothing() {
    let mut bench = Bench::new("");
    let stand = stand(&mut bench.line, &bench.scenario, 200 * MILLISECOND_NS).unwrap();
    assert!(stand.positions_m[L1..].iter().all(|position_m| (position_m - 0.29).abs() < 1e-4));
    assert!(stand.moved_m.iter().all(|moved_m| moved_m.abs() < 1e-5));
    assert_eq!(stand.states.len(), AXES);
}

mod loans {
    //! Values that a motion changes for its own duration, and what a killed one owes.

    use std::io;
    use std::sync::{Arc, Mutex};

    use super::*;
    use crate::commissioning::write::{Borrowed, Loan};

    /// A ledger that a test can read.
    #[derive(Debug, Clone, Default)]
    struct Notes(Arc<Mutex<Vec<OldValue>>>);

    impl Ledger for Notes {
        fn keep(&mut self, axis: usize, values: &[OldValue]) -> io::Result<()> {
            assert_eq!(axis, L1);
            *self.0.lock().unwrap() = values.to_vec();
            Ok(())
        }
    }

    /// A step that is killed at any moment: what was kept until then returns all old values.
    #[test]
    fn kept_values_return_what_a_killed_step_has_changed() {
        let mut bench = Bench::new("");
        let (notes, before) = (Notes::default(), bench.objects());
        bench.line.keep_old_values_in(Box::new(notes.clone()));
        let kept = notes.clone();
        let order = JogOrder::usual(&bench.scenario, L1, 1e-3);
        let mut at_kill = Vec::new();
        jog(&mut bench.line, &bench.scenario, &order, &mut |_| {
            at_kill.clone_from(&kept.0.lock().unwrap());
            Wish::Move
        })
        .unwrap();
        assert!(at_kill.len() > 6, "{at_kill:?}");
        assert_eq!(
            (bench.objects(), notes.0.lock().unwrap().len()),
            (before.clone(), 0),
            "nothing is owed any more"
        );
        // The drive as the kill left it.
        for old in &at_kill {
            let reduced = if old.object.0.index == 0x607D { old.value } else { 1 };
            bench.line.write(L1, old.object.0, reduced, old.bytes).unwrap();
        }
        assert_ne!(bench.objects(), before);
        assert_eq!(give_back(&mut bench.line, L1, &at_kill).unwrap(), []);
        assert_eq!(bench.objects(), before);
    }

    /// A cable that is pulled between reading and writing: the drive may have the value, so that it is owed the old one.
    #[test]
    fn a_write_without_an_answer_is_not_forgotten_and_a_refused_one_is() {
        let play = |text: &str, loan| {
            let mut bench = Bench::new(text);
            let notes = Notes::default();
            bench.line.keep_old_values_in(Box::new(notes.clone()));
            let mut borrowed = Borrowed::of_axis(L1, bench.scenario.profile(L1));
            let error = borrowed.set_all(&mut bench.line, &[loan]).err();
            (error.map(|error| error.abort_code()), notes.0.lock().unwrap().len())
        };
        let (refused, owed) = play("", Loan::new(0x6098, 0, 99, 1));
        assert!(refused.flatten().is_some() && owed == 0, "nothing is changed");
        let pulled = |ms| {
            let cable = format!(
                "[[faults]]\nkind = 'disconnect'\nbus = 1\nnode = 4\nfrom_s = {}",
                f64::from(ms) / 1e3
            );
            play(&cable, Loan::new(0x6081, 0, 77, 4))
        };
        let silent = [Some(None)];
        let lost: Vec<_> = (100..106).map(pulled).filter(|(error, _)| silent.contains(error)).collect();
        assert!(lost.contains(&(Some(None), 0)) && lost.contains(&(Some(None), 1)), "{lost:?}");
    }

    /// A drive keeps the last force of its process data, which some drives add in every mode.
    #[test]
    fn a_jog_clears_the_offsets_for_good() {
        let mut bench = Bench::new("");
        let offset = ObjectAddress::new(0x60B2, 0);
        bench.line.write(L1, offset, 55, 2).unwrap();
        bench.jog(1e-3).unwrap();
        assert_eq!(bench.line.read_number(L1, offset).unwrap(), 0);
    }

    /// Drives watch the heartbeat of 150 ms, and each keeping waits for the disk twice.
    #[test]
    fn a_jog_keeps_its_old_values_before_the_first_write() {
        let mut bench = Bench::new("");
        let kept = Arc::new(Mutex::new(Vec::new()));
        bench.line.keep_old_values_in(Box::new(Lengths(kept.clone())));
        bench.jog(1e-3).unwrap();
        let kept = kept.lock().unwrap();
        assert!(
            kept[0] > 6 && kept.len() == 4,
            "the reduced values, the limits, the mode, and nothing in the end: {kept:?}"
        );
        assert_eq!(kept.last(), Some(&0));
    }

    /// A ledger that counts.
    struct Lengths(Arc<Mutex<Vec<usize>>>);

    impl Ledger for Lengths {
        fn keep(&mut self, _: usize, values: &[OldValue]) -> io::Result<()> {
            self.0.lock().unwrap().push(values.len());
            Ok(())
        }
    }

    /// What a drive never takes is owed no more; the other values return.
    #[test]
    fn a_refused_old_value_does_not_stay_in_the_ledger() {
        let mut bench = Bench::new("");
        let notes = Notes::default();
        bench.line.keep_old_values_in(Box::new(notes.clone()));
        let old =
            |index, value, bytes| OldValue { object: ObjectKey(ObjectAddress::new(index, 0)), value, bytes };
        let (good, bad) = (old(0x6081, 77, 4), old(0x6098, 99, 1));
        assert_eq!(give_back(&mut bench.line, L1, &[good, bad]).unwrap(), [bad]);
        assert_eq!(bench.line.read_number(L1, good.object.0).unwrap(), 77);
        assert!(notes.0.lock().unwrap().is_empty());
    }

    /// A drive that takes the value of one object for another one: nothing is powered, and the refusal names both values.
    #[test]
    fn a_loan_that_a_drive_does_not_keep_is_refused_before_power() {
        for object in ["1016h:01", "6007h", "605Ah", "605Eh", "6065h", "6066h", "6072h", "607Dh:01", "607Ah"]
        {
            let quirk = format!(
                "[[drives.quirk]]\nkind = 'shows'\nobjects = ['{object}']\nvalue = 165\naxes = ['l1']"
            );
            let mut bench = Bench::new(&quirk);
            let refusal = bench.jog(1e-3).unwrap_err();
            let text = refusal.to_string();
            let first = if object.ends_with('h') { format!("{object}:00h") } else { format!("{object}h") };
            assert!(text.starts_with(&format!("l1: object {first} (")), "{text}");
            assert!(text.contains(": the drive acknowledged it and shows "), "{text}");
            assert!(
                !bench.log.controlwords().iter().any(|(_, word)| word.0 & 1 == 1),
                "{object}: it had power"
            );
        }
    }
}

mod stops {
    //! What ends a motion early, or keeps a drive from power.

    use super::*;

    /// The motor turns the other way than the encoder counts, from standstill on and from the first moments of the way.
    #[test]
    fn an_axis_that_moves_against_its_target_is_stopped_at_once() {
        let mut causes = Vec::new();
        for from_s in (0..12).map(|step| 1.1 + 0.02 * f64::from(step)) {
            let mut bench = Bench::with_fault("encoder_sign", L1, from_s);
            let cause = bench.stopped(0.001);
            let moved_m = stand(&mut bench.line, &bench.scenario, 0).unwrap().positions_m[L1] - 0.29;
            assert!(moved_m.abs() < 0.002, "{moved_m} {cause:?}");
            causes.push(cause);
        }
        let is_wrong_way = |cause: &StopCause| matches!(cause, StopCause::WrongDirection { .. });
        assert!(causes.iter().any(is_wrong_way), "{causes:?}");
    }

    #[test]
    fn an_axis_without_way_is_stopped_by_its_force_or_following_error() {
        for kind in ["brake_closed", "jam"] {
            let cause = Bench::with_fault(kind, L1, 0.0).stopped(0.005);
            let is_right = matches!(cause, StopCause::Force { .. } | StopCause::FollowingError { .. });
            assert!(is_right, "{kind}: {cause:?}");
        }
    }

    #[test]
    fn an_emergency_ends_a_jog_on_whichever_axis() {
        for sender in [L1, 0] {
            let cause = Bench::with_fault("drive_fault", sender, 2.0).stopped(0.005);
            let StopCause::Emergency { sender: found, code } = cause else { panic!("{cause:?}") };
            assert_eq!((found, code.0), (sender, 0x5112));
        }
    }

    #[test]
    fn another_axis_that_moves_ends_a_jog() {
        let cause = Bench::with_fault("brake_open", 4, 1.5).stopped(0.005);
        assert!(matches!(cause, StopCause::OtherAxis { other: 4, .. }), "{cause:?}");
    }

    #[test]
    fn a_drive_that_somebody_else_controls_keeps_every_axis_from_power() {
        let mut bench = Bench::new("");
        for word in [Controlword::SHUTDOWN, Controlword::SWITCH_ON] {
            bench.line.control(0, word).unwrap();
        }
        let error = bench.jog(0.001).unwrap_err();
        assert!(matches!(error, MotionError::Powered { axis: 0, .. }), "{error}");
        let l1 = bench.scenario.can.node_ids[L1];
        assert!(bench.log.controlwords().iter().all(|&(node, _)| node != l1));
    }

    /// A switch whose wire is broken: the axis may go away from it and come back, and not beyond its place.
    #[test]
    fn an_axis_does_not_go_in_the_direction_of_a_switch_that_is_closed_at_the_start() {
        let table = [
            ("", 0b10, [0.001, -0.001], [true, false]),
            ("", 0b01, [0.001, -0.001], [false, true]),
            ("", 0b11, [0.001, -1e-5], [true, true]),
            ("[[drive_profile]]\nreversed = ['l1']\n", 0b10, [0.001, -0.001], [false, true]),
        ];
        for (profile, bits, ways_m, refused) in table {
            for (by_m, is_refused) in ways_m.into_iter().zip(refused) {
                let quirk = format!("[[drives.quirk]]\nkind = 'shows'\nobjects = ['60FDh']\nvalue = {bits}");
                let mut bench = Bench::new(&format!("{profile}{quirk}"));
                let before = bench.objects();
                let jogged = bench.jog(by_m);
                let on_switch =
                    matches!(jogged, Err(MotionError::OnSwitch { axis: L1, bits: found }) if found == bits);
                assert_eq!(
                    (on_switch, jogged.is_ok()),
                    (is_refused, !is_refused),
                    "{bits:b} {by_m}: {jogged:?}"
                );
                let switched_on = bench.log.controlwords().iter().any(|(_, word)| word.0 & 1 == 1);
                assert_eq!(
                    (switched_on, bench.objects()),
                    (!is_refused, before),
                    "no power for a refused way"
                );
            }
        }
    }

    /// Somebody switches on d1 in the middle of the jog, and this interface hears no other master.
    #[test]
    fn a_second_drive_that_somebody_else_switches_on_ends_a_jog() {
        let word = |word: u8, from_s: f64| {
            format!(
                "[[faults]]\nkind = 'babble'\nbus = 0\nnode = 2\nid = 0x601\ncount = 1\nfrom_s = {from_s}\n\
             data = [0x2B, 0x40, 0x60, 0, {word}, 0, 0, 0]\n"
            )
        };
        let unheard = "[[faults]]\nkind = 'lose'\nbus = 0\nnode = 127\nid = 0x601\nfrom_s = 0.0\n";
        let cause =
            Bench::new(&(unheard.to_owned() + &word(6, 2.0005) + &word(7, 2.1005))).stopped_beside(0.005);
        assert!(matches!(cause, StopCause::OtherPowered { other: 0, .. }), "{cause:?}");
        let cause = Bench::new(&word(6, 2.0005)).stopped(0.005);
        assert_eq!(cause, StopCause::OtherMaster(OtherMaster { bus: 0, sign: MasterSign::SdoRequests }));
    }

    #[test]
    fn another_master_ends_a_jog_whatever_it_sends() {
        for (id, sign, text) in [
            (0x80, MasterSign::Sync, "SYNC"),
            (0, MasterSign::Nmt, "NMT"),
            (0x203, MasterSign::ProcessData, "process data"),
            (0x77F, MasterSign::Heartbeat, "a heartbeat of node 127"),
        ] {
            let master = format!(
                "[[faults]]\nkind = 'babble'\nbus = 1\nnode = 5\nid = {id}\ndata = [5, 9]\ncount = 1\nfrom_s = 2.0\n"
            );
            let cause = Bench::new(&master).stopped(0.005);
            assert_eq!(cause, StopCause::OtherMaster(OtherMaster { bus: 1, sign }));
            assert_eq!(sign.to_string(), text);
        }
    }

    /// The supply dips around the moment of power: the drive is back within 10 ms, and its own limits are in it.
    #[test]
    fn a_drive_that_restarted_gets_no_power() {
        let mut sound = Bench::new("");
        sound.jog(0.001).unwrap();
        let log = sound.log.text();
        let at_s = |frame: &str| {
            let line = log.lines().find(|line| line.contains(frame)).unwrap();
            line[1..].split(')').next().unwrap().parse::<f64>().unwrap()
        };
        let (first_s, on_s) = (at_s("604#2"), at_s("604#2B40600007"));
        for step in 0..60 {
            // From the first reduced value to the milliseconds before the power.
            let from_s = if step < 20 {
                first_s + (on_s - first_s) * f64::from(step) / 20.0
            } else {
                on_s - 0.020 + 5e-4 * f64::from(step - 20)
            };
            let dip = format!(
                "[[faults]]\nkind = 'drive_reboot'\naxis = 'l1'\nsize = '10 ms'\nfrom_s = {from_s}\n"
            );
            let mut bench = Bench::new(&dip);
            let cause = bench.stopped(0.001);
            assert!(matches!(cause, StopCause::Restarted(_)), "{from_s} s: {cause:?}");
            let words = bench.log.controlwords();
            let enables = words.iter().any(|&(_, word)| word == Controlword::ENABLE_OPERATION);
            assert!(!enables, "{from_s} s, power at {on_s} s: {words:?}");
        }
    }

    /// The answers stop for a second in the middle of the motion.
    #[test]
    fn a_motion_that_ends_without_answers_says_that_the_axis_is_off() {
        let lost =
            "[[faults]]\nkind = 'lose'\nbus = 1\nnode = 127\nid = 0x584\nfrom_s = 2.0\nuntil_s = 2.8\n";
        let mut bench = Bench::new(lost);
        let error = bench.jog(0.001).unwrap_err().to_string();
        assert!(error.starts_with("l1: object 60") && error.ends_with("; l1 is off"), "{error}");
        bench.assert_off();
    }

    #[test]
    fn a_drive_without_torque_is_not_enabled() {
        let mut bench = Bench::with_fault("drive_sto", L1, 0.0);
        let error = bench.jog(0.001).unwrap_err();
        assert!(
            matches!(error, MotionError::NotEnabled { axis: L1, .. } | MotionError::Stopped { .. }),
            "{error}"
        );
        bench.assert_off();
    }

    /// A leg that nothing holds falls as its power goes: with a brake that closes late, and without one.
    #[test]
    fn an_axis_that_falls_without_power_fails_the_jog() {
        for quirk in ["kind = 'slow_brake'\nclose_s = 1.0", "kind = 'no_brake'"] {
            let mut bench = Bench::new(&format!("[[drives.quirk]]\n{quirk}\naxes = ['l1']"));
            let error = bench.jog(0.001).unwrap_err();
            let MotionError::Dropped { axis: L1, moved_m } = error else { panic!("{quirk}: {error}") };
            assert!(moved_m < -0.001, "{moved_m}");
            bench.assert_off();
        }
    }

    /// A supply that dips at any moment from the first reduced value to the last, also before the axis has power: the
    /// limits are lost.
    #[test]
    fn a_drive_that_restarts_ends_every_motion_with_the_axis_off() {
        type Motion = fn(&mut Bench) -> Result<(), MotionError>;
        let profile =
            "[[drive_profile]]\nhoming = { method = 33, absolute = false, home_position_m = 0.27 }\n";
        let motions: [Motion; 2] = [|bench| bench.jog(0.001).map(drop), |bench| bench.home().map(drop)];
        for motion in motions {
            let mut sound = Bench::new(profile);
            motion(&mut sound).unwrap();
            let length_s = (sound.line.now_ns() - 100 * MILLISECOND_NS) as f64 / SECOND_NS as f64;
            for part in 0..12 {
                let from_s = 0.15 + 0.9 * length_s * f64::from(part) / 12.0;
                let dip = format!(
                    "[[faults]]\nkind = 'drive_reboot'\naxis = 'l1'\nsize = '5 ms'\nfrom_s = {from_s}\n"
                );
                let mut bench = Bench::new(&(profile.to_owned() + &dip));
                let Err(error) = motion(&mut bench) else {
                    panic!("{from_s} s: the drive has lost the values of the step")
                };
                let MotionError::Stopped { cause: StopCause::Restarted(restarted), .. } = error else {
                    panic!("{from_s} s: {error}")
                };
                assert_eq!(restarted, Restarted { axis: L1, by_master: false });
                bench.assert_off();
            }
        }
    }
}

use std::io::{self, Write};
use std::sync::{Arc, Mutex};

/// A log that a test can read.
#[derive(Debug, Clone, Default)]
pub(super) struct Log(Arc<Mutex<Vec<u8>>>);

impl Write for Log {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Log {
    /// Everything that was written.
    pub(super) fn text(&self) -> String {
        String::from_utf8(self.0.lock().unwrap().clone()).unwrap()
    }

    /// Every controlword that was sent, with the node.
    pub(super) fn controlwords(&self) -> Vec<(u8, Controlword)> {
        let text = self.text();
        let words = text.lines().filter_map(|line| {
            let (id, data) = line.split_whitespace().last()?.split_once('#')?;
            let node = u16::from_str_radix(id, 16).ok()?.checked_sub(0x600)?;
            let word = data.strip_prefix("2B406000")?;
            let low = u16::from_str_radix(word.get(..4)?, 16).ok()?;
            Some((u8::try_from(node).ok()?, Controlword(low.swap_bytes())))
        });
        words.collect()
    }
}
