//! The architecture's rules on dependencies. Crates keep their layers, and the files of a crate have no circle of
//! imports. An inherent impl of a type is in the file that defines the type. Every file belongs to a module.
//!
//! A file imports another file of its crate when a path in a `use` or in its code leads to an item of that file. A
//! re-export of a file below (`mod child; pub use child::Item;`) is no import, and a path through a re-export leads to
//! the file that defines the item. Code for tests does not count. Method calls carry no path and are not
//! seen, so a type must not be split over files.

#[path = "architecture/circles.rs"]
mod circles;
#[path = "architecture/features.rs"]
mod features;
#[path = "architecture/impls.rs"]
mod impls;
#[path = "architecture/imports.rs"]
mod imports;
#[path = "architecture/layers.rs"]
mod layers;
#[path = "architecture/orphans.rs"]
mod orphans;
#[path = "architecture/workspace.rs"]
mod workspace;

use std::fs;
use std::path::Path;

use circles::circles;
use features::other_features;
use impls::split_types;
use layers::{ROOMS, Room, dependencies_of, folders_below, layer_violations, room_violations};
use orphans::orphans;

#[test]
fn crates_keep_their_layers() {
    let violations = layer_violations(project());
    assert!(violations.is_empty(), "\n{}", violations.join("\n"));
}

/// Frames, buses and emulated wires are of use without this rig: neither its mechanism, nor its scenarios, nor iceoryx2.
#[test]
fn the_crate_of_can_stands_alone() {
    let used = dependencies_of(project(), "masseter-can");
    assert_eq!(used, ["libc", "rand", "rand_pcg", "rustix", "serde", "socketcan", "thiserror"]);
}

/// So are emulated drives.
#[test]
fn the_crate_of_drives_stands_on_that_of_can_alone() {
    let used = dependencies_of(project(), "masseter-drives");
    assert_eq!(used, ["arrayvec", "masseter-can", "serde", "thiserror"]);
}

/// A snapshot holds the state of the plant: a build with other sources refuses the file.
#[test]
fn snapshots_name_the_sources_of_the_plant_and_of_all_crates_below() {
    let build = fs::read_to_string(project().join("rig/run/virtual_time/build.rs")).unwrap();
    let (_, folders) = build.split_once("const FOLDERS").unwrap();
    let folder =
        |line: &str| Some(line.trim().strip_prefix("\"../../../")?.strip_suffix("/src\",")?.to_owned());
    let mut named: Vec<_> = folders.lines().filter_map(folder).collect();
    named.sort();
    assert_eq!(named, folders_below(project(), "masseter-plant"));
}

#[test]
fn the_command_and_its_bindings_share_the_compiled_crates_of_others() {
    for binding in ["masseter-c", "masseter-drives-python", "masseter-python"] {
        let differing = other_features(project(), binding);
        assert!(
            differing.is_empty(),
            "ask for these in shared/features/Cargo.toml:\n{}",
            differing.join("\n")
        );
    }
}

#[test]
fn folders_of_the_simulator_keep_to_their_rooms() {
    let violations = room_violations(project(), &ROOMS);
    assert!(violations.is_empty(), "\n{}", violations.join("\n"));
}

#[test]
fn no_crate_has_a_circle_of_imports() {
    let circles = circles(project());
    assert!(circles.is_empty(), "\n{}", circles.join("\n"));
}

#[test]
fn every_type_has_its_methods_in_its_own_file() {
    let split = split_types(project());
    assert!(split.is_empty(), "\n{}", split.join("\n"));
}

#[test]
fn every_file_belongs_to_a_module() {
    for crates in ["controller", "plant", "rig", "shared"] {
        assert_eq!(orphans(&project().join(crates)), Vec::<std::path::PathBuf>::new());
    }
}

/// Files that read what the kernel serves, a private folder, the program itself, or its sources; everything else reads through
/// `masseter_scenario::input`, which refuses what has no end.
const READERS: [&str; 11] = [
    "rig/cli/kinematics/table.rs",
    "rig/record/recording/src/folder.rs",
    "rig/record/recording/src/writer.rs",
    "rig/robot/ledger.rs",
    "rig/run/interrupts.rs",
    "rig/run/machine/src/lib.rs",
    "rig/run/machine/src/system_root.rs",
    "rig/run/virtual_time/build.rs",
    "rig/vary/campaign/src/campaign.rs",
    "rig/vary/campaign/src/folder.rs",
    "shared/runtime/src/realtime/scheduling.rs",
];

