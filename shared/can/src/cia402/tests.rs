use super::DriveState::{
    Fault, FaultReactionActive, NotReadyToSwitchOn, OperationEnabled, QuickStopActive, ReadyToSwitchOn,
    SwitchOnDisabled, SwitchedOn,
};
use super::*;

#[test]
fn a_drive_has_voltage_from_switched_on_to_the_end_of_a_fault_reaction() {
    let powered = DriveState::ALL.into_iter().filter(|state| state.is_powered());
    assert!(powered.eq([SwitchedOn, OperationEnabled, QuickStopActive, FaultReactionActive]));
}

const COMMANDS: [StateCommand; 6] = [
    StateCommand::Shutdown,
    StateCommand::SwitchOn,
    StateCommand::EnableOperation,
    StateCommand::DisableVoltage,
    StateCommand::QuickStop,
    StateCommand::FaultReset,
];

/// Row: state. Column: the state after each of [`COMMANDS`].
#[rustfmt::skip]
const TABLE: [(DriveState, [DriveState; 6]); 8] = [
    (NotReadyToSwitchOn,  [NotReadyToSwitchOn; 6]),
    (SwitchOnDisabled,    [ReadyToSwitchOn, SwitchOnDisabled, SwitchOnDisabled, SwitchOnDisabled, SwitchOnDisabled, SwitchOnDisabled]),
    (ReadyToSwitchOn,     [ReadyToSwitchOn, SwitchedOn, OperationEnabled, SwitchOnDisabled, SwitchOnDisabled, ReadyToSwitchOn]),
    (SwitchedOn,          [ReadyToSwitchOn, SwitchedOn, OperationEnabled, SwitchOnDisabled, SwitchOnDisabled, SwitchedOn]),
    (OperationEnabled,    [ReadyToSwitchOn, SwitchedOn, OperationEnabled, SwitchOnDisabled, QuickStopActive, OperationEnabled]),
    (QuickStopActive,     [QuickStopActive, QuickStopActive, QuickStopActive, SwitchOnDisabled, QuickStopActive, QuickStopActive]),
    (FaultReactionActive, [FaultReactionActive; 6]),
    (Fault,               [Fault, Fault, Fault, Fault, Fault, SwitchOnDisabled]),
];

#[test]
fn every_command_in_every_state() {
    for (state, expected) in TABLE {
        assert_eq!(COMMANDS.map(|command| state.after(command)), expected, "from {state}");
    }
}

#[test]
fn only_a_held_quick_stop_can_be_left_for_operation() {
    for state in DriveState::ALL {
        for command in COMMANDS {
            let differs = state.after_in_held_quick_stop(command) != state.after(command);
            assert_eq!(differs, state == QuickStopActive && command == StateCommand::EnableOperation);
        }
    }
    assert_eq!(QuickStopActive.after_in_held_quick_stop(StateCommand::EnableOperation), OperationEnabled);
}

#[test]
fn a_fault_ends_in_fault_from_every_state() {
    for state in DriveState::ALL {
        assert_eq!(state.after_fault().after_completion(), Fault, "from {state}");
    }
}

#[test]
fn a_drive_goes_on_by_itself_from_three_states_only() {
    let moved = DriveState::ALL.into_iter().filter(|state| state.after_completion() != *state);
    assert!(moved.eq([NotReadyToSwitchOn, QuickStopActive, FaultReactionActive]));
}

const FLAGS: [StatusBit; 7] = [
    StatusBit::VoltageEnabled,
    StatusBit::Warning,
    StatusBit::Remote,
    StatusBit::TargetReached,
    StatusBit::InternalLimit,
    StatusBit::TargetFollowed,
    StatusBit::FollowingError,
];

#[test]
fn every_statusword_encodes_at_most_one_state() {
    for bits in 0..=u16::MAX {
        let matching: Vec<_> = PATTERNS.iter().filter(|pattern| bits & pattern.0 == pattern.1).collect();
        assert!(matching.len() <= 1, "{bits:04X}h matches {matching:?}");
        assert_eq!(Statusword(bits).state().ok(), matching.first().map(|pattern| pattern.2));
    }
}

#[test]
fn a_state_survives_any_flags() {
    for state in DriveState::ALL {
        let all = FLAGS.into_iter().fold(Statusword::for_state(state), |word, bit| word.with(bit, true));
        assert_eq!(all.state(), Ok(state));
        assert!(FLAGS.into_iter().all(|bit| all.has(bit) && !all.with(bit, false).has(bit)));
    }
}

#[test]
fn bits_of_no_state_are_refused() {
    assert_eq!(Statusword(0x0001).state(), Err(StatuswordError(0x0001)));
    assert_eq!(StatuswordError(0x61).to_string(), "statusword 0061h encodes no state of CiA 402");
}

#[test]
fn words_seen_on_drives_are_understood() {
    let enabled = Statusword(0x1237);
    assert_eq!(enabled.state(), Ok(DriveState::OperationEnabled));
    assert!(enabled.has(StatusBit::TargetFollowed) && enabled.has(StatusBit::Remote));
    assert_eq!(Statusword(0x0250).state(), Ok(DriveState::SwitchOnDisabled));
    assert_eq!(Statusword(0x0218).state(), Ok(DriveState::Fault));
}

