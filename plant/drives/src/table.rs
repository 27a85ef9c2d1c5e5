//! The drive's object dictionary: every object, once. Memory, EDS and DBC follow from this table.
//!
//! Positions are encoder increments, velocities increments/s, accelerations increments/s², torques per
//! mille of the rated torque (of the rated force, for a linear axis).

use masseter_can::EVERY_SYNC;
use masseter_can::canopen::{AbortCode, CobId, ObjectAddress};

use Access::{Constant, ReadOnly, ReadWrite};
use DataType::{Domain, I8, I16, I32, Text, U8, U16, U32};
use Initial::{Configured, OfNode, Value};
use Mapping::{Any, Tpdo};
use Shape::{Array, Record};

/// PDOs of each direction.
pub const PDOS: usize = 4;
/// Objects that a PDO can carry.
pub(crate) const MAPPED_MAX: usize = 8;
/// Errors in the history (1003h).
pub(crate) const HISTORY: usize = 8;
/// Heartbeats that can be consumed (1016h).
pub(crate) const CONSUMED: usize = 2;
/// Bytes that the user data hold: more than a block of SDO.
pub(crate) const USER_DATA_MAX: usize = 1024;
/// 6502h: profile position, velocity and torque, homing, cyclic synchronous position, velocity and torque.
const SUPPORTED_MODES: i64 = 1 << 0 | 1 << 2 | 1 << 3 | 1 << 5 | 1 << 7 | 1 << 8 | 1 << 9;

/// Increments of a turn of the motor.
pub const INCREMENTS_PER_TURN: u32 = 10_000;
/// Units in the notation of CiA 402 (60A8h to 60AAh): increments (B5h), their rate (second 03h, its square 57h), and
/// turns a minute a second.
pub(crate) const INCREMENTS: u32 = 0x00B5_0000;
pub(crate) const INCREMENTS_PER_S: u32 = 0x00B5_0300;
pub(crate) const INCREMENTS_PER_S2: u32 = 0x00B5_5700;
pub(crate) const RPM_PER_S: u32 = 0x00C0_0300;

/// An object of several entries.
const fn object(name: &'static str, shape: Shape, entries: &'static [Entry]) -> Object {
    Object { name, shape, entries }
}

/// An object that is its only entry.
const fn var(entries: &'static [Entry; 1]) -> Object {
    Object { name: entries[0].name, shape: Shape::Var, entries }
}

/// The only entry of a plain object, or the first one.
const fn plain(index: u16, name: &'static str, kind: DataType, access: Access, initial: Initial) -> Entry {
    Entry::new((index, 0), name, kind, access, initial)
}

/// Sub-index 0 of an object that has others.
const fn highest(index: u16, subindex: u8) -> Entry {
    plain(index, "Highest sub-index supported", U8, Constant, Value(subindex as i64))
}

/// A positive quantity that follows from the settings.
const fn positive(address: (u16, u8), name: &'static str) -> Entry {
    Entry::new(address, name, U32, ReadWrite, Configured).within(1, u32::MAX as i64)
}

/// A unit that clients may write, as long as it is the drive's.
const fn unit(index: u16, name: &'static str, word: u32) -> Entry {
    plain(index, name, U32, ReadWrite, Value(word as i64)).within(word as i64, word as i64)
}

