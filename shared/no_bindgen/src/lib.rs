//! Nothing. iceoryx2-pal-posix lists bindgen as a dependency of its build script on every system, and runs it on QNX alone. This
//! crate takes bindgen's place (`[patch.crates-io]`), so that a first build does not compile bindgen and what it needs.
