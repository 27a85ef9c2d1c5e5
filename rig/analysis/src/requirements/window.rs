//! The part of a run in which a requirement is judged.

use masseter_runtime::clock::SECOND_NS;
use masseter_scenario::{During, Scenario, TimeWindow};

use super::condition::Condition;
use super::moment::Moment;
use super::refusal::{OfKey, Reason, Refused};
use super::trigger::Trigger;
use crate::signals::Values;

/// When a requirement is judged.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Window {
    /// In words; empty for the whole run.
    pub(super) text: String,
    extent: Extent,
}

#[derive(Debug, Clone, PartialEq)]
enum Extent {
    Always,
    While(Condition),
    /// Of the motion, s; both ends belong to it.
    Motion {
        from_s: f64,
        to_s: f64,
    },
    /// After an occurrence, with the time when it ends, ns.
    After {
        trigger: Trigger,
        for_ns: u64,
        until_ns: Option<u64>,
    },
}

impl Window {
    pub(super) fn new(
        during: Option<&During>,
        scenario: &Scenario,
        values: &mut Values,
    ) -> Result<Self, Refused> {
        let (text, extent) = match during {
            None => (String::new(), Extent::Always),
            Some(During::While(text)) => {
                let condition = Condition::parse(text, values).of_key("require.during")?;
                (format!(" while {}", condition.text), Extent::While(condition))
            }
            Some(During::Time(window)) => Self::of_time(window, scenario, values).of_key("require.during")?,
        };
        Ok(Self { text, extent })
    }

    fn of_time(
        window: &TimeWindow,
        scenario: &Scenario,
        values: &mut Values,
    ) -> Result<(String, Extent), Reason> {
        let TimeWindow { from_s, to_s, after, for_s } = window;
        if let Some(name) = after {
            if from_s.is_some() || to_s.is_some() {
                return Err("give after and for_s, or from_s and to_s".to_owned().into());
            }
            let trigger = Trigger::parse(name, scenario, values)?;
            if for_s.is_some_and(|for_s| !(for_s.is_finite() && for_s > 0.0)) {
                return Err("for_s: use a finite number above 0".to_owned().into());
            }
            let for_ns = for_s.map_or(u64::MAX, |for_s| (for_s * SECOND_NS as f64) as u64);
            let how_long = for_s.map_or_else(String::new, |for_s| format!("{for_s} s "));
            let text = format!(" {how_long}after {}", trigger.text);
            return Ok((text, Extent::After { trigger, for_ns, until_ns: None }));
        }
        if for_s.is_some() {
            return Err("give for_s with after".to_owned().into());
        }
        let (from_s, end_s) = (from_s.unwrap_or(0.0), to_s.unwrap_or(f64::INFINITY));
        if !(from_s >= 0.0 && end_s > from_s) {
            return Err(format!(
                "from_s = {from_s}, to_s = {end_s}: give a time from 0 s on, and a later end"
            )
            .into());
        }
        let until = to_s.map_or_else(String::new, |to_s| format!(" to {to_s} s"));
        Ok((format!(" from {from_s} s{until}"), Extent::Motion { from_s, to_s: end_s }))
    }

    /// Whether the sample belongs to the window. Every sample of the run must be given, in the order of time.
    pub(super) fn contains(&mut self, moment: &Moment<'_>) -> bool {
        match &mut self.extent {
            Extent::Always => true,
            Extent::While(condition) => condition.holds(moment.values),
            Extent::Motion { from_s, to_s } => {
                moment.motion_s.is_some_and(|motion_s| *from_s <= motion_s && motion_s <= *to_s)
            }
            Extent::After { trigger, for_ns, until_ns } => {
                if let Some(began_ns) = trigger.take(moment).last() {
                    *until_ns = Some(began_ns.saturating_add(*for_ns));
                }
                until_ns.is_some_and(|until_ns| moment.time_ns <= until_ns)
            }
        }
    }
}
