//! The page that sets each claim of the paper beside what was measured, in Markdown.

use askama::Template;

use crate::claims::PaperClaim;
use crate::study::Study;

/// The page with the captions of the figures. `command` repeats the study.
#[derive(Template)]
#[template(path = "claims.md", escape = "none")]
pub(super) struct Page<'a> {
    pub study: &'a Study,
    pub command: &'a str,
    pub claims: &'a [PaperClaim],
    pub version: &'static str,
}
