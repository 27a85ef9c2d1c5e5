//! Every platform that closes for one input, each once, before anything else is made of it.
//!
//! This is all that picking the true solution needs, and a fraction of what telling of every solution
//! costs: see [`Solutions`](super::Solutions) for that.

use masseter_shared::geometry::{Actuators, LEGS};

use super::closure::{Closed, Closure};
use super::elimination::{Elimination, Wanted};
use super::heading::{Heading, coincide, separation_rad};
use super::{Assembly, ForwardError, MOST_SOLUTIONS};

/// Solutions closer than this are one, radians on every leg.
const MERGED_WITHIN_RAD: f64 = 1e-6;
/// A leg shorter than this has no direction, metres.
const SHORTEST_LEG_M: f64 = 1e-9;

/// Closed platforms, none twice, mirrored ones next to each other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Platforms {
    pub closed: [Option<Closed>; MOST_SOLUTIONS],
    pub count: usize,
    overflowed: bool,
}

/// Inputs on which the equations are defined.
pub(super) fn check(actuators: &Actuators) -> Result<(), ForwardError> {
    if !actuators.is_finite() {
        return Err(ForwardError::NotFinite);
    }
    match (0..LEGS).find(|&leg| actuators.leg_m[leg] < SHORTEST_LEG_M) {
        Some(leg) => Err(ForwardError::NoLength { leg, leg_m: actuators.leg_m[leg] }),
        None => Ok(()),
    }
}

impl Platforms {
    /// All that are wanted, or [`ForwardError::Undecided`].
    pub(super) fn of(closure: &Closure<'_>, wanted: Wanted) -> Result<Self, ForwardError> {
        let mut platforms = Self { closed: [None; MOST_SOLUTIONS], count: 0, overflowed: false };
        let isolated = Elimination::new(closure).solve(wanted, |closed| platforms.add_pair(&closed));
        if isolated.is_err() || platforms.overflowed {
            return Err(ForwardError::Undecided { solutions: platforms.count });
        }
        Ok(platforms)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &Closed> {
        self.closed.iter().flatten()
    }

    /// Those in which the mechanism can stand.
    pub(super) fn true_ones(&self, closure: &Closure<'_>) -> impl Iterator<Item = &Closed> {
        let is_above = |closed: &&Closed| closed.headings.iter().all(|heading| heading.sin > 0.0);
        self.iter().filter(is_above).filter(|closed| assembly(closure, closed).is_true())
    }

    fn add_pair(&mut self, closed: &Closed) {
        self.add(closed);
        self.add(&closed.mirrored());
    }

    fn add(&mut self, closed: &Closed) {
        let is_same = |known: &Closed| coincide(&known.headings, &closed.headings, MERGED_WITHIN_RAD);
        if self.iter().any(is_same) {
            return;
        }
        match self.closed.get_mut(self.count) {
            Some(place) => {
                *place = Some(*closed);
                self.count += 1;
            }
            None => self.overflowed = true,
        }
    }
}

/// Which conditions of the true solution a platform meets.
pub(super) fn assembly(closure: &Closure<'_>, closed: &Closed) -> Assembly {
    let corners = closure.corners(&closed.headings);
    let determinant = closure.determinant(&closed.closing);
    Assembly::of(closure.mechanism, &closure.hinges, &corners, determinant)
}

/// How far the nearest of the others is, by the largest difference of any leg's angle, radians.
pub(super) fn nearest_other_rad<'a>(
    headings: &[Heading; LEGS],
    all: impl Iterator<Item = &'a [Heading; LEGS]>,
) -> Option<f64> {
    let distances = all.map(|other| separation_rad(headings, other));
    distances.filter(|&distance| distance > MERGED_WITHIN_RAD).min_by(f64::total_cmp)
}
