//! Bounds of a signal or an expression of signals: every value, or a statistic of its values, within limits.

use std::fmt::Display;

use masseter_scenario::{Quantity, RequirementConfig, Statistic, Unit, input::excerpt};

use super::condition::{Lookup, Moment};
use super::finding::{Finding, OfKey, Reason, Refused, RequirementPlot};
use super::{dimension::BaseExponents, expression::Expression, missing::Missing, trigger::Window};
use crate::breach::{Breach, widen};
use crate::{series::Band, signals::Values, statistic::Sums};

/// A signal or an expression.
#[derive(Debug, Clone)]
pub(super) struct Quantified {
    /// As written.
    pub(super) text: String,
    /// The unit in which it is shown.
    pub(super) unit: Unit,
    /// Why it may have no value in a whole run; empty where nothing is known.
    pub(super) absence: &'static str,
    /// Whether it depends on what the mechanism does.
    pub(super) is_truth: bool,
    source: ValueSource,
}

#[derive(Debug, Clone)]
enum ValueSource {
    Signal(usize),
    Expression { expression: Expression, signals: Vec<usize> },
}

impl Quantified {
    pub(super) fn new(config: &RequirementConfig, values: &mut Values) -> Result<Self, Refused> {
        match (&config.signal, &config.expression) {
            (Some(name), None) => Self::of_signal(name, values).of_key("require.signal"),
            (None, Some(text)) => {
                let name = config.unit.as_deref().unwrap_or_default();
                let unknown =
                    || Refused::new("require.unit", format!("'{}': the unit is unknown", excerpt(name)));
                let unit = Unit::named(name).ok_or_else(unknown)?;
                Self::of_expression(text, unit, values).of_key("require.expression")
            }
            _ => Err(Refused::new("require.expression", "give a signal or an expression")),
        }
    }

    fn of_signal(name: &str, values: &mut Values) -> Result<Self, Reason> {
        let signal = values.choose(name)?;
        let named = values.signal(signal);
        if named.states().is_some() {
            return Err(Reason::wrong(format!(
                "{name} is a state, which has no bounds; use never, or when and then"
            )));
        }
        let (unit, absence, is_truth) = (named.shown(), named.absence, named.is_truth);
        let source = ValueSource::Signal(signal);
        Ok(Self { text: name.to_owned(), unit, absence, is_truth, source })
    }

    fn of_expression(text: &str, unit: Unit, values: &mut Values) -> Result<Self, Reason> {
        let quoted = |reason: &dyn Display| format!("'{}': {reason}", excerpt(text));
        let expression = Expression::read(text).map_err(|error| quoted(&error))?;
        let names = expression.signals.iter();
        let signals: Vec<_> = names.map(|name| values.choose(name)).collect::<Result<_, _>>()?;
        if signals.is_empty() {
            return Err(quoted(&"write signals in braces, such as {l1.force}").into());
        }
        let named: Vec<_> = signals.iter().map(|signal| values.signal(*signal)).collect();
        if let Some(state) = named.iter().find(|signal| signal.states().is_some()) {
            return Err(quoted(&format_args!("{} is a state, no number", state.name)).into());
        }
        let derived = expression.dimension(|place| named[place].shown().dimension);
        let derived = derived.map_err(|error| quoted(&error))?;
        if derived != BaseExponents::of(unit.dimension) {
            return Err(quoted(&format_args!("its unit is {derived}, not '{}'", unit.name)).into());
        }
        let absences = named.iter().map(|signal| signal.absence);
        // A difference from what the controller states is its statement.
        let is_truth = named.iter().all(|signal| signal.is_truth);
        Ok(Self {
            is_truth,
            text: text.to_owned(),
            unit,
            absence: absences.into_iter().find(|absence| !absence.is_empty()).unwrap_or_default(),
            source: ValueSource::Expression { expression, signals },
        })
    }

    /// The value in SI units; `None` if a signal is missing.
    pub(super) fn value(&mut self, values: &[f64]) -> Option<f64> {
        match &mut self.source {
            ValueSource::Signal(signal) => Some(values[*signal]).filter(|value| !value.is_nan()),
            ValueSource::Expression { expression, signals } => {
                let has_all = signals.iter().all(|signal| !values[*signal].is_nan());
                has_all.then(|| expression.value(|place| values[signals[place]]))
            }
        }
    }
}

