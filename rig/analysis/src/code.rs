//! Codes in messages. A recording of another version may hold codes that this program does not know.

use std::fmt;

use serde::{Serialize, Serializer};

/// The meaning of a code, or its number where the code has no meaning in this version.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Code<T> {
    /// The meaning.
    Known(T),
    /// The number.
    Unknown(u32),
}

impl<T: TryFrom<u32>> From<u32> for Code<T> {
    fn from(code: u32) -> Self {
        T::try_from(code).map_or(Self::Unknown(code), Self::Known)
    }
}

impl<T: PartialEq> PartialEq<T> for Code<T> {
    fn eq(&self, other: &T) -> bool {
        matches!(self, Self::Known(known) if known == other)
    }
}

impl<T: fmt::Display> fmt::Display for Code<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Known(known) => known.fmt(f),
            Self::Unknown(code) => write!(f, "code {code}"),
        }
    }
}

/// As its name.
impl<T: fmt::Display> Serialize for Code<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use masseter_runtime::messages::codes::EventKind;

    use super::*;

    #[test]
    fn a_code_is_written_as_its_name_and_an_unknown_code_as_its_number() {
        let fault = Code::<EventKind>::from(EventKind::Fault.code());
        assert!(fault == EventKind::Fault && fault != EventKind::Transition);
        let unknown = Code::<EventKind>::from(4000);
        assert!(EventKind::ALL.iter().all(|kind| unknown != *kind));
        assert_eq!(serde_json::to_string(&[fault, unknown]).unwrap(), r#"["fault","code 4000"]"#);
    }
}
