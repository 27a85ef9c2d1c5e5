//! Homing of one axis (CiA 402, mode 6), while the other five stay without power.
//!
//! An axis with an encoder that keeps its position is compared and not moved. The others home twice: the second homing
//! shows the spread.

use masseter_can::cia402::{ControlBit, Controlword, StatusBit};
use masseter_runtime::clock::SECOND_NS;
use masseter_scenario::{HomingConfig, ObjectKey, ObjectRule, Scenario};
use serde::Serialize;

use crate::motion_error::{AxisError, MotionError, StopCause};
use crate::mover::{HOMING, Mover, Operator, POSITIONING, Wish};
use crate::watch::{Caution, read_position, seconds};
use crate::{line::Line, loan::Loan};

/// Methods that make the present place home (6098h).
const ON_THE_SPOT: [i8; 2] = [35, 37];
/// Way back before the second homing, m: beyond the place of the stop, not beyond the next index.
const BACK_M: f64 = 1e-3;
/// Shortest homing with a way back, m.
const NO_WAY_M: f64 = 1e-5;
/// Opening of the software limits on either side of the axis, strokes.
const OPENED: f64 = 1.1;
/// Longest time of the search, as a multiple of the time for the stroke at the homing speeds.
const PATIENCE: f64 = 1.5;
/// Time of the motion beyond home, s.
const REACTION_S: f64 = 0.02;

/// The result of a homing.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct HomeReport {
    /// 6064h afterwards, m.
    pub position_m: f64,
    /// Way of the search, m.
    pub way_m: f64,
    /// Distance of the second homing from the first, m. None for an encoder that keeps its position, because nothing
    /// moves.
    pub spread_m: Option<f64>,
}

/// One search.
#[derive(Debug, Clone, Copy)]
#[expect(clippy::struct_field_names, reason = "the unit ends every name")]
struct Found {
    /// Way of the search, m.
    way_m: f64,
    /// 6064h at the end, m.
    position_m: f64,
    /// Change of 6064h at the end without a motion, m.
    shift_m: f64,
}

/// Homes an axis, or compares an axis with an encoder that keeps its position.
///
/// # Errors
/// [`MotionError`]; the axis is off then, unless the error says that this is not proved.
pub fn home(
    line: &mut Line,
    scenario: &Scenario,
    axis: usize,
    operator: &mut Operator<'_>,
) -> Result<HomeReport, MotionError> {
    let homing = scenario.profile(axis).homing;
    if homing.absolute {
        return compare(line, scenario, axis);
    }
    let home_m = homing.home_position_m.ok_or(AxisError::NoHomePosition.of(axis))?;
    let mut mover = Mover::prepare(line, scenario, axis, Caution::usual(scenario, axis), operator)?;
    let stroke_m = scenario.mechanism.strokes.of_axis(axis);
    let done = home_twice(&mut mover, home_m, stroke_m[1] - stroke_m[0]);
    mover.end_motion(done)
}

fn compare(line: &mut Line, scenario: &Scenario, axis: usize) -> Result<HomeReport, MotionError> {
    let (stroke_m, scale) = (scenario.mechanism.strokes.of_axis(axis), scenario.scale(axis));
    let HomingConfig { tolerance_m, .. } = scenario.profile(axis).homing;
    let found_m = read_position(line, axis, &scale)?;
    if found_m < stroke_m[0] - tolerance_m || found_m > stroke_m[1] + tolerance_m {
        return Err(AxisError::BeyondStroke { found_m, stroke_m }.of(axis));
    }
    Ok(HomeReport { position_m: found_m, way_m: 0.0, spread_m: None })
}

