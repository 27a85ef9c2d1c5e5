//! Each declared fault: when it first struck, what detected it and began a safe stop, and how far the platform left its path
//! until then.

use masseter_model::geometry::Deviation;
use masseter_runtime::messages::codes::{Cause, Source};
use masseter_scenario::ChecksConfig;
use serde::Serialize;

use crate::events::{AFTERMATH_NS, Code, EventRecord};
use crate::{breach::is_within, poses::worse, tracking::PathSample};

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
    /// Whether the jaw went beyond its limits while the fault acted, or shortly after.
    #[serde(skip)]
    pub led_off_path: bool,
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
    faults: Vec<Followed>,
    limits: ChecksConfig,
    /// Whether the jaw was beyond its limits in the last sample.
    is_off_path: bool,
    /// The beginnings of safe stops.
    stops: Vec<EventRecord>,
}

/// A declared fault, the deviation in its last sample, and when it last ended, ns.
#[derive(Debug, Clone, Default)]
struct Followed {
    figures: FaultFigures,
    last: Deviation,
    ended_ns: Option<u64>,
}

impl FaultWatch {
    pub(super) fn new(declared: usize, limits: ChecksConfig) -> Self {
        let figures = |number| FaultFigures { number, ..FaultFigures::default() };
        let faults =
            (1..=declared).map(|number| Followed { figures: figures(number), ..Followed::default() });
        Self { faults: faults.collect(), limits, ..Self::default() }
    }

    pub(super) fn apply_event(&mut self, event: &EventRecord) {
        if event.cause == Cause::FaultInjected {
            self.strike(event.value as usize, event.time_ns);
        }
        if event.cause == Cause::FaultEnded
            && let Some(fault) = self.fault(event.value as usize)
        {
            fault.ended_ns = Some(event.time_ns);
        }
        if event.begins_stop() && !self.faults.is_empty() {
            self.stops.push(event.clone());
        }
    }

    /// A fault of this number, from 1, has struck.
    pub(super) fn strike(&mut self, number: usize, time_ns: u64) {
        if let Some(Followed { figures, .. }) = self.fault(number) {
            figures.struck_ns = Some(figures.struck_ns.map_or(time_ns, |struck_ns| struck_ns.min(time_ns)));
        }
    }

    fn fault(&mut self, number: usize) -> Option<&mut Followed> {
        self.faults.get_mut(number.checked_sub(1)?)
    }

    /// Counts a sample for every fault that had struck, until the stop. The events of its time have come.
    pub(super) fn apply_sample(&mut self, sample: &PathSample) {
        let PathSample { sampled_ns, deviation, .. } = *sample;
        let (incisal_mm, angle_deg) = (deviation.incisal_m * 1e3, deviation.angle_rad.to_degrees());
        let is_off_path = !is_within(incisal_mm, self.limits.tracking_max_mm)
            || !is_within(angle_deg, self.limits.tracking_max_deg);
        let leaves_path = is_off_path && !self.is_off_path;
        self.is_off_path = is_off_path;
        for Followed { figures, last, ended_ns } in &mut self.faults {
            let Some(struck_ns) = figures.struck_ns.filter(|struck_ns| *struck_ns <= sampled_ns) else {
                continue;
            };
            if first_stop(&self.stops, struck_ns).is_none_or(|found| sampled_ns <= found.time_ns) {
                *last = deviation;
                figures.deviation_mm = worse(figures.deviation_mm, incisal_mm);
                figures.deviation_deg = worse(figures.deviation_deg, angle_deg);
                let acts =
                    ended_ns.is_none_or(|ended_ns| sampled_ns <= ended_ns.saturating_add(AFTERMATH_NS));
                figures.led_off_path |= leaves_path && acts;
            }
        }
    }

    /// `ended_ns`: when the controller had ended in order. A fault that strikes later tests nothing.
    pub(super) fn into_figures(self, ended_ns: Option<u64>) -> Vec<FaultFigures> {
        let first = first_stop(&self.stops, 0);
        let figures = |Followed { figures: mut fault, last, .. }: Followed| {
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
        let mut watch = FaultWatch::new(3, ChecksConfig::default());
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

    /// The jaw is off its path from 20 to 30 ms, and again from 900 ms on.
    #[test]
    fn the_faults_that_act_as_the_jaw_leaves_its_path_led_it_off() {
        let ms = 1_000_000;
        for (what, struck_ms, ended_ms, has_led_off) in [
            ("acts at the first time", 10, None, true),
            ("ended shortly before the first time", 10, Some(15), true),
            ("strikes while the jaw is off its path, and acts at the second time", 25, None, true),
            (
                "strikes while the jaw is off its path, and ended long before the second time",
                25,
                Some(35),
                false,
            ),
            ("acts at the second time alone", 500, None, true),
            ("strikes after both", 950, None, false),
        ] {
            let mut watch = FaultWatch::new(1, ChecksConfig::default());
            let notice = |ms_of, cause| event(ms_of * ms, Source::Wire, EventKind::Notice, cause, 1.0);
            for time_ms in 0..1000 {
                if time_ms == struck_ms {
                    watch.apply_event(&notice(time_ms, Cause::FaultInjected));
                }
                if Some(time_ms) == ended_ms {
                    watch.apply_event(&notice(time_ms, Cause::FaultEnded));
                }
                let is_off = (20..30).contains(&time_ms) || time_ms >= 900;
                watch.apply_sample(&sample(time_ms * ms, if is_off { 0.6e-3 } else { 1e-5 }));
            }
            assert_eq!(watch.into_figures(None)[0].led_off_path, has_led_off, "{what}");
        }
    }

    #[test]
    fn a_fault_that_strikes_after_the_controllers_end_has_not_acted() {
        for (ended_ns, struck_ns) in [(None, Some(5)), (Some(5), Some(5)), (Some(4), None)] {
            let mut watch = FaultWatch::new(1, ChecksConfig::default());
            watch.apply_event(&event(5, Source::Wire, EventKind::Notice, Cause::FaultInjected, 1.0));
            assert_eq!(watch.into_figures(ended_ns)[0].struck_ns, struck_ns, "{ended_ns:?}");
        }
    }

    #[test]
    fn the_controllers_safe_stop_is_one_and_its_other_steps_are_not() {
        let mut watch = FaultWatch::new(1, ChecksConfig::default());
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
            let mut watch = FaultWatch::new(1, ChecksConfig::default());
            watch.apply_event(&event(0, Source::Wire, EventKind::Notice, Cause::FaultInjected, 1.0));
            (0..3).for_each(|i| watch.apply_sample(&sample(i, if i == bad { f64::NAN } else { 1e-5 })));
            let found = watch.into_figures(None);
            assert_eq!((found[0].deviation_mm, found[0].deviation_deg), (f64::INFINITY, f64::INFINITY));
        }
    }

    #[test]
    fn an_undetected_fault_is_followed_to_the_end_of_a_long_run() {
        let mut watch = FaultWatch::new(1, ChecksConfig::default());
        watch.apply_event(&event(5, Source::Wire, EventKind::Notice, Cause::FaultInjected, 1.0));
        (0..20_000).for_each(|i| watch.apply_sample(&sample(i, if i == 10 { 2e-3 } else { 1e-5 })));
        let found = watch.into_figures(None);
        assert!((found[0].deviation_mm - 2.0).abs() < 1e-12, "{found:?}");
    }
}