const IDLE: Controlword = Controlword::DISABLE_VOLTAGE;

#[test]
fn words_are_those_of_the_standard() {
    let table = [
        (Controlword::SHUTDOWN, 0x06, StateCommand::Shutdown),
        (Controlword::SWITCH_ON, 0x07, StateCommand::SwitchOn),
        (Controlword::ENABLE_OPERATION, 0x0F, StateCommand::EnableOperation),
        (Controlword::DISABLE_VOLTAGE, 0x00, StateCommand::DisableVoltage),
        (Controlword::QUICK_STOP, 0x02, StateCommand::QuickStop),
        (Controlword::FAULT_RESET, 0x80, StateCommand::FaultReset),
    ];
    for (word, bits, command) in table {
        assert_eq!(word.0, bits);
        assert_eq!(word.command(IDLE, DriveState::Fault), command);
    }
}

#[test]
fn dont_care_bits_do_not_matter() {
    let table = [
        (0b0000_1110, StateCommand::Shutdown),
        (0b0000_1101, StateCommand::DisableVoltage),
        (0b0000_1011, StateCommand::QuickStop),
        (0b1_0111_1111, StateCommand::EnableOperation),
    ];
    for (bits, command) in table {
        assert_eq!(Controlword(bits).command(IDLE, DriveState::Fault), command, "{bits:04X}h");
    }
}

#[test]
fn only_the_rising_edge_of_bit_7_resets() {
    for previous in 0..=0xFF {
        let command = Controlword::FAULT_RESET.command(Controlword(previous), DriveState::Fault);
        assert_eq!(command == StateCommand::FaultReset, previous & Controlword::FAULT_RESET.0 == 0);
    }
}

#[test]
fn bit_7_masks_no_stop() {
    let held = Controlword(Controlword::QUICK_STOP.0 | Controlword::FAULT_RESET.0);
    assert_eq!(held.command(Controlword::FAULT_RESET, DriveState::Fault), StateCommand::QuickStop);
    let enabled = DriveState::OperationEnabled;
    assert_eq!(held.command(Controlword::ENABLE_OPERATION, enabled), StateCommand::QuickStop);
    let off = Controlword::FAULT_RESET.command(Controlword::ENABLE_OPERATION, enabled);
    assert_eq!(off, StateCommand::DisableVoltage);
}

/// More steps than the longest way: fault reaction, fault, two words for the edge of the reset, four steps up.
const STEPS: usize = 8;

/// States of a drive that finishes its own tasks at once and then obeys [`next_controlword`].
fn journey(start: DriveState, request: DriveRequest, mut previous: Controlword) -> Vec<DriveState> {
    let mut state = start;
    let mut states = vec![start];
    for _ in 0..STEPS {
        let word = next_controlword(state, request, previous);
        state = state.after_completion();
        state = state.after(word.command(previous, state));
        previous = word;
        states.push(state);
    }
    states
}

#[test]
fn enable_reaches_operation_enabled_from_everywhere_whatever_was_sent_before() {
    for state in DriveState::ALL {
        for previous in 0..=0xFF {
            let end = journey(state, DriveRequest::Enable, Controlword(previous)).pop();
            assert_eq!(end, Some(DriveState::OperationEnabled), "from {state} after {previous:02X}h");
        }
    }
}

#[test]
fn off_and_quick_stop_end_without_force_and_leave_a_fault_alone() {
    for request in [DriveRequest::Off, DriveRequest::QuickStop] {
        for state in DriveState::ALL {
            let end = journey(state, request, Controlword::FAULT_RESET).pop();
            let faulted = state.after_completion() == DriveState::Fault;
            let expected = if faulted { DriveState::Fault } else { DriveState::SwitchOnDisabled };
            assert_eq!(end, Some(expected), "{request} from {state}");
        }
    }
}

#[test]
fn a_moving_drive_brakes_before_it_is_switched_off() {
    let states =
        journey(DriveState::OperationEnabled, DriveRequest::QuickStop, Controlword::ENABLE_OPERATION);
    assert_eq!(states[1], DriveState::QuickStopActive);
}

#[test]
fn an_unanswered_fault_reset_makes_a_new_edge_every_other_call() {
    let mut previous = Controlword::ENABLE_OPERATION;
    let words = [(); 4].map(|()| {
        previous = next_controlword(DriveState::Fault, DriveRequest::Enable, previous);
        previous
    });
    let (reset, low) = (Controlword::FAULT_RESET, Controlword::DISABLE_VOLTAGE);
    assert_eq!(words, [reset, low, reset, low]);
}

#[test]
fn periods_are_written_with_the_fewest_digits_and_never_too_short() {
    let table = [
        (1_000_000, (1, -3)),
        (2_500_000, (25, -4)),
        (4_000_000, (4, -3)),
        (100_000_000, (1, -1)),
        (1_000_000_000, (1, 0)),
        (125_000, (125, -6)),
        (3_333_333, (34, -4)),
        (2_544_529, (255, -5)),
        (1_124_859, (113, -5)),
        (2_550_001, (26, -4)),
        (0, (1, -6)),
        (1_000_000_000_000, (255, 0)),
    ];
    for (period_ns, expected) in table {
        assert_eq!(interpolation_period(period_ns), expected, "{period_ns} ns");
    }
}