/// A ratio that the drive's mechanics has: so much for each turn.
const fn ratio(index: u16, names: [&'static str; 2], [per_turn, turns]: [u32; 2]) -> [Entry; 3] {
    [
        highest(index, 2),
        Entry::new((index, 1), names[0], U32, Constant, Value(per_turn as i64)),
        Entry::new((index, 2), names[1], U32, Constant, Value(turns as i64)),
    ]
}

/// The COB-ID of a PDO: initially only the first one of each direction exists.
const fn first_exists(number: u16, word: u32) -> Initial {
    OfNode(if number == 0 { word } else { CobId(word).invalidated().0 })
}

/// The communication parameter of a receive PDO, numbered from 0.
const fn rpdo(number: u16) -> [Entry; 4] {
    let index = 0x1400 + number;
    let cob_id = first_exists(number, 0x200 + 0x100 * number as u32);
    [
        highest(index, 5),
        Entry::new((index, 1), "COB-ID used by RPDO", U32, ReadWrite, cob_id),
        Entry::new((index, 2), "Transmission type", U8, ReadWrite, Value(EVERY_SYNC as i64)),
        Entry::new((index, 5), "Event timer", U16, ReadWrite, Value(0)),
    ]
}

/// The communication parameter of a transmit PDO, numbered from 0.
const fn tpdo(number: u16) -> [Entry; 6] {
    let index = 0x1800 + number;
    let cob_id = first_exists(number, CobId::NO_REMOTE_REQUEST | (0x180 + 0x100 * number as u32));
    [
        highest(index, 6),
        Entry::new((index, 1), "COB-ID used by TPDO", U32, ReadWrite, cob_id),
        Entry::new((index, 2), "Transmission type", U8, ReadWrite, Value(EVERY_SYNC as i64)),
        Entry::new((index, 3), "Inhibit time", U16, ReadWrite, Value(0)),
        Entry::new((index, 5), "Event timer", U16, ReadWrite, Value(0)),
        Entry::new((index, 6), "SYNC start value", U8, ReadWrite, Value(0)).within(0, 240),
    ]
}

/// The mapping parameter of a PDO, whose objects follow from the settings.
const fn mapping(index: u16) -> [Entry; MAPPED_MAX + 1] {
    const NAMES: [&str; MAPPED_MAX + 1] = [
        "Number of mapped objects",
        "Mapped object 1",
        "Mapped object 2",
        "Mapped object 3",
        "Mapped object 4",
        "Mapped object 5",
        "Mapped object 6",
        "Mapped object 7",
        "Mapped object 8",
    ];
    let count = plain(index, NAMES[0], U8, ReadWrite, Configured);
    let mut entries = [count.within(0, MAPPED_MAX as i64); MAPPED_MAX + 1];
    let mut place = 1;
    while place <= MAPPED_MAX {
        entries[place] = Entry::new((index, place as u8), NAMES[place], U32, ReadWrite, Configured);
        place += 1;
    }
    entries
}

/// Every object, indices ascending.
#[rustfmt::skip]
pub(crate) static OBJECTS: &[Object] = &[
    var(&[plain(0x1000, "Device type", U32, Constant, Configured)]),
    var(&[plain(0x1001, "Error register", U8, ReadOnly, Value(0)).mapped(Tpdo)]),
    object("Pre-defined error field", Array, &[
        plain(0x1003, "Number of errors", U8, ReadWrite, Value(0)),
        Entry::new((0x1003, 1), "Standard error field 1", U32, ReadOnly, Value(0)),
        Entry::new((0x1003, 2), "Standard error field 2", U32, ReadOnly, Value(0)),
        Entry::new((0x1003, 3), "Standard error field 3", U32, ReadOnly, Value(0)),
        Entry::new((0x1003, 4), "Standard error field 4", U32, ReadOnly, Value(0)),
        Entry::new((0x1003, 5), "Standard error field 5", U32, ReadOnly, Value(0)),
        Entry::new((0x1003, 6), "Standard error field 6", U32, ReadOnly, Value(0)),
        Entry::new((0x1003, 7), "Standard error field 7", U32, ReadOnly, Value(0)),
        Entry::new((0x1003, 8), "Standard error field 8", U32, ReadOnly, Value(0)),
    ]),
    var(&[plain(0x1005, "COB-ID SYNC message", U32, Constant, Value(0x80))]),
    var(&[plain(0x1008, "Manufacturer device name", Text, Constant, Initial::Text("Masseter emulated drive"))]),
    var(&[plain(0x1009, "Manufacturer hardware version", Text, Constant, Initial::Text("emulated"))]),
    var(&[plain(0x100A, "Manufacturer software version", Text, Constant, Initial::Text(env!("CARGO_PKG_VERSION")))]),
    object("Store parameters", Array, &[
        highest(0x1010, 1),
        Entry::new((0x1010, 1), "Save all parameters", U32, ReadWrite, Value(1)),
    ]),
    object("Restore default parameters", Array, &[
        highest(0x1011, 1),
        Entry::new((0x1011, 1), "Restore all default parameters", U32, ReadWrite, Value(1)),
    ]),
    var(&[plain(0x1014, "COB-ID EMCY", U32, ReadWrite, OfNode(0x80))]),
    object("Consumer heartbeat time", Array, &[
        highest(0x1016, CONSUMED as u8),
        Entry::new((0x1016, 1), "Consumer heartbeat time 1", U32, ReadWrite, Configured),
        Entry::new((0x1016, 2), "Consumer heartbeat time 2", U32, ReadWrite, Value(0)),
    ]),
    var(&[plain(0x1017, "Producer heartbeat time", U16, ReadWrite, Configured)]),
    object("Identity object", Record, &[
        highest(0x1018, 4),
        Entry::new((0x1018, 1), "Vendor-ID", U32, Constant, Configured),
        Entry::new((0x1018, 2), "Product code", U32, Constant, Configured),
        Entry::new((0x1018, 3), "Revision number", U32, Constant, Configured),
        Entry::new((0x1018, 4), "Serial number", U32, Constant, OfNode(0)),
    ]),
    var(&[plain(0x1019, "Synchronous counter overflow value", U8, ReadWrite, Value(0)).within(0, 240)]),
    object("Error behaviour", Array, &[
        highest(0x1029, 1),
        Entry::new((0x1029, 1), "Communication error", U8, ReadWrite, Value(0)).within(0, 2),
    ]),
    object("SDO server parameter", Record, &[
        highest(0x1200, 2),
        Entry::new((0x1200, 1), "COB-ID client to server", U32, Constant, OfNode(0x600)),
        Entry::new((0x1200, 2), "COB-ID server to client", U32, Constant, OfNode(0x580)),
    ]),
    object("RPDO 1 communication parameter", Record, &rpdo(0)),
    object("RPDO 2 communication parameter", Record, &rpdo(1)),
    object("RPDO 3 communication parameter", Record, &rpdo(2)),
    object("RPDO 4 communication parameter", Record, &rpdo(3)),
    object("RPDO 1 mapping parameter", Record, &mapping(0x1600)),
    object("RPDO 2 mapping parameter", Record, &mapping(0x1601)),
    object("RPDO 3 mapping parameter", Record, &mapping(0x1602)),
    object("RPDO 4 mapping parameter", Record, &mapping(0x1603)),
    object("TPDO 1 communication parameter", Record, &tpdo(0)),
    object("TPDO 2 communication parameter", Record, &tpdo(1)),
    object("TPDO 3 communication parameter", Record, &tpdo(2)),
    object("TPDO 4 communication parameter", Record, &tpdo(3)),
    object("TPDO 1 mapping parameter", Record, &mapping(0x1A00)),
    object("TPDO 2 mapping parameter", Record, &mapping(0x1A01)),
    object("TPDO 3 mapping parameter", Record, &mapping(0x1A02)),
    object("TPDO 4 mapping parameter", Record, &mapping(0x1A03)),
    var(&[plain(0x2010, "User data", Domain, ReadWrite, Initial::Empty)]),
    var(&[plain(0x6007, "Abort connection option code", I16, ReadWrite, Value(3)).within(0, 3)]),
    var(&[plain(0x603F, "Error code", U16, ReadOnly, Value(0)).mapped(Tpdo)]),
    var(&[plain(0x6040, "Controlword", U16, ReadWrite, Value(0)).mapped(Any)]),
    var(&[plain(0x6041, "Statusword", U16, ReadOnly, Value(0)).mapped(Tpdo)]),
    var(&[plain(0x605A, "Quick stop option code", I16, ReadWrite, Value(2)).within(0, 6)]),
    var(&[plain(0x605B, "Shutdown option code", I16, ReadWrite, Value(0)).within(0, 1)]),
    var(&[plain(0x605C, "Disable operation option code", I16, ReadWrite, Value(0)).within(0, 1)]),
    var(&[plain(0x605D, "Halt option code", I16, ReadWrite, Value(1)).within(1, 2)]),
    var(&[plain(0x605E, "Fault reaction option code", I16, ReadWrite, Value(2)).within(0, 2)]),
    var(&[plain(0x6060, "Modes of operation", I8, ReadWrite, Value(8)).mapped(Any)]),
    var(&[plain(0x6061, "Modes of operation display", I8, ReadOnly, Value(8)).mapped(Tpdo)]),
    var(&[plain(0x6062, "Position demand value", I32, ReadOnly, Value(0)).mapped(Tpdo)]),
    var(&[plain(0x6063, "Position actual internal value", I32, ReadOnly, Value(0)).mapped(Tpdo)]),
    var(&[plain(0x6064, "Position actual value", I32, ReadOnly, Value(0)).mapped(Tpdo)]),
    var(&[plain(0x6065, "Following error window", U32, ReadWrite, Configured)]),
    var(&[plain(0x6066, "Following error time out", U16, ReadWrite, Configured)]),
    var(&[plain(0x6067, "Position window", U32, ReadWrite, Configured)]),
    var(&[plain(0x606B, "Velocity demand value", I32, ReadOnly, Value(0)).mapped(Tpdo)]),
    var(&[plain(0x606C, "Velocity actual value", I32, ReadOnly, Value(0)).mapped(Tpdo)]),
    var(&[plain(0x606D, "Velocity window", U16, ReadWrite, Configured)]),
    var(&[plain(0x606F, "Velocity threshold", U16, ReadWrite, Configured)]),
    var(&[plain(0x6071, "Target torque", I16, ReadWrite, Value(0)).mapped(Any)]),
    var(&[plain(0x6072, "Max torque", U16, ReadWrite, Configured)]),
    // In process data that answer a SYNC, the mean since the last SYNC, so that samples miss no work of a cycle.
    // Otherwise the present value.
    var(&[plain(0x6077, "Torque actual value", I16, ReadOnly, Value(0)).mapped(Tpdo)]),
    var(&[plain(0x607A, "Target position", I32, ReadWrite, Value(0)).mapped(Any)]),
    var(&[plain(0x607C, "Home offset", I32, ReadWrite, Value(0))]),
    object("Software position limit", Array, &[
        highest(0x607D, 2),
        Entry::new((0x607D, 1), "Min position limit", I32, ReadWrite, Configured),
        Entry::new((0x607D, 2), "Max position limit", I32, ReadWrite, Configured),
    ]),
    var(&[positive((0x607F, 0), "Max profile velocity")]),
    var(&[positive((0x6081, 0), "Profile velocity").mapped(Any)]),
    var(&[positive((0x6083, 0), "Profile acceleration").mapped(Any)]),
    var(&[positive((0x6084, 0), "Profile deceleration").mapped(Any)]),
    var(&[positive((0x6085, 0), "Quick stop deceleration")]),
    var(&[plain(0x6087, "Torque slope", U32, ReadWrite, Value(10_000)).within(1, u32::MAX as i64).mapped(Any)]),
    object("Position encoder resolution", Array, &ratio(0x608F, ["Encoder increments", "Motor revolutions"], [INCREMENTS_PER_TURN, 1])),
    object("Gear ratio", Array, &ratio(0x6091, ["Motor revolutions", "Shaft revolutions"], [1, 1])),
    object("Feed constant", Array, &ratio(0x6092, ["Feed", "Shaft revolutions"], [INCREMENTS_PER_TURN, 1])),
    var(&[plain(0x6098, "Homing method", I8, ReadWrite, Value(37))]),
    object("Homing speeds", Array, &[
        highest(0x6099, 2),
        positive((0x6099, 1), "Speed during search for switch"),
        positive((0x6099, 2), "Speed during search for zero"),
    ]),
    var(&[positive((0x609A, 0), "Homing acceleration")]),
    var(&[unit(0x60A8, "SI unit position", INCREMENTS)]),
    var(&[unit(0x60A9, "SI unit velocity", INCREMENTS_PER_S)]),
    var(&[unit(0x60AA, "SI unit acceleration", INCREMENTS_PER_S2)]),
    var(&[plain(0x60B0, "Position offset", I32, ReadWrite, Value(0)).mapped(Any)]),
    var(&[plain(0x60B1, "Velocity offset", I32, ReadWrite, Value(0)).mapped(Any)]),
    var(&[plain(0x60B2, "Torque offset", I16, ReadWrite, Value(0)).mapped(Any)]),
    object("Interpolation time period", Record, &[
        highest(0x60C2, 2),
        Entry::new((0x60C2, 1), "Interpolation time period value", U8, ReadWrite, Configured).within(1, 255),
        Entry::new((0x60C2, 2), "Interpolation time index", I8, ReadWrite, Configured).within(-6, 0),
    ]),
    var(&[plain(0x60F4, "Following error actual value", I32, ReadOnly, Value(0)).mapped(Tpdo)]),
    var(&[plain(0x60FD, "Digital inputs", U32, ReadOnly, Value(0)).mapped(Tpdo)]),
    var(&[plain(0x60FF, "Target velocity", I32, ReadWrite, Value(0)).mapped(Any)]),
    var(&[plain(0x6502, "Supported drive modes", U32, Constant, Value(SUPPORTED_MODES))]),
];

/// Data type of an entry, with its index in the object dictionary (CiA 301, table 44).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DataType {
    /// INTEGER8.
    I8 = 0x02,
    /// INTEGER16.
    I16 = 0x03,
    /// INTEGER32.
    I32 = 0x04,
    /// UNSIGNED8.
    U8 = 0x05,
    /// UNSIGNED16.
    U16 = 0x06,
    /// UNSIGNED32.
    U32 = 0x07,
    /// A constant text (VISIBLE_STRING).
    Text = 0x09,
    /// Bytes (DOMAIN).
    Domain = 0x0F,
}

