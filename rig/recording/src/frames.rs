//! CAN frames that were received together as one message of a recording, `masseter/msg/Frames`. A message for each frame
//! would take three times the bytes: most of them repeat stamps, or index messages. Every frame keeps all its fields, and its
//! place among the messages of the other topics.
//!
//! Times are those since the frame before: they repeat from cycle to cycle also where the cycle's begin varies.

use std::array;

use masseter_runtime::messages::{CanData, FrameTap};

use super::encapsulation::CDR_LITTLE_ENDIAN;

/// Most frames of a message; ten cycles of the rig have fewer.
const MOST_FRAMES: u32 = 256;
/// Where the number of frames stands behind the CDR header: behind three stamps, and two times of the first frame.
const COUNT_AT: usize = 40;
/// Bytes up to the first frame.
const HEAD: usize = COUNT_AT + 4;
/// Bytes of a frame before its data: three differences of times, identifier, bus, flags, length of the data.
const FRAME_HEAD: usize = 28;
/// The alignment of a frame.
const ALIGNMENT: usize = 4;

/// Frames that are gathered for a message.
#[derive(Debug, Default)]
pub(super) struct FrameBatch {
    /// Header and body of the message.
    bytes: Vec<u8>,
    first: FrameTap,
    last: FrameTap,
    count: u32,
    /// When the frames were received, ns.
    pub(super) log_time_ns: u64,
}

impl FrameBatch {
    pub(super) const TOPIC: &str = "frames";
    pub(super) const TYPE_NAME: &str = "masseter/msg/Frames";
    pub(super) const DEFINITION: &str = include_str!("../schemas/Frames.msg");

    /// Whether a frame that was received at `log_time_ns` belongs behind those gathered.
    pub(super) fn takes(&self, frame: &FrameTap, log_time_ns: u64) -> bool {
        self.count == 0
            || self.count < MOST_FRAMES
                && log_time_ns == self.log_time_ns
                && self.last.seq.checked_add(1) == Some(frame.seq)
                && frame.version == self.last.version
                && differences_ns(&self.last, frame).iter().all(|ns| i32::try_from(*ns).is_ok())
    }

    /// Adds a frame that it [takes](Self::takes).
    pub(super) fn push(&mut self, frame: &FrameTap, log_time_ns: u64) {
        if self.count == 0 {
            self.begin(frame, log_time_ns);
        }
        self.count += 1;
        let body = self.bytes.len() - CDR_LITTLE_ENDIAN.len();
        self.bytes.resize(CDR_LITTLE_ENDIAN.len() + body.next_multiple_of(ALIGNMENT), 0);
        for difference_ns in differences_ns(&self.last, frame) {
            self.bytes.extend_from_slice(&(difference_ns as i32).to_le_bytes());
        }
        let data = frame.data.as_slice();
        for number in [frame.id, frame.bus, frame.flags, data.len() as u32] {
            self.bytes.extend_from_slice(&number.to_le_bytes());
        }
        self.bytes.extend_from_slice(data);
        self.last = *frame;
    }

    fn begin(&mut self, first: &FrameTap, log_time_ns: u64) {
        (self.first, self.last, self.log_time_ns) = (*first, *first, log_time_ns);
        self.bytes.clear();
        self.bytes.extend_from_slice(&CDR_LITTLE_ENDIAN);
        for number in [first.seq, first.published_ns, first.version, first.time_ns, first.queued_ns] {
            self.bytes.extend_from_slice(&number.to_le_bytes());
        }
        self.bytes.extend_from_slice(&[0; HEAD - COUNT_AT]);
    }

    /// The message, with the first frame; none without frames. Then there are none.
    pub(super) fn end(&mut self) -> Option<(&FrameTap, &[u8])> {
        let count = std::mem::take(&mut self.count);
        let at = CDR_LITTLE_ENDIAN.len() + COUNT_AT;
        self.bytes.get_mut(at..at + 4)?.copy_from_slice(&count.to_le_bytes());
        (count > 0).then_some((&self.first, &self.bytes))
    }
}

/// The times of a frame since those of the frame before: on the wire, in the queue, and when it was published.
fn differences_ns(before: &FrameTap, frame: &FrameTap) -> [i64; 3] {
    let times_ns = |frame: &FrameTap| [frame.time_ns, frame.queued_ns, frame.published_ns];
    let [before_ns, after_ns] = [before, frame].map(times_ns);
    array::from_fn(|time| after_ns[time].wrapping_sub(before_ns[time]).cast_signed())
}

