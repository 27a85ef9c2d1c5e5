//! The judgement of a run without its figures, for many runs at once.

use masseter_analysis::Figures;
use masseter_recording::Manifest;

use crate::verdict::Verdict;

/// The verdict on a run, and the digest of what the rig did.
#[derive(Debug, Clone, PartialEq)]
pub struct Judgement {
    /// The verdict.
    pub verdict: Verdict,
    /// The digest: equal for runs in which the rig did the same.
    pub digest: String,
}

impl Judgement {
    /// Judges a run.
    pub fn new(manifest: &Manifest, figures: &Figures) -> Self {
        Self { verdict: Verdict::new(manifest, figures), digest: figures.digest.clone() }
    }
}
