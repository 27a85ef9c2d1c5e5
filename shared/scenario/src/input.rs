//! Input files of limited size, and quotations of their text for messages.

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Read};
use std::{os::unix::fs::OpenOptionsExt, path::Path};

use rustix::fs::OFlags;

/// Size of the largest file of the rig's own that the rig reads back, bytes.
pub const MOST_KEPT_BYTES: u64 = 64 << 20;
/// Longest quotation of a value in a message, characters.
const QUOTED: usize = 80;
/// Longest quotation of another program's sentence in a message, characters.
const QUOTED_SENTENCE: usize = 200;

/// A regular file, opened for reading. A device or a pipe is refused at once: neither has an end.
///
/// # Errors
/// The system's error, and a file that is no regular file.
pub fn open_regular(path: &Path) -> io::Result<File> {
    // Opening a pipe blocks until a writer comes.
    let file = OpenOptions::new().read(true).custom_flags(OFlags::NONBLOCK.bits() as i32).open(path)?;
    if !file.metadata()?.is_file() {
        return Err(io::Error::other("it is no regular file; copy its content into one"));
    }
    Ok(file)
}

/// The content of a regular file of at most `most_bytes`.
///
/// # Errors
/// Those of [`open_regular`], and a larger file.
pub fn read_bytes(path: &Path, most_bytes: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open_regular(path)?.take(most_bytes + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most_bytes {
        return Err(io::Error::other(format!("it is larger than {most_bytes} bytes")));
    }
    Ok(bytes)
}

/// The text of a regular file of at most `most_bytes`.
///
/// # Errors
/// Those of [`read_bytes`], and a file that is not text in UTF-8.
///
/// # Examples
/// ```
/// use std::path::Path;
///
/// use masseter_scenario::input::read_text;
///
/// let error = read_text(Path::new("/dev/zero"), 1000).unwrap_err();
/// assert!(error.to_string().contains("no regular file"));
/// ```
pub fn read_text(path: &Path, most_bytes: u64) -> io::Result<String> {
    String::from_utf8(read_bytes(path, most_bytes)?).map_err(|error| {
        let valid = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = valid.split(|byte| *byte == b'\n').count();
        io::Error::new(ErrorKind::InvalidData, format!("line {line} is no text in UTF-8"))
    })
}

/// Bytes 80h to 9Fh of Windows-1252; the others are those of Latin-1.
const WINDOWS_1252: [char; 32] = [
    '€', '\u{fffd}', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\u{fffd}', 'Ž', '\u{fffd}',
    '\u{fffd}', '‘', '’', '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\u{fffd}', 'ž', 'Ÿ',
];

/// The text of a regular file of at most `most_bytes` that another program wrote: UTF-8, UTF-16 with a byte order mark,
/// otherwise Windows-1252. The text has no byte order mark.
///
/// # Errors
/// Those of [`read_bytes`], and when the file is no text.
pub fn read_foreign_text(path: &Path, most_bytes: u64) -> io::Result<String> {
    foreign_text(&read_bytes(path, most_bytes)?)
        .map_err(|reason| io::Error::new(ErrorKind::InvalidData, reason))
}

/// The text of bytes that another program wrote, as [`read_foreign_text`] reads it.
///
/// # Errors
/// When the bytes are no text: the reason.
pub fn foreign_text(bytes: &[u8]) -> Result<String, &'static str> {
    let utf_16 = |bytes: &[u8], unit: fn([u8; 2]) -> u16| {
        let (pairs, rest) = bytes.as_chunks();
        let text = String::from_utf16(&pairs.iter().copied().map(unit).collect::<Vec<_>>());
        text.ok().filter(|_| rest.is_empty()).ok_or("it is no text in UTF-16, as its byte order mark says")
    };
    let text = match bytes {
        [0xFF, 0xFE, rest @ ..] => utf_16(rest, u16::from_le_bytes)?,
        [0xFE, 0xFF, rest @ ..] => utf_16(rest, u16::from_be_bytes)?,
        [0xEF, 0xBB, 0xBF, rest @ ..] | rest => match std::str::from_utf8(rest) {
            Ok(text) => text.to_owned(),
            Err(_) => rest.iter().map(|&byte| windows_1252(byte)).collect(),
        },
    };
    // Old Macs, and some instruments, end lines by CR alone.
    let text = if text.contains('\n') { text } else { text.replace('\r', "\n") };
    let need = "it has zero bytes; save the text as UTF-8, or as UTF-16 with a byte order mark";
    if text.contains('\0') { Err(need) } else { Ok(text) }
}

