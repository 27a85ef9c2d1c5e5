//! How often something occurs.

use masseter_scenario::wording::counted;
use masseter_scenario::{Dimension, RequirementConfig, Scenario};

use super::finding::Finding;
use super::moment::Moment;
use super::refusal::{OfKey, Refused};
use super::trigger::Trigger;
use super::window::Window;
use crate::signals::Values;

/// Judges a number of occurrences.
#[derive(Debug, Clone)]
pub(super) struct Count {
    trigger: Trigger,
    window: Window,
    at_least: Option<u64>,
    at_most: Option<u64>,
    samples: u64,
    times: u64,
    last_ns: Option<u64>,
}

impl Count {
    pub(super) fn new(
        config: &RequirementConfig,
        scenario: &Scenario,
        values: &mut Values,
    ) -> Result<Self, Refused> {
        let RequirementConfig { at_least, at_most, .. } = *config;
        if at_least.is_none() && at_most.is_none() {
            return Err(Refused::new("require.at_least", "give at_least, at_most or both"));
        }
        if at_least.zip(at_most).is_some_and(|(least, most)| least > most) {
            return Err(Refused::new("require.at_least", "at_least is above at_most"));
        }
        let event = config.event.as_deref().unwrap_or_default();
        let trigger = Trigger::parse(event, scenario, values).of_key("require.event")?;
        let window = Window::new(config.during.as_ref(), scenario, values)?;
        Ok(Self { trigger, window, at_least, at_most, samples: 0, times: 0, last_ns: None })
    }

    /// What must hold, in words.
    pub(super) fn must(&self) -> String {
        let least = self.at_least.map(|least| format!("at least {least}"));
        let most = self.at_most.map(|most| format!("at most {most}"));
        let limits: Vec<_> = least.into_iter().chain(most).collect();
        format!("{} {} times{}", self.trigger.text, limits.join(" and "), self.window.text)
    }

    pub(super) fn take(&mut self, moment: &Moment<'_>) {
        let times = self.trigger.take(moment).len() as u64;
        if self.window.contains(moment) {
            self.samples += 1;
            self.times += times;
            if times > 0 {
                self.last_ns = Some(moment.time_ns);
            }
        }
    }

    pub(super) fn finish(self) -> Finding {
        let unit = Dimension::One.si_unit();
        if self.samples == 0 {
            return Finding::untested(format!("no sample{}", self.window.text), unit);
        }
        let above = self.at_least.map(|least| self.times as f64 - least as f64);
        let below = self.at_most.map(|most| most as f64 - self.times as f64);
        let margin = above.into_iter().chain(below).fold(f64::INFINITY, f64::min);
        let text = counted(self.times, "time");
        Finding { margin: Some(margin), worst_ns: self.last_ns, ..Finding::new(margin >= 0.0, text, unit) }
    }
}
