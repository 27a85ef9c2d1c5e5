//! The differences of two streams of messages, in words and as JSON.

use std::fmt::Write;

use masseter_recording::Topic;
use masseter_terminal::Exit;
use serde::Serialize;

use super::compared::Compared;
use super::field_growth::FieldGrowth;
use super::lane::{Lane, Missing};
use super::motion_clock::MotionClock;
use crate::text::or_dash;

/// Version of the form as JSON.
const FORM: u32 = 1;

/// A field that differs.
#[derive(Debug, Serialize)]
struct FieldDifference {
    topic: &'static str,
    /// The time of the first difference since the motion began, s.
    motion_s: Option<f64>,
    #[serde(flatten)]
    growth: FieldGrowth,
}

/// Messages without a partner.
#[derive(Debug, Serialize)]
struct OneSided {
    topic: &'static str,
    /// Whether the second stream has them.
    only_in_b: bool,
    #[serde(flatten)]
    missing: Missing,
}

/// A topic whose digest differs.
#[derive(Debug, Serialize)]
struct DigestDifference {
    topic: &'static str,
    first_cycle: u64,
}

/// What differs between two streams.
#[derive(Debug, Serialize)]
pub struct Differences {
    form: u32,
    is_equal: bool,
    /// Messages that had a partner.
    messages: u64,
    /// By their first cycle, then in the order of a cycle.
    fields: Vec<FieldDifference>,
    one_sided: Vec<OneSided>,
    /// Topics whose messages have other fields.
    redefined: Vec<&'static str>,
    /// Topics that one side has not recorded, which are not compared.
    unrecorded: Vec<&'static str>,
    digests: Vec<DigestDifference>,
    #[serde(skip)]
    compared: Compared,
    #[serde(skip)]
    clock: MotionClock,
}

impl Differences {
    pub(super) fn new(compared: Compared, clock: MotionClock, unrecorded: &[Topic]) -> Self {
        Self {
            form: FORM,
            is_equal: true,
            messages: 0,
            fields: Vec::new(),
            one_sided: Vec::new(),
            redefined: Vec::new(),
            unrecorded: unrecorded.iter().map(|topic| topic.name()).collect(),
            digests: Vec::new(),
            compared,
            clock,
        }
    }

    pub(super) fn add_digests(&mut self, differences: Vec<(Topic, u64)>) {
        self.is_equal &= differences.is_empty();
        self.digests = differences
            .into_iter()
            .map(|(topic, first_cycle)| DigestDifference { topic: topic.name(), first_cycle })
            .collect();
        self.digests.sort_by_key(|difference| difference.first_cycle);
    }

    pub(super) fn add(&mut self, topic: Topic, has_same_fields: bool, lane: Lane) {
        let topic = topic.name();
        self.messages += lane.messages;
        // Each source of a topic has a lane.
        let is_redefined = lane.messages > 0 && !has_same_fields && !self.redefined.contains(&topic);
        self.redefined.extend(is_redefined.then_some(topic));
        let (growths, missing) = lane.finish();
        for growth in growths {
            let motion_s = self.clock.motion_s(growth.first_cycle);
            self.fields.push(FieldDifference { topic, motion_s, growth });
        }
        self.fields.sort_by_key(|field| field.growth.first_cycle);
        for (missing, only_in_b) in missing.into_iter().zip([false, true]) {
            self.one_sided.extend(missing.map(|missing| OneSided { topic, only_in_b, missing }));
        }
        self.one_sided.sort_by_key(|messages| messages.missing.first_cycle);
        self.is_equal &= self.fields.is_empty() && self.one_sided.is_empty() && self.redefined.is_empty();
    }

    /// The exit code: 0 for equal streams, 1 for others.
    pub fn exit(&self) -> Exit {
        if self.is_equal { Exit::Passed } else { Exit::Failed }
    }

