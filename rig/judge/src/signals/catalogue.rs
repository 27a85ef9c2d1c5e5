//! Every signal that a run has.
//!
//! Values are SI numbers; states are their codes. A value that a cycle does not have is none, never a guess.

use masseter_model::geometry::{AXES, AXIS_NAMES, Vec3};
use masseter_recorded_motion::recorded_signals;
use masseter_runtime::messages::codes::{ControllerState, DriveRequest, DriveState, NO_DRIVE_STATE};
use masseter_runtime::messages::{Truth, WORKS};
use masseter_runtime::named::{Declared, PlayedMotion};
use masseter_scenario::{MotionConfig, Scenario, Unit};

use super::signal::{Jaw, JawPoint, NamedSignal, SignalList};
use super::timeline::CycleMessages;
use crate::pressure::{PressedTooth, Pressure};
use crate::{condyles::Condyles, poses::true_pose};

/// A measure of what presses on a tooth.
type Measure = fn(&Pressure) -> f64;
/// An energy in the truth, J.
type Stored = fn(&Truth) -> f64;

/// The signals of a run of this scenario with this jaw, whose controller declares these.
pub(super) fn signals(scenario: &Scenario, jaw: Jaw, declared: &Declared) -> Vec<NamedSignal> {
    let mut list = SignalList::default();
    add_jaw(&mut list, jaw, scenario.has_contact());
    add_contact(&mut list, scenario);
    if scenario.load_cell.is_some() {
        list.add("load_cell.force", Unit::N, "Bite force that the load cell shows.", |of| {
            Some(of.reading?.load_cell_n)
        })
        .truth_if(true);
    }
    add_axes(&mut list, jaw.has_truth);
    add_energy(&mut list);
    add_controller(&mut list);
    add_timing(&mut list);
    add_declared(&mut list, declared);
    add_recorded(&mut list, scenario, declared);
    list.0
}

fn add_jaw(list: &mut SignalList, jaw: Jaw, has_contact: bool) {
    let points = [
        ("incisal", JawPoint::Incisal),
        ("condyle.left", JawPoint::LeftCondyle),
        ("condyle.right", JawPoint::RightCondyle),
    ];
    for (name, point) in points {
        for (at, axis) in ["x", "y", "z"].into_iter().enumerate() {
            list.add(
                format!("{name}.{axis}"),
                Unit::MM,
                format!("Place of the point along {axis} of the base: the true one, on the robot the estimated one."),
                move |of| Some(jaw.place(point, &jaw.actual(of)?)[at]),
            ).truth_if(jaw.has_truth);
        }
        list.add(
            format!("{name}.error"),
            Unit::MM,
            "Distance of the point from its desired place.",
            move |of| Some(jaw.distance(point, &jaw.actual(of)?, &of.desired?)),
        );
    }
    for (at, axis) in ["x", "y", "z"].into_iter().enumerate() {
        list.add(
            format!("incisal.desired.{axis}"),
            Unit::MM,
            format!("Desired place of the incisal point along {axis} of the base."),
            move |of| Some(jaw.place(JawPoint::Incisal, &of.desired?)[at]),
        );
    }
    list.add(
        "incisal.estimated_error",
        Unit::MM,
        "Distance of the incisal point from its desired place, by forward kinematics.",
        move |of| Some(jaw.distance(JawPoint::Incisal, &of.estimated()?, &of.desired?)),
    );
    let ways = [
        ("jaw.opening", "down", Vec3::new(0.0, 0.0, -1.0)),
        ("jaw.forward", "forward", Vec3::new(1.0, 0.0, 0.0)),
        ("jaw.left", "to the left", Vec3::new(0.0, 1.0, 0.0)),
    ];
    for (name, direction, along) in ways {
        let about = format!("Way of the incisal point {direction} from the closed jaw.");
        list.add(name, Unit::MM, about, move |of| Some(jaw.way(&jaw.actual(of)?)?.dot(&along)))
            .truth_if(jaw.has_truth);
    }
    for (axis, name, direction) in
        [(1, "pitch", "opening"), (2, "yaw", "to the left"), (0, "roll", "to the right")]
    {
        let about =
            format!("Turn of the jaw from the closed jaw, {direction}: a component of the rotation vector.");
        list.add(format!("jaw.{name}"), Unit::DEG, about, move |of| Some(jaw.turn(&jaw.actual(of)?)?[axis]))
            .truth_if(jaw.has_truth);
    }
    for (axis, name, direction) in [(0, "x", "forward"), (2, "z", "up")] {
        let about = format!(
            "Where the hinge axis from the closed jaw meets the midsagittal plane, {direction} of the closed incisal point; none \
             for turns below 2°."
        );
        list.add(format!("jaw.hinge.{name}"), Unit::MM, about, move |of| {
            Some(jaw.hinge(&jaw.actual(of)?)?[axis])
        })
        .truth_if(jaw.has_truth);
    }
    list.add(
        "jaw.rotation",
        Unit::DEG,
        "Angle of the jaw from its orientation when the motion began.",
        move |of| Some(jaw.actual(of)?.rotation.angle_to(&of.start?.rotation)),
    )
    .truth_if(jaw.has_truth);
    list.add(
        "platform.error",
        Unit::MM,
        "Distance of the platform's origin from its desired place.",
        move |of| Some((jaw.actual(of)?.translation.vector - of.desired?.translation.vector).norm()),
    );
    list.add(
        "platform.angle_error",
        Unit::DEG,
        "Angle of the platform from its desired orientation.",
        move |of| Some(jaw.actual(of)?.rotation.angle_to(&of.desired?.rotation)),
    );
    list.add(
        "bite.force",
        Unit::N,
        "Vertical force of food and upper teeth on the emulated jaw, mean over the cycle.",
        |of| Some(of.truth?.bite_force_n),
    )
    .truth_if(has_contact);
}

