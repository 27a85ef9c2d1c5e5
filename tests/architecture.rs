//! The architecture's two rules on dependencies: crates keep their layers, and the files of a crate have no circle of
//! imports.
//!
//! A file imports another file of its crate when a path in a `use` or in its code leads to an item of that file. A
//! re-export of a file below (`mod child; pub use child::Item;`) is no import, and a path through a re-export leads to
//! the file that defines the item. Code for tests does not count. Method calls carry no path and are not seen.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use proc_macro2::{TokenStream, TokenTree};
use serde_json::Value;
use syn::visit::{self, Visit};
use syn::{Attribute, ImplItemFn, Item, ItemUse, Macro, Meta, UseTree, Visibility};

#[test]
fn crates_keep_their_layers() {
    let violations = layer_violations(project());
    assert!(violations.is_empty(), "\n{}", violations.join("\n"));
}

#[test]
fn no_crate_has_a_circle_of_imports() {
    let circles = circles(project());
    assert!(circles.is_empty(), "\n{}", circles.join("\n"));
}

fn project() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The workspace as `cargo metadata` describes it, without the dependencies' own dependencies.
fn metadata(workspace: &Path) -> Value {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .args(["metadata", "--no-deps", "--offline", "--format-version", "1", "--manifest-path"])
        .arg(workspace.join("Cargo.toml"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn list(value: &Value) -> &[Value] {
    value.as_array().expect("a list")
}

fn text(value: &Value) -> &str {
    value.as_str().expect("a text")
}

/// The file or folder as seen from the workspace.
fn within(workspace: &Path, path: &Path) -> String {
    let workspace = workspace.canonicalize().unwrap();
    path.canonicalize().unwrap().strip_prefix(workspace).unwrap().display().to_string()
}

// Layers: dependencies between the crates of the workspace.

/// The layer of a crate, by its folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Layer {
    Can,
    Shared,
    Controller,
    Plant,
    /// Below `rig/`, with its place in `recording ← analysis ← report ← study` if it is one of these.
    Rig(Option<usize>),
    /// The root package: verbs, supervisor, recorder.
    Command,
}

impl Layer {
    fn of_folder(folder: &str) -> Self {
        const RIG: [&str; 4] = ["recording", "analysis", "report", "study"];
        let mut steps = folder.split('/');
        match (steps.next().unwrap_or_default(), steps.next()) {
            ("shared", Some("can")) => Self::Can,
            ("shared", _) => Self::Shared,
            ("controller", _) => Self::Controller,
            ("plant", _) => Self::Plant,
            ("rig", Some(part)) => Self::Rig(RIG.iter().position(|name| *name == part)),
            _ => Self::Command,
        }
    }

    /// Whether a crate of this layer may depend on one of the other.
    fn may_use(self, other: Self) -> bool {
        match (self, other) {
            (Self::Command, _) => true,
            (Self::Can, _) | (_, Self::Command) => false,
            (Self::Rig(Some(place)), Self::Rig(Some(below))) => below < place,
            (_, Self::Can | Self::Shared) | (Self::Rig(_), Self::Controller | Self::Plant | Self::Rig(_)) => {
                true
            }
            _ => self == other,
        }
    }
}

/// One line for each dependency that a layer forbids.
fn layer_violations(workspace: &Path) -> Vec<String> {
    let metadata = metadata(workspace);
    let folder_of = |manifest: &Path| within(workspace, manifest.parent().unwrap());
    let mut violations = Vec::new();
    for package in list(&metadata["packages"]) {
        let folder = folder_of(Path::new(text(&package["manifest_path"])));
        for dependency in list(&package["dependencies"]) {
            let Some(path) = dependency["path"].as_str() else { continue };
            let needed = within(workspace, Path::new(path));
            if !Layer::of_folder(&folder).may_use(Layer::of_folder(&needed)) {
                let names = [&package["name"], &dependency["name"]].map(text);
                violations.push(format!("{} ({folder}/) depends on {} ({needed}/)", names[0], names[1]));
            }
        }
    }
    violations
}

// Imports: paths between the files of one crate.

/// The names that lead to a module or an item, from the root of its crate.
type Names = Vec<String>;

/// A leaf of a `use`.
#[derive(Debug, Clone)]
struct Import {
    path: Names,
    /// The name that it has here; none for a glob.
    name: Option<String>,
    is_reexport: bool,
}

/// A module: a file, or a block `mod name { … }` in one.
#[derive(Debug, Default)]
struct Module {
    file: PathBuf,
    items: BTreeSet<String>,
    imports: Vec<Import>,
    /// Paths in code.
    paths: BTreeSet<Names>,
    /// Calls of macros by their names alone.
    macros: BTreeSet<String>,
}

/// The modules of a crate by their paths.
#[derive(Debug, Default)]
struct Crate {
    modules: BTreeMap<Names, Module>,
    /// Where each macro is defined.
    macros: BTreeMap<String, Names>,
}

/// An item, or a module itself, and the module that defines it.
#[derive(Debug)]
struct Target {
    module: Names,
    item: Option<String>,
}

/// A name that a module neither defines nor imports.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Absent {
    /// A path leads there, so a macro makes the item.
    IsMade,
    /// Another glob may have it.
    IsElsewhere,
}

impl Crate {
    fn read(root: &Path) -> Self {
        let mut read = Self::default();
        read.file(Vec::new(), root, root.parent().unwrap());
        read
    }

    /// Reads a file; `folder` holds the files of its modules.
    fn file(&mut self, path: Names, file: &Path, folder: &Path) {
        let text = fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let parsed = syn::parse_file(&text).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        self.module(path, file, folder, &parsed.items);
    }

    fn module(&mut self, path: Names, file: &Path, folder: &Path, items: &[Item]) {
        let mut module = Module { file: file.to_owned(), ..Module::default() };
        for item in items.iter().filter(|item| !is_for_tests(attributes(item))) {
            let Item::Mod(inner) = item else {
                let name = name(item);
                if let (Item::Macro(_), Some(name)) = (item, &name) {
                    self.macros.insert(name.clone(), path.clone());
                }
                module.items.extend(name);
                module.visit_item(item);
                continue;
            };
            let name = inner.ident.to_string();
            let inner_path = [path.as_slice(), std::slice::from_ref(&name)].concat();
            let inner_folder = folder.join(&name);
            if let Some((_, items)) = &inner.content {
                self.module(inner_path, file, &inner_folder, items);
                continue;
            }
            let candidates = [folder.join(format!("{name}.rs")), inner_folder.join("mod.rs")];
            let file = candidates.iter().find(|file| file.is_file());
            let file = file.unwrap_or_else(|| panic!("none of {candidates:?} exists"));
            self.file(inner_path, file, &inner_folder);
        }
        self.modules.insert(path, module);
    }

    /// What a path that is written in `module` leads to; none outside of this crate.
    fn resolve(&self, module: &[String], path: &[String], depth: usize) -> Option<Target> {
        let (first, rest) = path.split_first()?;
        match first.as_str() {
            "crate" => self.locate(&[], rest, depth, Absent::IsMade),
            "self" => self.locate(module, rest, depth, Absent::IsMade),
            "super" => {
                let (_, parent) = module.split_last()?;
                if rest.first().is_some_and(|next| next == "super") {
                    self.resolve(parent, rest, depth)
                } else {
                    self.locate(parent, rest, depth, Absent::IsMade)
                }
            }
            _ if self.binds(module, first) => self.locate(module, path, depth, Absent::IsMade),
            _ => None,
        }
    }

    /// Whether a name is a module, an item or an import in `module`.
    fn binds(&self, module: &[String], name: &str) -> bool {
        let here = &self.modules[module];
        self.modules.contains_key(&below(module, name))
            || here.items.contains(name)
            || here.imports.iter().any(|import| import.name.as_deref() == Some(name))
    }

    /// Follows names down from a module, through its imports too, to where the item is defined.
    fn locate(&self, module: &[String], names: &[String], depth: usize, absent: Absent) -> Option<Target> {
        // Two globs may import each other.
        let depth = depth.checked_sub(1)?;
        let Some((first, rest)) = names.split_first() else {
            return Some(Target { module: module.to_vec(), item: None });
        };
        let inner = below(module, first);
        if self.modules.contains_key(&inner) {
            return self.locate(&inner, rest, depth, absent);
        }
        let here = &self.modules[module];
        let item = || Target { module: module.to_vec(), item: Some(first.clone()) };
        if here.items.contains(first) {
            return Some(item());
        }
        if let Some(import) = here.imports.iter().find(|import| import.name.as_ref() == Some(first)) {
            return self.resolve(module, &[import.path.as_slice(), rest].concat(), depth);
        }
        let mut globs = here.imports.iter().filter(|import| import.name.is_none());
        let in_glob = globs.find_map(|glob| {
            let target = self.resolve(module, &glob.path, depth)?;
            // A glob of an enum's variants leads to the enum, not to a module.
            let is_module = target.item.is_none() && target.module != module;
            is_module.then(|| self.locate(&target.module, names, depth, Absent::IsElsewhere)).flatten()
        });
        in_glob.or_else(|| (absent == Absent::IsMade).then(item))
    }

    /// From every file to the files it imports, with the items.
    fn imports(&self) -> BTreeMap<&Path, BTreeMap<&Path, BTreeSet<String>>> {
        const DEPTH: usize = 32;
        let mut found: BTreeMap<&Path, BTreeMap<&Path, BTreeSet<String>>> = BTreeMap::new();
        for (path, module) in &self.modules {
            let edges = found.entry(&module.file).or_default();
            let mut add = |target: Target| {
                let file = self.modules[&target.module].file.as_path();
                if file != module.file {
                    let name = target.item.or_else(|| target.module.last().cloned());
                    edges.entry(file).or_default().extend(name);
                }
            };
            for import in &module.imports {
                let Some(target) = self.resolve(path, &import.path, DEPTH) else { continue };
                let is_facade = import.is_reexport && target.module.starts_with(path);
                // A module's name alone imports nothing: the paths that begin with it do.
                let is_module = target.item.is_none() && import.name.is_some();
                if !is_facade && !is_module {
                    add(target);
                }
            }
            for code in &module.paths {
                // A variable may have the name of a module.
                self.resolve(path, code, DEPTH).filter(|target| target.item.is_some()).map(&mut add);
            }
            for name in &module.macros {
                if let Some(defined_in) = self.macros.get(name) {
                    add(Target { module: defined_in.clone(), item: Some(format!("{name}!")) });
                }
            }
        }
        found
    }
}

fn below(module: &[String], name: &str) -> Names {
    module.iter().cloned().chain([name.to_owned()]).collect()
}

/// The paths of a module's code. Modules inside it are read for themselves.
impl<'ast> Visit<'ast> for Module {
    fn visit_path(&mut self, path: &'ast syn::Path) {
        self.paths.insert(path.segments.iter().map(|segment| segment.ident.to_string()).collect());
        visit::visit_path(self, path);
    }

    fn visit_item_use(&mut self, item: &'ast ItemUse) {
        if !is_for_tests(&item.attrs) {
            let is_reexport = !matches!(item.vis, Visibility::Inherited);
            leaves(&item.tree, &mut Vec::new(), is_reexport, &mut self.imports);
        }
    }

    fn visit_macro(&mut self, called: &'ast Macro) {
        match called.path.get_ident() {
            Some(name) => drop(self.macros.insert(name.to_string())),
            None => self.visit_path(&called.path),
        }
        self.tokens(called.tokens.clone());
    }

    fn visit_impl_item_fn(&mut self, function: &'ast ImplItemFn) {
        if !is_for_tests(&function.attrs) {
            visit::visit_impl_item_fn(self, function);
        }
    }

    /// `pub(super)` names a place, and imports nothing from it.
    fn visit_visibility(&mut self, _: &'ast Visibility) {}

    fn visit_attribute(&mut self, _: &'ast Attribute) {}
}

impl Module {
    /// The paths among a macro's tokens.
    fn tokens(&mut self, tokens: TokenStream) {
        let mut path = Names::new();
        let mut colons = 0;
        for token in tokens {
            match token {
                TokenTree::Punct(punct) if punct.as_char() == ':' => {
                    colons += 1;
                    continue;
                }
                TokenTree::Ident(ident) => {
                    if colons != 2 {
                        self.paths.insert(std::mem::take(&mut path));
                    }
                    path.push(ident.to_string());
                }
                TokenTree::Group(group) => {
                    self.paths.insert(std::mem::take(&mut path));
                    self.tokens(group.stream());
                }
                TokenTree::Punct(punct) if punct.as_char() == '!' && path.len() == 1 => {
                    self.macros.extend(path.pop());
                }
                TokenTree::Punct(_) | TokenTree::Literal(_) => {
                    self.paths.insert(std::mem::take(&mut path));
                }
            }
            colons = 0;
        }
        self.paths.insert(path);
    }
}

fn leaves(tree: &UseTree, path: &mut Names, is_reexport: bool, found: &mut Vec<Import>) {
    let mut leaf = |last: &str, name: Option<String>| {
        let mut path = path.clone();
        if !matches!(last, "" | "self") || path.is_empty() {
            path.push(last.to_owned());
        }
        found.push(Import { path, name, is_reexport });
    };
    match tree {
        UseTree::Path(step) => {
            path.push(step.ident.to_string());
            leaves(&step.tree, path, is_reexport, found);
            path.pop();
        }
        UseTree::Name(name) if name.ident == "self" => leaf("self", path.last().cloned()),
        UseTree::Name(name) => leaf(&name.ident.to_string(), Some(name.ident.to_string())),
        UseTree::Rename(rename) => leaf(&rename.ident.to_string(), Some(rename.rename.to_string())),
        UseTree::Glob(_) => leaf("", None),
        UseTree::Group(group) => {
            group.items.iter().for_each(|tree| leaves(tree, path, is_reexport, found));
        }
    }
}

/// Whether this is compiled for tests alone.
fn is_for_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| match &attribute.meta {
        Meta::List(list) if list.path.is_ident("cfg") => {
            let condition = list.tokens.to_string();
            let mut words = condition.split(|c: char| !c.is_alphanumeric() && c != '_');
            words.clone().any(|word| word == "test") && words.all(|word| word != "not")
        }
        _ => false,
    })
}

fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(item) => &item.attrs,
        Item::Enum(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Macro(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Static(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Trait(item) => &item.attrs,
        Item::Type(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => &[],
    }
}

fn name(item: &Item) -> Option<String> {
    Some(match item {
        Item::Const(item) => item.ident.to_string(),
        Item::Enum(item) => item.ident.to_string(),
        Item::Fn(item) => item.sig.ident.to_string(),
        Item::Macro(item) => item.ident.as_ref()?.to_string(),
        Item::Static(item) => item.ident.to_string(),
        Item::Struct(item) => item.ident.to_string(),
        Item::Trait(item) => item.ident.to_string(),
        Item::Type(item) => item.ident.to_string(),
        _ => return None,
    })
}

/// Every circle of every crate: its files, and the items that tie them.
fn circles(workspace: &Path) -> Vec<String> {
    let metadata = metadata(workspace);
    let packages = list(&metadata["packages"]).iter();
    let targets = packages.flat_map(|package| list(&package["targets"]));
    let is_crate = |target: &&Value| list(&target["kind"]).iter().any(|kind| kind == "lib" || kind == "bin");
    let roots: BTreeSet<_> = targets.filter(is_crate).map(|target| text(&target["src_path"])).collect();
    roots.into_iter().flat_map(|root| circles_of(workspace, &Crate::read(Path::new(root)))).collect()
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

type Imports<'a> = BTreeMap<&'a Path, BTreeMap<&'a Path, BTreeSet<String>>>;

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

// The proof that both rules can fail.

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

fn planted_circles(files: &[(&str, &str)]) -> Vec<String> {
    let manifest = ("Cargo.toml", "[package]\nname = \"planted\"\nedition = \"2024\"\n");
    let workspace = planted(&[&[manifest], files].concat());
    circles(workspace.path())
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
    let two = ("src/two.rs", "tell!(Made);");
    for (one, is_circle) in [
        ("macro_rules! tell { ($x:ident) => { $crate::two::Made }; }", true),
        ("macro_rules! tell { ($x:ident) => { pub struct $x; }; }", false),
        ("macro_rules! tell { ($x:ident) => { pub struct $x; }; }\nuse crate::two::Made;", true),
        (
            "macro_rules! tell { ($x:ident) => { pub struct $x; }; }\n#[cfg(test)]\nmod tests { use crate::two::Made; }",
            false,
        ),
    ] {
        let found = planted_circles(&[lib, ("src/one.rs", one), two]);
        assert_eq!(!found.is_empty(), is_circle, "{one}: {found:?}");
    }
}

#[test]
fn planted_violations_of_layers_are_found() {
    let folders = ["shared/can", "shared", "controller", "plant", "rig/recording", "rig/report", "rig/study"];
    let name = |folder: &str| folder.replace('/', "-");
    let depending = |from: &str, to: &str| {
        let package = |folder: &str| format!("[package]\nname = \"{}\"\nedition = \"2024\"\n", name(folder));
        let up = "../".repeat(from.split('/').count());
        let dependency = format!("[dependencies]\n{} = {{ path = \"{up}{to}\" }}\n", name(to));
        let mut files = vec![("Cargo.toml".to_owned(), format!("[workspace]\nmembers = {folders:?}"))];
        for folder in folders {
            let dependencies = if folder == from { dependency.as_str() } else { "" };
            files.push((format!("{folder}/Cargo.toml"), package(folder) + dependencies));
            files.push((format!("{folder}/src/lib.rs"), String::new()));
        }
        let files: Vec<_> = files.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect();
        layer_violations(planted(&files).path())
    };
    for (from, to) in [
        ("controller", "plant"),
        ("plant", "controller"),
        ("shared/can", "shared"),
        ("shared", "plant"),
        ("shared", "rig/recording"),
        ("plant", "rig/report"),
        ("rig/recording", "rig/report"),
        ("rig/report", "rig/study"),
    ] {
        let expected = format!("{} ({from}/) depends on {} ({to}/)", name(from), name(to));
        assert_eq!(depending(from, to), [expected]);
    }
    for (from, to) in [
        ("shared", "shared/can"),
        ("controller", "shared"),
        ("plant", "shared/can"),
        ("rig/recording", "shared"),
        ("rig/report", "rig/recording"),
        ("rig/study", "controller"),
    ] {
        assert_eq!(depending(from, to), [""; 0]);
    }
}
