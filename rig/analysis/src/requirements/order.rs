//! Occurrences that come in an order.

use masseter_scenario::{Dimension, RequirementConfig, Scenario};

use super::finding::Finding;
use super::moment::Moment;
use super::refusal::{OfKey, Refused};
use super::trigger::Trigger;
use crate::signals::Values;

/// Judges the order of the first occurrences.
#[derive(Debug, Clone)]
pub(super) struct Order {
    /// Each with the time of its first occurrence, ns.
    steps: Vec<(Trigger, Option<u64>)>,
}

impl Order {
    pub(super) fn new(
        config: &RequirementConfig,
        scenario: &Scenario,
        values: &mut Values,
    ) -> Result<Self, Refused> {
        if config.order.len() < 2 {
            return Err(Refused::new("require.order", "give at least two occurrences in order"));
        }
        let mut step =
            |name: &String| Ok((Trigger::parse(name, scenario, values).of_key("require.order")?, None));
        Ok(Self { steps: config.order.iter().map(&mut step).collect::<Result<_, Refused>>()? })
    }

    /// What must hold, in words.
    pub(super) fn must(&self) -> String {
        let names: Vec<_> = self.steps.iter().map(|(trigger, _)| trigger.text.as_str()).collect();
        names.join(", then ")
    }

    pub(super) fn take(&mut self, moment: &Moment<'_>) {
        for (trigger, first_ns) in &mut self.steps {
            if let Some(time_ns) = trigger.take(moment).first() {
                first_ns.get_or_insert(*time_ns);
            }
        }
    }

    pub(super) fn finish(self) -> Finding {
        let unit = Dimension::One.si_unit();
        let (first, first_ns) = &self.steps[0];
        if first_ns.is_none() {
            return Finding::untested(format!("{} never came", first.text), unit);
        }
        if let Some((missing, _)) = self.steps.iter().find(|(_, first_ns)| first_ns.is_none()) {
            return Finding::new(false, format!("{} never came", missing.text), unit);
        }
        let wrong = self.steps.windows(2).find(|pair| pair[1].1 < pair[0].1);
        match wrong {
            Some([(early, _), (late, late_ns)]) => {
                let text = format!("{} came before {}", late.text, early.text);
                Finding { worst_ns: *late_ns, ..Finding::new(false, text, unit) }
            }
            _ => Finding::new(true, "in this order".to_owned(), unit),
        }
    }
}
