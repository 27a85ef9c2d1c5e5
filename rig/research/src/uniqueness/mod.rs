//! Whether six inputs determine one pose: [`prove`] proves it for boxes of inputs, [`search`] looks for inputs with two
//! solutions that meet the paper's conditions.
//!
//! ```
//! use masseter_controller::kinematics::uniqueness::InputBox;
//! use masseter_model::geometry::{Mechanism, MechanismConfig};
//! use masseter_research::uniqueness::prove;
//!
//! let mechanism = Mechanism::new(&MechanismConfig::default())?;
//! // Slides within ±2 mm, legs of 268 to 272 mm.
//! let inputs = InputBox::uniform([-0.002, 0.002], [0.268, 0.272]);
//! let proven = prove(&mechanism, vec![inputs], None, 3000, |_, _| {});
//! assert!(proven.undecided.is_empty());
//! # Ok::<(), masseter_model::geometry::GeometryError>(())
//! ```

mod motion;
mod proof;
mod search;

pub use motion::boxes;
pub use proof::{Proven, prove};
pub use search::{Ambiguous, Search, search};
