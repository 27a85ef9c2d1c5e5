//! CAN frames that were published together as one message of a recording, `masseter/msg/Frames`. A message for each frame
//! would take three times the bytes: most of them repeat stamps, or index messages. Every frame keeps all its fields, and its
//! place among the messages of the other topics.

use masseter_shared::messages::{CanData, FrameTap};

use super::encapsulation::CDR_LITTLE_ENDIAN;

/// Most frames of a message; a cycle of the rig has fewer.
const MOST_FRAMES: u32 = 256;
/// Where the number of frames stands behind the CDR header: behind three stamps, and two times of the first frame.
const COUNT_AT: usize = 40;
/// Bytes up to the first frame.
const HEAD: usize = COUNT_AT + 4;
/// Bytes of a frame before its data: two differences of times, identifier, bus, flags, length of the data.
const FRAME_HEAD: usize = 24;
/// The alignment of a frame.
const ALIGNMENT: usize = 4;

/// Frames that are gathered for a message.
#[derive(Debug, Default)]
pub(super) struct FrameBatch {
    /// Header and body of the message.
    bytes: Vec<u8>,
    /// The first frame.
    first: FrameTap,
    count: u32,
    /// When the first frame was received, ns.
    pub(super) log_time_ns: u64,
}

impl FrameBatch {
    pub(super) const TOPIC: &str = "frames";
    pub(super) const TYPE_NAME: &str = "masseter/msg/Frames";
    pub(super) const DEFINITION: &str = include_str!("../schemas/Frames.msg");

    /// Whether a frame belongs behind those gathered.
    pub(super) fn takes(&self, frame: &FrameTap) -> bool {
        let first = &self.first;
        self.count == 0
            || self.count < MOST_FRAMES
                && frame.seq == first.seq + u64::from(self.count)
                && (frame.published_ns, frame.version) == (first.published_ns, first.version)
                && self
                    .differences_ns(frame)
                    .iter()
                    .all(|difference_ns| i32::try_from(*difference_ns).is_ok())
    }

    /// The times of a frame since those of the first: on the wire, and in the queue.
    fn differences_ns(&self, frame: &FrameTap) -> [i64; 2] {
        let FrameTap { time_ns, queued_ns, .. } = self.first;
        [frame.time_ns.wrapping_sub(time_ns), frame.queued_ns.wrapping_sub(queued_ns)].map(u64::cast_signed)
    }

    /// Adds a frame that it [takes](Self::takes).
    pub(super) fn push(&mut self, frame: &FrameTap, log_time_ns: u64) {
        if self.count == 0 {
            (self.first, self.log_time_ns) = (*frame, log_time_ns);
            self.bytes.clear();
            self.bytes.extend_from_slice(&CDR_LITTLE_ENDIAN);
            for number in [frame.seq, frame.published_ns, frame.version, frame.time_ns, frame.queued_ns] {
                self.bytes.extend_from_slice(&number.to_le_bytes());
            }
            self.bytes.extend_from_slice(&[0; HEAD - COUNT_AT]);
        }
        self.count += 1;
        let body = self.bytes.len() - CDR_LITTLE_ENDIAN.len();
        self.bytes.resize(CDR_LITTLE_ENDIAN.len() + body.next_multiple_of(ALIGNMENT), 0);
        for difference_ns in self.differences_ns(frame) {
            self.bytes.extend_from_slice(&(difference_ns as i32).to_le_bytes());
        }
        let data = frame.data.as_slice();
        for number in [frame.id, frame.bus, frame.flags, data.len() as u32] {
            self.bytes.extend_from_slice(&number.to_le_bytes());
        }
        self.bytes.extend_from_slice(data);
    }

    /// The message, with the first frame; none without frames. Then there are none.
    pub(super) fn end(&mut self) -> Option<(&FrameTap, &[u8])> {
        let count = std::mem::take(&mut self.count);
        let at = CDR_LITTLE_ENDIAN.len() + COUNT_AT;
        self.bytes.get_mut(at..at + 4)?.copy_from_slice(&count.to_le_bytes());
        (count > 0).then_some((&self.first, &self.bytes))
    }
}

