//! Abort codes of SDO transfers (CiA 301, table 22).

use std::fmt;

/// Abort code. Every number is a valid code; the codes of the standard have names and meanings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct AbortCode(pub u32);

macro_rules! abort_codes {
    ($($name:ident = $code:literal, $meaning:literal;)*) => {
        impl AbortCode {
            $(#[doc = concat!("The ", $meaning, ".")] pub const $name: Self = Self($code);)*

            /// The meaning in the standard; `None` for a code of a manufacturer.
            pub const fn meaning(self) -> Option<&'static str> {
                match self.0 {
                    $($code => Some($meaning),)*
                    _ => None,
                }
            }
        }
    };
}

abort_codes! {
    TOGGLE = 0x0503_0000, "toggle bit did not alternate";
    TIMED_OUT = 0x0504_0000, "SDO protocol timed out";
    UNKNOWN_COMMAND = 0x0504_0001, "command specifier is not valid or unknown";
    OUT_OF_MEMORY = 0x0504_0005, "memory does not suffice";
    UNSUPPORTED_ACCESS = 0x0601_0000, "access to the object is not supported";
    WRITE_ONLY = 0x0601_0001, "object is write-only";
    READ_ONLY = 0x0601_0002, "object is read-only";
    NO_OBJECT = 0x0602_0000, "object does not exist";
    NOT_MAPPABLE = 0x0604_0041, "object cannot be mapped to the PDO";
    PDO_LENGTH = 0x0604_0042, "mapped objects would exceed the PDO's length";
    PARAMETER_INCOMPATIBLE = 0x0604_0043, "parameter is incompatible, or its object is in use";
    INTERNAL_INCOMPATIBILITY = 0x0604_0047, "device is internally incompatible";
    HARDWARE = 0x0606_0000, "hardware failed";
    LENGTH = 0x0607_0010, "length does not match the data type";
    TOO_LONG = 0x0607_0012, "data is longer than its type";
    TOO_SHORT = 0x0607_0013, "data is shorter than its type";
    NO_SUBINDEX = 0x0609_0011, "sub-index does not exist";
    INVALID_VALUE = 0x0609_0030, "value is invalid";
    TOO_HIGH = 0x0609_0031, "value is too high";
    TOO_LOW = 0x0609_0032, "value is too low";
    MAXIMUM_BELOW_MINIMUM = 0x0609_0036, "maximum is below the minimum";
    NOT_AVAILABLE = 0x060A_0023, "resource is not available: no SDO connection";
    GENERAL = 0x0800_0000, "transfer failed";
    NOT_STORED = 0x0800_0020, "data cannot be transferred or stored";
    LOCAL_CONTROL = 0x0800_0021, "data cannot be transferred or stored because of local control";
    DEVICE_STATE = 0x0800_0022, "device's present state does not allow it";
    NO_DICTIONARY = 0x0800_0023, "object dictionary is missing or could not be generated";
    NO_DATA = 0x0800_0024, "object has no data";
}

impl fmt::Display for AbortCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:08X}h", self.0)?;
        self.meaning().map_or(Ok(()), |meaning| write!(f, " ({meaning})"))
    }
}
