//! Requirements: what must hold in a run, each with its outcome, its margin and the moment of the smallest margin.
//!
//! All are judged in one pass over the samples of the run, in the order of time. `docs/requirements.md` fixes the meaning
//! of windows, missing samples and the run's end. What the outcomes mean for a run is the [verdict](crate::Verdict)'s.

mod bounds;
mod condition;
mod count;
mod dimension;
mod expression;
mod finding;
mod missing;
mod response;
mod trigger;

use std::collections::BTreeSet;

use masseter_runtime::{messages::codes::ControllerState, named::Declared};
use masseter_scenario::{
    Dimension, RequirementConfig, Scenario, Statistic, input::excerpt, wording::nearest,
};

use self::condition::{Lookup, Moment};
use self::count::{Count, Never, Order};
use self::finding::{Finding, Reason, Refused};
use self::{bounds::Bounds, missing::Phase, response::Response, trigger::Trigger};
use crate::check::CheckFigures;
use crate::signals::{Registry, Sample, Values};

pub use finding::{RequirementError, RequirementFigures, RequirementPlot};
pub use trigger::event_names;

/// Judges every requirement of a scenario, sample by sample.
#[derive(Debug, Clone)]
pub(crate) struct Requirements {
    list: Vec<Requirement>,
    values: Values,
    row: Vec<f64>,
    state: usize,
    motion_ns: Option<u64>,
    is_real_time: bool,
}

/// Refuses a scenario with a requirement that cannot be judged. Without `declared`, the controller's own signals and
/// parameters are unknown yet and not checked.
///
/// # Errors
/// [`RequirementError`] with the key in the scenario.
pub fn check_requirements(scenario: &Scenario, declared: Option<&Declared>) -> Result<(), RequirementError> {
    let values = &mut Values::new(Registry::new(scenario, declared.unwrap_or(&Declared::default())));
    let mut of = Lookup { scenario, values };
    let may_come = |reason: &Reason| match reason {
        Reason::Unknown(signal) => declared.is_none() && signal.is_of_controller(),
        Reason::Wrong(_) => false,
    };
    let mut names = BTreeSet::new();
    for (place, config) in scenario.require.iter().enumerate() {
        let refused = |Refused { key, reason }| RequirementError {
            key,
            entry: Some(place),
            of: format!("require '{}'", excerpt(&config.name)),
            reason: reason.to_string(),
        };
        if !names.insert(&config.name) {
            return Err(refused(Refused::new("require.name", "another requirement has this name")));
        }
        if let Err(error) = Requirement::new(config, &mut of)
            && !may_come(&error.reason)
        {
            return Err(refused(error));
        }
    }
    for name in scenario.expect.iter().flat_map(|expect| &expect.events) {
        Trigger::parse(name, &mut of).map_err(|reason| RequirementError {
            key: "expect.events",
            entry: None,
            of: "expect.events".to_owned(),
            reason: reason.to_string(),
        })?;
    }
    Ok(())
}

impl Requirements {
    /// The requirements of a scenario whose controller declares these signals and parameters, and the events that it expects.
    pub(crate) fn new(scenario: &Scenario, declared: &Declared) -> Self {
        let mut values = Values::new(Registry::new(scenario, declared));
        let mut of = Lookup { scenario, values: &mut values };
        let mut read = |config: &RequirementConfig| {
            Requirement::new(config, &mut of).unwrap_or_else(|refused| {
                Requirement::of_kind(config, Kind::Unknown(refused.reason.to_string()))
            })
        };
        let mut list: Vec<_> = scenario.require.iter().map(&mut read).collect();
        let expected = scenario.expect.iter().flat_map(|expect| &expect.events).map(expected_event);
        list.extend(expected.map(|config| Requirement { is_expected_event: true, ..read(&config) }));
        let state = values.choose("controller.state").expect("every run has this signal");
        Self { list, values, row: Vec::new(), state, motion_ns: None, is_real_time: false }
    }

