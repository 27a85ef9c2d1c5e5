//! Files made here, as the format's guide describes them, are read or refused with the reason.

use super::*;

/// How a file stores its points.
#[derive(Debug, Clone, Copy)]
pub(in super::super) enum Numbers {
    Floats,
    /// Integers of this size, in the file's unit.
    Scaled(f32),
}

fn parameter(group: i8, name: &str, kind: i8, dimensions: &[usize], data: &[u8]) -> Vec<u8> {
    let mut entry = vec![name.len() as u8, group as u8];
    entry.extend(name.bytes());
    let content_size = 2 + dimensions.len() + data.len() + 1;
    entry.extend((content_size as u16 + 2).to_le_bytes());
    entry.extend([kind as u8, dimensions.len() as u8]);
    entry.extend(dimensions.iter().map(|dimension| *dimension as u8));
    entry.extend(data);
    entry.push(0);
    entry
}

fn texts(group: i8, name: &str, texts: &[&str]) -> Vec<u8> {
    let padded: Vec<_> = texts.iter().map(|text| format!("{text:<8}")).collect();
    parameter(group, name, -1, &[8, texts.len()], padded.concat().as_bytes())
}

fn group(id: i8, name: &str) -> Vec<u8> {
    let mut entry = vec![name.len() as u8, (-id) as u8];
    entry.extend(name.bytes());
    entry.extend([3, 0, 0]);
    entry
}

/// A file of markers from frame 7 on, mm; a marker without numbers is lost. Each frame has two analog values.
pub(in super::super) fn file(labels: &[&str], rate_hz: f32, rows: &[Vec<f64>], numbers: Numbers) -> Vec<u8> {
    let scale = if let Numbers::Scaled(scale) = numbers { scale } else { -1.0 };
    let mut head = vec![0; BLOCK];
    let (first, last) = (7_u16, 6 + rows.len() as u16);
    for (at, word) in [(2, labels.len() as u16), (4, 2), (6, first), (8, last), (16, 4), (18, 2)] {
        head[at..at + 2].copy_from_slice(&word.to_le_bytes());
    }
    head[..2].copy_from_slice(&[2, KEY]);
    head[12..16].copy_from_slice(&scale.to_le_bytes());
    head[20..24].copy_from_slice(&rate_hz.to_le_bytes());
    let mut section = vec![1, KEY, 2, 84];
    section.extend(group(1, "POINT"));
    section.extend(texts(1, "LABELS", labels));
    section.extend(texts(1, "UNITS", &["mm"]));
    section.extend(parameter(1, "RATE", 4, &[], &rate_hz.to_le_bytes()));
    section.extend(parameter(1, "SCALE", 4, &[], &scale.to_le_bytes()));
    section.extend(parameter(1, "FRAMES", 2, &[], &(rows.len() as u16).to_le_bytes()));
    section.extend(group(2, "ANALOG"));
    section.extend(texts(2, "LABELS", &["EMG_R", "EMG_L"]));
    section.resize(2 * BLOCK, 0);
    let mut data = Vec::new();
    let mut put = |number: f64| match numbers {
        Numbers::Floats => data.extend((number as f32).to_le_bytes()),
        Numbers::Scaled(_) => data.extend((number as i16).to_le_bytes()),
    };
    let unit = if let Numbers::Scaled(scale) = numbers { f64::from(scale) } else { 1.0 };
    for row in rows {
        for place in row.chunks(3) {
            let is_lost = place.iter().any(|coordinate| coordinate.is_nan());
            for mm in place {
                put(if is_lost { 0.0 } else { mm / unit });
            }
            put(if is_lost { -1.0 } else { 0.0 });
        }
        put(5.0);
        put(5.0);
    }
    [head, section, data].concat()
}

const LABELS: [&str; 3] = ["LI", "RM", "R"];

fn rows() -> Vec<Vec<f64>> {
    let mut rows: Vec<Vec<f64>> =
        (0..6).map(|row| (0..9).map(|at| f64::from(9 * row + at)).collect()).collect();
    rows[2][3..6].fill(f64::NAN);
    rows
}

fn refusal(bytes: &[u8]) -> String {
    markers(bytes).unwrap_err().to_string()
}