impl DataType {
    /// Bytes of a value; 0 for a text and a domain, whose lengths are their own.
    pub const fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 => 4,
            Self::Text | Self::Domain => 0,
        }
    }

    /// Whether values may be negative.
    pub const fn is_signed(self) -> bool {
        matches!(self, Self::I8 | Self::I16 | Self::I32)
    }

    /// The number that the lowest bytes of a memory word mean.
    pub const fn number(self, word: u32) -> i64 {
        match self {
            Self::I8 => word as i8 as i64,
            Self::I16 => word as i16 as i64,
            Self::I32 => word as i32 as i64,
            Self::U8 => word as u8 as i64,
            Self::U16 => word as u16 as i64,
            Self::U32 | Self::Text | Self::Domain => word as i64,
        }
    }
}

/// The right to change an entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// Nobody: it never changes.
    Constant,
    /// The drive alone.
    ReadOnly,
    /// Any client.
    ReadWrite,
}

/// Which PDOs an entry may be mapped to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mapping {
    /// None.
    Never,
    /// PDOs that the drive transmits.
    Tpdo,
    /// PDOs of both directions.
    Any,
}

/// The value that an entry has after power-on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Initial {
    /// This one.
    Value(i64),
    /// This one plus the node id.
    OfNode(u32),
    /// One that follows from the settings.
    Configured,
    /// This text.
    Text(&'static str),
    /// No bytes, of a domain.
    Empty,
}

