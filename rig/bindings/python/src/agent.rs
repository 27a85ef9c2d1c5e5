//! The rig's controller, whose targets, pose or forces come from outside while it moves the jaw.

use std::{cell::Cell, rc::Rc};

use anyhow::{Context, bail, ensure};
use masseter_controller::motion_controller::MotionController;
use masseter_controller::pose_law::{Demand, LawFailed, PoseLaw, asked_pose};
use masseter_model::geometry::{AXES, Pose};
use masseter_plan::RunPlan;
use masseter_runtime::control::{Controller, NoBranch, Outcome, Tick};
use masseter_runtime::messages::{Command, Event, Reading, State};
use masseter_runtime::{messages::codes::ControllerState, named::Declared};

/// The least length of numbers that give a quaternion.
const LEAST_NORM: f64 = 1e-6;

/// What the numbers of an action are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ActionKind {
    Targets,
    Pose,
    Forces,
}

impl ActionKind {
    pub(crate) fn named(name: &str) -> anyhow::Result<Self> {
        Ok(match name {
            "targets" => Self::Targets,
            "pose" => Self::Pose,
            "forces" => Self::Forces,
            _ => bail!("no action is called '{name}'; use targets, pose or forces"),
        })
    }

    /// Refuses a scenario whose drives cannot take such actions.
    pub(crate) fn check(self, scenario: &masseter_scenario::Scenario) -> anyhow::Result<()> {
        let mut feeding = scenario.clone();
        feeding.controller.feed_forward_torque |= self == Self::Forces;
        feeding.validate().context("the action 'forces' feeds forces forward")
    }

    /// The least and the largest values of an action.
    pub(crate) fn bounds(self, plan: &RunPlan) -> Vec<[f64; 2]> {
        let strokes = plan.mechanism.strokes();
        let axes = 0..AXES;
        match self {
            Self::Targets => axes.map(|axis| strokes.of_axis(axis)).collect(),
            // Positions in m; a quaternion of any length.
            Self::Pose => vec![[-1.0, 1.0]; 7],
            Self::Forces => {
                axes.map(|axis| plan.scenario.max_force_n(axis)).map(|most_n| [-most_n, most_n]).collect()
            }
        }
    }

    fn action(self, numbers: &[f64]) -> anyhow::Result<Action> {
        let expected = if self == Self::Pose { 7 } else { AXES };
        ensure!(numbers.len() == expected, "the action has {} numbers, not {expected}", numbers.len());
        if let Some(place) = numbers.iter().position(|number| !number.is_finite()) {
            bail!("number {place} of the action is {}", numbers[place]);
        }
        let axes = |numbers: &[f64]| std::array::from_fn(|axis| numbers[axis]);
        Ok(match self {
            Self::Targets => Action::Targets(axes(numbers)),
            Self::Forces => Action::Forces(axes(numbers)),
            Self::Pose => {
                let [px, py, pz, quaternion @ ..] = *numbers.first_chunk::<7>().context("seven numbers")?;
                let norm = quaternion.iter().map(|part| part * part).sum::<f64>().sqrt();
                ensure!(norm > LEAST_NORM, "the quaternion of the action has the length {norm}");
                // One of length 1 keeps every bit, as in a run.
                let is_whole = (norm - 1.0).abs() < 1e-3;
                let quaternion = if is_whole { quaternion } else { quaternion.map(|part| part / norm) };
                Action::Pose(asked_pose([px, py, pz], quaternion))
            }
        })
    }
}

#[derive(Debug, Clone, Copy)]
enum Action {
    Targets([f64; AXES]),
    Pose(Pose),
    Forces([f64; AXES]),
}

/// What passes between an agent and whoever acts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Exchanged {
    action: Option<Action>,
    /// Of the cycle that has begun, while the jaw moves.
    pub(crate) demand: Option<Demand>,
    pub(crate) state: ControllerState,
}

const NOTHING: Exchanged = Exchanged { action: None, demand: None, state: ControllerState::WaitReadings };

