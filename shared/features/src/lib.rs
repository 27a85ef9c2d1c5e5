//! Nothing. The C library and the Python package ask crates of others for other features than the command does. Cargo would
//! then compile half of these crates once more for each of them. `masseter-runtime` depends on this crate, which asks for all
//! these features, so that every build of the workspace has the same.
