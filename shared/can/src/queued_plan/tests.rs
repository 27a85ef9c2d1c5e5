//! The bounds beside examples, and beside simulated buses.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::*;

fn message(id: u16, data_length: u32, node: usize, queueing: Queueing) -> QueuedMessage {
    let (name, id) = (format!("{id:03X}"), CanId::standard(id).unwrap());
    QueuedMessage { name, id, data_length, node, queueing }
}

fn after(by: u16, within_ns: u64) -> Queueing {
    Queueing::After(Release { by: CanId::standard(by).unwrap(), within_ns })
}

fn latest_us(cycle_us: u64, queues: &[Queue], messages: &[QueuedMessage]) -> Vec<Option<u64>> {
    let latest = latest_arrivals(Bitrate::MAX, cycle_us * 1000, queues, messages).unwrap();
    latest.iter().map(|latest| latest.latest_ns.map(|ns| ns / 1000)).collect()
}

fn wire_ns(message: &QueuedMessage) -> u64 {
    Bitrate::MAX.bits_to_ns(worst_case_bits(message.data_length, false))
}

/// A bus of up to five nodes with any queues, messages and times.
struct RandomBus {
    cycle_ns: u64,
    queues: Vec<Queue>,
    messages: Vec<QueuedMessage>,
}

impl RandomBus {
    fn new(random: &mut Pcg32) -> Self {
        let mut ids: Vec<u16> = (1..80).collect();
        let mut queues = Vec::new();
        let mut drafts: Vec<(u16, u32, usize, Draft)> = Vec::new();
        for node in 0..random.random_range(1..=5) {
            queues.push(if random.random_bool(0.6) { Queue::Fifo } else { Queue::Priority });
            let mut id = || ids.swap_remove(random.random_range(0..ids.len()));
            let answer = id();
            let (sporadic, cyclic) = ([id(), id()], [id(), id(), id()]);
            let releasers: Vec<_> = drafts
                .iter()
                .filter(|(id, _, _, draft)| *id < answer && !matches!(draft, Draft::Apart(_)))
                .collect();
            if !releasers.is_empty() && random.random_bool(0.6) {
                let by = releasers[random.random_range(0..releasers.len())].0;
                let within = if random.random_bool(0.5) { 0 } else { random.random_range(0..300) };
                drafts.push((answer, random.random_range(0..=8), node, Draft::After(by, within)));
                // Two answers at once have no order in a FIFO.
                let others = cyclic.into_iter().filter(|&id| id > by && queues[node] == Queue::Priority);
                for id in others {
                    drafts.push((id, random.random_range(0..=8), node, Draft::After(by, within)));
                }
            } else {
                let mut by: Vec<u64> = (0..random.random_range(1..=3))
                    .map(|_| [0, random.random_range(0..1000)][random.random_range(0..2)])
                    .collect();
                by.sort_unstable();
                for (id, by) in cyclic.into_iter().zip(by) {
                    drafts.push((id, random.random_range(0..=8), node, Draft::By(by)));
                }
            }
            for id in &sporadic[..random.random_range(0..=2)] {
                let apart = random.random_range(300..5000);
                drafts.push((*id, random.random_range(0..=8), node, Draft::Apart(apart)));
            }
        }
        let cyclic = drafts.iter().filter(|(.., draft)| !matches!(draft, Draft::Apart(_)));
        let load_ns: u64 =
            cyclic.map(|&(id, length, node, _)| wire_ns(&message(id, length, node, Queueing::By(0)))).sum();
        let cycle_ns = load_ns * random.random_range(1200..4000) / 1000;
        let scaled = |permille: u64| cycle_ns * permille / 1000;
        let messages = drafts.into_iter().map(|(id, length, node, draft)| {
            let queueing = match draft {
                Draft::By(by) => Queueing::By(scaled(by)),
                Draft::After(by, within) => after(by, scaled(within)),
                Draft::Apart(apart) => Queueing::Apart(scaled(apart)),
            };
            message(id, length, node, queueing)
        });
        Self { cycle_ns, queues, messages: messages.collect() }
    }

