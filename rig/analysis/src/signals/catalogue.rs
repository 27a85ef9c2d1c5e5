//! Every signal that a run has.
//!
//! Values are SI numbers; states are their codes. A value that a cycle does not have is none, never a guess.

use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_runtime::messages::codes::{ControllerState, DriveRequest, DriveState, NO_DRIVE_STATE};
use masseter_runtime::named::Declared;
use masseter_scenario::{Scenario, Unit};

use super::cycle::CycleMessages;
use super::derived::{Jaw, JawPoint, desired, estimated, solution};
use super::list::SignalList;
use super::signal::NamedSignal;

/// The signals of a run of this scenario with this jaw, whose controller declares these.
pub(super) fn signals(scenario: &Scenario, jaw: Jaw, declared: &Declared) -> Vec<NamedSignal> {
    let mut list = SignalList::default();
    add_jaw(&mut list, jaw);
    add_contact(&mut list, scenario);
    if scenario.load_cell.is_some() {
        list.add("load_cell.force", "N", "Bite force that the load cell shows.", |messages| {
            Some(messages.reading?.load_cell_n)
        });
    }
    add_axes(&mut list);
    add_controller(&mut list);
    add_timing(&mut list);
    add_declared(&mut list, declared);
    list.into_signals()
}

fn add_jaw(list: &mut SignalList, jaw: Jaw) {
    let points = [
        ("incisal", JawPoint::Incisal),
        ("condyle.left", JawPoint::LeftCondyle),
        ("condyle.right", JawPoint::RightCondyle),
    ];
    for (name, point) in points {
        for (at, axis) in ["x", "y", "z"].into_iter().enumerate() {
            list.add(
                format!("{name}.{axis}"),
                "mm",
                format!("Place of the point along {axis} of the base: the true one, on the robot the estimated one."),
                move |messages| Some(jaw.place(point, &jaw.actual(messages)?)[at]),
            );
        }
        list.add(
            format!("{name}.error"),
            "mm",
            "Distance of the point from its desired place.",
            move |messages| Some(jaw.distance(point, &jaw.actual(messages)?, &desired(messages)?)),
        );
    }
    for (at, axis) in ["x", "y", "z"].into_iter().enumerate() {
        list.add(
            format!("incisal.desired.{axis}"),
            "mm",
            format!("Desired place of the incisal point along {axis} of the base."),
            move |messages| Some(jaw.place(JawPoint::Incisal, &desired(messages)?)[at]),
        );
    }
    list.add(
        "incisal.estimated_error",
        "mm",
        "Distance of the incisal point from its desired place, by forward kinematics.",
        move |messages| Some(jaw.distance(JawPoint::Incisal, &estimated(messages)?, &desired(messages)?)),
    );
    list.add_from(
        "jaw.opening",
        "mm",
        "Distance of the incisal point from its place when the motion began.",
        move |messages, start| Some(jaw.distance(JawPoint::Incisal, &jaw.actual(messages)?, &start.pose?)),
    );
    list.add_from(
        "jaw.rotation",
        "deg",
        "Angle of the jaw from its orientation when the motion began.",
        move |messages, start| Some(jaw.actual(messages)?.rotation.angle_to(&start.pose?.rotation)),
    );
    list.add(
        "platform.error",
        "mm",
        "Distance of the platform's origin from its desired place.",
        move |messages| {
            Some((jaw.actual(messages)?.translation.vector - desired(messages)?.translation.vector).norm())
        },
    );
    list.add(
        "platform.angle_error",
        "deg",
        "Angle of the platform from its desired orientation.",
        move |messages| Some(jaw.actual(messages)?.rotation.angle_to(&desired(messages)?.rotation)),
    );
    list.add(
        "bite.force",
        "N",
        "Vertical force of food and upper teeth on the emulated jaw, mean over the cycle.",
        |messages| Some(messages.truth?.bite_force_n),
    );
}

/// None where the jaws cannot touch.
fn add_contact(list: &mut SignalList, scenario: &Scenario) {
    if !scenario.has_contact() {
        return;
    }
    for tooth in scenario.arch().into_iter().map(|tooth| u32::from(tooth.number)) {
        list.add(
            format!("contact.{tooth}"),
            "N",
            format!("Force of antagonist and food on tooth {tooth}, mean over a cycle."),
            move |messages| loads_n(messages)?.find(|(number, _)| *number == tooth).map(|(_, load_n)| load_n),
        );
    }
    list.add("contact.total", "N", "Sum of the forces on all teeth.", |messages| {
        Some(loads_n(messages)?.map(|(_, load_n)| load_n).sum())
    });
}