/// Judges bounds.
#[derive(Debug, Clone)]
pub(super) struct Bounds {
    of: Quantified,
    window: Window,
    statistic: Statistic,
    percentile: f64,
    limits: Limits,
    sums: Sums,
    missing: Missing,
    worst: Option<Worst>,
    /// The first value beyond a limit.
    first: Option<Worst>,
    /// From the first to the last judged sample, ns.
    span_ns: Option<[u64; 2]>,
    fails_undisturbed: bool,
    /// Every value, for a percentile alone.
    values: Vec<f64>,
    series: Band,
    began_ns: Option<u64>,
}

/// A margin, such as the smallest so far.
#[derive(Debug, Clone, Copy)]
struct Worst {
    margin: f64,
    value: f64,
    time_ns: u64,
}

/// The allowed values, SI.
#[derive(Debug, Clone, Copy)]
struct Limits {
    min: Option<f64>,
    max: Option<f64>,
}

impl Limits {
    /// How far a value is within the limits, and the nearer limit.
    fn margin(&self, value: f64) -> (f64, f64) {
        let below = self.max.map(|max| (max - value, max));
        let above = self.min.map(|min| (value - min, min));
        let nearest = below.into_iter().chain(above).min_by(|(a, _), (b, _)| a.total_cmp(b));
        let (margin, limit) = nearest.expect("a requirement has a limit");
        // What is no number, or infinite, exceeds every limit.
        (if margin.is_finite() { margin } else { f64::NEG_INFINITY }, limit)
    }
}