/// An entry of an object.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    /// Index and sub-index.
    pub address: ObjectAddress,
    /// Its name.
    pub name: &'static str,
    /// Its data type.
    pub kind: DataType,
    /// Who changes it.
    pub access: Access,
    /// Which PDOs may carry it.
    pub mapping: Mapping,
    pub(crate) initial: Initial,
    /// Lowest and highest value that may be written; `None` where the type alone limits it.
    pub limits: Option<(i64, i64)>,
}

impl Entry {
    /// An entry that is neither mapped nor limited.
    pub(super) const fn new(
        (index, subindex): (u16, u8),
        name: &'static str,
        kind: DataType,
        access: Access,
        initial: Initial,
    ) -> Self {
        let address = ObjectAddress::new(index, subindex);
        Self { address, name, kind, access, mapping: Mapping::Never, initial, limits: None }
    }

    pub(super) const fn mapped(mut self, mapping: Mapping) -> Self {
        self.mapping = mapping;
        self
    }

    pub(super) const fn within(mut self, lowest: i64, highest: i64) -> Self {
        self.limits = Some((lowest, highest));
        self
    }

    /// Whether a client may write the entry.
    ///
    /// # Errors
    /// [`AbortCode::READ_ONLY`].
    pub(crate) fn check_access(&self) -> Result<(), AbortCode> {
        if self.access == Access::ReadWrite { Ok(()) } else { Err(AbortCode::READ_ONLY) }
    }

