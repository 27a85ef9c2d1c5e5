//! Least squares on a model that plays a recording again with noise of its own: values and 95 % intervals.
//!
//! The recording's noise is unknown. So residuals are those from the mean of some playings with other seeds,
//! and slopes are those of playings without noise. The spread of the sums over blocks of the recording gives the
//! intervals, so that serial correlation counts. A weak prior, the start with a standard deviation of one scale, bounds
//! what the recording leaves open. Nothing here depends on a rig.

use nalgebra::{DMatrix, DVector};
use rayon::iter::{IntoParallelIterator, ParallelIterator};

/// Positions and forces of the axes.
pub(super) const CHANNELS: usize = 2 * masseter_model::geometry::AXES;
/// The channels in a cycle.
pub(super) type Row = [f64; CHANNELS];

/// Playings behind each mean on the way, and behind the last ones.
const ON_THE_WAY: u64 = 4;
const AT_THE_END: u64 = 8;
/// Most rounds, most steps in each, and steps at the end.
const MOST_ROUNDS: usize = 4;
const MOST_STEPS: usize = 12;
const LAST_STEPS: usize = 2;
/// Blocks of a recording.
pub(super) const BLOCKS: usize = 40;
/// Standard deviations by which noise alone may raise the cost of a step.
const ROUGH: f64 = 1.0;
/// An estimate whose interval is wider, in shares of its value to each side, is none.
const WIDEST: f64 = 0.1;

/// The noise of a playing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Noise {
    None,
    Seed(u64),
}

/// Plays a recording again.
pub(super) trait Model: Sync {
    /// Why it cannot go on.
    type Error: Send;

    /// The channels in every cycle with these values of the parameters; none where no rig has such values.
    ///
    /// # Errors
    /// Those that end the fit.
    fn play(&self, values: &[f64], noise: Noise) -> Result<Option<Vec<Row>>, Self::Error>;
}

/// A parameter, not below zero.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unknown {
    /// Its first value.
    pub(super) start: f64,
    /// The least value that is told from zero.
    pub(super) least: f64,
    /// The difference for a slope, in shares of its scale.
    pub(super) difference: f64,
    /// Standard deviation of what is known of the start.
    pub(super) spread: f64,
    /// Values in whose neighbourhoods the best one may lie.
    pub(super) valleys: &'static [f64],
}

impl Unknown {
    fn scale(&self) -> f64 {
        self.start.max(self.least)
    }

    /// The weight of what is known of the start, in the parameter's scale.
    fn prior(&self) -> f64 {
        (self.scale() / self.spread).powi(2)
    }
}

/// What a recording says of a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Estimate {
    pub(super) value: f64,
    /// Half of the 95 % interval.
    pub(super) half_width: f64,
    /// Whether the recording determines it.
    pub(super) is_determined: bool,
}

/// What the recording says of all.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Fit {
    pub(super) estimates: Vec<Estimate>,
    /// Residuals divided by the model's own noise, rms: 1 where the model explains the recording.
    pub(super) misfit: f64,
}

impl Fit {
    /// Fits a model to a recording. `finest` are the increments of the channels. None where no rig has the first values.
    ///
    /// # Errors
    /// Those of the model.
    pub(super) fn of<M: Model>(
        model: &M,
        recorded: &[Row],
        unknowns: &[Unknown],
        finest: &Row,
    ) -> Result<Option<Self>, M::Error> {
        let problem = Problem { model, recorded, unknowns };
        let Some(mut here) = problem.place(problem.start(), ON_THE_WAY)? else { return Ok(None) };
        let weights_of = |place: &Place| -> Row {
            std::array::from_fn(|at| place.noise[at].max(finest[at].powi(2) / 12.0).recip())
        };
        let weights = weights_of(&here);
        for round in 0..MOST_ROUNDS {
            let before = here.scaled.clone();
            here = problem.scan(here, &weights)?;
            if round > 0 && here.scaled == before {
                break;
            }
            here = problem.descend(here, &weights)?;
        }
        let mut end = None;
        for _ in 0..LAST_STEPS {
            let Some(place) = problem.place(here.scaled.clone(), AT_THE_END)? else { break };
            let normal = problem.normal(&place, &weights)?;
            here.scaled = place.moved(&normal.step(0.0));
            end = Some((normal, place));
        }
        Ok(end.map(|(normal, place)| Self {
            estimates: normal.estimates(unknowns, &here.scaled, &place, &weights),
            misfit: problem.misfit(&place, &weights_of(&place)),
        }))
    }
}

