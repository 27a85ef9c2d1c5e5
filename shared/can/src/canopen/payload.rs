//! The check of the data length, for all codecs.

/// An object of a length that its definition does not allow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("data bytes of {object}: {actual}, expected {expected}")]
pub struct LengthError {
    /// The communication object.
    pub object: &'static str,
    /// Bytes that the definition requires.
    pub expected: usize,
    /// Bytes received.
    pub actual: usize,
}

/// The data as an array of the object's length.
pub(crate) fn exactly<const N: usize>(object: &'static str, data: &[u8]) -> Result<[u8; N], LengthError> {
    data.try_into().map_err(|_| LengthError { object, expected: N, actual: data.len() })
}
