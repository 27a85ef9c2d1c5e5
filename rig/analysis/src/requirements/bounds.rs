//! Bounds of a signal: every value, or a statistic of its values, within limits.

use masseter_scenario::{Quantity, RequirementConfig, Scenario, Statistic};

use super::finding::{Finding, RequirementPlot};
use super::moment::Moment;
use super::quantified::Quantified;
use super::refusal::{OfKey, Refused};
use super::window::Window;
use crate::series::{Extremes, Series};
use crate::signals::Values;

/// Judges bounds.
#[derive(Debug, Clone)]
pub(super) struct Bounds {
    of: Quantified,
    window: Window,
    statistic: Statistic,
    percentile: f64,
    limits: Limits,
    samples: u64,
    missing: u64,
    worst: Option<Worst>,
    fails_undisturbed: bool,
    sum: f64,
    squares: f64,
    range: [f64; 2],
    /// Every value, for a percentile alone.
    values: Vec<f64>,
    series: Series<Extremes<1>>,
    began_ns: Option<u64>,
}

/// The smallest margin so far.
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
        // What is no number is within no limit.
        (if margin.is_nan() { f64::NEG_INFINITY } else { margin }, limit)
    }
}

impl Bounds {
    pub(super) fn new(
        config: &RequirementConfig,
        scenario: &Scenario,
        values: &mut Values,
    ) -> Result<Self, Refused> {
        let of = Quantified::new(config, values)?;
        let limit = |key: &'static str, given: Option<Quantity>| {
            let si =
                |given: Quantity| given.si_of(of.unit.dimension).map_err(|need| format!("{given}: {need}"));
            given.map(si).transpose().of_key(key)
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
            window: Window::new(config.during.as_ref(), scenario, values)?,
            of,
            statistic: config.statistic,
            percentile,
            limits,
            samples: 0,
            missing: 0,
            worst: None,
            fails_undisturbed: false,
            sum: 0.0,
            squares: 0.0,
            range: [f64::INFINITY, f64::NEG_INFINITY],
            values: Vec::new(),
            series: Series::default(),
            began_ns: None,
        })
    }

    /// What must hold, in words.
    pub(super) fn must(&self) -> String {
        let text = &self.of.text;
        let what = match self.statistic {
            Statistic::Value => text.clone(),
            Statistic::Abs => format!("|{text}|"),
            Statistic::Mean => format!("mean of {text}"),
            Statistic::Rms => format!("rms of {text}"),
            Statistic::PeakToPeak => format!("peak to peak of {text}"),
            Statistic::Percentile => format!("percentile {} of {text}", self.percentile),
        };
        let limits = match (self.limits.min, self.limits.max) {
            (Some(min), Some(max)) => {
                format!("within {} and {}", self.of.unit.text(min), self.of.unit.text(max))
            }
            (Some(min), None) => format!("at least {}", self.of.unit.text(min)),
            (None, max) => format!("at most {}", self.of.unit.text(max.unwrap_or(f64::NAN))),
        };
        format!("{what} {limits}{}", self.window.text)
    }

    pub(super) fn take(&mut self, moment: &Moment<'_>) {
        let value = self.of.value(moment.values);
        let (value, is_missing) = (value.unwrap_or(f64::NAN), value.is_none());
        let began_ns = *self.began_ns.get_or_insert(moment.time_ns);
        if !self.window.contains(moment) || moment.is_closing {
            return;
        }
        if is_missing {
            self.missing += 1;
            return;
        }
        // What the requirement does not judge would only spoil the scale of the plot.
        self.series.take(moment.time_ns - began_ns, 0, value / self.of.unit.si);
        let value = if self.statistic == Statistic::Abs { value.abs() } else { value };
        self.samples += 1;
        self.sum += value;
        self.squares += value * value;
        self.range = [self.range[0].min(value), self.range[1].max(value)];
        if self.statistic == Statistic::Percentile {
            self.values.push(value);
        }
        let (margin, _) = self.limits.margin(value);
        self.fails_undisturbed |= margin < 0.0 && !moment.is_disturbed;
        if self.worst.is_none_or(|worst| margin < worst.margin) {
            self.worst = Some(Worst { margin, value, time_ns: moment.time_ns });
        }
    }

    pub(super) fn finish(mut self) -> (Finding, Option<RequirementPlot>) {
        let finding = self.finding();
        let limits = [self.limits.min, self.limits.max].into_iter().flatten();
        let plot = RequirementPlot {
            signal: self.of.text.clone(),
            unit: self.of.unit.name,
            began_ns: self.began_ns.unwrap_or(0),
            curve: self.series.band(0),
            limits: limits.map(|limit| limit / self.of.unit.si).collect(),
        };
        (finding, Some(plot))
    }

    fn finding(&mut self) -> Finding {
        let unit = self.of.unit;
        let Some(worst) = self.worst else {
            let why = if self.missing > 0 {
                format!(
                    "{} has no value{}: all {} samples are missing{}",
                    self.of.text, self.window.text, self.missing, self.of.absence
                )
            } else {
                format!("no sample{}", self.window.text)
            };
            return Finding::untested(why, unit);
        };
        let is_of_values = matches!(self.statistic, Statistic::Value | Statistic::Abs);
        let value = if is_of_values { worst.value } else { self.value_of_statistic() };
        let (margin, limit) = self.limits.margin(value);
        let missing = if self.missing > 0 { format!(", {} missing", self.missing) } else { String::new() };
        let text = format!("{} in {} samples{missing}", unit.text(value), self.samples);
        Finding {
            margin: Some(margin).filter(|margin| margin.is_finite()),
            relative_margin: Finding::share(margin, limit),
            worst_ns: is_of_values.then_some(worst.time_ns),
            may_be_disturbed: !(is_of_values && self.fails_undisturbed),
            ..Finding::new(margin >= 0.0, text, unit)
        }
    }

    fn value_of_statistic(&mut self) -> f64 {
        let samples = self.samples as f64;
        match self.statistic {
            Statistic::Value | Statistic::Abs => f64::NAN,
            Statistic::Mean => self.sum / samples,
            Statistic::Rms => (self.squares / samples).sqrt(),
            Statistic::PeakToPeak => self.range[1] - self.range[0],
            Statistic::Percentile => {
                self.values.sort_by(f64::total_cmp);
                // The nearest rank; products of decimals are a little too large.
                let rank = (self.percentile * samples / 100.0 - 1e-9).ceil() as usize;
                self.values[rank.saturating_sub(1).min(self.values.len() - 1)]
            }
        }
    }
}
