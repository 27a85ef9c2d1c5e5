//! Whether the motion was played that the run was to play, by the facts: the scenario's motion, the time for which the drives
//! were enabled, and how far the motion came by the judge's own count.

use std::fmt::{self, Display, Formatter};

use masseter_analysis::requirements::RequirementResult;
use masseter_analysis::{Departure, Figures};
use masseter_recording::Manifest;
use masseter_runtime::messages::codes::{Cause, ControllerState};
use masseter_runtime::named::PlayedMotion;

use crate::check::CheckResult;

/// Share of the motion that must be played; the last ramp moves nothing any more.
const WHOLE: f64 = 0.99;
/// A stated desired pose farther from the scenario's motion is that of another motion, mm and degrees. A program that computes
/// the motion itself rounds otherwise.
const SAME_POSE: f64 = 0.01;

/// By what a finished motion is not the one that the run was to play.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Shortfall {
    /// The desired poses are not those of the scenario's motion.
    Other(Departure),
    /// The scenario's motion did not come to its end.
    Early { reached_s: f64, end_s: f64 },
    /// The drives were not enabled for as long as an own motion is to last.
    OwnEarly { enabled_s: f64, duration_s: f64 },
    /// A program's desired poses need not be the scenario's, and no requirement judges the run.
    Unjudged,
}

impl Shortfall {
    /// None where the motion was played, and where a stop ended it, which has a verdict of its own. A motion that was stopped by
    /// request is short, but none other.
    pub(crate) fn of(manifest: &Manifest, figures: &Figures) -> Option<Self> {
        let has_finished = figures.final_state.is_some_and(|state| state == ControllerState::Finished);
        if !has_finished || figures.stopped_by.is_some() {
            return None;
        }
        let found = match manifest.declared.motion {
            PlayedMotion::Own => Self::of_own(manifest, figures),
            PlayedMotion::Scenario => Self::of_scenario(manifest, figures),
        };
        found.filter(|found| matches!(found, Self::Other(_)) || !was_stopped_by_request(figures))
    }

    fn of_scenario(manifest: &Manifest, figures: &Figures) -> Option<Self> {
        let is_same = |departure: &Departure| departure.incisal_mm <= SAME_POSE && departure.deg <= SAME_POSE;
        if let Some(departure) = figures.motion_departure.filter(|departure| !is_same(departure)) {
            return Some(Self::Other(departure));
        }
        let (end_s, reached_s) = (manifest.motion_end_s?, figures.motion_reached_s.unwrap_or(0.0));
        let early = (reached_s < WHOLE * end_s).then_some(Self::Early { reached_s, end_s });
        let is_compared = figures.motion_departure.is_some_and(|departure| !departure.is_partial);
        early.or_else(|| if is_compared { None } else { Self::unjudged(manifest, figures) })
    }

    fn of_own(manifest: &Manifest, figures: &Figures) -> Option<Self> {
        let (enabled_s, duration_s) = (figures.enabled_s, manifest.motion_s);
        let early = (enabled_s < WHOLE * duration_s).then_some(Self::OwnEarly { enabled_s, duration_s });
        early.or_else(|| Self::unjudged(manifest, figures))
    }

    fn unjudged(manifest: &Manifest, figures: &Figures) -> Option<Self> {
        let mut required = figures.requirements.iter().filter(|required| !required.is_expected_event);
        let is_judged = required.any(|required| required.result != RequirementResult::Untested);
        (manifest.is_of_program() && !is_judged).then_some(Self::Unjudged)
    }

    pub(crate) fn result(self) -> CheckResult {
        if self == Self::Unjudged { CheckResult::Untested } else { CheckResult::Failed }
    }
}

impl Display for Shortfall {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Other(Departure { incisal_mm, deg, at_s, .. }) => write!(
                f,
                "the scenario's motion was not played: the desired pose is up to {incisal_mm:.3} mm (at {at_s:.3} s of the \
                 motion) and {deg:.3}° from it; a controller with a motion of its own declares it"
            ),
            Self::Early { reached_s, end_s } => write!(
                f,
                "the scenario's motion was not played: it came to {reached_s:.2} of {end_s:.2} s of its own time"
            ),
            Self::OwnEarly { enabled_s, duration_s } => write!(
                f,
                "the controller's own motion ended early: the drives were enabled for {enabled_s:.2} of {duration_s:.2} s; \
                 --duration declares its end"
            ),
            Self::Unjudged => write!(
                f,
                "nothing judged the motion, whose desired poses need not be the scenario's: require something of the jaw in \
                 [[require]]"
            ),
        }
    }
}

/// Whether the motion was to end early: by the operator, the scenario, or the controller itself.
pub(crate) fn was_stopped_by_request(figures: &Figures) -> bool {
    figures.events.iter().any(|event| event.cause == Cause::StopRequested)
}

/// What is added where the motion is not the scenario's.
pub(crate) fn whose_motion(manifest: &Manifest) -> &'static str {
    match manifest.declared.motion {
        PlayedMotion::Scenario => "",
        PlayedMotion::Own => ", own motion of the controller",
    }
}

#[cfg(test)]
mod tests {
    use masseter_analysis::requirements::RequirementFigures;
    use masseter_analysis::{Analysis, Code, EventRecord, StoppedBy};
    use masseter_recording::MachineInfo;
    use masseter_runtime::messages::Event;
    use masseter_runtime::messages::codes::{EventKind, Source};
    use masseter_runtime::named::Declared;
    use masseter_scenario::Scenario;

    use super::*;

