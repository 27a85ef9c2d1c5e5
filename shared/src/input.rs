//! Input files of limited size, and their text as messages quote it.

use std::fs::OpenOptions;
use std::io::{self, ErrorKind, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use rustix::fs::OFlags;

/// Characters of a value that a message quotes.
const QUOTED: usize = 80;

/// The text of a regular file of at most `most_bytes`. A device or a pipe is refused at once: neither has an end.
///
/// # Errors
/// The system's, and when the file is no regular file, is larger, or is not text in UTF-8.
///
/// # Examples
/// ```
/// use std::path::Path;
///
/// use masseter_shared::input::read_text;
///
/// let error = read_text(Path::new("/dev/zero"), 1000).unwrap_err();
/// assert!(error.to_string().contains("no regular file"));
/// ```
pub fn read_text(path: &Path, most_bytes: u64) -> io::Result<String> {
    // A pipe would block the opening until somebody writes.
    let file = OpenOptions::new().read(true).custom_flags(OFlags::NONBLOCK.bits() as i32).open(path)?;
    if !file.metadata()?.is_file() {
        return Err(io::Error::other("it is no regular file; copy its content into one"));
    }
    let mut bytes = Vec::new();
    file.take(most_bytes + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most_bytes {
        return Err(io::Error::other(format!("it is larger than {most_bytes} bytes")));
    }
    String::from_utf8(bytes).map_err(|error| {
        let valid = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = valid.split(|byte| *byte == b'\n').count();
        io::Error::new(ErrorKind::InvalidData, format!("line {line} is no text in UTF-8"))
    })
}

/// A value as messages quote it: at most 80 characters, without control characters.
///
/// # Examples
/// ```
/// use masseter_shared::input::excerpt;
///
/// assert_eq!(excerpt("1,\u{1b}[2J"), "1,\\u{1b}[2J");
/// assert_eq!(excerpt(&"x".repeat(100)).chars().count(), 81);
/// ```
pub fn excerpt(text: &str) -> String {
    let mut characters = text.chars();
    let mut quoted = String::new();
    for character in characters.by_ref().take(QUOTED) {
        match character {
            '"' | '\'' | '\\' => quoted.push(character),
            _ => quoted.extend(character.escape_debug()),
        }
    }
    if characters.next().is_some() {
        quoted.push('…');
    }
    quoted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_beyond_its_limit_is_refused() {
        let path = std::env::temp_dir().join(format!("masseter-input-{}", std::process::id()));
        std::fs::write(&path, "12345").unwrap();
        assert_eq!(read_text(&path, 5).unwrap(), "12345");
        let error = read_text(&path, 4).unwrap_err().to_string();
        std::fs::remove_file(&path).unwrap();
        assert_eq!(error, "it is larger than 4 bytes");
    }

    #[test]
    fn the_line_that_is_no_text_is_named() {
        let path = std::env::temp_dir().join(format!("masseter-text-{}", std::process::id()));
        std::fs::write(&path, b"1\n2\n\xff").unwrap();
        let error = read_text(&path, 10).unwrap_err().to_string();
        std::fs::remove_file(&path).unwrap();
        assert_eq!(error, "line 3 is no text in UTF-8");
    }

    #[test]
    fn what_is_no_regular_file_is_refused_at_once() {
        for path in ["/dev/zero", "/dev", "/dev/null"] {
            let error = read_text(Path::new(path), 10).unwrap_err().to_string();
            assert!(error.contains("no regular file"), "{path}: {error}");
        }
    }
}
