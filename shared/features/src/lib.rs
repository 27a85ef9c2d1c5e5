//! Features of crates of others. The C library and the Python package need other features than the command, and Cargo would compile
//! half of these crates once more for each. `masseter-runtime` depends on this crate, which lists all features, so that every build of the
//! workspace has the same.
