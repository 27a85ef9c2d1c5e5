//! Circles: files of one crate that import each other, directly or through others.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::imports::{Crate, Imports};
use super::workspace::{crate_roots, within};

/// Every circle of every crate: its files, and the items that tie them.
pub(super) fn circles(workspace: &Path) -> Vec<String> {
    crate_roots(workspace).iter().flat_map(|root| circles_of(workspace, &Crate::read(root))).collect()
}

fn circles_of(workspace: &Path, read: &Crate) -> Vec<String> {
    let imports = read.imports();
    let reached: BTreeMap<_, _> = imports.keys().map(|file| (*file, reached_from(file, &imports))).collect();
    let mut seen = BTreeSet::new();
    let mut circles = Vec::new();
    for file in imports.keys().filter(|file| reached[*file].contains(*file)) {
        let circle: BTreeSet<_> =
            reached[file].iter().filter(|other| reached[*other].contains(file)).copied().collect();
        if seen.insert(circle.clone()) {
            circles.push(described(workspace, &circle, &imports));
        }
    }
    circles
}

/// All files that a file imports, and those they import.
fn reached_from<'a>(file: &Path, imports: &Imports<'a>) -> BTreeSet<&'a Path> {
    let mut reached = BTreeSet::new();
    let mut ahead: Vec<_> = imports[file].keys().copied().collect();
    while let Some(next) = ahead.pop() {
        if reached.insert(next) {
            ahead.extend(imports[next].keys());
        }
    }
    reached
}

fn described(workspace: &Path, circle: &BTreeSet<&Path>, imports: &Imports) -> String {
    let line = |from: &Path, to: &Path, names: &BTreeSet<String>| {
        let [from, to] = [from, to].map(|file| within(workspace, file));
        let names: Vec<_> = names.iter().map(String::as_str).collect();
        format!("  {from} imports from {to}: {}\n", names.join(", "))
    };
    let lines = circle.iter().flat_map(|from| {
        let inside = imports[from].iter().filter(|(to, _)| circle.contains(*to));
        inside.map(|(to, names)| line(from, to, names))
    });
    let lines: String = lines.collect();
    format!("a circle of {} files:\n{lines}", circle.len())
}
