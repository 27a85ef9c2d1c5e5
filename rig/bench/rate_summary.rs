//! What `bench rate` reads of a run's `summary.json`. A key that is not there is an error: a share of nothing would
//! read as a perfect one.

use serde::{Deserialize, Deserializer};

use crate::exit::Exit;

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
    cycles: u64,
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
    messages: u64,
    missing: u64,
}

/// An option that is there: serde takes an absent one for null.
fn null_or<'de, D: Deserializer<'de>, T: Deserialize<'de>>(value: D) -> Result<Option<T>, D::Error> {
    Option::deserialize(value)
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

    /// What the rig missed and lost, as shares from 0 to 1.
    pub(super) fn shares(&self) -> [(&'static str, f64); 3] {
        let Figures { cycles, controller_skips, plant_skips, topics, .. } = &self.figures;
        let skipped = controller_skips.skipped + plant_skips.skipped;
        let by_machine = controller_skips.by_machine + plant_skips.by_machine;
        // Both processes have a deadline a cycle.
        let deadlines = 2 * cycles + skipped;
        let recorded: u64 = topics.iter().map(|topic| topic.messages).sum();
        let dropped: u64 = topics.iter().map(|topic| topic.missing).sum();
        let share = |part: u64, of: u64| part as f64 / of as f64;
        [
            ("missed", share(skipped, deadlines)),
            ("missed by the machine", share(by_machine, deadlines)),
            ("dropped", share(dropped, recorded + dropped)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WRITTEN: &str = r#"{
        "form": 1,
        "verdict": {"word": "PASS", "exit_code": 0},
        "figures": {
            "cycles": 45,
            "controller_skips": {"skipped": 4, "by_machine": 1, "worked_ns": 7},
            "plant_skips": {"skipped": 6, "by_machine": 2, "worked_ns": 7},
            "final_state": "finished",
            "topics": [
                {"topic": "reading", "messages": 60, "missing": 0},
                {"topic": "frame", "messages": 30, "missing": 10}
            ]
        }
    }"#;

    #[test]
    fn misses_are_shares_of_both_processes_deadlines_and_drops_of_all_messages() {
        let summary: Summary = serde_json::from_str(WRITTEN).unwrap();
        assert!(summary.is_finished() && !summary.is_disturbed());
        assert_eq!(summary.shares(), [("missed", 0.1), ("missed by the machine", 0.03), ("dropped", 0.1)]);
    }

    #[test]
    fn a_key_that_is_not_there_is_an_error_and_no_zero() {
        for key in ["exit_code", "cycles", "plant_skips", "by_machine", "final_state", "topics", "missing"] {
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
