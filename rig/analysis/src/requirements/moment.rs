//! A sample of the run as requirements see it.

use crate::events::EventRecord;

/// The values and events of one sample.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moment<'a> {
    /// When, ns of the run's clock.
    pub(super) time_ns: u64,
    /// Since the motion began, s; none before.
    pub(super) motion_s: Option<f64>,
    /// The chosen signals; NaN where one is missing.
    pub(super) values: &'a [f64],
    /// The events since the sample before.
    pub(super) events: &'a [EventRecord],
    /// Whether a lost cycle may have acted on the jaw.
    pub(super) is_disturbed: bool,
    /// Whether it is no sample, but holds the events after the last one.
    pub(super) is_closing: bool,
}
