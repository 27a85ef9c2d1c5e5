//! Errors as text.

/// An error and its causes in one line, without causes that the text before quotes.
pub(crate) fn in_one_line(error: &anyhow::Error) -> String {
    error.chain().fold(String::new(), |text, cause| {
        let cause = cause.to_string();
        match text.as_str() {
            "" => cause,
            _ if text.contains(&cause) => text,
            _ => text + ": " + &cause,
        }
    })
}
