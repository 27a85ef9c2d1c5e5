//! A cable that is pulled, and a supply that dips, in the middle of every step of the bring-up: the step ends, says which drive, and is
//! no evidence. A drive with power is off afterwards, or the step says that this is not proved.

mod common;

use std::fs;
use std::process::Command;

use common::{MASSETER, Workspace, json, stderr, stdout};

/// The leg l1 has node 4 on bus 1.
const CABLE: &str = "kind = 'disconnect'\nbus = 1\nnode = 4";
const SUPPLY: &str = "kind = 'drive_reboot'\naxis = 'l1'\nsize = '10 s'";

/// One step on a robot whose fault begins at that time after switch-on: exit code and what it says.
fn play(fault: &str, from_s: f64, step: &[&str]) -> (Option<i32>, String) {
    let robot = Workspace::new(&format!(
        "[dynamics]\ninitial_leg_m = 0.2974\n[[drive_profile]]\naxes = ['l1', 'l2', 'l3']\n\
         homing = {{ absolute = false, method = 33, home_position_m = 0.2974 }}\n\
         [[faults]]\n{fault}\nfrom_s = {from_s:?}\n"
    ));
    let mut command = Command::new(MASSETER);
    command.args(["robot", step[0]]).arg(robot.file("scenario.toml")).args(&step[1..]);
    let output = command.arg("--folder").arg(robot.file("bringup")).output().expect("masseter starts");
    let folder = fs::read_dir(robot.file("bringup")).unwrap().last().unwrap().unwrap().path();
    assert_eq!(json(&folder.join("result.json"))["passed"], false, "{step:?} {fault}: it would be evidence");
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

/// A dip from which the drive is back at once: without power, and without the values of the step.
#[test]
fn a_short_dip_of_the_supply_ends_a_jog_with_the_drive_off() {
    let dip = "kind = 'drive_reboot'\naxis = 'l1'\nsize = '10 ms'";
    let (code, text) = play(dip, 2.5, &["jog", "--axis", "l1", "--by=-5mm", "--out-of-order"]);
    assert_eq!(code, Some(5), "{text}");
    assert!(text.contains("the axis is off"), "{text}");
}
