//! Recordings that no longer say at their beginning what their channels are.

use super::super::writer::LIBRARY;
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

/// Makes the header that of another program.
fn disown(bytes: &mut [u8]) {
    let place = bytes.windows(LIBRARY.len()).position(|found| found == LIBRARY.as_bytes()).unwrap();
    bytes[place] ^= 1;
}

fn channels(bytes: &[u8]) -> Vec<(mcap::records::Channel, Option<Schema>)> {
    let mut reader = Reader::new(Cursor::new(bytes)).unwrap();
    while reader.next_entry().unwrap().is_some() {}
    reader.channels().map(|(channel, schema)| (channel.clone(), schema.cloned())).collect()
}

#[test]
fn they_are_found_again_in_the_index() {
    let mut bytes = without_definitions();
    disown(&mut bytes);
    let read = read(&bytes).unwrap();
    assert!(read.messages == WHOLE.messages);
    assert_eq!(read.damage.len(), 1, "{:?}", read.damage);
}

#[test]
fn a_damaged_index_is_named_and_defines_nothing() {
    let mut bytes = without_definitions();
    disown(&mut bytes);
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

#[test]
fn those_of_this_version_are_known_without_an_index() {
    let mut damaged = without_definitions();
    damage_last(&mut damaged, "reading");
    let (last_flush, _) = FLUSHED[FLUSHED.len() - 1];
    for bytes in [&damaged[..], &without_definitions()[..last_flush]] {
        assert!(read(bytes).unwrap().messages == WHOLE.messages);
        assert_eq!(channels(bytes), channels(&WHOLE.bytes));
    }
}

#[test]
fn a_recovered_recording_is_not_taken_for_one_of_this_version() {
    let (_, saved) = recovered(&WHOLE.bytes);
    let cut_in_its_first_chunk = &saved[..200];
    assert_eq!(channels(cut_in_its_first_chunk), []);
    let of_this_version = &WHOLE.bytes[..200];
    assert_eq!(channels(of_this_version), channels(&WHOLE.bytes));
}
