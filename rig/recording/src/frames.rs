//! CAN frames that were published together as one message of a recording, `masseter/msg/Frames`. A message for each frame
//! would take three times the bytes: most of them repeat stamps, or index messages. Every frame keeps all its fields, and its
//! place among the messages of the other topics.

use masseter_shared::messages::{CanData, FrameTap};

use super::encoding::CDR_LITTLE_ENDIAN;

/// Most frames of a message; a cycle of the rig has fewer.
const MOST_FRAMES: u32 = 256;
/// Bytes behind the CDR header up to the first frame, and where the number of frames stands among them.
const HEAD: usize = 40;
const COUNT_AT: usize = 32;
/// Bytes of a frame before its data: two differences of times, identifier, bus, flags, length of the data.
const FRAME_HEAD: usize = 32;
/// The alignment of a frame.
const ALIGNMENT: usize = 8;

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
    }

    /// Adds a frame that it [takes](Self::takes).
    pub(super) fn push(&mut self, frame: &FrameTap, log_time_ns: u64) {
        if self.count == 0 {
            (self.first, self.log_time_ns) = (*frame, log_time_ns);
            self.bytes.clear();
            self.bytes.extend_from_slice(&CDR_LITTLE_ENDIAN);
            for stamp in [frame.seq, frame.published_ns, frame.version, frame.time_ns, 0] {
                self.bytes.extend_from_slice(&stamp.to_le_bytes());
            }
        }
        self.count += 1;
        let body = self.bytes.len() - CDR_LITTLE_ENDIAN.len();
        self.bytes.resize(CDR_LITTLE_ENDIAN.len() + body.next_multiple_of(ALIGNMENT), 0);
        let after_ns = frame.time_ns.wrapping_sub(self.first.time_ns);
        let waited_ns = if frame.queued_ns == 0 { 0 } else { frame.time_ns.wrapping_sub(frame.queued_ns) };
        for time in [after_ns, waited_ns] {
            self.bytes.extend_from_slice(&time.to_le_bytes());
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
    let [seq, published_ns, version, first_ns]: [u64; 4] = bytemuck::pod_read_unaligned(&head[..COUNT_AT]);
    let [count, unused]: [u32; 2] = bytemuck::pod_read_unaligned(&head[COUNT_AT..]);
    let mut frames = Vec::new();
    for number in 0..u64::from(count) {
        let (frame, behind) = rest.split_at_checked(FRAME_HEAD)?;
        let [after_ns, waited_ns]: [u64; 2] = bytemuck::pod_read_unaligned(&frame[..16]);
        let [id, bus, flags, length]: [u32; 4] = bytemuck::pod_read_unaligned(&frame[16..]);
        let (data, behind) = behind.split_at_checked(length as usize)?;
        let padding = length.next_multiple_of(ALIGNMENT as u32) - length;
        rest = behind.get(padding as usize..).unwrap_or_default();
        let time_ns = first_ns.wrapping_add(after_ns);
        let queued_ns = if waited_ns == 0 { 0 } else { time_ns.wrapping_sub(waited_ns) };
        let (seq, data) = (seq.checked_add(number)?, CanData::checked(data)?);
        frames.push(FrameTap { seq, published_ns, version, time_ns, queued_ns, id, bus, flags, data });
    }
    (unused == 0 && rest.is_empty()).then_some(frames)
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
            seen in prop::collection::vec(
                (any::<u64>(), 1..u64::MAX, any::<bool>(), any::<[u32; 3]>(), prop::collection::vec(any::<u8>(), 0..=64)),
                1..20,
            ),
        ) {
            let written: Vec<_> = (5..).zip(seen).map(|(seq, (time_ns, waited_ns, is_known, [id, bus, flags], data))| {
                let queued_ns = if is_known { time_ns.wrapping_sub(waited_ns) } else { 0 };
                FrameTap { time_ns, queued_ns, id, bus, flags, data: CanData::new(&data), ..frame(seq, 9) }
            }).collect();
            let mut batch = FrameBatch::default();
            for frame in &written {
                prop_assert!(batch.takes(frame));
                batch.push(frame, 1);
            }
            prop_assert_eq!(frames(&body(&mut batch)), Some(written));
        }
    }
}
