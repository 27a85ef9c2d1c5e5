//! One cycle of the controller: reading → FK → pose → control → IK → limited command.
//!
//! A pure step function: time and readings come in, messages go out, and nothing is allocated. This module
//! uses no transport, no clock and no CAN.

use std::hint::black_box;

use masseter_model::geometry::{AXES, Actuators, Conditioning, Jacobian, Joints, Mechanism, Pose};
use masseter_runtime::control::{Controller, Outcome, Tick};
use masseter_runtime::messages::codes::ControllerState;
use masseter_runtime::messages::{Command, Event, Reading, State};
use masseter_runtime::named::{Declared, Parameter};
use masseter_scenario::Scenario;
use nalgebra::Translation3;

use crate::command_acknowledgement::CommandAcknowledgement;
use crate::feed_forward::FeedForward;
use crate::force_control::ForceControl;
use crate::force_observer::ForceObserver;
use crate::model::Model;
use crate::path_supervision::PathSupervision;
use crate::playback::Playback;
use crate::pose_control::PoseControl;
use crate::pose_law::{Demand, PoseLaw};
use crate::safety::{self, Fault};
use crate::sequencer::Sequencer;
use crate::slew::Slew;
use crate::start::StartTolerance;
use crate::trajectory::{self, Trajectory};

/// Time between two looks at the motion for its margins, s.
const MARGINS_EVERY_S: f64 = 0.005;
/// Cycles between two condition numbers, which change slowly and take a microsecond each.
const CYCLES_OF_A_CONDITION: u64 = 10;
/// How many parameters the controller has beside those of the law.
const OWN: usize = 2;
/// Age of a reading that comes late but is used.
const LATE_READING_CYCLES: u64 = 1;

/// The default controller: plays a trajectory.
///
/// ```
/// use masseter_controller::motion_controller::MotionController;
/// use masseter_controller::trajectory::Trajectory;
/// use masseter_scenario::Scenario;
/// use masseter_runtime::control::{Controller, Tick};
/// use masseter_model::geometry::Mechanism;
/// use masseter_runtime::messages::codes::ControllerState;
///
/// let scenario = Scenario::default();
/// let mechanism = Mechanism::new(&scenario.mechanism)?;
/// let motion = Trajectory::new(&scenario.motion, &scenario.jaw, &mechanism, scenario.duration_s)?;
/// let mut controller = MotionController::new(&scenario, mechanism, motion);
/// controller.observe(None);
/// controller.decide(Tick { cycle: 1, now_ns: 540_000 });
/// assert_eq!(controller.state(), ControllerState::WaitReadings);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct MotionController {
    sequencer: Sequencer,
    mechanism: Mechanism,
    velocity_limit_m_s: [f64; AXES],
    /// The most that the trim may move an axis.
    trim_reach_m: f64,
    start: StartTolerance,
    playback: Playback,
    acknowledgement: CommandAcknowledgement,
    law: Box<dyn PoseLaw>,
    /// What the law declares, then the controller's own parameters.
    declared: Declared,
    /// None unless the scenario has forces fed forward.
    feed_forward: Option<FeedForward>,
    /// None unless the scenario has the bite force estimated.
    observer: Option<ForceObserver>,
    has_load_cell: bool,
    /// What the load cell showed last, N.
    load_cell_n: Option<f64>,
    supervision: PathSupervision,
    /// By how many cycles the platform may be earlier or later on its path.
    slack_cycles: f64,
    /// Cycles in this state since the desired pose no longer changes.
    cycles_at_rest: u64,
    desired: Option<Pose>,
    /// The pose that the law asked for last.
    asked: Option<Pose>,
    target: Option<Actuators>,
    force_offset_n: [f64; AXES],
    /// The last condition number, with the cycle that computed it.
    condition: Option<(u64, f64)>,
}

