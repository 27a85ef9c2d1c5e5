//! The log of the buses that a step of the bring-up leaves, and what is so in every one of them.

use std::collections::BTreeSet;

/// Identifier and data of the frames of a log.
pub(crate) fn frames(log: &str) -> impl Iterator<Item = (u32, &str)> {
    let frames = log.lines().filter_map(|line| line.split_whitespace().nth(2)?.split_once('#'));
    frames.filter_map(|(id, data)| Some((u32::from_str_radix(id, 16).ok()?, data)))
}

/// The nodes with power after each controlword that a step has sent by SDO. Process data go to such a node alone.
pub(crate) fn powered(log: &str) -> Vec<BTreeSet<u32>> {
    let (mut on, mut all) = (BTreeSet::new(), Vec::new());
    for (id, data) in frames(log) {
        let receiver = id.checked_sub(0x200).filter(|node| (1..0x80).contains(node));
        assert!(receiver.is_none_or(|node| on.contains(&node)), "process data: {id:X}#{data}");
        let node = id.checked_sub(0x600).filter(|node| (1..0x80).contains(node));
        let Some((node, word)) = node.zip(data.strip_prefix("2B406000")) else { continue };
        // Bits 0 and 1: "switch on" and "enable voltage".
        let low = u8::from_str_radix(&word[..2], 16).unwrap();
        if low & 3 == 3 {
            on.insert(node)
        } else {
            low & 2 == 0 && on.remove(&node)
        };
        all.push(on.clone());
    }
    all
}

/// Whether a step gave an axis power. It never gave a second one power, and at its end none had any.
pub(crate) fn moved_one_axis_at_most(step: &str, log: &str) -> bool {
    let powered = powered(log);
    assert!(powered.iter().all(|on| on.len() <= 1), "{step}: {powered:?}");
    assert!(powered.last().is_none_or(BTreeSet::is_empty), "{step}: {powered:?}");
    powered.iter().any(|on| !on.is_empty())
}

/// An inspection asks by SDO uploads, and sends nothing else: no download, no NMT, no SYNC, no controlword. Returns the number of
/// its requests.
pub(crate) fn assert_only_uploads(log: &str) -> usize {
    let mut requests = 0;
    for (id, data) in frames(log) {
        match id {
            // An upload begins with 40h, and its segments are asked for with 60h and 70h.
            0x601..=0x606 => {
                assert!(["40", "60", "70"].contains(&&data[..2]), "{id:X}#{data}");
                requests += 1;
            }
            // Answers, heartbeats and emergencies of the drives.
            0x581..=0x586 | 0x701..=0x706 | 0x081..=0x086 => {}
            _ => panic!("{id:X}#{data}"),
        }
    }
    requests
}
