//! What is worked out in advance changes no pose.

use masseter_shared::config::Scenario;
use masseter_shared::geometry::Mechanism;

use super::*;

const STEP_S: f64 = 1e-3;
const AHEAD_S: [f64; FORESEEN] = [0.0, 2.0 * STEP_S];

fn playback() -> Playback {
    let scenario = Scenario::default();
    let mechanism = Mechanism::new(&scenario.mechanism).unwrap();
    let trajectory = Trajectory::new(&scenario.motion, &scenario.jaw, &mechanism, None).unwrap();
    Playback::new(trajectory, 0.1, 0.05)
}

/// The poses wanted now, without what was foreseen and with it, and how many of them were.
fn wanted(playback: &Playback) -> ([Pose; FORESEEN], [Pose; FORESEEN], usize) {
    let unforeseen = Playback { foreseen: [None; FORESEEN], ..playback.clone() };
    let is_foreseen = |ahead_s| playback.foreseen_at(playback.time_ahead_s(ahead_s)).is_some();
    let count = AHEAD_S.into_iter().filter(|&ahead_s| is_foreseen(ahead_s)).count();
    (
        AHEAD_S.map(|ahead_s| unforeseen.pose_ahead(ahead_s)),
        AHEAD_S.map(|ahead_s| playback.pose_ahead(ahead_s)),
        count,
    )
}

#[test]
fn a_motion_that_goes_on_is_foreseen_in_every_part_of_it_and_while_it_comes_to_rest() {
    let mut playback = playback();
    for begin in [Playback::ease, Playback::play, Playback::stop] {
        begin(&mut playback);
        for _ in 0..60 {
            playback.foresee(STEP_S, AHEAD_S);
            playback.advance(STEP_S);
            let (unforeseen, foreseen, count) = wanted(&playback);
            assert_eq!((foreseen, count), (unforeseen, FORESEEN));
        }
    }
}

#[test]
fn what_was_foreseen_is_not_used_where_the_motion_goes_on_otherwise() {
    let otherwise: [fn(&mut Playback); 4] = [
        |_waits| {},
        |stops| {
            stops.stop();
            stops.advance(STEP_S);
        },
        |is_late| is_late.advance(1.5 * STEP_S),
        |begins_anew| {
            begins_anew.ease();
            begins_anew.advance(STEP_S);
        },
    ];
    for goes_on in otherwise {
        let mut playback = playback();
        playback.play();
        (0..500).for_each(|_| playback.advance(STEP_S));
        playback.foresee(STEP_S, AHEAD_S);
        goes_on(&mut playback);
        let (unforeseen, foreseen, count) = wanted(&playback);
        assert_eq!((foreseen, count), (unforeseen, 0));
    }
}
