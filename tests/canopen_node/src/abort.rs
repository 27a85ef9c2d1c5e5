//! Abort codes of SDO (CiA 301, table 22).

/// The code with which the server refuses a transfer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Abort(pub(crate) u32);

impl Abort {
    pub(crate) const TOGGLE: Self = Self(0x0503_0000);
    pub(crate) const COMMAND: Self = Self(0x0504_0001);
    pub(crate) const WRITE_ONLY: Self = Self(0x0601_0001);
    pub(crate) const READ_ONLY: Self = Self(0x0601_0002);
    pub(crate) const NO_OBJECT: Self = Self(0x0602_0000);
    pub(crate) const NOT_MAPPABLE: Self = Self(0x0604_0041);
    pub(crate) const PDO_LENGTH: Self = Self(0x0604_0042);
    pub(crate) const TOO_LONG: Self = Self(0x0607_0012);
    pub(crate) const TOO_SHORT: Self = Self(0x0607_0013);
    pub(crate) const NO_SUBINDEX: Self = Self(0x0609_0011);
    pub(crate) const VALUE: Self = Self(0x0609_0030);
    pub(crate) const TOO_HIGH: Self = Self(0x0609_0031);
    pub(crate) const TOO_LOW: Self = Self(0x0609_0032);
    pub(crate) const NOT_STORED: Self = Self(0x0800_0020);
    pub(crate) const DEVICE_STATE: Self = Self(0x0800_0022);
}
