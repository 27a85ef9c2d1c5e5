//! The number of an error of the operating system.

use std::io;

pub(super) fn errno(error: &io::Error) -> i32 {
    // Only a frame of an unexpected size has no number of the system's.
    error.raw_os_error().unwrap_or(libc::EPROTO)
}
