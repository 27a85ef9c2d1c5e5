//! The differences of two streams of messages, in words and as JSON.

use std::fmt::Write;

use masseter_recording::Topic;
use masseter_terminal::Exit;
use serde::Serialize;

use super::comparison::Compared;
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
    digests: Vec<DigestDifference>,
    #[serde(skip)]
    compared: Compared,
    #[serde(skip)]
    clock: MotionClock,
}

impl Differences {
    pub(super) fn new(compared: Compared, clock: MotionClock) -> Self {
        Self {
            form: FORM,
            is_equal: true,
            messages: 0,
            fields: Vec::new(),
            one_sided: Vec::new(),
            redefined: Vec::new(),
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
        self.redefined.extend((lane.messages > 0 && !has_same_fields).then_some(topic));
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
            let what = format!("{}.{} is {in_a} in {a}, {in_b} in {b}", field.topic, field.growth.name());
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
