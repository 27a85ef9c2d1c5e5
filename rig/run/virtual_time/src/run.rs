//! A run under virtual time: a loop over a rig, with a controller that gives the commands.

#[cfg(test)]
pub(crate) mod tests;

use std::sync::Arc;

use masseter_controller::process::BuildController;
use masseter_plan::RunPlan;
use masseter_plant::PlantError;
use masseter_recording::Ending;
use masseter_runtime::control::{Controller, Deadline, Duties, NoBranch, Observed, Outcome, set_parameters};
use masseter_runtime::injection::{Operator, Withdrawn};
use masseter_runtime::named::{Declared, NameError, NamedValues};
use masseter_runtime::{lifecycle::Party, lockstep::EPOCH_NS, messages::Command};
use masseter_scenario::Scenario;

use crate::stepper::{Stepper, StepperState};
use crate::{log::Sink, snapshot::OtherScenario};

/// What the user asks of a run; nothing where a method is not written.
pub trait Requests {
    /// Whether an orderly stop is requested.
    fn is_stop_requested(&self) -> bool {
        false
    }

    /// Whether an immediate end is requested.
    fn is_abort_requested(&self) -> bool {
        false
    }
}

/// Nobody asks for anything.
#[derive(Debug, Clone, Copy)]
pub struct Uninterrupted;

impl Requests for Uninterrupted {}

/// What a run goes on without.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Without {
    /// Faults and stimuli.
    Acting(Withdrawn),
    /// The value of a parameter in the scenario: that of the controller comes back.
    Parameter(String),
}

impl From<Withdrawn> for Without {
    fn from(withdrawn: Withdrawn) -> Self {
        Self::Acting(withdrawn)
    }
}

/// The controller of a run, and what accompanies it.
struct Control {
    controller: Box<dyn Controller>,
    duties: Duties,
    deadline: Deadline,
}

impl Control {
    /// The controller of a run that has not begun.
    fn new(plan: &RunPlan, mut controller: Box<dyn Controller>) -> anyhow::Result<Self> {
        let named = NamedValues::new(controller.declared(), &plan.scenario.parameters)?;
        set_parameters(&mut *controller, &named);
        let declared = named.settings().declared();
        let operator = Operator::new(&plan.scenario, declared, EPOCH_NS)?;
        let deadline = Deadline::new(&plan.scenario, declared, plan.trajectory.duration_s());
        Ok(Self { controller, duties: Duties { named, operator }, deadline })
    }

    fn branch(&self) -> Result<Self, NoBranch> {
        let (duties, deadline) = (self.duties.clone(), self.deadline);
        Ok(Self { controller: self.controller.branch()?, duties, deadline })
    }
}

/// The controller of a plan, by its builder.
pub(crate) fn built(plan: &RunPlan, build: BuildController) -> Box<dyn Controller> {
    build(&plan.scenario, plan.mechanism.clone(), plan.trajectory.clone())
}

/// A rig and its controller, cycle by cycle. The messages go to a [`Sink`].
///
/// ```
/// use masseter_controller::motion_controller::MotionController;
/// use masseter_plan::RunPlan;
/// use masseter_recording::Recorded;
/// use masseter_scenario::Scenario;
/// use masseter_virtual_time::{Run, Sink};
///
/// /// Counts the readings.
/// #[derive(Clone, Default)]
/// struct Readings(usize);
///
/// impl Sink for Readings {
///     fn take(&mut self, message: &Recorded, _: u64) {
///         self.0 += usize::from(matches!(message, Recorded::Reading(_)));
///     }
///
///     fn has_failed(&self) -> bool {
///         false
///     }
/// }
///
/// let plan = RunPlan::new(Scenario::default())?;
/// let mut run = Run::new(
///     &plan,
///     |scenario, mechanism, motion| Box::new(MotionController::new(scenario, mechanism, motion)),
///     Readings::default(),
/// )?;
/// (0..100).try_for_each(|_| run.play_cycle())?;
/// let branch = run.snapshot()?;
/// (0..100).try_for_each(|_| run.play_cycle())?;
/// run.restore(&branch)?;
/// (0..50).try_for_each(|_| run.play_cycle())?;
/// assert_eq!(run.into_sink().0, 150);
/// # Ok::<(), anyhow::Error>(())
/// ```
pub struct Run<S> {
    scenario: Arc<Scenario>,
    stepper: Stepper<S>,
    control: Control,
    /// What the controller has to decide in a cycle that has begun.
    observed: Option<Observed>,
}

/// The state of a run at an instant: that of the rig, that of the controller with its parameters and its operator, and the
/// sink.
/// It lives in memory. The state of a rig alone goes [into a file](crate::Snapshot::write_to).
pub struct RunSnapshot<S> {
    scenario: Arc<Scenario>,
    stepper: StepperState,
    control: Control,
    observed: Option<Observed>,
    sink: S,
}

