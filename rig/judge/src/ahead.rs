//! Whether the true jaw is ahead of the motion: whether the motion at a later time explains the jaw's distance from its path.

use masseter_model::geometry::{Pose, Vec3};

/// Three points of the jaw, or how they move.
pub(super) type Points = [Vec3; 3];

/// The length of a window of the motion, s. The whole motion counts as well.
const WINDOW_S: f64 = 1.0;
/// Fewer samples show nothing.
const FEWEST_SAMPLES: f64 = 10.0;
/// A shorter distance (rms, m) is noise: a slow motion would make a long time of it.
const LEAST_DISTANCE_M: f64 = 20e-6;
/// The share of the distance that a later time must explain.
const EXPLAINED: f64 = 0.95;

/// Sums over samples, of which the covariances are taken: a constant distance is no lead.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    samples: f64,
    distance: Points,
    speed: Points,
    distance_squares: f64,
    speed_squares: f64,
    products: f64,
    lag_s: f64,
}

fn dot(one: &Points, other: &Points) -> f64 {
    one.iter().zip(other).map(|(one, other)| one.dot(other)).sum()
}

impl Sums {
    fn add(&mut self, distance: &Points, speed: &Points, lag_s: f64) {
        self.samples += 1.0;
        self.distance.iter_mut().zip(distance).for_each(|(sum, distance)| *sum += distance);
        self.speed.iter_mut().zip(speed).for_each(|(sum, speed)| *sum += speed);
        self.distance_squares += dot(distance, distance);
        self.speed_squares += dot(speed, speed);
        self.products += dot(distance, speed);
        self.lag_s += lag_s;
    }

    /// How far the jaw is ahead of the motion, s; none where that does not explain its distance.
    fn ahead_s(&self) -> Option<f64> {
        let of_means = |one, other| dot(one, other) / self.samples;
        let distances = self.distance_squares - of_means(&self.distance, &self.distance);
        let speeds = self.speed_squares - of_means(&self.speed, &self.speed);
        let products = self.products - of_means(&self.distance, &self.speed);
        let is_far = distances > self.samples * LEAST_DISTANCE_M * LEAST_DISTANCE_M;
        let is_explained = products * products > EXPLAINED * distances * speeds;
        (self.samples >= FEWEST_SAMPLES && is_far && is_explained)
            .then(|| products / speeds - self.lag_s / self.samples)
    }
}

/// Follows the jaw beside its motion.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct AheadWatch {
    /// The desired pose before, and how far it had come.
    before: Option<(Pose, f64)>,
    window_ends_s: Option<f64>,
    window: Sums,
    whole: Sums,
    /// Of the windows that have ended.
    most_s: f64,
}

impl AheadWatch {
    /// Takes a sample of a motion that has come so far. `between` gives how the points move from one pose to another.
    pub(super) fn add_sample(
        &mut self,
        lag_s: f64,
        progress_s: f64,
        [desired, actual]: [&Pose; 2],
        between: impl Fn(&Pose, &Pose) -> Points,
    ) {
        let Some((before, before_s)) = self.before else {
            self.before = Some((*desired, progress_s));
            return;
        };
        if progress_s <= before_s {
            return;
        }
        self.before = Some((*desired, progress_s));
        let speed = between(&before, desired).map(|way| way / (progress_s - before_s));
        let distance = between(desired, actual);
        let ends_s = *self.window_ends_s.get_or_insert(progress_s + WINDOW_S);
        if progress_s >= ends_s {
            self.most_s = self.most_s.max(self.window.ahead_s().unwrap_or_default());
            (self.window, self.window_ends_s) = (Sums::default(), Some(progress_s + WINDOW_S));
        }
        self.window.add(&distance, &speed, lag_s);
        self.whole.add(&distance, &speed, lag_s);
    }

    /// How far the jaw was ahead of the motion at most, s. A motion's end counts from half a window on: a few samples of a slow jaw
    /// show nothing.
    pub(super) fn in_s(&self) -> f64 {
        let left_s = self.window_ends_s.zip(self.before).map(|(ends_s, (_, now_s))| ends_s - now_s);
        let has_half = left_s.is_some_and(|left_s| left_s < WINDOW_S / 2.0);
        let has_windows = self.whole.samples > self.window.samples;
        [(has_half, &self.window), (has_half || has_windows, &self.whole)]
            .into_iter()
            .filter_map(|(is_judged, sums)| sums.ahead_s().filter(|_| is_judged))
            .fold(self.most_s, f64::max)
    }
}
