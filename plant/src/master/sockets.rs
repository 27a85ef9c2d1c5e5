//! The link to real drives: SocketCAN interfaces. This link has no truth of the mechanism.
//!
//! An interface has one master, because two masters stop each other's drives. The lock is a name among the abstract
//! sockets. Abstract sockets belong to a network namespace, as interfaces do, and end with their process. The lock does
//! not exclude masters of other programs or other computers; the master notices those by their frames.

use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::{io::ErrorKind, ops::Range, os::linux::net::SocketAddrExt};

use masseter_can::faults::FaultNote;
use masseter_can::{
    Bus, InterfaceNeeds, JudgedInterface, OpenError, PortFaults, ReceiveError, SocketCan, Tapped,
};
use masseter_model::geometry::AXES;
use masseter_runtime::{clock, injection::Injected, realtime::Waiter};
use masseter_scenario::{CanConfig, MASTER_NODE, Scenario};

use super::link::{Buses, Link, MASTER_PORT, check_quantities, fault_seed, faults_of_bus, restart_after_ns};
use crate::error::PlantError;

/// Longest wait for a real frame, ns. A fault may hold frames back that are due before the next arrival.
const LONGEST_BLOCK_NS: u64 = 100_000;

/// Judges the interfaces of a scenario. One that does not exist is left out: its opening fails with the reason.
///
/// # Errors
/// [`PlantError::Unfit`] for an interface whose settings cannot be read.
pub fn judge_interfaces(can: &CanConfig) -> Result<Vec<JudgedInterface>, PlantError> {
    let judged = |(name, drives): (&String, &Vec<usize>)| {
        // SYNC, SDO and heartbeat; for each drive process data, or NMT at its start.
        let frames = 3 + 2 * drives.len() as u32;
        match JudgedInterface::read(name, InterfaceNeeds { bitrate_bps: can.bitrate_bps, frames }) {
            Err(error) if error.kind() == ErrorKind::NotFound => None,
            judged => Some(judged.map_err(|error| {
                let words = format!("the settings of {name} cannot be read ({error}); allow netlink sockets");
                PlantError::Unfit(vec![words])
            })),
        }
    };
    can.interfaces.iter().zip(&can.buses).filter_map(judged).collect()
}

/// Refuses interfaces over which nothing may be sent.
pub(crate) fn refuse_unfit(can: &CanConfig) -> Result<(), PlantError> {
    let faults: Vec<_> = judge_interfaces(can)?.into_iter().flat_map(|judged| judged.faults).collect();
    if faults.is_empty() { Ok(()) } else { Err(PlantError::Unfit(faults)) }
}

/// The master's port, its faults, and a tap on every wire.
#[derive(Debug)]
pub struct SocketLink {
    ports: Vec<SocketCan>,
    faults: Vec<PortFaults>,
    taps: Vec<SocketCan>,
    _locks: Vec<UnixDatagram>,
}

impl SocketLink {
    /// Opens the scenario's interfaces, one a bus, with the faults of the master's ports from `now_ns` on. Nothing is sent,
    /// and nothing ever will be on an interface that is unfit.
    pub(crate) fn open(scenario: &Scenario, now_ns: u64) -> Result<Self, PlantError> {
        check_quantities(scenario)?;
        let can = &scenario.can;
        let faults_of_port = |bus: usize| {
            let faults = faults_of_bus(scenario, bus, &[MASTER_NODE], now_ns)?;
            let (seed, restart_after_ns) = (fault_seed(scenario, bus), restart_after_ns(can));
            Ok(PortFaults::new(faults, MASTER_PORT, seed, restart_after_ns)?)
        };
        refuse_unfit(can)?;
        let faults = (0..can.buses.len()).map(faults_of_port).collect::<Result<_, PlantError>>()?;
        let port = |interface: &String| SocketCan::open(interface);
        let open = || can.interfaces.iter().map(port).collect::<Result<_, _>>();
        let (ports, taps) = (open()?, open()?);
        let locks = can.interfaces.iter().map(|interface| lock(interface)).collect::<Result<_, _>>()?;
        Ok(Self { ports, faults, taps, _locks: locks })
    }
}

impl Buses for SocketLink {
    fn port(&mut self, bus: usize) -> impl Bus {
        self.faults[bus].over(&mut self.ports[bus])
    }
}

impl Link for SocketLink {
    fn tap(&mut self, bus: usize, _: u64) -> Result<Option<Tapped>, ReceiveError> {
        self.taps[bus].tap()
    }

    fn next_note(&mut self, bus: usize, now_ns: u64) -> Option<FaultNote> {
        self.faults[bus].next_note(now_ns)
    }

    fn set_window(&mut self, injected: Injected, window_ns: Range<u64>) {
        if let Injected::Fault(number) = injected {
            self.faults.iter_mut().for_each(|port| port.set_fault_window(number, window_ns.clone()));
        }
    }

    fn wait(&mut self, latest_ns: u64, waiter: &mut Waiter) -> u64 {
        let until_ns = latest_ns.min(clock::now_ns() + LONGEST_BLOCK_NS);
        waiter.until_woken(until_ns, latest_ns, |until_ns| SocketCan::wait::<AXES>(&self.ports, until_ns))
    }
}

/// Locks an interface: the right to be its master, until the socket is dropped.
pub(super) fn lock(interface: &str) -> Result<UnixDatagram, PlantError> {
    let name = SocketAddr::from_abstract_name(format!("masseter-master-{interface}"));
    name.and_then(|name| UnixDatagram::bind_addr(&name)).map_err(|error| {
        let interface = interface.to_owned();
        match error.kind() {
            ErrorKind::AddrInUse => PlantError::MasterHere(interface),
            _ => OpenError::Os(interface, error.raw_os_error().unwrap_or_default()).into(),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interface_whose_settings_are_unknown_is_refused() {
        let of = |name: &str| {
            let can = Scenario::default().can;
            judge_interfaces(&CanConfig { interfaces: vec![name.to_owned()], ..can })
        };
        assert_eq!(of("nocan9"), Ok(vec![]), "its opening says that it does not exist");
        let error = of("lo/ifindex").unwrap_err();
        assert!(error.to_string().contains("the settings of lo/ifindex cannot be read"), "{error}");
    }

    #[test]
    fn an_interface_has_one_master_until_it_is_gone() {
        let interface = format!("test{}", std::process::id());
        let first = lock(&interface).unwrap();
        let refused = lock(&interface).unwrap_err();
        assert_eq!(refused, PlantError::MasterHere(interface.clone()));
        assert!(lock(&format!("{interface}b")).is_ok());
        drop(first);
        assert!(lock(&interface).is_ok());
    }
}
