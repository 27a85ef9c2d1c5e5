//! Breaches: the first value of each failed check or requirement beyond its limit. The earliest one of a run shows where to
//! look first.

use std::borrow::Cow;
use std::fmt::{self, Display, Formatter};

use masseter_scenario::ChecksConfig;
use serde::Serialize;

use crate::tracking::PathSample;

/// A value beyond its limit.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Breach {
    /// The check or requirement that failed.
    pub check: Cow<'static, str>,
    /// What was judged.
    pub what: String,
    /// Its value, with the unit.
    pub value: String,
    /// Its limit, with the unit.
    pub limit: String,
    /// Where the breach shows in a stretch of time alone, such as a mean: the beginning of the stretch, s since the motion began.
    pub from_s: Option<f64>,
    /// When the limit was first exceeded, or the end of that stretch, s since the motion began.
    pub at_s: Option<f64>,
    /// The stretch, ns of the run's clock; of a moment both ends are the same.
    #[serde(skip)]
    span_ns: Option<[u64; 2]>,
}

impl Breach {
    /// Of no check yet.
    pub(crate) fn new(what: impl Into<String>, value: impl Into<String>, limit: impl Into<String>) -> Self {
        Self { what: what.into(), value: value.into(), limit: limit.into(), ..Self::default() }
    }

    /// The breach of this check.
    pub(crate) fn of(self, check: Cow<'static, str>) -> Self {
        Self { check, ..self }
    }

    /// A breach at a moment.
    pub(crate) fn at(self, time_ns: impl Into<Option<u64>>) -> Self {
        self.over(time_ns.into().map(|time_ns| [time_ns; 2]))
    }

    /// A breach that shows in a stretch of time alone.
    pub(crate) fn over(self, span_ns: Option<[u64; 2]>) -> Self {
        Self { span_ns, ..self }
    }

    /// With its times since the motion began.
    fn since(self, motion_ns: Option<u64>) -> Self {
        let since_s = |ns: u64| Some((ns as f64 - motion_ns? as f64) / 1e9);
        let [from_ns, at_ns] = [0, 1].map(|end| self.span_ns.map(|span_ns| span_ns[end]));
        let from_s = from_ns.filter(|_| from_ns != at_ns).and_then(since_s);
        Self { from_s, at_s: at_ns.and_then(since_s), ..self }
    }
}

impl Display for Breach {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { check, what, value, limit, .. } = self;
        write!(f, "{check}: {what} {value}, limit {limit}")?;
        match (self.from_s, self.at_s) {
            (Some(from_s), Some(at_s)) => write!(f, ", from {from_s:.3} s to {at_s:.3} s of the motion"),
            (None, Some(at_s)) => write!(f, ", at {at_s:.3} s of the motion"),
            (_, None) => Ok(()),
        }
    }
}

/// The earliest of these breaches; those without a time come last.
pub(crate) fn earliest(breaches: impl Iterator<Item = Breach>, motion_ns: Option<u64>) -> Option<Breach> {
    let earliest = breaches.min_by_key(|breach| breach.span_ns.map_or(u64::MAX, |[_, at_ns]| at_ns));
    earliest.map(|breach| breach.since(motion_ns))
}

/// A figure of the run beside its limit, and how both are shown.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bound {
    pub(crate) what: &'static str,
    pub(crate) value: f64,
    pub(crate) limit: f64,
    pub(crate) unit: &'static str,
    pub(crate) digits: usize,
}

impl Bound {
    pub(crate) fn is_beyond(&self) -> bool {
        !is_within(self.value, self.limit)
    }

    pub(crate) fn share(&self) -> f64 {
        self.value / self.limit
    }

    /// The breach of it; `of` follows the name.
    pub(crate) fn breach(&self, of: &str) -> Breach {
        let Self { what, value, limit, unit, digits } = self;
        Breach::new(format!("{what}{of}"), format!("{value:.digits$}{unit}"), format!("{limit}{unit}"))
    }
}

impl Display for Bound {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Breach { what, value, limit, .. } = self.breach("");
        write!(f, "{what} {value}, limit {limit}")
    }
}

/// NaN exceeds every limit.
pub(crate) fn is_within(value: f64, limit: f64) -> bool {
    value <= limit
}

/// When the jaw first left its path beyond a limit, and when the motion played.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PathBreach {
    /// The first and the last cycle of the motion, ns of the run's clock.
    pub motion_ns: Option<[u64; 2]>,
    /// The first error beyond its limit.
    pub first: Option<Breach>,
}

impl PathBreach {
    pub(crate) fn take(&mut self, sample: &PathSample, is_running: bool, limits: &ChecksConfig) {
        let time_ns = sample.sampled_ns;
        if is_running {
            widen(&mut self.motion_ns, time_ns);
        }
        if self.first.is_some() {
            return;
        }
        let deviation = &sample.deviation;
        let mm =
            |what, m| Bound { what, value: m * 1e3, limit: limits.tracking_max_mm, unit: " mm", digits: 4 };
        let (value, limit) = (deviation.angle_rad.to_degrees(), limits.tracking_max_deg);
        let errors = [
            mm("incisal point", deviation.incisal_m),
            mm("platform", deviation.origin_m),
            Bound { what: "platform", value, limit, unit: "°", digits: 4 },
        ];
        let beyond = errors.iter().find(|error| error.is_beyond());
        self.first = beyond.map(|error| error.breach(" from its path").at(time_ns));
    }
}

/// Extends a stretch to this time.
pub(crate) fn widen(span_ns: &mut Option<[u64; 2]>, time_ns: u64) {
    span_ns.get_or_insert([time_ns; 2])[1] = time_ns;
}

#[cfg(test)]
mod tests;
