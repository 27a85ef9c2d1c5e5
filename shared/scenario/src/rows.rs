//! Rows of numbers in CSV of people and programs. Every reader of the rig uses these rules.
//!
//! A row is a line. Comments begin with `#`. Names and numbers may be in quotes. Neither has a comma or the end of a
//! line, so a quote without its partner is a part of the field.

use std::io::{self, BufRead, Read};
use std::iter;

use crate::{input::excerpt, wording::counted};

/// Bytes of the longest line. Numbers of full precision need a tenth of this length.
const LONGEST_LINE: usize = 4096;
const BYTE_ORDER_MARK: char = '\u{feff}';

/// A line, or the reason for its refusal.
#[derive(Debug)]
pub struct Line {
    /// From 1; comments count.
    pub number: u64,
    /// Without surrounding white space.
    pub text: Result<String, String>,
}

/// The lines without comments. Bytes that are no UTF-8 become replacement characters. An error of the system is the
/// last line.
///
/// ```
/// use masseter_scenario::rows::{lines, numbers};
///
/// let row = lines(&b"# Time and place\n0.5, \"2\"\n"[..]).next().unwrap();
/// assert_eq!(row.number, 2);
/// assert_eq!(numbers(&row.text.unwrap(), &["t_s", "x_m"]), Ok(vec![0.5, 2.0]));
/// ```
pub fn lines(source: impl BufRead) -> impl Iterator<Item = Line> {
    let (mut source, mut is_cut) = (Some(source), false);
    let texts = iter::from_fn(move || {
        let line = read_line(source.as_mut()?, &mut is_cut);
        if !matches!(line, Ok(Some(_))) {
            source = None;
        }
        line.unwrap_or_else(|error| Some(Err(error.to_string())))
    });
    let lines = (1..).zip(texts).map(|(number, text)| Line { number, text });
    lines.filter(|line| !line.text.as_ref().is_ok_and(|text| text.starts_with('#')))
}

/// The fields of a line.
pub fn fields(line: &str) -> impl Iterator<Item = &str> {
    line.split(',').map(|field| {
        let field = field.trim();
        field.strip_prefix('"').and_then(|rest| rest.strip_suffix('"')).unwrap_or(field)
    })
}

/// A finite number for each of the columns. The error has the cause and its remedy.
pub fn numbers(line: &str, columns: &[&str]) -> Result<Vec<f64>, String> {
    if line.is_empty() {
        return Err("an empty line".to_owned());
    }
    let (found, expected) = (fields(line).count(), columns.len());
    if found != expected {
        let found = counted(found as u64, "field");
        return Err(format!("{found}, expected {expected}; complete the line or delete it"));
    }
    fields(line).zip(columns).map(|(text, column)| finite_number(text, column)).collect()
}

fn finite_number(text: &str, column: &str) -> Result<f64, String> {
    let finite = text.parse().ok().filter(|value: &f64| value.is_finite());
    finite.ok_or_else(|| {
        let text = excerpt(text);
        format!(
            "{column} is '{text}', not a finite number; write it with a decimal point, or delete the line"
        )
    })
}

/// The next line, of at most [`LONGEST_LINE`] bytes. A longer line is an error; a longer comment is cut. The search for the
/// end of such a line waits for the next call, because there may be no end.
fn read_line(source: &mut impl BufRead, is_cut: &mut bool) -> io::Result<Option<Result<String, String>>> {
    if *is_cut {
        source.skip_until(b'\n')?;
    }
    let mut line = Vec::new();
    source.take(LONGEST_LINE as u64).read_until(b'\n', &mut line)?;
    *is_cut = line.len() == LONGEST_LINE && !line.ends_with(b"\n");
    let text = String::from_utf8_lossy(&line).trim_start_matches(BYTE_ORDER_MARK).trim().to_owned();
    let is_refused = *is_cut && !text.starts_with('#');
    let text = if is_refused { Err(format!("longer than {LONGEST_LINE} bytes")) } else { Ok(text) };
    Ok((!line.is_empty()).then_some(text))
}

#[cfg(test)]
mod tests {
    use std::io::BufReader;

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

    #[test]
    fn names_and_numbers_may_stand_in_quotes() {
        assert_eq!(fields("\"a\" , b,\"c").collect::<Vec<_>>(), ["a", "b", "\"c"]);
        assert_eq!(numbers("\"1\", \"2.5\"", &["a", "b"]), Ok(vec![1.0, 2.5]));
    }

    #[test]
    fn what_is_no_row_of_the_columns_is_refused_with_the_reason() {
        for (line, reason) in [
            ("", "an empty line"),
            ("1", "1 field, expected 2; complete the line or delete it"),
            ("1,2,3", "3 fields, expected 2"),
            ("1,zero", "b is 'zero', not a finite number; write it with a decimal point, or delete the line"),
            ("NaN,1", "a is 'NaN', not a finite number"),
            ("1,inf", "b is 'inf', not a finite number"),
        ] {
            assert!(numbers(line, &["a", "b"]).unwrap_err().starts_with(reason), "{line}");
        }
    }
}
