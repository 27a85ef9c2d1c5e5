//! A pose law that is a function of Python.

use std::{sync::mpsc, thread, time::Duration};

use masseter_controller::pose_law::{
    Demand as RigDemand, ExternalForce as RigExternalForce, FunctionLaw, LawFailed, asked_pose,
};
use masseter_model::geometry::{self, AXES};
use masseter_runtime::named::{Declared, Parameter, PlayedMotion, Signal};
use masseter_runtime::{control::Outcome, lifecycle::attach::attach, messages::pose_fields};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMappingProxy};

use crate::{failed, not_attached};

/// Time between two looks at Ctrl-C.
const POLL: Duration = Duration::from_millis(20);

/// A pose: position in the base frame, m, and unit quaternion.
#[pyclass(frozen, eq, from_py_object, module = "masseter")]
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pose {
    #[pyo3(get)]
    position_m: Vector,
    #[pyo3(get)]
    quaternion_wxyz: Quaternion,
}

type Vector = (f64, f64, f64);
type Quaternion = (f64, f64, f64, f64);

#[pymethods]
impl Pose {
    #[new]
    fn new(position_m: [f64; 3], quaternion_wxyz: [f64; 4]) -> Self {
        let ([px, py, pz], [w, x, y, z]) = (position_m, quaternion_wxyz);
        Self { position_m: (px, py, pz), quaternion_wxyz: (w, x, y, z) }
    }

    /// What pickle calls the constructor with.
    fn __getnewargs__(&self) -> (Vector, Quaternion) {
        (self.position_m, self.quaternion_wxyz)
    }

    fn __repr__(&self) -> String {
        format!("Pose(position_m={:?}, quaternion_wxyz={:?})", self.position_m, self.quaternion_wxyz)
    }
}

impl Pose {
    /// Position and quaternion.
    pub(crate) fn fields(self) -> ([f64; 3], [f64; 4]) {
        let ((px, py, pz), (w, x, y, z)) = (self.position_m, self.quaternion_wxyz);
        ([px, py, pz], [w, x, y, z])
    }
}

impl From<&geometry::Pose> for Pose {
    fn from(pose: &geometry::Pose) -> Self {
        let (position_m, quaternion_wxyz) = pose_fields(pose);
        Self::new(position_m, quaternion_wxyz)
    }
}

/// The estimated external force on the platform.
#[pyclass(frozen, get_all)]
#[derive(Debug, Clone, Copy)]
pub(crate) struct ExternalForce {
    force_n: [f64; 3],
    moment_nm: [f64; 3],
    uncertainty_n: f64,
}

impl From<RigExternalForce> for ExternalForce {
    fn from(RigExternalForce { force_n, moment_nm, uncertainty_n }: RigExternalForce) -> Self {
        Self { force_n, moment_nm, uncertainty_n }
    }
}

/// What a pose law needs of a cycle.
#[pyclass(frozen, get_all)]
#[derive(Debug)]
pub(crate) struct Demand {
    cycle: u64,
    period_s: f64,
    motion_time_s: f64,
    controller_state: u32,
    desired: Pose,
    estimated: Option<Pose>,
    ahead: Pose,
    desired_twist: [f64; AXES],
    position_m: Option<[f64; AXES]>,
    force_n: Option<[f64; AXES]>,
    load_cell_n: Option<f64>,
    external: Option<ExternalForce>,
    parameters: Py<PyMappingProxy>,
    signals: Py<PyDict>,
}

impl Demand {
    pub(crate) fn new(
        py: Python<'_>,
        demand: &RigDemand,
        parameters: Bound<'_, PyDict>,
        signals: Py<PyDict>,
    ) -> Self {
        Self {
            cycle: demand.cycle,
            period_s: demand.period_s,
            motion_time_s: demand.motion_time_s,
            controller_state: demand.state.code(),
            desired: (&demand.desired).into(),
            estimated: demand.estimated.as_ref().map(Pose::from),
            ahead: (&demand.ahead).into(),
            desired_twist: demand.desired_twist.unwrap_or_default().into(),
            position_m: demand.measured.map(|measured| measured.position_m),
            force_n: demand.measured.map(|measured| measured.force_n),
            load_cell_n: demand.load_cell_n,
            external: demand.external.map(ExternalForce::from),
            parameters: PyMappingProxy::new(py, parameters.as_mapping()).unbind(),
            signals,
        }
    }
}

/// A function of Python, and what it gets and fills.
struct PythonLaw {
    function: Py<PyAny>,
    declared: Declared,
    signals: Py<PyDict>,
}

