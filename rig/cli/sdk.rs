//! What a project of `masseter new` is built with: a checkout of Masseter's source, or a folder of `scripts/release`. The
//! command looks for it beside itself, since it may be installed anywhere.

use std::path::{Path, PathBuf};
use std::{env, fs};

/// A folder to build with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Sdk {
    /// A checkout; Cargo builds the library and the package from it.
    Source(PathBuf),
    /// A folder of `scripts/release`, where both are built.
    Release(PathBuf),
}

/// Why there is nothing to build with.
#[derive(Debug, thiserror::Error)]
pub(super) enum SdkError {
    #[error(
        "{} is neither Masseter's source nor a folder of scripts/release; give one of them by --sdk",
        .0.display()
    )]
    Neither(PathBuf),
    #[error(
        "neither this command nor this folder lies in Masseter's source or in a folder of scripts/release; give one of \
         them by --sdk"
    )]
    NotFound,
    #[error(
        "a Rust project needs Masseter's source, and {} has only what is built of it; give a checkout by --sdk, or take \
         --lang c, cpp or python",
        .0.display()
    )]
    NoCrates(PathBuf),
    #[error("{} has no wheel masseter-….whl; give a folder of scripts/release by --sdk", .0.display())]
    NoWheel(PathBuf),
}

impl Sdk {
    /// The given folder. Else the nearest one above this command, or above the current folder.
    pub(super) fn new(given: Option<&Path>) -> Result<Self, SdkError> {
        if let Some(folder) = given {
            let absolute = std::path::absolute(folder).ok();
            return absolute.and_then(|at| Self::at(&at)).ok_or_else(|| SdkError::Neither(folder.to_owned()));
        }
        let starts = [env::current_exe(), env::current_dir()];
        starts.into_iter().flatten().find_map(|start| Self::above(&start)).ok_or(SdkError::NotFound)
    }

    pub(super) fn folder(&self) -> &Path {
        match self {
            Self::Source(folder) | Self::Release(folder) => folder,
        }
    }

    /// Refuses where there are no crates.
    pub(super) fn demand_crates(&self) -> Result<(), SdkError> {
        match self {
            Self::Source(_) => Ok(()),
            Self::Release(folder) => Err(SdkError::NoCrates(folder.clone())),
        }
    }

    /// What pip installs.
    pub(super) fn python_package(&self) -> Result<PathBuf, SdkError> {
        match self {
            Self::Source(folder) => Ok(folder.join("rig/bindings/python")),
            Self::Release(folder) => wheel(folder).ok_or_else(|| SdkError::NoWheel(folder.clone())),
        }
    }

    /// The part of a CMakeLists.txt that defines the library `masseter`.
    pub(super) const fn cmake(&self) -> &'static str {
        match self {
            Self::Source(_) => include_str!("../../examples/controllers/library_of_source.cmake"),
            Self::Release(_) => include_str!("../../examples/controllers/library_of_release.cmake"),
        }
    }

    fn above(start: &Path) -> Option<Self> {
        start.ancestors().find_map(Self::at)
    }

    fn at(folder: &Path) -> Option<Self> {
        let has = |path: &str| folder.join(path).is_file();
        if has("rig/bindings/interface/masseter.h") {
            Some(Self::Source(folder.to_owned()))
        } else if has("include/masseter.h") && has("lib/pkgconfig/masseter.pc") {
            Some(Self::Release(folder.to_owned()))
        } else {
            None
        }
    }
}

/// The wheel in a folder.
fn wheel(folder: &Path) -> Option<PathBuf> {
    let is_wheel = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with("masseter-") && path.extension().is_some_and(|extension| extension == "whl")
    };
    fs::read_dir(folder).ok()?.filter_map(|entry| Some(entry.ok()?.path())).find(is_wheel)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with_files(files: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for file in files {
            let path = folder.path().join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "").unwrap();
        }
        folder
    }

    const RELEASE: [&str; 4] = [
        "bin/masseter",
        "include/masseter.h",
        "lib/pkgconfig/masseter.pc",
        "masseter-0.1.0-cp311-abi3-any.whl",
    ];

    #[test]
    fn the_nearest_folder_above_the_command_counts() {
        let outer = with_files(&["rig/bindings/interface/masseter.h", "target/debug/masseter"]);
        let source = Some(Sdk::Source(outer.path().to_owned()));
        assert_eq!(Sdk::above(&outer.path().join("target/debug/masseter")), source);
        let inner = outer.path().join("target/made");
        fs::rename(with_files(&RELEASE).keep(), &inner).unwrap();
        assert_eq!(Sdk::above(&inner.join("bin/masseter")), Some(Sdk::Release(inner)));
    }

    #[test]
    fn a_release_has_a_wheel_and_no_crates() {
        let folder = with_files(&RELEASE);
        let release = Sdk::new(Some(folder.path())).unwrap();
        assert_eq!(release.python_package().unwrap(), folder.path().join(RELEASE[3]));
        let refused = release.demand_crates().unwrap_err().to_string();
        assert!(refused.contains("give a checkout by --sdk"), "{refused}");
        fs::remove_file(folder.path().join(RELEASE[3])).unwrap();
        assert!(matches!(release.python_package(), Err(SdkError::NoWheel(_))));
    }

    #[test]
    fn a_folder_of_anything_else_is_refused() {
        let folder = with_files(&["include/masseter.h"]);
        assert!(matches!(Sdk::new(Some(folder.path())), Err(SdkError::Neither(_))));
    }
}
