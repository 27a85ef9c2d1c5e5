//! Any bytes are read as a recording, or refused; what can be read of them can be written again.
#![no_main]

use std::io::Cursor;

use libfuzzer_sys::fuzz_target;
use masseter::recording::{Reader, recover};

fuzz_target!(|bytes: &[u8]| {
    let Ok(mut reader) = Reader::new(Cursor::new(bytes)) else { return };
    while let Ok(Some(_)) = reader.next_message() {}
    let mut again = Reader::new(Cursor::new(bytes)).expect("it could be opened before");
    let _ = recover(&mut again, Cursor::new(Vec::new()));
});