/// The frames of a message's body; none where they do not fill it.
pub(super) fn frames(body: &[u8]) -> Option<Vec<FrameTap>> {
    let (head, mut rest) = body.split_at_checked(HEAD)?;
    let [seq, published_ns, version, time_ns, queued_ns]: [u64; 5] =
        bytemuck::pod_read_unaligned(&head[..COUNT_AT]);
    let count: u32 = bytemuck::pod_read_unaligned(&head[COUNT_AT..]);
    let mut times_ns = [time_ns, queued_ns, published_ns];
    let mut frames = Vec::new();
    for number in 0..u64::from(count) {
        let (frame, behind) = rest.split_at_checked(FRAME_HEAD)?;
        let after_ns: [i32; 3] = bytemuck::pod_read_unaligned(&frame[..12]);
        let [id, bus, flags, length]: [u32; 4] = bytemuck::pod_read_unaligned(&frame[12..]);
        let (data, behind) = behind.split_at_checked(length as usize)?;
        let data = CanData::checked(data)?;
        // The last one is not padded.
        rest = behind.get(data.as_slice().len().wrapping_neg() % ALIGNMENT..).unwrap_or_default();
        times_ns = array::from_fn(|time| times_ns[time].wrapping_add_signed(after_ns[time].into()));
        let [time_ns, queued_ns, published_ns] = times_ns;
        let seq = seq.checked_add(number)?;
        frames.push(FrameTap { seq, published_ns, version, time_ns, queued_ns, id, bus, flags, data });
    }
    rest.is_empty().then_some(frames)
}

#[cfg(test)]
mod tests {
    use masseter_runtime::messages::Message;
    use proptest::prelude::*;

    use super::*;

    fn frame(seq: u64, published_ns: u64) -> FrameTap {
        let mut frame = FrameTap::default();
        frame.stamp(seq, published_ns);
        frame
    }

    fn body(batch: &mut FrameBatch) -> Vec<u8> {
        let (_, bytes) = batch.end().unwrap();
        bytes.strip_prefix(&CDR_LITTLE_ENDIAN).unwrap().to_vec()
    }

    #[test]
    fn a_frame_behind_a_gap_or_of_another_reception_begins_another_message() {
        let mut batch = FrameBatch::default();
        batch.push(&frame(3, 10), 20);
        assert!(batch.takes(&frame(4, 10), 20) && batch.takes(&frame(4, 11), 20), "of two cycles");
        assert!(!batch.takes(&frame(5, 10), 20) && !batch.takes(&frame(4, 10), 21));
        assert!(batch.end().is_some() && batch.end().is_none());
        assert!(batch.takes(&frame(7, 11), 21));
    }

    #[test]
    fn a_frame_seconds_away_begins_another_message() {
        let mut batch = FrameBatch::default();
        batch.push(&FrameTap { time_ns: 5_000_000_000, queued_ns: 4_999_000_000, ..frame(3, 10) }, 1);
        let takes = |time_ns, queued_ns, published_ns| {
            batch.takes(&FrameTap { time_ns, queued_ns, ..frame(4, published_ns) }, 1)
        };
        assert!(takes(7_000_000_000, 3_000_000_000, 2_000_000_000));
        assert!(!takes(8_000_000_000, 4_999_000_000, 10) && !takes(5_000_100_000, 0, 10));
        assert!(!takes(5_000_100_000, 4_999_000_000, 3_000_000_000));
    }

    #[test]
    fn a_body_that_is_cut_or_continued_holds_no_frames() {
        let mut batch = FrameBatch::default();
        for seq in 1..=2 {
            batch.push(&FrameTap { data: CanData::new(&[7; 5]), ..frame(seq, 1) }, 1);
        }
        let body = body(&mut batch);
        assert_eq!(frames(&body).unwrap().len(), 2);
        assert!((0..body.len()).all(|length| frames(&body[..length]).is_none()));
        assert!(frames(&[&body[..], &[0; 4]].concat()).is_none());
    }

    proptest! {
        #[test]
        fn frames_are_read_as_they_were_written(
            first_ns: [u64; 3],
            seen in prop::collection::vec(
                (any::<[i32; 3]>(), any::<[u32; 3]>(), prop::collection::vec(any::<u8>(), 0..=64)),
                1..20,
            ),
        ) {
            let mut times_ns = first_ns;
            let mut written = vec![];
            for (seq, (after_ns, [id, bus, flags], data)) in (4..).zip(seen) {
                let [time_ns, queued_ns, published_ns] = times_ns;
                let data = CanData::new(&data);
                written.push(FrameTap { time_ns, queued_ns, id, bus, flags, data, ..frame(seq, published_ns) });
                times_ns = array::from_fn(|time| times_ns[time].wrapping_add_signed(after_ns[time].into()));
            }
            let mut batch = FrameBatch::default();
            for frame in &written {
                prop_assert!(batch.takes(frame, 1));
                batch.push(frame, 1);
            }
            prop_assert_eq!(frames(&body(&mut batch)), Some(written));
        }
    }
}
