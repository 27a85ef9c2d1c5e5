//! Forward and inverse kinematics over the rows of an array.

use masseter_controller::kinematics::ForwardTracker;
use masseter_model::geometry::{AXES, Actuators, MechanismConfig};
use masseter_runtime::messages::{pose_fields, pose_from_fields};
use masseter_scenario::Scenario;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::{MasseterError, failed};

/// Numbers of a pose: position, then quaternion w x y z.
const POSE: usize = 7;

/// The dimensions of the mechanism.
#[pyclass(frozen)]
pub(crate) struct Mechanism(masseter_model::geometry::Mechanism);

#[pymethods]
impl Mechanism {
    #[new]
    #[pyo3(signature = (scenario=None))]
    fn new(scenario: Option<std::path::PathBuf>) -> PyResult<Self> {
        let config = match scenario {
            None => MechanismConfig::default(),
            Some(path) => Scenario::read(&path).map_err(failed)?.mechanism,
        };
        masseter_model::geometry::Mechanism::new(&config).map(Self).map_err(failed)
    }

    /// Poses of rows of six positions.
    fn forward<'py>(&self, py: Python<'py>, positions: &[u8]) -> PyResult<Bound<'py, PyBytes>> {
        let mut tracker = ForwardTracker::new(self.0.clone());
        let solved = py.detach(|| {
            collect(rows::<AXES>(positions), |axes| {
                let solution =
                    tracker.update(&Actuators::from_axes(axes)).map_err(|error| error.to_string())?;
                let ([px, py, pz], [w, x, y, z]) = pose_fields(&solution.pose);
                Ok([px, py, pz, w, x, y, z])
            })
        });
        answer(py, solved)
    }

    /// Positions of rows of poses.
    fn inverse<'py>(&self, py: Python<'py>, poses: &[u8]) -> PyResult<Bound<'py, PyBytes>> {
        let solved = py.detach(|| {
            collect(rows::<POSE>(poses), |[px, py, pz, quaternion @ ..]: [f64; POSE]| {
                let norm = quaternion.iter().map(|part| part * part).sum::<f64>().sqrt();
                if (norm - 1.0).abs() > 1e-6 {
                    return Err(format!("the quaternion has the length {norm}, not 1"));
                }
                let pose = pose_from_fields([px, py, pz], quaternion);
                let joints = self.0.inverse(&pose).map_err(|error| error.to_string())?;
                Ok(joints.actuators.to_axes())
            })
        });
        answer(py, solved)
    }
}

fn rows<const N: usize>(bytes: &[u8]) -> impl Iterator<Item = [f64; N]> {
    let number = |bytes: &[u8]| f64::from_ne_bytes(bytes.try_into().expect("eight bytes"));
    bytes
        .chunks_exact(8 * N)
        .map(move |row| std::array::from_fn(|index| number(&row[8 * index..8 * index + 8])))
}

/// The rows that `solve` gives, as bytes; or the first row that has none, and why.
fn collect<const N: usize, const M: usize>(
    rows: impl Iterator<Item = [f64; N]>,
    mut solve: impl FnMut([f64; N]) -> Result<[f64; M], String>,
) -> Result<Vec<u8>, (usize, String)> {
    let mut bytes = Vec::with_capacity(rows.size_hint().0 * 8 * M);
    for (index, row) in rows.enumerate() {
        let solved = solve(row).map_err(|error| (index, error))?;
        bytes.extend(solved.iter().flat_map(|number| number.to_ne_bytes()));
    }
    Ok(bytes)
}

fn answer(py: Python<'_>, solved: Result<Vec<u8>, (usize, String)>) -> PyResult<Bound<'_, PyBytes>> {
    let refused = |(row, error)| MasseterError::new_err(format!("row {row}: {error}"));
    solved.map(|bytes| PyBytes::new(py, &bytes)).map_err(refused)
}
