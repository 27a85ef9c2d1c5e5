//! Numbered lines of the input, of any content and length.

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
        let Some(path) = path else { return Ok(Self::new("standard input".to_owned(), io::stdin().lock())) };
        let name = path.display().to_string();
        let file = File::open(path).with_context(|| format!("cannot read {name}"))?;
        Ok(Self::new(name, BufReader::new(file)))
    }

    fn new(name: String, source: impl BufRead + 'static) -> Self {
        Self { name, source: Box::new(source), lines: 0, is_over: false }
    }

    /// What it is called in messages.
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// The next line, the longest ones cut behind `LONGEST_LINE` bytes; nothing at the end of the input.
    fn read(&mut self) -> io::Result<Vec<u8>> {
        let mut line = Vec::new();
        (&mut self.source).take(LONGEST_LINE as u64).read_until(b'\n', &mut line)?;
        if is_cut(&line) {
            self.source.skip_until(b'\n')?;
        }
        Ok(line)
    }
}

impl Iterator for Input {
    type Item = Line;

    fn next(&mut self) -> Option<Line> {
        while !self.is_over {
            self.lines += 1;
            let text = match self.read() {
                Ok(line) if line.is_empty() => {
                    self.is_over = true;
                    return None;
                }
                Ok(line) if is_comment(&line) => continue,
                Ok(line) => text(line),
                Err(error) => {
                    self.is_over = true;
                    Err(error.to_string())
                }
            };
            return Some(Line { number: self.lines, text });
        }
        None
    }
}

fn is_cut(line: &[u8]) -> bool {
    line.len() == LONGEST_LINE && !line.ends_with(b"\n")
}

/// Whatever its encoding and however long it is.
fn is_comment(line: &[u8]) -> bool {
    let line = line.strip_prefix(BYTE_ORDER_MARK.as_bytes()).unwrap_or(line);
    line.trim_ascii_start().starts_with(b"#")
}

/// A line without its end.
fn text(line: Vec<u8>) -> Result<String, String> {
    if is_cut(&line) {
        return Err(format!("longer than {LONGEST_LINE} bytes"));
    }
    let line = String::from_utf8(line).map_err(|_| "not text in UTF-8".to_owned())?;
    Ok(line.trim_start_matches(BYTE_ORDER_MARK).trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(text: &[u8]) -> Vec<(u64, Result<String, String>)> {
        let input = Input::new(String::new(), io::Cursor::new(text.to_vec()));
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
    fn comments_are_passed_over_in_any_encoding_and_of_any_length() {
        let latin_1 = b"# Gr\xf6\xdfe\n \t# \xff\n1\n";
        assert_eq!(lines(latin_1), [(3, Ok("1".to_owned()))]);
        let long = [b"\xef\xbb\xbf#", &[b'x'; 2 * LONGEST_LINE][..], b"\n2\n"].concat();
        assert_eq!(lines(&long), [(2, Ok("2".to_owned()))]);
    }

    #[test]
    fn a_line_without_end_is_not_gathered() {
        let long = [&[b'1'; 3 * LONGEST_LINE][..], b"\n2\n"].concat();
        assert!(matches!(&lines(&long)[..], [(1, Err(_)), (2, Ok(_))]));
        let longest = [&[b'1'; LONGEST_LINE - 1][..], b"\n2\n"].concat();
        assert!(matches!(&lines(&longest)[..], [(1, Ok(_)), (2, Ok(_))]));
    }
}