#[test]
fn files_of_users_are_read_up_to_a_limit() {
    let mut readers = Vec::new();
    for crates in ["controller", "plant", "rig", "shared"] {
        readers.extend(unlimited_readers(&project().join(crates)));
    }
    let name = |path: std::path::PathBuf| path.strip_prefix(project()).unwrap().display().to_string();
    let mut readers: Vec<_> = readers.into_iter().map(name).collect();
    let is_of_system = |name: &String| name.starts_with("shared/domain/") || name.contains("/socket_can/");
    readers.retain(|name| !is_of_system(name));
    readers.sort();
    assert_eq!(readers, READERS, "read through masseter_scenario::input, or say here why not");
}

/// The files whose code outside of tests reads whole files without a limit, or opens devices.
fn unlimited_readers(folder: &Path) -> Vec<std::path::PathBuf> {
    let reads = |line: &str| {
        let calls = ["fs::read(", "fs::read_to_string(", "File::open("];
        !line.trim_start().starts_with("//") && calls.iter().any(|call| line.contains(call))
    };
    let mut found = code_files(folder);
    found.retain(|path| {
        let text = fs::read_to_string(path).unwrap();
        text.split("#[cfg(test)]\nmod tests {").next().unwrap().lines().any(reads)
    });
    found
}

