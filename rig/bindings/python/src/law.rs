//! A pose law that is a function of Python.

use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use masseter_controller::pose_law::{Demand as RigDemand, LawFailed, PoseLaw};
use masseter_controller::process::run_with_law;
use masseter_model::geometry;
use masseter_runtime::control::Outcome;
use masseter_runtime::lifecycle::attach::attach;
use masseter_runtime::messages::pose_fields;
use masseter_runtime::named::{Declared, Parameter, Signal};
use nalgebra::{Quaternion, Translation3, Unit};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::{failed, not_attached};

/// Time between two looks at Ctrl-C.
const POLL: Duration = Duration::from_millis(20);

/// A pose: position in the base frame, m, and unit quaternion.
#[pyclass(frozen, from_py_object)]
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pose {
    #[pyo3(get)]
    position_m: (f64, f64, f64),
    #[pyo3(get)]
    quaternion_wxyz: (f64, f64, f64, f64),
}

#[pymethods]
impl Pose {
    #[new]
    fn new(position_m: [f64; 3], quaternion_wxyz: [f64; 4]) -> Self {
        let ([px, py, pz], [w, x, y, z]) = (position_m, quaternion_wxyz);
        Self { position_m: (px, py, pz), quaternion_wxyz: (w, x, y, z) }
    }

    fn __repr__(&self) -> String {
        format!("Pose(position_m={:?}, quaternion_wxyz={:?})", self.position_m, self.quaternion_wxyz)
    }
}

impl From<&geometry::Pose> for Pose {
    fn from(pose: &geometry::Pose) -> Self {
        let (position_m, quaternion_wxyz) = pose_fields(pose);
        Self::new(position_m, quaternion_wxyz)
    }
}

impl From<Pose> for geometry::Pose {
    /// As it is: the controller refuses what is no pose.
    fn from(Pose { position_m: (px, py, pz), quaternion_wxyz: (w, x, y, z) }: Pose) -> Self {
        let rotation = Unit::new_unchecked(Quaternion::new(w, x, y, z));
        geometry::Pose::from_parts(Translation3::new(px, py, pz), rotation)
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
    parameters: Py<PyDict>,
    signals: Py<PyDict>,
}

#[derive(Debug)]
struct PythonLaw {
    function: Py<PyAny>,
    declared: Declared,
    parameters: Py<PyDict>,
    /// What the law fills.
    signals: Py<PyDict>,
    filled: Vec<f64>,
    /// Where the exception goes that ends the motion.
    exception: mpsc::Sender<PyErr>,
}

impl PoseLaw for PythonLaw {
    fn command(&mut self, demand: &RigDemand) -> Result<geometry::Pose, LawFailed> {
        Python::attach(|py| {
            let demand = Demand {
                cycle: demand.cycle,
                period_s: demand.period_s,
                motion_time_s: demand.motion_time_s,
                controller_state: demand.state.code(),
                desired: (&demand.desired).into(),
                estimated: demand.estimated.as_ref().map(Pose::from),
                ahead: (&demand.ahead).into(),
                parameters: self.parameters.clone_ref(py),
                signals: self.signals.clone_ref(py),
            };
            self.asked_pose(py, demand).map_err(|error| {
                // Nobody waits for it once the caller was interrupted.
                let _ = self.exception.send(error);
                LawFailed
            })
        })
    }

    fn declared(&self) -> Declared {
        self.declared.clone()
    }

    fn set_parameter(&mut self, place: usize, value: f64) {
        let name = &self.declared.parameters[place].name;
        Python::attach(|py| self.parameters.bind(py).set_item(name, value))
            .expect("a dictionary takes a text");
    }

    fn fill_signals(&self, signals: &mut [f64]) {
        signals.copy_from_slice(&self.filled);
    }
}

impl PythonLaw {
    /// The pose that the law returns; keeps the signals that the law fills.
    fn asked_pose(&mut self, py: Python<'_>, demand: Demand) -> PyResult<geometry::Pose> {
        let pose = self.function.call1(py, (demand,))?;
        let pose: Pose = pose.extract(py).map_err(|_| failed("the law returned no masseter.Pose"))?;
        let signals = self.signals.bind(py);
        for (filled, signal) in self.filled.iter_mut().zip(&self.declared.signals) {
            *filled = signals.as_any().get_item(&signal.name)?.extract()?;
        }
        if signals.len() > self.filled.len() {
            return Err(failed(format!("the law fills signals that are not declared: {}", signals.keys())));
        }
        Ok(pose.into())
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
    declared(signals, parameters).map(drop)
}

/// What a program of Python declares.
pub(crate) fn declared(
    signals: Vec<SignalOfPython>,
    parameters: Vec<ParameterOfPython>,
) -> PyResult<Declared> {
    let signal = |(name, unit, about)| Signal { name, unit, about };
    let parameter = |(name, unit, about, value, range)| Parameter { name, unit, about, value, range };
    let declared = Declared {
        signals: signals.into_iter().map(signal).collect(),
        parameters: parameters.into_iter().map(parameter).collect(),
        ..Declared::default()
    };
    declared.check().map_err(failed)?;
    Ok(declared)
}

/// Attaches to a rig and runs its controller with this law. Returns whether the motion was finished; false after a safe stop.
#[pyfunction]
pub(crate) fn control(
    py: Python<'_>,
    law: Py<PyAny>,
    rig: Option<String>,
    signals: Vec<SignalOfPython>,
    parameters: Vec<ParameterOfPython>,
) -> PyResult<bool> {
    let (exception, exceptions) = mpsc::channel();
    let declared = declared(signals, parameters)?;
    let signals = PyDict::new(py);
    for signal in &declared.signals {
        signals.set_item(&signal.name, 0.0)?;
    }
    let filled = vec![0.0; declared.signals.len()];
    let (parameters, signals) = (PyDict::new(py).into(), signals.into());
    let law = PythonLaw { function: law, declared, parameters, signals, filled, exception };
    // A thread of its own: real-time priority and core end with it.
    let running = thread::spawn(move || {
        let context = attach(rig.as_deref()).map_err(not_attached)?;
        run_with_law(context, Box::new(law)).map_err(failed)
    });
    while !running.is_finished() {
        py.detach(|| thread::sleep(POLL));
        py.check_signals()?;
    }
    let ran = py.detach(|| running.join()).map_err(|_| failed("a fault of Masseter itself"))?;
    if let Ok(exception) = exceptions.try_recv() {
        return Err(exception);
    }
    ran.map(|outcome| outcome == Outcome::Finished)
}
