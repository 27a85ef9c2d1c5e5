//! Whether the jaw is at rest after every stop: a safe stop, one by request, the end of the motion, and the loss of power.
//!
//! A stop begins with the first drive that is no longer enabled, a stop by the master, or the end of the controller's
//! motion. From then on the way of each axis counts from where its drive lost power, and that of the jaw from where the
//! last drive lost it: of the true mechanism where it is emulated, otherwise of the encoders.

use masseter_model::geometry::{AXES, AXIS_NAMES, Deviation, Pose};
use masseter_recording::Ending;
use masseter_runtime::clock::{MILLISECOND_NS, SECOND_NS};
use masseter_runtime::messages::Reading;
use masseter_runtime::messages::codes::{ControllerState, drive_state};
use masseter_scenario::{AFTER_STOP_S, ChecksConfig, Scenario};
use serde::Serialize;

use crate::breach::{Bound, Breach};
use crate::check::Check;
use crate::poses::{are_enabled, true_pose, worse};
use crate::signals::{CycleMessages, Sample};

/// How far the mechanism moved after its stops.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct StandstillFigures {
    /// For how long the last stop was recorded, s; none without a stop.
    pub recorded_s: Option<f64>,
    /// The largest way of each axis after a stop, mm.
    pub axes_mm: [f64; AXES],
    /// The largest way of the incisal point, mm; `None` if the true jaw is unknown.
    pub jaw_mm: Option<f64>,
    /// The largest angle of the platform, degrees.
    pub jaw_deg: Option<f64>,
    /// The largest way of the incisal point, mm, and angle of the platform, degrees, once the brakes have had the time to close.
    #[serde(skip)]
    pub settled: [f64; 2],
    /// When a way was first beyond its limit.
    #[serde(skip)]
    pub first: Option<Breach>,
}

/// Longest time from the stop to the loss of power; a drive that is not heard of says nothing of its power, ns.
const POWER_OFF_WITHIN_NS: u64 = 100 * MILLISECOND_NS;
/// From the stop until an axis that ran into its brake is at rest, ns.
const SETTLED_NS: u64 = 150 * MILLISECOND_NS;
/// Share of the time after the stop that must be recorded: a plant that loses cycles records a little less.
const LEAST_SHARE: f64 = 0.9;

/// Watches the mechanism after each stop.
#[derive(Debug, Clone, Default)]
pub(super) struct StandstillWatch {
    has_truth: bool,
    /// The incisal point in the platform frame.
    incisal_m: [f64; 3],
    /// From the loss of power until an axis must stand, ns.
    reaction_ns: [u64; AXES],
    is_at_work: bool,
    stop: Option<Stop>,
    limits: ChecksConfig,
    figures: StandstillFigures,
}

/// The present stop.
#[derive(Debug, Clone, Copy)]
struct Stop {
    began_ns: u64,
    /// When each drive lost power, ns.
    off_ns: [Option<u64>; AXES],
    /// Where each axis must stay, m.
    places_m: [Option<f64>; AXES],
    jaw: Option<Pose>,
    /// Where the jaw was once it must have settled.
    settled: Option<Pose>,
}

impl StandstillWatch {
    pub(super) fn new(scenario: &Scenario) -> Self {
        let reaction_s =
            |axis| scenario.checks.standstill_after_ms / 1e3 + scenario.profile(axis).brake.close_s;
        Self {
            has_truth: scenario.can.is_virtual(),
            incisal_m: scenario.jaw.reference_point_m,
            reaction_ns: std::array::from_fn(|axis| (reaction_s(axis) * SECOND_NS as f64) as u64),
            limits: scenario.checks,
            ..Self::default()
        }
    }

    /// Takes the next sample in the order of time.
    pub(super) fn add_sample(&mut self, Sample { time_ns, messages, is_closing, .. }: &Sample) {
        if let Some(reading) = &messages.reading {
            self.follow(*time_ns, reading, messages.controller_state);
        }
        let Some(stop) = self.stop.as_mut().filter(|_| !is_closing) else { return };
        let since_ns = time_ns.saturating_sub(stop.began_ns);
        // A time in which an axis is unseen shows no standstill.
        let has_all = (0..AXES).all(|axis| place_m(messages, axis, self.has_truth).is_some());
        let recorded_s = self.figures.recorded_s.get_or_insert(0.0);
        if has_all {
            *recorded_s = since_ns as f64 / SECOND_NS as f64;
        }
        for (axis, most_mm) in self.figures.axes_mm.iter_mut().enumerate() {
            let Some(place_m) = place_m(messages, axis, self.has_truth) else { continue };
            if *time_ns >= stop.due_ns(axis) + self.reaction_ns[axis] {
                let way_m = (place_m - *stop.places_m[axis].get_or_insert(place_m)).abs();
                *most_mm = worse(*most_mm, way_m * 1e3);
            }
        }
        let is_due = stop.places_m.iter().all(Option::is_some);
        if let Some(pose) = messages.truth.as_ref().filter(|_| is_due).and_then(true_pose) {
            let moved = Deviation::between(&pose, stop.jaw.get_or_insert(pose), self.incisal_m);
            let StandstillFigures { jaw_mm, jaw_deg, .. } = &mut self.figures;
            *jaw_mm = Some(worse(jaw_mm.unwrap_or(0.0), moved.incisal_m * 1e3));
            *jaw_deg = Some(worse(jaw_deg.unwrap_or(0.0), moved.angle_rad.to_degrees()));
            if since_ns >= SETTLED_NS {
                let moved = Deviation::between(&pose, stop.settled.get_or_insert(pose), self.incisal_m);
                let [mm, deg] = &mut self.figures.settled;
                *mm = worse(*mm, moved.incisal_m * 1e3);
                *deg = worse(*deg, moved.angle_rad.to_degrees());
            }
        }
        self.figures.note_breach(*time_ns, &self.limits);
    }

