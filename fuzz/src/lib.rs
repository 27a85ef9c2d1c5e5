//! Fuzz targets: what must hold for any bytes from outside. `fuzz/run` feeds them under libFuzzer, which searches for bytes that
//! reach something new. `cargo test` feeds each with a sample, without a search.

pub mod can_codecs;
pub mod forward_kinematics;
pub mod motion_csv;
pub mod recording;
#[cfg(test)]
mod sample;
pub mod scenario;

use std::fs;
use std::path::PathBuf;

use masseter_controller::trajectory::Trajectory;

/// How far a rotation may be from one, which leaves a platform rigid.
const UNIT_WITHIN: f64 = 1e-9;

/// A file that holds these bytes, always the same one of this thread: for readers that take a path.
fn file_of(bytes: &[u8]) -> PathBuf {
    let (process, thread) = (std::process::id(), std::thread::current().id());
    let path = std::env::temp_dir().join(format!("masseter-fuzz-{process}-{thread:?}"));
    fs::write(&path, bytes).expect("the folder for temporary files takes a file");
    path
}

/// Whether the trajectory has a rigid, finite pose at any time, and rests before its start and after its end.
fn assert_proper(trajectory: &Trajectory) {
    let duration_s = trajectory.duration_s();
    assert!(duration_s.is_finite() && duration_s > 0.0, "a motion of {duration_s} s");
    for step in 0..=20 {
        let time_s = duration_s * f64::from(step) / 20.0;
        let pose = trajectory.pose(time_s);
        assert!(pose.to_homogeneous().iter().all(|x| x.is_finite()), "{pose} at {time_s} s");
        assert!((pose.rotation.norm() - 1.0).abs() < UNIT_WITHIN, "{pose} at {time_s} s");
    }
    assert_eq!(trajectory.pose(-1.0), trajectory.pose(0.0));
    assert_eq!(trajectory.pose(duration_s + 1.0), trajectory.pose(duration_s));
}