    /// Whether the list is empty: then nothing has to be taken.
    pub(crate) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// The place of the requirement of that name; otherwise the most similar name.
    pub(crate) fn place_of(&self, name: &str) -> Result<usize, Option<&str>> {
        let names = || self.list.iter().map(|requirement| requirement.name.as_str());
        names().position(|known| known == name).ok_or_else(|| nearest(name, names()))
    }

    /// The margin of a requirement so far, in the unit in which it is shown; none before it shows.
    pub(crate) fn margin_so_far(&mut self, place: usize) -> Option<f64> {
        let (_, finding) = self.list[place].must_and_finding();
        finding.margin.map(|margin| margin / finding.unit.si)
    }

    /// What every requirement comes to.
    pub(crate) fn into_figures(self) -> Vec<RequirementFigures> {
        self.list.into_iter().map(|requirement| requirement.into_figures(self.motion_ns)).collect()
    }

    /// Takes the next sample.
    pub(crate) fn judge_sample(&mut self, Sample { time_ns, messages, events, is_closing }: &Sample) {
        self.values.take(messages, &mut self.row);
        if self.row[self.state].to_bits() == f64::from(ControllerState::Running.code()).to_bits() {
            self.motion_ns.get_or_insert(*time_ns);
        }
        let motion_s = self.motion_ns.map(|motion_ns| (time_ns - motion_ns) as f64 / 1e9);
        let (values, is_disturbed) = (self.row.as_slice(), messages.is_disturbed);
        // Simulated time has no account of the loops.
        self.is_real_time |= messages.state.is_some_and(|state| state.worked_ns > 0);
        let (phase, is_real_time, is_closing) = (Phase::of(messages), self.is_real_time, *is_closing);
        let time_ns = *time_ns;
        let moment =
            Moment { time_ns, motion_s, values, events, phase, is_disturbed, is_real_time, is_closing };
        self.list.iter_mut().for_each(|requirement| requirement.judge_moment(&moment));
    }
}

/// The requirement that an expected event occurs.
fn expected_event(name: &String) -> RequirementConfig {
    RequirementConfig {
        name: format!("expected event {name}"),
        event: Some(name.clone()),
        at_least: Some(1),
        ..Default::default()
    }
}

/// A requirement while the run is read.
#[derive(Debug, Clone)]
struct Requirement {
    name: String,
    id: Option<String>,
    is_expected_event: bool,
    kind: Kind,
}

#[derive(Debug, Clone)]
enum Kind {
    Bounds(Box<Bounds>),
    Response(Box<Response>),
    Never(Never),
    Count(Count),
    Order(Order),
    /// A signal that the controller turns out not to have.
    Unknown(String),
}

/// The forms of a requirement, by the keys that make it one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    Signal,
    When,
    Never,
    Event,
    Order,
}

impl Requirement {
    fn of_kind(config: &RequirementConfig, kind: Kind) -> Self {
        Self { name: config.name.clone(), id: config.id.clone(), is_expected_event: false, kind }
    }

    /// Reads a requirement, and chooses its signals.
    fn new(config: &RequirementConfig, of: &mut Lookup<'_>) -> Result<Self, Refused> {
        let forms = [
            (Form::Signal, "signal", config.signal.is_some() || config.expression.is_some()),
            (Form::When, "when", config.when.is_some() || config.then.is_some()),
            (Form::Never, "never", config.never.is_some()),
            (Form::Event, "event", config.event.is_some()),
            (Form::Order, "order", !config.order.is_empty()),
        ];
        let mut given = forms.into_iter().filter(|(.., is_given)| *is_given);
        let (Some((form, key, _)), None) = (given.next(), given.next()) else {
            let need = "give exactly one of signal (or expression), when with then, never, event, order";
            return Err(Refused::new("require", need));
        };
        let kind = match form {
            Form::Signal => Kind::Bounds(Box::new(Bounds::new(config, of)?)),
            Form::When => Kind::Response(Box::new(Response::new(config, of)?)),
            Form::Never => Kind::Never(Never::new(config, of)?),
            Form::Event => Kind::Count(Count::new(config, of)?),
            Form::Order => Kind::Order(Order::new(config, of)?),
        };
        match idle_key(config, form) {
            Some(idle) => Err(Refused::new(idle, format!("it has no effect with {key}"))),
            None => Ok(Self::of_kind(config, kind)),
        }
    }