/// Adds nothing if the jaws cannot touch.
fn add_contact(list: &mut SignalList, scenario: &Scenario) {
    if !scenario.has_contact() {
        return;
    }
    for tooth in scenario.arch().into_iter().map(|tooth| u32::from(tooth.number)) {
        list.add(
            format!("contact.{tooth}"),
            Unit::N,
            format!("Force of antagonist and food on tooth {tooth}, mean over a cycle."),
            move |of| loads_n(of)?.find(|(number, _)| *number == tooth).map(|(_, load_n)| load_n),
        )
        .truth_if(true);
    }
    list.add("contact.total", Unit::N, "Sum of the forces on all teeth.", |of| {
        Some(loads_n(of)?.map(|(_, load_n)| load_n).sum())
    })
    .truth_if(true);
    for (place, side) in ["left", "right"].into_iter().enumerate() {
        let condyles = Condyles::new(scenario);
        let about = format!(
            "Force on the {side} condyle if both condyles alone held the jaw against teeth, food, weight and inertia: an estimate \
             without muscles."
        );
        list.add(format!("condyle.{side}.load"), Unit::N, about, move |of| {
            let truths = [of.truth_before.as_ref()?, of.truth.as_ref()?];
            Some(condyles.as_ref()?.forces_n(truths, of.contact.as_ref()?)?[place].norm())
        })
        .truth_if(true);
    }
    let measures: [(&str, Unit, &str, Measure); 3] = [
        ("contact_area", Unit::MM2, "Area over which antagonist or food press on", |on| on.area_m2),
        ("pressure", Unit::MPA, "Mean pressure of antagonist or food on", |on| on.mean_pa),
        ("pressure_peak", Unit::MPA, "Highest pressure of antagonist or food on", |on| on.peak_pa),
    ];
    for tooth in PressedTooth::all(scenario) {
        for (name, unit, about, measure) in measures {
            let number = tooth.number;
            list.add(format!("{name}.{number}"), unit, format!("{about} tooth {number}."), move |of| {
                let contact = of.contact.as_ref()?.teeth().find(|contact| contact.number == number)?;
                Some(measure(&tooth.pressure(&contact, &true_pose(of.truth.as_ref()?)?)))
            })
            .truth_if(true);
        }
    }
}

