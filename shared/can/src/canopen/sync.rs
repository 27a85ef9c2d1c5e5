//! SYNC (CiA 301, 7.2.5) without counter: object 1019 is 0, so the frame is empty.

use super::{Cob, LengthError, exactly};
use crate::frame::Frame;

/// The SYNC frame.
pub fn frame() -> Frame {
    Frame::fixed(Cob::Sync.into(), [])
}

/// Checks the data of a SYNC frame.
///
/// # Errors
/// [`LengthError`] unless the frame is empty: a node sends SYNC with a counter, or another object with this identifier.
pub fn check(data: &[u8]) -> Result<(), LengthError> {
    exactly::<0>("SYNC", data).map(|_| ())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sync_is_empty() {
        assert_eq!(frame().to_string(), "080#");
        assert_eq!(check(frame().data()), Ok(()));
        assert_eq!(check(&[7]), Err(LengthError { object: "SYNC", expected: 0, actual: 1 }));
    }
}
