//! The connection between master and drives, as the plant sees it: [`Buses`] for the master, [`Link`] for the core.
//!
//! [`sockets`] connects the master to real interfaces; the emulation brings simulated wires of its own. [`layout`]
//! assigns drives to buses, [`faults`] assigns faults to them.

use std::ops::Range;

use masseter_can::faults::FaultNote;
use masseter_can::{Bus, ReceiveError, Tapped};
use masseter_runtime::injection::Injected;
use masseter_runtime::messages::{Contact, Truth};
use masseter_runtime::realtime::Waiter;

use crate::injection::{Mishap, Occurrence};
use crate::mechanism::DynamicsError;

pub(crate) mod faults;
mod interface_lock;
pub(crate) mod layout;
pub(crate) mod sockets;

/// The wires that a master serves.
pub trait Buses {
    /// The master's port on a wire.
    fn port(&mut self, bus: usize) -> impl Bus;
}

/// The wires of a plant: the master's ports, taps, and the truth of emulated drives.
pub trait Link: Buses {
    /// Simulates everything up to `until_ns`; real wires need no such call.
    fn advance(&mut self, _until_ns: u64) -> Result<(), DynamicsError> {
        Ok(())
    }

    /// The next frame or error on a wire up to `now_ns`, from any node.
    fn tap(&mut self, bus: usize, now_ns: u64) -> Result<Option<Tapped>, ReceiveError>;

    /// The next beginning or end of an injected fault up to `now_ns`.
    fn next_note(&mut self, bus: usize, now_ns: u64) -> Option<FaultNote>;

    /// The time in which a fault or a stimulus acts has become known.
    fn set_window(&mut self, injected: Injected, window_ns: Range<u64>);

    /// The next beginning or end of what the emulation carries out; the wires have notes instead.
    fn next_occurrence(&mut self) -> Option<Occurrence> {
        None
    }

    /// The next mishap of the mechanism, with its time, ns.
    fn next_mishap(&mut self) -> Option<(u64, Mishap)> {
        None
    }

    /// The axis whose drive is at a port of a simulated wire; none at the master's.
    fn axis_at(&self, _bus: usize, _port: usize) -> Option<usize> {
        None
    }

    /// Waits in real time until frames may have arrived, but not beyond `latest_ns`; returns the time.
    fn wait(&mut self, latest_ns: u64, waiter: &mut Waiter) -> u64;

    /// The mechanism's true motion at the last SYNC, where it is emulated here.
    fn truth(&self) -> Option<Truth> {
        None
    }

    /// What the load cell showed at the last SYNC, N; 0 where there is none.
    fn load_cell_n(&self) -> f64 {
        0.0
    }

    /// The forces between the jaws in the cycle before the last SYNC, where they are emulated here and can touch.
    fn contact(&self) -> Option<Contact> {
        None
    }
}
