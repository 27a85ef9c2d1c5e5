//! Numbered lines of the input, of any content.

use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::mem;
use std::path::Path;

use anyhow::Context;

const BYTE_ORDER_MARK: char = '\u{feff}';

/// A line, or why it could not be read.
#[derive(Debug)]
pub(super) struct Line {
    pub number: u64,
    pub text: Result<String, String>,
}

/// The input with its name in messages.
pub(super) struct Input {
    pub name: String,
    pub lines: Box<dyn Iterator<Item = Line>>,
}

impl Input {
    /// Opens a file, or standard input.
    pub(super) fn open(path: Option<&Path>) -> anyhow::Result<Self> {
        let Some(path) = path else {
            let lines = Box::new(lines(io::stdin().lock()));
            return Ok(Self { name: "standard input".to_owned(), lines });
        };
        let name = path.display().to_string();
        let file = File::open(path).with_context(|| format!("cannot read {name}"))?;
        Ok(Self { name, lines: Box::new(lines(BufReader::new(file))) })
    }
}

/// The lines without comments. What is no text in UTF-8 becomes replacement characters. An error of the system is the
/// last line.
fn lines(source: impl BufRead) -> impl Iterator<Item = Line> {
    let mut is_over = false;
    let lines = source.split(b'\n').take_while(move |line| !mem::replace(&mut is_over, line.is_err()));
    let text =
        |line: Vec<u8>| String::from_utf8_lossy(&line).trim_start_matches(BYTE_ORDER_MARK).trim().to_owned();
    let numbered = lines
        .zip(1..)
        .map(move |(line, number)| Line { number, text: line.map(text).map_err(|error| error.to_string()) });
    numbered.filter(|line| !line.text.as_ref().is_ok_and(|text| text.starts_with('#')))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &[u8]) -> Vec<(u64, Result<String, String>)> {
        lines(text).map(|line| (line.number, line.text)).collect()
    }

    #[test]
    fn every_line_but_comments_is_one_whatever_stands_in_it() {
        let text = |text: &str| Ok(text.to_owned());
        assert_eq!(
            read(b"\xef\xbb\xbfa,b\r\n# b\n\n\"1,2\n 3,4 "),
            [(1, text("a,b")), (3, text("")), (4, text("\"1,2")), (5, text("3,4"))]
        );
        assert_eq!(read(b""), []);
        assert_eq!(read(b"\n"), [(1, text(""))]);
        assert_eq!(read(b"\xff\n1\n"), [(1, text("\u{fffd}")), (2, text("1"))]);
    }

    #[test]
    fn comments_are_passed_over_in_any_encoding_and_of_any_length() {
        let latin_1 = b"# Gr\xf6\xdfe\n \t# \xff\n1\n";
        assert_eq!(read(latin_1), [(3, Ok("1".to_owned()))]);
        let long = [b"\xef\xbb\xbf#", &[b'x'; 10_000][..], b"\n2\n"].concat();
        assert_eq!(read(&long), [(2, Ok("2".to_owned()))]);
    }
}
