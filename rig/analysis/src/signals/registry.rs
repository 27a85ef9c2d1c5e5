//! Every signal that a run has: its name, its unit, its meaning, and how its value follows from the messages of a cycle.
//!
//! Values are SI numbers; states are their codes. A value that a cycle does not have is none, never a guess.

use std::fmt;
use std::sync::Arc;

use masseter_shared::config::{Dimension, Scenario, Unit};
use masseter_shared::geometry::{AXES, AXIS_NAMES, Pose};
use masseter_shared::messages::codes::{ControllerState, DriveRequest, DriveState, NO_DRIVE_STATE};
use masseter_shared::named::Declared;
use masseter_shared::wording::nearest;
use serde::Serialize;

use super::cycle::CycleMessages;
use super::derived::{Jaw, JawPoint, desired, estimated, solution};

/// How a signal's value follows from a cycle; none where the cycle does not have it.
type Extract = Box<dyn Fn(&CycleMessages, &Start) -> Option<f64> + Send + Sync>;

/// What some signals count from: the pose of the jaw in the first cycle of the motion.
#[derive(Debug, Clone, Copy, Default)]
struct Start {
    pose: Option<Pose>,
}

/// The names of the values of a state.
pub(crate) type StateNames = fn() -> Vec<(&'static str, u32)>;

/// A signal.
#[derive(Serialize)]
pub struct NamedSignal {
    /// Its name, such as `incisal.error`.
    pub name: String,
    /// The name of the unit in which it is shown.
    pub unit: String,
    /// What it is.
    pub about: String,
    #[serde(skip)]
    shown: Unit,
    #[serde(skip)]
    states: Option<StateNames>,
    /// Why it may have no value in a whole run.
    #[serde(skip)]
    absence: &'static str,
    #[serde(skip)]
    extract: Extract,
}

impl fmt::Debug for NamedSignal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} [{}]", self.name, self.unit)
    }
}

impl NamedSignal {
    /// The unit in which it is shown.
    pub fn shown(&self) -> Unit {
        self.shown
    }

    /// Why it may have no value in a whole run; empty where nothing is known.
    pub(crate) fn absence(&self) -> &'static str {
        self.absence
    }

    /// The names of its values, where it is a state.
    pub fn states(&self) -> Option<Vec<(&'static str, u32)>> {
        self.states.map(|names| names())
    }
}

/// The signals of a run.
///
/// ```
/// use masseter_analysis::signals::Registry;
/// use masseter_shared::config::Scenario;
/// use masseter_shared::named::Declared;
///
/// let registry = Registry::new(&Scenario::default(), &Declared::default());
/// let place = registry.place_of("incisal.error")?;
/// assert_eq!(registry.signals()[place].unit, "mm");
/// assert!(registry.place_of("incisal.eror").unwrap_err().ends_with("did you mean 'incisal.error'?"));
/// # Ok::<(), String>(())
/// ```
#[derive(Debug)]
pub struct Registry {
    signals: Vec<NamedSignal>,
    jaw: Jaw,
}

impl Registry {
    /// The signals of a run of this scenario whose controller declares these.
    pub fn new(scenario: &Scenario, declared: &Declared) -> Self {
        let jaw = Jaw::new(&scenario.jaw, scenario.can.is_virtual());
        let mut registry = Self { signals: Vec::new(), jaw };
        registry.add_jaw(jaw);
        registry.add_contact(scenario);
        if scenario.load_cell.is_some() {
            registry.add("load_cell.force", "N", "Bite force that the load cell shows.", |messages| {
                Some(messages.reading?.load_cell_n)
            });
        }
        registry.add_axes();
        registry.add_controller();
        registry.add_timing();
        registry.add_declared(declared);
        registry
    }

    /// Every signal.
    pub fn signals(&self) -> &[NamedSignal] {
        &self.signals
    }

