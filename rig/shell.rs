//! Words of a shell's command line.

/// The text as one word, quoted where a shell would read more.
pub(crate) fn word(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-+=:,@%".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) {
        return text.to_owned();
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_is_quoted_where_a_shell_would_read_more_than_one() {
        assert_eq!(word("a/b-1.toml"), "a/b-1.toml");
        assert_eq!(word("my file.toml"), "'my file.toml'");
        assert_eq!(word("it's"), r"'it'\''s'");
    }
}
