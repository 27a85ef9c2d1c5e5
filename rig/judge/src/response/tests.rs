//! Messages of made-up buses beside the bounds of their plan.

use masseter_can::{Bitrate, ErrorKind, ErrorReport};
use masseter_runtime::messages::tap;

use super::*;

const PERIOD_NS: u64 = 1_000_000;

fn message(name: &str, id: u16, data_length: u32) -> PeriodicMessage {
    PeriodicMessage {
        name: name.to_owned(),
        id: CanId::standard(id).unwrap(),
        data_length,
        period_ns: PERIOD_NS,
        deadline_ns: PERIOD_NS,
        release: None,
    }
}

/// SYNC and one message of 8 bytes: bounds of 55 + 135 µs for both.
fn responses(has_faults: bool) -> Responses {
    let messages = vec![message("SYNC", 0x080, 0), message("TPDO1 1", 0x181, 8)];
    let plan = BusPlan::new(0, Bitrate::MAX, PERIOD_NS, messages).unwrap();
    Responses::with(vec![plan], has_faults.then_some(FAULTS))
}

fn seen(id: u32, queued_ns: u64, took_us: u64) -> FrameTap {
    FrameTap { id, queued_ns, time_ns: queued_ns + took_us * 1000, ..FrameTap::default() }
}

fn followed_without_faults(frames: impl IntoIterator<Item = FrameTap>) -> BusResponse {
    followed(responses(false), frames)
}

fn followed(mut responses: Responses, frames: impl IntoIterator<Item = FrameTap>) -> BusResponse {
    frames.into_iter().for_each(|frame| take(&mut responses, &frame));
    responses.into_figures(0)
}

fn take(responses: &mut Responses, frame: &FrameTap) {
    responses.apply_frame(frame, tap::bus_of(frame).unwrap(), &tap::decode(frame).unwrap());
}

#[test]
fn the_longest_of_each_message_stands_beside_its_bound() {
    let found = followed_without_faults([
        seen(0x080, 1000, 51),
        seen(0x080, 1_001_000, 120),
        seen(0x181, 1000, 190),
        seen(0x601, 5, 99),
    ]);
    assert_eq!(found.unbounded, None);
    let told: Vec<_> =
        found.messages.iter().map(|m| (m.message.as_str(), m.frames, m.max_ns, m.bound_ns)).collect();
    assert_eq!(
        told,
        [
            ("SYNC", 2, Some(120_000), Some(190_000)),
            ("TPDO1 1", 1, Some(190_000), Some(190_000)),
            ("other", 1, Some(99_000), None)
        ]
    );
    assert_eq!(found.exceeding().count(), 0);
    assert_eq!(found.tightest().unwrap().message, "TPDO1 1");
}

#[test]
fn a_message_beyond_its_bound_is_found() {
    let found = followed_without_faults([seen(0x080, 1000, 191), seen(0x181, 1000, 190)]);
    assert_eq!(found.unbounded, None);
    assert!(found.exceeding().map(|message| message.message.as_str()).eq(["SYNC"]));
}

#[test]
fn there_are_no_bounds_of_disturbed_buses_of_crowded_ones_and_of_unknown_times() {
    let report = ErrorReport { time_ns: 2000, port: 1, kind: ErrorKind::Bit, tec: 8, rec: 0 };
    let error = tap::encode(0, &Tapped::Error(report));
    let cases = [
        (vec![], "no frame of bus 0 was recorded"),
        (vec![seen(0x080, 0, 0)], "lacks the queuing times of the frames"),
        (vec![seen(0x080, 1000, 51), error], "bus 0 had 1 error"),
        (
            vec![seen(0x080, 1000, 51), seen(0x080, 61_000, 51)],
            "2 of 2 frames of bus 0 were early or late beside a stall",
        ),
        (
            vec![seen(0x080, 1000, 51), seen(0x080, 1000, 102)],
            "2 of 2 frames of bus 0 were early or late beside a stall",
        ),
    ];
    for (frames, reason) in cases {
        let found = followed_without_faults(frames.clone());
        let why = found.unbounded.as_ref();
        assert!(why.is_some_and(|why| why.contains(reason)), "{frames:?}: {found:?}");
        assert!(found.messages.iter().all(|message| message.bound_ns.is_none()), "{found:?}");
    }
}

/// SYNC of cycle 100 comes late or early, and frames of that and the next cycles wait for each other.
#[test]
fn frames_beside_a_stall_are_not_judged_and_the_others_are() {
    let run = |shift_us: i64, crowded: std::ops::RangeInclusive<u64>| {
        followed_without_faults((1..=400).flat_map(move |cycle| {
            let shift_ns = if cycle == 100 { shift_us * 1000 } else { 0 };
            let at_ns = (cycle * PERIOD_NS).saturating_add_signed(shift_ns);
            let took_us = if crowded.contains(&cycle) { 500 } else { 120 };
            [seen(0x080, at_ns, took_us), seen(0x181, at_ns + 60_000, took_us)]
        }))
    };
    for (shift_us, off_time) in [(600, 9), (700, 9), (-600, 8)] {
        let found = run(shift_us, 99..=101);
        assert_eq!((found.unbounded.as_deref(), found.off_time_frames), (None, off_time), "{shift_us}");
        assert_eq!(found.exceeding().count(), 0, "{found:?}");
        assert_eq!(run(shift_us, 100..=104).exceeding().count(), 2, "they wait longer than a stall explains");
    }
    // However many frames are off their times, the others are judged.
    for (slow, exceeding) in [(0, 0), (397, 2)] {
        let found = followed_without_faults((1..=400).flat_map(move |cycle| {
            let shift_ns = if cycle % 4 == 1 && cycle < 390 { 600_000 } else { 0 };
            let at_ns = cycle * PERIOD_NS + shift_ns;
            let took_us = if cycle == slow { 500 } else { 120 };
            [seen(0x080, at_ns, took_us), seen(0x181, at_ns + 60_000, took_us)]
        }));
        assert!(found.off_time_frames > 400 && found.unbounded.is_none(), "{found:?}");
        assert_eq!(found.exceeding().count(), exceeding, "{found:?}");
    }
    let kept = run(0, 100..=100);
    assert_eq!((kept.off_time_frames, kept.exceeding().count()), (0, 2), "nothing explains their waiting");
}

#[test]
fn of_a_part_of_the_frames_nothing_is_judged() {
    let mut responses = responses(false);
    take(&mut responses, &seen(0x080, 1000, 191));
    let found = responses.into_figures(3);
    assert_eq!(found.unbounded.as_deref(), Some("the recording lacks 3 frames"));
    assert_eq!(found.exceeding().count(), 0);
}

#[test]
fn with_faults_there_are_no_bounds() {
    let found = followed(responses(true), [seen(0x080, 1000, 191), seen(0x181, 1000, 190)]);
    assert_eq!(found.unbounded.as_deref(), Some("the scenario's faults are in no plan"));
    assert_eq!((found.exceeding().count(), found.tightest()), (0, None));
}

#[test]
fn every_message_of_a_rig_has_a_bound() {
    let sync = CanId::from(Cob::Sync).flagged();
    assert_eq!(sync, 0x080);
    let syncs = [0, 1].map(|bus| FrameTap { bus, ..seen(sync, 1000, 51) });
    let found = followed(Responses::for_scenario(&Scenario::default()), syncs);
    assert!(found.messages.iter().all(|message| message.message == "other" || message.bound_ns.is_some()));
    assert_eq!(found.messages.len(), 2 * (1 + 3 + 3 + 4 + 1));
}
