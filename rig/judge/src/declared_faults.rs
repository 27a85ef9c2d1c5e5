//! Each declared fault: when it first struck, what detected it and began a safe stop, and how far the platform left its path
//! until then.

use masseter_model::geometry::Deviation;
use masseter_runtime::messages::codes::{Cause, Source};
use serde::Serialize;

use crate::events::{Code, EventRecord};
use crate::{poses::worse, tracking::PathSample};

/// A declared fault and its effect.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct FaultFigures {
    /// Number in the scenario's list, from 1.
    pub number: usize,
    /// When it first struck, ns of the run's clock; `None` if it never did.
    pub struck_ns: Option<u64>,
    /// Largest distance of the incisal point from its path, from then until a safe stop began, or else the motion's end, mm.
    pub deviation_mm: f64,
    /// Largest angle in that time, degrees.
    pub deviation_deg: f64,
    /// What began the first safe stop from then on; none without.
    pub detection: Option<Detection>,
}

/// The event that begins a safe stop: the controller's or the master's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Detection {
    /// Who reported it.
    pub source: Code<Source>,
    /// As what.
    pub cause: Code<Cause>,
    /// Time from the first strike, ms.
    pub latency_ms: f64,
    /// Distance of the incisal point from its path in the last sample before, mm.
    pub deviation_mm: f64,
    /// Angle in that sample, degrees.
    pub deviation_deg: f64,
}

/// Follows the declared faults.
#[derive(Debug, Clone, Default)]
pub(super) struct FaultWatch {
    /// Each with the deviation in its last sample.
    faults: Vec<(FaultFigures, Deviation)>,
    /// The beginnings of safe stops.
    stops: Vec<EventRecord>,
}

impl FaultWatch {
    pub(super) fn new(declared: usize) -> Self {
        let figures = |number| FaultFigures { number, ..FaultFigures::default() };
        let faults = (1..=declared).map(|number| (figures(number), Deviation::default()));
        Self { faults: faults.collect(), stops: Vec::new() }
    }

    pub(super) fn apply_event(&mut self, event: &EventRecord) {
        if event.cause == Cause::FaultInjected {
            self.strike(event.value as usize, event.time_ns);
        }
        if event.begins_stop() && !self.faults.is_empty() {
            self.stops.push(event.clone());
        }
    }

    /// A fault of this number, from 1, has struck.
    pub(super) fn strike(&mut self, number: usize, time_ns: u64) {
        if let Some((fault, _)) = number.checked_sub(1).and_then(|place| self.faults.get_mut(place)) {
            fault.struck_ns = Some(fault.struck_ns.map_or(time_ns, |struck_ns| struck_ns.min(time_ns)));
        }
    }

    /// Counts a sample for every fault that had struck, until the stop. The events of its time have come.
    pub(super) fn apply_sample(&mut self, sample: &PathSample) {
        for (fault, last) in &mut self.faults {
            let Some(struck_ns) = fault.struck_ns.filter(|struck_ns| *struck_ns <= sample.sampled_ns) else {
                continue;
            };
            if first_stop(&self.stops, struck_ns).is_none_or(|found| sample.sampled_ns <= found.time_ns) {
                *last = sample.deviation;
                fault.deviation_mm = worse(fault.deviation_mm, last.incisal_m * 1e3);
                fault.deviation_deg = worse(fault.deviation_deg, last.angle_rad.to_degrees());
            }
        }
    }

    /// `ended_ns`: when the controller had ended in order. A fault that strikes later tests nothing.
    pub(super) fn into_figures(self, ended_ns: Option<u64>) -> Vec<FaultFigures> {
        let first = first_stop(&self.stops, 0);
        let figures = |(mut fault, last): (FaultFigures, Deviation)| {
            fault.struck_ns.take_if(|struck_ns| ended_ns.is_some_and(|ended_ns| *struck_ns > ended_ns));
            fault.detection = fault.struck_ns.zip(first).and_then(|(struck_ns, stop)| {
                Some(Detection {
                    source: stop.source,
                    cause: stop.cause,
                    // A fault that strikes during a stop has not begun it.
                    latency_ms: stop.time_ns.checked_sub(struck_ns)? as f64 / 1e6,
                    deviation_mm: last.incisal_m * 1e3,
                    deviation_deg: last.angle_rad.to_degrees(),
                })
            });
            fault
        };
        self.faults.into_iter().map(figures).collect()
    }
}

fn first_stop(stops: &[EventRecord], struck_ns: u64) -> Option<&EventRecord> {
    stops.iter().filter(|found| found.time_ns >= struck_ns).min_by_key(|found| found.time_ns)
}

#[cfg(test)]
mod tests {
    use masseter_runtime::messages::Event;
    use masseter_runtime::messages::codes::{ControllerState, EventKind};

    use super::*;

    fn event(time_ns: u64, source: Source, kind: EventKind, cause: Cause, value: f64) -> EventRecord {
        (&Event { time_ns, value, ..Event::new(source, kind, cause) }).into()
    }

    fn safe_stop(time_ns: u64) -> EventRecord {
        let [from, to] = [ControllerState::Running, ControllerState::SafeStop].map(ControllerState::code);
        let fault = Event::new(Source::Controller, EventKind::Fault, Cause::MasterFault);
        (&Event { time_ns, from, to, ..fault }).into()
    }

