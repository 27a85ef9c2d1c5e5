//! Jog and home on emulated drives.

mod loans;
mod stops;
mod watchdogs;

use std::path::Path;

use masseter_can::canopen::{NodeId, ObjectAddress};
use masseter_can::cia402::{ControlBit, Controlword, DriveState};
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

    /// The reason for the stop of a jog. All drives are off afterwards.
    fn stopped(&mut self, by_m: f64) -> StopCause {
        let error = self.jog(by_m).unwrap_err();
        let MotionError::OfAxis { axis: L1, reason: AxisError::Stopped(cause) } = error else {
            panic!("{error}")
        };
        self.assert_off();
        cause
    }

    /// The reason for the stop of a jog. Another drive has power.
    fn stopped_beside(&mut self, by_m: f64) -> StopCause {
        let error = self.jog(by_m).unwrap_err();
        let MotionError::OfAxis { axis: L1, reason: AxisError::Stopped(cause) } = error else {
            panic!("{error}")
        };
        assert!(!stand(&mut self.line, &self.scenario, 0).unwrap().states[L1].is_powered());
        cause
    }

    fn assert_off(&mut self) {
        let stand = stand(&mut self.line, &self.scenario, 0).unwrap();
        assert!(stand.states.iter().all(|state| !state.is_powered()), "{:?}", stand.states);
    }

    /// Values that a step borrows; none of an object that the drive lacks.
    fn objects(&mut self) -> Vec<Option<u32>> {
        let objects = [
            (0x1016, 1),
            (0x6007, 0),
            (0x605A, 0),
            (0x605E, 0),
            (0x1400, 5),
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
        let read = |(index, subindex)| self.line.read_number(L1, ObjectAddress::new(index, subindex)).ok();
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
    assert!(
        matches!(error, MotionError::OfAxis { axis: L1, reason: AxisError::BeyondStroke { .. } }),
        "{error}"
    );
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
    assert!(
        matches!(error, Err(MotionError::OfAxis { reason: AxisError::Stopped(StopCause::Requested), .. })),
        "{error:?}"
    );
    assert!(at_ns.last().unwrap() < &(4 * SECOND_NS));
    bench.assert_off();
    let words = bench.log.controlwords();
    let halts = words.iter().filter(|(_, word)| word.has(ControlBit::Halt)).count();
    assert_eq!(halts, 1, "at the release: {words:?}");
    let end: Vec<_> = words[words.len() - 2..].iter().map(|(_, word)| *word).collect();
    assert_eq!(end, [Controlword::QUICK_STOP, Controlword::DISABLE_VOLTAGE]);
}

/// No motion follows when a person lets go before the beginning and then ends the step.
#[test]
fn a_stop_while_the_axis_waits_starts_nothing() {
    let mut bench = Bench::new("");
    let order = JogOrder::usual(&bench.scenario, L1, 0.002);
    let wish = |now_ns: u64| if now_ns < 3 * SECOND_NS { Wish::Halt } else { Wish::Stop };
    let error = jog(&mut bench.line, &bench.scenario, &order, &mut |now_ns| wish(now_ns));
    assert!(
        matches!(error, Err(MotionError::OfAxis { reason: AxisError::Stopped(StopCause::Requested), .. })),
        "{error:?}"
    );
    bench.assert_off();
    let words = bench.log.controlwords();
    assert!(words.iter().any(|(_, word)| *word == Controlword::ENABLE_OPERATION), "it had power: {words:?}");
    assert!(!words.iter().any(|(_, word)| word.has(ControlBit::Start)), "{words:?}");
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
    bench.line.traffic.beat_every(u16::MAX);
    bench.line.listen(SECOND_NS).unwrap();
    bench.assert_off();
}

#[test]
fn ways_beyond_a_jog_are_refused_before_anything_is_sent() {
    let mut bench = Bench::new("");
    for by_m in [0.0, 0.021, 1e-12, 1e300, f64::NAN] {
        let error = bench.jog(by_m).unwrap_err();
        assert!(matches!(error, MotionError::OfAxis { reason: AxisError::Way { .. }, .. }), "{error}");
        // A tiny and a huge way are written with an exponent.
        assert!(error.to_string().len() < 100, "{error}");
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
    let MotionError::OfAxis { axis: L1, reason: AxisError::HomePosition { found_m, .. } } = error else {
        panic!("{error}")
    };
    assert!((found_m + 0.27).abs() < 1e-4, "{found_m}");
}

#[test]
fn homing_needs_the_position_of_home_and_an_absolute_encoder_does_not_move() {
    assert!(matches!(
        homing(37, "").home(),
        Err(MotionError::OfAxis { axis: L1, reason: AxisError::NoHomePosition })
    ));
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

use std::io::{self, Write};
use std::sync::{Arc, Mutex};

/// A log that a test can read.
#[derive(Debug, Clone, Default)]
pub(crate) struct Log(Arc<Mutex<Vec<u8>>>);

impl Write for Log {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Log {
    /// All written bytes.
    pub(crate) fn text(&self) -> String {
        String::from_utf8(self.0.lock().unwrap().clone()).unwrap()
    }

    /// Every sent controlword, with the node.
    pub(crate) fn controlwords(&self) -> Vec<(u8, Controlword)> {
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
