//! A cable that is pulled, and a supply that dips, in the middle of every step of the bring-up: the step ends, says which drive, and is
//! no evidence. A drive with power is off afterwards, or the step says that this is not proved.

mod common;

use std::fs;
use std::process::{Command, Output};

use common::{MASSETER, Workspace, json, stderr, stdout};

/// The leg l1 has node 4 on bus 1.
const CABLE: &str = "kind = 'disconnect'\nbus = 1\nnode = 4";
const SUPPLY: &str = "kind = 'drive_reboot'\naxis = 'l1'\nsize = '10 s'";
/// A dip from which the drive is back at once.
const DIP: &str = "kind = 'drive_reboot'\naxis = 'l1'\nsize = '10 ms'";

/// One step in a folder, with the scenario that is there.
fn step(robot: &Workspace, step: &[&str]) -> Output {
    let mut command = Command::new(MASSETER);
    command.args(["robot", step[0]]).arg(robot.file("scenario.toml")).args(&step[1..]);
    command.arg("--folder").arg(robot.file("bringup")).output().expect("masseter starts")
}

/// One step on a robot whose fault begins at that time after switch-on: exit code and what it says.
fn play(fault: &str, from_s: f64, tried: &[&str]) -> (Option<i32>, String) {
    let sound = "[dynamics]\ninitial_leg_m = 0.2974\n[[drive_profile]]\naxes = ['l1', 'l2', 'l3']\n\
                 homing = { absolute = false, method = 33, home_position_m = 0.2974 }\n";
    let robot = Workspace::new(sound);
    if tried[0] == "configure" {
        assert!(step(&robot, &["inspect"]).status.success());
    }
    robot.write("scenario.toml", &format!("{sound}[[faults]]\n{fault}\nfrom_s = {from_s:?}\n"));
    let output = step(&robot, tried);
    let evidence = robot.file("bringup");
    let mut folders: Vec<_> = fs::read_dir(evidence).unwrap().map(|entry| entry.unwrap().path()).collect();
    folders.retain(|path| path.is_dir());
    folders.sort();
    let result = json(&folders.last().unwrap().join("result.json"));
    assert_eq!(result["passed"], false, "{tried:?} {fault}: it would be evidence");
    (output.status.code(), stdout(&output) + &stderr(&output))
}

#[test]
fn a_drive_that_goes_while_it_is_read_fails_the_inspection() {
    for fault in [CABLE, SUPPLY] {
        let (code, text) = play(fault, 2.05, &["inspect"]);
        assert_eq!(code, Some(1), "{text}");
        assert!(text.contains("node 4 does not answer"), "{text}");
    }
}

#[test]
fn an_axis_that_moves_is_off_or_not_proved_off_when_its_drive_goes() {
    let jog = ["jog", "--axis", "l1", "--by=-5mm", "--out-of-order"];
    let home = ["home", "--axis", "l1", "--out-of-order"];
    for step in [&jog[..], &home[..]] {
        for fault in [CABLE, SUPPLY] {
            let (code, text) = play(fault, 2.5, step);
            assert_eq!(code, Some(5), "{step:?} {fault}: {text}");
            assert!(text.contains("l1: NOT PROVED OFF"), "a silent drive proves nothing: {text}");
        }
    }
}

/// The drive comes back without power, and without the values of the step.
#[test]
fn a_short_dip_of_the_supply_ends_a_jog_with_the_drive_off() {
    let (code, text) = play(DIP, 2.5, &["jog", "--axis", "l1", "--by=-5mm", "--out-of-order"]);
    assert_eq!(code, Some(5), "{text}");
    assert!(text.contains("the axis is off"), "{text}");
}

/// The drives after it are not touched: l2 and l3 would come later.
#[test]
fn a_drive_that_goes_while_it_is_configured_fails_the_step_and_is_named() {
    for (fault, why) in [
        (CABLE, "failed: l1: object 607Ch:00h: no answer; check its power"),
        (SUPPLY, "failed: l1: object 607Ch:00h: no answer; check its power"),
        (DIP, "failed: l1: the drive restarted meanwhile; check its supply"),
    ] {
        let (code, text) = play(fault, 2.85, &["configure"]);
        assert_eq!(code, Some(1), "{text}");
        assert!(text.contains(why), "{fault}: {text}");
        assert!(text.contains("d3: 1 value written") && !text.contains("l2: "), "{fault}: {text}");
    }
}

/// While l2 or l3 is written: the values of l1 are lost.
#[test]
fn a_drive_that_restarts_after_its_own_turn_fails_the_configuration() {
    let (code, text) = play(DIP, 3.2, &["configure"]);
    assert_eq!(code, Some(1), "{text}");
    assert!(text.contains("failed: l1: the drive restarted meanwhile") && text.contains("l3: "), "{text}");
}

/// Between the two readings: nothing has power, so there is nothing to stop.
#[test]
fn a_drive_that_goes_while_the_pose_is_checked_fails_the_check() {
    for (fault, why) in [
        (CABLE, "l1: object 6064h:00h: no answer"),
        (SUPPLY, "l1: object 6064h:00h: no answer"),
        (DIP, "l1: the drive restarted during the step; check its supply"),
    ] {
        let (code, text) = play(fault, 0.6, &["check-pose", "--out-of-order"]);
        assert_eq!(code, Some(1), "{text}");
        assert!(text.contains(why), "{fault}: {text}");
    }
}