    fn sample(sampled_ns: u64, incisal_m: f64) -> PathSample {
        let deviation = Deviation { incisal_m, angle_rad: 10.0 * incisal_m, origin_m: 0.0 };
        PathSample { sampled_ns, desired: None, actual: None, deviation }
    }

    /// Fault 1 strikes at 1 ms, a drive reports an emergency at 1.5 ms, and the master stops at 3.5 ms. Fault 2 strikes during
    /// that stop, and fault 3 never.
    #[test]
    fn the_path_is_followed_from_the_strike_to_the_stop_whatever_comes_first() {
        let mut watch = FaultWatch::new(3);
        let struck =
            |time_ns, value| event(time_ns, Source::Wire, EventKind::Notice, Cause::FaultInjected, value);
        let emergency = |time_ns| event(time_ns, Source::Drive, EventKind::Fault, Cause::Emergency, 33_792.0);
        watch.apply_event(&emergency(1_500_000));
        watch.apply_event(&safe_stop(5_000_000));
        watch.apply_event(&event(3_500_000, Source::Master, EventKind::Fault, Cause::ProcessDataLost, 4.0));
        watch.apply_event(&struck(1_000_000, 1.0));
        watch.apply_event(&struck(4_500_000, 2.0));
        watch.apply_event(&emergency(6_500_000));
        for (sampled_ns, incisal_m) in
            [(0, 9e-3), (1_000_000, 1e-4), (2_000_000, 3e-4), (3_000_000, 2e-4), (4_000_000, 5e-3)]
        {
            watch.apply_sample(&sample(sampled_ns, incisal_m));
        }
        let found = watch.into_figures(None);
        assert_eq!(found.iter().map(|figures| figures.number).collect::<Vec<_>>(), [1, 2, 3]);

        let first = &found[0];
        assert!((first.deviation_mm - 0.3).abs() < 1e-12, "{first:?}");
        assert!((first.deviation_deg - 3e-3f64.to_degrees()).abs() < 1e-12, "{first:?}");
        let detection = first.detection.unwrap();
        assert!(detection.source == Source::Master && detection.cause == Cause::ProcessDataLost);
        assert!((detection.latency_ms - 2.5).abs() < 1e-12 && (detection.deviation_mm - 0.2).abs() < 1e-12);
        assert!((detection.deviation_deg - 2e-3f64.to_degrees()).abs() < 1e-12, "{first:?}");
        assert_eq!((found[1].struck_ns, found[1].detection), (Some(4_500_000), None));
        assert_eq!((found[2].struck_ns, found[2].detection), (None, None));
    }

    #[test]
    fn a_fault_that_strikes_after_the_controllers_end_has_not_acted() {
        for (ended_ns, struck_ns) in [(None, Some(5)), (Some(5), Some(5)), (Some(4), None)] {
            let mut watch = FaultWatch::new(1);
            watch.apply_event(&event(5, Source::Wire, EventKind::Notice, Cause::FaultInjected, 1.0));
            assert_eq!(watch.into_figures(ended_ns)[0].struck_ns, struck_ns, "{ended_ns:?}");
        }
    }

    #[test]
    fn the_controllers_safe_stop_is_one_and_its_other_steps_are_not() {
        let mut watch = FaultWatch::new(1);
        watch.apply_event(&event(5, Source::Wire, EventKind::Notice, Cause::FaultInjected, 1.0));
        watch.apply_event(&event(7, Source::Controller, EventKind::Fault, Cause::TrackingLost, 1e-3));
        watch.apply_event(&safe_stop(2_000_000));
        (0..4).for_each(|i| watch.apply_sample(&sample(i * 1_000_000, i as f64 * 1e-3)));
        let found = watch.into_figures(None);
        assert!((found[0].deviation_mm - 2.0).abs() < 1e-12, "{found:?}");
        assert!(found[0].detection.unwrap().source == Source::Controller, "{found:?}");
    }

    #[test]
    fn a_deviation_that_is_no_number_is_infinite() {
        for bad in [0, 2] {
            let mut watch = FaultWatch::new(1);
            watch.apply_event(&event(0, Source::Wire, EventKind::Notice, Cause::FaultInjected, 1.0));
            (0..3).for_each(|i| watch.apply_sample(&sample(i, if i == bad { f64::NAN } else { 1e-5 })));
            let found = watch.into_figures(None);
            assert_eq!((found[0].deviation_mm, found[0].deviation_deg), (f64::INFINITY, f64::INFINITY));
        }
    }

    #[test]
    fn an_undetected_fault_is_followed_to_the_end_of_a_long_run() {
        let mut watch = FaultWatch::new(1);
        watch.apply_event(&event(5, Source::Wire, EventKind::Notice, Cause::FaultInjected, 1.0));
        (0..20_000).for_each(|i| watch.apply_sample(&sample(i, if i == 10 { 2e-3 } else { 1e-5 })));
        let found = watch.into_figures(None);
        assert!((found[0].deviation_mm - 2.0).abs() < 1e-12, "{found:?}");
    }
}
