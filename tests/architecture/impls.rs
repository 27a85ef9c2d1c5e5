//! Inherent impls: a type's methods are in the file that defines it, so no other file has access to its private state.

use std::path::Path;

use super::imports::Crate;
use super::workspace::{crate_roots, within};

/// One line for each inherent impl in another file than its type.
pub(super) fn split_types(workspace: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for root in crate_roots(workspace) {
        for (file, name, defined_in) in Crate::read(&root).foreign_impls() {
            let [file, defined_in] = [file, defined_in].map(|file| within(workspace, file));
            found.push(format!("{file} has an impl of {name}, which {defined_in} defines"));
        }
    }
    found
}
