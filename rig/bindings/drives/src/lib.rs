//! The native part of the Python package `masseter_drives`; the package itself has the documentation.
//!
//! This module has no clock: the caller gives the time, in ns, up to which the drives go on. It has no thread, either; threads of
//! Python may share a stand.
#![allow(clippy::needless_pass_by_value, reason = "Python passes values")]

mod given;

use std::fmt::Display;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use masseter_can::canopen::NodeId;
use masseter_can::{
    Bitrate, Bus, CanId, ErrorState, Frame, ReceiveError, SendError, VirtualWire, WireConfig,
};
use masseter_drives::{DriveFault, DriveSettings, Stand, eds};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<Bench>()
}

/// An error of the class of that name in `masseter_drives.errors`.
fn error<A>(class: &str, arguments: A) -> PyErr
where
    A: for<'py> pyo3::call::PyCallArgs<'py>,
{
    Python::attach(|py| {
        let errors = py.import("masseter_drives.errors")?;
        errors.getattr(class)?.call1(arguments).map(PyErr::from_value)
    })
    .unwrap_or_else(std::convert::identity)
}

/// A refusal of a setting, with its value and what to do.
fn setting_error(key: &str, value: impl Display, need: &dyn Display) -> PyErr {
    error("SettingError", (key, value.to_string(), need.to_string()))
}

/// Buses of Python on one wire; a wire of 127 drives has one.
const BUSES: usize = 8;
/// All ports of a wire.
const PORTS: usize = 128;
/// Frames of a bus that wait for the wire: a scan of all nodes sends 127 at once.
const TRANSMIT_CAPACITY: usize = 256;
/// The step of the drives: a frame is received within such a time after its end, ns.
const STEP_NS: u64 = 125_000;
/// How often a thread that lets time pass gives way to another.
const MOST_YIELDS: usize = 1000;

/// Drives on a simulated wire with ports for buses of Python.
#[pyclass(frozen, module = "masseter_drives._native")]
struct Bench {
    inner: Mutex<Inner>,
    /// Threads that wait for the drives.
    waiting: AtomicUsize,
}

struct Inner {
    stand: Stand,
    settings: Vec<DriveSettings>,
    now_ns: u64,
    /// The ports that buses may have, with the frames that each has lost; none where no bus is open.
    buses: Vec<(usize, Option<u64>)>,
}

/// A received frame: its time in ns, its identifier, whether it is extended, its data.
type Received<'py> = (u64, u32, bool, Bound<'py, PyBytes>);

#[pymethods]
impl Bench {
    #[new]
    fn new(settings: &str, bitrate: u32, queue: usize) -> PyResult<Self> {
        let settings = given::settings_of_all(settings)?;
        let no_rate = |reason| setting_error("bitrate", bitrate, &reason);
        let bitrate = Bitrate::new(bitrate).map_err(no_rate)?;
        if !(1..=100_000).contains(&queue) {
            return Err(setting_error("queue", queue, &"use 1 to 100000 frames"));
        }
        let drives = settings.len();
        let buses = BUSES.min(PORTS - drives);
        let wire = VirtualWire::new(&WireConfig {
            bitrate,
            ports: drives + buses,
            transmit_capacity: TRANSMIT_CAPACITY,
            receive_capacity: queue,
            restart_after_ns: None,
        });
        let stand = Stand::on_wire(wire, &settings);
        let stand = stand.map_err(|refusal| setting_error("settings", drives, &refusal))?;
        let ports = (0..buses).map(|bus| if bus == 0 { Stand::MASTER } else { drives + bus });
        let buses = ports.map(|port| (port, None)).collect();
        let inner = Mutex::new(Inner { stand, settings, now_ns: 0, buses });
        Ok(Self { inner, waiting: AtomicUsize::new(0) })
    }

    /// Time that the drives have reached, ns.
    fn now_ns(&self, py: Python<'_>) -> u64 {
        self.with(py, |inner| inner.now_ns)
    }

    /// Lets time pass up to `until_ns`.
    fn advance(&self, py: Python<'_>, until_ns: u64) {
        self.with(py, |inner| inner.advance(until_ns));
        self.give_way(py);
    }