fn add_axes(list: &mut SignalList) {
    for (axis, name) in AXIS_NAMES.into_iter().enumerate() {
        let at = move |values: [f64; AXES]| values[axis];
        // Before the first process data of a drive, and after its loss, a reading has no values of the drive.
        let reading = move |messages: &CycleMessages| {
            messages.reading.filter(|reading| reading.drive_state[axis] != NO_DRIVE_STATE)
        };
        // Without a request to the drives a command has no targets.
        let command = |messages: &CycleMessages| {
            messages.command.filter(|command| command.request != DriveRequest::Off.code())
        };
        list.add(format!("{name}.position"), "mm", "Position that the encoder reports.", move |messages| {
            Some(at(reading(messages)?.position_m))
        });
        list.add(format!("{name}.true_position"), "mm", "True position of the axis.", move |messages| {
            Some(at(messages.truth?.joint_m))
        });
        list.add(format!("{name}.velocity"), "mm/s", "True velocity of the axis.", move |messages| {
            Some(at(messages.truth?.joint_m_s))
        });
        list.add(
            format!("{name}.force"),
            "N",
            "Force that the drive reports; of an emulated one the mean over the cycle.",
            move |messages| Some(at(reading(messages)?.force_n)),
        );
        list.add(format!("{name}.target"), "mm", "Target of the cycle's command.", move |messages| {
            Some(at(command(messages)?.target_m))
        });
        list.add_state(format!("{name}.drive"), "State of the drive.", drive_states, move |messages| {
            Some(reading(messages)?.drive_state[axis])
        });
    }
}

fn add_controller(list: &mut SignalList) {
    list.add_state("controller.state", "State of the controller.", controller_states, |messages| {
        Some(messages.state?.controller_state)
    });
    list.add("motion.time", "s", "How far the motion has come.", |messages| {
        Some(messages.state?.motion_time_s)
    });
    list.add("fk.residual", "um", "Largest difference of a platform side from its length.", |messages| {
        Some(solution(messages)?.residual_m)
    });
    list.add(
        "fk.condition",
        "",
        "Condition number of the Jacobian, computed every ten cycles and held in between.",
        |messages| Some(solution(messages)?.condition),
    );
    list.add("fk.iterations", "", "Iterations of the forward kinematics.", |messages| {
        Some(f64::from(solution(messages)?.iterations))
    });
    list.add("master.fault", "", "1 once the master refuses to move anything.", |messages| {
        Some(f64::from(messages.reading?.master_fault))
    });
}

fn add_timing(list: &mut SignalList) {
    for (place, role) in ["controller", "plant"].into_iter().enumerate() {
        let about = format!(
            "Share of its core that the {role}'s loop took since its message before, by work and by spinning."
        );
        let cpu = NamedSignal::new(format!("{role}.cpu"), "%", about, move |messages, _| messages.cpu[place]);
        list.push(cpu.with_absence("; simulated time takes no share of a core: use --clock rt"));
    }
    let seconds =
        |from_ns: u64, to_ns: u64| (from_ns > 0 && to_ns > 0).then(|| (to_ns as f64 - from_ns as f64) / 1e9);
    list.add("plant.wake_up", "us", "Wake-up of the plant after its deadline.", move |messages| {
        messages.reading.and_then(|reading| seconds(reading.due_ns, reading.woke_ns))
    });
    list.add("controller.wake_up", "us", "Wake-up of the controller after its deadline.", move |messages| {
        messages.state.and_then(|state| seconds(state.due_ns, state.woke_ns))
    });
    list.add("controller.work", "us", "Time from the reading to the ready command.", move |messages| {
        solution(messages).and_then(|state| seconds(state.received_ns, state.commanded_ns))
    });
    list.add("fk.time", "us", "Time that the forward kinematics takes.", move |messages| {
        solution(messages).and_then(|state| seconds(state.received_ns, state.solved_ns))
    });
    list.add("process_data.time", "us", "Time from SYNC to the last process data.", move |messages| {
        messages.reading.and_then(|reading| seconds(reading.sampled_ns, reading.complete_ns))
    });
    list.add("plant.skipped", "", "Deadlines that the plant has skipped since the start.", |messages| {
        Some(messages.reading?.skipped_cycles as f64)
    });
    list.add(
        "controller.skipped",
        "",
        "Deadlines that the controller has skipped since the start.",
        |messages| Some(messages.state?.skipped_cycles as f64),
    );
}

fn add_declared(list: &mut SignalList, declared: &Declared) {
    for (place, signal) in declared.signals.iter().enumerate() {
        let si = Unit::named(&signal.unit).map_or(1.0, |unit| unit.si);
        list.add(format!("signal.{}", signal.name), &signal.unit, &signal.about, move |messages| {
            Some(messages.signals.as_ref()?.signals.as_slice().get(place)? * si)
        });
    }
    for (place, parameter) in declared.parameters.iter().enumerate() {
        let si = Unit::named(&parameter.unit).map_or(1.0, |unit| unit.si);
        list.add(
            format!("parameter.{}", parameter.name),
            &parameter.unit,
            &parameter.about,
            move |messages| Some(messages.parameters.as_ref()?.parameters.as_slice().get(place)? * si),
        );
    }
}

/// The force on each tooth, N.
fn loads_n(messages: &CycleMessages) -> Option<impl Iterator<Item = (u32, f64)>> {
    Some(messages.contact.as_ref()?.teeth().map(|tooth| (tooth.number, tooth.load_n())))
}

fn controller_states() -> Vec<(&'static str, u32)> {
    ControllerState::ALL.iter().map(|state| (state.name(), state.code())).collect()
}

fn drive_states() -> Vec<(&'static str, u32)> {
    DriveState::ALL.iter().map(|state| (state.name(), state.code())).collect()
}
