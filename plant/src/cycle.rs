//! The order of the plant's cycle, the same in real time, in lockstep and under virtual time. The caller provides clock
//! and transport: see [`PlantPorts`].

use std::borrow::Borrow;

use masseter_runtime::messages::{Command, Contact, Reading, Truth};
use masseter_runtime::{clock::SECOND_NS, realtime::Wake, schedule::CycleSchedule};
use masseter_scenario::AFTER_STOP_S;

use crate::{core::PlantCore, error::PlantError, master::link::Link};

/// Source and destinations of the plant's messages, and the plant's waits.
pub trait PlantPorts<L: Link> {
    /// A command, owned or in shared memory.
    type Command: Borrow<Command>;
    /// The reason for an incomplete cycle.
    type Error: From<PlantError>;

    /// Now, ns.
    fn now_ns(&self) -> u64;

    /// Waits until `due_ns`, or longer if that saves spinning, but not beyond `latest_ns`; returns the time then.
    fn wait_until(&mut self, due_ns: u64, latest_ns: u64) -> u64;

    /// Waits until frames may have arrived, but not beyond `latest_ns`; returns the time.
    fn wait_for_frames(&mut self, link: &mut L, latest_ns: u64) -> u64;

    /// Publishes the reading that `fill` writes.
    ///
    /// # Errors
    /// When the message cannot be sent.
    fn publish_reading(&mut self, fill: impl FnOnce(&mut Reading)) -> Result<(), Self::Error>;

    /// Publishes the truth of the mechanism.
    ///
    /// # Errors
    /// When the message cannot be sent.
    fn publish_truth(&mut self, truth: &Truth) -> Result<(), Self::Error>;

    /// Publishes the forces between the jaws.
    ///
    /// # Errors
    /// When the message cannot be sent.
    fn publish_contact(&mut self, contact: &Contact) -> Result<(), Self::Error>;

    /// The command of this cycle; if late, the newest command, if any. `wake` is the cycle's SYNC.
    ///
    /// # Errors
    /// When the messages cannot be received.
    fn command(&mut self, wake: &Wake) -> Result<Option<Self::Command>, Self::Error>;

    /// Publishes the frames and events since the last call.
    ///
    /// # Errors
    /// When a message cannot be sent.
    fn publish_frames_and_events(&mut self, plant: &mut PlantCore<L>) -> Result<(), Self::Error>;
}

/// Runs one cycle: SYNC, process data, reading, truth, contact, command; then frames and events, which nobody waits
/// for.
///
/// ```
/// use masseter_plant::core::PlantCore;
/// use masseter_plant::cycle::{PlantPorts, run_cycle};
/// use masseter_plant::emulation::VirtualLink;
/// use masseter_runtime::realtime::Wake;
/// use masseter_runtime::schedule::CycleSchedule;
///
/// /// A second at 1 kHz, in simulated time.
/// fn run_second<P: PlantPorts<VirtualLink>>(
///     plant: &mut PlantCore,
///     ports: &mut P,
///     schedule: &CycleSchedule,
/// ) -> Result<(), P::Error> {
///     for cycle in 1..=1000 {
///         run_cycle(plant, ports, schedule, &Wake::on_time(cycle, (cycle - 1) * 1_000_000))?;
///     }
///     Ok(())
/// }
/// ```
///
/// # Errors
/// Those of the plant and of the ports.
pub fn run_cycle<L: Link, P: PlantPorts<L>>(
    plant: &mut PlantCore<L>,
    ports: &mut P,
    schedule: &CycleSchedule,
    wake: &Wake,
) -> Result<(), P::Error> {
    begin_cycle(plant, ports, schedule, wake)?;
    end_cycle(plant, ports, wake)
}

/// The first half of a cycle: SYNC, process data, reading, truth and contact. [`end_cycle`] must follow, once.
///
/// # Errors
/// Those of the plant and of the ports.
pub fn begin_cycle<L: Link, P: PlantPorts<L>>(
    plant: &mut PlantCore<L>,
    ports: &mut P,
    schedule: &CycleSchedule,
    wake: &Wake,
) -> Result<(), P::Error> {
    plant.begin_cycle(*wake)?;
    // Counted from the SYNC as sent, so that a late SYNC gives a late but complete reading.
    let reading_by_ns = wake.woke_ns + schedule.reading_by_ns;
    let mut now_ns = ports.wait_until(wake.woke_ns + schedule.reading_from_ns, reading_by_ns);
    while !plant.collect(now_ns)? && now_ns < reading_by_ns {
        now_ns = ports.wait_for_frames(&mut plant.link, reading_by_ns);
    }
    ports.publish_reading(|reading| plant.fill_reading(reading))?;
    if let Some(truth) = plant.truth() {
        ports.publish_truth(&truth)?;
    }
    if let Some(contact) = plant.contact() {
        ports.publish_contact(&contact)?;
    }
    Ok(())
}

/// The second half of a cycle that [`begin_cycle`] began: the command, if one came; then frames and events, for which
/// nobody waits.
///
/// # Errors
/// Those of the plant and of the ports.
pub fn end_cycle<L: Link, P: PlantPorts<L>>(
    plant: &mut PlantCore<L>,
    ports: &mut P,
    wake: &Wake,
) -> Result<(), P::Error> {
    let applied = ports
        .command(wake)
        .and_then(|command| Ok(plant.apply(ports.now_ns(), command.as_ref().map(Borrow::borrow))?));
    // Also after an error: these frames and events explain it.
    ports.publish_frames_and_events(plant).and(applied)
}

/// Fewest cycles after the controller's last one. The request to stop is sent in one cycle, takes effect in the next, and is
/// confirmed after the ramp.
const FEWEST_AFTER: u64 = 10;

/// Stops the drives, and runs the cycles after the controller's last one, without commands. The time is
/// [`AFTER_STOP_S`], so that the recording has a fall or a drift after the stop. `wait` waits for each cycle; skipped
/// cycles count.
///
/// # Errors
/// Those of the plant, of the ports and of the wait.
pub fn run_after_controller<L: Link, P: PlantPorts<L>>(
    plant: &mut PlantCore<L>,
    ports: &mut P,
    schedule: &CycleSchedule,
    period_ns: u64,
    mut wait: impl FnMut(&mut PlantCore<L>, &mut P) -> Result<Wake, P::Error>,
) -> Result<(), P::Error> {
    plant.master.stop();
    let last_cycle = plant.cycle + cycles_after(period_ns);
    while plant.cycle < last_cycle {
        let wake = wait(plant, ports)?;
        run_cycle(plant, ports, schedule, &wake)?;
    }
    Ok(())
}

/// Number of cycles of this period after the controller's last cycle.
fn cycles_after(period_ns: u64) -> u64 {
    ((AFTER_STOP_S * SECOND_NS as f64) as u64).div_ceil(period_ns).max(FEWEST_AFTER)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_after_the_controller_is_half_a_second_and_never_less_than_a_stop_takes() {
        assert_eq!([100_000, 1_000_000, 3_333_333, 100_000_000].map(cycles_after), [5000, 500, 151, 10]);
    }
}
