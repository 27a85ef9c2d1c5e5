//! Time of the buses' messages from their queueing to their arrival, beside the bounds of the plan.
//!
//! A bound holds for undisturbed buses. A late process may queue messages closer together than planned; then the plan
//! is worked out again for the closest queueing. Real interfaces do not report when a frame was queued.
//!
//! A stall queues messages far off their times. The bound does not hold for the frames of that cycle and of the next
//! two. They are counted and not judged.

use masseter_can::{BusPlan, CanId, PeriodicMessage, PlannedMessage, Tapped, canopen::Cob};
use masseter_runtime::{messages::FrameTap, schedule::plans};
use masseter_scenario::{Scenario, wording::counted};
use serde::Serialize;

/// The longest response time of a message.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ResponseFigures {
    /// Index of the bus.
    pub bus: usize,
    /// Its name in the plan; `other` for all messages that are in no plan: SDO, NMT, emergencies.
    pub message: String,
    /// Frames whose time of queueing is known.
    pub frames: u64,
    /// Longest time from being queued to the end of the frame; none without such frames, ns.
    pub max_ns: Option<u64>,
    /// The bound, ns: by the plan, or by the closest queueing if messages were queued closer together than planned.
    /// None without a bound.
    pub bound_ns: Option<u64>,
}

impl ResponseFigures {
    /// Whether a frame took longer than the bound.
    pub fn exceeds(&self) -> bool {
        self.max_ns.zip(self.bound_ns).is_some_and(|(max_ns, bound_ns)| max_ns > bound_ns)
    }

    /// Share of the bound that was used.
    pub fn share(&self) -> Option<f64> {
        self.max_ns.zip(self.bound_ns).map(|(max_ns, bound_ns)| max_ns as f64 / bound_ns as f64)
    }
}

/// Response times of all buses.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct BusResponse {
    /// The messages of each bus, the most urgent first.
    pub messages: Vec<ResponseFigures>,
    /// Frames queued off their times by a stall, and those beside them, which are not judged.
    pub off_time_frames: u64,
    /// Why there are no bounds for this run; `None` if there are.
    pub unbounded: Option<String>,
}

impl BusResponse {
    /// Messages that took longer than their bound.
    pub fn exceeding(&self) -> impl Iterator<Item = &ResponseFigures> {
        self.messages.iter().filter(|message| message.exceeds())
    }

    /// The message that used most of its bound.
    pub fn tightest(&self) -> Option<&ResponseFigures> {
        let shares = self.messages.iter().filter_map(|message| Some((message, message.share()?)));
        shares.max_by(|(_, one), (_, other)| one.total_cmp(other)).map(|(message, _)| message)
    }
}

/// Share of a cycle by which a message may come early, and SYNC late. The default buses are in use for up to seven eighths.
const JITTER: f64 = 0.1;
/// Cycles after a message off its time in which the bus may still be crowded.
const CROWDED_CYCLES: u64 = 2;
/// Fewest frames at their times by which a bus with other frames is judged.
const FEWEST_ON_TIME: u64 = 10;

/// Why runs of some scenarios have no bounds.
const FAULTS: &str = "the scenario's faults are in no plan";
const NOT_RECORDED: &str = "the CAN frames are not recorded (recording.frames = false)";

/// Follows every frame.
#[derive(Debug, Clone, Default)]
pub(super) struct Responses {
    buses: Vec<Followed>,
    /// Why no run of the scenario has bounds.
    unbounded: Option<&'static str>,
}

/// One bus.
#[derive(Debug, Clone)]
struct Followed {
    plan: BusPlan,
    /// In the order of the plan's messages.
    messages: Vec<Seen>,
    others: Seen,
    /// Whether or not the time of queueing is known.
    frames: u64,
    error_frames: u64,
    /// Frames off their times, and until when others are counted as such, ns.
    off_time: u64,
    off_time_until_ns: u64,
    /// Frames since the last SYNC: they are judged once the next SYNC shows that no stall was among them.
    pending: Vec<Pending>,
}

/// A frame that is not judged yet: its place in the plan, none for others, and its times.
#[derive(Debug, Clone, Copy)]
struct Pending {
    planned: Option<usize>,
    queued_ns: u64,
    arrived_ns: u64,
}