    /// The word that a client may write.
    ///
    /// # Errors
    /// The abort code for a wrong length, a value out of range, or an entry that clients may not write.
    pub(crate) fn writable(&self, data: &[u8], is_sized: bool) -> Result<u32, AbortCode> {
        self.check_access()?;
        let bytes = self.kind.bytes();
        if is_sized && data.len() > bytes {
            return Err(AbortCode::TOO_LONG);
        }
        let mut word = [0; 4];
        word[..bytes].copy_from_slice(data.get(..bytes).ok_or(AbortCode::TOO_SHORT)?);
        let word = u32::from_le_bytes(word);
        self.check_limits(word)?;
        Ok(word)
    }

    /// Whether a value keeps to the limits.
    ///
    /// # Errors
    /// [`AbortCode::TOO_HIGH`], [`AbortCode::TOO_LOW`].
    pub(crate) fn check_limits(&self, word: u32) -> Result<(), AbortCode> {
        let value = self.kind.number(word);
        match self.limits {
            Some((_, highest)) if value > highest => Err(AbortCode::TOO_HIGH),
            Some((lowest, _)) if value < lowest => Err(AbortCode::TOO_LOW),
            _ => Ok(()),
        }
    }
}

/// The structure of an object (CiA 301, table 42).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shape {
    Var,
    Array,
    Record,
}

/// An object with its entries, sub-indices ascending.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Object {
    pub(crate) name: &'static str,
    pub(crate) shape: Shape,
    pub(crate) entries: &'static [Entry],
}

impl Object {
    /// Its index.
    pub(crate) const fn index(&self) -> u16 {
        self.entries[0].address.index
    }
}

/// An entry of a mapping parameter: index, sub-index and length in bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct MappingEntry(pub(crate) u32);

impl MappingEntry {
    /// The mapped object.
    pub(crate) const fn object(self) -> ObjectAddress {
        ObjectAddress::new((self.0 >> 16) as u16, (self.0 >> 8) as u8)
    }

    /// Its length in bits.
    pub(crate) const fn bits(self) -> usize {
        (self.0 & 0xFF) as usize
    }
}
