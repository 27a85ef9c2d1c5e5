//! Puts a node on a CAN interface of the kernel.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use canopen_node::{Dcf, Frame, Node, NodeId, Quirks, Settings};
use clap::Parser;
use masseter_can::CanId;
use socketcan::{CanFrame, CanSocket, EmbeddedFrame as _, Socket as _, StandardId};

/// Longest pause between two steps.
const STEP: Duration = Duration::from_millis(10);

/// A CANopen servo drive for tests.
#[derive(Debug, Parser)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of its own")]
struct Arguments {
    /// CAN interface
    #[arg(long)]
    interface: String,
    /// Description of the device (DCF or EDS)
    #[arg(long)]
    dcf: PathBuf,
    /// Node id, 1 to 127
    #[arg(long)]
    node_id: u8,
    /// Serial number, 1018h:04h [default: that of the description]
    #[arg(long)]
    serial: Option<u32>,
    /// File that keeps saved values; without it they last as long as the process
    #[arg(long)]
    store: Option<PathBuf>,
    /// 6064h at the start
    #[arg(long, allow_negative_numbers = true, default_value_t = 0)]
    position_increments: i32,
    /// Place of the home switch
    #[arg(long, allow_negative_numbers = true, default_value_t = 0)]
    home_increments: i32,
    /// Mechanical stops
    #[arg(long, allow_negative_numbers = true, num_args = 2, value_names = ["LOW", "HIGH"])]
    stops_increments: Option<Vec<i32>>,
    /// Increments of a turn, where 608Fh does not tell
    #[arg(long, default_value_t = 2000)]
    increments_per_turn: u32,
    /// Refuse to write parameters of PDOs in operational
    #[arg(long)]
    pdos_closed_in_operational: bool,
    /// Send a boot-up message of the boot loader before that of the application
    #[arg(long)]
    boot_loader: bool,
    /// Time that saving takes, ms
    #[arg(long, default_value_t = 0)]
    save_ms: u32,
    /// Stay in switch on disabled
    #[arg(long)]
    safe_torque_off: bool,
    /// Count from 0 at every start
    #[arg(long)]
    incremental: bool,
    /// Read 607Ch at home, and not its negative
    #[arg(long)]
    home_offset_positive: bool,
    /// Show in bit 8 of the statusword that SYNC comes
    #[arg(long)]
    shows_sync: bool,
}

impl Arguments {
    fn settings(&self) -> anyhow::Result<Settings> {
        Ok(Settings {
            serial: self.serial,
            position_increments: self.position_increments,
            home_increments: self.home_increments,
            stops_increments: self.stops_increments.as_ref().map(|stops| [stops[0], stops[1]]),
            increments_per_turn: self.increments_per_turn,
            quirks: Quirks {
                pdos_closed_in_operational: self.pdos_closed_in_operational,
                boot_loader: self.boot_loader,
                save_ms: self.save_ms,
                safe_torque_off: self.safe_torque_off,
                is_incremental: self.incremental,
                is_home_offset_positive: self.home_offset_positive,
                shows_sync: self.shows_sync,
            },
            ..Settings::new(NodeId::new(self.node_id)?)
        })
    }
}

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    let described = fs::read(&arguments.dcf).with_context(|| arguments.dcf.display().to_string())?;
    let dcf = Dcf::parse(&String::from_utf8_lossy(&described))
        .with_context(|| arguments.dcf.display().to_string())?;
    let store = arguments.store.as_deref();
    let stored = store.filter(|path| path.exists()).map(fs::read_to_string).transpose()?.unwrap_or_default();
    let socket = CanSocket::open(&arguments.interface).with_context(|| arguments.interface.clone())?;
    #[expect(clippy::disallowed_methods, reason = "a process of its own on the machine's clock")]
    let start = Instant::now();
    let now_ns = || start.elapsed().as_nanos() as u64;
    let mut node = Node::new(&dcf, arguments.settings()?, &stored, now_ns())?;
    loop {
        while let Some(frame) = node.outgoing() {
            socket.write_frame(&to_kernel(frame)?).with_context(|| arguments.interface.clone())?;
        }
        if let (Some(text), Some(path)) = (node.to_store(), store) {
            replace(path, &text).with_context(|| path.display().to_string())?;
        }
        match socket.read_frame_timeout(STEP) {
            Ok(CanFrame::Data(frame)) => {
                if let socketcan::Id::Standard(id) = frame.id() {
                    node.receive(Frame::new(CanId::standard(id.as_raw())?, frame.data())?, now_ns());
                }
            }
            Ok(_) => {}
            Err(error) if error.kind() == std::io::ErrorKind::TimedOut => {}
            Err(error) => return Err(error).context(arguments.interface),
        }
        node.step(now_ns());
    }
}

fn to_kernel(frame: Frame) -> anyhow::Result<CanFrame> {
    let id = StandardId::new(frame.id().number() as u16).context("an identifier of 11 bits")?;
    CanFrame::new(id, frame.data()).context("a frame of at most eight bytes")
}

/// Another process never sees half of a store.
fn replace(path: &Path, text: &str) -> std::io::Result<()> {
    let fresh = path.with_extension("new");
    fs::write(&fresh, text)?;
    fs::rename(fresh, path)
}
