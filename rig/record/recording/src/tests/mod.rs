//! Laws of the recording: flushed messages survive any cut, and no damage goes unnoticed or invents
//! anything.

mod forged;
mod lost_definitions;

use std::io::Cursor;
use std::sync::LazyLock;

use masseter_model::geometry::{Mechanism, MechanismConfig};
use masseter_runtime::messages::{CanData, Command, FrameTap, Message, Reading, State, Truth};
use masseter_scenario::JawConfig;
use proptest::prelude::*;

use super::*;

const CYCLES: u64 = 200;
const CYCLES_A_FLUSH: u64 = 40;
const MILLISECOND_NS: u64 = 1_000_000;

fn scene() -> Scene {
    Scene::new(&Mechanism::new(&MechanismConfig::default()).unwrap(), &JawConfig::default())
}

/// The messages of one cycle.
fn cycle(cycle: u64) -> Vec<Recorded> {
    let now_ns = cycle * MILLISECOND_NS;
    let wave = (cycle as f64 * 0.01).sin();
    let mut command = Command { cycle, target_m: [wave; 6], ..Default::default() };
    let mut reading = Reading { cycle, sampled_ns: now_ns, position_m: [wave; 6], ..Default::default() };
    let mut state = State { cycle, reading_cycle: cycle, sampled_ns: now_ns, ..Default::default() };
    let mut truth = Truth {
        cycle,
        sampled_ns: now_ns,
        position_m: [0.0, 0.0, 0.27 + wave * 0.01],
        quaternion_wxyz: [1.0, 0.0, 0.0, 0.0],
        ..Default::default()
    };
    let mut frame =
        FrameTap { time_ns: now_ns, id: 0x181, data: CanData::new(&[0; 8]), ..Default::default() };
    command.stamp(cycle, now_ns);
    reading.stamp(cycle, now_ns);
    state.stamp(cycle, now_ns);
    truth.stamp(cycle, now_ns);
    frame.stamp(cycle, now_ns);
    vec![
        Recorded::Command(command),
        Recorded::Reading(reading),
        Recorded::State(state),
        Recorded::Truth(truth),
        Recorded::Frame(frame),
    ]
}

/// What the recordings below have attached.
const ATTACHED: &[u8] = b"seed = 1\n";

fn attach<W: Medium>(recorder: &mut Recorder<W>) {
    recorder.attach("scenario.toml", "application/toml", ATTACHED).unwrap();
}

/// A whole recording.
struct Whole {
    bytes: Vec<u8>,
    messages: Vec<Recorded>,
}

static WHOLE: LazyLock<Whole> = LazyLock::new(|| {
    let mut medium = Cursor::new(Vec::new());
    let mut recorder = Recorder::new(&mut medium, scene()).unwrap();
    attach(&mut recorder);
    let mut messages = Vec::new();
    for number in 1..=CYCLES {
        for message in cycle(number) {
            recorder.record(&message, number * MILLISECOND_NS).unwrap();
            messages.push(message);
        }
        if number.is_multiple_of(CYCLES_A_FLUSH) {
            recorder.flush().unwrap();
        }
    }
    recorder.finish().unwrap();
    Whole { bytes: medium.into_inner(), messages }
});

/// Length of the file when each flush was done, and how many messages it holds.
static FLUSHED: LazyLock<Vec<(usize, usize)>> = LazyLock::new(|| {
    let mut medium = Cursor::new(Vec::new());
    let mut flushed = Vec::new();
    for flushes in 0..=CYCLES / CYCLES_A_FLUSH {
        medium = Cursor::new(Vec::new());
        let mut recorder = Recorder::new(&mut medium, scene()).unwrap();
        attach(&mut recorder);
        recorder.flush().unwrap();
        let mut messages = 0;
        for number in 1..=flushes * CYCLES_A_FLUSH {
            for message in cycle(number) {
                recorder.record(&message, number * MILLISECOND_NS).unwrap();
                messages += 1;
            }
            if number.is_multiple_of(CYCLES_A_FLUSH) {
                recorder.flush().unwrap();
            }
        }
        std::mem::forget(recorder);
        flushed.push((medium.get_ref().len(), messages));
    }
    drop(medium);
    flushed
});

struct Read {
    messages: Vec<Recorded>,
    attached: Vec<Vec<u8>>,
    damage: Vec<Damage>,
    cut_short: bool,
}

fn read(bytes: &[u8]) -> Result<Read, ReadError> {
    let mut reader = Reader::new(Cursor::new(bytes))?;
    let mut messages = Vec::new();
    while let Some(message) = reader.next_message()? {
        messages.push(message);
    }
    let attached = reader.attachments().iter().map(|file| file.data.to_vec()).collect();
    Ok(Read { messages, attached, damage: reader.damage().to_vec(), cut_short: reader.was_cut_short() })
}

fn recovered(bytes: &[u8]) -> (Recovered, Vec<u8>) {
    let mut medium = Cursor::new(Vec::new());
    let mut reader = Reader::new(Cursor::new(bytes)).unwrap();
    (recover(&mut reader, &mut medium).unwrap(), medium.into_inner())
}

#[test]
fn what_was_recorded_is_read() {
    let read = read(&WHOLE.bytes).unwrap();
    assert!(read.messages == WHOLE.messages);
    assert_eq!(read.attached, [ATTACHED]);
    assert_eq!(read.damage, []);
    assert!(!read.cut_short);
}

#[test]
fn a_stranger_is_refused_by_its_first_bytes() {
    for bytes in [&b""[..], b"no", b"no recording, but some more bytes", &[0x89, b'M', b'C', b'A', b'P']] {
        assert!(matches!(read(bytes), Err(ReadError::NoMcap { .. })));
    }
}

