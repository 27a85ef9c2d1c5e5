//! Jog: one axis goes a short way and back, while the other five stay without power.
//!
//! The jog uses SDO in pre-operational, in profile position (mode 1). After that, the drive answers some SYNCs without
//! power, for a measurement of its answer time.

use masseter_runtime::clock::{MILLISECOND_NS, SECOND_NS};
use masseter_scenario::Scenario;
use serde::Serialize;

use crate::line::Line;
use crate::motion_error::{AxisError, MotionError};
use crate::mover::{Mover, Operator, POSITIONING};
use crate::steps::{SyncAnswers, sync_answers};
use crate::watch::{Caution, Sample};

/// The longest way of a jog, m.
const MOST_M: f64 = 0.02;
/// Shortest time at either end, for overshoot and settling, ns.
const REST_NS: u64 = 300 * MILLISECOND_NS;

/// The order of a jog.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JogOrder {
    /// The axis.
    pub axis: usize,
    /// The way, m: d or l grows where it is above 0.
    pub by_m: f64,
    /// The caution.
    pub caution: Caution,
    /// Time at the far end, ns.
    pub dwell_ns: u64,
}

/// The result of a jog.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct JogReport {
    /// Positions by 6064h at the beginning, at the far end and at the end, m.
    pub positions_m: [f64; 3],
    /// Half of the range of 6064h while the axis stood, m.
    pub noise_m: f64,
    /// There and back.
    pub ways: [StepResponse; 2],
    /// Way of the axis while the brake closes, m.
    pub drop_m: f64,
    /// The drive's answers to SYNC after the motion.
    pub sync_answers: SyncAnswers,
}

impl JogOrder {
    /// A jog with the usual caution, and so slow that the way takes at least a second.
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
        return Err(AxisError::Way { by_m, most_m: MOST_M }.of(axis));
    }
    let mut mover = Mover::prepare(line, scenario, axis, caution, operator)?;
    let done = there_and_back(&mut mover, order);
    let report = mover.end_motion(done)?;
    Ok(JogReport { sync_answers: sync_answers(line, axis)?, ..report })
}

fn there_and_back(mover: &mut Mover<'_>, order: &JogOrder) -> Result<JogReport, MotionError> {
    let scale = mover.scale();
    let Caution { still_m, .. } = mover.caution;
    let here = scale.increments(mover.position_m()?);
    let way = (order.by_m / scale.increment_m).round() as i32;
    mover.check_way(here + way)?;
    let room = way.abs() + scale.window(still_m) as i32;
    mover.borrowed.set_limits(mover.line, [here - room, here + room])?;
    mover.switch_on(POSITIONING)?;
    let began_m = mover.position_m()?;
    let (there, far_m) = one_way(mover, here + way, order.dwell_ns)?;
    let (back, end_m) = one_way(mover, here, REST_NS)?;
    let noise_m = mover.noise_m;
    let window_m = (3.0 * noise_m).max(3.0 * scale.increment_m.abs());
    let response = |seen: &[Sample], ends_m| StepResponse::new(seen, ends_m, window_m);
    let drop_m = mover.switch_off()?;
    Ok(JogReport {
        positions_m: [began_m, far_m, end_m],
        noise_m,
        ways: [response(&there, [began_m, far_m]), response(&back, [far_m, end_m])],
        drop_m,
        sync_answers: SyncAnswers::default(),
    })
}

/// One way with the rest at its end. Returns all looks, and the place of the axis.
fn one_way(mover: &mut Mover<'_>, target: i32, rest_ns: u64) -> Result<(Vec<Sample>, f64), MotionError> {
    let mut seen = mover.move_to(target)?;
    let rest = mover.dwell(rest_ns.max(REST_NS))?;
    let settled = &rest[rest.len() / 2..];
    let stands_m = settled.iter().map(|sample| sample.position_m).sum::<f64>() / settled.len() as f64;
    seen.extend(rest);
    Ok((seen, stands_m))
}

/// The share of the way at both ends in which the axis may still speed up or slow down.
const RAMP: f64 = 0.2;
/// Fewest looks that give a mean force.
const FEWEST: usize = 3;

/// The figures of one way of an axis. SDO answers are milliseconds apart, so the times are no finer.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StepResponse {
    /// From 10 to 90 % of the way, s.
    pub rise_s: f64,
    /// Furthest beyond the target, m.
    pub overshoot_m: f64,
    /// From the set-point to the last look further than the noise from the end, s.
    pub settled_s: f64,
    /// Mean force (6077h) in the middle of the way, N; none for too few looks.
    pub force_n: Option<f64>,
}

impl StepResponse {
    /// Of everything seen since the set-point, from one position to another, m. Nearer than `window_m` is there.
    pub(crate) fn new(seen: &[Sample], [from_m, to_m]: [f64; 2], window_m: f64) -> Self {
        let share = |sample: &Sample| (sample.position_m - from_m) / (to_m - from_m);
        let began_ns = seen.first().map_or(0, |sample| sample.at_ns);
        let time_s = |sample: &Sample| (sample.at_ns - began_ns) as f64 / SECOND_NS as f64;
        let reached_s = |part: f64| seen.iter().find(|sample| share(sample) >= part).map_or(f64::NAN, time_s);
        let middle: Vec<f64> = seen
            .iter()
            .take_while(|sample| share(sample) < 1.0 - RAMP)
            .filter(|sample| share(sample) > RAMP)
            .map(|sample| sample.force_n)
            .collect();
        let furthest = seen.iter().map(share).fold(1.0, f64::max);
        let outside = seen.iter().rfind(|sample| (sample.position_m - to_m).abs() > window_m);
        Self {
            rise_s: reached_s(0.9) - reached_s(0.1),
            overshoot_m: (furthest - 1.0) * (to_m - from_m).abs(),
            settled_s: outside.map_or(0.0, time_s),
            force_n: (middle.len() >= FEWEST).then(|| middle.iter().sum::<f64>() / middle.len() as f64),
        }
    }
}

#[cfg(test)]
mod tests {
    use masseter_can::cia402::Statusword;

    use super::*;

    #[test]
    fn a_way_has_its_rise_overshoot_settling_and_force() {
        let places = [0.0, 0.15, 0.3, 0.5, 0.7, 0.95, 1.1, 1.0, 1.0];
        let seen: Vec<_> = (0..)
            .zip(places)
            .map(|(step, share)| Sample {
                at_ns: step * SECOND_NS / 10,
                position_m: 0.3 - 0.001 * share,
                force_n: if (share - 0.5_f64).abs() < 0.01 { -14.0 } else { -8.0 },
                status: Statusword(0),
            })
            .collect();
        let found = StepResponse::new(&seen, [0.3, 0.299], 2e-5);
        assert!((found.rise_s - 0.4).abs() < 1e-9 && (found.settled_s - 0.6).abs() < 1e-9, "{found:?}");
        assert!(
            (found.overshoot_m - 1e-4).abs() < 1e-12 && (found.force_n.unwrap() + 10.0).abs() < 1e-9,
            "{found:?}"
        );
    }
}
