//! A figure of the study.

/// A drawing with its caption.
#[derive(Debug, Clone)]
pub(crate) struct Figure {
    /// File name without its extension.
    pub name: &'static str,
    /// The text under it.
    pub caption: String,
    /// The drawing.
    pub svg: String,
}
