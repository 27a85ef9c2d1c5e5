//! What must never happen, how often something occurs, and in which order.

use masseter_scenario::{Dimension, RequirementConfig, wording::counted};

use super::condition::{Condition, Lookup, Moment, is_condition};
use super::finding::{Finding, OfKey, Refused};
use super::missing::Missing;
use super::trigger::{Trigger, Window};
use crate::breach::{Breach, widen};

/// Judges that something never happens.
#[derive(Debug, Clone)]
pub(super) struct Never {
    what: What,
    window: Window,
    samples: u64,
    missing: Missing,
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
    pub(super) fn new(config: &RequirementConfig, of: &mut Lookup<'_>) -> Result<Self, Refused> {
        let text = config.never.as_deref().unwrap_or_default();
        let what = if is_condition(text) {
            What::Condition(Condition::parse(text, of.values).of_key("require.never")?)
        } else {
            What::Occurrence(Trigger::parse(text, of).of_key("require.never")?)
        };
        let window = Window::new(config, of)?;
        let missing = Missing::default();
        Ok(Self { what, window, samples: 0, missing, times: 0, first_ns: None, worst: None })
    }

    /// Whether it judges what the mechanism does.
    pub(super) fn is_truth(&self) -> bool {
        matches!(&self.what, What::Condition(condition) if condition.is_truth)
    }

    /// What must hold, in words.
    pub(super) fn must(&self) -> String {
        let what = match &self.what {
            What::Condition(condition) => &condition.text,
            What::Occurrence(trigger) => &trigger.text,
        };
        format!("never {what}{}", self.window.text)
    }

