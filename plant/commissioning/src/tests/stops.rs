//! Reasons for an early end of a motion, or for a drive without power.

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
    assert!(matches!(error, MotionError::OfAxis { axis: 0, reason: AxisError::Powered(_) }), "{error}");
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
            let on_switch = matches!(jogged, Err(MotionError::OfAxis { axis: L1, reason: AxisError::OnSwitch { bits: found } }) if found == bits);
            assert_eq!((on_switch, jogged.is_ok()), (is_refused, !is_refused), "{bits:b} {by_m}: {jogged:?}");
            let switched_on = bench.log.controlwords().iter().any(|(_, word)| word.0 & 1 == 1);
            assert_eq!((switched_on, bench.objects()), (!is_refused, before), "no power for a refused way");
        }
    }
}

/// Another program switches on d1 in the middle of the jog, and this interface has no sign of another master.
#[test]
fn a_second_drive_that_somebody_else_switches_on_ends_a_jog() {
    let word = |word: u8, from_s: f64| {
        format!(
            "[[faults]]\nkind = 'babble'\nbus = 0\nnode = 2\nid = 0x601\ncount = 1\nfrom_s = {from_s}\n\
         data = [0x2B, 0x40, 0x60, 0, {word}, 0, 0, 0]\n"
        )
    };
    let unheard = "[[faults]]\nkind = 'lose'\nbus = 0\nnode = 127\nid = 0x601\nfrom_s = 0.0\n";
    let cause = Bench::new(&(unheard.to_owned() + &word(6, 2.0005) + &word(7, 2.1005))).stopped_beside(0.005);
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
        let dip =
            format!("[[faults]]\nkind = 'drive_reboot'\naxis = 'l1'\nsize = '10 ms'\nfrom_s = {from_s}\n");
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
    let lost = "[[faults]]\nkind = 'lose'\nbus = 1\nnode = 127\nid = 0x584\nfrom_s = 2.0\nuntil_s = 2.8\n";
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
        matches!(
            error,
            MotionError::OfAxis { reason: AxisError::NotEnabled { .. } | AxisError::Stopped(_), axis: L1 }
        ),
        "{error}"
    );
    bench.assert_off();
}

/// A leg without a hold falls at the loss of its power: with a brake that closes late, and without a brake.
#[test]
fn an_axis_that_falls_without_power_fails_the_jog() {
    for quirk in ["kind = 'slow_brake'\nclose_s = 1.0", "kind = 'no_brake'"] {
        let mut bench = Bench::new(&format!("[[drives.quirk]]\n{quirk}\naxes = ['l1']"));
        let error = bench.jog(0.001).unwrap_err();
        let MotionError::OfAxis { axis: L1, reason: AxisError::Dropped { moved_m } } = error else {
            panic!("{quirk}: {error}")
        };
        assert!(moved_m < -0.001, "{moved_m}");
        bench.assert_off();
    }
}

/// A supply that dips at any moment from the first reduced value to the last, also before the axis has power: the
/// limits are lost.
#[test]
fn a_drive_that_restarts_ends_every_motion_with_the_axis_off() {
    type Motion = fn(&mut Bench) -> Result<(), MotionError>;
    let profile = "[[drive_profile]]\nhoming = { method = 33, absolute = false, home_position_m = 0.27 }\n";
    let motions: [Motion; 2] = [|bench| bench.jog(0.001).map(drop), |bench| bench.home().map(drop)];
    for motion in motions {
        let mut sound = Bench::new(profile);
        motion(&mut sound).unwrap();
        let length_s = (sound.line.now_ns() - 100 * MILLISECOND_NS) as f64 / SECOND_NS as f64;
        for part in 0..12 {
            let from_s = 0.15 + 0.9 * length_s * f64::from(part) / 12.0;
            let dip =
                format!("[[faults]]\nkind = 'drive_reboot'\naxis = 'l1'\nsize = '5 ms'\nfrom_s = {from_s}\n");
            let mut bench = Bench::new(&(profile.to_owned() + &dip));
            let Err(error) = motion(&mut bench) else {
                panic!("{from_s} s: the drive has lost the values of the step")
            };
            let MotionError::OfAxis { reason: AxisError::Stopped(StopCause::Restarted(restarted)), .. } =
                error
            else {
                panic!("{from_s} s: {error}")
            };
            assert_eq!(restarted, Restarted { axis: L1, by_master: false });
            bench.assert_off();
        }
    }
}