/// The files of code below a folder, without those of tests.
fn code_files(folder: &Path) -> Vec<std::path::PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let is_test = ["tests", "tests.rs", "examples", "fuzz", "reference.rs", "target"]
            .iter()
            .any(|name| path.ends_with(name));
        if is_test {
            continue;
        }
        if path.is_dir() {
            found.extend(code_files(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    found
}

fn project() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

// The proof that every rule can fail.

/// A workspace of the files given, in a temporary folder.
fn planted(files: &[(&str, &str)]) -> tempfile::TempDir {
    let workspace = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = workspace.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    workspace
}

#[test]
fn a_file_without_a_module_is_found() {
    let files = [
        ("Cargo.toml", ""),
        ("lib.rs", "mod known;"),
        ("known.rs", "pub(crate) mod part;"),
        ("known/part.rs", ""),
        ("known/lost.rs", "mod part;"),
        ("gone/mod.rs", "mod part;"),
        ("tests/whole.rs", ""),
    ];
    let workspace = planted(&files);
    let mut found = orphans(workspace.path());
    found.sort();
    assert_eq!(found, ["gone/mod.rs", "known/lost.rs"].map(|file| workspace.path().join(file)));
}

fn planted_circles(files: &[(&str, &str)]) -> Vec<String> {
    let manifest = ("Cargo.toml", "[package]\nname = \"planted\"\nedition = \"2024\"\n");
    let workspace = planted(&[&[manifest], files].concat());
    circles(workspace.path())
}

/// `cargo test` runs no file of `tests` that `main.rs` does not name.
#[test]
fn every_file_of_tests_belongs_to_the_program() {
    let main = fs::read_to_string(project().join("tests/main.rs")).unwrap();
    for entry in fs::read_dir(project().join("tests")).unwrap() {
        let file = entry.unwrap().file_name().into_string().unwrap();
        let Some(name) = file.strip_suffix(".rs").filter(|name| *name != "main") else { continue };
        assert!(
            main.contains(&format!("\nmod {name};\n")),
            "{file} never runs: add 'mod {name};' to tests/main.rs"
        );
    }
}

#[test]
fn a_planted_use_beyond_a_room_is_found() {
    let rooms = [
        Room { folder: "src/drive", crates: &["masseter_can"], rooms: &["src/error.rs", "src/old.rs"] },
        Room { folder: "src/gone.rs", crates: &[], rooms: &[] },
    ];
    let manifest = ("Cargo.toml", "[package]\nname = \"planted\"\nedition = \"2024\"\n");
    let lib = ("src/lib.rs", "mod drive;\nmod error;\nmod mechanism;");
    let rest = [("src/error.rs", "pub struct Error;"), ("src/mechanism.rs", "pub struct Axis;")];
    let inner = ("src/drive/inner.rs", "use masseter_can::Frame;\nuse crate::error::Error;");
    for (code, expected) in [
        ("mod inner;\n#[cfg(test)]\nmod tests { use masseter_scenario::Scenario; }", None),
        ("mod inner;\nuse masseter_scenario::Scenario;", Some("src/drive/mod.rs uses masseter_scenario")),
        ("mod inner;\nfn f() { masseter_model::g(); }", Some("src/drive/mod.rs uses masseter_model")),
        ("mod inner;\nuse crate::mechanism::Axis;", Some("src/drive/mod.rs uses src/mechanism.rs")),
    ] {
        let files = [manifest, lib, rest[0], rest[1], inner, ("src/drive/mod.rs", code)];
        let found = room_violations(planted(&files).path(), &rooms);
        let missing = ["src/gone.rs is not there", "src/old.rs is not there"];
        let expected: Vec<_> = expected.into_iter().chain(missing).collect();
        assert_eq!(found, expected, "{code}");
    }
}

#[test]
fn a_planted_impl_in_another_file_than_its_type_is_found() {
    let manifest = ("Cargo.toml", "[package]\nname = \"planted\"\nedition = \"2024\"\n");
    let lib = ("src/lib.rs", "mod one;\nmod two;\npub use one::Whole;");
    let one = (
        "src/one.rs",
        "pub struct Whole<T>(T);\nimpl<T> Whole<T> {}\nmod inner { impl super::Whole<u8> {} }",
    );
    for (two, is_split) in [
        ("impl crate::one::Whole<u8> {}", true),
        ("use crate::Whole as Renamed;\nimpl Renamed<u8> {}", true),
        ("impl Default for crate::one::Whole<u8> { fn default() -> Self { Self(0) } }", false),
        ("struct Whole;\nimpl Whole {}", false),
        ("#[cfg(test)]\nimpl crate::one::Whole<u8> {}", false),
    ] {
        let found = split_types(planted(&[manifest, lib, one, ("src/two.rs", two)]).path());
        let expected = "src/two.rs has an impl of Whole, which src/one.rs defines";
        assert_eq!(found, if is_split { vec![expected] } else { vec![] }, "{two}");
    }
}

#[test]
fn a_planted_circle_is_found_with_its_files_and_names() {
    let found = planted_circles(&[
        ("src/lib.rs", "mod one;\nmod two;\nmod three;"),
        ("src/one.rs", "use crate::two::{Second, self};\npub struct First(Second);"),
        ("src/two/mod.rs", "mod inner;\npub use inner::Second;"),
        ("src/two/inner.rs", "pub struct Second(Option<Box<super::super::three::Third>>);"),
        ("src/three.rs", "pub struct Third;\nfn check() { assert!(size_of::<crate::one::First>() > 0); }"),
    ]);
    let expected = "a circle of 3 files:\n  \
        src/one.rs imports from src/two/inner.rs: Second\n  \
        src/three.rs imports from src/one.rs: First\n  \
        src/two/inner.rs imports from src/three.rs: Third\n";
    assert_eq!(found, [expected]);
}

#[test]
fn a_file_and_its_parent_are_a_circle_when_both_use_each_other() {
    let child = ("src/child.rs", "use super::Error;\npub fn work() -> Result<(), Error> { Ok(()) }");
    for (parent, is_circle) in [
        ("mod child;\npub use child::work;\npub struct Error;", false),
        ("mod child;\npub struct Error;\npub fn all() { child::work(); }", true),
        ("mod child;\npub use child::work;\npub struct Error;\npub fn all() { work(); }", true),
        ("mod child;\nuse child::*;\npub struct Error;", true),
        ("mod child;\nmod error;\npub use error::Error;\npub fn all() { child::work(); }", false),
    ] {
        let found = planted_circles(&[("src/lib.rs", parent), child, ("src/error.rs", "pub struct Error;")]);
        assert_eq!(!found.is_empty(), is_circle, "{parent}: {found:?}");
    }
}

#[test]
fn macros_tie_files_and_code_for_tests_does_not() {
    let lib = ("src/lib.rs", "#[macro_use]\nmod one;\nmod two;");
    let two = ("src/two.rs", "define!(Made);");
    for (one, is_circle) in [
        ("macro_rules! define { ($x:ident) => { $crate::two::Made }; }", true),
        ("macro_rules! define { ($x:ident) => { pub struct $x; }; }", false),
        ("macro_rules! define { ($x:ident) => { pub struct $x; }; }\nuse crate::two::Made;", true),
        (
            "macro_rules! define { ($x:ident) => { pub struct $x; }; }\n#[cfg(test)]\nmod tests { use crate::two::Made; }",
            false,
        ),
    ] {
        let found = planted_circles(&[lib, ("src/one.rs", one), two]);
        assert_eq!(!found.is_empty(), is_circle, "{one}: {found:?}");
    }
}

#[test]
fn planted_violations_of_layers_are_found() {
    let folders = [
        "shared/can",
        "shared/model",
        "shared/scenario",
        "shared/runtime",
        "controller",
        "controller/recorded_motion",
        "plant",
        "rig/show/terminal",
        "rig/show/charts",
        "rig/run/plan",
        "rig/record/recording",
        "rig/judge",
        "rig/show/report",
        "rig/research",
        "rig/unknown",
    ];
    // The root package is a crate of the workspace itself.
    let name = |folder: &str| if folder.is_empty() { "root".to_owned() } else { folder.replace('/', "-") };
    let depending = |from: &str, to: &str| {
        let package = |folder: &str| format!("[package]\nname = \"{}\"\nedition = \"2024\"\n", name(folder));
        let up = "../".repeat(Path::new(from).components().count());
        let dependency = format!("[dependencies]\n{} = {{ path = \"{up}{to}\" }}\n", name(to));
        let manifest = |folder: &str| package(folder) + if folder == from { dependency.as_str() } else { "" };
        let root = manifest("") + &format!("[workspace]\nmembers = {folders:?}");
        let mut files = vec![("Cargo.toml".to_owned(), root), ("src/lib.rs".to_owned(), String::new())];
        for folder in folders {
            files.push((format!("{folder}/Cargo.toml"), manifest(folder)));
            files.push((format!("{folder}/src/lib.rs"), String::new()));
        }
        let files: Vec<_> = files.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect();
        layer_violations(planted(&files).path())
    };
    for (from, to) in [
        ("controller", "plant"),
        ("plant", "controller"),
        ("shared/can", "shared/runtime"),
        ("shared/model", "shared/scenario"),
        ("shared/scenario", "shared/runtime"),
        ("shared/runtime", "plant"),
        ("controller/recorded_motion", "shared/runtime"),
        ("controller/recorded_motion", "controller"),
        ("shared/runtime", "rig/record/recording"),
        ("plant", "rig/show/report"),
        ("rig/record/recording", "rig/show/report"),
        ("rig/show/report", "rig/research"),
        ("rig/run/plan", "rig/record/recording"),
        ("rig/record/recording", "controller"),
        ("rig/judge", "plant"),
        ("rig/show/report", "plant"),
        ("rig/show/charts", "rig/show/terminal"),
        ("rig/show/terminal", "shared/runtime"),
        ("rig/research", "plant"),
        ("rig/research", "rig/show/report"),
        ("rig/unknown", "shared/runtime"),
        ("", "rig/research"),
    ] {
        let expected = format!("{} ({from}/) depends on {} ({to}/)", name(from), name(to));
        assert_eq!(depending(from, to), [expected]);
    }
    for (from, to) in [
        ("shared/runtime", "shared/can"),
        ("controller", "shared/runtime"),
        ("controller", "controller/recorded_motion"),
        ("plant", "shared/can"),
        ("rig/record/recording", "shared/runtime"),
        ("rig/show/report", "rig/record/recording"),
        ("rig/run/plan", "plant"),
        ("rig/judge", "rig/record/recording"),
        ("rig/show/report", "rig/show/terminal"),
        ("rig/research", "controller"),
        ("", "rig/show/report"),
    ] {
        assert_eq!(depending(from, to), [""; 0]);
    }
}
