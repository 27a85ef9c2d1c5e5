//! The forces between the jaws: the greatest of each tooth, the moment of the greatest of all together, and their course.

use masseter_runtime::messages::{Contact, ToothContact};
use masseter_scenario::MOST_PAIRS;
use serde::Serialize;

use super::series::{Curve, Extremes, Series};

/// What the teeth of the emulated jaw bore.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ContactFigures {
    /// The greatest sum of the forces on all teeth, N.
    pub total_max_n: f64,
    /// When that was, ns of the run's clock.
    pub total_max_at_ns: u64,
    /// The lower teeth, in the order of their numbers.
    pub teeth: Vec<ToothFigures>,
    /// What the teeth bore over time, as often as a screen shows it; of a long run not to its end.
    #[serde(skip)]
    pub moments: Vec<ToothLoads>,
}

/// What a tooth bore.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ToothFigures {
    /// FDI number.
    pub number: u32,
    /// Where its force acts, platform frame, m.
    pub place_m: [f64; 3],
    /// The greatest force on it, N.
    pub max_n: f64,
    /// The force on it when the sum of all was greatest, base axes, N.
    pub at_total_max_n: [f64; 3],
    /// The greatest force in each stretch of time, with its own time since the run's first SYNC, s and N.
    #[serde(skip)]
    pub course_n: Curve,
}

/// What the teeth bore when their sum was greatest within the time of a frame on a screen.
#[derive(Debug, Clone, PartialEq)]
pub struct ToothLoads {
    /// When, s since the run's first SYNC.
    pub at_s: f64,
    /// Place of a tooth in the list of teeth, and the force on it, base axes, N; those without a force are left out.
    pub forces_n: Vec<(usize, [f64; 3])>,
    total_n: f64,
}

/// Length of a frame, s, and the frames that are kept.
const FRAME_S: f64 = 1.0 / 60.0;
const MOST_FRAMES: usize = 2048;
/// Less is no force to be shown, N.
const LEAST_N: f64 = 0.1;

/// Collects them.
#[derive(Debug, Clone, Default)]
pub(super) struct ContactWatch {
    moments: Vec<ToothLoads>,
    frame_ends_s: f64,
    total_max_n: f64,
    greatest: Contact,
    max_n: [f64; MOST_PAIRS],
    courses: Series<Extremes<MOST_PAIRS>>,
    /// The newest message, which names the teeth.
    newest: Option<Contact>,
}

impl ContactWatch {
    /// Takes a message, sampled so long after the run's first SYNC; none where no course is shown.
    pub(super) fn take(&mut self, contact: &Contact, since_ns: Option<u64>) {
        let mut total_n = 0.0;
        for (place, tooth) in contact.teeth().enumerate() {
            let load_n = tooth.load_n();
            total_n += load_n;
            self.max_n[place] = self.max_n[place].max(load_n);
            if let Some(since_ns) = since_ns {
                self.courses.take(since_ns, place, load_n);
            }
        }
        if let Some(since_ns) = since_ns {
            self.moment(since_ns as f64 / 1e9, total_n, contact);
        }
        if total_n > self.total_max_n {
            (self.total_max_n, self.greatest) = (total_n, *contact);
        }
        self.newest = Some(*contact);
    }

    fn moment(&mut self, at_s: f64, total_n: f64, contact: &Contact) {
        let is_of_last = at_s < self.frame_ends_s;
        let is_less = self.moments.last().is_some_and(|last| is_of_last && total_n <= last.total_n);
        if total_n < LEAST_N || is_less {
            return;
        }
        if is_of_last {
            self.moments.pop();
        } else if self.moments.len() == MOST_FRAMES {
            return;
        } else {
            self.frame_ends_s = at_s + FRAME_S;
        }
        let loaded = contact.teeth().enumerate().filter(|(_, tooth)| tooth.load_n() >= LEAST_N);
        let forces_n = loaded.map(|(place, tooth)| (place, tooth.force_n)).collect();
        self.moments.push(ToothLoads { at_s, forces_n, total_n });
    }

    /// The figures; none without a message.
    pub(super) fn finish(self) -> Option<ContactFigures> {
        let greatest: Vec<_> = self.greatest.teeth().collect();
        let tooth = |(place, tooth): (usize, ToothContact)| ToothFigures {
            number: tooth.number,
            place_m: tooth.place_m,
            max_n: self.max_n[place],
            at_total_max_n: greatest.get(place).map_or([0.0; 3], |tooth| tooth.force_n),
            course_n: self.courses.highest(place),
        };
        Some(ContactFigures {
            total_max_n: self.total_max_n,
            total_max_at_ns: self.greatest.sampled_ns,
            teeth: self.newest?.teeth().enumerate().map(tooth).collect(),
            moments: self.moments,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn contact(sampled_ns: u64, forces_n: [f64; 2]) -> Contact {
        let mut contact = Contact { sampled_ns, ..Contact::default() };
        contact.tooth[..2].copy_from_slice(&[36, 46]);
        (contact.force_n[2], contact.force_n[5]) = (-forces_n[0], -forces_n[1]);
        contact
    }

    #[test]
    fn the_greatest_of_each_tooth_and_the_greatest_sum_are_kept_with_their_moment() {
        let mut watch = ContactWatch::default();
        for (tenth, forces_n) in [(1, [5.0, 0.0]), (2, [30.0, 20.0]), (3, [40.0, 1.0])] {
            let at_ns = tenth * 100_000;
            watch.take(&contact(at_ns, forces_n), Some(at_ns));
        }
        let figures = watch.finish().unwrap();
        assert_eq!((figures.total_max_n, figures.total_max_at_ns), (50.0, 200_000));
        let found: Vec<_> =
            figures.teeth.iter().map(|tooth| (tooth.number, tooth.max_n, tooth.at_total_max_n[2])).collect();
        assert_eq!(found, [(36, 40.0, -30.0), (46, 20.0, -20.0)]);
        assert_eq!(figures.teeth[0].course_n, [(0.0003, 40.0)]);
        // The three messages share a frame of a screen.
        let moments: Vec<_> =
            figures.moments.iter().map(|moment| (moment.at_s, moment.forces_n.len())).collect();
        assert_eq!(moments, [(0.0002, 2)]);
        assert_eq!(ContactWatch::default().finish(), None);
    }
}