    /// The first difference and a table of all, with the names of both streams.
    pub fn in_words(&self, names: [&str; 2]) -> String {
        let mut text = self.verdict(names);
        text.push('\n');
        let left_out = self.compared.left_out();
        if !left_out.is_empty() {
            let _ = writeln!(text, "{left_out}");
        }
        if !self.fields.is_empty() {
            let _ = writeln!(
                text,
                "\n{:<36} {:>8} {:>9} {:>13} {:>9} {:>13} {:>9} {:>13}",
                "differing field",
                "cycle",
                "motion, s",
                "first",
                "> 1 unit",
                "largest",
                "in cycle",
                "at the end"
            );
        }
        for FieldDifference { topic, motion_s, growth } in &self.fields {
            let _ = writeln!(
                text,
                "{:<36} {:>8} {:>9} {:>13} {:>9} {:>13} {:>9} {:>13}",
                format!("{topic}.{}", growth.name()),
                growth.first_cycle,
                or_dash(*motion_s, |motion_s| format!("{motion_s:.3}")),
                growth.sized(growth.first),
                or_dash(growth.beyond_one_cycle, |cycle| cycle.to_string()),
                growth.sized(growth.largest),
                growth.largest_cycle,
                growth.sized(growth.at_end),
            );
        }
        for OneSided { topic, only_in_b, missing } in &self.one_sided {
            let Missing { first_cycle, messages } = missing;
            let name = names[usize::from(*only_in_b)];
            let _ =
                writeln!(text, "only in {name}: {messages} on '{topic}', the first in cycle {first_cycle}");
        }
        for topic in &self.redefined {
            let _ =
                writeln!(text, "not compared: '{topic}', whose messages have other fields in {}", names[1]);
        }
        for topic in &self.unrecorded {
            let _ = writeln!(text, "not compared: '{topic}', which one side has not recorded");
        }
        for DigestDifference { topic, first_cycle } in &self.digests {
            let _ = writeln!(text, "the digests of '{topic}' differ from cycle {first_cycle} on");
        }
        text
    }

    /// The first line.
    fn verdict(&self, [a, b]: [&str; 2]) -> String {
        if self.is_equal {
            return format!("EQUAL: {} messages, bit by bit", self.messages);
        }
        let field = self.fields.first().map(|field| {
            let [in_a, in_b] = &field.growth.values;
            let size = field
                .growth
                .first
                .map_or_else(String::new, |size| format!(" ({} apart)", field.growth.sized(Some(size))));
            let what =
                format!("{}.{} is {in_a} in {a}, {in_b} in {b}{size}", field.topic, field.growth.name());
            (field.growth.first_cycle, what)
        });
        let one_sided = self.one_sided.first().map(|OneSided { topic, only_in_b, missing }| {
            let name = if *only_in_b { b } else { a };
            (missing.first_cycle, format!("only {name} has a message on '{topic}'"))
        });
        let digest = self.digests.first().map(|DigestDifference { topic, first_cycle }| {
            let what = format!("topic '{topic}' by its digest");
            let whole = self.fields.first().filter(|field| field.growth.first_cycle > *first_cycle);
            let whole =
                whole.zip(field.as_ref()).map(|(_, (cycle, what))| format!("; in cycle {cycle}, {what}"));
            (*first_cycle, what + &whole.unwrap_or_default())
        });
        // Of several in one cycle the field says most.
        let first = [field.clone(), one_sided, digest].into_iter().flatten().min_by_key(|(cycle, _)| *cycle);
        let Some((cycle, what)) = first else {
            return "DIFFERENT: the messages have other fields".to_owned();
        };
        let time = self.clock.motion_s(cycle);
        let time = time.map_or_else(String::new, |motion_s| format!(", {motion_s:.3} s of the motion"));
        format!("DIFFERENT from cycle {cycle} on{time}: {what}")
    }
}

#[cfg(test)]
mod tests {
    use masseter_recording::{Columns, Recorded, definitions};
    use masseter_runtime::messages::codes::ControllerState;
    use masseter_runtime::messages::{CanData, Command, FrameTap, State};
    use masseter_runtime::named::{Declared, Signal};

    use super::super::comparison::{Comparison, Side};
    use super::*;

    fn comparison(compared: Compared, declared: [&Declared; 2]) -> Comparison {
        let columns = |declared: &Declared| {
            Columns::of_topics(definitions(declared).iter().map(|(_, channel)| channel))
        };
        Comparison::new(compared, declared.map(columns))
    }

    fn compared_by(compared: Compared, sides: [&[Recorded]; 2]) -> Differences {
        let none = Declared::default();
        let mut comparison = comparison(compared, [&none, &none]);
        for (side, messages) in [Side::A, Side::B].into_iter().zip(sides) {
            for message in messages {
                comparison.take(side, message);
            }
        }
        comparison.finish()
    }

    fn commands(targets_m: &[(u64, f64)]) -> Vec<Recorded> {
        let command = |&(cycle, target_m): &(u64, f64)| {
            let target_m = [0.0, 0.0, 0.0, 0.25, target_m, 0.25];
            Recorded::Command(Command { cycle, target_m, ..Command::default() })
        };
        targets_m.iter().map(command).collect()
    }

