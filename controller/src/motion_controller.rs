//! One cycle of the controller: reading → FK → pose → control → IK → limited command.
//!
//! A pure step function: time and readings come in, messages go out, and nothing is allocated. This module
//! uses no transport, no clock and no CAN.

use masseter_model::geometry::{Mechanism, Pose, Twist};
use masseter_runtime::control::{Controller, NoBranch, Outcome, Tick};
use masseter_runtime::messages::codes::{ControllerState, EventKind, Source};
use masseter_runtime::messages::{Command, Event, Reading, State};
use masseter_runtime::named::{Declared, Parameter};
use masseter_scenario::Scenario;
use nalgebra::Translation3;

use crate::forces::{Forces, twist_between};
use crate::path_supervision::{PathSupervision, StartTolerance};
use crate::playback::{Playback, Progress};
use crate::pose_control::PoseControl;
use crate::pose_law::{Demand, Measured, Notice, PoseLaw};
use crate::safety::Fault;
use crate::sequencer::Sequencer;
use crate::targets::Targets;
use crate::trajectory::Trajectory;

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
    start: StartTolerance,
    progress: Progress,
    law: Box<dyn PoseLaw>,
    needs_twist: bool,
    /// The declaration of the law. The controller's own parameters and signals follow.
    of_law: Declared,
    forces: Forces,
    supervision: PathSupervision,
    targets: Targets,
    desired: Option<Pose>,
}

/// Takes the value of a parameter, 0 to 1.
type SetShare = fn(&mut Playback, f64);

/// The controller's own parameters: name, meaning, and the function that takes the value.
const OWN_PARAMETERS: [(&str, &str, SetShare); 2] = [
    ("motion_rate", "Speed of the motion; 1 as written.", Playback::set_motion_rate),
    (
        "motion_amplitude",
        "Share of the way from the motion's first pose; 1 as written.",
        Playback::set_motion_amplitude,
    ),
];

impl MotionController {
    /// A controller that plays `trajectory` on `mechanism` once the rig is ready.
    pub fn new(scenario: &Scenario, mechanism: Mechanism, trajectory: Trajectory) -> Self {
        let closed_m = trajectory.closed_pose().translation.z;
        let law: Box<dyn PoseLaw> = match scenario.force_control {
            Some(config) => Box::new(crate::force_control::ForceControl::new(scenario, config, closed_m)),
            None => Box::new(PoseControl::new(&scenario.controller, scenario.rate_hz)),
        };
        Self::with_law(scenario, mechanism, trajectory, law)
    }

    /// A controller with another pose law, which also replaces the scenario's force control.
    pub fn with_law(
        scenario: &Scenario,
        mechanism: Mechanism,
        trajectory: Trajectory,
        law: Box<dyn PoseLaw>,
    ) -> Self {
        Self {
            sequencer: Sequencer::new(scenario, mechanism.clone()),
            start: StartTolerance::new(scenario, &mechanism),
            progress: Progress::new(scenario, &mechanism, trajectory),
            of_law: law.declared(),
            needs_twist: law.needs_twist(),
            law,
            forces: Forces::new(scenario, &mechanism),
            supervision: PathSupervision::new(scenario),
            targets: Targets::new(scenario, mechanism),
            desired: None,
        }
    }

    /// The state of the sequence.
    pub fn state(&self) -> ControllerState {
        self.sequencer.state
    }

    /// Computes the targets of this cycle: pose law, inverse kinematics and limits.
    fn control(&mut self, desired: Pose) -> Result<(), Fault> {
        if !self.sequencer.is_moving() {
            return Ok(());
        }
        let demand = self.demand(self.sequencer.cycle, &self.progress.playback, desired);
        if let Some(estimated) = &demand.estimated {
            self.supervise(&desired, estimated)?;
        }
        self.forces.check_bite()?;
        let asked = self.law.command(&demand)?;
        self.targets.ask_for(&asked, demand.period_s)?;
        let Sequencer { period_s, config, .. } = &self.sequencer;
        self.forces.feed_forward(&*self.law, |before| {
            self.progress.playback.pose_ahead((config.lead_cycles - before) * period_s)
        });
        Ok(())
    }

    /// Compares desired and estimated pose. The law's detour and the slack are no deviation.
    fn supervise(&mut self, desired: &Pose, estimated: &Pose) -> Result<(), Fault> {
        let detour = Translation3::from(self.law.detour().at_sample_m);
        let slack_s = self.supervision.slack_cycles * self.sequencer.period_s;
        let earlier = if slack_s > 0.0 {
            self.progress.playback.pose_ahead(-self.sequencer.sample_age_s() - slack_s)
        } else {
            *desired
        };
        self.supervision.check_pose(&(detour * desired), estimated, &(detour * earlier))
    }

    /// Before the drives are enabled, the jaw must be near the first pose of the motion.
    fn check_start(&self) -> Result<(), Fault> {
        match &self.sequencer.estimate {
            Some(found) if self.sequencer.has_steady_readings() => {
                self.start.check_way(&found.solution.pose, &self.progress.playback.first_pose())
            }
            _ => Ok(()),
        }
    }

    /// A copy with the whole state, for an independent continuation.
    ///
    /// # Errors
    /// [`NoBranch`] for a pose law without copies.
    pub fn copy(&self) -> Result<Self, NoBranch> {
        Ok(Self {
            sequencer: self.sequencer.clone(),
            start: self.start.clone(),
            progress: self.progress.clone(),
            law: self.law.branch()?,
            needs_twist: self.needs_twist,
            of_law: self.of_law.clone(),
            forces: self.forces.clone(),
            supervision: self.supervision.clone(),
            targets: self.targets.clone(),
            desired: self.desired,
        })
    }