/// Times of a message on the bus.
#[derive(Debug, Clone, Copy, Default)]
struct Seen {
    frames: u64,
    max_ns: Option<u64>,
    last_queued_ns: Option<u64>,
    last_judged_ns: Option<u64>,
    /// The least time between two of it being queued.
    least_period_ns: Option<u64>,
}

impl Seen {
    /// A frame off its time is counted only.
    fn count_frame(&mut self, queued_ns: u64, arrived_ns: u64, is_off_time: bool) {
        self.frames += 1;
        let last_ns = self.last_judged_ns.replace(queued_ns);
        if is_off_time {
            return;
        }
        self.max_ns = self.max_ns.max(Some(arrived_ns.saturating_sub(queued_ns)));
        if let Some(last_ns) = last_ns {
            let period_ns = queued_ns.saturating_sub(last_ns);
            self.least_period_ns = Some(self.least_period_ns.map_or(period_ns, |least| least.min(period_ns)));
        }
    }

    fn figures(&self, bus: usize, message: &str, bound_ns: Option<u64>) -> ResponseFigures {
        let Self { frames, max_ns, .. } = *self;
        ResponseFigures { bus, message: message.to_owned(), frames, max_ns, bound_ns }
    }
}

impl Responses {
    /// On the buses of a rig that was accepted; without plans there are no figures.
    pub(super) fn for_scenario(scenario: &Scenario) -> Self {
        if !scenario.recording.frames {
            return Self::with(Vec::new(), Some(NOT_RECORDED));
        }
        let plans = plans(scenario).unwrap_or_default();
        Self::with(plans, (!scenario.faults.is_empty()).then_some(FAULTS))
    }

    fn with(plans: Vec<BusPlan>, unbounded: Option<&'static str>) -> Self {
        let followed = |plan: BusPlan| Followed {
            messages: vec![Seen::default(); plan.messages.len()],
            plan,
            others: Seen::default(),
            frames: 0,
            error_frames: 0,
            off_time: 0,
            off_time_until_ns: 0,
            pending: Vec::new(),
        };
        Self { buses: plans.into_iter().map(followed).collect(), unbounded }
    }

    /// `tapped`: what `tap` holds.
    pub(super) fn apply_frame(&mut self, tap: &FrameTap, bus: usize, tapped: &Tapped) {
        let Some(bus) = self.buses.get_mut(bus) else { return };
        let planned = bus.plan.messages.iter().position(|planned| planned.message.id.flagged() == tap.id);
        if planned.is_none() && matches!(tapped, Tapped::Error(_)) {
            bus.error_frames += 1;
            return;
        }
        bus.frames += 1;
        if tap.queued_ns > 0 {
            bus.add_frame(planned, tap.queued_ns, tap.time_ns);
        }
    }

    /// `missing`: frames that were not recorded.
    pub(super) fn into_figures(mut self, missing: u64) -> BusResponse {
        self.buses.iter_mut().for_each(Followed::judge_cycle);
        let unbounded = self.unbounded(missing);
        let figures = |bus: &Followed| bus.figures(&bus.bounds_ns(unbounded.is_none()));
        let messages = self.buses.iter().flat_map(figures).collect();
        let off_time_frames = self.buses.iter().map(|bus| bus.off_time).sum();
        BusResponse { messages, off_time_frames, unbounded }
    }

    /// Why there are no bounds for this run.
    fn unbounded(&self, missing: u64) -> Option<String> {
        if let Some(why) = self.unbounded {
            return Some(why.to_owned());
        }
        if missing > 0 {
            return Some(format!("the recording lacks {}", counted(missing, "frame")));
        }
        self.buses.iter().find_map(Followed::unbounded)
    }
}

impl Followed {
    /// Takes a frame of a planned message, by its place in the plan, or another one.
    fn add_frame(&mut self, planned: Option<usize>, queued_ns: u64, arrived_ns: u64) {
        let is_off_time = planned.is_some_and(|index| self.is_off_time(index, queued_ns));
        if is_off_time {
            self.off_time_until_ns = queued_ns + CROWDED_CYCLES * self.plan.cycle_ns;
        }
        if planned.is_some_and(|index| self.is_sync(index)) {
            self.judge_cycle();
        }
        self.pending.push(Pending { planned, queued_ns, arrived_ns });
        if let Some(index) = planned {
            self.messages[index].last_queued_ns = Some(queued_ns);
        }
    }

