//! What must never happen.

use masseter_scenario::{RequirementConfig, Scenario, Unit};

use super::condition::Condition;
use super::finding::Finding;
use super::moment::Moment;
use super::refusal::{OfKey, Refused};
use super::trigger::Trigger;
use super::window::Window;
use crate::signals::Values;

/// Judges that something never happens.
#[derive(Debug, Clone)]
pub(super) struct Never {
    what: What,
    window: Window,
    samples: u64,
    times: u64,
    first_ns: Option<u64>,
    /// The smallest margin and its moment.
    worst: Option<(f64, u64)>,
}

#[derive(Debug, Clone)]
enum What {
    Condition(Condition),
    Occurrence(Trigger),
}

impl Never {
    pub(super) fn new(
        config: &RequirementConfig,
        scenario: &Scenario,
        values: &mut Values,
    ) -> Result<Self, Refused> {
        let text = config.never.as_deref().unwrap_or_default();
        let what = match Condition::parse(text, values) {
            Ok(condition) => What::Condition(condition),
            Err(_) if !text.contains(['<', '>', '=']) => {
                What::Occurrence(Trigger::parse(text, scenario, values).of_key("require.never")?)
            }
            refused => refused.map(What::Condition).of_key("require.never")?,
        };
        let window = Window::new(config.during.as_ref(), scenario, values)?;
        Ok(Self { what, window, samples: 0, times: 0, first_ns: None, worst: None })
    }

    /// What must hold, in words.
    pub(super) fn must(&self) -> String {
        format!("never {}{}", self.text(), self.window.text)
    }

    fn text(&self) -> &str {
        match &self.what {
            What::Condition(condition) => &condition.text,
            What::Occurrence(trigger) => &trigger.text,
        }
    }

    pub(super) fn take(&mut self, moment: &Moment<'_>) {
        let is_inside = self.window.contains(moment);
        let (times, margin) = match &mut self.what {
            What::Condition(condition) => {
                let Some(robustness) = condition.robustness(moment.values) else { return };
                (u64::from(robustness >= 0.0), -robustness)
            }
            What::Occurrence(trigger) => (trigger.take(moment).len() as u64, f64::INFINITY),
        };
        if !is_inside {
            return;
        }
        self.samples += 1;
        self.times += times;
        if times > 0 {
            self.first_ns.get_or_insert(moment.time_ns);
        }
        if self.worst.is_none_or(|(worst, _)| margin < worst) {
            self.worst = Some((margin, moment.time_ns));
        }
    }

    pub(super) fn finish(self) -> Finding {
        let unit = self.unit();
        if self.samples == 0 {
            return Finding::untested(format!("no sample{}", self.window.text), unit);
        }
        let text = match self.times {
            0 => format!("never in {} samples", self.samples),
            times => format!("in {times} of {} samples", self.samples),
        };
        let worst = self.worst.filter(|(margin, _)| margin.is_finite());
        let relative_margin = match &self.what {
            What::Condition(condition) => worst.and_then(|(margin, _)| condition.share(margin)),
            What::Occurrence(_) => None,
        };
        Finding {
            margin: worst.map(|(margin, _)| margin),
            relative_margin,
            worst_ns: self.first_ns.or(worst.map(|(_, time_ns)| time_ns)),
            ..Finding::new(self.times == 0, text, unit)
        }
    }

    /// The unit of the margin.
    pub(super) fn unit(&self) -> Unit {
        match &self.what {
            What::Condition(condition) => condition.unit,
            What::Occurrence(_) => masseter_scenario::Dimension::One.si_unit(),
        }
    }
}
