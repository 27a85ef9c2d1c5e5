//! Wake-ups, axes and buses of a run over time, for plots.

use masseter_can::Tapped;
use masseter_can::{Bitrate, wire};
use masseter_shared::geometry::AXES;
use masseter_shared::messages::Truth;

use super::series::{Curve, Extremes, Series};

/// A run over time: seconds since its first SYNC, and the lowest and the highest value of each stretch of time.
#[derive(Debug, Clone, Default)]
pub struct OverTime {
    /// The instant that curves count from, ns of the run's clock.
    pub began_ns: u64,
    /// Latest wake-up of the controller in each stretch, ns late.
    pub controller_late_ns: Curve,
    /// Latest wake-up of the plant in each stretch, ns late.
    pub plant_late_ns: Curve,
    /// Position of each axis, m.
    pub position_m: [Curve; AXES],
    /// Velocity of each axis, m/s.
    pub velocity_m_s: [Curve; AXES],
    /// Force of each actuator, N.
    pub force_n: [Curve; AXES],
    /// Share of each bus in use, 0 to 1.
    pub bus_load: Vec<Curve>,
}

/// Collects them.
#[derive(Debug, Default)]
pub(super) struct OverTimeCollector {
    began_ns: Option<u64>,
    late: Series<Extremes<2>>,
    axes: Series<Extremes<{ 3 * AXES }>>,
    /// Time that frames took on each bus.
    busy_ns: Vec<Series<u64>>,
    bitrate: Option<Bitrate>,
}

/// Indices of the two processes.
pub(super) const CONTROLLER: usize = 0;
pub(super) const PLANT: usize = 1;

impl OverTimeCollector {
    /// For buses of this bit rate; without one there is no load.
    pub(super) fn new(bitrate: Option<Bitrate>) -> Self {
        Self { bitrate, ..Self::default() }
    }

    fn since(&mut self, time_ns: u64) -> u64 {
        time_ns.saturating_sub(*self.began_ns.get_or_insert(time_ns))
    }

    pub(super) fn wake_up(&mut self, process: usize, due_ns: u64, woke_ns: u64) {
        let since_ns = self.since(due_ns);
        self.late.at(since_ns).take(process, woke_ns.saturating_sub(due_ns) as f64);
    }

    pub(super) fn truth(&mut self, truth: &Truth) {
        let since_ns = self.since(truth.sampled_ns);
        let stretch = self.axes.at(since_ns);
        let values = [truth.joint_m, truth.joint_m_s, truth.force_n];
        for (index, value) in values.into_iter().flatten().enumerate() {
            stretch.take(index, value);
        }
    }

    pub(super) fn frame(&mut self, time_ns: u64, bus: usize, tapped: &Tapped) {
        let since_ns = self.since(time_ns);
        if let Some((received, bitrate)) = tapped.frame().zip(self.bitrate) {
            let busy_ns = bitrate.bits_to_ns(wire::frame_bits(&received.frame));
            self.busy_ns.resize_with(self.busy_ns.len().max(bus + 1), Series::default);
            *self.busy_ns[bus].at(since_ns) += busy_ns;
        }
    }

    pub(super) fn finish(self) -> OverTime {
        let bands = |quantity: usize| std::array::from_fn(|axis| self.axes.band(quantity * AXES + axis));
        let load = |bus: &Series<u64>| {
            let full_ns = bus.width_s() * 1e9;
            bus.iter().map(|(at_s, busy_ns)| (at_s, *busy_ns as f64 / full_ns)).collect()
        };
        OverTime {
            began_ns: self.began_ns.unwrap_or(0),
            controller_late_ns: self.late.highest(CONTROLLER),
            plant_late_ns: self.late.highest(PLANT),
            position_m: bands(0),
            velocity_m_s: bands(1),
            force_n: bands(2),
            bus_load: self.busy_ns.iter().map(load).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use masseter_can::TappedFrame;
    use masseter_can::{Bitrate, CanId, Frame};

    use super::*;

    #[test]
    fn a_bus_that_is_half_full_is_said_to_be() {
        let frame = Frame::fixed(CanId::standard(0x123).unwrap(), [0x55; 8]);
        let bits = wire::frame_bits(&frame);
        let mut collector = OverTimeCollector::new(Some(Bitrate::new(2 * 1000 * bits).unwrap()));
        for millisecond in 0..1000 {
            let time_ns = millisecond * 1_000_000;
            collector.frame(time_ns, 0, &Tapped::Frame(TappedFrame { frame, time_ns, queued_ns: None }));
        }
        let over_time = collector.finish();
        assert_eq!(over_time.bus_load.len(), 1);
        assert!(over_time.bus_load[0].iter().all(|(_, share)| (share - 0.5).abs() < 1e-3));
    }
}
