//! Whether a drive has lost its power since the pose check: a number in an object that the drive forgets without power.
//!
//! The object is the profile velocity (6081h). Only jog and home use it, and both write their own value first and return the old one.
//! Drives whose encoder keeps its position need no mark.

use anyhow::bail;
use masseter_can::canopen::ObjectAddress;
use masseter_plant::bringup::Line;
use masseter_shared::clock;
use masseter_shared::config::{ObjectConfig, ObjectKey, ObjectRule, Scenario};
use masseter_shared::geometry::{AXES, AXIS_NAMES};

/// The profile velocity.
const MARKED: ObjectAddress = ObjectAddress::new(0x6081, 0);

/// The mark of each drive; none where the drive needs none, or takes none.
pub(super) type Marks = [Option<u32>; AXES];

/// Marks the drives that forget their position without power.
pub(super) fn mark(scenario: &Scenario, line: &mut Line) -> Marks {
    std::array::from_fn(|axis| {
        let profile = scenario.profile(axis);
        let ObjectConfig { rule, value, .. } = profile.object(ObjectKey(MARKED));
        let is_free = matches!(rule, ObjectRule::Write | ObjectRule::Optional) && value.is_none();
        (is_free && !profile.homing.absolute).then(|| mark_axis(line, axis)).flatten()
    })
}

/// A velocity below the present one, which tells from another start of the drive.
fn mark_axis(line: &mut Line, axis: usize) -> Option<u32> {
    let before = line.read_number(axis, MARKED).ok().filter(|&before| before > 1)?;
    let mark = 1 + clock::wall_time().subsec_micros() % (before - 1);
    line.write(axis, MARKED, mark, 4).ok()?;
    line.read_number(axis, MARKED).ok().filter(|&found| found == mark)
}

/// Refuses a drive without its mark.
pub(super) fn check(marks: &Marks, checked: &str, line: &mut Line) -> anyhow::Result<()> {
    for (axis, mark) in marks.iter().enumerate() {
        if mark.is_some_and(|mark| line.read_number(axis, MARKED).ok() != Some(mark)) {
            bail!(
                "{}: the drive was without power, or reset, since the pose check of {checked}; home the axis and check the \
                 pose again",
                AXIS_NAMES[axis]
            );
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::io;
    use std::path::Path;

    use masseter_plant::bringup::reset;

    use super::*;

    #[test]
    fn a_drive_that_was_reset_since_its_mark_is_refused() {
        let text =
            "[[drive_profile]]\naxes = ['l1', 'l2']\nhoming = { absolute = false, home_position_m = 0.29 }";
        let scenario = Scenario::parse(Path::new("robot.toml"), text).unwrap();
        let mut line = Line::open(&scenario, Box::new(io::sink())).unwrap();
        line.listen(100_000_000).unwrap();
        let marks = mark(&scenario, &mut line);
        assert_eq!(marks.map(|mark| mark.is_some()), [false, false, false, true, true, false]);
        check(&marks, "today", &mut line).unwrap();
        reset(&mut line, 4).unwrap();
        let refusal = check(&marks, "today", &mut line).unwrap_err().to_string();
        assert!(
            refusal.starts_with("l2: the drive was without power, or reset, since the pose check of today")
        );
    }
}