impl MotionController {
    /// A controller that plays `trajectory` on `mechanism` once the rig is ready.
    pub fn new(scenario: &Scenario, mechanism: Mechanism, trajectory: Trajectory) -> Self {
        let law: Box<dyn PoseLaw> = match scenario.force_control {
            Some(config) => {
                Box::new(ForceControl::new(scenario, config, trajectory.closed_pose().translation.z))
            }
            None => Box::new(PoseControl::new(&scenario.controller, scenario.rate_hz)),
        };
        Self::with_law(scenario, mechanism, trajectory, law)
    }

    /// The same with another pose law, which takes the place of the scenario's force control too.
    pub fn with_law(
        scenario: &Scenario,
        mechanism: Mechanism,
        trajectory: Trajectory,
        law: Box<dyn PoseLaw>,
    ) -> Self {
        let config = scenario.controller;
        let limits = scenario.limits.within(&scenario.drives);
        // The plan has checked every cycle; the margins that a change of rate needs show in a coarser look.
        let period_s = scenario.period_s().max(MARGINS_EVERY_S);
        let demands = trajectory::check(&trajectory, &mechanism, &limits, period_s).ok();
        let change_s = Slew::change_s(demands.as_ref(), &limits);
        let model = Model::new(scenario, mechanism.clone());
        let is_observed = scenario.is_force_estimated();
        let mut declared = law.declared();
        declared.parameters.extend(own_parameters());
        declared.signals.extend(is_observed.then(ForceObserver::declared).into_iter().flatten());
        Self {
            sequencer: Sequencer::new(scenario, mechanism.clone()),
            velocity_limit_m_s: std::array::from_fn(|axis| scenario.drives.of_axis(axis).max_velocity_m_s),
            trim_reach_m: config.trim_limit_m + config.trim_limit_rad * mechanism.platform_arm_m(),
            start: StartTolerance::new(scenario, &mechanism),
            mechanism,
            playback: Playback::new(trajectory, config.ease_s, config.stop_ramp_s, change_s),
            acknowledgement: CommandAcknowledgement::default(),
            law,
            declared,
            feed_forward: config
                .feed_forward_torque
                .then(|| FeedForward::new(model.clone(), scenario.period_s())),
            observer: is_observed.then(|| ForceObserver::new(scenario, model)),
            has_load_cell: scenario.load_cell.is_some(),
            load_cell_n: None,
            supervision: PathSupervision::new(scenario),
            slack_cycles: 0.0,
            cycles_at_rest: 0,
            desired: None,
            asked: None,
            target: None,
            force_offset_n: [0.0; AXES],
            condition: None,
        }
    }

    /// The state of the sequence.
    pub fn state(&self) -> ControllerState {
        self.sequencer.state
    }

    /// Pose law, inverse kinematics and limits: the targets of this cycle.
    fn control(&mut self, desired: Pose) -> Result<(), Fault> {
        if !self.sequencer.is_moving() {
            return Ok(());
        }
        let demand = self.demand(desired);
        if let Some(estimated) = &demand.estimated {
            let detour = Translation3::from(self.law.detour().at_sample_m);
            let earlier = if self.slack_cycles > 0.0 {
                self.playback.pose_ahead(-self.sample_age_s() - self.slack_cycles * demand.period_s)
            } else {
                desired
            };
            self.supervision.check(&(detour * desired), estimated, &(detour * earlier))?;
        }
        let asked = self.law.command(&demand)?;
        safety::check_asked(&asked)?;
        self.asked = Some(asked);
        let joints = self.mechanism.inverse(&asked)?;
        // A motion that uses its strokes to the end leaves no room for the trim.
        let before = self.target.unwrap_or(joints.actuators);
        let target = self.mechanism.strokes().clamp(&joints.actuators, &before, self.trim_reach_m)?;
        safety::check_velocity(&target, &before, &self.velocity_limit_m_s, demand.period_s)?;
        self.target = Some(target);
        self.feed_forward();
        Ok(())
    }