/// A model, its recording, and what is sought.
struct Problem<'a, M> {
    model: &'a M,
    recorded: &'a [Row],
    unknowns: &'a [Unknown],
}

/// Values of the parameters in their scales, and the mean of some playings with them.
struct Place {
    scaled: DVector<f64>,
    mean: Vec<Row>,
    played: Vec<Vec<Row>>,
    /// Variance of a single playing.
    noise: Row,
}

impl Place {
    /// The values a step further.
    fn moved(&self, step: &DVector<f64>) -> DVector<f64> {
        (&self.scaled + step).map(|scaled| scaled.max(0.0))
    }
}

impl<M: Model> Problem<'_, M> {
    fn start(&self) -> DVector<f64> {
        DVector::from_iterator(self.unknowns.len(), self.unknowns.iter().map(|of| of.start / of.scale()))
    }

    fn prior(&self) -> DVector<f64> {
        DVector::from_iterator(self.unknowns.len(), self.unknowns.iter().map(Unknown::prior))
    }

    fn play(&self, scaled: &DVector<f64>, noise: Noise) -> Result<Option<Vec<Row>>, M::Error> {
        let values: Vec<f64> =
            scaled.iter().zip(self.unknowns).map(|(share, of)| share * of.scale()).collect();
        self.model.play(&values, noise)
    }

    /// Plays with these values and that many seeds.
    fn place(&self, scaled: DVector<f64>, playings: u64) -> Result<Option<Place>, M::Error> {
        let played: Result<Option<Vec<_>>, _> = (0..playings)
            .into_par_iter()
            .map(|seed| self.play(&scaled, Noise::Seed(seed)).transpose())
            .collect::<Option<Result<_, _>>>()
            .transpose();
        let Some(played) = played? else { return Ok(None) };
        let mut mean = vec![[0.0; CHANNELS]; self.recorded.len()];
        let mut noise = [0.0; CHANNELS];
        let share = ((playings - 1).max(1) as f64 * self.recorded.len() as f64).recip();
        for (cycle, mean) in mean.iter_mut().enumerate() {
            for (channel, mean) in mean.iter_mut().enumerate() {
                let values = || played.iter().map(|rows: &Vec<Row>| rows[cycle][channel]);
                *mean = values().sum::<f64>() / playings as f64;
                noise[channel] += share * values().map(|value| (value - *mean).powi(2)).sum::<f64>();
            }
        }
        Ok(Some(Place { scaled, mean, played, noise }))
    }

    fn squares(&self, place: &Place, weights: &Row) -> f64 {
        residuals(self.recorded, place)
            .flat_map(|row| row.into_iter().zip(weights))
            .map(|(r, weight)| weight * r * r)
            .sum()
    }

    fn cost(&self, place: &Place, weights: &Row) -> f64 {
        let from_start = &place.scaled - self.start();
        self.squares(place, weights) + self.prior().component_mul(&from_start).dot(&from_start)
    }

    /// Goes to another valley, where one of those that a parameter may have is deeper.
    fn scan(&self, mut here: Place, weights: &Row) -> Result<Place, M::Error> {
        for (number, unknown) in self.unknowns.iter().enumerate() {
            let one = |value: f64| {
                let mut scaled = here.scaled.clone();
                scaled[number] = value / unknown.scale();
                let place = self.place(scaled, 1)?;
                Ok(place.map(|place| (self.cost(&place, weights), place.scaled)))
            };
            let own = here.scaled[number] * unknown.scale();
            let values: Vec<f64> = unknown.valleys.iter().copied().chain([own]).collect();
            let places: Vec<Option<(f64, DVector<f64>)>> = if values.len() > 1 {
                values.into_par_iter().map(one).collect::<Result<_, _>>()?
            } else {
                Vec::new()
            };
            let deepest = places.into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((_, scaled)) = deepest.filter(|(_, scaled)| *scaled != here.scaled) {
                here = self.place(scaled, ON_THE_WAY)?.unwrap_or(here);
            }
        }
        Ok(here)
    }

    /// Steps down to the floor of the valley.
    fn descend(&self, mut here: Place, weights: &Row) -> Result<Place, M::Error> {
        let allowed = ROUGH * (2.0 * (CHANNELS * self.recorded.len()) as f64).sqrt();
        let mut damping = 1e-3;
        for _ in 0..MOST_STEPS {
            let normal = self.normal(&here, weights)?;
            let most = self.cost(&here, weights) + allowed;
            let mut moved = None;
            while moved.is_none() && damping < 1e6 {
                let step = normal.step(damping);
                let trial = self.place(here.moved(&step), ON_THE_WAY)?;
                moved = trial.filter(|trial| self.cost(trial, weights) < most).map(|trial| (trial, step));
                damping *= if moved.is_some() { 0.1 } else { 10.0 };
            }
            let Some((next, step)) = moved else { break };
            here = next;
            if normal.distance(&step) < self.unknowns.len() as f64 {
                break;
            }
        }
        Ok(here)
    }

    /// The residuals by the noise of a playing and of the mean.
    fn misfit(&self, place: &Place, weights: &Row) -> f64 {
        let variance = 1.0 + (place.played.len() as f64).recip();
        (self.squares(place, weights) / variance / (CHANNELS * self.recorded.len()) as f64).sqrt()
    }

    /// The slopes at a place by a parameter. Where the difference leads to values of no rig, the other side is taken.
    fn slopes(&self, place: &Place, base: &[Row], number: usize) -> Result<Vec<Row>, M::Error> {
        let share = if place.scaled[number] > 0.0 { self.unknowns[number].difference } else { 1.0 };
        for difference in [share, -share] {
            let mut scaled = place.scaled.clone();
            scaled[number] += difference;
            if let Some(rows) = self.play(&scaled, Noise::None)? {
                let slope =
                    |(row, base): (&Row, &Row)| std::array::from_fn(|at| (row[at] - base[at]) / difference);
                return Ok(rows.iter().zip(base).map(slope).collect());
            }
        }
        Ok(vec![[0.0; CHANNELS]; base.len()])
    }

    /// The normal equations at a place.
    fn normal(&self, place: &Place, weights: &Row) -> Result<Normal, M::Error> {
        let count = self.unknowns.len();
        let base = self.play(&place.scaled, Noise::None)?.unwrap_or_else(|| place.mean.clone());
        let slopes: Vec<Vec<Row>> = (0..count)
            .into_par_iter()
            .map(|number| self.slopes(place, &base, number))
            .collect::<Result<_, _>>()?;
        let mut matrix = DMatrix::zeros(count, count);
        for one in 0..count {
            for other in 0..=one {
                let rows = slopes[one].iter().zip(&slopes[other]);
                let products =
                    rows.map(|(a, b)| (0..CHANNELS).map(|at| weights[at] * a[at] * b[at]).sum::<f64>());
                matrix[(one, other)] = products.sum();
            }
        }
        matrix.fill_upper_triangle_with_lower_triangle();
        let scores = scores(self.recorded, place, &slopes, weights);
        let prior = self.prior();
        let drawn = prior.component_mul(&(self.start() - &place.scaled));
        Ok(Normal { matrix, slopes, scores, prior, drawn })
    }
}

