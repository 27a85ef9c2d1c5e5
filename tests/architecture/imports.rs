//! Imports: paths between the files of one crate.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use proc_macro2::{TokenStream, TokenTree};
use syn::visit::{self, Visit};
use syn::{Attribute, ImplItemFn, Item, ItemImpl, ItemUse, Macro, Meta, Type, UseTree, Visibility};

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
    /// The types of inherent impls.
    impls: BTreeSet<Names>,
}

/// The names by which each file imports each other file.
pub(super) type Imports<'a> = BTreeMap<&'a Path, BTreeMap<&'a Path, BTreeSet<String>>>;

/// The modules of a crate by their paths.
#[derive(Debug, Default)]
pub(super) struct Crate {
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

/// Imports that a path may lead through.
const DEPTH: usize = 32;

impl Crate {
    pub(super) fn read(root: &Path) -> Self {
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
                module.impls.extend(type_of_inherent_impl(item));
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

    /// The crates of the workspace that each file names.
    pub(super) fn named_crates(&self) -> BTreeMap<&Path, BTreeSet<&str>> {
        let mut found: BTreeMap<&Path, BTreeSet<&str>> = BTreeMap::new();
        for module in self.modules.values() {
            let paths = module.imports.iter().map(|import| &import.path).chain(&module.paths);
            let firsts = paths.filter_map(|path| path.first()).map(String::as_str);
            let named = firsts.filter(|name| name.starts_with("masseter_"));
            found.entry(&module.file).or_default().extend(named);
        }
        found
    }

    /// Inherent impls in another file than their type: file, name of the type, file of the type.
    pub(super) fn foreign_impls(&self) -> Vec<(&Path, String, &Path)> {
        let mut found = Vec::new();
        for (path, module) in &self.modules {
            for written in &module.impls {
                let Some(Target { module: defined_in, item: Some(name) }) =
                    self.resolve(path, written, DEPTH)
                else {
                    continue;
                };
                let defined_in = &self.modules[&defined_in].file;
                if *defined_in != module.file {
                    found.push((module.file.as_path(), name, defined_in.as_path()));
                }
            }
        }
        found
    }

    /// From every file to the files it imports, with the items.
    pub(super) fn imports(&self) -> Imports<'_> {
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

fn type_of_inherent_impl(item: &Item) -> Option<Names> {
    let Item::Impl(ItemImpl { trait_: None, self_ty, .. }) = item else { return None };
    let Type::Path(written) = &**self_ty else { return None };
    Some(written.path.segments.iter().map(|segment| segment.ident.to_string()).collect())
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
