//! Forces by the controller's own model of the mechanism: the model, the observer of external forces, and
//! feed-forward. Nothing here controls a force.

use masseter_model::geometry::{AXES, Mechanism, Pose};
use masseter_runtime::messages::Reading;
use masseter_runtime::messages::codes::Cause;
use masseter_runtime::named::Signal;
use masseter_scenario::{ForceControlConfig, ForceSource, Scenario};

use crate::forces::feed_forward::FeedForward;
use crate::forces::observer::ForceObserver;
use crate::pose_law::{ExternalForce, PoseLaw};
use crate::{safety::Fault, sequencer::Sequencer};

mod calibration;
mod cell;
mod feed_forward;
mod model;
mod observer;

pub(crate) use model::{Model, derivatives, twist_between};

/// The forces of the rig: estimated, measured, and fed forward.
#[derive(Debug, Clone)]
pub(crate) struct Forces {
    /// None without an estimate of the bite force in the scenario.
    observer: Option<ForceObserver>,
    has_load_cell: bool,
    /// Last value of the load cell, N.
    pub(crate) load_cell_n: Option<f64>,
    /// None without control of the bite force in the scenario.
    control: Option<ForceControlConfig>,
    /// None without feed-forward in the scenario.
    feed_forward: Option<FeedForward>,
    /// Offsets of this cycle, N.
    pub(crate) offset_n: [f64; AXES],
}

impl Forces {
    pub(crate) fn new(scenario: &Scenario, mechanism: &Mechanism) -> Self {
        let model = || Model::new(scenario, mechanism.clone());
        let feed_forward = || FeedForward::new(model(), scenario.period_s());
        Self {
            observer: scenario.is_force_estimated().then(|| ForceObserver::new(scenario, model())),
            has_load_cell: scenario.load_cell.is_some(),
            load_cell_n: None,
            control: scenario.force_control,
            feed_forward: scenario.controller.feed_forward_torque.then(feed_forward),
            offset_n: [0.0; AXES],
        }
    }

    /// Takes the values of a reading. The observer takes each fresh sample while the drives carry the jaw.
    pub(crate) fn observe(&mut self, reading: Option<&Reading>, sequencer: &Sequencer) {
        if let Some(observer) = &mut self.observer {
            match (reading, sequencer.fresh_estimate()) {
                _ if !sequencer.is_moving() => observer.reset(),
                (Some(reading), Some(estimate)) => {
                    observer.take_cell(reading.load_cell_n);
                    observer.take_sample(reading.cycle, &estimate.solution.pose, &reading.force_n);
                }
                _ => {}
            }
        }
        if let Some(reading) = reading.filter(|_| self.has_load_cell) {
            self.load_cell_n = Some(reading.load_cell_n);
        }
    }

    /// The external force on the platform, once there is an estimate.
    pub(crate) fn external(&self) -> Option<ExternalForce> {
        self.observer.as_ref().and_then(ForceObserver::external)
    }

    /// Refuses a bite force above the limit of the force control, or one that is no number, whatever law controls the force.
    /// During a calibration the rough force counts: a limit has no time without a force. Of a control by the estimate the drives'
    /// force counts beside the estimate, so a cell that hides a force does not hide it from the limit; a controlled lateral force counts, too.
    pub(crate) fn check_bite(&self) -> Result<(), Fault> {
        let Some(control) = &self.control else { return Ok(()) };
        let external = self.external();
        let forces_n = match control.source {
            ForceSource::Estimate => [
                self.observer.as_ref().and_then(ForceObserver::rough_bite_n),
                external.map(|external| external.bite_n()),
                control.lateral.and(external).map(|external| external.force_n[0].hypot(external.force_n[1])),
            ],
            ForceSource::LoadCell => [self.load_cell_n, None, None],
        };
        let limit_n = control.limit_n();
        let beyond = forces_n.into_iter().flatten().find(|bite_n| bite_n.is_nan() || *bite_n > limit_n);
        beyond.map_or(Ok(()), |bite_n| Err(Fault::new(Cause::ForceLimit, bite_n, limit_n)))
    }

    /// The motion begins anew.
    pub(crate) fn begin_motion(&mut self) {
        self.feed_forward.iter_mut().for_each(FeedForward::begin);
    }

    /// The forces that the motion needs while the drives move to the targets of this cycle. The drives approach a
    /// target during the last period before its time. `before` gives the desired pose this many periods before that
    /// time.
    pub(crate) fn feed_forward(&mut self, law: &dyn PoseLaw, before: impl Fn(f64) -> Pose) {
        if let Some(feed_forward) = &mut self.feed_forward {
            self.offset_n = feed_forward.offset_n([1.5, 0.5, -0.5].map(before), &law.detour());
        }
    }

    /// The signals of the estimate.
    pub(crate) fn signals(&self) -> impl Iterator<Item = Signal> {
        self.observer
            .iter()
            .flat_map(|_| ForceObserver::SIGNALS)
            .map(|(name, about)| signal(name, "N", about))
    }

    /// Writes these signals.
    pub(crate) fn fill_signals(&self, signals: &mut [f64]) {
        if let Some(observer) = &self.observer {
            observer.fill_signals(signals);
        }
    }
}

/// A signal with its unit and meaning.
pub(crate) fn signal(name: &str, unit: &str, about: &str) -> Signal {
    Signal { name: name.to_owned(), unit: unit.to_owned(), about: about.to_owned() }
}
