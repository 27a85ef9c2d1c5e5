//! The differences of two streams of messages, in words and as JSON.

use std::fmt::Write;

use masseter_recording::{Recorded, Topic};
use masseter_runtime::messages::State;
use masseter_runtime::messages::codes::{ControllerState, EventKind, Source};
use masseter_terminal::Exit;
use serde::Serialize;

use super::lane::{FieldGrowth, Missing};
use crate::text::{or_dash, table};

/// Version of the form as JSON.
pub(super) const FORM: u32 = 1;

/// A topic whose digest differs.
#[derive(Debug, Serialize)]
pub(super) struct DigestDifference {
    pub(super) topic: &'static str,
    pub(super) first_cycle: u64,
}

/// What differs between two streams.
#[derive(Debug, Serialize)]
pub struct Differences {
    pub(super) form: u32,
    pub(super) is_equal: bool,
    /// Messages that had a partner.
    pub(super) messages: u64,
    /// By their first cycle, then in the order of a cycle.
    pub(super) fields: Vec<FieldGrowth>,
    pub(super) one_sided: Vec<Missing>,
    /// Topics whose messages have other fields.
    pub(super) redefined: Vec<&'static str>,
    /// Topics that one side has not recorded, which are not compared.
    pub(super) unrecorded: Vec<&'static str>,
    pub(super) digests: Vec<DigestDifference>,
    #[serde(skip)]
    pub(super) compared: Compared,
    #[serde(skip)]
    pub(super) clock: MotionClock,
}

impl Differences {
    /// The exit code: 0 for equal streams, 1 for others.
    pub fn exit(&self) -> Exit {
        if self.is_equal { Exit::Passed } else { Exit::Failed }
    }

    /// The first difference and a table of all, with the names of both streams.
    pub fn in_words(&self, names: [&str; 2]) -> String {
        const WIDTHS: [usize; 8] = [36, 8, 9, 13, 9, 13, 9, 13];
        let mut text = self.verdict(names);
        text.push('\n');
        let left_out = self.compared.left_out();
        if !left_out.is_empty() {
            let _ = writeln!(text, "{left_out}");
        }
        if !self.fields.is_empty() {
            let heads = [
                "differing field",
                "cycle",
                "motion, s",
                "first",
                "> 1 unit",
                "largest",
                "in cycle",
                "at the end",
            ];
            let rows = self.fields.iter().map(|growth| {
                [
                    growth.name(),
                    growth.first_cycle.to_string(),
                    or_dash(growth.motion_s, |motion_s| format!("{motion_s:.3}")),
                    growth.sized(growth.first),
                    or_dash(growth.beyond_one_cycle, |cycle| cycle.to_string()),
                    growth.sized(growth.largest),
                    growth.largest_cycle.to_string(),
                    growth.sized(growth.at_end),
                ]
            });
            text = text + "\n" + &table(WIDTHS, heads, rows);
        }
        for Missing { topic, only_in_b, first_cycle, messages } in &self.one_sided {
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
        let field = self.fields.first().map(|growth| {
            let [in_a, in_b] = &growth.values;
            let size = growth.first.map(|size| format!(" ({} apart)", growth.sized(Some(size))));
            let size = size.unwrap_or_default();
            (growth.first_cycle, format!("{} is {in_a} in {a}, {in_b} in {b}{size}", growth.name()))
        });
        let one_sided = self.one_sided.first().map(|Missing { topic, only_in_b, first_cycle, .. }| {
            let name = if *only_in_b { b } else { a };
            (*first_cycle, format!("only {name} has a message on '{topic}'"))
        });
        let digest = self.digests.first().map(|DigestDifference { topic, first_cycle }| {
            let what = format!("topic '{topic}' by its digest");
            let whole = self.fields.first().filter(|field| field.first_cycle > *first_cycle);
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

/// Which fields two streams can have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Compared {
    /// All, in simulated time.
    Everything,
    /// All but the number and the time of publication: a replay of a run in real time.
    WithoutStamps,
    /// Neither numbers nor times, nor the frames: two runs, at least one of them in real time.
    WithoutTimes,
}

impl Compared {
    pub(super) fn has_topic(self, topic: Topic) -> bool {
        topic != Topic::Machine && (self != Self::WithoutTimes || topic != Topic::Frame)
    }

    pub(super) fn has_field(self, field: &str) -> bool {
        match self {
            Self::Everything => true,
            Self::WithoutStamps => !["seq", "published_ns"].contains(&field),
            Self::WithoutTimes => field != "seq" && !field.ends_with("_ns"),
        }
    }

    /// What is left out, in words; empty for nothing.
    pub(super) fn left_out(self) -> &'static str {
        match self {
            Self::Everything => "",
            Self::WithoutStamps => "not compared, since the clock was real: number and time of publication",
            Self::WithoutTimes => "not compared, since a clock was real: times, numbers of messages, frames",
        }
    }
}

/// What tells the time of a cycle.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct MotionClock {
    /// Cycle and deadline of the first state, ns.
    first: Option<(u64, u64)>,
    period_ns: Option<u64>,
    /// The cycle in which the motion began.
    running_from: Option<u64>,
    /// The newest cycle.
    pub(super) cycle: u64,
}

impl MotionClock {
    pub(super) fn add_message(&mut self, message: &Recorded) {
        match message {
            Recorded::State(State { cycle, due_ns, controller_state, .. }) => {
                self.cycle = *cycle;
                let (first_cycle, first_ns) = *self.first.get_or_insert((*cycle, *due_ns));
                let period_ns =
                    || due_ns.saturating_sub(first_ns).checked_div(cycle.saturating_sub(first_cycle));
                self.period_ns = self.period_ns.or_else(period_ns);
                if *controller_state == ControllerState::Running.code() {
                    self.running_from.get_or_insert(*cycle);
                }
            }
            // A thinned recording has all events, and few states.
            Recorded::Event(event)
                if event.source == Source::Controller.code()
                    && event.kind == EventKind::Transition.code()
                    && event.to == ControllerState::Running.code() =>
            {
                self.running_from.get_or_insert(event.cycle);
            }
            _ => {}
        }
    }

    /// The time of a cycle since the motion began, s; negative before. None without a motion.
    pub(super) fn motion_s(&self, cycle: u64) -> Option<f64> {
        let cycles = cycle as f64 - self.running_from? as f64;
        Some(cycles * self.period_ns? as f64 / 1e9)
    }
}

#[cfg(test)]
mod tests {
    use masseter_recording::{Columns, Recorded, definitions};
    use masseter_runtime::messages::codes::ControllerState;
    use masseter_runtime::messages::{CanData, Command, FrameTap, State};
    use masseter_runtime::named::{Declared, Signal};

    use super::*;
    use crate::divergence::{Comparison, Side};

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
