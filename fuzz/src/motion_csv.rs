//! Any file is a recorded motion or refused with the reason; a motion has proper poses at any time, rests at
//! both ends and has the line of each pose.

use std::fmt::Write;

use crate::{assert_proper, file_of};
use arbitrary::{Result, Unstructured};
use masseter_controller::trajectory::Trajectory;
use masseter_model::geometry::{Mechanism, MechanismConfig};
use masseter_scenario::{FileConfig, IfImplausible, JawConfig, MotionConfig};

const POSES: &str = "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz";
const MARKERS: &str = "time_s,m1_x_mm,m1_y_mm,m1_z_mm,m2_x_mm,m2_y_mm,m2_z_mm,m3_x_mm,m3_y_mm,m3_z_mm";
const LONGEST_BYTES: usize = 20_000;

/// Feeds the target with these bytes.
///
/// # Panics
/// If what the head of this file says does not hold.
pub fn feed(data: &[u8]) {
    // Too few bytes make no configuration.
    let _ = play(&mut Unstructured::new(data));
}

fn play(bytes: &mut Unstructured<'_>) -> Result<()> {
    let config = config(bytes)?;
    let text = file(bytes)?;
    let motion = MotionConfig::File(FileConfig { path: file_of(&text), ..config });
    let mechanism = Mechanism::new(&MechanismConfig::default()).expect("the default is a mechanism");
    let trajectory = match Trajectory::new(&motion, &JawConfig::default(), &mechanism, None) {
        Ok(trajectory) => trajectory,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            return Ok(());
        }
    };
    assert_proper(&trajectory);
    let lines = String::from_utf8_lossy(&text).lines().count() as u64;
    for time_s in [0.0, trajectory.duration_s() / 2.0, trajectory.duration_s()] {
        let source = trajectory.source_line(time_s).expect("a recording has lines");
        let line = source.rsplit(':').next().and_then(|line| line.parse().ok());
        assert!(line.is_some_and(|line| (1..=lines).contains(&line)), "{source} of {lines}");
    }
    Ok(())
}

fn config(bytes: &mut Unstructured<'_>) -> Result<FileConfig> {
    let axes =
        *bytes.choose(&[["+x", "+y", "+z"], ["+y", "-x", "+z"], ["-x", "+z", "+y"], ["+x", "+x", "z"]])?;
    let config = FileConfig::new("");
    Ok(FileConfig {
        axes: axes.map(String::from),
        reference_point_mm: bytes.arbitrary()?,
        marker_origin_mm: bytes.arbitrary()?,
        lowpass_hz: *bytes.choose(&[config.lowpass_hz, 0.0, 0.5, 50.0])?,
        // Of random rows hardly any are plausible; with a warning they are played all the same.
        if_implausible: *bytes.choose(&[IfImplausible::Warn, IfImplausible::Refuse])?,
        ..config
    })
}

/// Bytes as they are, or behind either header, or rows of numbers.
fn file(bytes: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let header = if bytes.arbitrary()? { POSES } else { MARKERS };
    match bytes.int_in_range(0..=3)? {
        0 => rest(bytes),
        1 => Ok([header.as_bytes(), b"\n", &rest(bytes)?].concat()),
        _ => rows(bytes, header),
    }
}

fn rest(bytes: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    bytes.bytes(bytes.len()).map(<[u8]>::to_vec)
}

/// Rows of a jaw that moves, but for a number now and then.
fn rows(bytes: &mut Unstructured<'_>, header: &str) -> Result<Vec<u8>> {
    let mut text = format!("{header}\n");
    let mut time_s = 0.0;
    while !bytes.is_empty() && text.len() < LONGEST_BYTES {
        time_s += number(bytes, |byte| f64::from(byte as u8) / 1000.0)?;
        write!(text, "{time_s:?}").expect("strings take all");
        let values = if header == POSES { pose(bytes)? } else { markers(bytes)? };
        values.iter().try_for_each(|value| write!(text, ",{value:?}")).expect("strings take all");
        text.push('\n');
    }
    Ok(text.into_bytes())
}

fn pose(bytes: &mut Unstructured<'_>) -> Result<Vec<f64>> {
    let [x, y, z, a, b, c] = numbers(bytes)?;
    let norm = (1.0 + (a * a + b * b + c * c) / 1e4).sqrt();
    Ok(vec![x, y, z, 1.0 / norm, a / 100.0 / norm, b / 100.0 / norm, c / 100.0 / norm])
}

/// A triangle that moves, and whose corners may move a little by themselves.
fn markers(bytes: &mut Unstructured<'_>) -> Result<Vec<f64>> {
    const CORNERS: [f64; 9] = [0.0, 0.0, 0.0, 30.0, 0.0, 0.0, 0.0, 30.0, 0.0];
    let moved: [f64; 3] = numbers(bytes)?;
    let own: [f64; 9] = if bytes.arbitrary()? { numbers(bytes)? } else { [0.0; 9] };
    Ok((0..9).map(|index| CORNERS[index] + moved[index % 3] + own[index] / 20.0).collect())
}

/// Most of them within ±12.8.
fn numbers<const N: usize>(bytes: &mut Unstructured<'_>) -> Result<[f64; N]> {
    let mut all = [0.0; N];
    for each in &mut all {
        *each = number(bytes, |byte| f64::from(byte) / 10.0)?;
    }
    Ok(all)
}

/// What a byte means, or any number at all.
fn number(bytes: &mut Unstructured<'_>, meaning: fn(i8) -> f64) -> Result<f64> {
    match bytes.arbitrary()? {
        i8::MIN => bytes.arbitrary(),
        byte => Ok(meaning(byte)),
    }
}
