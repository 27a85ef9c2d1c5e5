//! Whose motion it is, by pseudonyms, and which of its jaw cycles count: `[study]`. No key takes a name of a person.

use super::error::{Checked, require, require_word};

section! {
    /// The place of a run in a study, and the choice of its jaw cycles.
    pub struct StudyConfig {
        /// Pseudonym of the person; none when empty.
        pub patient: String = String::new() => "at most 32 letters, digits, `-`, `_`",
        /// Name of the session; none when empty.
        pub session: String = String::new() => "at most 32 letters, digits, `-`, `_`",
        /// Part of the motion whose jaw cycles count, from and to, s; the whole motion when absent.
        pub window_s: Option<[f64; 2]> = None => "0 or more, the end above the beginning",
        /// Numbers of jaw cycles that do not count, as in the report.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub leave_out: Vec<u64> = Vec::new(),
    }
}

impl StudyConfig {
    pub(super) fn validate(&self) -> Checked {
        let need = "use a pseudonym of at most 32 letters, digits, '-' or '_'";
        require_word("study.patient", &self.patient, 0..=32, need)?;
        require_word("study.session", &self.session, 0..=32, need)?;
        let Some([from_s, to_s]) = self.window_s else { return Ok(()) };
        let is_window = 0.0 <= from_s && from_s < to_s && to_s.is_finite();
        let window = format_args!("[{from_s}, {to_s}]");
        require(is_window, "study.window_s", &window, "0 or more, the end above the beginning")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_persons_and_empty_windows_are_refused() {
        let study = |patient: &str, window_s| StudyConfig {
            patient: patient.to_owned(),
            window_s,
            ..StudyConfig::default()
        };
        let cases = [
            (study("P-01", Some([0.0, 2.0])), None),
            (study("", None), None),
            (study("Jane Doe", None), Some("study.patient")),
            (study("P1", Some([2.0, 2.0])), Some("study.window_s")),
            (study("P1", Some([f64::NAN, 2.0])), Some("study.window_s")),
        ];
        for (study, key) in cases {
            let refusal = study.validate().err().map(|error| error.to_string());
            assert_eq!(refusal.is_some(), key.is_some(), "{study:?}: {refusal:?}");
            assert!(refusal.is_none_or(|refusal| refusal.contains(key.unwrap_or_default())));
        }
    }
}