/// The two hold it together; both belong to one thread.
#[derive(Debug, Clone)]
pub(crate) struct Exchange(Rc<Cell<Exchanged>>);

impl Exchange {
    pub(crate) fn new() -> Self {
        Self(Rc::new(Cell::new(NOTHING)))
    }

    /// Before the first cycle of another run.
    pub(crate) fn clear(&self) {
        self.set(&NOTHING);
    }

    pub(crate) fn get(&self) -> Exchanged {
        self.0.get()
    }

    pub(crate) fn set(&self, exchanged: &Exchanged) {
        self.0.set(*exchanged);
    }

    pub(crate) fn act(&self, kind: ActionKind, numbers: &[f64]) -> anyhow::Result<()> {
        let action = Some(kind.action(numbers)?);
        self.set(&Exchanged { action, ..self.get() });
        Ok(())
    }

    pub(crate) fn is_of(&self, other: &Self) -> bool {
        Rc::ptr_eq(&self.0, &other.0)
    }
}

/// Asks for the pose of the action, and without one for the desired pose.
#[derive(Debug, Clone)]
struct ActedPose(Exchange);

impl PoseLaw for ActedPose {
    fn command(&mut self, demand: &Demand) -> Result<Pose, LawFailed> {
        Ok(match self.0.get().action {
            Some(Action::Pose(pose)) => pose,
            _ => demand.ahead,
        })
    }

    fn branch(&self) -> Result<Box<dyn PoseLaw>, NoBranch> {
        Ok(Box::new(self.clone()))
    }
}

/// The controller.
pub(crate) struct Agent {
    inner: MotionController,
    exchange: Exchange,
}

impl Agent {
    pub(crate) fn new(plan: &RunPlan, kind: ActionKind, exchange: Exchange) -> Self {
        let (scenario, mechanism, motion) = (&plan.scenario, plan.mechanism.clone(), plan.trajectory.clone());
        let inner = if kind == ActionKind::Pose {
            MotionController::with_law(scenario, mechanism, motion, Box::new(ActedPose(exchange.clone())))
        } else {
            MotionController::new(scenario, mechanism, motion)
        };
        Self { inner, exchange }
    }

    fn is_moving(&self) -> bool {
        use ControllerState::{Easing, Holding, Running};
        matches!(self.inner.state(), Easing | Running | Holding)
    }
}

impl Controller for Agent {
    fn observe(&mut self, reading: Option<&Reading>) {
        self.inner.observe(reading);
        let demand = self.is_moving().then(|| self.inner.coming_demand());
        self.exchange.set(&Exchanged { demand, ..self.exchange.get() });
    }

    fn decide(&mut self, tick: Tick) -> Option<Event> {
        self.inner.decide(tick)
    }

    fn fill_command(&self, command: &mut Command) {
        self.inner.fill_command(command);
        match self.exchange.get().action.filter(|_| self.is_moving()) {
            Some(Action::Targets(target_m)) => command.target_m = target_m,
            Some(Action::Forces(force_n)) => command.force_offset_n = force_n,
            Some(Action::Pose(_)) | None => {}
        }
    }

    fn fill_state(&mut self, state: &mut State) {
        self.inner.fill_state(state);
        self.exchange.set(&Exchanged { state: self.inner.state(), ..self.exchange.get() });
    }

    fn request_stop(&mut self) {
        self.inner.request_stop();
    }

    fn outcome(&self) -> Option<Outcome> {
        self.inner.outcome()
    }

    fn declared(&self) -> Declared {
        self.inner.declared()
    }

    fn set_parameter(&mut self, place: usize, value: f64) {
        self.inner.set_parameter(place, value);
    }

    fn fill_signals(&self, signals: &mut [f64]) {
        self.inner.fill_signals(signals);
    }

    fn branch(&self) -> Result<Box<dyn Controller>, NoBranch> {
        Ok(Box::new(Self { inner: self.inner.copy()?, exchange: self.exchange.clone() }))
    }
}