    #[test]
    fn a_difference_is_told_by_its_first_cycle_its_element_and_its_growth() {
        let a = commands(&[(1, 0.25), (2, 0.25), (3, 0.25), (4, 0.25), (5, 0.25)]);
        let b = commands(&[(1, 0.25), (2, 0.250_000_5), (3, 0.250_002), (4, 0.250_001_5), (5, 0.25)]);
        let told = compared_by(Compared::Everything, [&a, &b]);
        let json = serde_json::to_value(&told).unwrap();
        let field = &json["fields"][0];
        assert_eq!((&field["first_cycle"], &field["element"]), (&2.into(), &4.into()));
        assert_eq!((&field["beyond_one_cycle"], &field["largest_cycle"]), (&3.into(), &3.into()));
        assert_eq!((&field["messages"], field["at_end"].as_f64()), (&3.into(), Some(0.0)));
        let words = told.in_words(["A", "B"]);
        let first =
            "DIFFERENT from cycle 2 on: command.target_m[4] is 0.25 in A, 0.2500005 in B (0.500 µm apart)\n";
        assert!(words.starts_with(first), "{words}");
        assert_eq!(told.exit(), Exit::Failed);
    }

    #[test]
    fn numbers_are_compared_bit_by_bit() {
        let [a, b] = [0.0, -0.0].map(|zero| commands(&[(1, zero)]));
        assert_eq!(compared_by(Compared::Everything, [&a, &b]).exit(), Exit::Failed);
        let nan = commands(&[(1, f64::NAN)]);
        assert_eq!(compared_by(Compared::Everything, [&nan, &nan]).exit(), Exit::Passed);
    }

    #[test]
    fn cycles_that_one_side_skipped_are_no_partners_of_others() {
        let a = commands(&[(1, 0.1), (2, 0.2), (3, 0.3)]);
        let b = commands(&[(1, 0.1), (3, 0.3), (4, 0.4)]);
        let words = compared_by(Compared::Everything, [&a, &b]).in_words(["A", "B"]);
        assert!(words.starts_with("DIFFERENT from cycle 2 on: only A has a message on 'command'"), "{words}");
        assert!(words.contains("only in B: 1 on 'command', the first in cycle 4"), "{words}");
        assert!(!words.contains("target_m"), "{words}");
    }

    #[test]
    fn of_two_differences_in_one_cycle_the_cause_comes_first_and_frames_are_shown_by_their_bytes() {
        let frame = |byte| Recorded::Frame(FrameTap { data: CanData::new(&[byte]), ..FrameTap::default() });
        let state = |cycle, iterations| {
            let controller_state = ControllerState::Running.code();
            Recorded::State(State {
                cycle,
                iterations,
                controller_state,
                due_ns: cycle * 1_000_000,
                ..State::default()
            })
        };
        let a = [commands(&[(1, 0.1), (2, 0.2)]), vec![state(1, 3), state(2, 3), frame(0xAA)]].concat();
        let b = [commands(&[(1, 0.1), (2, 0.3)]), vec![state(1, 3), state(2, 4), frame(0xBB)]].concat();
        let words = compared_by(Compared::Everything, [&a, &b]).in_words(["A", "B"]);
        assert!(
            words.starts_with("DIFFERENT from cycle 2 on, 0.001 s of the motion: command.target_m[4]"),
            "{words}"
        );
        let places = ["command.target_m[4]  ", "state.iterations", "frame.data"].map(|name| words.find(name));
        assert!(places.iter().all(Option::is_some) && places.is_sorted(), "{words}");
        let frames = [[frame(0xAA)], [frame(0xBB)]];
        let words = compared_by(Compared::Everything, [&frames[0], &frames[1]]).in_words(["A", "B"]);
        assert!(words.contains("frame.data is AA in A, BB in B"), "{words}");
    }

    #[test]
    fn a_real_clock_leaves_out_what_it_decides() {
        let command =
            |seq, published_ns| [Recorded::Command(Command { seq, published_ns, ..Command::default() })];
        let state = |woke_ns| [Recorded::State(State { woke_ns, ..State::default() })];
        let exits = |a: &[Recorded], b: &[Recorded]| {
            [Compared::Everything, Compared::WithoutStamps, Compared::WithoutTimes]
                .map(|compared| compared_by(compared, [a, b]).exit())
        };
        assert_eq!(exits(&command(1, 10), &command(2, 20)), [Exit::Failed, Exit::Passed, Exit::Passed]);
        assert_eq!(exits(&state(10), &state(20)), [Exit::Failed, Exit::Failed, Exit::Passed]);
    }

    #[test]
    fn messages_with_other_fields_are_a_difference_and_are_not_compared() {
        let declared = |name: &str| Declared {
            signals: vec![Signal { name: name.into(), unit: String::new(), about: String::new() }],
            ..Declared::default()
        };
        let mut comparison = comparison(Compared::Everything, [&declared("grip"), &declared("trim")]);
        let signals = Recorded::Signals(masseter_runtime::messages::Signals::default());
        comparison.take(Side::A, &signals);
        comparison.take(Side::B, &signals);
        let words = comparison.finish().in_words(["A", "B"]);
        assert!(words.contains("not compared: 'signal', whose messages have other fields in B"), "{words}");
    }
}