    /// Before the drives are enabled, the jaw must be near the first pose of the motion.
    fn check_start(&self) -> Result<(), Fault> {
        if !self.sequencer.has_steady_readings() {
            return Ok(());
        }
        let found = self.sequencer.estimate.map(|estimate| estimate.solution.pose);
        found.map_or(Ok(()), |found| self.start.check(&found, &self.playback.first_pose()))
    }

    fn demand(&self, desired: Pose) -> Demand {
        let Sequencer { cycle, period_s, state, config, silent_cycles, estimate, .. } = &self.sequencer;
        Demand {
            cycle: *cycle,
            period_s: *period_s,
            state: *state,
            motion_time_s: self.playback.motion_time_ahead_s(-self.sample_age_s()),
            desired,
            estimated: estimate.filter(|_| *silent_cycles == 0).map(|estimate| estimate.solution.pose),
            ahead: self.playback.pose_ahead(config.lead_cycles * period_s),
            external: self.observer.as_ref().and_then(ForceObserver::external),
            load_cell_n: self.load_cell_n,
        }
    }

    /// Age of the estimate's sample beyond that of a reading in time, s. The motion waits for readings that are later.
    fn sample_age_s(&self) -> f64 {
        let Sequencer { cycle, period_s, estimate, .. } = &self.sequencer;
        let reading_cycle = estimate.map_or(*cycle, |estimate| estimate.reading_cycle);
        cycle.saturating_sub(reading_cycle).min(LATE_READING_CYCLES) as f64 * period_s
    }

    /// The observer of forces takes each fresh sample while the drives carry the jaw.
    fn observe_force(&mut self, reading: Option<&Reading>) {
        let Some(observer) = &mut self.observer else { return };
        match (reading, &self.sequencer.estimate) {
            _ if !self.sequencer.is_moving() => observer.reset(),
            (Some(reading), Some(estimate)) if self.sequencer.silent_cycles == 0 => {
                observer.take(reading.cycle, &estimate.solution.pose, &reading.force_n);
            }
            _ => {}
        }
    }

    /// The forces that the motion needs while the drives move to the targets of this cycle: they approach a target during the
    /// last period before it is reached.
    fn feed_forward(&mut self) {
        let Some(feed_forward) = &mut self.feed_forward else { return };
        let Sequencer { period_s, config, .. } = &self.sequencer;
        let poses = [1.5, 0.5, -0.5]
            .map(|earlier| self.playback.pose_ahead((config.lead_cycles - earlier) * period_s));
        self.force_offset_n = feed_forward.offset_n(poses, &self.law.detour());
    }

    /// Whether the motion of this state is over.
    fn is_over(&self) -> bool {
        if self.sequencer.state == ControllerState::Holding {
            self.cycles_at_rest as f64 * self.sequencer.period_s >= self.sequencer.config.hold_s
        } else {
            self.playback.is_over()
        }
    }

    /// Prepares playback and target for the state that has been entered.
    fn enter(&mut self) {
        match self.sequencer.state {
            ControllerState::Enabling => {
                if let Some(estimate) = &self.sequencer.estimate {
                    self.target = Some(estimate.measured);
                    self.playback.hold(estimate.solution.pose);
                }
            }
            ControllerState::Easing => {
                self.playback.ease();
                self.feed_forward.iter_mut().for_each(FeedForward::begin);
            }
            ControllerState::Running => self.playback.play(),
            ControllerState::Holding => self.playback.stop(),
            ControllerState::SafeStop => {
                self.target = self.sequencer.estimate.map(|estimate| estimate.measured);
            }
            _ => {}
        }
        self.cycles_at_rest = 0;
    }
}

impl Controller for MotionController {
    fn observe(&mut self, reading: Option<&Reading>) {
        self.sequencer.observe(reading);
        if let Some(estimate) = &self.sequencer.estimate
            && self.sequencer.silent_cycles == 0
        {
            self.slack_cycles = self.supervision.slack_cycles(estimate);
        }
        self.observe_force(reading);
        if let Some(reading) = reading.filter(|_| self.has_load_cell) {
            self.load_cell_n = Some(reading.load_cell_n);
        }
    }

