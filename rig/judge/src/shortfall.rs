//! By what a finished motion is not the one that the run was to play: how far the jaw went, for how long, and in which order.
//! Whether the run passes is the [verdict](super::verdict)'s.

use std::fmt::{self, Display, Formatter};

use masseter_recording::{Ending, Manifest};
use masseter_runtime::messages::codes::ControllerState;
use masseter_runtime::{control::Deadline, named::PlayedMotion};
use masseter_scenario::ExpectedVerdict;

use crate::stop_cause::acted_before;
use crate::{
    breach::Breach, check::Check, check::CheckResult, figures::Figures, played::StoppedBy,
    reference::Disorder,
};

/// Share of the motion that the jaw must go.
const WHOLE: f64 = 0.95;
/// Share of the time that the motion must last.
const WHOLE_TIME: f64 = 0.99;

/// By what a finished motion is not the one that the run was to play.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Shortfall {
    /// The jaw went only this share of the scenario's motion.
    NotPlayed { share: f64, way_mm: f64 },
    /// The controller did not begin the motion in this time, s, so that the rig ended the run.
    NotBegun { limit_s: f64 },
    /// The controller did not end in this time, s, so that the rig ended the run.
    NotEnded { limit_s: f64 },
    /// The controller's states are out of order.
    OutOfOrder(Disorder),
    /// The scenario's motion moves nothing.
    Still,
    /// The motion ended too early. Requirements judge only what was played.
    Early { running_s: f64, duration_s: f64, least_s: f64 },
    /// The motion is the controller's own or gone since the run, and no requirement judges the jaw.
    Unjudged,
    /// The controller alone states or asks for the expected safe stop, and nothing caused or judged the stop.
    OnlyStated,
}

impl Shortfall {
    /// `None` if the motion was played, and where something that anybody sees ended it, which has a verdict of its own.
    pub(crate) fn of(manifest: &Manifest, figures: &Figures) -> Option<Self> {
        let is_in = |expected| figures.final_state.is_some_and(|state| state == expected);
        if manifest.ending == Ending::Overdue {
            return Some(Self::overdue(manifest, figures));
        }
        match figures.stopped_by {
            Some(StoppedBy::Master) => return None,
            Some(StoppedBy::QuickStop | StoppedBy::Drives) => return Self::of_stated_stop(manifest, figures),
            None if is_in(ControllerState::SafeStop) => return Self::of_stated_stop(manifest, figures),
            None => {}
        }
        let is_never = |found: &(Disorder, _)| found.0 == Disorder::NeverBegan;
        // A stop by request, or the end of a process, may come before the motion.
        let may_be_short = figures.was_stopped_by_request() || manifest.ending != Ending::Completed;
        let disorder = figures.disorder.filter(|disorder| !(is_never(disorder) && may_be_short));
        if !is_in(ControllerState::Finished) {
            return disorder.filter(is_never).map(|(disorder, _)| Self::OutOfOrder(disorder));
        }
        if let Some((disorder, _)) = disorder {
            return Some(Self::OutOfOrder(disorder));
        }
        if manifest.declared.motion == PlayedMotion::Own {
            return Self::early(manifest, figures).or_else(|| Self::unjudged(manifest, figures));
        }
        match (figures.motion.way_mm, figures.motion.played) {
            (None, _) => Self::unjudged(manifest, figures),
            (Some(_), None) => (!figures.was_stopped_by_request()).then_some(Self::Still),
            (Some(way_mm), Some(share)) => {
                let is_played = share >= WHOLE;
                let short = (!is_played).then_some(Self::NotPlayed { share, way_mm });
                short.or_else(|| Self::cut(manifest, figures))
            }
        }
    }

    /// By the deadline that the plant kept.
    fn overdue(manifest: &Manifest, figures: &Figures) -> Self {
        let deadline = Deadline::new(&manifest.scenario, &manifest.declared, manifest.motion_s);
        if figures.has_begun {
            Self::NotEnded { limit_s: deadline.end_s }
        } else {
            Self::NotBegun { limit_s: deadline.begin_s }
        }
    }

    fn early(manifest: &Manifest, figures: &Figures) -> Option<Self> {
        let (running_s, duration_s) = (figures.running_s, manifest.motion_s);
        let least_s = WHOLE_TIME * duration_s;
        let is_early = running_s < least_s && !figures.was_stopped_by_request();
        is_early.then_some(Self::Early { running_s, duration_s, least_s })
    }

    /// The scenario's motion may be faster than written; what is left of it counts.
    fn cut(manifest: &Manifest, figures: &Figures) -> Option<Self> {
        let duration_s = manifest.motion_s;
        let running_s = duration_s - figures.motion.rest_s?;
        let least_s = WHOLE_TIME * duration_s - manifest.scenario.checks.motion_lag_ms / 1e3;
        (running_s < least_s).then_some(Self::Early { running_s, duration_s, least_s })
    }

