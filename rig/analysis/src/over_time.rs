//! Wake-ups, axes and buses of a run over time, for plots.

use masseter_can::Tapped;
use masseter_can::{Bitrate, wire};
use masseter_shared::geometry::AXES;
use masseter_shared::messages::{Reading, State, Truth};

use super::series::{Extremes, Merge, Series, Sums};

/// A curve: seconds since the run's first SYNC, and values.
pub type Curve = Vec<(f64, f64)>;

/// Lowest and highest value of each stretch of time, as one curve that touches both.
type Band = Curve;

/// A run over time.
#[derive(Debug, Clone, Default)]
pub struct OverTime {
    /// The instant that curves count from, ns of the run's clock.
    pub began_ns: u64,
    /// Latest wake-up of the controller in each stretch, ns late.
    pub controller_late_ns: Curve,
    /// Latest wake-up of the plant in each stretch, ns late.
    pub plant_late_ns: Curve,
    /// Position of each axis, m.
    pub position_m: [Band; AXES],
    /// Velocity of each axis, m/s.
    pub velocity_m_s: [Band; AXES],
    /// Force of each actuator, N.
    pub force_n: [Band; AXES],
    /// Share of each bus in use, 0 to 1.
    pub bus_load: Vec<Curve>,
}

/// Collects them.
#[derive(Debug, Default)]
pub(super) struct Watch {
    began_ns: Option<u64>,
    late: Series<Extremes<2>>,
    axes: Series<Extremes<{ 3 * AXES }>>,
    /// Time that frames took on each bus.
    busy_ns: Series<Sums>,
    bitrate: Option<Bitrate>,
}

const CONTROLLER: usize = 0;
const PLANT: usize = 1;

impl Watch {
    /// For buses of this bit rate; without one there is no load.
    pub(super) fn new(bitrate: Option<Bitrate>) -> Self {
        Self { bitrate, ..Self::default() }
    }

    fn since(&mut self, time_ns: u64) -> u64 {
        time_ns.saturating_sub(*self.began_ns.get_or_insert(time_ns))
    }

    pub(super) fn reading(&mut self, reading: &Reading) {
        let since_ns = self.since(reading.due_ns);
        self.late.at(since_ns).take(PLANT, reading.woke_ns.saturating_sub(reading.due_ns) as f64);
    }

    pub(super) fn state(&mut self, state: &State) {
        let since_ns = self.since(state.due_ns);
        self.late.at(since_ns).take(CONTROLLER, state.woke_ns.saturating_sub(state.due_ns) as f64);
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
            self.busy_ns.at(since_ns).add(bus, busy_ns);
        }
    }

    pub(super) fn finish(self) -> OverTime {
        let bands = |quantity: usize| std::array::from_fn(|axis| band(&self.axes, quantity * AXES + axis));
        let buses = self.busy_ns.iter().map(|(_, sums)| sums.0.len()).max().unwrap_or(0);
        let full_ns = self.busy_ns.width_s() * 1e9;
        let load = |bus: usize| {
            let share = |sums: &Sums| sums.0.get(bus).map_or(0.0, |busy_ns| *busy_ns as f64 / full_ns);
            self.busy_ns.iter().map(|(at_s, sums)| (at_s, share(sums))).collect()
        };
        OverTime {
            began_ns: self.began_ns.unwrap_or(0),
            controller_late_ns: highest(&self.late, CONTROLLER),
            plant_late_ns: highest(&self.late, PLANT),
            position_m: bands(0),
            velocity_m_s: bands(1),
            force_n: bands(2),
            bus_load: (0..buses).map(load).collect(),
        }
    }
}

/// Highest value of each stretch of time.
pub(super) fn highest<const N: usize>(series: &Series<Extremes<N>>, index: usize) -> Curve {
    let points = series.iter().map(|(at_s, stretch)| (at_s, stretch.highest[index]));
    points.filter(|(_, value)| value.is_finite()).collect()
}

pub(super) fn band<const N: usize>(series: &Series<Extremes<N>>, index: usize) -> Band
where
    Extremes<N>: Merge,
{
    let ends = series
        .iter()
        .flat_map(|(at_s, stretch)| [(at_s, stretch.lowest[index]), (at_s, stretch.highest[index])]);
    ends.filter(|(_, value)| value.is_finite()).collect()
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
        let mut watch = Watch::new(Some(Bitrate::new(2 * 1000 * bits).unwrap()));
        for millisecond in 0..1000 {
            let time_ns = millisecond * 1_000_000;
            watch.frame(time_ns, 0, &Tapped::Frame(TappedFrame { frame, time_ns, queued_ns: None }));
        }
        let over_time = watch.finish();
        assert_eq!(over_time.bus_load.len(), 1);
        assert!(over_time.bus_load[0].iter().all(|(_, share)| (share - 0.5).abs() < 1e-3));
    }
}
