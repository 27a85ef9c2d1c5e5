//! Colour for the words that judge.

use std::io::{self, Write};

use anstream::AutoStream;
use anstyle::{AnsiColor, Style};

use crate::{escaped, taken, wrap};

/// What a word means for who reads it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tone {
    /// As it should be: green.
    Good,
    /// To be looked at: amber.
    Doubtful,
    /// Wrong: red.
    Bad,
}

impl Tone {
    fn style(self) -> Style {
        let colour = match self {
            Self::Good => AnsiColor::Green,
            Self::Doubtful => AnsiColor::Yellow,
            Self::Bad => AnsiColor::Red,
        };
        colour.on_default().bold()
    }
}

/// Chooses for the whole process when words are coloured. Without a choice, or with `Auto`, that is where standard output
/// is a terminal and `NO_COLOR` is not set.
pub fn choose_colour(choice: clap::ColorChoice) {
    let choice = match choice {
        clap::ColorChoice::Auto => anstream::ColorChoice::Auto,
        clap::ColorChoice::Always => anstream::ColorChoice::Always,
        clap::ColorChoice::Never => anstream::ColorChoice::Never,
    };
    choice.write_global();
}

/// Writes a result to standard output as [`result`](crate::result) does. Each word of `tones` with which a line begins is
/// coloured. On a terminal, lines are broken to its width.
///
/// # Errors
/// When the write fails, except for a closed pipe.
///
/// # Examples
/// ```
/// use masseter_terminal::{Tone, result_with_tones};
///
/// let tones = [("PASS", Tone::Good), ("FAIL", Tone::Bad)];
/// result_with_tones("PASS: every check passed\n", &tones)?;
/// # Ok::<(), anyhow::Error>(())
/// ```
pub fn result_with_tones(text: &str, tones: &[(&str, Tone)]) -> anyhow::Result<()> {
    // Without colour the stream removes the styles again.
    let mut output = AutoStream::auto(io::stdout().lock());
    taken(output.write_all(coloured(text, tones).as_bytes()).and_then(|()| output.flush()))
}

fn coloured(text: &str, tones: &[(&str, Tone)]) -> String {
    let text = wrap::for_stdout(&escaped(text));
    text.split_inclusive('\n').map(|line| coloured_line(line, tones)).collect()
}

fn coloured_line(line: &str, tones: &[(&str, Tone)]) -> String {
    let start = line.trim_start();
    let begins = |word: &str| {
        start.strip_prefix(word).is_some_and(|rest| !rest.starts_with(|next: char| next.is_alphanumeric()))
    };
    let Some(&(word, tone)) = tones.iter().find(|(word, _)| begins(word)) else { return line.to_owned() };
    let (indent, rest) = (&line[..line.len() - start.len()], &start[word.len()..]);
    let style = tone.style();
    format!("{indent}{style}{word}{style:#}{rest}")
}

#[cfg(test)]
mod tests {
    use super::*;

    const TONES: [(&str, Tone); 2] = [("ok", Tone::Good), ("SAFE STOP", Tone::Bad)];

    #[test]
    fn only_a_whole_word_at_the_start_of_a_line_is_coloured() {
        let cases = [
            ("  ok   tracking ok\n", "  \u{1b}[1m\u{1b}[32mok\u{1b}[0m   tracking ok\n"),
            ("SAFE STOP: a\nb ok\n", "\u{1b}[1m\u{1b}[31mSAFE STOP\u{1b}[0m: a\nb ok\n"),
            ("okay\n\n", "okay\n\n"),
            ("ok", "\u{1b}[1m\u{1b}[32mok\u{1b}[0m"),
            ("", ""),
        ];
        for (text, expected) in cases {
            assert_eq!(coloured(text, &TONES), expected, "{text:?}");
        }
    }

    #[test]
    fn control_characters_of_the_text_stay_codes() {
        assert_eq!(coloured("jaw\u{1b}[2J", &TONES), "jaw\\u{1b}[2J");
    }
}
