//! The part of a run's `summary.json` that `bench rate` reads. A missing key is an error: a missing count would look like
//! a count of zero.

use serde::{Deserialize, Deserializer};

use masseter_terminal::Exit;

/// The keys that are read.
#[derive(Debug, Deserialize)]
pub(super) struct Summary {
    verdict: Verdict,
    figures: Figures,
}

#[derive(Debug, Deserialize)]
struct Verdict {
    exit_code: u8,
}

#[derive(Debug, Deserialize)]
struct Figures {
    controller_skips: Skips,
    plant_skips: Skips,
    #[serde(deserialize_with = "null_or")]
    final_state: Option<String>,
    topics: Vec<Topic>,
}

#[derive(Debug, Deserialize)]
struct Skips {
    skipped: u64,
    by_machine: u64,
}

#[derive(Debug, Deserialize)]
struct Topic {
    #[serde(rename = "topic")]
    name: String,
    messages: u64,
    missing: u64,
}

/// A key that must exist, with a value or null: serde takes a missing key for null.
fn null_or<'de, D: Deserializer<'de>, T: Deserialize<'de>>(value: D) -> Result<Option<T>, D::Error> {
    Option::deserialize(value)
}

impl Topic {
    fn published(&self) -> u64 {
        self.messages + self.missing
    }
}

fn share(part: u64, of: u64) -> f64 {
    part as f64 / of as f64
}

impl Summary {
    /// Whether the motion was played to its end.
    pub(super) fn is_finished(&self) -> bool {
        self.figures.final_state.as_deref() == Some("finished")
    }

    /// Whether the machine was too disturbed to judge the run.
    pub(super) fn is_disturbed(&self) -> bool {
        self.verdict.exit_code == Exit::Invalid as u8
    }

    /// Whether every message was recorded.
    pub(super) fn is_whole(&self) -> bool {
        self.figures.topics.iter().all(|topic| topic.missing == 0)
    }

    /// The share of messages lost, and if none was lost, the share of deadlines missed; from 0 to 1.
    pub(super) fn shares(&self) -> Vec<(&'static str, f64)> {
        let dropped = self.dropped();
        if self.is_whole() { [self.missed().as_slice(), &[dropped]].concat() } else { vec![dropped] }
    }

    fn dropped(&self) -> (&'static str, f64) {
        let topics = &self.figures.topics;
        let dropped: u64 = topics.iter().map(|topic| topic.missing).sum();
        ("dropped", share(dropped, topics.iter().map(Topic::published).sum()))
    }

    fn missed(&self) -> [(&'static str, f64); 2] {
        let Figures { controller_skips, plant_skips, topics, .. } = &self.figures;
        let skipped = controller_skips.skipped + plant_skips.skipped;
        let by_machine = controller_skips.by_machine + plant_skips.by_machine;
        // Each process publishes one of these per cycle, and none in a cycle that it skips.
        let cycles = topics.iter().filter(|topic| ["state", "reading"].contains(&topic.name.as_str()));
        let deadlines = cycles.map(Topic::published).sum::<u64>() + skipped;
        [("missed", share(skipped, deadlines)), ("missed by the machine", share(by_machine, deadlines))]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WRITTEN: &str = r#"{
        "form": 1,
        "verdict": {"word": "PASS", "exit_code": 0},
        "figures": {
            "controller_skips": {"skipped": 4, "by_machine": 1, "worked_ns": 7},
            "plant_skips": {"skipped": 6, "by_machine": 2, "worked_ns": 7},
            "final_state": "finished",
            "topics": [
                {"topic": "reading", "messages": 50, "missing": 0},
                {"topic": "state", "messages": 40, "missing": 0},
                {"topic": "frame", "messages": 110, "missing": 0}
            ]
        }
    }"#;

    #[test]
    fn misses_are_shares_of_the_deadlines_of_both_processes() {
        let summary: Summary = serde_json::from_str(WRITTEN).unwrap();
        assert!(summary.is_finished() && !summary.is_disturbed());
        assert_eq!(summary.shares(), [("missed", 0.1), ("missed by the machine", 0.03), ("dropped", 0.0)]);
    }

    #[test]
    fn a_run_with_missing_messages_gives_only_their_share() {
        let incomplete =
            WRITTEN.replace("\"messages\": 110, \"missing\": 0", "\"messages\": 60, \"missing\": 50");
        let summary: Summary = serde_json::from_str(&incomplete).unwrap();
        assert!(!summary.is_whole());
        assert_eq!(summary.shares(), [("dropped", 0.25)]);
    }

    #[test]
    fn a_missing_key_is_an_error_and_not_zero() {
        for key in ["exit_code", "plant_skips", "by_machine", "final_state", "topics", "missing"] {
            let renamed = WRITTEN.replace(&format!("\"{key}\""), "\"renamed\"");
            let error = serde_json::from_str::<Summary>(&renamed).unwrap_err().to_string();
            assert!(error.contains(key), "{key}: {error}");
        }
    }

    #[test]
    fn a_run_without_a_state_did_not_finish() {
        let stateless = WRITTEN.replace("\"finished\"", "null");
        assert!(!serde_json::from_str::<Summary>(&stateless).unwrap().is_finished());
    }
}