    /// The longest times of all messages in a few cycles, in which most things happen at the worst time.
    fn simulate(&self, random: &mut Pcg32) -> Vec<u64> {
        let Self { cycle_ns, queues, messages } = self;
        let until_ns = 6 * cycle_ns;
        let sporadic_goes_first = random.random_bool(0.5);
        // Frames to come: time, order at one time, message, begin of its cycle or time of its queueing.
        let mut events: Vec<(u64, usize, usize, u64)> = Vec::new();
        let bys: Vec<_> = messages
            .iter()
            .filter_map(|message| match message.queueing {
                Queueing::By(by_ns) => Some(by_ns),
                _ => None,
            })
            .collect();
        let worst_ns = 2 * cycle_ns + bys[random.random_range(0..bys.len())];
        let mut last_ns = vec![0; queues.len()];
        for cycle in 0..6 {
            for (index, message) in messages.iter().enumerate() {
                let Queueing::By(by_ns) = message.queueing else { continue };
                let early_ns = if random.random_bool(0.8) { 0 } else { random.random_range(0..=by_ns) };
                let at_ns = (cycle * cycle_ns + by_ns - early_ns).max(last_ns[message.node]);
                last_ns[message.node] = at_ns;
                if random.random_bool(0.95) {
                    events.push((at_ns, messages.len() + index, index, cycle * cycle_ns));
                }
            }
        }
        for (index, message) in messages.iter().enumerate() {
            let Queueing::Apart(apart_ns) = message.queueing else { continue };
            let near_ns = random.random_range(0..*cycle_ns);
            let near = [worst_ns, worst_ns - 1, worst_ns - near_ns, worst_ns + near_ns];
            let mut at_ns = near[random.random_range(0..4)];
            while at_ns < until_ns {
                let order = if sporadic_goes_first { index } else { 2 * messages.len() + index };
                events.push((at_ns, order, index, at_ns));
                at_ns +=
                    apart_ns + if random.random_bool(0.8) { 0 } else { random.random_range(0..*cycle_ns) };
            }
        }
        let (mut now_ns, mut longest_ns) = (0, vec![0; messages.len()]);
        loop {
            // Of each node the frame at the head of its queue.
            events.sort_unstable();
            let waiting = || events.iter().enumerate().filter(|(_, event)| event.0 <= now_ns);
            let heads = queues.iter().enumerate().filter_map(|(node, queue)| {
                let mut of_node = waiting().filter(|(_, event)| messages[event.2].node == node);
                match queue {
                    Queue::Fifo => of_node.next(),
                    Queue::Priority => of_node.min_by_key(|(_, event)| messages[event.2].id),
                }
            });
            let Some((place, _)) = heads.min_by_key(|(_, event)| messages[event.2].id) else {
                let Some(&(next_ns, ..)) = events.first() else { return longest_ns };
                now_ns = next_ns;
                continue;
            };
            let (_, _, sent, begin_ns) = events.remove(place);
            let shorter_ns = if random.random_bool(0.9) { 0 } else { random.random_range(0..10_000) };
            now_ns += wire_ns(&messages[sent]) - shorter_ns;
            longest_ns[sent] = longest_ns[sent].max(now_ns - begin_ns);
            for (index, message) in messages.iter().enumerate() {
                let Queueing::After(Release { by, within_ns }) = message.queueing else { continue };
                if by == messages[sent].id {
                    let wait_ns =
                        [0, within_ns, random.random_range(0..=within_ns)][random.random_range(0..3)];
                    events.push((now_ns + wait_ns, messages.len() + index, index, begin_ns));
                }
            }
        }
    }
}

/// Times as thousandths of a cycle.
#[derive(Clone, Copy)]
enum Draft {
    By(u64),
    After(u16, u64),
    Apart(u64),
}

