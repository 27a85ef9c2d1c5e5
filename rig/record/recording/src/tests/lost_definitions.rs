//! Recordings whose channel definitions at the beginning are damaged.

use super::*;

/// A recording whose definitions at the beginning are damaged.
fn without_definitions() -> Vec<u8> {
    let mut bytes = WHOLE.bytes.clone();
    let (first_chunk_ends, _) = FLUSHED[0];
    bytes[first_chunk_ends - 100] ^= 0xff;
    bytes
}

/// Flips a bit of the last place where `word` stands.
fn damage_last(bytes: &mut [u8], word: &str) {
    let place = bytes.windows(word.len()).rposition(|found| found == word.as_bytes()).unwrap();
    bytes[place + word.len() - 1] ^= 1;
}

fn channels(bytes: &[u8]) -> Vec<mcap::Channel<'static>> {
    let mut reader = Reader::new(Cursor::new(bytes)).unwrap();
    while reader.next_entry().unwrap().is_some() {}
    reader.channels().cloned().collect()
}

#[test]
fn they_are_found_again_in_the_index() {
    let bytes = without_definitions();
    let read = read(&bytes).unwrap();
    assert!(read.messages == WHOLE.messages);
    assert_eq!(read.damage.len(), 1, "{:?}", read.damage);
}

#[test]
fn a_damaged_index_is_named_and_defines_nothing() {
    let mut bytes = without_definitions();
    damage_last(&mut bytes, "reading");
    let read = read(&bytes).unwrap();
    assert_eq!(read.messages, []);
    let [_, index] = read.damage.as_slice() else { panic!("{:?}", read.damage) };
    assert!(index.reason.contains("the index has checksum"), "{index}");
    assert_eq!(channels(&bytes), []);
    let (recovered, _) = recovered(&bytes);
    assert!(recovered.messages == 0 && recovered.undefined > 0, "{recovered:?}");
}

#[test]
fn a_damaged_index_renames_nothing() {
    let mut bytes = WHOLE.bytes.clone();
    damage_last(&mut bytes, "reading");
    assert_eq!(channels(&bytes), channels(&WHOLE.bytes));
}
