//! What a description of a device does not contain.

use masseter_can::canopen::NodeId;

/// The place of a node, and of its axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Node id.
    pub node: NodeId,
    /// Serial number, 1018h:04h; none for that of the description.
    pub serial: Option<u32>,
    /// 6064h at the start. It counts from the zero of the machine, as all places here do.
    pub position_increments: i32,
    /// Where homing finds the home switch, increments.
    pub home_increments: i32,
    /// Mechanical stops, increments; none for an axis without ends.
    pub stops_increments: Option<[i32; 2]>,
    /// Increments of a turn, where 608Fh does not tell: velocities in rpm need it.
    pub increments_per_turn: u32,
    /// Habits of the device.
    pub quirks: Quirks,
}

/// Habits of real devices that no description contains. The default is none of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[expect(clippy::struct_excessive_bools, reason = "each is a habit of its own")]
pub struct Quirks {
    /// Parameters of PDOs are closed in operational: abort 08000022h.
    pub pdos_closed_in_operational: bool,
    /// The boot loader sends a boot-up message of its own before the application's.
    pub boot_loader: bool,
    /// Time that saving takes. Meanwhile 1010h reads 0.
    pub save_ms: u32,
    /// Safe torque off is active: the drive stays in switch on disabled and refuses nothing.
    pub safe_torque_off: bool,
    /// An incremental encoder: 6064h is 0 after every start, wherever the axis stands.
    pub is_incremental: bool,
    /// At home 6064h is 607Ch, and not its negative.
    pub is_home_offset_positive: bool,
    /// Bit 8 of the statusword tells in cyclic synchronous position that SYNC comes.
    pub shows_sync: bool,
}

impl Settings {
    /// A node at position 0 without stops and habits.
    pub fn new(node: NodeId) -> Self {
        Self {
            node,
            serial: None,
            position_increments: 0,
            home_increments: 0,
            stops_increments: None,
            increments_per_turn: 2000,
            quirks: Quirks::default(),
        }
    }
}