fn windows_1252(byte: u8) -> char {
    match byte {
        0x80..=0x9F => WINDOWS_1252[usize::from(byte - 0x80)],
        _ => char::from(byte),
    }
}

/// The quotation of a value for messages: at most 80 characters, without control characters.
///
/// # Examples
/// ```
/// use masseter_scenario::input::excerpt;
///
/// assert_eq!(excerpt("1,\u{1b}[2J"), "1,\\u{1b}[2J");
/// assert_eq!(excerpt(&"x".repeat(100)).chars().count(), 81);
/// ```
pub fn excerpt(text: &str) -> String {
    quoted(text, QUOTED)
}

/// The quotation of another program's sentence for messages: at most 200 characters, without control characters.
///
/// # Examples
/// ```
/// use masseter_scenario::input::sentence;
///
/// assert_eq!(sentence("it's over\n"), "it's over\\n");
/// assert_eq!(sentence(&"x".repeat(300)).chars().count(), 201);
/// ```
pub fn sentence(text: &str) -> String {
    quoted(text, QUOTED_SENTENCE)
}

/// Whether a text is at most `most_bytes` long and printable. No character may command a terminal, end a line or turn
/// the direction of reading.
///
/// # Examples
/// ```
/// use masseter_scenario::input::is_printable;
///
/// assert!(is_printable("µm/s²", 48));
/// assert!(!is_printable("m\nfloat64 evil", 48));
/// ```
pub fn is_printable(text: &str, most_bytes: usize) -> bool {
    let turns_or_ends =
        |c| matches!(c, '\u{200e}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    text.len() <= most_bytes && !text.chars().any(|c| c.is_control() || turns_or_ends(c))
}

fn quoted(text: &str, most: usize) -> String {
    let (mut quoted, mut length) = (String::new(), 0);
    for character in text.chars() {
        let plain = matches!(character, '"' | '\'' | '\\').then_some(character);
        let shown = plain.map_or_else(|| character.escape_debug().to_string(), String::from);
        length += shown.chars().count();
        if length > most {
            quoted.push('…');
            break;
        }
        quoted.push_str(&shown);
    }
    quoted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quotation_is_short_and_commands_nothing() {
        for hostile in ["\u{1b}[31m".repeat(1000), "\u{202e}\n\0".repeat(1000), "ä".repeat(100_000)] {
            let quoted = sentence(&hostile);
            assert!(quoted.chars().count() <= 201 && is_printable(&quoted, 1000), "{quoted}");
        }
    }

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
    fn foreign_text_is_read_in_its_code_page() {
        let text = "[FileInfo]\r\nDescription=Prüfung µm €\r\n";
        let utf_16 =
            |unit: fn(u16) -> [u8; 2]| "\u{feff}".encode_utf16().chain(text.encode_utf16()).flat_map(unit);
        let windows: Vec<u8> = text.chars().map(|c| if c == '€' { 0x80 } else { c as u8 }).collect();
        for bytes in [
            text.into(),
            ["\u{feff}", text].concat().into_bytes(),
            utf_16(u16::to_le_bytes).collect(),
            utf_16(u16::to_be_bytes).collect(),
            windows,
        ] {
            assert_eq!(foreign_text(&bytes).as_deref(), Ok(text), "{bytes:x?}");
        }
        assert_eq!(foreign_text(b"\x8e\x9f\xa0\xff\x81").as_deref(), Ok("ŽŸ\u{a0}ÿ\u{fffd}"));
        assert_eq!(foreign_text(b"").as_deref(), Ok(""));
        assert_eq!(foreign_text(b"a,b\r1,2\r").as_deref(), Ok("a,b\n1,2\n"));
        for no_text in [&b"\xff\xfea"[..], b"\xff\xfe\x00\xd8", b"a\0b\0", b"\x7fELF\0\xff"] {
            assert!(foreign_text(no_text).is_err(), "{no_text:x?}");
        }
    }

    #[test]
    fn what_is_no_regular_file_is_refused_at_once() {
        for path in ["/dev/zero", "/dev", "/dev/null"] {
            let error = read_text(Path::new(path), 10).unwrap_err().to_string();
            assert!(error.contains("no regular file"), "{path}: {error}");
        }
    }
}
