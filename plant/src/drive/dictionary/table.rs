//! The drive's object dictionary: every object, once. Memory, EDS and DBC follow from this table.
//!
//! Positions are encoder increments, velocities increments/s, accelerations increments/s², torques per
//! mille of the rated torque (of the rated force, for a linear axis).

use masseter_can::canopen::CobId;
use masseter_can::{EVERY_SYNC, Rpdo1, Tpdo1};
use masseter_shared::config::IdentityConfig;

use super::entry::Access::{Constant, ReadOnly, ReadWrite};
use super::entry::DataType::{I8, I16, I32, Text, U8, U16, U32};
use super::entry::Initial::{Configured, OfNode, Value};
use super::entry::Mapping::{Any, Tpdo};
use super::entry::Shape::{Array, Record, Var};
use super::entry::{Access, DataType, Entry, Initial, Object, Shape};

/// PDOs of each direction.
pub(crate) const PDOS: usize = 4;
/// Objects that a PDO can carry.
pub(crate) const MAPPED_MAX: usize = 8;
/// Errors in the history (1003h).
pub(crate) const HISTORY: usize = 8;
/// Heartbeats that can be consumed (1016h).
pub(crate) const CONSUMED: usize = 2;
/// Device type and identity of the drive (1000h, 1018h).
pub(crate) const IDENTITY: IdentityConfig = IdentityConfig::EMULATED;
/// 6502h: profile position, homing, cyclic synchronous position and torque.
const SUPPORTED_MODES: i64 = 1 << 0 | 1 << 5 | 1 << 7 | 1 << 9;

const fn object(index: u16, name: &'static str, shape: Shape, entries: &'static [Entry]) -> Object {
    Object { index, name, shape, entries }
}

/// The only entry of a plain object.
const fn plain(name: &'static str, kind: DataType, access: Access, initial: Initial) -> Entry {
    Entry::new(0, name, kind, access, initial)
}

/// A positive quantity that follows from the scenario.
const fn positive(subindex: u8, name: &'static str) -> Entry {
    Entry::new(subindex, name, U32, ReadWrite, Configured).within(1, u32::MAX as i64)
}

/// The COB-ID of a PDO: initially only the first one of each direction exists.
const fn first_exists(number: u32, word: u32) -> Initial {
    OfNode(if number == 0 { word } else { CobId(word).invalidated().0 })
}

/// The communication parameter of a receive PDO, numbered from 0.
const fn rpdo(number: u32) -> [Entry; 4] {
    let cob_id = first_exists(number, 0x200 + 0x100 * number);
    [
        Entry::highest(5),
        Entry::new(1, "COB-ID used by RPDO", U32, ReadWrite, cob_id),
        Entry::new(2, "Transmission type", U8, ReadWrite, Value(EVERY_SYNC as i64)),
        Entry::new(5, "Event timer", U16, ReadWrite, Value(0)),
    ]
}

/// The communication parameter of a transmit PDO, numbered from 0.
const fn tpdo(number: u32) -> [Entry; 6] {
    let cob_id = first_exists(number, CobId::NO_REMOTE_REQUEST | (0x180 + 0x100 * number));
    [
        Entry::highest(6),
        Entry::new(1, "COB-ID used by TPDO", U32, ReadWrite, cob_id),
        Entry::new(2, "Transmission type", U8, ReadWrite, Value(EVERY_SYNC as i64)),
        Entry::new(3, "Inhibit time", U16, ReadWrite, Value(0)),
        Entry::new(5, "Event timer", U16, ReadWrite, Value(0)),
        Entry::new(6, "SYNC start value", U8, ReadWrite, Value(0)).within(0, 240),
    ]
}

static RPDO: [[Entry; 4]; PDOS] = [rpdo(0), rpdo(1), rpdo(2), rpdo(3)];
static TPDO: [[Entry; 6]; PDOS] = [tpdo(0), tpdo(1), tpdo(2), tpdo(3)];
static RPDO1_MAPPING: [Entry; MAPPED_MAX + 1] = mapping(&Rpdo1::MAPPING);
static TPDO1_MAPPING: [Entry; MAPPED_MAX + 1] = mapping(&Tpdo1::MAPPING);
static NO_MAPPING: [Entry; MAPPED_MAX + 1] = mapping(&[]);

/// The mapping parameter of a PDO that initially carries these objects.
const fn mapping(objects: &[u32]) -> [Entry; MAPPED_MAX + 1] {
    const NAMES: [&str; MAPPED_MAX] = [
        "Mapped object 1",
        "Mapped object 2",
        "Mapped object 3",
        "Mapped object 4",
        "Mapped object 5",
        "Mapped object 6",
        "Mapped object 7",
        "Mapped object 8",
    ];
    let count = plain("Number of mapped objects", U8, ReadWrite, Value(0)).within(0, MAPPED_MAX as i64);
    let mut entries = [count; MAPPED_MAX + 1];
    entries[0].initial = Value(objects.len() as i64);
    let mut place = 0;
    while place < MAPPED_MAX {
        let object = if place < objects.len() { objects[place] as i64 } else { 0 };
        entries[place + 1] = Entry::new(place as u8 + 1, NAMES[place], U32, ReadWrite, Value(object));
        place += 1;
    }
    entries
}