    fn unjudged(manifest: &Manifest, figures: &Figures) -> Option<Self> {
        (manifest.is_of_program() && !has_judged_truth(figures)).then_some(Self::Unjudged)
    }

    /// A program can state a safe stop, or switch the drives off, at any time. An expected stop needs a cause from outside before it, or a requirement.
    fn of_stated_stop(manifest: &Manifest, figures: &Figures) -> Option<Self> {
        let expect = manifest.scenario.expect.as_ref();
        let is_expected = expect.is_some_and(|expect| expect.accepts(ExpectedVerdict::SafeStop));
        let has_cause = acted_before(manifest, figures, figures.last_act_ns().unwrap_or(u64::MAX));
        let is_proved = has_cause || has_judged_truth(figures) || !manifest.is_of_program();
        (is_expected && !is_proved).then_some(Self::OnlyStated)
    }

    /// What is beyond its limit; none where nothing shows.
    fn breach(self, figures: &Figures) -> Option<Breach> {
        let motion_ns = figures.path_breach.motion_ns;
        let percent = |share: f64| format!("{:.0} %", (share * 100.0).round() + 0.0);
        let seconds = |s: f64| format!("{s:.2} s");
        match self {
            Self::NotPlayed { share, .. } => {
                Some(Breach::new("played part of the motion", percent(share), percent(WHOLE)).over(motion_ns))
            }
            Self::Early { running_s, least_s, .. } => {
                let breach = Breach::new("the motion ran for", seconds(running_s), seconds(least_s));
                Some(breach.at(motion_ns.map(|[_, ended_ns]| ended_ns)))
            }
            Self::NotBegun { limit_s } => {
                Some(Breach::new("state running", "never", format!("within {}", seconds(limit_s))))
            }
            Self::NotEnded { limit_s } => {
                Some(Breach::new("state finished", "never", format!("within {}", seconds(limit_s))))
            }
            Self::OutOfOrder(disorder) => {
                Some(out_of_order(disorder).at(figures.disorder.and_then(|(_, at_ns)| at_ns)))
            }
            Self::Still | Self::Unjudged | Self::OnlyStated => None,
        }
    }

    /// The check of that name, which fails, or is untested where nothing is beyond a limit.
    pub(crate) fn check(self, name: &'static str, figures: &Figures) -> Check {
        match self.breach(figures) {
            Some(breach) => Check::judged(name, self.to_string(), false).with_breach(breach),
            None => Check::untested(name, self.to_string()),
        }
    }
}

impl Display for Shortfall {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotPlayed { share, way_mm } => write!(
                f,
                "the scenario's motion was not played: {:.0} % of its way of {way_mm:.1} mm; a controller with a motion of its own \
                 declares it",
                // No share of -0 %.
                (share * 100.0).round() + 0.0
            ),
            Self::NotBegun { limit_s } => write!(
                f,
                "the controller did not begin the motion within {limit_s:.1} s of the first SYNC, so the rig ended the run; \
                 controller.overdue_s gives it more time"
            ),
            Self::NotEnded { limit_s } => write!(
                f,
                "the controller did not end within {limit_s:.1} s of the motion's beginning, so the rig ended the run; \
                 controller.overdue_s gives it more time"
            ),
            Self::OutOfOrder(disorder) => disorder.fmt(f),
            Self::Still => f.write_str("the scenario's motion does not move the jaw"),
            Self::Early { running_s, duration_s, .. } => write!(
                f,
                "the controller's motion ended early: {running_s:.2} of its {duration_s:.2} s were played; for a \
                 motion of its own, set the end by --duration"
            ),
            Self::Unjudged => f.write_str(
                "nothing judged the motion, which is not the scenario's: require something of the true jaw in [[require]], such as \
                 incisal.z; on the robot of the encoders, such as l1.position",
            ),
            Self::OnlyStated => f.write_str(
                "the controller alone caused the safe stop: declare the fault that it answers in [[faults]], or require something of \
                 the true jaw in [[require]]",
            ),
        }
    }
}

/// The state that is out of order, and where it belongs.
fn out_of_order(disorder: Disorder) -> Breach {
    match disorder {
        Disorder::NeverBegan => Breach::new("state running", "never", "from the end of the lead-in on"),
        Disorder::BeforeDrives => {
            Breach::new("state", ControllerState::Running.to_string(), "once all drives are enabled")
        }
        Disorder::Back { from, to } => Breach::new("state", to.to_string(), format!("not after {from}")),
    }
}

/// Whether a requirement on the true jaw was judged. What the controller states of its own motion does not count.
fn has_judged_truth(figures: &Figures) -> bool {
    let mut required = figures.requirements.iter().filter(|required| required.is_truth);
    required.any(|required| required.result != CheckResult::Untested)
}

#[cfg(test)]
mod tests;