    pub(super) fn judge_moment(&mut self, moment: &Moment<'_>) {
        let is_inside = self.window.contains(moment);
        self.missing.apply_phase(moment.phase);
        let (times, margin) = match &mut self.what {
            What::Condition(condition) => {
                let robustness = condition.robustness(moment.values);
                if is_inside && !moment.is_closing {
                    self.missing.count_sample(robustness.is_some(), moment.phase, moment.is_real_time);
                }
                let Some(robustness) = robustness else { return };
                (u64::from(robustness >= 0.0), -robustness)
            }
            What::Occurrence(trigger) => (trigger.times_ns(moment).len() as u64, f64::INFINITY),
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

    pub(super) fn finding(&self) -> Finding {
        let worst = self.worst.filter(|(margin, _)| margin.is_finite());
        let (unit, relative_margin) = match &self.what {
            What::Condition(condition) => {
                (condition.unit, worst.and_then(|(margin, _)| condition.share(margin)))
            }
            What::Occurrence(_) => (Dimension::One.si_unit(), None),
        };
        if self.samples == 0 {
            return Finding::untested(format!("no sample{}", self.window.text), unit);
        }
        let text = match self.times {
            0 => format!("never in {} samples", self.samples),
            times => format!("in {times} of {} samples", self.samples),
        };
        let (what, how) = match &self.what {
            What::Condition(condition) => (&condition.text, "held"),
            What::Occurrence(trigger) => (&trigger.text, "occurred"),
        };
        let finding = Finding {
            breach: self.first_ns.map(|first_ns| Breach::new(what, how, "never").at(first_ns)),
            margin: worst.map(|(margin, _)| margin),
            relative_margin,
            worst_ns: self.first_ns.or(worst.map(|(_, time_ns)| time_ns)),
            ..Finding::new(self.times == 0, text, unit)
        };
        self.window.limit(finding.with_missing(&self.missing), None)
    }
}

/// Judges a number of occurrences.
#[derive(Debug, Clone)]
pub(super) struct Count {
    trigger: Trigger,
    window: Window,
    at_least: Option<u64>,
    at_most: Option<u64>,
    samples: u64,
    /// From the first to the last judged sample, ns.
    span_ns: Option<[u64; 2]>,
    times: u64,
    /// When it first occurred more often than it may.
    beyond_ns: Option<u64>,
    last_ns: Option<u64>,
}

impl Count {
    pub(super) fn new(config: &RequirementConfig, of: &mut Lookup<'_>) -> Result<Self, Refused> {
        let RequirementConfig { at_least, at_most, .. } = *config;
        if at_least.is_none() && at_most.is_none() {
            return Err(Refused::new("require.at_least", "give at_least, at_most or both"));
        }
        if at_least.zip(at_most).is_some_and(|(least, most)| least > most) {
            return Err(Refused::new("require.at_least", "at_least is above at_most"));
        }
        let event = config.event.as_deref().unwrap_or_default();
        let trigger = Trigger::parse(event, of).of_key("require.event")?;
        let window = Window::new(config, of)?;
        let (span_ns, beyond_ns, last_ns) = (None, None, None);
        Ok(Self { trigger, window, at_least, at_most, samples: 0, span_ns, times: 0, beyond_ns, last_ns })
    }

    /// What must hold, in words.
    pub(super) fn must(&self) -> String {
        format!("{} {} times{}", self.trigger.text, self.limits(), self.window.text)
    }

    fn limits(&self) -> String {
        let least = self.at_least.map(|least| format!("at least {least}"));
        let most = self.at_most.map(|most| format!("at most {most}"));
        let limits: Vec<_> = least.into_iter().chain(most).collect();
        limits.join(" and ")
    }

    pub(super) fn judge_moment(&mut self, moment: &Moment<'_>) {
        let times = self.trigger.times_ns(moment).len() as u64;
        if self.window.contains(moment) {
            self.samples += 1;
            self.times += times;
            if times > 0 {
                self.last_ns = Some(moment.time_ns);
            }
            if self.at_most.is_some_and(|most| self.times > most) {
                self.beyond_ns.get_or_insert(moment.time_ns);
            }
            widen(&mut self.span_ns, moment.time_ns);
        }
    }

    pub(super) fn finding(&self) -> Finding {
        let unit = Dimension::One.si_unit();
        if self.samples == 0 {
            return Finding::untested(format!("no sample{}", self.window.text), unit);
        }
        let above = self.at_least.map(|least| self.times as f64 - least as f64);
        let below = self.at_most.map(|most| most as f64 - self.times as f64);
        let margin = above.into_iter().chain(below).fold(f64::INFINITY, f64::min);
        let text = counted(self.times, "time");
        let breach = Breach::new(&self.trigger.text, &text, self.limits());
        let span_ns = self.beyond_ns.map_or(self.span_ns, |beyond_ns| Some([beyond_ns; 2]));
        let breach = (margin < 0.0).then(|| breach.over(span_ns));
        let finding = Finding { breach, ..Finding::new(margin >= 0.0, text, unit) };
        self.window.limit(Finding { margin: Some(margin), worst_ns: self.last_ns, ..finding }, None)
    }
}

/// Judges the order of the first occurrences.
#[derive(Debug, Clone)]
pub(super) struct Order {
    /// Each with the time of its first occurrence, ns.
    steps: Vec<(Trigger, Option<u64>)>,
}

impl Order {
    pub(super) fn new(config: &RequirementConfig, of: &mut Lookup<'_>) -> Result<Self, Refused> {
        if config.order.len() < 2 {
            return Err(Refused::new("require.order", "give at least two occurrences in order"));
        }
        if let Some((_, twice)) =
            (1..).zip(&config.order).find(|(next, name)| config.order[*next..].contains(name))
        {
            let need = format!("{twice} occurs twice, but its first occurrence alone counts; name it once");
            return Err(Refused::new("require.order", need));
        }
        let step = |name: &String| Ok((Trigger::parse(name, of).of_key("require.order")?, None));
        Ok(Self { steps: config.order.iter().map(step).collect::<Result<_, Refused>>()? })
    }

    /// What must hold, in words.
    pub(super) fn must(&self) -> String {
        let names: Vec<_> = self.steps.iter().map(|(trigger, _)| trigger.text.as_str()).collect();
        names.join(", then ")
    }

    pub(super) fn judge_moment(&mut self, moment: &Moment<'_>) {
        for (trigger, first_ns) in &mut self.steps {
            if let Some(time_ns) = trigger.times_ns(moment).first() {
                first_ns.get_or_insert(*time_ns);
            }
        }
    }

    pub(super) fn finding(&self) -> Finding {
        let unit = Dimension::One.si_unit();
        if let Some((missing, _)) = self.steps.iter().find(|(_, first_ns)| first_ns.is_none()) {
            let text = format!("{} never came", missing.text);
            let has_begun = self.steps[0].1.is_some();
            let breach = Breach::new(&missing.text, "never came", "once");
            let failed = Finding { breach: Some(breach), ..Finding::new(false, text.clone(), unit) };
            return if has_begun { failed } else { Finding::untested(text, unit) };
        }
        let wrong = self.steps.windows(2).find(|pair| pair[1].1 < pair[0].1);
        match wrong {
            Some([(early, _), (late, late_ns)]) => {
                let text = format!("{} came before {}", late.text, early.text);
                let breach =
                    Breach::new(&late.text, format!("before {}", early.text), "after it").at(*late_ns);
                Finding { breach: Some(breach), worst_ns: *late_ns, ..Finding::new(false, text, unit) }
            }
            _ => Finding::new(true, "in this order".to_owned(), unit),
        }
    }
}