    /// Opens a bus, and returns its number. The bus receives what comes from now on.
    fn join(&self, py: Python<'_>) -> PyResult<usize> {
        self.with(py, |inner| {
            let free = inner.buses.iter().position(|(_, lost)| lost.is_none());
            let bus = free.ok_or_else(|| {
                setting_error("channel", inner.buses.len(), &"so many buses are open; close one")
            })?;
            let Inner { stand, buses, now_ns, .. } = inner;
            let mut port = stand.wire().port(buses[bus].0);
            while !matches!(port.receive(*now_ns), Ok(None)) {}
            buses[bus].1 = Some(0);
            Ok(bus)
        })
    }

    /// Closes a bus, and returns how many frames the bus has lost. Frames that wait for the wire are still sent.
    fn leave(&self, py: Python<'_>, bus: usize) -> u64 {
        self.with(py, |inner| {
            let (_, lost) = inner.receive(bus, 0);
            inner.buses[bus].1 = None;
            lost
        })
    }

    /// Queues a frame of a bus. Returns whether there was room.
    fn send(&self, py: Python<'_>, bus: usize, id: u32, extended: bool, data: &[u8]) -> PyResult<bool> {
        let id = if extended {
            CanId::extended(id)
        } else {
            CanId::standard(u16::try_from(id).unwrap_or(u16::MAX))
        };
        let frame = id.and_then(|id| Frame::new(id, data));
        let frame = frame.map_err(|refusal| error("FrameError", (refusal.to_string(),)))?;
        self.with(py, |inner| {
            let now_ns = inner.now_ns;
            match inner.port(bus).send(now_ns, frame) {
                Ok(()) => Ok(true),
                Err(SendError::QueueFull { .. }) => Ok(false),
                Err(refusal) => Err(error("BusOffError", (refusal.to_string(),))),
            }
        })
    }

    /// The next frame of a bus up to `until_ns`: time passes until the frame is there. The second value is the number of
    /// frames that the bus has lost so far.
    fn receive<'py>(&self, py: Python<'py>, bus: usize, until_ns: u64) -> (Option<Received<'py>>, u64) {
        let (received, lost) = self.with(py, |inner| inner.receive(bus, until_ns));
        self.give_way(py);
        let received = received.map(|received| {
            let (id, data) = (received.frame.id(), received.frame.data());
            (received.time_ns, id.number(), id.is_extended(), PyBytes::new(py, data))
        });
        (received, lost)
    }

    /// The state of a bus' fault confinement: 0 active, 1 passive, 2 off.
    fn error_state(&self, py: Python<'_>, bus: usize) -> u8 {
        self.with(py, |inner| match inner.port(bus).status().state {
            ErrorState::Active => 0,
            ErrorState::Passive => 1,
            ErrorState::BusOff => 2,
        })
    }

    /// The electronic data sheet of a drive.
    fn eds(&self, py: Python<'_>, node: u8) -> PyResult<String> {
        self.with(py, |inner| {
            let place = inner.place(node)?;
            eds(&inner.settings[place]).map_err(|refusal| setting_error("quirks", node, &refusal))
        })
    }

    /// The state of a drive under CiA 402.
    fn power_state(&self, py: Python<'_>, node: u8) -> PyResult<String> {
        self.with(py, |inner| {
            let place = inner.place(node)?;
            Ok(inner.stand.drive(place).state().to_string())
        })
    }

    /// Begins a fault, or ends the fault.
    #[pyo3(signature = (node, kind, acts, size=None))]
    fn set_fault(&self, py: Python<'_>, node: u8, kind: &str, acts: bool, size: Option<f64>) -> PyResult<()> {
        let fault = fault(kind)?;
        let has_size = matches!(
            fault,
            DriveFault::TorqueLoss | DriveFault::SlowEnable | DriveFault::Scale | DriveFault::EmcyStorm
        );
        // A share of the torque; of the others a day in s, or a factor.
        let most = if fault == DriveFault::TorqueLoss { 1.0 } else { 86_400.0 };
        let need = if has_size {
            format!("give its size, above 0 and at most {most}")
        } else {
            "this fault has no size".to_owned()
        };
        if acts && (size.is_some() != has_size || size.is_some_and(|size| !(size > 0.0 && size <= most))) {
            return Err(setting_error(
                kind,
                size.map_or("no size".to_owned(), |size| size.to_string()),
                &need,
            ));
        }
        self.with(py, |inner| {
            let place = inner.place(node)?;
            let size = acts.then_some(size.unwrap_or_default());
            inner.stand.drive(place).set_fault(fault, size);
            Ok(())
        })
    }

    /// Whether a fault has had an effect since it was set.
    fn has_struck(&self, py: Python<'_>, node: u8, kind: &str) -> PyResult<bool> {
        let fault = fault(kind)?;
        self.with(py, |inner| {
            let place = inner.place(node)?;
            Ok(inner.stand.drive(place).faults().has_struck(fault))
        })
    }

    /// A value of the axis of a drive.
    fn value(&self, py: Python<'_>, node: u8, name: &str) -> PyResult<f64> {
        self.with(py, |inner| Ok(*inner.value(node, name)?))
    }

    /// Changes a value of the axis of a drive.
    fn set_value(&self, py: Python<'_>, node: u8, name: &str, value: f64) -> PyResult<()> {
        if !value.is_finite() || (name == "mass_kg" && value <= 0.0) {
            return Err(setting_error(name, value, &"use a finite number, and a mass above 0"));
        }
        self.with(py, |inner| {
            *inner.value(node, name)? = value;
            Ok(())
        })
    }

    /// Whether the encoder of a drive is stuck where the axis is now.
    fn stick_encoder(&self, py: Python<'_>, node: u8, is_stuck: bool) -> PyResult<()> {
        self.with(py, |inner| {
            let place = inner.place(node)?;
            let at_m = inner.stand.mass(place).position_m;
            inner.stand.encoder(place).stuck_m = is_stuck.then_some(at_m);
            Ok(())
        })
    }
}

