//! Food between teeth: a piece gives way to a bite, gets thinner with every chew, and is swallowed.
//!
//! Each of its teeth compresses a column, an equal share of the piece, independently. A chew closes the teeth to less
//! than half of the piece's thickness, and opens them again. The tongue then collects the food: in the next bite the
//! piece has `left_by_chew` of its thickness. Below `swallowed_m` the food is swallowed, and a fresh piece follows once
//! the mouth is open wide enough.

#[cfg(test)]
mod tests;

use std::sync::Arc;

use arrayvec::ArrayVec;
use masseter_model::geometry::Vec3;
use masseter_scenario::{FoodConfig, MOST_PAIRS, Material};

use super::teeth::{Friction, Grip, Touch, contact_force_n};

/// A break of a piece of food between the teeth.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct FoodBreak {
    /// FDI number of the first of the teeth on which the piece lay.
    pub(crate) tooth: u8,
    /// The piece's elastic force before, N.
    pub(crate) force_n: f64,
    /// Its strength, N.
    pub(crate) strength_n: f64,
}

/// A piece of food.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct Food {
    /// Shared, so that another serving of the food allocates nothing.
    pub(crate) config: Arc<FoodConfig>,
    pub(super) columns: ArrayVec<Column, MOST_PAIRS>,
    /// Thickness that the piece has when it is collected, m.
    pub(super) collected_m: f64,
    is_chewed: bool,
    is_broken: bool,
}

/// The part of a piece on one tooth.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Column {
    /// The place of its tooth among the pairs.
    pair: usize,
    /// 0 until the piece is collected, m.
    pub(super) thickness_m: f64,
    compression_m: f64,
    /// Compression of the spring that relaxes, m.
    relaxing_m: f64,
    grip: Grip,
}

impl Food {
    /// A fresh piece on teeth of an arch, given by their numbers. Teeth that the arch lacks carry nothing.
    pub(crate) fn new(config: &FoodConfig, arch: &[u8]) -> Self {
        let pair = |number: &u8| arch.iter().position(|tooth| tooth == number);
        let column = |pair| Column { pair, ..Column::default() };
        Self {
            columns: config.teeth.iter().filter_map(pair).map(column).take(MOST_PAIRS).collect(),
            collected_m: config.thickness_m,
            config: Arc::new(config.clone()),
            is_chewed: false,
            is_broken: false,
        }
    }

    /// Bites: adds the forces on the lower teeth (N, base axes) to those of their pairs. Reports a break of the piece.
    pub(super) fn bite(&mut self, touches: &[Touch], forces_n: &mut [Vec3]) -> Option<FoodBreak> {
        self.collect(touches);
        let mut elastic_n = 0.0;
        for place in 0..self.columns.len() {
            let column = &mut self.columns[place];
            let Touch { gap_m, step_s, .. } = touches[column.pair];
            self.is_chewed |= column.thickness_m > 0.0 && gap_m < self.collected_m / 2.0;
            column.compress((column.thickness_m - gap_m).max(0.0), step_s / self.config.relaxation_s);
            let compression_m = column.compression_m;
            elastic_n += compression_m * self.stiffness_n_per_m(compression_m);
        }
        let broke = self.break_at(elastic_n);
        self.give_way(touches);
        self.push(touches, forces_n);
        broke
    }

    /// Collects the food if the mouth is open wide enough.
    fn collect(&mut self, touches: &[Touch]) {
        let is_open =
            |thickness_m: f64| self.columns.iter().all(|column| touches[column.pair].gap_m >= thickness_m);
        if !is_open(self.collected_m) {
            return;
        }
        if std::mem::take(&mut self.is_chewed) {
            self.collected_m *= self.config.left_by_chew;
            if self.collected_m < self.config.swallowed_m {
                (self.collected_m, self.is_broken) = (self.config.thickness_m, false);
            }
        }
        let is_ready = self.columns.iter().all(|column| touches[column.pair].gap_m >= self.collected_m);
        let thickness_m = if is_ready { self.collected_m } else { 0.0 };
        self.columns.iter_mut().for_each(|column| column.thickness_m = thickness_m);
    }