impl Bounds {
    pub(super) fn new(config: &RequirementConfig, lookup: &mut Lookup<'_>) -> Result<Self, Refused> {
        let of = Quantified::new(config, lookup.values)?;
        let limit = |key: &'static str, given: Option<Quantity>| {
            let si =
                given.map(|given| given.si_of(of.unit.dimension).map_err(|need| format!("{given}: {need}")));
            si.transpose().of_key(key)
        };
        let limits =
            Limits { min: limit("require.min", config.min)?, max: limit("require.max", config.max)? };
        match (limits.min, limits.max) {
            (None, None) => return Err(Refused::new("require.max", "give min, max or both")),
            (Some(min), Some(max)) if min > max => {
                return Err(Refused::new("require.min", "min is above max"));
            }
            _ => {}
        }
        let percentile = match (config.statistic, config.percentile) {
            (Statistic::Percentile, Some(percentile)) if (0.0..=100.0).contains(&percentile) => percentile,
            (Statistic::Percentile, _) => {
                return Err(Refused::new("require.percentile", "give percentile, 0 to 100"));
            }
            (_, Some(_)) => {
                let need = "percentile goes with statistic = \"percentile\"";
                return Err(Refused::new("require.percentile", need));
            }
            (_, None) => 0.0,
        };
        Ok(Self {
            window: Window::new(config, lookup)?,
            of,
            statistic: config.statistic,
            percentile,
            limits,
            sums: Sums::default(),
            missing: Missing::default(),
            worst: None,
            first: None,
            span_ns: None,
            fails_undisturbed: false,
            values: Vec::new(),
            series: Band::default(),
            began_ns: None,
        })
    }

    /// Whether it judges what the mechanism does.
    pub(super) fn is_truth(&self) -> bool {
        self.of.is_truth
    }

    /// What is judged, in words.
    fn what(&self) -> String {
        let text = &self.of.text;
        match self.statistic {
            Statistic::Value => text.clone(),
            Statistic::Abs => format!("|{text}|"),
            Statistic::Mean => format!("mean of {text}"),
            Statistic::Rms => format!("rms of {text}"),
            Statistic::PeakToPeak => format!("peak to peak of {text}"),
            Statistic::Percentile => format!("percentile {} of {text}", self.percentile),
        }
    }

    /// What must hold, in words.
    pub(super) fn must(&self) -> String {
        let in_unit = |limit: f64| self.of.unit.text(limit);
        let limits = match (self.limits.min, self.limits.max) {
            (Some(min), Some(max)) => format!("within {} and {}", in_unit(min), in_unit(max)),
            (Some(min), None) => format!("at least {}", in_unit(min)),
            (None, max) => format!("at most {}", in_unit(max.unwrap_or(f64::NAN))),
        };
        format!("{} {limits}{}", self.what(), self.window.text)
    }

    pub(super) fn judge_moment(&mut self, moment: &Moment<'_>) {
        let value = self.of.value(moment.values);
        let began_ns = *self.began_ns.get_or_insert(moment.time_ns);
        self.missing.apply_phase(moment.phase);
        if !self.window.contains(moment) || moment.is_closing {
            return;
        }
        self.missing.count_sample(value.is_some(), moment.phase, moment.is_real_time);
        let Some(value) = value else { return };
        // What the requirement does not judge would only spoil the scale of the plot.
        self.series.add(moment.time_ns - began_ns, value / self.of.unit.si);
        let value = if self.statistic == Statistic::Abs { value.abs() } else { value };
        self.sums.add(value);
        if self.statistic == Statistic::Percentile {
            self.values.push(value);
        }
        let (margin, _) = self.limits.margin(value);
        self.fails_undisturbed |= margin < 0.0 && !moment.is_disturbed;
        let found = Worst { margin, value, time_ns: moment.time_ns };
        if self.worst.is_none_or(|worst| margin < worst.margin) {
            self.worst = Some(found);
        }
        if margin < 0.0 {
            self.first.get_or_insert(found);
        }
        widen(&mut self.span_ns, moment.time_ns);
    }

    /// The signal over time, with its limits and the statistic that was judged.
    pub(super) fn plot(&mut self) -> RequirementPlot {
        let si = self.of.unit.si;
        let curve = self.series.curve();
        let is_signed = curve.iter().any(|(_, value)| *value < 0.0);
        let both_sides = |value: f64| if is_signed { vec![value, -value] } else { vec![value] };
        let limits = [self.limits.min, self.limits.max].into_iter().flatten().map(|limit| limit / si);
        let value = if self.sums.samples > 0 { self.value_of_statistic() / si } else { f64::NAN };
        let (limits, found) = match self.statistic {
            Statistic::Value => (limits.collect(), None),
            Statistic::Abs => (limits.flat_map(both_sides).collect(), None),
            Statistic::Mean => (limits.collect(), Some(("mean", vec![value]))),
            Statistic::Rms => (limits.flat_map(both_sides).collect(), Some(("rms", both_sides(value)))),
            Statistic::PeakToPeak => {
                (Vec::new(), self.sums.range.map(|range| ("range", range.map(|end| end / si).to_vec())))
            }
            Statistic::Percentile => (limits.collect(), Some(("percentile", vec![value]))),
        };
        RequirementPlot {
            signal: self.of.text.clone(),
            unit: self.of.unit.name,
            began_ns: self.began_ns.unwrap_or(0),
            curve,
            limits,
            found: found.filter(|(_, values)| values.iter().all(|value| value.is_finite())),
        }
    }

    pub(super) fn finding(&mut self) -> Finding {
        let unit = self.of.unit;
        let Some(worst) = self.worst else {
            let (text, window) = (&self.of.text, &self.window.text);
            let why = match self.missing.all {
                0 => format!("no sample{window}"),
                n => format!("{text} has no value{window}: all {n} samples are missing{}", self.of.absence),
            };
            return Finding::untested(why, unit);
        };
        let is_of_values = matches!(self.statistic, Statistic::Value | Statistic::Abs);
        let value = if is_of_values { worst.value } else { self.value_of_statistic() };
        let (margin, limit) = self.limits.margin(value);
        let text = format!("{} in {} samples", unit.text(value), self.sums.samples);
        let (first, span_ns) = match self.first.filter(|_| is_of_values) {
            Some(first) => (first.value, Some([first.time_ns; 2])),
            None => (value, self.span_ns),
        };
        let limit_of_first = self.limits.margin(first).1;
        let breach = Breach::new(self.what(), unit.text(first), unit.text(limit_of_first)).over(span_ns);
        let finding = Finding {
            margin: Some(margin).filter(|margin| margin.is_finite()),
            relative_margin: Finding::share(margin, limit),
            worst_ns: is_of_values.then_some(worst.time_ns),
            breach: Some(breach).filter(|_| margin < 0.0),
            may_be_disturbed: !(is_of_values && self.fails_undisturbed),
            ..Finding::new(margin >= 0.0, text, unit)
        };
        self.window.limit(finding.with_missing(&self.missing), None)
    }

    fn value_of_statistic(&mut self) -> f64 {
        match self.statistic {
            Statistic::Value | Statistic::Abs => f64::NAN,
            Statistic::Mean => self.sums.mean(),
            Statistic::Rms => self.sums.rms(),
            Statistic::PeakToPeak => self.sums.range.map_or(f64::NAN, |[least, most]| most - least),
            Statistic::Percentile => {
                self.values.sort_by(f64::total_cmp);
                // The nearest rank; products of decimals are a little too large.
                let rank = (self.percentile * self.values.len() as f64 / 100.0 - 1e-9).ceil() as usize;
                self.values[rank.saturating_sub(1).min(self.values.len() - 1)]
            }
        }
    }
}
