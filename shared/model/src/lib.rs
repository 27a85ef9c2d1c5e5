//! The mechanism as mathematics: geometry, inverse kinematics and Jacobian, and the equations of its rigid bodies.
//!
//! There is no input and output here, and no file. Forward kinematics belongs to the controller, and the integration of the
//! motion to the plant.

/// Declares a table of a scenario whose keys are all optional, and its `Default`.
#[macro_export]
macro_rules! section {
    ($(#[$attribute:meta])* pub struct $name:ident {
        $($(#[$field_attribute:meta])* pub $field:ident: $type:ty = $default:expr,)*
    }) => {
        $(#[$attribute])*
        #[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct $name {
            $($(#[$field_attribute])* pub $field: $type,)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)* }
            }
        }
    };
}

pub mod dynamics;
pub mod geometry;