fn home_twice(mover: &mut Mover<'_>, home_m: f64, stroke_m: f64) -> Result<HomeReport, MotionError> {
    let (axis, homing) = (mover.axis, mover.profile().homing);
    configure(mover)?;
    mover.watch.ignore_switches();
    open_limits(mover, stroke_m)?;
    let first = search(mover, stroke_m)?;
    // The axis stops behind its home, by its ramp and by its reaction time.
    let HomingConfig { tolerance_m, zero_speed_m_s, acceleration_m_s2, .. } = homing;
    let behind_m = zero_speed_m_s.powi(2) / (2.0 * acceleration_m_s2) + zero_speed_m_s * REACTION_S;
    if (first.position_m - home_m).abs() > tolerance_m + behind_m {
        let found_m = first.position_m;
        return Err(AxisError::HomePosition { found_m, expected_m: home_m }.of(axis));
    }
    // The limits count from the new home.
    open_limits(mover, stroke_m)?;
    if first.way_m.abs() > NO_WAY_M {
        mover.watch.heed_switches(mover.line)?;
        mover.switch_on(POSITIONING)?;
        let back_m = mover.position_m()? - BACK_M * first.way_m.signum();
        mover.move_to(mover.scale().increments(back_m))?;
        mover.switch_off()?;
        mover.watch.ignore_switches();
    }
    let second = search(mover, stroke_m)?;
    let spread_m = second.shift_m.abs();
    if spread_m > tolerance_m {
        return Err(AxisError::Spread { spread_m, tolerance_m }.of(axis));
    }
    Ok(HomeReport { position_m: second.position_m, way_m: first.way_m, spread_m: Some(spread_m) })
}

/// The homing objects until the end, and the home object for good: the positions count from it.
fn configure(mover: &mut Mover<'_>) -> Result<(), MotionError> {
    let (profile, scale) = (mover.profile(), mover.scale());
    let homing = &profile.homing;
    mover.borrow(&[
        Loan::new(0x6098, 0, homing.method as u32, 1),
        Loan::new(0x6099, 1, scale.velocity(homing.speed_m_s), 4),
        Loan::new(0x6099, 2, scale.velocity(homing.zero_speed_m_s), 4),
        Loan::new(0x609A, 0, scale.acceleration(homing.acceleration_m_s2), 4),
    ])?;
    let ObjectKey(object) = homing.home_object;
    if profile.object(homing.home_object).rule != ObjectRule::Absent {
        let value = homing.home_increments(scale.increment_m) as u32;
        mover.line.write(mover.axis, object, value, 4)?;
    }
    Ok(())
}

fn open_limits(mover: &mut Mover<'_>, stroke_m: f64) -> Result<(), MotionError> {
    let scale = mover.scale();
    let (here, room) = (scale.increments(mover.position_m()?), scale.window(OPENED * stroke_m) as i32);
    Ok(mover.borrowed.set_limits(mover.line, [here - room, here + room])?)
}

/// One homing, from off to off.
fn search(mover: &mut Mover<'_>, stroke_m: f64) -> Result<Found, MotionError> {
    let homing = &mover.profile().homing;
    mover.switch_on(HOMING)?;
    let began_m = mover.position_m()?;
    let limit_s = PATIENCE * stroke_m * (1.0 / homing.speed_m_s + 1.0 / homing.zero_speed_m_s);
    let until_ns = mover.line.now_ns() + seconds(limit_s);
    mover.control(Controlword::ENABLE_OPERATION)?;
    // "Attained" of an earlier homing proves nothing: the bit must go first, except for a homing on the spot.
    let mut is_old =
        mover.look()?.status.has(StatusBit::HOMING_ATTAINED) && !ON_THE_SPOT.contains(&homing.method);
    let begins_ns = mover.line.now_ns() + SECOND_NS;
    mover.control(Controlword::ENABLE_OPERATION.with(ControlBit::Start))?;
    let mut before_m = began_m;
    loop {
        let sample = mover.look()?;
        if sample.status.has(StatusBit::HOMING_ERROR) {
            return mover.stopped(StopCause::Homing);
        }
        let is_attained = sample.status.has(StatusBit::HOMING_ATTAINED);
        is_old &= is_attained;
        if is_attained && !is_old && sample.status.has(StatusBit::TargetReached) {
            break;
        }
        if is_old && sample.at_ns >= begins_ns {
            return mover.stopped(StopCause::NotBegun);
        }
        if (mover.operator)(sample.at_ns) != Wish::Move {
            return mover.stopped(StopCause::Requested);
        }
        if sample.at_ns >= until_ns {
            return mover.stopped(StopCause::TimedOut { limit_s });
        }
        before_m = sample.position_m;
    }
    mover.control(Controlword::ENABLE_OPERATION)?;
    let position_m = mover.position_m()?;
    mover.switch_off()?;
    Ok(Found { way_m: before_m - began_m, position_m, shift_m: position_m - before_m })
}
