//! A chart: its axes, curves and limits.

use serde::Serialize;

use crate::points::Points;
use crate::time::Moment;

/// What is drawn from left to right.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Across {
    /// Seconds since the first SYNC. Charts over time share cursor and zoom.
    Time,
    /// 1/(1 − quantile), by its logarithm, labelled as percentiles.
    Percentile,
}

/// How values are spaced from bottom to top.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// Evenly.
    Linear,
    /// By their logarithm.
    Log,
}

/// How a curve looks, by what it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Style {
    /// One of several alike, in the palette's colour.
    Plain,
    /// Wide and pale, below the others.
    Desired,
    /// A solid line.
    True,
    /// Thin and dashed, above the others.
    Estimated,
    /// Thin and pale.
    Raw,
    /// Above its raw values, in their colour.
    Smoothed,
}

/// A curve.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Series {
    /// The name in the legend, unique in its chart.
    pub name: String,
    /// How it looks.
    pub style: Style,
    /// A place in the palette, from 0. Without one, a plain curve takes the next and the others that of their style.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub colour: Option<usize>,
    /// Where it goes.
    pub points: Points,
}

impl Series {
    /// In the colour of its style.
    #[must_use]
    pub fn new(name: impl Into<String>, style: Style, points: Points) -> Self {
        Self { name: name.into(), style, colour: None, points }
    }

    /// In a colour of the palette.
    #[must_use]
    pub fn coloured(self, colour: usize) -> Self {
        Self { colour: Some(colour), ..self }
    }
}

/// Levels that must not be passed. A level far from all curves stands in words below the chart.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Limit {
    /// What it is.
    pub name: String,
    /// In the chart's unit.
    pub values: Vec<f64>,
}

/// A chart.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Chart {
    /// What the values are.
    pub title: String,
    /// Their unit; may be empty.
    pub unit: String,
    /// From left to right.
    pub across: Across,
    /// From bottom to top.
    pub scale: Scale,
    /// The first is drawn first.
    pub series: Vec<Series>,
    /// Levels over the whole width.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub limits: Vec<Limit>,
    /// Moments of this chart alone, beside those of the page.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub moments: Vec<Moment>,
    /// Height of the plot, px.
    pub height: u32,
    /// Why there may be no point.
    pub otherwise: String,
}

impl Chart {
    /// Whether it shares cursor and zoom with the other charts over time.
    pub fn is_over_time(&self) -> bool {
        self.across == Across::Time
    }

    /// Over time, without curves yet.
    #[must_use]
    pub fn over_time(title: impl Into<String>, unit: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            unit: unit.into(),
            across: Across::Time,
            scale: Scale::Linear,
            series: Vec::new(),
            limits: Vec::new(),
            moments: Vec::new(),
            height: 190,
            otherwise: "No value was recorded.".to_owned(),
        }
    }
}
