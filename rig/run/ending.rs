//! How a run came to its end, by how its processes ended.

use std::process::ExitStatus;

use masseter_recording::Ending;
use masseter_terminal::Exit;

use super::child::{Role, describe};

/// What a run's end is called: after the first process that died, or what the recording lacks; else after who broke it
/// off; else as the controller ended.
pub(super) fn of_all(broken_off: Option<Ending>, controller: Ending, others: Option<Ending>) -> Ending {
    match (broken_off, controller, others) {
        (Some(died @ Ending::Died { .. }), ..) | (_, died @ Ending::Died { .. }, _) => died,
        (_, _, Some(others)) => others,
        (Some(broken_off), _, None) => broken_off,
        (None, controller, None) => controller,
    }
}

/// What plant and logger make of a run whose controller ended as it should.
pub(super) fn of_the_others(plant: Option<ExitStatus>, logger: Option<ExitStatus>) -> Option<Ending> {
    if !plant.is_some_and(|status| status.success()) {
        return Some(died(Role::Plant, plant));
    }
    match logger.and_then(|status| status.code()) {
        Some(code) if code == Exit::Passed as i32 => None,
        Some(code) if code == Exit::Incomplete as i32 => Some(Ending::RecordingFailed),
        _ => Some(died(Role::Logger, logger)),
    }
}

pub(super) fn died(role: Role, status: Option<ExitStatus>) -> Ending {
    let how = status.map_or_else(|| "it did not end when asked to, and was killed".to_owned(), describe);
    Ending::died(role.name(), how)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_death_outranks_a_gap_in_the_recording_that_the_users_word_and_that_a_safe_stop() {
        let died = |role: Role| Ending::died(role.name(), "SIGKILL (9)".to_owned());
        let (logger, plant, controller) = (died(Role::Logger), died(Role::Plant), died(Role::Controller));
        let (completed, interrupted, safe_stop) = (Ending::Completed, Ending::Interrupted, Ending::SafeStop);
        let gap = Ending::RecordingFailed;
        for (broken_off, by_controller, others, expected) in [
            (None, &completed, None, &completed),
            (None, &safe_stop, None, &safe_stop),
            (None, &safe_stop, Some(&gap), &gap),
            (None, &controller, Some(&gap), &controller),
            (Some(&interrupted), &completed, None, &interrupted),
            (Some(&interrupted), &safe_stop, None, &interrupted),
            (Some(&interrupted), &completed, Some(&gap), &gap),
            (Some(&interrupted), &completed, Some(&plant), &plant),
            (Some(&interrupted), &controller, Some(&plant), &controller),
            (Some(&logger), &controller, Some(&plant), &logger),
        ] {
            let found = of_all(broken_off.cloned(), by_controller.clone(), others.cloned());
            assert_eq!(&found, expected, "{broken_off:?}, {by_controller:?}, {others:?}");
        }
    }
}
