//! The native part of the Python package `masseter`; the package itself has the documentation.
//!
//! Arrays cross the border as bytes of 64-bit floats, so that this crate needs no array library.
#![allow(clippy::needless_pass_by_value, reason = "Python passes values")]

mod agent;
mod env;
mod episode;
mod law;
mod robot;
mod session;
mod vector;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use bytemuck::{AnyBitPattern, NoUninit, cast_slice, pod_read_unaligned};
use masseter_model::geometry::{self, AXES, Actuators, MechanismConfig};
use masseter_recording::{ReadError, Reader, RunFolder, Topic};
use masseter_runtime::lifecycle::attach::AttachError;
use masseter_runtime::messages::{pose_fields, pose_from_fields};
use pyo3::prelude::*;
use pyo3::{create_exception, exceptions::PyException, types::PyBytes};

create_exception!(masseter, MasseterError, PyException, "The message of the rig, with what to do.");
create_exception!(masseter, NoRigError, MasseterError, "No rig of that name takes a controller.");

/// The error of Python with the message of `error`.
fn failed(error: impl std::fmt::Display) -> PyErr {
    MasseterError::new_err(error.to_string())
}

/// The same for an error of attaching: whoever starts a rig waits for it to take a controller.
fn not_attached(error: AttachError) -> PyErr {
    match error {
        AttachError::NoSuchRig { .. } => NoRigError::new_err(error.to_string()),
        _ => failed(error),
    }
}

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("MasseterError", module.py().get_type::<MasseterError>())?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("NoRigError", module.py().get_type::<NoRigError>())?;
    module.add_class::<Mechanism>()?;
    module.add_class::<law::Demand>()?;
    module.add_class::<law::ExternalForce>()?;
    module.add_class::<law::Pose>()?;
    module.add_class::<robot::MotionPoint>()?;
    module.add_class::<robot::RobotModel>()?;
    module.add_class::<robot::Times>()?;
    module.add_class::<session::Session>()?;
    module.add_class::<env::Env>()?;
    module.add_class::<env::Snapshot>()?;
    module.add_class::<vector::VectorEnv>()?;
    module.add_function(wrap_pyfunction!(law::check_declaration, module)?)?;
    module.add_function(wrap_pyfunction!(law::control, module)?)?;
    module.add_function(wrap_pyfunction!(read_run, module)?)?;
    Ok(())
}

/// Numbers of a pose: position, then quaternion w x y z.
const POSE: usize = 7;

/// Forward and inverse kinematics over the rows of an array, of a mechanism with these dimensions.
#[pyclass(frozen)]
struct Mechanism(geometry::Mechanism);

#[pymethods]
impl Mechanism {
    #[new]
    #[pyo3(signature = (scenario=None))]
    fn new(scenario: Option<PathBuf>) -> PyResult<Self> {
        let config = match scenario {
            None => MechanismConfig::default(),
            Some(path) => masseter_scenario::Scenario::read(&path).map_err(failed)?.mechanism,
        };
        geometry::Mechanism::new(&config).map(Self).map_err(failed)
    }

    /// Poses of rows of six positions.
    fn forward<'py>(&self, py: Python<'py>, positions: &[u8]) -> PyResult<Bound<'py, PyBytes>> {
        let mut tracker = masseter_controller::kinematics::ForwardTracker::new(self.0.clone());
        solve_rows(py, positions, |axes: [f64; AXES]| {
            let solution = tracker.update(&Actuators::from_axes(axes));
            let pose = solution.map_err(|error| error.to_string())?.pose;
            let ([px, py, pz], [w, x, y, z]) = pose_fields(&pose);
            Ok([px, py, pz, w, x, y, z])
        })
    }

    /// Positions of rows of poses.
    fn inverse<'py>(&self, py: Python<'py>, poses: &[u8]) -> PyResult<Bound<'py, PyBytes>> {
        solve_rows(py, poses, |[px, py, pz, quaternion @ ..]: [f64; POSE]| {
            let norm = quaternion.iter().map(|part| part * part).sum::<f64>().sqrt();
            if (norm - 1.0).abs() > 1e-6 {
                return Err(format!("the quaternion has the length {norm}, not 1"));
            }
            let joints = self.0.inverse(&pose_from_fields([px, py, pz], quaternion));
            Ok(joints.map_err(|error| error.to_string())?.actuators.to_axes())
        })
    }
}

/// The rows that `solve` makes of rows of numbers, while other threads of Python run. The error names the first row that has
/// none.
fn solve_rows<'py, const N: usize, const M: usize>(
    py: Python<'py>,
    rows: &[u8],
    mut solve: impl FnMut([f64; N]) -> Result<[f64; M], String> + Send,
) -> PyResult<Bound<'py, PyBytes>>
where
    [f64; N]: AnyBitPattern,
    [f64; M]: NoUninit,
{
    let solved: Result<Vec<_>, _> = py.detach(|| {
        let rows = rows.chunks_exact(size_of::<[f64; N]>()).map(pod_read_unaligned).enumerate();
        rows.map(|(row, numbers)| solve(numbers).map_err(|error| format!("row {row}: {error}"))).collect()
    });
    Ok(PyBytes::new(py, cast_slice(&solved.map_err(failed)?)))
}

/// The numbers of bytes from Python.
fn floats(bytes: &[u8]) -> Vec<f64> {
    bytes.chunks_exact(size_of::<f64>()).map(pod_read_unaligned).collect()
}

/// The folder of a run; the messages of each topic that controllers use, in order, as the bytes of their structures; and
/// whether the recording is whole.
type ReadRun<'py> = (PathBuf, BTreeMap<&'static str, Bound<'py, PyBytes>>, bool);

/// Reads a run.
#[pyfunction]
fn read_run(py: Python<'_>, path: PathBuf) -> PyResult<ReadRun<'_>> {
    let folder = RunFolder::open(&path).map_err(failed)?;
    let recording = folder.recording();
    let read = py.detach(|| read_topics(&recording));
    let (topics, is_whole) = read.map_err(|error| failed(format!("{}: {error}", recording.display())))?;
    let topics = topics.into_iter().map(|(name, bytes)| (name, PyBytes::new(py, &bytes))).collect();
    Ok((folder.path().to_owned(), topics, is_whole))
}

fn read_topics(path: &Path) -> Result<(BTreeMap<&'static str, Vec<u8>>, bool), ReadError> {
    let mut reader = Reader::open(path)?;
    let of_controllers = |topic: &Topic| !matches!(topic, Topic::Frame | Topic::Machine);
    let names = Topic::ALL.into_iter().filter(of_controllers).map(Topic::name);
    let mut topics: BTreeMap<_, _> = names.map(|name| (name, Vec::new())).collect();
    while let Some(message) = reader.next_message()? {
        if let Some(bytes) = topics.get_mut(message.topic().name()) {
            bytes.extend_from_slice(message.body());
        }
    }
    Ok((topics, reader.damage().is_empty() && !reader.was_cut_short()))
}
