//! Numbered lines of the input, of any content and length.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use anyhow::Context;

/// Bytes of the longest line that is read. Numbers of full precision make lines a tenth as long.
const LONGEST_LINE: usize = 4096;
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
    let numbered = (1..).zip(Bounded { source, rest: Rest::NextLine });
    let lines = numbered.map(|(number, text)| Line { number, text });
    lines.filter(|line| !line.text.as_ref().is_ok_and(|text| text.starts_with('#')))
}

/// Lines of at most [`LONGEST_LINE`] bytes. A longer one is an error, but for a comment, which is cut.
struct Bounded<R> {
    source: R,
    rest: Rest,
}

/// What to read next.
enum Rest {
    NextLine,
    /// The line just given goes on: the end is only looked for when the next line is asked for, since there may be none.
    OfLongLine,
    Nothing,
}

impl<R: BufRead> Bounded<R> {
    fn read(&mut self) -> io::Result<Option<Result<String, String>>> {
        if matches!(self.rest, Rest::OfLongLine) {
            self.source.skip_until(b'\n')?;
        }
        let mut line = Vec::new();
        (&mut self.source).take(LONGEST_LINE as u64).read_until(b'\n', &mut line)?;
        let is_cut = line.len() == LONGEST_LINE && !line.ends_with(b"\n");
        self.rest = match line.is_empty() {
            true => Rest::Nothing,
            false if is_cut => Rest::OfLongLine,
            false => Rest::NextLine,
        };
        let text = String::from_utf8_lossy(&line).trim_start_matches(BYTE_ORDER_MARK).trim().to_owned();
        let is_refused = is_cut && !text.starts_with('#');
        let text = if is_refused { Err(format!("longer than {LONGEST_LINE} bytes")) } else { Ok(text) };
        Ok((!line.is_empty()).then_some(text))
    }
}

impl<R: BufRead> Iterator for Bounded<R> {
    type Item = Result<String, String>;

    fn next(&mut self) -> Option<Self::Item> {
        if matches!(self.rest, Rest::Nothing) {
            return None;
        }
        self.read().unwrap_or_else(|error| {
            self.rest = Rest::Nothing;
            Some(Err(error.to_string()))
        })
    }
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

    #[test]
    fn a_long_line_is_refused_without_being_read_to_its_end() {
        let exactly = [&[b'1'; LONGEST_LINE - 1][..], b"\n2"].concat();
        assert_eq!(read(&exactly).len(), 2);
        assert!(read(&exactly).iter().all(|(_, text)| text.is_ok()));
        let longer = [&[b'1'; 3 * LONGEST_LINE][..], b"\n2\n"].concat();
        let refused = Err("longer than 4096 bytes".to_owned());
        assert_eq!(read(&longer), [(1, refused.clone()), (2, Ok("2".to_owned()))]);
        let mut endless = lines(BufReader::new(io::repeat(b'1')));
        assert_eq!(endless.next().unwrap().text, refused);
    }
}
