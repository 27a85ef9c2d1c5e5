//! Lines on a terminal: colour for the words that judge, and breaks to its width. What follows a break stands below the
//! last column of the line.

use std::io::{self, Write};
use std::os::fd::AsFd;

use anstream::AutoStream;
use anstyle::{AnsiColor, Style};
use rustix::termios::{isatty, tcgetwinsize};

use crate::{escaped, taken};

/// Narrower terminals get lines as they are: their users would see one word a line.
const LEAST: usize = 40;

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
    let width = columns(io::stdout()).unwrap_or(0);
    let text: String = escaped(text).split_inclusive('\n').map(|line| wrapped(line, width)).collect();
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

/// Characters in a line of a terminal; none where the stream is no terminal, or one of unknown width.
pub fn columns(stream: impl AsFd) -> Option<usize> {
    let size = isatty(&stream).then(|| tcgetwinsize(&stream).ok()).flatten()?;
    (size.ws_col > 0).then_some(size.ws_col.into())
}

/// A line with breaks where it is wider than the terminal.
fn wrapped(line: &str, width: usize) -> String {
    let indent = hanging_indent(line);
    if width < LEAST || line.trim_end().chars().count() <= width || indent + LEAST / 2 > width {
        return line.to_owned();
    }
    let (mut text, mut used) = (String::new(), 0);
    for word in line.trim_end().split_inclusive(' ') {
        let length = word.trim_end().chars().count();
        if used + length > width && used > indent {
            text.truncate(text.trim_end().len());
            text.push('\n');
            text.push_str(&" ".repeat(indent));
            used = indent;
        }
        text.push_str(word);
        used += word.chars().count();
    }
    text + "\n"
}

/// Where the last column of a line begins: after the last gap of several spaces, or two places in.
fn hanging_indent(line: &str) -> usize {
    let text = line.trim_end();
    let gap = text.rfind("  ").map_or(0, |gap| gap + 2);
    if text[gap..].contains(' ') { text[..gap].chars().count().max(2) } else { 2 }
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

    #[test]
    fn the_rest_of_a_line_stands_below_its_last_column() {
        let line =
            "  ok   tracking           closest of 10001 samples: incisal point rms 0.0064 mm, limit 0.1 mm\n";
        let below = " ".repeat(26);
        let expected = format!(
            "  ok   tracking           closest of 10001\n{below}samples: incisal\n{below}point rms 0.0064 mm,\n{below}limit 0.1 mm\n"
        );
        assert_eq!(wrapped(line, 46), expected);
        assert!(expected.lines().all(|line| line.chars().count() <= 46));
        assert_eq!(wrapped(line, 100), line);
        assert_eq!(wrapped(line, 0), line);
    }

    #[test]
    fn a_line_without_columns_goes_on_two_places_in() {
        let line = "masseter doctor lists what disturbs this machine, and what to do\n";
        assert_eq!(
            wrapped(line, 50),
            "masseter doctor lists what disturbs this machine,\n  and what to do\n"
        );
    }

    #[test]
    fn a_word_that_is_too_long_stays_whole() {
        let word = "x".repeat(90);
        assert_eq!(wrapped(&format!("see {word}\n"), 60), format!("see\n  {word}\n"));
    }
}