impl PythonLaw {
    /// The pose that the law returns; takes over the signals that the law fills.
    fn ask(&self, demand: &RigDemand, parameters: &[f64], filled: &mut [f64]) -> PyResult<geometry::Pose> {
        Python::attach(|py| {
            let values = PyDict::new(py);
            for (parameter, value) in self.declared.parameters.iter().zip(parameters) {
                values.set_item(&parameter.name, value)?;
            }
            let demand = Demand::new(py, demand, values, self.signals.clone_ref(py));
            let pose = self.function.call1(py, (demand,))?;
            let pose: Pose = pose.extract(py).map_err(|_| failed("the law returned no masseter.Pose"))?;
            let signals = self.signals.bind(py);
            for (filled, signal) in filled.iter_mut().zip(&self.declared.signals) {
                *filled = signals.as_any().get_item(&signal.name)?.extract()?;
            }
            if signals.len() > filled.len() {
                return Err(failed(format!(
                    "the law fills signals that are not declared: {}",
                    signals.keys()
                )));
            }
            let (position_m, quaternion_wxyz) = pose.fields();
            Ok(asked_pose(position_m, quaternion_wxyz))
        })
    }
}

/// Name, unit and meaning.
pub(crate) type SignalOfPython = (String, String, String);
/// The same, then the value and its range.
pub(crate) type ParameterOfPython = (String, String, String, f64, [f64; 2]);

/// Refuses what a recording could not contain.
#[pyfunction]
pub(crate) fn check_declaration(
    signals: Vec<SignalOfPython>,
    parameters: Vec<ParameterOfPython>,
) -> PyResult<()> {
    declared(signals, parameters, false).map(drop)
}

/// What a program of Python declares.
pub(crate) fn declared(
    signals: Vec<SignalOfPython>,
    parameters: Vec<ParameterOfPython>,
    has_own_motion: bool,
) -> PyResult<Declared> {
    let signal = |(name, unit, about)| Signal { name, unit, about };
    let parameter = |(name, unit, about, value, range)| Parameter { name, unit, about, value, range };
    let declared = Declared {
        signals: signals.into_iter().map(signal).collect(),
        parameters: parameters.into_iter().map(parameter).collect(),
        motion: if has_own_motion { PlayedMotion::Own } else { PlayedMotion::Scenario },
    };
    declared.check().map_err(failed)?;
    Ok(declared)
}

/// Attaches to a rig and runs its controller with this law. Returns whether the motion was finished; false after a safe stop.
/// Before the start, calls `prepare` with the period and the values that the scenario gives parameters.
#[pyfunction]
pub(crate) fn control(
    py: Python<'_>,
    law: Py<PyAny>,
    rig: Option<String>,
    signals: Vec<SignalOfPython>,
    parameters: Vec<ParameterOfPython>,
    prepare: Option<Py<PyAny>>,
    has_own_motion: bool,
) -> PyResult<bool> {
    let (exception, exceptions) = mpsc::channel();
    let declared = declared(signals, parameters, has_own_motion)?;
    let signals = PyDict::new(py);
    for signal in &declared.signals {
        signals.set_item(&signal.name, 0.0)?;
    }
    let python = PythonLaw { function: law, declared: declared.clone(), signals: signals.into() };
    let law = FunctionLaw::new(declared, move |demand, parameters, signals| {
        python.ask(demand, parameters, signals).map_err(|error| {
            // Nobody waits for it once the caller was interrupted.
            let _ = exception.send(error);
            LawFailed
        })
    });
    let context = py.detach(|| attach(rig.as_deref())).map_err(not_attached)?;
    if let Some(prepare) = prepare {
        prepare.call1(py, (context.scenario.period_s(), context.scenario.parameters.clone()))?;
    }
    let is_simulated = context.lockstep.is_some();
    let play = move || masseter_controller::process::run_with_law(context, Box::new(law)).map_err(failed);
    // Debuggers follow the caller's thread. In real time the law has a thread of its own, with which priority and core end.
    let ran = if is_simulated { py.detach(play) } else { in_own_thread(py, play)? };
    if let Ok(exception) = exceptions.try_recv() {
        return Err(exception);
    }
    ran.map(|outcome| outcome == Outcome::Finished)
}

/// Calls `play` in a thread of its own; Ctrl-C ends the wait.
fn in_own_thread<T: Send + 'static>(
    py: Python<'_>,
    play: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    let running = thread::spawn(play);
    while !running.is_finished() {
        py.detach(|| thread::sleep(POLL));
        py.check_signals()?;
    }
    py.detach(|| running.join()).map_err(|_| failed("a fault of Masseter itself"))
}
