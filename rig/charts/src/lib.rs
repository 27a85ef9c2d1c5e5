//! Colours of all charts of the rig.

pub mod palette;
