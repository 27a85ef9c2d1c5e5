//! The bus trait: one node's port onto a wire, as one `SocketCAN` socket is.
//!
//! Time is an argument, in ns of `CLOCK_MONOTONIC`. A simulated wire takes its time from this argument; a real wire uses
//! the kernel's time stamps instead. No call blocks or allocates. Opening, configuring and restarting an interface are
//! not part of the trait.

use std::io;

use crate::frame::Frame;

/// One node's port onto a wire.
pub trait Bus {
    /// Queues a frame for transmission at `now_ns`. The frame goes out when the wire is free: by priority on a simulated
    /// wire, in the order of sending on a real interface.
    ///
    /// # Errors
    /// [`SendError`]; a refused frame is not queued. The caller decides whether to send the frame again.
    fn send(&mut self, now_ns: u64, frame: Frame) -> Result<(), SendError>;

    /// The oldest frame of another node that has arrived at `now_ns` and is not fetched yet; `None` without such a
    /// frame. A port never receives its own frames.
    ///
    /// # Errors
    /// [`ReceiveError`]; later calls still deliver the frames received before and after the failure.
    fn receive(&mut self, now_ns: u64) -> Result<Option<Received>, ReceiveError>;

    /// The port's fault confinement, as last known.
    fn status(&self) -> BusStatus;

    /// Frames of this port that wait for the wire, as far as known. After a hang of the adapter they are all sent at once.
    fn unsent(&self) -> usize;
}

impl<B: Bus + ?Sized> Bus for &mut B {
    fn send(&mut self, now_ns: u64, frame: Frame) -> Result<(), SendError> {
        (**self).send(now_ns, frame)
    }

    fn receive(&mut self, now_ns: u64) -> Result<Option<Received>, ReceiveError> {
        (**self).receive(now_ns)
    }

    fn status(&self) -> BusStatus {
        (**self).status()
    }

    fn unsent(&self) -> usize {
        (**self).unsent()
    }
}

/// A frame with the time it was received.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Received {
    /// The frame.
    pub frame: Frame,
    /// When its last end-of-frame bit was on the wire, ns.
    pub time_ns: u64,
}

/// The system's error for a transmit queue without room (`ENOBUFS`).
pub const FULL_QUEUE: i32 = libc::ENOBUFS;

/// Why a frame was not queued.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum SendError {
    /// The transmit queue is full (`ENOBUFS`).
    #[error("transmit queue full ({capacity} frames): the bus is overloaded, or no node acknowledges")]
    QueueFull {
        /// Frames the queue holds.
        capacity: usize,
    },
    /// The controller is off the bus after too many errors.
    #[error("bus-off (transmit error counter {tec}): check bit rate, termination and wiring, then restart")]
    BusOff {
        /// Transmit error counter.
        tec: u16,
    },
    /// A failure of the operating system: above all an interface that is down or gone.
    #[error("sending failed: {}", io::Error::from_raw_os_error(*.errno))]
    Os {
        /// Error number of the operating system.
        errno: i32,
    },
}

/// Why a port receives nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ReceiveError {
    /// Frames arrive while the receive queue is full. Reported once for each group of losses.
    #[error("received frames lost: {lost}; the receive queue was not emptied in time")]
    Overrun {
        /// Frames lost since the last report.
        lost: u64,
    },
    /// A failure of the operating system: above all an interface that is down or gone.
    #[error("receiving failed: {}", io::Error::from_raw_os_error(*.errno))]
    Os {
        /// Error number of the operating system.
        errno: i32,
    },
}

/// State of fault confinement (ISO 11898-1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum ErrorState {
    /// The node sends, receives, and signals errors with dominant flags.
    Active,
    /// An error counter is at 128 or more: the node signals errors with recessive flags.
    Passive,
    /// The transmit error counter is above 255: the node neither sends nor receives.
    BusOff,
}

/// Fault confinement of one port.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BusStatus {
    /// State.
    pub state: ErrorState,
    /// Transmit error counter.
    pub tec: u16,
    /// Receive error counter.
    pub rec: u16,
}