    /// Breaks a whole, brittle piece whose elastic force reaches its strength.
    fn break_at(&mut self, elastic_n: f64) -> Option<FoodBreak> {
        let FoodConfig { material, strength_n, .. } = *self.config;
        if material != Material::Brittle || self.is_broken || elastic_n < strength_n {
            return None;
        }
        self.is_broken = true;
        let tooth = *self.config.teeth.first()?;
        Some(FoodBreak { tooth, force_n: elastic_n, strength_n })
    }

    /// Flattens columns beyond the strength of a material that flows.
    fn give_way(&mut self, touches: &[Touch]) {
        let FoodConfig { material, strength_n, .. } = *self.config;
        let is_whole_and_brittle = material == Material::Brittle && !self.is_broken;
        if material == Material::Viscoelastic || is_whole_and_brittle {
            return;
        }
        let strength_n = self.share() * strength_n / self.columns.len() as f64;
        let most_m = self.compression_of(strength_n);
        for column in &mut self.columns {
            if column.compression_m > most_m {
                column.compression_m = most_m;
                column.thickness_m = touches[column.pair].gap_m + most_m;
            }
        }
    }

    fn push(&mut self, touches: &[Touch], forces_n: &mut [Vec3]) {
        let columns = self.columns.len() as f64;
        let FoodConfig { material, damping_s_per_m, strength_n, relaxing_n_per_m, .. } = *self.config;
        let friction = Friction {
            coefficient: self.config.friction,
            stiffness_n_per_m: self.config.stiffness_n_per_m / columns,
        };
        for place in 0..self.columns.len() {
            let stiffness_n_per_m = self.stiffness_n_per_m(self.columns[place].compression_m);
            let column = &mut self.columns[place];
            let touch = &touches[column.pair];
            let mut elastic_n = column.compression_m * stiffness_n_per_m;
            if material == Material::Viscoelastic {
                let relaxing_n = relaxing_n_per_m / columns * column.relaxing_m;
                elastic_n = (elastic_n + relaxing_n).clamp(0.0, strength_n / columns);
            }
            let normal_n = contact_force_n(elastic_n, damping_s_per_m, touch.closing_m_s);
            forces_n[column.pair] +=
                touch.normal * -normal_n + column.grip.force_n(touch, normal_n, friction);
        }
    }

    /// Elastic force of a column divided by its compression, N/m. The force of the whole piece is stiffness · t ·
    /// (compression / t)ⁿ, with the thickness t of a fresh piece. So a thinner piece carries less until the teeth meet,
    /// as in the course of chewing.
    fn stiffness_n_per_m(&self, compression_m: f64) -> f64 {
        let FoodConfig { thickness_m, stiffness_n_per_m, exponent, .. } = *self.config;
        let stiffness_n_per_m = self.share() * stiffness_n_per_m / self.columns.len() as f64;
        stiffness_n_per_m * (compression_m / thickness_m).powf(exponent - 1.0)
    }

    /// The compression of a column under an elastic force, m.
    fn compression_of(&self, elastic_n: f64) -> f64 {
        let FoodConfig { thickness_m, stiffness_n_per_m, exponent, .. } = *self.config;
        let whole_n = self.share() * stiffness_n_per_m / self.columns.len() as f64 * thickness_m;
        thickness_m * (elastic_n / whole_n).powf(1.0 / exponent)
    }

    /// Present share of stiffness and strength of the piece.
    fn share(&self) -> f64 {
        if self.is_broken { self.config.residual } else { 1.0 }
    }
}

impl Column {
    /// Compresses the column in a step. `relaxation` is the step as a share of the spring's time of relaxation.
    fn compress(&mut self, compression_m: f64, relaxation: f64) {
        let more_m = compression_m - std::mem::replace(&mut self.compression_m, compression_m);
        let relaxed_m = (self.relaxing_m + more_m) / (1.0 + relaxation);
        self.relaxing_m = if compression_m > 0.0 { relaxed_m } else { 0.0 };
    }
}