/// The frames of a message's body; none where they do not fill it.
pub(super) fn frames(body: &[u8]) -> Option<Vec<FrameTap>> {
    let (head, mut rest) = body.split_at_checked(HEAD)?;
    let [seq, published_ns, version, first_ns, first_queued_ns]: [u64; 5] =
        bytemuck::pod_read_unaligned(&head[..COUNT_AT]);
    let count: u32 = bytemuck::pod_read_unaligned(&head[COUNT_AT..]);
    let mut frames = Vec::new();
    for number in 0..u64::from(count) {
        let (frame, behind) = rest.split_at_checked(FRAME_HEAD)?;
        let [after_ns, queued_after_ns]: [i32; 2] = bytemuck::pod_read_unaligned(&frame[..8]);
        let [id, bus, flags, length]: [u32; 4] = bytemuck::pod_read_unaligned(&frame[8..]);
        let (data, behind) = behind.split_at_checked(length as usize)?;
        let data = CanData::checked(data)?;
        // The last one is not padded.
        rest = behind.get(data.as_slice().len().wrapping_neg() % ALIGNMENT..).unwrap_or_default();
        let time_ns = first_ns.wrapping_add_signed(after_ns.into());
        let queued_ns = first_queued_ns.wrapping_add_signed(queued_after_ns.into());
        let seq = seq.checked_add(number)?;
        frames.push(FrameTap { seq, published_ns, version, time_ns, queued_ns, id, bus, flags, data });
    }
    rest.is_empty().then_some(frames)
}

#[cfg(test)]
mod tests {
    use masseter_shared::messages::Message;
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
    fn a_frame_behind_a_gap_or_of_another_time_begins_another_message() {
        let mut batch = FrameBatch::default();
        batch.push(&frame(3, 10), 1);
        assert!(batch.takes(&frame(4, 10)));
        assert!(!batch.takes(&frame(5, 10)) && !batch.takes(&frame(4, 11)));
        assert!(batch.end().is_some() && batch.end().is_none());
        assert!(batch.takes(&frame(7, 11)));
    }

    #[test]
    fn a_frame_seconds_away_begins_another_message() {
        let mut batch = FrameBatch::default();
        batch.push(&FrameTap { time_ns: 5_000_000_000, queued_ns: 4_999_000_000, ..frame(3, 10) }, 1);
        let at = |time_ns, queued_ns| FrameTap { time_ns, queued_ns, ..frame(4, 10) };
        assert!(batch.takes(&at(7_000_000_000, 3_000_000_000)));
        assert!(!batch.takes(&at(8_000_000_000, 4_999_000_000)) && !batch.takes(&at(5_000_100_000, 0)));
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
            first_ns: u64,
            first_queued_ns: u64,
            seen in prop::collection::vec(
                (any::<[i32; 2]>(), any::<[u32; 3]>(), prop::collection::vec(any::<u8>(), 0..=64)),
                1..20,
            ),
        ) {
            let mut written = vec![FrameTap { time_ns: first_ns, queued_ns: first_queued_ns, ..frame(4, 9) }];
            written.extend((5..).zip(seen).map(|(seq, ([after_ns, queued_after_ns], [id, bus, flags], data))| {
                let time_ns = first_ns.wrapping_add_signed(after_ns.into());
                let queued_ns = first_queued_ns.wrapping_add_signed(queued_after_ns.into());
                FrameTap { time_ns, queued_ns, id, bus, flags, data: CanData::new(&data), ..frame(seq, 9) }
            }));
            let mut batch = FrameBatch::default();
            for frame in &written {
                prop_assert!(batch.takes(frame));
                batch.push(frame, 1);
            }
            prop_assert_eq!(frames(&body(&mut batch)), Some(written));
        }
    }
}