    /// The place of the signal of that name.
    ///
    /// # Errors
    /// A sentence with the most similar name.
    pub fn place_of(&self, name: &str) -> Result<usize, String> {
        self.signals.iter().position(|signal| signal.name == name).ok_or_else(|| {
            let question = nearest(name, self.signals.iter().map(|signal| signal.name.as_str()))
                .map_or_else(String::new, |likely| format!("; did you mean '{likely}'?"));
            format!("there is no signal '{name}'; masseter signals lists them{question}")
        })
    }

    fn add(
        &mut self,
        name: impl Into<String>,
        unit: &str,
        about: impl Into<String>,
        extract: impl Fn(&CycleMessages) -> Option<f64> + Send + Sync + 'static,
    ) {
        self.add_from(name, unit, about, move |messages, _| extract(messages));
    }

    fn add_from(
        &mut self,
        name: impl Into<String>,
        unit: &str,
        about: impl Into<String>,
        extract: impl Fn(&CycleMessages, &Start) -> Option<f64> + Send + Sync + 'static,
    ) {
        let shown = Unit::named(unit).unwrap_or_else(|| Dimension::One.si_unit());
        self.signals.push(NamedSignal {
            name: name.into(),
            unit: unit.to_owned(),
            about: about.into(),
            shown,
            states: None,
            absence: "",
            extract: Box::new(extract),
        });
    }

    fn add_state(
        &mut self,
        name: impl Into<String>,
        about: &str,
        states: StateNames,
        extract: impl Fn(&CycleMessages) -> Option<u32> + Send + Sync + 'static,
    ) {
        self.add(name, "", about, move |messages| extract(messages).map(f64::from));
        if let Some(signal) = self.signals.last_mut() {
            signal.states = Some(states);
        }
    }

    fn add_jaw(&mut self, jaw: Jaw) {
        let points = [
            ("incisal", JawPoint::Incisal),
            ("condyle.left", JawPoint::LeftCondyle),
            ("condyle.right", JawPoint::RightCondyle),
        ];
        for (name, point) in points {
            for (at, axis) in ["x", "y", "z"].into_iter().enumerate() {
                self.add(
                    format!("{name}.{axis}"),
                    "mm",
                    format!("Place of the point along {axis} of the base: the true one, on the robot the estimated one."),
                    move |messages| Some(jaw.place(point, &jaw.actual(messages)?)[at]),
                );
            }
            self.add(
                format!("{name}.error"),
                "mm",
                "Distance of the point from its desired place.",
                move |messages| Some(jaw.distance(point, &jaw.actual(messages)?, &desired(messages)?)),
            );
        }
        for (at, axis) in ["x", "y", "z"].into_iter().enumerate() {
            self.add(
                format!("incisal.desired.{axis}"),
                "mm",
                format!("Desired place of the incisal point along {axis} of the base."),
                move |messages| Some(jaw.place(JawPoint::Incisal, &desired(messages)?)[at]),
            );
        }
        self.add(
            "incisal.estimated_error",
            "mm",
            "Distance of the incisal point from its desired place, by forward kinematics.",
            move |messages| Some(jaw.distance(JawPoint::Incisal, &estimated(messages)?, &desired(messages)?)),
        );
        self.add_from(
            "jaw.opening",
            "mm",
            "Distance of the incisal point from its place when the motion began.",
            move |messages, start| {
                Some(jaw.distance(JawPoint::Incisal, &jaw.actual(messages)?, &start.pose?))
            },
        );
        self.add_from(
            "jaw.rotation",
            "deg",
            "Angle of the jaw from its orientation when the motion began.",
            move |messages, start| Some(jaw.actual(messages)?.rotation.angle_to(&start.pose?.rotation)),
        );
        self.add(
            "platform.error",
            "mm",
            "Distance of the platform's origin from its desired place.",
            move |messages| {
                Some(
                    (jaw.actual(messages)?.translation.vector - desired(messages)?.translation.vector).norm(),
                )
            },
        );
        self.add(
            "platform.angle_error",
            "deg",
            "Angle of the platform from its desired orientation.",
            move |messages| Some(jaw.actual(messages)?.rotation.angle_to(&desired(messages)?.rotation)),
        );
        self.add(
            "bite.force",
            "N",
            "Vertical force of food and upper teeth on the emulated jaw, mean over the cycle.",
            |messages| Some(messages.truth?.bite_force_n),
        );
    }

