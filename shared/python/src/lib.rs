//! The native part of the Python package `masseter`; the package itself has the documentation.
//!
//! Arrays cross the border as bytes of 64-bit floats, so that this crate needs no array library.
#![allow(clippy::needless_pass_by_value, reason = "Python passes values")]

mod kinematics;
mod law;
mod recording;
mod session;

use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

create_exception!(masseter, MasseterError, PyException, "The message of the rig, with what to do.");

/// The error of Python with the message of `error`.
fn failed(error: impl std::fmt::Display) -> PyErr {
    MasseterError::new_err(error.to_string())
}

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("MasseterError", module.py().get_type::<MasseterError>())?;
    module.add_class::<kinematics::Mechanism>()?;
    module.add_class::<law::Demand>()?;
    module.add_class::<law::Pose>()?;
    module.add_class::<session::Session>()?;
    module.add_function(wrap_pyfunction!(law::check, module)?)?;
    module.add_function(wrap_pyfunction!(law::control, module)?)?;
    module.add_function(wrap_pyfunction!(recording::topics, module)?)?;
    Ok(())
}