#[test]
fn floats_and_scaled_integers_are_read_with_names_unit_and_lost_points() {
    for numbers in [Numbers::Floats, Numbers::Scaled(0.5)] {
        let Markers { text, first_frame, protocol } =
            markers(&file(&LABELS, 100.0, &rows(), numbers)).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines[0],
            "time_s,LI_x_mm,LI_y_mm,LI_z_mm,RM_x_mm,RM_y_mm,RM_z_mm,mR_x_mm,mR_y_mm,mR_z_mm"
        );
        assert_eq!(lines[2], "0.01,9e0,1e1,1.1e1,1.2e1,1.3e1,1.4e1,1.5e1,1.6e1,1.7e1", "{numbers:?}");
        assert_eq!(lines[3], "0.02,1.8e1,1.9e1,2e1,,,,2.4e1,2.5e1,2.6e1");
        assert_eq!((lines.len(), first_frame), (7, 7));
        assert_eq!(
            protocol,
            [
                "format C3D: 3 markers, frames 7 to 12 at 100 Hz as lines 2 to 7",
                "markers renamed: 'R' is mR",
                "analog channels are not read: 'EMG_R', 'EMG_L'"
            ]
        );
    }
}

#[test]
fn a_file_cut_at_any_byte_is_refused() {
    let whole = file(&LABELS, 100.0, &rows(), Numbers::Floats);
    // The analog values of the last frame are not needed.
    for length in 2..whole.len() - 8 {
        let text = refusal(&whole[..length]);
        assert!(text.contains("cut short") || text.contains("damaged"), "{length}: {text}");
    }
    assert!(refusal(&whole[..whole.len() - 9]).contains("frame 12 of 7 to 12"));
}

#[test]
fn numbers_that_contradict_the_file_are_refused_with_the_reason() {
    let whole = file(&LABELS, 100.0, &rows(), Numbers::Floats);
    let with = |at: usize, bytes: &[u8]| {
        let mut changed = whole.clone();
        changed[at..at + bytes.len()].copy_from_slice(bytes);
        refusal(&changed)
    };
    let rate_at = whole.windows(4).rposition(|name| name == b"RATE").unwrap();
    let frames_at = whole.windows(6).position(|name| name == b"FRAMES").unwrap();
    for (at, bytes, reason) in [
        (BLOCK + 3, &[85][..], "DEC processor, which are not read; save the file again for Intel"),
        (BLOCK + 3, &[86], "big-endian"),
        (BLOCK + 3, &[7], "unknown (7)"),
        (0, &[0], "names no block"),
        (0, &[200], "cut short at its parameters"),
        (2, &[0, 0], "holds no points"),
        (2, &[255, 255], "cut short at frame 7"),
        (6, &[13, 0], "0 frames in its header and 6 in POINT:FRAMES"),
        (8, &[255, 255], "more than 65534 frames without TRIAL"),
        (8, &[254, 255], "65528 frames in its header"),
        (16, &[0, 0], "no block where its data begin"),
        (16, &[255, 255], "cut short at frame 7"),
        (rate_at + 4, &[1, 0], "a wrong offset"),
        (rate_at + 4, &[255, 255], "a wrong offset"),
        (rate_at + 7, &[200], "a value is cut short"),
        (rate_at + 8, &0_f32.to_le_bytes(), "a rate of 0"),
        (rate_at + 8, &f32::NAN.to_le_bytes(), "a rate of NaN"),
        (frames_at + 10, &[9, 0], "6 frames in its header and 9"),
    ] {
        assert!(with(at, bytes).contains(reason), "{at}: {} for {reason}", with(at, bytes));
    }
    assert!(refusal(&file(&LABELS, 100.0, &[], Numbers::Floats)).contains("holds no frame"));
    assert!(refusal(&file(&LABELS, 100.0, &rows(), Numbers::Scaled(f32::NAN))).contains("a scale of NaN"));
}

#[test]
fn no_byte_of_header_and_parameters_breaks_the_reading() {
    let whole = file(&LABELS, 100.0, &rows(), Numbers::Floats);
    for at in 2..3 * BLOCK {
        for byte in [0, 1, 127, 128, 255] {
            let mut changed = whole.clone();
            changed[at] = byte;
            if let Ok(read) = markers(&changed) {
                assert!(read.text.len() < 64 * whole.len(), "{at}: {byte}");
            }
        }
    }
}
