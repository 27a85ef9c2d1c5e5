//! Lines of the input, numbered, whatever stands in them and however long they are.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use anyhow::Context;

/// Bytes of the longest line that is read. Numbers of full precision make lines a tenth as long.
const LONGEST_LINE: usize = 4096;
const BYTE_ORDER_MARK: &str = "\u{feff}";

/// A line, or why it could not be read.
#[derive(Debug)]
pub(super) struct Line {
    pub number: u64,
    pub text: Result<String, String>,
}

/// The input, line by line. Comments are passed over; an error of the system ends it.
pub(super) struct Input {
    name: String,
    source: Box<dyn BufRead>,
    lines: u64,
    is_over: bool,
}

impl Input {
    /// Opens a file, or standard input.
    pub(super) fn open(path: Option<&Path>) -> anyhow::Result<Self> {
        let Some(path) = path else { return Ok(Self::of("standard input".to_owned(), io::stdin().lock())) };
        let name = path.display().to_string();
        let file = File::open(path).with_context(|| format!("cannot read {name}"))?;
        Ok(Self::of(name, BufReader::new(file)))
    }

    fn of(name: String, source: impl BufRead + 'static) -> Self {
        Self { name, source: Box::new(source), lines: 0, is_over: false }
    }

    /// What it is called in messages.
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// The next line without its end; none at the end of the input.
    fn read(&mut self) -> io::Result<Option<Result<String, String>>> {
        let mut line = Vec::new();
        (&mut self.source).take(LONGEST_LINE as u64).read_until(b'\n', &mut line)?;
        if line.is_empty() {
            return Ok(None);
        }
        if line.len() == LONGEST_LINE && !line.ends_with(b"\n") {
            self.source.skip_until(b'\n')?;
            return Ok(Some(Err(format!("longer than {LONGEST_LINE} bytes"))));
        }
        let Ok(line) = String::from_utf8(line) else { return Ok(Some(Err("not text in UTF-8".to_owned()))) };
        Ok(Some(Ok(line.trim_start_matches(BYTE_ORDER_MARK).trim().to_owned())))
    }
}

impl Iterator for Input {
    type Item = Line;

    fn next(&mut self) -> Option<Line> {
        while !self.is_over {
            self.lines += 1;
            let text = self.read().unwrap_or_else(|error| {
                self.is_over = true;
                Some(Err(error.to_string()))
            });
            match text {
                None => self.is_over = true,
                Some(Ok(comment)) if comment.starts_with('#') => {}
                Some(text) => return Some(Line { number: self.lines, text }),
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(text: &[u8]) -> Vec<(u64, Result<String, String>)> {
        let input = Input::of(String::new(), io::Cursor::new(text.to_vec()));
        input.map(|line| (line.number, line.text)).collect()
    }

    #[test]
    fn every_line_but_comments_is_one_whatever_stands_in_it() {
        let text = |text: &str| Ok(text.to_owned());
        assert_eq!(
            lines(b"\xef\xbb\xbfa,b\r\n# b\n\n\"1,2\n 3,4 "),
            [(1, text("a,b")), (3, text("")), (4, text("\"1,2")), (5, text("3,4"))]
        );
        assert_eq!(lines(b""), []);
        assert_eq!(lines(b"\n"), [(1, text(""))]);
        assert!(matches!(&lines(b"\xff\n1\n")[..], [(1, Err(_)), (2, Ok(_))]));
    }

    #[test]
    fn a_line_without_end_is_not_gathered() {
        let long = [&[b'1'; 3 * LONGEST_LINE][..], b"\n2\n"].concat();
        assert!(matches!(&lines(&long)[..], [(1, Err(_)), (2, Ok(_))]));
        let longest = [&[b'1'; LONGEST_LINE - 1][..], b"\n2\n"].concat();
        assert!(matches!(&lines(&longest)[..], [(1, Ok(_)), (2, Ok(_))]));
    }
}