/// Where nothing is emulated, the encoders alone show what moves.
fn add_axes(list: &mut SignalList, has_truth: bool) {
    for (axis, name) in AXIS_NAMES.into_iter().enumerate() {
        let at = move |values: [f64; AXES]| values[axis];
        // Before the first process data of a drive, and after its loss, a reading has no values of the drive.
        let reading = move |of: &CycleMessages| {
            of.reading.filter(|reading| reading.drive_state[axis] != NO_DRIVE_STATE)
        };
        // Without a request to the drives a command has no targets.
        let command =
            |of: &CycleMessages| of.command.filter(|command| command.request != DriveRequest::Off.code());
        list.add(format!("{name}.position"), Unit::MM, "Position that the encoder reports.", move |of| {
            Some(at(reading(of)?.position_m))
        })
        .truth_if(!has_truth);
        list.add(format!("{name}.true_position"), Unit::MM, "True position of the axis.", move |of| {
            Some(at(of.truth?.joint_m))
        })
        .truth_if(true);
        list.add(format!("{name}.velocity"), Unit::MM_S, "True velocity of the axis.", move |of| {
            Some(at(of.truth?.joint_m_s))
        })
        .truth_if(true);
        list.add(
            format!("{name}.force"),
            Unit::N,
            "Force that the drive reports; of an emulated one the mean over the cycle.",
            move |of| Some(at(reading(of)?.force_n)),
        );
        list.add(format!("{name}.target"), Unit::MM, "Target of the cycle's command.", move |of| {
            Some(at(command(of)?.target_m))
        });
        let states = || DriveState::ALL.iter().map(|state| (state.name(), state.code())).collect();
        list.add_state(format!("{name}.drive"), "State of the drive.", states, move |of| {
            Some(reading(of)?.drive_state[axis])
        });
    }
}

/// The ledger of energy of the emulated mechanism: work since the start, and where it is.
fn add_energy(list: &mut SignalList) {
    let works: [(&str, &str); WORKS] = [
        ("motors", "Work of the drives"),
        ("friction.slides", "Work of the friction of the slides"),
        ("friction.legs", "Work of the friction of the legs"),
        ("friction.joints", "Work of the friction of hinges and balls"),
        ("contact", "Work of teeth and food"),
        ("others", "Work of pushes, payload, end stops and seized guides"),
    ];
    for (kind, (name, about)) in works.into_iter().enumerate() {
        let about = format!("{about} on the mechanism since the start.");
        list.add(format!("energy.{name}"), Unit::J, about, move |of| Some(of.truth?.work_j[kind]))
            .truth_if(true);
    }
    let stored: [(&str, &str, Stored); 3] = [
        ("kinetic", "Energy of the mechanism's motion.", |truth| truth.kinetic_j),
        ("potential", "Energy of the mechanism's height above that of the start.", |truth| truth.potential_j),
        (
            "gap",
            "Energy without work: kinetic and potential energy less all work. 0 but for the step of the simulation.",
            |truth| truth.kinetic_j + truth.potential_j - truth.work_j.iter().sum::<f64>(),
        ),
    ];
    for (name, about, value) in stored {
        list.add(format!("energy.{name}"), Unit::J, about, move |of| Some(value(&of.truth?))).truth_if(true);
    }
}

fn add_controller(list: &mut SignalList) {
    let states = || ControllerState::ALL.iter().map(|state| (state.name(), state.code())).collect();
    list.add_state("controller.state", "State of the controller.", states, |of| of.controller_state);
    list.add("motion.time", Unit::S, "How far the motion has come, as the controller states it.", |of| {
        Some(of.state?.motion_time_s)
    });
    list.add(
        "motion.lag",
        Unit::MS,
        "By how much the motion is late, since commands or readings were lost.",
        |of| of.lag_s,
    );
    list.add("fk.residual", Unit::UM, "Largest difference of a platform side from its length.", |of| {
        Some(of.solution?.residual_m)
    });
    list.add(
        "fk.condition",
        Unit::ONE,
        "Condition number of the Jacobian, computed every ten cycles and held in between.",
        |of| Some(of.solution?.condition),
    );
    list.add("fk.iterations", Unit::ONE, "Iterations of the forward kinematics.", |of| {
        Some(f64::from(of.solution?.iterations))
    });
    list.add("master.fault", Unit::ONE, "1 once the master refuses to move anything.", |of| {
        Some(f64::from(of.reading?.master_fault))
    });
}

