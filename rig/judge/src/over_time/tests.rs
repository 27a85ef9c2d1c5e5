use masseter_can::TappedFrame;
use masseter_can::{Bitrate, CanId, Frame};
use masseter_model::geometry::Deviation;

use super::*;

#[test]
fn a_bus_that_is_half_full_is_said_to_be_where_anything_was_recorded() {
    let frame = Frame::fixed(CanId::standard(0x123).unwrap(), [0x55; 8]);
    let bits = wire::frame_bits(&frame);
    let mut over_time = OverTime::new([0.0; 3], Some(Bitrate::new(2 * 1000 * bits).unwrap()), 0);
    for millisecond in (0..400).chain(600..1000) {
        let time_ns = millisecond * 1_000_000;
        over_time.wake_up(PLANT, time_ns, time_ns + 1);
        over_time.apply_frame(time_ns, 0, &Tapped::Frame(TappedFrame { frame, time_ns, queued_ns: None }));
    }
    let loads: Vec<_> = over_time.bus_load().collect();
    let [load] = &loads[..] else { panic!("{loads:?}") };
    assert!(load.iter().all(|(_, share)| (share - 0.5).abs() < 1e-3), "{load:?}");
    let is_lost = |(at_s, _): &&(f64, f64)| (0.4..0.6).contains(at_s);
    assert_eq!((load.len(), load.iter().filter(is_lost).count()), (80, 0));
}

/// The platform moves by 1 mm a cycle, and from cycle 20 on without a desired pose.
#[test]
fn the_incisal_point_is_followed_in_the_whole_run_and_its_path_to_its_end() {
    let mut over_time = OverTime::new([0.03, 0.0, -0.01], None, 0);
    for cycle in 0..40_u64 {
        let sampled_ns = 5_000_000 + cycle * 1_000_000;
        let x = cycle as f64 * 1e-3;
        let pose = Pose::translation(x, 0.0, 0.0);
        over_time.incisal(Place::Actual, sampled_ns, Some(&pose));
        if cycle < 20 {
            let desired = Some(Pose::translation(x + 1e-3, 0.0, 0.0));
            let deviation = Deviation { origin_m: 9.0, incisal_m: 1e-3, angle_rad: 9.0 };
            over_time.apply_path(&PathSample { sampled_ns, desired, actual: None, deviation });
        }
    }
    assert!((over_time.duration_s - 0.039).abs() < 1e-12);
    let ends = |band: &Band| {
        let curve = band.curve();
        [curve[0], curve[curve.len() - 1]]
    };
    assert_eq!(ends(&over_time.actual_incisal_m[0]), [(0.0, 0.03), (0.039, 0.069)]);
    assert_eq!(ends(&over_time.desired_incisal_m[0]), [(0.0, 0.031), (0.019, 0.05)]);
    assert_eq!(ends(&over_time.actual_incisal_m[2]), [(0.0, -0.01), (0.039, -0.01)]);
    assert!(over_time.distance_m.curve().iter().all(|(_, distance_m)| (distance_m - 1e-3).abs() < 1e-12));
}
