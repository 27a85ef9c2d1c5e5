//! Lines no wider than the terminal. What follows a break stands below the last column of the line.

use std::io;
use std::os::fd::AsFd;

use rustix::termios::{isatty, tcgetwinsize};

/// Narrower terminals get lines as they are: their users would see one word a line.
const LEAST: usize = 40;

/// Characters in a line of a terminal; none where the stream is no terminal, or one of unknown width.
pub fn columns(stream: impl AsFd) -> Option<usize> {
    let size = isatty(&stream).then(|| tcgetwinsize(&stream).ok()).flatten()?;
    (size.ws_col > 0).then_some(size.ws_col.into())
}

/// The text for standard output: with breaks if that is a terminal.
pub(crate) fn for_stdout(text: &str) -> String {
    let width = columns(io::stdout()).unwrap_or(0);
    text.split_inclusive('\n').map(|line| wrapped(line, width)).collect()
}

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
