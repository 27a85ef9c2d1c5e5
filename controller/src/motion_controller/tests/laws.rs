//! Pose laws of a user: a valid law works, and every error of a law ends in a safe stop with its cause.

use masseter_model::geometry::Vec3;
use masseter_runtime::messages::explain;
use nalgebra::{Quaternion, Unit};

use super::*;
use crate::pose_law::{Demand, LawFailed};

/// A law that is a function.
struct Law(fn(&Demand) -> Result<Pose, LawFailed>);

impl std::fmt::Debug for Law {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Law")
    }
}

impl PoseLaw for Law {
    fn command(&mut self, demand: &Demand) -> Result<Pose, LawFailed> {
        (self.0)(demand)
    }
}

fn bench(law: fn(&Demand) -> Result<Pose, LawFailed>) -> Bench {
    let scenario = short();
    let controller =
        MotionController::with_law(&scenario, mechanism(), trajectory(&scenario), Box::new(Law(law)));
    Bench { controller, ..Bench::new() }
}

/// A law of a user with the computation of the default law.
#[derive(Debug)]
struct Copied(PoseControl);

impl PoseLaw for Copied {
    fn command(&mut self, demand: &Demand) -> Result<Pose, LawFailed> {
        self.0.command(demand)
    }
}

#[test]
fn a_law_equal_to_the_default_one_gives_equal_commands_whether_warmed_up_or_not() {
    let scenario = short();
    let law = Box::new(Copied(PoseControl::new(&scenario.controller, 1000)));
    let controller = MotionController::with_law(&scenario, mechanism(), trajectory(&scenario), law);
    let (mut default, mut own) = (Bench::new(), Bench { controller, ..Bench::new() });
    while own.controller.state() != ControllerState::Finished {
        // Work in advance must not reach the law: the law would integrate an error twice.
        own.controller.warm_up();
        default.cycle(Some);
        own.cycle(Some);
        assert_eq!(own.commands, default.commands, "cycle {}", own.cycle);
    }
}

#[test]
fn a_law_that_asks_for_the_desired_pose_plays_the_motion() {
    let mut bench = bench(|demand| Ok(demand.ahead));
    bench.run_until(ControllerState::Finished);
    assert!(bench.events.iter().all(|event| event.kind == EventKind::Transition.code()));
}

#[test]
fn a_law_is_asked_only_while_the_platform_may_move_and_gets_what_the_state_message_reports() {
    let mut bench = bench(|demand| {
        assert!(matches!(
            demand.state,
            ControllerState::Easing | ControllerState::Running | ControllerState::Holding
        ));
        let estimated = demand.estimated.expect("every reading is complete");
        let off = (estimated.translation.vector - demand.desired.translation.vector).norm();
        assert!(off < 1e-3, "{off} m at {} s", demand.motion_time_s);
        Ok(demand.ahead)
    });
    bench.run_until(ControllerState::Finished);
}

#[test]
fn whatever_a_law_does_wrong_ends_in_a_safe_stop_with_its_cause() {
    type Wrong = fn(&Demand) -> Result<Pose, LawFailed>;
    let cases: [(Wrong, Cause, &str); 7] = [
        (|_| Err(LawFailed), Cause::LawFailed, "the pose law: failed"),
        (
            |_| Ok(Pose::translation(f64::NAN, 0.0, 0.27)),
            Cause::LawFailed,
            "gave no pose: its position contains NaN",
        ),
        (
            |_| Ok(Pose::translation(0.0, f64::INFINITY, 0.27)),
            Cause::LawFailed,
            "gave no pose: its position contains inf",
        ),
        (
            |demand| {
                let rotation = Unit::new_unchecked(Quaternion::new(0.5, 0.0, 0.0, 0.0));
                Ok(Pose::from_parts(demand.ahead.translation, rotation))
            },
            Cause::LawFailed,
            "its quaternion has the length 0.5, not 1",
        ),
        (
            |_| Ok(Pose::from_parts(Vec3::zeros().into(), Unit::new_unchecked(Quaternion::from([0.0; 4])))),
            Cause::LawFailed,
            "its quaternion has the length 0, not 1",
        ),
        (|demand| Ok(Pose::translation(0.0, 0.002, 0.0) * demand.ahead), Cause::VelocityLimit, ""),
        (|demand| Ok(Pose::translation(0.0, 0.0, 1.0) * demand.ahead), Cause::StrokeLimit, ""),
    ];
    for (wrong, cause, said) in cases {
        let mut bench = bench(|demand| Ok(demand.ahead));
        bench.run_until(ControllerState::Running);
        (0..100).for_each(|_| bench.cycle(Some));
        bench.controller.law = Box::new(Law(wrong));
        (0..3).for_each(|_| bench.cycle(Some));
        assert_eq!(bench.controller.state(), ControllerState::SafeStop, "{cause}");
        assert_eq!(bench.last_cause(), cause);
        let explained = explain(bench.events.last().unwrap(), &[]).unwrap_or_default();
        assert!(explained.contains(said), "{explained}");
    }
}

/// The platform drifts by less than the velocity limits: supervision of the path stops it.
#[test]
fn a_law_that_drifts_away_is_stopped_by_the_tracking_limit() {
    let mut bench = bench(|demand| {
        let drift_m = 1e-5 * (demand.motion_time_s.max(0.0) * 1000.0);
        Ok(Pose::translation(0.0, 0.0, drift_m) * demand.ahead)
    });
    bench.run_until(ControllerState::SafeStop);
    assert!(
        [Cause::TrackingLost, Cause::OrientationLost].contains(&bench.last_cause()),
        "{}",
        bench.last_cause()
    );
}

#[test]
fn a_controller_is_branched_with_its_law_and_refused_with_a_law_that_has_no_branch() {
    let refusal = bench(|demand| Ok(demand.ahead)).controller.branch().err().unwrap();
    assert!(refusal.0.ends_with("::Law"), "{refusal}");
    assert!(Bench::new().controller.branch().is_ok());
}