    /// Notes a stop, the end of one, and the loss of power.
    fn follow(&mut self, time_ns: u64, reading: &Reading, controller_state: Option<u32>) {
        let is_at_work = are_enabled(reading) && reading.master_fault == 0 && !is_over(controller_state);
        if is_at_work {
            self.stop = None;
        } else if self.is_at_work {
            let (off_ns, places_m) = ([None; AXES], [None; AXES]);
            self.stop = Some(Stop { began_ns: time_ns, off_ns, places_m, jaw: None, settled: None });
            self.figures.recorded_s = Some(0.0);
        }
        self.is_at_work = is_at_work;
        for (code, off_ns) in
            reading.drive_state.iter().zip(self.stop.iter_mut().flat_map(|stop| &mut stop.off_ns))
        {
            if matches!(drive_state(*code), Ok(Some(state)) if !state.is_powered()) {
                off_ns.get_or_insert(time_ns);
            }
        }
    }

    pub(super) fn into_figures(self) -> StandstillFigures {
        self.figures
    }
}

impl Stop {
    /// From when on an axis that needs no time to react must stand, ns.
    fn due_ns(&self, axis: usize) -> u64 {
        let latest_ns = self.began_ns + POWER_OFF_WITHIN_NS;
        self.off_ns[axis].map_or(latest_ns, |off_ns| off_ns.min(latest_ns))
    }
}

impl StandstillFigures {
    /// The largest ways, each beside its limit.
    fn ways(&self, limits: &ChecksConfig) -> Vec<Bound> {
        let ChecksConfig { standstill_axis_mm, standstill_jaw_mm, standstill_jaw_deg, .. } = *limits;
        let way = |what, value, limit, unit| Bound { what, value, limit, unit, digits: 3 };
        let jaw = [
            self.jaw_mm.map(|most| way("incisal point", most, standstill_jaw_mm, " mm")),
            self.jaw_deg.map(|most| way("platform", most, standstill_jaw_deg, "°")),
        ];
        let axes = AXIS_NAMES.iter().zip(self.axes_mm);
        let axes = axes.map(|(name, most)| way(name, most, standstill_axis_mm, " mm"));
        jaw.into_iter().flatten().chain(axes).collect()
    }

    /// Notes the first way beyond its limit.
    fn note_breach(&mut self, time_ns: u64, limits: &ChecksConfig) {
        if self.first.is_none() {
            let beyond = self.ways(limits).into_iter().find(Bound::is_beyond);
            self.first = beyond.map(|way| way.breach(" moved after the stop").at(time_ns));
        }
    }
}

/// Whether the controller says that the motion is over.
fn is_over(state: Option<u32>) -> bool {
    use ControllerState::{Disabling, Finished, SafeStop};
    [Disabling, Finished, SafeStop].iter().any(|over| state == Some(over.code()))
}

/// Where an axis is in a cycle, m; `None` if its message is missing.
fn place_m(messages: &CycleMessages, axis: usize, has_truth: bool) -> Option<f64> {
    if has_truth {
        return messages.truth.as_ref().map(|truth| truth.joint_m[axis]);
    }
    let reading = messages.reading.as_ref()?;
    (reading.fresh_axes >> axis & 1 == 1).then_some(reading.position_m[axis])
}

/// None in a run without a stop. A recording that ends soon after the stop shows no fall.
pub(super) fn standstill(
    found: &StandstillFigures,
    ending: &Ending,
    is_partial: bool,
    limits: &ChecksConfig,
) -> Option<Check> {
    const NAME: &str = "standstill";
    let recorded_s = found.recorded_s?;
    let ways = found.ways(limits);
    let beyond: Vec<_> = ways.iter().filter(|way| way.is_beyond()).map(ToString::to_string).collect();
    if !beyond.is_empty() {
        let check = Check::judged(NAME, format!("moved after the stop: {}", beyond.join("; ")), false);
        return Some(check.with_breach(found.first.clone()));
    }
    if recorded_s < AFTER_STOP_S * LEAST_SHARE {
        let why = format!("recorded for {recorded_s:.3} s after the stop, {AFTER_STOP_S} s needed");
        let is_whole =
            matches!(ending, Ending::Completed | Ending::SafeStop | Ending::Overdue) && !is_partial;
        return Some(if is_whole { Check::untested(NAME, why) } else { Check::not_judged(NAME, why) });
    }
    let closest = ways.iter().max_by(|a, b| a.share().total_cmp(&b.share()));
    let closest = closest.map_or_else(String::new, ToString::to_string);
    Some(Check::judged(NAME, format!("{closest}; observed for {recorded_s:.2} s after the stop"), true))
}

#[cfg(test)]
mod tests;