    fn judge_moment(&mut self, moment: &Moment<'_>) {
        match &mut self.kind {
            Kind::Bounds(bounds) => bounds.judge_moment(moment),
            Kind::Response(response) => response.judge_moment(moment),
            Kind::Never(never) => never.judge_moment(moment),
            Kind::Count(count) => count.judge_moment(moment),
            Kind::Order(order) => order.judge_moment(moment),
            Kind::Unknown(_) => {}
        }
    }

    /// Whether it judges what the mechanism does, and not what a controller states of it.
    fn is_truth(&self) -> bool {
        match &self.kind {
            Kind::Bounds(bounds) => bounds.is_truth(),
            Kind::Response(response) => response.is_truth(),
            Kind::Never(never) => never.is_truth(),
            Kind::Count(_) | Kind::Order(_) | Kind::Unknown(_) => false,
        }
    }

    /// What must hold, in words, and what the samples so far come to.
    fn must_and_finding(&mut self) -> (String, Finding) {
        match &mut self.kind {
            Kind::Bounds(bounds) => (bounds.must(), bounds.finding()),
            // The windows that are open end here, but only in a copy.
            Kind::Response(response) => (response.must(), response.clone().into_finding()),
            Kind::Never(never) => (never.must(), never.finding()),
            Kind::Count(count) => (count.must(), count.finding()),
            Kind::Order(order) => (order.must(), order.finding()),
            Kind::Unknown(why) => (String::new(), Finding::untested(why.clone(), Dimension::One.si_unit())),
        }
    }

    /// What it comes to. `motion_ns` is when the motion began.
    fn into_figures(mut self, motion_ns: Option<u64>) -> RequirementFigures {
        let (is_truth, (must, finding)) = (self.is_truth(), self.must_and_finding());
        let plot = if let Kind::Bounds(bounds) = &mut self.kind { Some(bounds.plot()) } else { None };
        let since_motion_s = |ns: u64| Some((ns as f64 - motion_ns? as f64) / 1e9);
        RequirementFigures {
            name: self.name,
            id: self.id,
            must,
            result: finding.result,
            finding: finding.text,
            figures: CheckFigures {
                margin: finding.margin.map(|margin| margin / finding.unit.si),
                margin_unit: finding.unit.name,
                relative_margin: finding.relative_margin,
                worst_at_s: finding.worst_ns.and_then(since_motion_s),
                latency_ms: finding.latency_s.map(|seconds| seconds * 1e3),
            },
            worst_ns: finding.worst_ns,
            breach: finding.breach,
            may_be_disturbed: finding.may_be_disturbed,
            is_expected_event: self.is_expected_event,
            is_truth,
            plot,
        }
    }
}

/// A given key that this form of a requirement does not use.
fn idle_key(config: &RequirementConfig, form: Form) -> Option<&'static str> {
    let keys = [
        ("require.unit", config.unit.is_some(), Form::Signal),
        ("require.statistic", config.statistic != Statistic::default(), Form::Signal),
        ("require.percentile", config.percentile.is_some(), Form::Signal),
        ("require.min", config.min.is_some(), Form::Signal),
        ("require.max", config.max.is_some(), Form::Signal),
        ("require.delay", config.delay.is_some(), Form::When),
        ("require.within", config.within.is_some(), Form::When),
        ("require.stays_for", config.stays_for.is_some(), Form::When),
        ("require.at_least", config.at_least.is_some(), Form::Event),
        ("require.at_most", config.at_most.is_some(), Form::Event),
    ];
    let idle = keys.into_iter().find(|(_, is_given, of)| *is_given && *of != form);
    let of_order = [("require.during", config.during.is_some()), ("require.whole", config.whole)];
    let of_order =
        || of_order.into_iter().find(|(_, is_given)| *is_given && form == Form::Order).map(|(key, _)| key);
    let of_signal = || (config.unit.is_some() && config.signal.is_some()).then_some("require.unit");
    idle.map(|(key, ..)| key).or_else(of_order).or_else(of_signal)
}

#[cfg(test)]
mod tests;
