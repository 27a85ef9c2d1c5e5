//! How much of the scenario's motion was played. The controller states its motion time. The judge counts it only as far as
//! cycles passed, and computes the pose that belongs to it from the scenario.

use std::sync::Arc;

use masseter_controller::trajectory::Trajectory;
use masseter_model::geometry::Mechanism;
use masseter_runtime::messages::codes::Cause;
use masseter_runtime::messages::{Event, State};
use masseter_runtime::named::{Declared, PlayedMotion};
use masseter_scenario::Scenario;
use serde::Serialize;

use crate::pose_errors::{deviation, pose, worse};
use crate::tracking::is_moving;

/// Cycles that the motion's time may catch up: a reading that comes late has the time of the sample before.
const LATE_CYCLES: f64 = 2.0;
/// Share of the motion that may pass in cycles without a state, which lost cycles explain.
const UNSEEN: f64 = 0.05;
/// Less is rounding, s.
const ROUNDING_S: f64 = 1e-6;
/// The parameter of the rig's motion controller that lets it play a part of the motion's way.
const AMPLITUDE: &str = "motion_amplitude";

/// The greatest distance of the stated desired pose from the scenario's motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Departure {
    /// Of the incisal point, mm.
    pub incisal_mm: f64,
    /// Angle, degrees.
    pub deg: f64,
    /// When the incisal point was so far away, s of the motion's time.
    pub at_s: f64,
    /// Whether the rest of the motion was not compared, since the amplitude was set.
    pub is_partial: bool,
}

/// Follows the motion's time.
#[derive(Debug, Clone)]
pub(super) struct PlayedWatch {
    period_s: f64,
    incisal_m: [f64; 3],
    /// None where the desired poses are not the scenario's: in an own motion, with force control, at another amplitude.
    scenario: Option<Arc<Trajectory>>,
    amplitude_place: Option<usize>,
    /// Cycle and motion time of the last state of the motion.
    last: Option<(u64, f64)>,
    /// What the motion's time may catch up, s.
    credit_s: f64,
    /// The motion's time jumped or vanished: what follows is no part of it.
    has_jumped: bool,
    /// How far the motion came before.
    reached_s: Option<f64>,
    /// The part of it that passed in cycles without a state, s.
    unseen_s: f64,
    departure: Option<Departure>,
}

impl PlayedWatch {
    pub(super) fn new(scenario: &Scenario, declared: &Declared) -> Self {
        let is_amplitude = |name: &String| name == AMPLITUDE;
        let is_scaled = scenario.parameters.keys().any(is_amplitude)
            || scenario.stimulus.iter().filter_map(|stimulus| stimulus.parameter.as_ref()).any(is_amplitude);
        let has_poses =
            declared.motion == PlayedMotion::Scenario && scenario.force_control.is_none() && !is_scaled;
        Self {
            period_s: scenario.period_s(),
            incisal_m: scenario.jaw.reference_point_m,
            scenario: has_poses.then(|| trajectory(scenario)).flatten(),
            amplitude_place: declared.place_of(AMPLITUDE).ok(),
            last: None,
            credit_s: LATE_CYCLES * scenario.period_s(),
            has_jumped: false,
            reached_s: None,
            unseen_s: 0.0,
            departure: None,
        }
    }

    /// Takes a state. Once the motion has begun, a state without its time ends it.
    pub(super) fn state(&mut self, state: &State) {
        let time_s = state.motion_time_s;
        if !is_moving(state) || time_s.is_nan() || time_s < 0.0 {
            self.has_jumped |= self.last.is_some();
            return;
        }
        let (cycle, before_s) = self.last.replace((state.cycle, time_s)).unwrap_or((state.cycle, 0.0));
        let passed_s = state.cycle.saturating_sub(cycle) as f64 * self.period_s;
        let (step_s, late_s) = (time_s - before_s, LATE_CYCLES * self.period_s);
        let credit_s = self.credit_s + passed_s - step_s;
        // A motion that waits may not make up for it later.
        self.credit_s = credit_s.min(late_s);
        self.has_jumped |= credit_s < -ROUNDING_S;
        let reached_s = self.reached_s.get_or_insert(0.0);
        if !self.has_jumped {
            *reached_s = reached_s.max(time_s);
            self.unseen_s += (step_s - self.period_s - late_s).max(0.0);
            self.compare(state);
        }
    }