#[test]
fn a_newer_layout_is_named() {
    let mut medium = Cursor::new(Vec::new());
    let mut recorder = Recorder::new(&mut medium, scene()).unwrap();
    let newer = Reading { seq: 1, version: 99, ..Default::default() };
    recorder.record(&Recorded::Reading(newer), 1).unwrap();
    recorder.finish().unwrap();
    let error = read(medium.get_ref()).err().unwrap().to_string();
    assert!(error.contains("'reading'") && error.contains("version 99"), "{error}");
}

#[test]
fn a_hole_in_the_middle_costs_its_chunk_alone() {
    let mut bytes = WHOLE.bytes.clone();
    let (from, _) = FLUSHED[2];
    let (to, _) = FLUSHED[3];
    // From behind the head of a chunk, before its indexes, into the next chunk.
    bytes.drain(from + 100..to + 7);
    let read = read(&bytes).unwrap();
    let cycles = (CYCLES_A_FLUSH * 5) as usize;
    let expected = [&WHOLE.messages[..2 * cycles], &WHOLE.messages[4 * cycles..]].concat();
    assert!(read.messages == expected, "{} messages", read.messages.len());
    assert_eq!(read.damage.len(), 1, "{:?}", read.damage);
    assert!(!read.cut_short);
}

#[test]
fn bytes_behind_the_end_are_damage_and_no_cut() {
    for more in [&b"x"[..], b"12345678", &WHOLE.bytes] {
        let read = read(&[&WHOLE.bytes, more].concat()).unwrap();
        assert!(read.messages == WHOLE.messages);
        let [behind] = read.damage.as_slice() else { panic!("{:?}", read.damage) };
        assert_eq!(behind.from, WHOLE.bytes.len() as u64);
        assert!(!read.cut_short);
    }
}

#[test]
fn a_flipped_bit_is_damage_and_no_cut() {
    let mut medium = Cursor::new(Vec::new());
    let mut recorder = Recorder::new(&mut medium, scene()).unwrap();
    for message in cycle(1) {
        recorder.record(&message, 0).unwrap();
    }
    recorder.finish().unwrap();
    let mut bytes = medium.into_inner();
    // One bit of each byte, each bit of the eight in turn: all of them take eight times as long.
    for place in 0..bytes.len() {
        let bit = place % 8;
        bytes[place] ^= 1 << bit;
        let read = read(&bytes).unwrap();
        let is_found = !read.damage.is_empty() && !read.cut_short;
        assert!(is_found, "bit {bit} of byte {place}: {:?}", read.damage);
        bytes[place] ^= 1 << bit;
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn whatever_was_flushed_before_a_cut_is_read(cut in 0..WHOLE.bytes.len()) {
        let bytes = &WHOLE.bytes[..cut];
        let Ok(read) = read(bytes) else {
            prop_assert!(cut < FLUSHED[0].0, "the definitions were flushed");
            return Ok(());
        };
        let (_, safe) = FLUSHED.iter().rev().find(|(length, _)| *length <= cut).copied().unwrap_or_default();
        prop_assert!(read.messages.len() >= safe, "{} of {safe} messages", read.messages.len());
        prop_assert!(read.messages == WHOLE.messages[..read.messages.len()]);
        prop_assert!(cut < FLUSHED[0].0 || read.attached == [ATTACHED]);
        prop_assert!(read.cut_short);
    }

    #[test]
    fn a_recovered_recording_is_whole(cut in FLUSHED[0].0..WHOLE.bytes.len()) {
        let bytes = &WHOLE.bytes[..cut];
        let before = read(bytes).unwrap();
        let (_, bytes) = recovered(bytes);
        let after = read(&bytes).unwrap();
        prop_assert!(after.messages == before.messages);
        prop_assert_eq!(after.attached, [ATTACHED]);
        prop_assert_eq!(after.damage, []);
        prop_assert!(!after.cut_short);
    }

    #[test]
    fn flipped_bits_are_noticed_and_invent_nothing(
        flips in prop::collection::vec((0..WHOLE.bytes.len(), 0..8u8), 1..6),
    ) {
        let mut bytes = WHOLE.bytes.clone();
        for (place, bit) in flips {
            bytes[place] ^= 1 << bit;
        }
        prop_assume!(bytes != WHOLE.bytes);
        let read = read(&bytes).unwrap();
        prop_assert!(!read.damage.is_empty());
        let mut written = WHOLE.messages.iter();
        let all_written = read.messages.iter().all(|message| written.any(|known| known == message));
        prop_assert!(all_written, "a message that nobody wrote");
        prop_assert!(read.attached.iter().all(|attached| attached == ATTACHED), "a file that nobody attached");
    }

    #[test]
    fn whatever_is_read_of_a_damaged_recording_is_recovered(
        flips in prop::collection::vec((0..2 * FLUSHED[0].0, 0..8u8), 1..6),
    ) {
        let mut bytes = WHOLE.bytes.clone();
        for (place, bit) in flips {
            bytes[place] ^= 1 << bit;
        }
        let before = read(&bytes);
        prop_assume!(before.is_ok());
        let (_, bytes) = recovered(&bytes);
        let after = read(&bytes).unwrap();
        prop_assert!(after.messages == before.unwrap().messages);
        prop_assert_eq!(after.damage, []);
    }

    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..4096)) {
        let _ = read(&bytes);
        let _ = read(&[mcap::MAGIC, &bytes].concat());
        let _ = read(&[&WHOLE.bytes[..WHOLE.bytes.len() / 2], &bytes].concat());
    }
}