impl Bench {
    /// Works with the drives while other threads of Python run.
    fn with<R: Send>(&self, py: Python<'_>, work: impl FnOnce(&mut Inner) -> R + Send) -> R {
        py.detach(|| {
            self.waiting.fetch_add(1, Ordering::Relaxed);
            let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
            self.waiting.fetch_sub(1, Ordering::Relaxed);
            work(&mut inner)
        })
    }

    /// Lets a waiting thread go first: a lock is not fair, and a thread that receives takes it again at once.
    fn give_way(&self, py: Python<'_>) {
        py.detach(|| {
            let is_awaited = |_: &usize| self.waiting.load(Ordering::Relaxed) > 0;
            (0..MOST_YIELDS).take_while(is_awaited).for_each(|_| std::thread::yield_now());
        });
    }
}

impl Inner {
    fn advance(&mut self, until_ns: u64) {
        self.now_ns = self.now_ns.max(until_ns);
        self.stand.advance(self.now_ns);
    }

    fn port(&mut self, bus: usize) -> masseter_can::Port<'_> {
        self.stand.wire().port(self.buses[bus].0)
    }

    fn receive(&mut self, bus: usize, until_ns: u64) -> (Option<masseter_can::Received>, u64) {
        loop {
            let now_ns = self.now_ns;
            match self.port(bus).receive(now_ns) {
                Err(ReceiveError::Overrun { lost }) => {
                    self.buses[bus].1 = self.buses[bus].1.map(|before| before + lost);
                }
                Ok(None) | Err(_) if now_ns < until_ns => self.advance(until_ns.min(now_ns + STEP_NS)),
                received => return (received.ok().flatten(), self.buses[bus].1.unwrap_or_default()),
            }
        }
    }

    fn place(&self, node: u8) -> PyResult<usize> {
        let place = self.settings.iter().position(|settings| settings.node.get() == node);
        let nodes = self.settings.iter().map(|settings| settings.node).map(NodeId::get);
        place.ok_or_else(|| {
            setting_error(
                "node",
                node,
                &format!("no drive has this id; use one of {:?}", nodes.collect::<Vec<_>>()),
            )
        })
    }

    fn value(&mut self, node: u8, name: &str) -> PyResult<&mut f64> {
        let place = self.place(node)?;
        Ok(match name {
            "mass_kg" => &mut self.stand.mass(place).mass_kg,
            "load_n" => &mut self.stand.mass(place).load_n,
            "position_m" => &mut self.stand.mass(place).position_m,
            "velocity_m_s" => &mut self.stand.mass(place).velocity_m_s,
            "encoder_error_m" => &mut self.stand.encoder(place).error_m,
            _ => return Err(setting_error("value", name, &"no value of an axis")),
        })
    }
}

fn fault(kind: &str) -> PyResult<DriveFault> {
    serde_json::from_value(serde_json::json!(kind)).map_err(|refusal| setting_error("fault", kind, &refusal))
}