fn add_timing(list: &mut SignalList) {
    for (place, role) in ["controller", "plant"].into_iter().enumerate() {
        let about = format!(
            "Share of its core that the {role}'s loop took since its message before, by work and by spinning."
        );
        let cpu = list.add(format!("{role}.cpu"), Unit::PERCENT, about, move |of| of.cpu[place]);
        cpu.absence = "; simulated time takes no share of a core: use --clock rt";
    }
    let seconds =
        |from_ns: u64, to_ns: u64| (from_ns > 0 && to_ns > 0).then(|| (to_ns as f64 - from_ns as f64) / 1e9);
    list.add("plant.wake_up", Unit::US, "Wake-up of the plant after its deadline.", move |of| {
        of.reading.and_then(|reading| seconds(reading.due_ns, reading.woke_ns))
    });
    list.add("controller.wake_up", Unit::US, "Wake-up of the controller after its deadline.", move |of| {
        of.state.and_then(|state| seconds(state.due_ns, state.woke_ns))
    });
    list.add("controller.work", Unit::US, "Time from the reading to the ready command.", move |of| {
        of.solution.and_then(|state| seconds(state.received_ns, state.commanded_ns))
    });
    list.add("fk.time", Unit::US, "Time that the forward kinematics takes.", move |of| {
        of.solution.and_then(|state| seconds(state.received_ns, state.solved_ns))
    });
    list.add("process_data.time", Unit::US, "Time from SYNC to the last process data.", move |of| {
        of.reading.and_then(|reading| seconds(reading.sampled_ns, reading.complete_ns))
    });
    list.add("plant.skipped", Unit::ONE, "Deadlines that the plant has skipped since the start.", |of| {
        Some(of.reading?.skipped_cycles as f64)
    });
    list.add(
        "controller.skipped",
        Unit::ONE,
        "Deadlines that the controller has skipped since the start.",
        |of| Some(of.state?.skipped_cycles as f64),
    );
}

fn add_declared(list: &mut SignalList, declared: &Declared) {
    for (place, signal) in declared.signals.iter().enumerate() {
        let value = move |of: &CycleMessages| of.signals.as_ref()?.signals.as_slice().get(place).copied();
        list.add_declared(format!("signal.{}", signal.name), &signal.unit, &signal.about, value);
    }
    for (place, parameter) in declared.parameters.iter().enumerate() {
        let value =
            move |of: &CycleMessages| of.parameters.as_ref()?.parameters.as_slice().get(place).copied();
        list.add_declared(format!("parameter.{}", parameter.name), &parameter.unit, &parameter.about, value);
    }
}

/// What the file of the played motion holds beside the motion; nothing where it is gone since the run.
fn add_recorded(list: &mut SignalList, scenario: &Scenario, declared: &Declared) {
    let MotionConfig::File(file) = &scenario.motion else { return };
    if declared.motion != PlayedMotion::Scenario {
        return;
    }
    for signal in recorded_signals(file, &scenario.jaw).unwrap_or_default() {
        let (name, unit) = (signal.name.clone(), signal.unit.clone());
        let about =
            format!("Column '{}' of the motion's file at motion.time; none where it is lost.", signal.column);
        list.add_declared(name, &unit, &about, move |of| signal.at(of.state?.motion_time_s));
    }
}

/// The force on each tooth, N.
fn loads_n(of: &CycleMessages) -> Option<impl Iterator<Item = (u32, f64)>> {
    Some(of.contact.as_ref()?.teeth().map(|tooth| (tooth.number, tooth.load_n())))
}