/// The distances of a playing or a recording from the mean of a place.
fn residuals(rows: &[Row], place: &Place) -> impl Iterator<Item = Row> {
    rows.iter().zip(&place.mean).map(|(row, mean)| std::array::from_fn(|at| row[at] - mean[at]))
}

/// JᵀWr of each block.
fn scores(rows: &[Row], place: &Place, slopes: &[Vec<Row>], weights: &Row) -> Vec<DVector<f64>> {
    let mut scores = vec![DVector::zeros(slopes.len()); BLOCKS];
    for (cycle, residuals) in residuals(rows, place).enumerate() {
        let score = &mut scores[cycle * BLOCKS / rows.len()];
        for (number, slopes) in slopes.iter().enumerate() {
            score[number] +=
                (0..CHANNELS).map(|at| weights[at] * slopes[cycle][at] * residuals[at]).sum::<f64>();
        }
    }
    scores
}

/// The variance of the sum of scores that differ from block to block by chance.
fn variance(scores: &[DVector<f64>]) -> DMatrix<f64> {
    let mean = scores.iter().sum::<DVector<f64>>() / scores.len() as f64;
    scores.iter().map(|score| (score - &mean) * (score - &mean).transpose()).sum()
}

/// The normal equations of a place: JᵀWJ in the parameters' scales, and JᵀWr of every block.
struct Normal {
    matrix: DMatrix<f64>,
    slopes: Vec<Vec<Row>>,
    scores: Vec<DVector<f64>>,
    prior: DVector<f64>,
    /// What draws the values to the start.
    drawn: DVector<f64>,
}