#[test]
fn no_message_of_ten_thousand_simulated_buses_arrives_after_its_bound() {
    let (mut bounded, mut nearly_reached) = ([0, 0], [0, 0]);
    for seed in 0..10_000 {
        let mut random = Pcg32::seed_from_u64(seed);
        let bus = RandomBus::new(&mut random);
        let RandomBus { cycle_ns, queues, messages } = &bus;
        let bounds = latest_arrivals(Bitrate::MAX, *cycle_ns, queues, messages).unwrap();
        let bound_ns = |message| bounds.iter().find(|bound| &bound.message == message).unwrap().latest_ns;
        for _ in 0..2 {
            for (message, seen_ns) in messages.iter().zip(bus.simulate(&mut random)) {
                let Some(bound_ns) = bound_ns(message) else { continue };
                assert!(
                    seen_ns <= bound_ns,
                    "seed {seed}: {message:?} after {seen_ns} ns, {queues:?} {bounds:#?}"
                );
                let kind = usize::from(queues[message.node] == Queue::Fifo);
                bounded[kind] += 1;
                nearly_reached[kind] += u64::from(seen_ns * 10 >= bound_ns * 9);
            }
        }
    }
    // Bounds that nothing comes near would prove little.
    for (bounded, nearly_reached) in bounded.into_iter().zip(nearly_reached) {
        assert!(bounded > 50_000 && nearly_reached * 20 > bounded, "{nearly_reached} of {bounded}");
    }
}

#[test]
fn a_frame_waits_for_the_earlier_frames_of_its_fifo_and_for_what_overtakes_them() {
    // A master with SYNC, two commands and a heartbeat; a drive with a heartbeat.
    let messages = [
        message(0x080, 0, 0, Queueing::By(0)),
        message(0x201, 6, 0, Queueing::By(900_000)),
        message(0x202, 6, 0, Queueing::By(900_000)),
        message(0x77F, 1, 0, Queueing::By(900_000)),
        message(0x701, 1, 1, Queueing::Apart(50_000_000)),
    ];
    let [sync_us, command_us, heartbeat_us] = [55, 115, 65];
    let fifo = latest_us(1000, &[Queue::Fifo], &messages);
    let late_us = 900 + 2 * command_us + 2 * heartbeat_us;
    assert_eq!(
        fifo[0],
        Some(late_us - 1000 + sync_us),
        "behind all of the last cycle and the drive's heartbeat"
    );
    assert_eq!(fifo[1..3], [1, 2].map(|commands| Some(900 + heartbeat_us + commands * command_us)));
    assert_eq!(fifo[4], Some(late_us), "the own heartbeat comes last");
    let priority = latest_us(1000, &[Queue::Priority], &messages);
    assert_eq!(priority[0], Some(command_us + sync_us), "a command may begin just before");
    assert_eq!(priority[1], Some(900 + 2 * command_us + sync_us), "likewise, and the next SYNC overtakes");
}

/// SYNC waits in a FIFO behind a heartbeat, and the answers to SYNC come together with the message of a third node.
#[test]
fn answers_to_a_message_that_a_fifo_hides_come_as_late_as_that_message() {
    let mut messages =
        vec![message(0x080, 0, 0, Queueing::By(0)), message(0x77F, 1, 0, Queueing::By(1_999_000))];
    for drive in 1..=3 {
        messages.push(message(0x180 + drive, 8, drive.into(), after(0x080, 0)));
        messages.push(message(0x700 + drive, 1, drive.into(), Queueing::Apart(50_000_000)));
    }
    messages.push(message(0x300, 8, 4, Queueing::By(314_000)));
    let latest = latest_us(2000, &[Queue::Fifo], &messages);
    assert_eq!(latest[0], Some(4 * 65 + 135 + 55 - 1), "behind all heartbeats and the third node");
    assert_eq!(latest[4], Some(314 + 65 + 55 + 4 * 135), "SYNC and its answers may go first");
}

#[test]
fn a_full_bus_has_no_bound_for_the_messages_that_it_delays() {
    let fast = |id, node| message(id, 8, node, Queueing::Apart(300_000));
    let messages = [fast(1, 0), fast(2, 1), message(3, 8, 2, Queueing::By(0))];
    assert_eq!(latest_us(1000, &[], &messages), [Some(270), Some(405), None]);
}

#[test]
fn a_releaser_is_a_more_urgent_message_with_a_cycle() {
    for releaser in [message(5, 8, 0, Queueing::By(0)), message(3, 8, 0, Queueing::Apart(1_000_000))] {
        let by = releaser.id;
        let messages = [message(4, 8, 1, Queueing::After(Release { by, within_ns: 0 })), releaser];
        let error = latest_arrivals(Bitrate::MAX, 1_000_000, &[], &messages).unwrap_err();
        assert_eq!((error.name.as_str(), error.releaser), ("004", by));
    }
}