    /// The demand of the cycle whose reading was observed and which is not decided yet.
    pub fn coming_demand(&self) -> Demand {
        let cycle = self.sequencer.cycle + 1;
        let mut progress = self.progress.clone();
        progress.advance(&self.sequencer, cycle);
        let desired = progress.playback.pose_ahead(-self.sequencer.sample_age_in(cycle));
        let desired_twist = Some(self.desired_twist(cycle, &progress.playback));
        Demand { desired_twist, ..self.demand(cycle, &progress.playback, desired) }
    }

    fn demand(&self, cycle: u64, playback: &Playback, desired: Pose) -> Demand {
        let Sequencer { period_s, state, config, .. } = &self.sequencer;
        let age_s = self.sequencer.sample_age_in(cycle);
        let fresh = self.sequencer.fresh_estimate();
        Demand {
            cycle,
            period_s: *period_s,
            state: *state,
            motion_time_s: playback.motion_time_ahead_s(-age_s),
            desired,
            estimated: fresh.map(|estimate| estimate.solution.pose),
            ahead: playback.pose_ahead(config.lead_cycles * period_s),
            desired_twist: self.needs_twist.then(|| self.desired_twist(cycle, playback)),
            measured: fresh.map(|estimate| Measured {
                position_m: estimate.measured.to_axes(),
                force_n: estimate.force_n,
            }),
            external: self.forces.external(),
            load_cell_n: self.forces.load_cell_n,
        }
    }

    fn desired_twist(&self, cycle: u64, playback: &Playback) -> Twist {
        let (period_s, age_s) = (self.sequencer.period_s, self.sequencer.sample_age_in(cycle));
        let [before, after] = [-0.5, 0.5].map(|periods| playback.pose_ahead(periods * period_s - age_s));
        twist_between(&before, &after, period_s)
    }

    /// Prepares the motion and the targets for the state that has been entered.
    fn enter_state(&mut self) {
        self.progress.enter_state(&self.sequencer);
        let measured = self.sequencer.estimate.map(|estimate| estimate.measured);
        match self.sequencer.state {
            ControllerState::Enabling => self.targets.actuators = measured.or(self.targets.actuators),
            ControllerState::Easing => self.forces.begin_motion(),
            ControllerState::SafeStop => self.targets.actuators = measured,
            _ => {}
        }
    }
}

impl Controller for MotionController {
    fn observe(&mut self, reading: Option<&Reading>) {
        self.sequencer.observe(reading);
        if let Some(estimate) = self.sequencer.fresh_estimate() {
            self.supervision.update_slack(estimate);
        }
        self.forces.observe(reading, &self.sequencer);
    }

    fn decide(&mut self, tick: Tick) -> Option<Event> {
        self.progress.advance(&self.sequencer, tick.cycle);
        let fault = self.sequencer.begin_cycle(tick);
        let desired = self.progress.playback.pose_ahead(-self.sequencer.sample_age_s());
        self.desired = Some(Translation3::from(self.law.detour().at_sample_m) * desired);
        let fault = fault.or_else(|| self.check_start().err());
        let fault = fault.or_else(|| self.progress.check_lag().err());
        let fault = fault.or_else(|| self.control(desired).err());
        let event = self.sequencer.follow(fault, self.progress.is_over(&self.sequencer), tick);
        if event.is_some() {
            self.enter_state();
        }
        self.progress.count_rest();
        event.or_else(|| {
            let Notice { cause, value, limit } = self.law.take_notice()?;
            let event = Event::new(Source::Controller, EventKind::Notice, cause);
            Some(Event { time_ns: tick.now_ns, cycle: tick.cycle, value, limit, ..event })
        })
    }

    fn fill_command(&self, command: &mut Command) {
        *command = self.sequencer.command(self.targets.actuators);
        if self.sequencer.is_moving() {
            command.force_offset_n = self.forces.offset_n;
        }
    }

    /// Also computes the conditioning: a figure for reports, so its place is after the command.
    fn fill_state(&mut self, state: &mut State) {
        *state = self.sequencer.state_message(self.desired.as_ref());
        state.motion_time_s = self.progress.playback.motion_time_ahead_s(-self.sequencer.sample_age_s());
        if let Some(estimate) = &self.sequencer.estimate {
            state.condition = self.targets.condition(&self.sequencer, estimate);
        }
    }

    fn request_stop(&mut self) {
        self.sequencer.request_stop();
    }

    fn outcome(&self) -> Option<Outcome> {
        self.sequencer.outcome()
    }

    fn declared(&self) -> Declared {
        let mut declared = self.of_law.clone();
        declared.parameters.extend(OWN_PARAMETERS.map(|(name, about, _)| Parameter {
            about: about.to_owned(),
            range: [0.0, 1.0],
            ..Parameter::new(name, 1.0)
        }));
        declared.signals.extend(self.forces.signals());
        declared
    }

    fn set_parameter(&mut self, place: usize, value: f64) {
        match place.checked_sub(self.of_law.parameters.len()) {
            None => self.law.set_parameter(place, value),
            Some(own) => (OWN_PARAMETERS[own].2)(&mut self.progress.playback, value),
        }
    }

    fn fill_signals(&self, signals: &mut [f64]) {
        let (of_law, of_forces) = signals.split_at_mut(self.of_law.signals.len());
        self.law.fill_signals(of_law);
        self.forces.fill_signals(of_forces);
    }

    fn warm_up(&self) {
        self.targets.warm_up(&self.sequencer);
    }

    fn branch(&self) -> Result<Box<dyn Controller>, NoBranch> {
        Ok(Box::new(self.copy()?))
    }
}

#[cfg(test)]
mod tests;
