//! A short number for what a run did, without its times: requests and targets, positions and states of the drives, and the
//! desired poses and states of the controller, cycle by cycle.
//!
//! Simulated runs of the same scenario and seed have the same digest, whatever the machine. In real time, lost cycles and
//! the phase of the start change the digest.

use crc32fast::Hasher;
use masseter_recording::Recorded;

/// Digests each topic by itself, since the recorder drains topic after topic.
#[derive(Debug, Clone, Default)]
pub(super) struct Digest {
    commands: Hasher,
    readings: Hasher,
    states: Hasher,
}

impl Digest {
    pub(super) fn take(&mut self, message: &Recorded) {
        let (hasher, cycle, code, numbers): (_, _, _, &[&[f64]]) = match message {
            Recorded::Command(command) => {
                (&mut self.commands, command.cycle, command.request, &[&command.target_m])
            }
            Recorded::Reading(reading) => {
                reading.drive_state.iter().for_each(|state| self.readings.update(&state.to_le_bytes()));
                (&mut self.readings, reading.cycle, reading.fresh_axes, &[&reading.position_m])
            }
            Recorded::State(state) => (
                &mut self.states,
                state.cycle,
                state.controller_state,
                &[&state.desired_position_m, &state.desired_quaternion_wxyz],
            ),
            _ => return,
        };
        hasher.update(&cycle.to_le_bytes());
        hasher.update(&code.to_le_bytes());
        numbers.iter().copied().flatten().for_each(|number| hasher.update(&number.to_le_bytes()));
    }

    /// Eight hexadecimal digits.
    pub(super) fn finish(self) -> String {
        let mut all = Hasher::new();
        for topic in [self.commands, self.readings, self.states] {
            all.update(&topic.finalize().to_le_bytes());
        }
        format!("{:08x}", all.finalize())
    }
}

#[cfg(test)]
mod tests {
    use masseter_runtime::messages::{Command, Reading, State};

    use super::*;

    fn digest(messages: &[Recorded]) -> String {
        let mut digest = Digest::default();
        for message in messages {
            digest.take(message);
        }
        digest.finish()
    }

    #[test]
    fn what_the_rig_did_counts_and_when_does_not() {
        let (command, reading) = (Command { cycle: 1, ..Command::default() }, Reading::default());
        let state = State { cycle: 1, woke_ns: 5, ..State::default() };
        let plain = digest(&[command.into(), reading.into(), state.into()]);
        assert_eq!(digest(&[state.into(), command.into(), reading.into()]), plain, "topic after topic");
        let later = State { woke_ns: 6, ..state };
        assert_eq!(digest(&[command.into(), reading.into(), later.into()]), plain);
        let (mut moved, mut off, mut elsewhere) = (command, reading, state);
        (moved.target_m[5], off.drive_state[5], elsewhere.desired_position_m[2]) = (1e-9, 3, 1e-9);
        let changed = [
            digest(&[moved.into(), reading.into(), state.into()]),
            digest(&[command.into(), off.into(), state.into()]),
            digest(&[command.into(), reading.into(), elsewhere.into()]),
            digest(&[command.into(), command.into(), reading.into(), state.into()]),
        ];
        assert!(changed.iter().all(|digest| *digest != plain), "{changed:?} {plain}");
    }
}
