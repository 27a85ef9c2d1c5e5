//! The ending of a run, from the endings of its processes.

use std::process::ExitStatus;

use masseter_recording::Ending;
use masseter_terminal::Exit;

use super::child::{KILLED, PLANT, RECORDER, describe};

/// The ending of the run: the first death of a process, else an incomplete recording, else the interruption, else the
/// controller's ending.
pub(super) fn of_run(interruption: Option<Ending>, controller: Ending, others: Option<Ending>) -> Ending {
    match (interruption, controller, others) {
        (Some(died @ Ending::Died { .. }), ..) | (_, died @ Ending::Died { .. }, _) => died,
        (_, _, Some(others)) => others,
        (Some(interruption), _, None) => interruption,
        (None, controller, None) => controller,
    }
}

/// The ending that plant or recorder cause, if any. None as a status means that the process was killed.
pub(super) fn of_plant_and_recorder(
    plant: Option<ExitStatus>,
    recorder: Option<ExitStatus>,
) -> Option<Ending> {
    if !plant.is_some_and(|status| status.success()) {
        return Some(died(PLANT, plant));
    }
    match recorder.and_then(|status| status.code()) {
        Some(code) if code == Exit::Passed as i32 => None,
        Some(code) if code == Exit::Incomplete as i32 => Some(Ending::RecordingFailed),
        _ => Some(died(RECORDER, recorder)),
    }
}

/// The cause of death of a process that did not end when it was asked to.
pub(super) const NOT_ENDED: &str = "it did not end when it was asked to";

pub(super) fn died(role: &str, status: Option<ExitStatus>) -> Ending {
    let how = status.map_or_else(|| format!("{NOT_ENDED}, and {KILLED}"), describe);
    Ending::died(role, how)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_death_outranks_an_incomplete_recording_then_an_interruption_then_a_safe_stop() {
        let died = |role| Ending::died(role, "SIGKILL (9)".to_owned());
        let (recorder, plant, controller) = (died(RECORDER), died(PLANT), died("controller"));
        let (completed, interrupted, safe_stop) = (Ending::Completed, Ending::Interrupted, Ending::SafeStop);
        let gap = Ending::RecordingFailed;
        for (interruption, by_controller, others, expected) in [
            (None, &completed, None, &completed),
            (None, &safe_stop, None, &safe_stop),
            (None, &safe_stop, Some(&gap), &gap),
            (None, &controller, Some(&gap), &controller),
            (Some(&interrupted), &completed, None, &interrupted),
            (Some(&interrupted), &safe_stop, None, &interrupted),
            (Some(&interrupted), &completed, Some(&gap), &gap),
            (Some(&interrupted), &completed, Some(&plant), &plant),
            (Some(&interrupted), &controller, Some(&plant), &controller),
            (Some(&recorder), &controller, Some(&plant), &recorder),
        ] {
            let found = of_run(interruption.cloned(), by_controller.clone(), others.cloned());
            assert_eq!(&found, expected, "{interruption:?}, {by_controller:?}, {others:?}");
        }
    }
}