    /// None where the jaws cannot touch.
    fn add_contact(&mut self, scenario: &Scenario) {
        if !scenario.has_contact() {
            return;
        }
        for tooth in scenario.arch().into_iter().map(|tooth| u32::from(tooth.number)) {
            self.add(
                format!("contact.{tooth}"),
                "N",
                format!("Force of antagonist and food on tooth {tooth}, mean over a cycle."),
                move |messages| {
                    loads_n(messages)?.find(|(number, _)| *number == tooth).map(|(_, load_n)| load_n)
                },
            );
        }
        self.add("contact.total", "N", "Sum of the forces on all teeth.", |messages| {
            Some(loads_n(messages)?.map(|(_, load_n)| load_n).sum())
        });
    }

    fn add_axes(&mut self) {
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
            self.add(
                format!("{name}.position"),
                "mm",
                "Position that the encoder reports.",
                move |messages| Some(at(reading(messages)?.position_m)),
            );
            self.add(format!("{name}.true_position"), "mm", "True position of the axis.", move |messages| {
                Some(at(messages.truth?.joint_m))
            });
            self.add(format!("{name}.velocity"), "mm/s", "True velocity of the axis.", move |messages| {
                Some(at(messages.truth?.joint_m_s))
            });
            self.add(
                format!("{name}.force"),
                "N",
                "Force that the drive reports; of an emulated one the mean over the cycle.",
                move |messages| Some(at(reading(messages)?.force_n)),
            );
            self.add(format!("{name}.target"), "mm", "Target of the cycle's command.", move |messages| {
                Some(at(command(messages)?.target_m))
            });
            self.add_state(format!("{name}.drive"), "State of the drive.", drive_states, move |messages| {
                Some(reading(messages)?.drive_state[axis])
            });
        }
    }

    fn add_controller(&mut self) {
        self.add_state("controller.state", "State of the controller.", controller_states, |messages| {
            Some(messages.state?.controller_state)
        });
        self.add("motion.time", "s", "How far the motion has come.", |messages| {
            Some(messages.state?.motion_time_s)
        });
        self.add("fk.residual", "um", "Largest difference of a platform side from its length.", |messages| {
            Some(solution(messages)?.residual_m)
        });
        self.add("fk.condition", "", "Condition number of the Jacobian.", |messages| {
            Some(solution(messages)?.condition)
        });
        self.add("fk.iterations", "", "Iterations of the forward kinematics.", |messages| {
            Some(f64::from(solution(messages)?.iterations))
        });
        self.add("master.fault", "", "1 once the master refuses to move anything.", |messages| {
            Some(f64::from(messages.reading?.master_fault))
        });
    }

    fn add_timing(&mut self) {
        for (place, role) in ["controller", "plant"].into_iter().enumerate() {
            self.add(
                format!("{role}.cpu"),
                "%",
                format!("Share of its core that the {role}'s loop took since its message before, by work and by spinning."),
                move |messages| messages.cpu[place],
            );
            if let Some(signal) = self.signals.last_mut() {
                signal.absence = "; simulated time takes no share of a core: use --clock rt";
            }
        }
        let seconds = |from_ns: u64, to_ns: u64| {
            (from_ns > 0 && to_ns > 0).then(|| (to_ns as f64 - from_ns as f64) / 1e9)
        };
        self.add("plant.wake_up", "us", "Wake-up of the plant after its deadline.", move |messages| {
            messages.reading.and_then(|reading| seconds(reading.due_ns, reading.woke_ns))
        });
        self.add(
            "controller.wake_up",
            "us",
            "Wake-up of the controller after its deadline.",
            move |messages| messages.state.and_then(|state| seconds(state.due_ns, state.woke_ns)),
        );
        self.add("controller.work", "us", "Time from the reading to the ready command.", move |messages| {
            solution(messages).and_then(|state| seconds(state.received_ns, state.commanded_ns))
        });
        self.add("fk.time", "us", "Time that the forward kinematics takes.", move |messages| {
            solution(messages).and_then(|state| seconds(state.received_ns, state.solved_ns))
        });
        self.add("process_data.time", "us", "Time from SYNC to the last process data.", move |messages| {
            messages.reading.and_then(|reading| seconds(reading.sampled_ns, reading.complete_ns))
        });
        self.add("plant.skipped", "", "Deadlines that the plant has skipped since the start.", |messages| {
            Some(messages.reading?.skipped_cycles as f64)
        });
        self.add(
            "controller.skipped",
            "",
            "Deadlines that the controller has skipped since the start.",
            |messages| Some(messages.state?.skipped_cycles as f64),
        );
    }

    fn add_declared(&mut self, declared: &Declared) {
        for (place, signal) in declared.signals.iter().enumerate() {
            let si = Unit::named(&signal.unit).map_or(1.0, |unit| unit.si);
            self.add(format!("signal.{}", signal.name), &signal.unit, &signal.about, move |messages| {
                Some(messages.signals.as_ref()?.signals.as_slice().get(place)? * si)
            });
        }
        for (place, parameter) in declared.parameters.iter().enumerate() {
            let si = Unit::named(&parameter.unit).map_or(1.0, |unit| unit.si);
            self.add(
                format!("parameter.{}", parameter.name),
                &parameter.unit,
                &parameter.about,
                move |messages| Some(messages.parameters.as_ref()?.parameters.as_slice().get(place)? * si),
            );
        }
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

/// The values of chosen signals, cycle by cycle.
#[derive(Debug, Clone)]
pub struct Values {
    registry: Arc<Registry>,
    /// The places of the chosen signals.
    chosen: Vec<usize>,
    start: Start,
}

impl Values {
    /// None chosen yet.
    pub fn new(registry: Registry) -> Self {
        Self { registry: Arc::new(registry), chosen: Vec::new(), start: Start::default() }
    }

    /// Every signal, at its place in the registry.
    pub fn of_all(registry: Registry) -> Self {
        let chosen = (0..registry.signals.len()).collect();
        Self { chosen, ..Self::new(registry) }
    }

    /// Chooses the signal of that name; returns its place among the chosen ones.
    ///
    /// # Errors
    /// As [`Registry::place_of`].
    pub fn choose(&mut self, name: &str) -> Result<usize, String> {
        let place = self.registry.place_of(name)?;
        Ok(self.chosen.iter().position(|chosen| *chosen == place).unwrap_or_else(|| {
            self.chosen.push(place);
            self.chosen.len() - 1
        }))
    }

    /// The chosen signal at that place.
    pub fn signal(&self, chosen: usize) -> &NamedSignal {
        &self.registry.signals[self.chosen[chosen]]
    }

    /// The values of the chosen signals in a cycle; NaN where the cycle does not have one.
    pub fn take(&mut self, messages: &CycleMessages, values: &mut Vec<f64>) {
        let running = ControllerState::Running.code();
        if self.start.pose.is_none() && messages.state.is_some_and(|state| state.controller_state == running)
        {
            self.start.pose = self.registry.jaw.actual(messages);
        }
        values.clear();
        values.extend(
            self.chosen.iter().map(|place| {
                (self.registry.signals[*place].extract)(messages, &self.start).unwrap_or(f64::NAN)
            }),
        );
    }
}
