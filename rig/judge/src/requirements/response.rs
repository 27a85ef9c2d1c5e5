//! Responses: after each trigger, a condition follows within a time and holds for a time.
//!
//! A trigger that occurs at t is answered if, for some sample τ of [t + delay, t + within], the condition holds at every sample
//! of [τ, τ + `stays_for`]. Time to answer, latency and margin count from t, also where t is between two samples. Both windows
//! end at the last sample of the run. The robustness of an answer is the largest, over τ, of
//! the smallest robustness of the condition in its window: the discrete semantics of signal temporal logic.

use std::collections::VecDeque;

use masseter_runtime::clock::SECOND_NS;
use masseter_scenario::{Dimension, Quantity, RequirementConfig, Unit, wording::counted};

use super::condition::{Condition, Lookup, Moment};
use super::finding::{Finding, OfKey, Refused};
use super::missing::Phase;
use super::trigger::{Trigger, Window};
use crate::breach::Breach;

/// Triggers that are followed at a time. More are counted, not judged.
const MOST_OPEN: usize = 1000;

/// Judges responses.
#[derive(Debug, Clone)]
pub(super) struct Response {
    trigger: Trigger,
    then: Condition,
    window: Window,
    delay_ns: u64,
    within_ns: Option<u64>,
    stays_for_ns: u64,
    /// Samples whose window has not ended yet, with the condition's robustness.
    waiting: VecDeque<(u64, f64)>,
    /// Of the waiting samples, those that may be the smallest of a window, in ascending order.
    smallest: VecDeque<(u64, f64)>,
    /// Samples without a value since the last one that has one, and whether the motion ran in each.
    missing: Vec<(u64, bool)>,
    open: Vec<Answer>,
    triggers: u64,
    /// Triggers that changed nothing: the condition held before, and went on.
    held_before: u64,
    answered: u64,
    not_followed: u64,
    worst: Option<Answer>,
    /// The first trigger without an answer in its time.
    first_failed: Option<Answer>,
    longest_s: Option<f64>,
    /// The shortest observation of an answer that the run's end cut, ns.
    cut_ns: Option<u64>,
    last_ns: u64,
    /// Triggers at the end of the run, without a sample within their time.
    beyond: u64,
    /// Triggers between two samples, of which none lies within their time.
    unseen: u64,
}

/// The answer to a trigger so far.
#[derive(Debug, Clone, Copy)]
struct Answer {
    /// When the trigger occurred, ns.
    at_ns: u64,
    /// The best robustness within the time.
    best: f64,
    /// When the condition first held as required, ns.
    answered_ns: Option<u64>,
    /// Whether a sample lay within the time.
    is_judged: bool,
    /// For how much of its window the condition was observed at the best answer, where the run ended in it, ns.
    observed_ns: Option<u64>,
}

impl Answer {
    fn latency_s(&self) -> Option<f64> {
        Some((self.answered_ns? as f64 - self.at_ns as f64) / SECOND_NS as f64)
    }
}