/// Why a run cannot go to a snapshot.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RestoreError {
    /// The snapshot is one of another scenario or seed.
    #[error(transparent)]
    OtherScenario(#[from] OtherScenario),
    /// The snapshot has a controller that cannot be copied.
    #[error(transparent)]
    Controller(#[from] NoBranch),
}

impl<S: Sink> Run<S> {
    /// A planned run before its first cycle.
    ///
    /// # Errors
    /// When the scenario does not fit the plant, or what the controller declares.
    pub fn new(plan: &RunPlan, build: BuildController, sink: S) -> anyhow::Result<Self> {
        Self::with_controller(plan, built(plan, build), sink)
    }

    /// A run of the plan with this controller.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_controller(plan: &RunPlan, controller: Box<dyn Controller>, sink: S) -> anyhow::Result<Self> {
        Self::with_sink(plan, controller, |_| Ok(sink))
    }

    /// The same with the sink for what the controller declares.
    pub(crate) fn with_sink(
        plan: &RunPlan,
        controller: Box<dyn Controller>,
        sink: impl FnOnce(&Declared) -> anyhow::Result<S>,
    ) -> anyhow::Result<Self> {
        let control = Control::new(plan, controller)?;
        let sink = sink(control.duties.named.settings().declared())?;
        let stepper = Stepper::new(&plan.scenario, plan.schedule, sink)?;
        Ok(Self { scenario: Arc::new(plan.scenario.clone()), stepper, control, observed: None })
    }

    /// Begins the next cycle, unless one has begun: the controller observes its reading, and decides nothing yet.
    ///
    /// # Errors
    /// When the plant fails.
    pub fn begin_cycle(&mut self) -> Result<(), PlantError> {
        if self.observed.is_none() {
            let Control { controller, duties, .. } = &mut self.control;
            self.observed = Some(self.stepper.begin_observed(&mut **controller, duties)?);
        }
        Ok(())
    }

    /// Plays one cycle, or the rest of one that has [begun](Self::begin_cycle).
    ///
    /// # Errors
    /// When the plant fails.
    pub fn play_cycle(&mut self) -> Result<(), PlantError> {
        let Self { stepper, control: Control { controller, duties, .. }, observed, .. } = self;
        let observed = match observed.take() {
            Some(observed) => observed,
            None => stepper.begin_observed(&mut **controller, duties)?,
        };
        stepper.end_decided(&mut **controller, duties, observed)
    }

    /// What the controller declares.
    pub fn declared(&self) -> &Declared {
        self.control.duties.named.settings().declared()
    }

    /// Where the messages went.
    pub fn sink(&self) -> &S {
        &self.stepper.ports.log.sink
    }

    /// The same, to be changed.
    pub fn sink_mut(&mut self) -> &mut S {
        &mut self.stepper.ports.log.sink
    }

    /// The number of the last cycle that began; 0 before the first.
    pub fn cycle(&self) -> u64 {
        self.stepper.cycle
    }

    /// Whether the controller has done its last cycle.
    pub fn has_ended(&self) -> bool {
        self.control.controller.outcome().is_some()
    }

    /// Goes on without this, between two cycles: from the next SYNC on faults and stimuli that act have ended, and those
    /// that have not begun never do.
    ///
    /// # Errors
    /// [`NameError`] for a parameter that the controller does not have.
    pub fn go_without(&mut self, without: &Without) -> Result<(), NameError> {
        let Control { controller, duties, .. } = &mut self.control;
        match without {
            Without::Acting(withdrawn) => {
                let from_ns = self.stepper.withdraw(&self.scenario, *withdrawn);
                duties.operator.withdraw(*withdrawn, from_ns);
            }
            Without::Parameter(name) => {
                let own = controller.declared();
                let value = own.parameters[own.place_of(name)?].value;
                duties.named.settings().set(name, value)?;
            }
        }
        Ok(())
    }

    /// Plays the run to its end; returns the ending, which counts only if the sink took every message.
    pub(crate) fn play(&mut self, interrupts: &dyn Requests) -> Ending {
        let mut plant_error = None;
        while plant_error.is_none()
            && !self.control.deadline.is_over(self.cycle())
            && self.control.controller.outcome().is_none()
            && !self.sink().has_failed()
            && !interrupts.is_abort_requested()
        {
            if interrupts.is_stop_requested() {
                self.control.controller.request_stop();
            }
            plant_error = self.play_cycle().err();
            let mut command = Command::default();
            self.control.controller.fill_command(&mut command);
            self.control.deadline.note(self.stepper.cycle, command.controller_state);
        }
        let has_ended = self.control.controller.outcome().is_some();
        let is_overdue = !has_ended && self.control.deadline.is_over(self.cycle());
        if (is_overdue || has_ended) && plant_error.is_none() {
            plant_error = self.stepper.play_after_controller().err();
        }
        match (plant_error, self.control.controller.outcome()) {
            (Some(error), _) => Ending::died(Party::Plant.name(), error.to_string()),
            _ if interrupts.is_stop_requested() => Ending::Interrupted,
            (None, Some(Outcome::SafeStop)) => Ending::SafeStop,
            _ if is_overdue => Ending::Overdue,
            (None, _) => Ending::Completed,
        }
    }

    /// The sink, with what it took.
    pub fn into_sink(self) -> S {
        self.stepper.ports.log.sink
    }
}

impl<S: Sink + Clone> Run<S> {
    /// The state of the run between two cycles, to be [restored](Self::restore) again and again.
    ///
    /// # Errors
    /// Where the controller or its pose law is not the rig's, and has no `branch`.
    pub fn snapshot(&self) -> Result<RunSnapshot<S>, NoBranch> {
        let (scenario, stepper, sink) = (self.scenario.clone(), self.stepper.state(), self.sink().clone());
        Ok(RunSnapshot { scenario, stepper, control: self.control.branch()?, observed: self.observed, sink })
    }

    /// Goes back, or on, to a snapshot. The cycles that follow are those that followed it.
    ///
    /// # Errors
    /// Where the snapshot is one of another scenario or seed. The run then goes on as it was.
    pub fn restore(&mut self, snapshot: &RunSnapshot<S>) -> Result<(), RestoreError> {
        OtherScenario::refuse(&self.scenario, &snapshot.scenario)?;
        self.control = snapshot.control.branch()?;
        self.observed = snapshot.observed;
        self.stepper.set_state(&snapshot.stepper);
        self.sink_mut().clone_from(&snapshot.sink);
        Ok(())
    }
}
