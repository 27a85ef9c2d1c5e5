//! Nothing: without a build script, cargo leaves out what it depends on.

fn main() {}