    /// Judges the frames of a cycle, unless they or the next SYNC are off their times.
    fn judge_cycle(&mut self) {
        let mut pending = std::mem::take(&mut self.pending);
        for Pending { planned, queued_ns, arrived_ns } in pending.drain(..) {
            let is_off_time = queued_ns < self.off_time_until_ns;
            self.off_time += u64::from(is_off_time);
            let seen = planned.map_or(&mut self.others, |index| &mut self.messages[index]);
            seen.count_frame(queued_ns, arrived_ns, is_off_time);
        }
        self.pending = pending;
    }

    fn is_sync(&self, index: usize) -> bool {
        self.plan.messages[index].message.id == CanId::from(Cob::Sync)
    }

    /// Whether a message of every cycle comes too soon after the last one, or SYNC too late.
    fn is_off_time(&self, index: usize, queued_ns: u64) -> bool {
        let (message, cycle_ns) = (&self.plan.messages[index].message, self.plan.cycle_ns);
        let Some(last_ns) = self.messages[index].last_queued_ns else { return false };
        let interval = queued_ns.saturating_sub(last_ns) as f64 / cycle_ns as f64;
        let is_early = message.period_ns == cycle_ns && interval < 1.0 - JITTER;
        is_early || (self.is_sync(index) && interval > 1.0 + JITTER)
    }

    fn figures(&self, bounds_ns: &[Option<u64>]) -> Vec<ResponseFigures> {
        let bus = self.plan.bus;
        let planned = self.plan.messages.iter().zip(&self.messages).zip(bounds_ns);
        let planned =
            planned.map(|((planned, seen), bound_ns)| seen.figures(bus, &planned.message.name, *bound_ns));
        planned.chain([self.others.figures(bus, "other", None)]).collect()
    }

    /// For the plan's messages, both as planned and as they were queued.
    fn bounds_ns(&self, are_bounded: bool) -> Vec<Option<u64>> {
        let as_queued = self.plan_as_queued();
        let both = self.plan.messages.iter().zip(&as_queued.messages);
        let bound_ns = |(planned, queued): (&PlannedMessage, &PlannedMessage)| {
            let (planned_ns, queued_ns) = planned.response_ns.zip(queued.response_ns)?;
            are_bounded.then_some(planned_ns.max(queued_ns))
        };
        both.map(bound_ns).collect()
    }

    /// Why there are no bounds here.
    fn unbounded(&self) -> Option<String> {
        let bus = self.plan.bus;
        if self.frames == 0 {
            return Some(format!("no frame of bus {bus} was recorded"));
        }
        if self.messages.iter().all(|seen| seen.frames == 0) {
            return Some(format!("bus {bus}: its recording lacks the queuing times of the frames"));
        }
        if self.error_frames > 0 {
            return Some(format!("bus {bus} had {}", counted(self.error_frames, "error")));
        }
        if self.off_time > 0 && self.frames - self.off_time < FEWEST_ON_TIME {
            return Some(format!(
                "{} of {} frames of bus {bus} were early or late beside a stall",
                self.off_time, self.frames
            ));
        }
        let as_queued = self.plan_as_queued();
        let unbounded = as_queued.messages.iter().find(|queued| queued.response_ns.is_none())?;
        let name = &unbounded.message.name;
        Some(format!("messages of bus {bus} were queued so close together that {name} has no bound"))
    }

    /// The plan for messages as close to each other as they were queued, whoever released them.
    fn plan_as_queued(&self) -> BusPlan {
        let as_queued = |(planned, seen): (&PlannedMessage, &Seen)| {
            let message = planned.message.clone();
            let period_ns =
                seen.least_period_ns.map_or(message.period_ns, |ns| ns.clamp(1, message.period_ns));
            PeriodicMessage { period_ns, release: None, ..message }
        };
        let messages = self.plan.messages.iter().zip(&self.messages).map(as_queued).collect();
        BusPlan::new(self.plan.bus, self.plan.bitrate, self.plan.cycle_ns, messages)
            .expect("no message has a releaser")
    }
}

#[cfg(test)]
mod tests;
