//! A push on the jaw: a force and a torque over the time since they began.

use std::ops::Range;

use masseter_runtime::clock::SECOND_NS;
use masseter_scenario::{Shape, StimulusConfig};
use nalgebra::Vector6;

use super::wrench_table::WrenchTable;
use crate::error::PlantError;

/// A push.
#[derive(Debug, Clone)]
pub(super) struct Push {
    course: Course,
    /// Where the force acts, m in the platform frame; the incisal point when absent.
    pub(super) point_m: Option<[f64; 3]>,
}

#[derive(Debug, Clone)]
enum Course {
    Shaped { whole: Vector6<f64>, shape: Shape, for_s: f64, frequency_hz: f64 },
    Table(WrenchTable),
}

impl Push {
    /// The push of a stimulus; none of another one.
    pub(super) fn new(config: &StimulusConfig) -> Result<Option<Self>, PlantError> {
        let StimulusConfig { push_n, torque_n_m, push_table, point_m, shape, for_s, frequency_hz, .. } =
            config;
        let course = match (push_table, push_n, torque_n_m) {
            (Some(path), ..) => Course::Table(WrenchTable::read(path)?),
            (None, None, None) => return Ok(None),
            (None, force_n, torque_n_m) => {
                let [[x, y, z], [a, b, c]] = [force_n, torque_n_m].map(|given| given.unwrap_or_default());
                Course::Shaped {
                    whole: Vector6::new(x, y, z, a, b, c),
                    shape: *shape,
                    for_s: for_s.unwrap_or(f64::INFINITY),
                    frequency_hz: frequency_hz.unwrap_or_default(),
                }
            }
        };
        Ok(Some(Self { course, point_m: *point_m }))
    }

    /// The window in which it acts: that of a table ends with the table.
    pub(super) fn acting_ns(&self, window_ns: &Range<u64>) -> Range<u64> {
        let Range { start, end } = *window_ns;
        match &self.course {
            Course::Shaped { .. } => start..end,
            Course::Table(table) => {
                start..end.min(start.saturating_add((table.length_s() * SECOND_NS as f64) as u64))
            }
        }
    }

    /// The force (N) and the torque (N m) in base axes, so long after the beginning.
    pub(super) fn wrench(&self, since_ns: u64) -> Vector6<f64> {
        let since_s = since_ns as f64 / SECOND_NS as f64;
        match &self.course {
            Course::Shaped { whole, shape, for_s, frequency_hz } => {
                whole * shape.at(since_s, *for_s, *frequency_hz)
            }
            Course::Table(table) => table.at(since_s),
        }
    }
}