    const PLAYED: Departure = Departure { incisal_mm: 0.009, deg: 0.009, at_s: 1.0, is_partial: false };

    /// A finished run that played 10 s to the end, with this change.
    fn shortfall(change: impl FnOnce(&mut Manifest, &mut Figures)) -> Option<Shortfall> {
        let machine = MachineInfo { cpu: "any".into(), cores: 2, kernel: "Linux".into(), is_virtual: false };
        let mut manifest = Manifest::new("0.1.0", Scenario::default(), 10.0, "virtual", machine);
        (manifest.motion_end_s, manifest.controller) = (Some(9.5), Some("external".to_owned()));
        let mut figures = Analysis::new(&manifest.scenario, &Declared::default()).finish(false, &[]);
        figures.final_state = Some(Code::Known(ControllerState::Finished));
        (figures.enabled_s, figures.motion_reached_s) = (11.0, Some(9.5));
        figures.motion_departure = Some(PLAYED);
        change(&mut manifest, &mut figures);
        Shortfall::of(&manifest, &figures)
    }

    fn stop_by_request(figures: &mut Figures) {
        let stop = Event::new(Source::Controller, EventKind::Transition, Cause::StopRequested);
        figures.events.push(EventRecord::from(&stop));
    }

    fn require(figures: &mut Figures, result: RequirementResult, is_expected_event: bool) {
        figures.requirements.push(RequirementFigures {
            name: "opens".to_owned(),
            must: String::new(),
            result,
            finding: String::new(),
            margin: None,
            margin_unit: "mm",
            relative_margin: None,
            worst_at_s: None,
            worst_ns: None,
            latency_ms: None,
            may_be_disturbed: false,
            is_expected_event,
            plot: None,
        });
    }

    #[test]
    fn the_scenarios_motion_is_played_along_its_path_and_to_its_end() {
        assert_eq!(shortfall(|_, _| ()), None);
        assert_eq!(shortfall(|_, figures| figures.motion_reached_s = Some(9.41)), None);
        let early = |reached_s| Some(Shortfall::Early { reached_s, end_s: 9.5 });
        assert_eq!(shortfall(|_, figures| figures.motion_reached_s = Some(9.4)), early(9.4));
        assert_eq!(shortfall(|_, figures| figures.motion_reached_s = None), early(0.0));
        // With force control or another amplitude, the desired poses show nothing.
        for departure in [None, Some(Departure { is_partial: true, ..PLAYED })] {
            let found = shortfall(|_, figures| figures.motion_departure = departure);
            assert_eq!(found, Some(Shortfall::Unjudged));
        }
        for departure in [
            Departure { incisal_mm: 0.011, ..PLAYED },
            Departure { deg: 0.011, ..PLAYED },
            Departure { incisal_mm: f64::INFINITY, ..PLAYED },
        ] {
            let found = shortfall(|_, figures| figures.motion_departure = Some(departure));
            assert_eq!(found, Some(Shortfall::Other(departure)));
        }
    }

    #[test]
    fn a_request_excuses_an_early_end_and_no_other_motion() {
        let early = |figures: &mut Figures| figures.motion_reached_s = Some(3.0);
        assert!(shortfall(|_, figures| early(figures)).is_some());
        let stopped = shortfall(|_, figures| {
            early(figures);
            stop_by_request(figures);
        });
        assert_eq!(stopped, None);
        let other = Departure { incisal_mm: 7.0, ..PLAYED };
        let stopped = shortfall(|_, figures| {
            figures.motion_departure = Some(other);
            stop_by_request(figures);
        });
        assert_eq!(stopped, Some(Shortfall::Other(other)));
    }

    #[test]
    fn a_stop_and_an_end_in_another_state_are_told_otherwise() {
        let never_moved = |figures: &mut Figures| figures.motion_reached_s = None;
        let stopped = shortfall(|_, figures| {
            never_moved(figures);
            figures.stopped_by = Some(StoppedBy::Master);
        });
        let unfinished = shortfall(|_, figures| {
            never_moved(figures);
            figures.final_state = Some(Code::Known(ControllerState::Running));
        });
        assert_eq!([stopped, unfinished], [None, None]);
    }

    #[test]
    fn an_own_motion_lasts_as_long_as_the_scenario_says_and_is_judged_by_a_requirement() {
        let own = |change: fn(&mut Manifest, &mut Figures)| {
            shortfall(|manifest, figures| {
                manifest.declared.motion = PlayedMotion::Own;
                // Nothing that the scenario's motion would have to be.
                (figures.motion_reached_s, figures.motion_departure) = (None, None);
                change(manifest, figures);
            })
        };
        assert_eq!(own(|_, _| ()), Some(Shortfall::Unjudged));
        assert_eq!(own(|manifest, _| manifest.controller = Some("hold".to_owned())), None);
        for (result, is_expected_event, expected) in [
            (RequirementResult::Passed, false, None),
            (RequirementResult::Failed, false, None),
            (RequirementResult::Untested, false, Some(Shortfall::Unjudged)),
            (RequirementResult::Passed, true, Some(Shortfall::Unjudged)),
        ] {
            let found = shortfall(|manifest, figures| {
                manifest.declared.motion = PlayedMotion::Own;
                require(figures, result, is_expected_event);
            });
            assert_eq!(found, expected, "{result:?}");
        }
        let early = Shortfall::OwnEarly { enabled_s: 4.3, duration_s: 10.0 };
        assert_eq!(own(|_, figures| figures.enabled_s = 4.3), Some(early));
    }
}
