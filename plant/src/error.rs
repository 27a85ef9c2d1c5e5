//! Errors of the plant: every reason why a plant cannot be built or cannot continue.

use std::path::PathBuf;

use masseter_can::{BitrateError, NotByPort, OpenError, canopen::NodeIdError};
use masseter_model::geometry::{GeometryError, InverseError, LimitViolation};
use masseter_scenario::DynamicsConfig;

/// A plant that cannot be built or cannot continue.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlantError {
    /// The mechanism's dimensions.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
    /// The mechanism's dynamics.
    #[error(transparent)]
    Dynamics(#[from] DynamicsError),
    /// A real interface.
    #[error(transparent)]
    Interface(#[from] OpenError),
    /// Settings or a state of a real interface with which no drive can be controlled: what is wrong, and the remedies.
    #[error("{}", .0.join("; "))]
    Unfit(Vec<String>),
    /// Another master of this machine drives the interface.
    #[error("{0}: another rig drives it; end that one, or use other interfaces")]
    MasterHere(String),
    /// The bit rate.
    #[error("can.bitrate_bps: {0}")]
    Bitrate(#[from] BitrateError),
    /// A node id out of range.
    #[error("can.node_ids: {0}")]
    NodeId(#[from] NodeIdError),
    /// A fault that needs a simulated wire.
    #[error("faults: {0}")]
    NotByPort(#[from] NotByPort),
    /// A table of a stimulus.
    #[error("{}{}: {problem}", path.display(), line.map(|line| format!(":{line}")).unwrap_or_default())]
    Table {
        /// The file.
        path: PathBuf,
        /// The line, from 1; none for the file as a whole.
        line: Option<u64>,
        /// The error with its remedy.
        problem: String,
    },
    /// The file with the drives' memory.
    #[error("drives.memory = {}: {reason}; mend the file, or remove it for drives that have stored nothing", path.display())]
    Memory {
        /// The file.
        path: PathBuf,
        /// Why the file is not usable.
        reason: String,
    },
    /// Values of the scenario that contradict each other: their keys, the reason and the remedy.
    #[error("{0}")]
    Scenario(String),
}

/// Dynamics that cannot be built or cannot be integrated.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum DynamicsError {
    /// The pose has no joint coordinates.
    #[error("the mechanism came to a pose without joint coordinates: {0}")]
    Inverse(#[from] InverseError),
    /// The mass matrix cannot be inverted: masses or inertias are not positive.
    #[error("the mechanism's mass matrix is not positive definite; check [dynamics]")]
    Mass,
    /// Contact between the jaws that the integration cannot resolve.
    #[error(transparent)]
    Contact(#[from] ContactError),
    /// Initial legs on which the platform cannot be level within the strokes.
    #[error(
        "dynamics.initial_leg_m = {initial_leg_m}: {violation}; choose legs, and an initial_offset_m, with which the level \
         platform is within its strokes"
    )]
    Start {
        /// Length of the legs, m.
        initial_leg_m: f64,
        /// The joint that is outside its stroke.
        violation: LimitViolation,
    },
}

/// A contact that the integration cannot resolve.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ContactError {
    /// At the chosen step.
    #[error(
        "dynamics.step_ns = {step_ns}: the contact of teeth and food is too stiff for this step; use at most {longest_ns}, or \
         less teeth.stiff_n_per_m or food.stiffness_n_per_m"
    )]
    Step {
        /// The chosen step, ns.
        step_ns: u64,
        /// The longest step that resolves the contact, ns.
        longest_ns: u64,
    },
    /// At every step.
    #[error(
        "teeth.stiff_n_per_m, food.stiffness_n_per_m: the contact of teeth and food needs a dynamics.step_ns of {longest_ns}, \
         which is less than {}; use less stiffness",
        DynamicsConfig::STEPS_NS.start()
    )]
    Stiff {
        /// The longest step that resolves the contact, ns.
        longest_ns: u64,
    },
}