impl Response {
    pub(super) fn new(config: &RequirementConfig, of: &mut Lookup<'_>) -> Result<Self, Refused> {
        let missing = |key| Refused::new(key, "give when and then: it is missing");
        let when = config.when.as_deref().ok_or_else(|| missing("require.when"))?;
        let then = config.then.as_deref().ok_or_else(|| missing("require.then"))?;
        let time_ns = |key: &'static str, time: Option<Quantity>| {
            let seconds =
                |time: Quantity| time.si_of(Dimension::Time).map_err(|need| format!("{time}: {need}"));
            match time.map(seconds).transpose().of_key(key)? {
                Some(seconds) if seconds < 0.0 => Err(Refused::new(key, "use a time not below 0")),
                seconds => Ok(seconds.map(|seconds| (seconds * SECOND_NS as f64).round() as u64)),
            }
        };
        let delay_ns = time_ns("require.delay", config.delay)?.unwrap_or(0);
        let within_ns = time_ns("require.within", config.within)?;
        let stays_for_ns = time_ns("require.stays_for", config.stays_for)?.unwrap_or(0);
        if within_ns.is_some_and(|within_ns| within_ns < delay_ns) {
            return Err(Refused::new("require.within", "it is shorter than delay"));
        }
        Ok(Self {
            trigger: Trigger::parse(when, of).of_key("require.when")?,
            then: Condition::parse(then, of.values).of_key("require.then")?,
            window: Window::new(config, of)?,
            delay_ns,
            within_ns,
            stays_for_ns,
            waiting: VecDeque::new(),
            smallest: VecDeque::new(),
            missing: Vec::new(),
            open: Vec::new(),
            triggers: 0,
            held_before: 0,
            answered: 0,
            not_followed: 0,
            worst: None,
            first_failed: None,
            longest_s: None,
            cut_ns: None,
            last_ns: 0,
            beyond: 0,
            unseen: 0,
        })
    }

    /// Whether it judges what the mechanism does.
    pub(super) fn is_truth(&self) -> bool {
        self.then.is_truth
    }

    /// What must hold, in words.
    pub(super) fn must(&self) -> String {
        let ms = |ns: u64| format!("{} ms", ns as f64 / 1e6);
        let within = self.within_ns.map_or_else(String::new, |ns| format!(" within {}", ms(ns)));
        let delay =
            if self.delay_ns > 0 { format!(" not before {}", ms(self.delay_ns)) } else { String::new() };
        let stays =
            if self.stays_for_ns > 0 { format!(", for {}", ms(self.stays_for_ns)) } else { String::new() };
        format!("after {}: {}{delay}{within}{stays}{}", self.trigger.text, self.then.text, self.window.text)
    }

    pub(super) fn judge_moment(&mut self, moment: &Moment<'_>) {
        let held = self.holds();
        if !moment.is_closing {
            self.add_sample(moment);
        }
        let held = held && self.holds();
        let occurred = self.trigger.times_ns(moment);
        if self.window.contains(moment) {
            self.held_before += if held { occurred.len() as u64 } else { 0 };
            for at_ns in occurred {
                self.open_answer(at_ns);
            }
        }
    }

    /// Whether the condition holds at the last sample.
    fn holds(&self) -> bool {
        self.waiting.back().is_some_and(|(_, robustness)| *robustness >= 0.0)
    }

    /// A missing value ends a condition that must stay once another follows, or where the motion ran. A stop
    /// excuses values that are missing before it.
    fn add_sample(&mut self, moment: &Moment<'_>) {
        if moment.phase == Phase::Stopped {
            self.missing.iter_mut().for_each(|(_, has_run)| *has_run = false);
        }
        let Some(robustness) = self.then.robustness(moment.values) else {
            return self.missing.push((moment.time_ns, moment.phase == Phase::Running));
        };
        for (time_ns, _) in std::mem::take(&mut self.missing) {
            self.add_robustness(time_ns, f64::NEG_INFINITY);
        }
        self.add_robustness(moment.time_ns, robustness);
    }

    fn add_robustness(&mut self, time_ns: u64, robustness: f64) {
        self.judge_ended(Some(time_ns));
        self.waiting.push_back((time_ns, robustness));
        while self.smallest.back().is_some_and(|(_, last)| *last >= robustness) {
            self.smallest.pop_back();
        }
        self.smallest.push_back((time_ns, robustness));
        self.last_ns = time_ns;
    }

    fn open_answer(&mut self, at_ns: u64) {
        self.triggers += 1;
        if self.open.len() == MOST_OPEN {
            self.not_followed += 1;
        } else {
            let (best, answered_ns, is_judged, observed_ns) = (f64::NEG_INFINITY, None, false, None);
            self.open.push(Answer { at_ns, best, answered_ns, is_judged, observed_ns });
        }
    }

    /// Judges the samples whose windows end before `now_ns`. Without it, at the end of the run, all are judged that are left.
    fn judge_ended(&mut self, now_ns: Option<u64>) {
        while let Some(&(time_ns, _)) = self.waiting.front()
            && now_ns.is_none_or(|now_ns| time_ns.saturating_add(self.stays_for_ns) < now_ns)
        {
            self.waiting.pop_front();
            while self.smallest.front().is_some_and(|(at_ns, _)| *at_ns < time_ns) {
                self.smallest.pop_front();
            }
            let robustness = self.smallest.front().map_or(f64::NEG_INFINITY, |(_, smallest)| *smallest);
            self.judge_sample(time_ns, robustness);
        }
    }

    fn judge_sample(&mut self, time_ns: u64, robustness: f64) {
        let observed_ns = Some(self.last_ns.saturating_sub(time_ns)).filter(|ns| *ns < self.stays_for_ns);
        let (delay_ns, within_ns) = (self.delay_ns, self.within_ns);
        for answer in self.open.iter_mut().filter(|answer| time_ns >= answer.at_ns.saturating_add(delay_ns)) {
            if within_ns.is_none_or(|within_ns| time_ns <= answer.at_ns.saturating_add(within_ns)) {
                answer.is_judged = true;
                if robustness > answer.best {
                    (answer.best, answer.observed_ns) = (robustness, observed_ns);
                }
            }
            if robustness >= 0.0 {
                answer.answered_ns.get_or_insert(time_ns);
            }
        }
        // An answer is known once its time is over and the condition has held.
        let is_known = |answer: &mut Answer| {
            let is_over = within_ns.is_none_or(|within_ns| time_ns > answer.at_ns.saturating_add(within_ns));
            is_over && answer.answered_ns.is_some()
        };
        let known: Vec<_> = self.open.extract_if(.., is_known).collect();
        for answer in known {
            self.close_answer(answer);
        }
    }

    fn close_answer(&mut self, answer: Answer) {
        if !answer.is_judged {
            let due_ns = self.within_ns.map(|within_ns| answer.at_ns.saturating_add(within_ns));
            let is_between = due_ns.is_some_and(|due_ns| due_ns < self.last_ns);
            let count = if is_between { &mut self.unseen } else { &mut self.beyond };
            *count += 1;
            return;
        }
        self.answered += u64::from(answer.best >= 0.0);
        if answer.best < 0.0 && self.first_failed.is_none_or(|first| answer.at_ns < first.at_ns) {
            self.first_failed = Some(answer);
        }
        self.cut_ns = self.cut_ns.into_iter().chain(answer.observed_ns).min();
        let margin = self.margin(&answer).unwrap_or(f64::NEG_INFINITY);
        let worst = self.worst.map(|worst| self.margin(&worst).unwrap_or(f64::NEG_INFINITY));
        if worst.is_none_or(|worst| margin < worst) {
            self.worst = Some(answer);
        }
        let latency_s = answer.latency_s().into_iter().chain(self.longest_s);
        self.longest_s = latency_s.reduce(f64::max);
    }

    /// Of a signal its robustness; of a state the time left, s.
    fn margin(&self, answer: &Answer) -> Option<f64> {
        if self.then.is_numeric() {
            return Some(answer.best);
        }
        Some(self.within_ns? as f64 / SECOND_NS as f64 - answer.latency_s()?)
    }

    pub(super) fn into_finding(mut self) -> Finding {
        let missing = std::mem::take(&mut self.missing);
        for (time_ns, _) in missing.iter().filter(|(_, has_run)| *has_run) {
            self.add_robustness(*time_ns, f64::NEG_INFINITY);
        }
        // The windows that are left end with the run.
        self.judge_ended(None);
        for (time_ns, _) in missing.iter().filter(|(_, has_run)| !has_run) {
            self.judge_sample(*time_ns, f64::NEG_INFINITY);
        }
        for answer in std::mem::take(&mut self.open) {
            self.close_answer(answer);
        }
        let is_numeric = self.then.is_numeric();
        let unit = if is_numeric { self.then.unit } else { Unit::MS };
        let Some(worst) = self.worst else {
            let (trigger, window) = (&self.trigger.text, &self.window.text);
            let why = match self.triggers {
                0 => format!("{trigger} never came{window}"),
                _ => format!("no sample lies within the time after {trigger}"),
            };
            return Finding::untested(why, unit);
        };
        let margin = self.margin(&worst).filter(|margin| margin.is_finite());
        let relative_margin = margin.and_then(|margin| {
            let within_s = self.within_ns.map(|ns| ns as f64 / SECOND_NS as f64);
            if is_numeric { self.then.share(margin) } else { Finding::share(margin, within_s?) }
        });
        let judged = self.triggers - self.beyond - self.unseen;
        let finding = Finding::new(self.answered == judged, self.in_words(), unit).with_unseen(self.unseen);
        let (worst_ns, latency_s) = (Some(worst.at_ns), self.longest_s);
        let ms = |ns: u64| ns as f64 / 1e6;
        let cut = self.cut_ns.map(|observed_ns| {
            format!("the run ended after {:.0} ms of {:.0} ms", ms(observed_ns), ms(self.stays_for_ns))
        });
        let breach = self.first_failed.map(|answer| self.breach(&answer));
        self.window.limit(Finding { margin, relative_margin, worst_ns, latency_s, breach, ..finding }, cut)
    }

    /// A trigger without an answer in its time.
    fn breach(&self, answer: &Answer) -> Breach {
        let what = format!("{} after {}", self.then.text, self.trigger.text);
        let value = answer.latency_s().map(|seconds| format!("came after {:.3} ms", seconds * 1e3));
        let limit = self.within_ns.map(|ns| format!("{} ms", ns as f64 / 1e6));
        let due_ns = answer.at_ns.saturating_add(self.within_ns.unwrap_or(0));
        Breach::new(
            what,
            value.unwrap_or_else(|| "never came".to_owned()),
            limit.unwrap_or_else(|| "once".to_owned()),
        )
        .at(due_ns)
    }

    fn in_words(&self) -> String {
        let latency = match self.longest_s {
            Some(longest_s) => format!("; longest latency {:.3} ms", longest_s * 1e3),
            None => "; never followed".to_owned(),
        };
        let held = match self.held_before {
            0 => String::new(),
            times => format!("; the condition held already before {}", counted(times, "trigger")),
        };
        let beyond = match self.beyond {
            0 => String::new(),
            more => format!("; {} without a sample within its time not judged", counted(more, "trigger")),
        };
        let unseen = match self.unseen {
            0 => String::new(),
            more => format!(
                "; {} between two samples not judged: make within longer than a cycle",
                counted(more, "trigger")
            ),
        };
        let cut = match self.not_followed {
            0 => String::new(),
            more => format!("; {more} more not followed, as {MOST_OPEN} were open"),
        };
        let triggers = counted(self.triggers, "trigger");
        format!("{} of {triggers} answered{latency}{held}{beyond}{unseen}{cut}", self.answered)
    }
}
