//! Any bytes, or a whole recording with any damage, are read or refused, and nothing is read that was not
//! recorded; whatever can be read can be saved, and then reads the same from a file without damage.

use std::io::Cursor;
use std::sync::LazyLock;

use arbitrary::{Result, Unstructured};
use masseter_model::geometry::{Mechanism, MechanismConfig};
use masseter_recording::{ReadError, Reader, Recorded, Recorder, Scene, recover};
use masseter_runtime::messages::{Message, Reading};
use masseter_scenario::JawConfig;

/// Opcode and length of a record, channel, number and two times of a message.
const LEAST_MESSAGE_BYTES: u64 = 9 + 22;
const CYCLES: u64 = 20;
/// A checksum of 32 bits finds any stretch of damage that is no longer.
const BURST_BYTES: usize = 4;

/// Feeds the target with these bytes.
///
/// # Panics
/// If what the head of this file says does not hold.
pub fn feed(data: &[u8]) {
    // Only the end of the bytes ends the edits.
    let _ = try_out(&mut Unstructured::new(data));
}

fn try_out(bytes: &mut Unstructured<'_>) -> Result<()> {
    match bytes.int_in_range(0..=3)? {
        0 => read_and_save(bytes.bytes(bytes.len())?),
        1 => {
            let mut recording = WHOLE.clone();
            while !bytes.is_empty() {
                overwrite(&mut recording, bytes, 1)?;
            }
            read_and_save(&recording);
        }
        2 => {
            let kept = bytes.int_in_range(0..=WHOLE.len())?;
            let cut = &WHOLE[..kept];
            assert!(RECORDED.starts_with(&messages(cut)), "of {kept} bytes");
            read_and_save(cut);
        }
        _ => {
            let mut recording = WHOLE.clone();
            overwrite(&mut recording, bytes, BURST_BYTES)?;
            let mut recorded = RECORDED.iter();
            for message in messages(&recording) {
                assert!(
                    recorded.any(|known| *known == message),
                    "{message:?} was not recorded in this place"
                );
            }
            read_and_save(&recording);
        }
    }
    Ok(())
}

/// A message with all that belongs to it.
#[derive(Debug, PartialEq)]
struct Found {
    topic: Option<String>,
    /// Name, encoding and data.
    schema: Option<(String, String, Vec<u8>)>,
    channel: u16,
    sequence: u32,
    times_ns: [u64; 2],
    data: Vec<u8>,
}

/// Reads to the end; `None` if nothing is MCAP.
fn read(reader: &mut Reader<Cursor<&[u8]>>) -> Option<Vec<Found>> {
    let mut all = Vec::new();
    loop {
        match reader.next_entry() {
            Ok(None) => break,
            Ok(Some(entry)) => all.push(Found {
                schema: entry
                    .channel
                    .as_ref()
                    .and_then(|channel| channel.schema.as_ref())
                    .map(|schema| (schema.name.clone(), schema.encoding.clone(), schema.data.to_vec())),
                topic: entry.channel.map(|channel| channel.topic.clone()),
                channel: entry.header.channel_id,
                sequence: entry.header.sequence,
                times_ns: [entry.header.log_time, entry.header.publish_time],
                data: entry.data,
            }),
            Err(ReadError::NoMcap { .. }) => return None,
            Err(error) => panic!("memory can be read: {error}"),
        }
    }
    let size = reader.size();
    let damage: Vec<_> = reader.damage().iter().flat_map(|damage| [damage.from, damage.to]).collect();
    assert!(damage.is_sorted() && damage.last().is_none_or(|&end| end <= size), "{damage:?} of {size}");
    assert!(all.len() as u64 * LEAST_MESSAGE_BYTES <= reader.chunks().uncompressed_bytes);
    Some(all)
}

fn read_and_save(bytes: &[u8]) {
    let open = |bytes| Reader::new(Cursor::new(bytes)).expect("memory can be read");
    let Some(mut readable) = read(&mut open(bytes)) else { return };
    let all = readable.len() as u64;
    readable.retain(|found| found.topic.is_some());

    let mut saved = Cursor::new(Vec::new());
    let recovered = recover(&mut open(bytes), &mut saved).expect("what can be read can be saved");
    assert_eq!(recovered.messages, readable.len() as u64);
    assert_eq!(recovered.messages + recovered.undefined, all);

    let mut whole = open(saved.get_ref());
    assert_eq!(read(&mut whole).expect("it was just written"), readable);
    assert!(whole.damage().is_empty() && !whole.was_cut_short());
}

/// The rig's messages, as far as they can be read.
fn messages(bytes: &[u8]) -> Vec<Recorded> {
    let mut reader = Reader::new(Cursor::new(bytes)).expect("memory can be read");
    std::iter::from_fn(|| reader.next_message().ok().flatten()).collect()
}

/// Puts up to so many bytes somewhere into the recording.
fn overwrite(recording: &mut [u8], bytes: &mut Unstructured<'_>, most: usize) -> Result<()> {
    let at = bytes.int_in_range(0..=recording.len() - 1)?;
    for byte in recording[at..].iter_mut().take(most) {
        *byte = bytes.arbitrary()?;
    }
    Ok(())
}

static RECORDED: LazyLock<Vec<Recorded>> =
    LazyLock::new(|| (1..=CYCLES).map(reading).map(Recorded::Reading).collect());

fn reading(cycle: u64) -> Reading {
    let mut reading = Reading { cycle, ..Default::default() };
    reading.stamp(cycle, cycle);
    reading
}

/// Two chunks of messages and all that belongs to them.
static WHOLE: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let mechanism = Mechanism::new(&MechanismConfig::default()).expect("the default is a mechanism");
    let mut medium = Cursor::new(Vec::new());
    let mut recorder =
        Recorder::new(&mut medium, Scene::new(&mechanism, &JawConfig::default())).expect("memory takes all");
    for cycle in 1..=CYCLES {
        recorder.record(&Recorded::Reading(reading(cycle)), cycle).expect("memory takes all");
        if cycle == CYCLES / 2 {
            recorder.flush().expect("memory takes all");
        }
    }
    recorder.finish().expect("memory takes all");
    medium.into_inner()
});