impl Normal {
    /// The step of Levenberg and Marquardt.
    fn step(&self, damping: f64) -> DVector<f64> {
        let mut damped = self.matrix.clone();
        (0..damped.nrows())
            .for_each(|at| damped[(at, at)] += self.prior[at] + damping * self.matrix[(at, at)]);
        let gradient = self.scores.iter().sum::<DVector<f64>>() + &self.drawn;
        damped.cholesky().map_or_else(|| DVector::zeros(gradient.len()), |factor| factor.solve(&gradient))
    }

    /// The square of a step's length in standard deviations of white noise.
    fn distance(&self, step: &DVector<f64>) -> f64 {
        step.dot(&(&self.matrix * step))
    }

    /// What the recording says of each parameter. Its noise is that of the recording or that of the playings, whichever is
    /// larger: a few blocks may have all the information, and then one recording shows little of its own noise.
    fn estimates(
        &self,
        unknowns: &[Unknown],
        scaled: &DVector<f64>,
        place: &Place,
        weights: &Row,
    ) -> Vec<Estimate> {
        let (count, playings) = (unknowns.len(), place.played.len() as f64);
        let prior = DMatrix::from_diagonal(&self.prior);
        let inverse = (&self.matrix + &prior).cholesky().map_or_else(|| prior.clone(), |of| of.inverse());
        let freedom = (BLOCKS - count) as f64;
        let of_recording = variance(&self.scores) * (BLOCKS as f64 / freedom);
        let of_playings: DMatrix<f64> =
            place.played.iter().map(|rows| variance(&scores(rows, place, &self.slopes, weights))).sum();
        let of_playings = of_playings * ((1.0 + playings.recip()) / (playings - 1.0));
        let [recorded, played] =
            [of_recording, of_playings].map(|noise| &inverse * (noise + &prior) * &inverse);
        let of_one = |(number, of): (usize, &Unknown)| {
            let variance = recorded[(number, number)].max(played[(number, number)]);
            let half_width = masseter_judge::student_t(freedom) * variance.sqrt() * of.scale();
            let value = scaled[number] * of.scale();
            Estimate { value, half_width, is_determined: half_width < WIDEST * value.max(of.least) }
        };
        unknowns.iter().enumerate().map(of_one).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    const CYCLES: usize = 2000;
    /// The step of a channel's numbers.
    const INCREMENT: f64 = 0.5;

    /// Three parameters: two that the channels show, one of them in a curve, and one that they do not show.
    struct Curves;

    impl Model for Curves {
        type Error = Infallible;

        fn play(&self, values: &[f64], noise: Noise) -> Result<Option<Vec<Row>>, Infallible> {
            let &[wave, curve, _] = values else { return Ok(None) };
            let mut random = match noise {
                Noise::None => None,
                Noise::Seed(seed) => Some(Pcg64Mcg::seed_from_u64(seed)),
            };
            let mut drift = 0.0;
            let row = |cycle| {
                let time = f64::from(cycle) * 0.01;
                let exact = wave * time.sin() + (curve * time.cos()).exp();
                let Some(random) = &mut random else { return [exact; CHANNELS] };
                // The noise has a memory.
                drift = 0.9 * drift + random.random_range(-0.1..0.1);
                std::array::from_fn(|_| {
                    let noisy = exact + drift + random.random_range(-0.5..0.5);
                    (noisy / INCREMENT).round() * INCREMENT
                })
            };
            Ok((values[1] < 3.0).then(|| (0..CYCLES as u32).map(row).collect()))
        }
    }

    fn fit(truth: [f64; 3], seed: u64) -> Fit {
        let Ok(Some(recorded)) = Curves.play(&truth, Noise::Seed(seed)) else {
            panic!("no rig has {truth:?}")
        };
        let unknowns = [2.0, 1.0, 1.0].map(|start| Unknown {
            start,
            least: 0.1,
            difference: 0.02,
            spread: start,
            valleys: &[],
        });
        let Ok(fit) = Fit::of(&Curves, &recorded, &unknowns, &[INCREMENT; CHANNELS]);
        fit.expect("the start is playable")
    }

    #[test]
    fn intervals_of_what_the_recording_shows_cover_under_serial_correlation() {
        let mut covered = [0; 2];
        for seed in 1000..1040 {
            let truth = [1.5, 1.3, 0.7];
            let found = fit(truth, seed);
            assert!((found.misfit - 1.0).abs() < 0.2, "{}", found.misfit);
            for (number, covered) in covered.iter_mut().enumerate() {
                let Estimate { value, half_width, is_determined } = found.estimates[number];
                assert!(is_determined && (value / truth[number] - 1.0).abs() < 0.05, "{seed}: {value}");
                *covered += usize::from((value - truth[number]).abs() < half_width);
            }
        }
        // 95 % of 40 is 38; fewer than 34 have a probability below 2 %.
        assert!(covered.iter().all(|covered| *covered >= 34), "{covered:?}");
    }

    #[test]
    fn what_the_recording_does_not_show_is_undetermined() {
        let found = fit([1.5, 1.3, 0.2], 1).estimates[2];
        assert!(!found.is_determined && found.half_width > 1.0, "{found:?}");
    }

    #[test]
    fn a_recording_of_other_values_than_its_model_has_shows_in_the_misfit() {
        let truth = [1.5, 1.3, 0.2];
        let Ok(Some(mut recorded)) = Curves.play(&truth, Noise::Seed(1)) else {
            panic!("no rig has {truth:?}")
        };
        for (cycle, row) in recorded.iter_mut().enumerate() {
            row[0] += (cycle as f64 * 0.3).sin() * 5.0;
        }
        let unknowns = [2.0, 1.0, 1.0].map(|start| Unknown {
            start,
            least: 0.1,
            difference: 0.02,
            spread: start,
            valleys: &[],
        });
        let Ok(found) = Fit::of(&Curves, &recorded, &unknowns, &[INCREMENT; CHANNELS]);
        assert!(found.is_some_and(|fit| fit.misfit > 1.3));
    }

    #[test]
    fn a_start_that_no_rig_has_gives_no_fit() {
        let unknowns = [2.0, 5.0, 1.0].map(|start| Unknown {
            start,
            least: 0.1,
            difference: 0.02,
            spread: start,
            valleys: &[],
        });
        let fit = Fit::of(&Curves, &vec![[0.0; CHANNELS]; CYCLES], &unknowns, &[INCREMENT; CHANNELS]);
        assert_eq!(fit, Ok(None));
    }
}
