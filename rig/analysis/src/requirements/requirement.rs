//! A requirement of any kind.

use masseter_scenario::{Dimension, RequirementConfig, Scenario};

use super::bounds::Bounds;
use super::count::Count;
use super::finding::{Finding, RequirementFigures, RequirementPlot};
use super::moment::Moment;
use super::never::Never;
use super::order::Order;
use super::refusal::Refused;
use super::response::Response;
use crate::signals::Values;

/// A requirement while the run is read.
#[derive(Debug, Clone)]
pub(super) struct Requirement {
    name: String,
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

impl Requirement {
    /// Reads a requirement, and chooses its signals.
    pub(super) fn new(
        config: &RequirementConfig,
        scenario: &Scenario,
        values: &mut Values,
    ) -> Result<Self, Refused> {
        let kinds = [
            (config.signal.is_some() || config.expression.is_some(), "signal"),
            (config.when.is_some() || config.then.is_some(), "when"),
            (config.never.is_some(), "never"),
            (config.event.is_some(), "event"),
            (!config.order.is_empty(), "order"),
        ];
        let given: Vec<_> = kinds.iter().filter(|(is_given, _)| *is_given).map(|(_, kind)| *kind).collect();
        let kind = match given.as_slice() {
            ["signal"] => Kind::Bounds(Box::new(Bounds::new(config, scenario, values)?)),
            ["when"] => Kind::Response(Box::new(Response::new(config, scenario, values)?)),
            ["never"] => Kind::Never(Never::new(config, scenario, values)?),
            ["event"] => Kind::Count(Count::new(config, scenario, values)?),
            ["order"] => Kind::Order(Order::new(config, scenario, values)?),
            _ => {
                let need = "give exactly one of signal (or expression), when with then, never, event, order";
                return Err(Refused::new("require", need));
            }
        };
        if let Some(key) = idle_key(config, given[0]) {
            return Err(Refused::new(key, format!("it has no effect with {}", given[0])));
        }
        Ok(Self { name: config.name.clone(), is_expected_event: false, kind })
    }

    /// A requirement that the run cannot test, for that reason.
    pub(super) fn unknown(config: &RequirementConfig, why: String) -> Self {
        Self { name: config.name.clone(), is_expected_event: false, kind: Kind::Unknown(why) }
    }

    /// The same as an event that `[expect]` names.
    pub(super) fn into_expected_event(self) -> Self {
        Self { is_expected_event: true, ..self }
    }

    pub(super) fn take(&mut self, moment: &Moment<'_>) {
        match &mut self.kind {
            Kind::Bounds(bounds) => bounds.take(moment),
            Kind::Response(response) => response.take(moment),
            Kind::Never(never) => never.take(moment),
            Kind::Count(count) => count.take(moment),
            Kind::Order(order) => order.take(moment),
            Kind::Unknown(_) => {}
        }
    }

    fn must(&self) -> String {
        match &self.kind {
            Kind::Bounds(bounds) => bounds.must(),
            Kind::Response(response) => response.must(),
            Kind::Never(never) => never.must(),
            Kind::Count(count) => count.must(),
            Kind::Order(order) => order.must(),
            Kind::Unknown(_) => String::new(),
        }
    }

    /// What it comes to. `motion_ns` is when the motion began.
    pub(super) fn finish(self, motion_ns: Option<u64>) -> RequirementFigures {
        let must = self.must();
        let (finding, plot): (Finding, Option<RequirementPlot>) = match self.kind {
            Kind::Bounds(bounds) => bounds.finish(),
            Kind::Response(response) => (response.finish(), None),
            Kind::Never(never) => (never.finish(), None),
            Kind::Count(count) => (count.finish(), None),
            Kind::Order(order) => (order.finish(), None),
            Kind::Unknown(why) => (Finding::untested(why, Dimension::One.si_unit()), None),
        };
        let since_motion_s = |ns: u64| Some((ns as f64 - motion_ns? as f64) / 1e9);
        RequirementFigures {
            name: self.name,
            must,
            result: finding.result,
            finding: finding.text,
            margin: finding.margin.map(|margin| margin / finding.unit.si),
            margin_unit: finding.unit.name,
            relative_margin: finding.relative_margin,
            worst_at_s: finding.worst_ns.and_then(since_motion_s),
            worst_ns: finding.worst_ns,
            latency_ms: finding.latency_s.map(|seconds| seconds * 1e3),
            may_be_disturbed: finding.may_be_disturbed,
            is_expected_event: self.is_expected_event,
            plot,
        }
    }
}

/// A given key that this kind of requirement does not use.
fn idle_key(config: &RequirementConfig, kind: &str) -> Option<&'static str> {
    let is_default_statistic = config.statistic == masseter_scenario::Statistic::default();
    let keys = [
        ("require.unit", config.unit.is_some(), "signal"),
        ("require.statistic", !is_default_statistic, "signal"),
        ("require.percentile", config.percentile.is_some(), "signal"),
        ("require.min", config.min.is_some(), "signal"),
        ("require.max", config.max.is_some(), "signal"),
        ("require.delay", config.delay.is_some(), "when"),
        ("require.within", config.within.is_some(), "when"),
        ("require.stays_for", config.stays_for.is_some(), "when"),
        ("require.at_least", config.at_least.is_some(), "event"),
        ("require.at_most", config.at_most.is_some(), "event"),
    ];
    let idle = keys.into_iter().find(|(_, is_given, of)| *is_given && *of != kind);
    let idle = idle.map(|(key, ..)| key);
    idle.or_else(|| (config.during.is_some() && kind == "order").then_some("require.during"))
        .or_else(|| (config.unit.is_some() && config.signal.is_some()).then_some("require.unit"))
}
