//! Jog: one axis goes a short way and back, while the other five stay without power.
//!
//! Everything goes by SDO in pre-operational, in profile position (mode 1). After that, the drive answers some SYNCs without
//! power, for the time that its answers take.

use masseter_runtime::clock::MILLISECOND_NS;
use masseter_scenario::Scenario;

use super::caution::{Caution, Operator};
use super::line::Line;
use super::motion_error::MotionError;
use super::mover::{Mover, POSITIONING};
use super::step_response::StepResponse;
use super::sync_answer;
use super::watch::Sample;

/// The longest way of a jog, m.
const MOST_M: f64 = 0.02;
/// Shortest time at either end, so that overshoot and settling show, ns.
const REST_NS: u64 = 300 * MILLISECOND_NS;

/// What a jog is to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JogOrder {
    /// The axis.
    pub axis: usize,
    /// The way, m: d or l grows where it is above 0.
    pub by_m: f64,
    /// How carefully.
    pub caution: Caution,
    /// How long the axis stays at the far end, ns.
    pub dwell_ns: u64,
}

/// What a jog found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JogReport {
    /// Where it began, at the far end, and where it ended by 6064h, m.
    pub positions_m: [f64; 3],
    /// Half of the range of 6064h while the axis stood, m.
    pub noise_m: f64,
    /// There and back.
    pub ways: [StepResponse; 2],
    /// How far the axis moved while the brake closed, m.
    pub drop_m: f64,
    /// The longest time from SYNC to process data, ns; none for a drive that left a SYNC without an answer.
    pub sync_answer_ns: Option<u64>,
}

impl JogOrder {
    /// A jog with the usual caution, and so slow that the way takes a second.
    pub fn usual(scenario: &Scenario, axis: usize, by_m: f64) -> Self {
        let mut caution = Caution::usual(scenario, axis);
        caution.speed_m_s = caution.speed_m_s.min(by_m.abs());
        Self { axis, by_m, caution, dwell_ns: REST_NS }
    }
}

impl JogReport {
    /// The way by 6064h, m.
    pub fn moved_m(&self) -> f64 {
        self.positions_m[1] - self.positions_m[0]
    }

    /// Friction and load, N: half of the difference of the forces both ways, and their mean. None without both forces.
    pub fn friction_and_load_n(&self) -> Option<[f64; 2]> {
        let [there_n, back_n] = [self.ways[0].force_n?, self.ways[1].force_n?];
        Some([(there_n - back_n).abs() / 2.0, f64::midpoint(there_n, back_n)])
    }
}

/// Jogs an axis there and back.
///
/// # Errors
/// [`MotionError`]; the axis is off then, unless the error says that this is not proved.
pub fn jog(
    line: &mut Line,
    scenario: &Scenario,
    order: &JogOrder,
    operator: &mut Operator<'_>,
) -> Result<JogReport, MotionError> {
    let &JogOrder { axis, by_m, caution, .. } = order;
    let increment_m = scenario.scale(axis).increment_m.abs();
    if !(10.0 * increment_m..=MOST_M).contains(&by_m.abs()) {
        return Err(MotionError::Way { axis, by_m, most_m: MOST_M });
    }
    let mut mover = Mover::prepare(line, scenario, axis, caution)?;
    let done = go(&mut mover, order, operator);
    let report = mover.finish(done)?;
    Ok(JogReport { sync_answer_ns: sync_answer::longest_ns(line, axis)?, ..report })
}

fn go(
    mover: &mut Mover<'_>,
    order: &JogOrder,
    operator: &mut Operator<'_>,
) -> Result<JogReport, MotionError> {
    let scale = mover.scale();
    let Caution { still_m, .. } = mover.caution();
    let here = scale.increments(mover.position_m()?);
    let way = (order.by_m / scale.increment_m).round() as i32;
    mover.check_way(here + way)?;
    let room = way.abs() + scale.window(still_m) as i32;
    mover.borrow_limits([here - room, here + room])?;
    mover.switch_on(POSITIONING, operator)?;
    let began_m = mover.position_m()?;
    let (there, far_m) = leg(mover, here + way, order.dwell_ns, operator)?;
    let (back, end_m) = leg(mover, here, REST_NS, operator)?;
    let noise_m = mover.noise_m();
    let window_m = (3.0 * noise_m).max(3.0 * scale.increment_m.abs());
    let response = |seen: &[Sample], ends_m| StepResponse::new(seen, ends_m, window_m);
    let drop_m = mover.switch_off()?;
    Ok(JogReport {
        positions_m: [began_m, far_m, end_m],
        noise_m,
        ways: [response(&there, [began_m, far_m]), response(&back, [far_m, end_m])],
        drop_m,
        sync_answer_ns: None,
    })
}

/// One way with the rest at its end; everything that was seen, and where the axis stands.
fn leg(
    mover: &mut Mover<'_>,
    target: i32,
    rest_ns: u64,
    operator: &mut Operator<'_>,
) -> Result<(Vec<Sample>, f64), MotionError> {
    let mut seen = mover.move_to(target, operator)?;
    let rest = mover.dwell(rest_ns.max(REST_NS), operator)?;
    let settled = &rest[rest.len() / 2..];
    let stands_m = settled.iter().map(|sample| sample.position_m).sum::<f64>() / settled.len() as f64;
    seen.extend(rest);
    Ok((seen, stands_m))
}