    /// The stated desired pose, beside the scenario's at this time of the motion.
    fn compare(&mut self, state: &State) {
        let Some(scenario) = &self.scenario else { return };
        let at_s = state.motion_time_s;
        let stated = pose(state.desired_position_m, state.desired_quaternion_wxyz);
        let apart = deviation(stated.as_ref(), Some(&scenario.pose_in_motion(at_s)), self.incisal_m);
        let (mm, deg) = (apart.incisal_m * 1e3, apart.angle_rad.to_degrees());
        let greatest =
            self.departure.get_or_insert(Departure { incisal_mm: 0.0, deg: 0.0, at_s, is_partial: false });
        if mm > greatest.incisal_mm {
            (greatest.incisal_mm, greatest.at_s) = (mm, at_s);
        }
        greatest.deg = worse(greatest.deg, deg);
    }

    /// Whoever sets the amplitude wants other poses from then on.
    pub(super) fn event(&mut self, event: &Event) {
        let is_set = event.cause == Cause::ParameterSet.code();
        if is_set && self.amplitude_place == Some(event.object as usize) {
            self.scenario = None;
            self.departure.iter_mut().for_each(|departure| departure.is_partial = true);
        }
    }

    /// How far the motion came, s, and how far the desired pose was from it. What passed unseen counts only as a small share.
    pub(super) fn finish(self) -> (Option<f64>, Option<Departure>) {
        let unseen_s = self.unseen_s;
        let seen_s = |reached_s: f64| {
            if unseen_s > UNSEEN * reached_s { (reached_s - unseen_s).max(0.0) } else { reached_s }
        };
        (self.reached_s.map(seen_s), self.departure)
    }
}

/// The scenario's motion; none where its file is gone since the run.
fn trajectory(scenario: &Scenario) -> Option<Arc<Trajectory>> {
    let mechanism = Mechanism::new(&scenario.mechanism).ok()?;
    Trajectory::new(&scenario.motion, &scenario.jaw, &mechanism, scenario.duration_s).ok().map(Arc::new)
}

#[cfg(test)]
mod tests {
    use masseter_runtime::messages::codes::ControllerState;
    use masseter_runtime::messages::pose_fields;
    use masseter_runtime::named::Parameter;

    use super::*;

    fn watch(declared: &Declared) -> (PlayedWatch, Arc<Trajectory>) {
        let scenario = Scenario { duration_s: Some(2.0), ..Scenario::default() };
        (PlayedWatch::new(&scenario, declared), trajectory(&scenario).unwrap())
    }

    /// A state in the scenario's pose at this time.
    fn state(motion: &Trajectory, cycle: u64, motion_time_s: f64) -> State {
        let (desired_position_m, desired_quaternion_wxyz) =
            pose_fields(&motion.pose_in_motion(motion_time_s));
        let controller_state = ControllerState::Running.code();
        State {
            cycle,
            motion_time_s,
            desired_position_m,
            desired_quaternion_wxyz,
            controller_state,
            ..State::default()
        }
    }

    /// How far a motion with these cycles and times came, s.
    fn reached_s(times: &[(u64, f64)]) -> Option<f64> {
        let (mut watch, motion) = watch(&Declared::default());
        for (cycle, time_s) in times {
            watch.state(&state(&motion, *cycle, *time_s));
        }
        watch.finish().0
    }