    fn decide(&mut self, tick: Tick) -> Option<Event> {
        // A motion that waited goes on at full speed from the target that the drives held: a period's worth, as ever.
        let answered_cycle = self.sequencer.estimate.map_or(0, |estimate| estimate.answers_cycle);
        if self.acknowledgement.takes_step(tick.cycle, answered_cycle) {
            self.playback.advance(self.sequencer.period_s);
        }
        let fault = self.sequencer.begin_cycle(tick);
        let desired = self.playback.pose_ahead(-self.sample_age_s());
        self.desired = Some(Translation3::from(self.law.detour().at_sample_m) * desired);
        let fault = fault.or_else(|| self.check_start().err());
        let fault = fault.or_else(|| self.control(desired).err());
        let event = self.sequencer.follow(fault, self.is_over(), tick);
        if event.is_some() {
            self.enter();
        }
        self.cycles_at_rest = if self.playback.is_at_rest() { self.cycles_at_rest + 1 } else { 0 };
        event
    }

    fn fill_command(&self, command: &mut Command) {
        *command = self.sequencer.command(self.target);
        if self.sequencer.is_moving() {
            command.force_offset_n = self.force_offset_n;
        }
    }

    /// Also the conditioning, which is only reported, and so computed after the command has gone out.
    fn fill_state(&mut self, state: &mut State) {
        *state = self.sequencer.state_message(self.desired.as_ref());
        state.motion_time_s = self.playback.motion_time_ahead_s(-self.sample_age_s());
        let Some(estimate) = &self.sequencer.estimate else { return };
        let cycle = self.sequencer.cycle;
        if self.condition.is_none_or(|(computed, _)| cycle >= computed + CYCLES_OF_A_CONDITION) {
            let joints = Joints { actuators: estimate.measured, theta_rad: estimate.solution.theta_rad };
            let jacobian = Jacobian::new(&self.mechanism, &estimate.solution.pose, &joints);
            self.condition = Some((cycle, Conditioning::new(&jacobian).number()));
        }
        state.condition = self.condition.map_or(0.0, |(_, number)| number);
    }

    fn request_stop(&mut self) {
        self.sequencer.request_stop();
    }

    fn outcome(&self) -> Option<Outcome> {
        self.sequencer.outcome()
    }

    fn declared(&self) -> Declared {
        self.declared.clone()
    }

    fn set_parameter(&mut self, place: usize, value: f64) {
        // From the end, where the own ones are.
        match self.declared.parameters.len() - place {
            OWN => self.playback.set_motion_rate(value),
            1 => self.playback.set_motion_amplitude(value),
            _ => self.law.set_parameter(place, value),
        }
    }

    fn fill_signals(&self, signals: &mut [f64]) {
        let observed = self.observer.as_ref().map_or(0, |_| ForceObserver::SIGNALS);
        let (of_law, observed) = signals.split_at_mut(signals.len() - observed);
        self.law.fill_signals(of_law);
        if let Some(observer) = &self.observer {
            observer.fill_signals(observed);
        }
    }

    fn warm_up(&self) {
        if let Some(estimate) = &self.sequencer.estimate {
            let solution = self.sequencer.tracker.clone().update(&estimate.measured);
            let joints = self.mechanism.inverse(&self.asked.unwrap_or(estimate.solution.pose));
            let _ = black_box((solution, joints));
        }
    }
}

/// The parameters beside those of the law.
fn own_parameters() -> [Parameter; OWN] {
    let share = |name, about: &str| Parameter {
        about: about.to_owned(),
        range: [0.0, 1.0],
        ..Parameter::new(name, 1.0)
    };
    [
        share("motion_rate", "Speed of the motion; 1 as written."),
        share("motion_amplitude", "Share of the way from the motion's first pose; 1 as written."),
    ]
}

#[cfg(test)]
mod tests;