/// Every object, indices ascending.
#[rustfmt::skip]
pub(crate) static OBJECTS: &[Object] = &[
    object(0x1000, "Device type", Var, &[plain("Device type", U32, Constant, Value(IDENTITY.device_type as i64))]),
    object(0x1001, "Error register", Var, &[plain("Error register", U8, ReadOnly, Value(0)).mapped(Tpdo)]),
    object(0x1003, "Pre-defined error field", Array, &[
        plain("Number of errors", U8, ReadWrite, Value(0)),
        Entry::new(1, "Standard error field 1", U32, ReadOnly, Value(0)),
        Entry::new(2, "Standard error field 2", U32, ReadOnly, Value(0)),
        Entry::new(3, "Standard error field 3", U32, ReadOnly, Value(0)),
        Entry::new(4, "Standard error field 4", U32, ReadOnly, Value(0)),
        Entry::new(5, "Standard error field 5", U32, ReadOnly, Value(0)),
        Entry::new(6, "Standard error field 6", U32, ReadOnly, Value(0)),
        Entry::new(7, "Standard error field 7", U32, ReadOnly, Value(0)),
        Entry::new(8, "Standard error field 8", U32, ReadOnly, Value(0)),
    ]),
    object(0x1005, "COB-ID SYNC message", Var, &[plain("COB-ID SYNC message", U32, Constant, Value(0x80))]),
    object(0x1008, "Manufacturer device name", Var, &[plain("Manufacturer device name", Text, Constant, Initial::Text("Masseter emulated drive"))]),
    object(0x1009, "Manufacturer hardware version", Var, &[plain("Manufacturer hardware version", Text, Constant, Initial::Text("emulated"))]),
    object(0x100A, "Manufacturer software version", Var, &[plain("Manufacturer software version", Text, Constant, Initial::Text(env!("CARGO_PKG_VERSION")))]),
    object(0x1010, "Store parameters", Array, &[
        Entry::highest(1),
        Entry::new(1, "Save all parameters", U32, ReadWrite, Value(1)),
    ]),
    object(0x1011, "Restore default parameters", Array, &[
        Entry::highest(1),
        Entry::new(1, "Restore all default parameters", U32, ReadWrite, Value(1)),
    ]),
    object(0x1014, "COB-ID EMCY", Var, &[plain("COB-ID EMCY", U32, ReadWrite, OfNode(0x80))]),
    object(0x1016, "Consumer heartbeat time", Array, &[
        Entry::highest(CONSUMED as u8),
        Entry::new(1, "Consumer heartbeat time 1", U32, ReadWrite, Configured),
        Entry::new(2, "Consumer heartbeat time 2", U32, ReadWrite, Value(0)),
    ]),
    object(0x1017, "Producer heartbeat time", Var, &[plain("Producer heartbeat time", U16, ReadWrite, Configured)]),
    object(0x1018, "Identity object", Record, &[
        Entry::highest(4),
        Entry::new(1, "Vendor-ID", U32, Constant, Value(IDENTITY.vendor_id as i64)),
        Entry::new(2, "Product code", U32, Constant, Value(IDENTITY.product_code as i64)),
        Entry::new(3, "Revision number", U32, Constant, Value(IDENTITY.revision as i64)),
        Entry::new(4, "Serial number", U32, Constant, OfNode(0)),
    ]),
    object(0x1019, "Synchronous counter overflow value", Var, &[plain("Synchronous counter overflow value", U8, ReadWrite, Value(0)).within(0, 240)]),
    object(0x1029, "Error behaviour", Array, &[
        Entry::highest(1),
        Entry::new(1, "Communication error", U8, ReadWrite, Value(0)).within(0, 2),
    ]),
    object(0x1200, "SDO server parameter", Record, &[
        Entry::highest(2),
        Entry::new(1, "COB-ID client to server", U32, Constant, OfNode(0x600)),
        Entry::new(2, "COB-ID server to client", U32, Constant, OfNode(0x580)),
    ]),
    object(0x1400, "RPDO 1 communication parameter", Record, &RPDO[0]),
    object(0x1401, "RPDO 2 communication parameter", Record, &RPDO[1]),
    object(0x1402, "RPDO 3 communication parameter", Record, &RPDO[2]),
    object(0x1403, "RPDO 4 communication parameter", Record, &RPDO[3]),
    object(0x1600, "RPDO 1 mapping parameter", Record, &RPDO1_MAPPING),
    object(0x1601, "RPDO 2 mapping parameter", Record, &NO_MAPPING),
    object(0x1602, "RPDO 3 mapping parameter", Record, &NO_MAPPING),
    object(0x1603, "RPDO 4 mapping parameter", Record, &NO_MAPPING),
    object(0x1800, "TPDO 1 communication parameter", Record, &TPDO[0]),
    object(0x1801, "TPDO 2 communication parameter", Record, &TPDO[1]),
    object(0x1802, "TPDO 3 communication parameter", Record, &TPDO[2]),
    object(0x1803, "TPDO 4 communication parameter", Record, &TPDO[3]),
    object(0x1A00, "TPDO 1 mapping parameter", Record, &TPDO1_MAPPING),
    object(0x1A01, "TPDO 2 mapping parameter", Record, &NO_MAPPING),
    object(0x1A02, "TPDO 3 mapping parameter", Record, &NO_MAPPING),
    object(0x1A03, "TPDO 4 mapping parameter", Record, &NO_MAPPING),
    object(0x6007, "Abort connection option code", Var, &[plain("Abort connection option code", I16, ReadWrite, Value(3)).within(0, 3)]),
    object(0x603F, "Error code", Var, &[plain("Error code", U16, ReadOnly, Value(0)).mapped(Tpdo)]),
    object(0x6040, "Controlword", Var, &[plain("Controlword", U16, ReadWrite, Value(0)).mapped(Any)]),
    object(0x6041, "Statusword", Var, &[plain("Statusword", U16, ReadOnly, Value(0)).mapped(Tpdo)]),
    object(0x605A, "Quick stop option code", Var, &[plain("Quick stop option code", I16, ReadWrite, Value(2)).within(0, 6)]),
    object(0x605E, "Fault reaction option code", Var, &[plain("Fault reaction option code", I16, ReadWrite, Value(2)).within(0, 2)]),
    object(0x6060, "Modes of operation", Var, &[plain("Modes of operation", I8, ReadWrite, Value(8)).mapped(Any)]),
    object(0x6061, "Modes of operation display", Var, &[plain("Modes of operation display", I8, ReadOnly, Value(8)).mapped(Tpdo)]),
    object(0x6062, "Position demand value", Var, &[plain("Position demand value", I32, ReadOnly, Value(0)).mapped(Tpdo)]),
    object(0x6064, "Position actual value", Var, &[plain("Position actual value", I32, ReadOnly, Value(0)).mapped(Tpdo)]),
    object(0x6065, "Following error window", Var, &[plain("Following error window", U32, ReadWrite, Configured)]),
    object(0x6066, "Following error time out", Var, &[plain("Following error time out", U16, ReadWrite, Configured)]),
    object(0x6067, "Position window", Var, &[plain("Position window", U32, ReadWrite, Configured)]),
    object(0x606C, "Velocity actual value", Var, &[plain("Velocity actual value", I32, ReadOnly, Value(0)).mapped(Tpdo)]),
    object(0x6071, "Target torque", Var, &[plain("Target torque", I16, ReadWrite, Value(0)).mapped(Any)]),
    object(0x6072, "Max torque", Var, &[plain("Max torque", U16, ReadWrite, Configured)]),
    object(0x6077, "Torque actual value", Var, &[plain("Torque actual value", I16, ReadOnly, Value(0)).mapped(Tpdo)]),
    object(0x607A, "Target position", Var, &[plain("Target position", I32, ReadWrite, Value(0)).mapped(Any)]),
    object(0x607C, "Home offset", Var, &[plain("Home offset", I32, ReadWrite, Value(0))]),
    object(0x607D, "Software position limit", Array, &[
        Entry::highest(2),
        Entry::new(1, "Min position limit", I32, ReadWrite, Configured),
        Entry::new(2, "Max position limit", I32, ReadWrite, Configured),
    ]),
    object(0x607F, "Max profile velocity", Var, &[positive(0, "Max profile velocity")]),
    object(0x6081, "Profile velocity", Var, &[positive(0, "Profile velocity").mapped(Any)]),
    object(0x6083, "Profile acceleration", Var, &[positive(0, "Profile acceleration").mapped(Any)]),
    object(0x6084, "Profile deceleration", Var, &[positive(0, "Profile deceleration").mapped(Any)]),
    object(0x6085, "Quick stop deceleration", Var, &[positive(0, "Quick stop deceleration")]),
    object(0x6098, "Homing method", Var, &[plain("Homing method", I8, ReadWrite, Value(37))]),
    object(0x6099, "Homing speeds", Array, &[
        Entry::highest(2),
        positive(1, "Speed during search for switch"),
        positive(2, "Speed during search for zero"),
    ]),
    object(0x609A, "Homing acceleration", Var, &[positive(0, "Homing acceleration")]),
    object(0x60C2, "Interpolation time period", Record, &[
        Entry::highest(2),
        Entry::new(1, "Interpolation time period value", U8, ReadWrite, Configured).within(1, 255),
        Entry::new(2, "Interpolation time index", I8, ReadWrite, Configured).within(-6, 0),
    ]),
    object(0x60F4, "Following error actual value", Var, &[plain("Following error actual value", I32, ReadOnly, Value(0)).mapped(Tpdo)]),
    object(0x6502, "Supported drive modes", Var, &[plain("Supported drive modes", U32, Constant, Value(SUPPORTED_MODES))]),
];