    #[test]
    fn the_motions_time_passes_no_faster_than_the_cycles() {
        type Case = (&'static [(u64, f64)], Option<f64>);
        let cases: [Case; 9] = [
            (&[], None),
            (&[(1, -1.0), (2, f64::NAN)], None),
            (&[(7, 0.0), (8, 0.001), (9, 0.002)], Some(0.002)),
            // A late reading has the time of the sample before.
            (&[(7, 0.0), (8, 0.0), (9, 0.002)], Some(0.002)),
            // Twice as fast, and at rest.
            (&[(7, 0.0), (8, 0.002), (9, 0.004), (10, 0.006), (20, 0.006)], Some(0.004)),
            // A wait earns nothing.
            (&[(7, 0.0), (8, 0.0), (9, 0.0), (10, 0.0), (11, 0.004)], Some(0.0)),
            // The time vanishes.
            (&[(7, 0.0), (8, f64::NAN), (9, 0.002)], Some(0.0)),
            (&[(7, 0.0), (8, 1.0), (9, 1.001), (1100, 1.5)], Some(0.0)),
            (&[(7, 1.5), (2000, 1.5)], Some(0.0)),
        ];
        for (times, expected) in cases {
            assert_eq!(reached_s(times), expected, "{times:?}");
        }
    }

    #[test]
    fn few_lost_cycles_pass_unseen_and_many_are_not_played() {
        let (mut few, mut many) = (Vec::new(), Vec::new());
        for cycle in 0..=1000_u32 {
            let time = (u64::from(cycle), f64::from(cycle) * 1e-3);
            few.extend((!(500..530).contains(&cycle)).then_some(time));
            many.extend((!(300..800).contains(&cycle)).then_some(time));
        }
        assert_eq!(reached_s(&few), Some(1.0));
        let seen_s = reached_s(&many).unwrap();
        assert!((seen_s - 0.502).abs() < 1e-6, "{seen_s}");
    }

    #[test]
    fn a_state_without_motion_ends_it() {
        let (mut watch, motion) = watch(&Declared::default());
        let off = State { controller_state: ControllerState::Disabling.code(), ..state(&motion, 2, 0.001) };
        for state in [off, state(&motion, 3, 0.0), state(&motion, 4, 0.001), off, state(&motion, 6, 0.002)] {
            watch.state(&state);
        }
        assert_eq!(watch.finish().0, Some(0.001));
    }

    #[test]
    fn another_pose_than_the_scenarios_is_a_departure_with_its_time() {
        let (mut watch, motion) = watch(&Declared::default());
        for cycle in 0..1000 {
            let mut state = state(&motion, cycle, cycle as f64 * 1e-3);
            if cycle == 700 {
                state.desired_position_m[2] += 2e-3;
            }
            watch.state(&state);
        }
        let departure = watch.finish().1.unwrap();
        assert!((departure.incisal_mm - 2.0).abs() < 1e-6 && departure.deg < 1e-4, "{departure:?}");
        assert!((departure.at_s - 0.7).abs() < 1e-9);
    }

    #[test]
    fn own_motions_and_set_amplitudes_have_poses_of_their_own() {
        let amplitude = Declared { parameters: vec![Parameter::new(AMPLITUDE, 1.0)], ..Declared::default() };
        let own = Declared { motion: PlayedMotion::Own, ..amplitude.clone() };
        let set = Event { object: 0, cause: Cause::ParameterSet.code(), ..Event::default() };
        for (declared, event, is_compared) in
            [(&amplitude, None, true), (&own, None, false), (&amplitude, Some(set), false)]
        {
            let (mut watch, motion) = watch(declared);
            watch.state(&state(&motion, 1, 0.0));
            if let Some(event) = event {
                watch.event(&event);
            }
            let controller_state = ControllerState::Running.code();
            watch.state(&State { cycle: 2, motion_time_s: 0.001, controller_state, ..State::default() });
            let departure = watch.finish().1;
            assert_eq!(departure.is_some_and(|departure| departure.is_partial), event.is_some());
            assert_eq!(departure.is_some_and(|departure| departure.incisal_mm.is_infinite()), is_compared);
        }
    }
}
