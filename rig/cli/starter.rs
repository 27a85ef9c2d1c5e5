//! Folders to start from: `masseter init` lays down a scenario, a motion and a CI workflow, `masseter new controller` a
//! project with a working controller in the user's language. Nothing is replaced, and nothing is built here.

use std::fs::{self, File};
use std::io::{ErrorKind, Write};
use std::os::unix::ffi::OsStrExt;

use clap::{Subcommand, ValueEnum};

use crate::prelude::*;

/// The scenario, as a path within the folder.
const SCENARIO: &str = "scenario.toml";
/// Path within the folder, content, and what a user needs to know about the file.
const INIT_FILES: [(&str, &str, &str); 3] = [
    (SCENARIO, include_str!("../../examples/start.toml"), "the motion, a gain and the limits of a run"),
    ("jaw.csv", include_str!("../../examples/jaw.csv"), "the motion, made up"),
    (
        ".github/workflows/masseter.yml",
        include_str!("../../examples/workflow.yml"),
        "the folder's scenarios in CI; enter where Masseter's source is",
    ),
];

/// The arguments of `init`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example:\n  masseter init rig\n  masseter run rig/scenario.toml")]
pub(super) struct InitArgs {
    /// New or empty folder
    folder: PathBuf,
}

/// Writes every file, and prints the next command.
pub(super) fn init(InitArgs { folder }: &InitArgs) -> anyhow::Result<Exit> {
    lay_down(
        folder,
        &INIT_FILES.map(|(path, content, _)| StarterFile { path, content: content.to_owned() }),
    )?;
    for (name, _, about) in INIT_FILES {
        result_line!("{}: {about}", folder.join(name).display())?;
    }
    result_line!("next: masseter run {}", quoted(&folder.join(SCENARIO)))?;
    Ok(Exit::Passed)
}

/// What to make.
#[derive(Debug, Clone, Subcommand)]
pub(super) enum NewVerb {
    /// A project with a working controller
    Controller(NewControllerArgs),
}

/// The arguments of `new controller`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example:\n  masseter new controller --lang cpp my_controller")]
pub(super) struct NewControllerArgs {
    /// New or empty folder
    folder: PathBuf,
    /// Language
    #[arg(long, value_enum)]
    lang: Language,
    /// What the controller does itself
    #[arg(long, value_enum, default_value = "pose")]
    kind: Kind,
    /// Masseter's source, or a folder of scripts/release [default: the one above this command or above the current folder]
    #[arg(long, value_name = "DIR", alias = "source")]
    sdk: Option<PathBuf>,
}

/// A language with a project.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Language {
    /// Rust, with Cargo
    Rust,
    /// C++17, with CMake
    Cpp,
    /// C11, with CMake
    C,
    /// Python 3.11 or later, with pip
    Python,
}

/// What a controller does itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Kind {
    /// A law that returns a pose; the rig does the rest
    Pose,
    /// Everything: it commands the drives
    Drives,
}

impl Kind {
    const fn readme(self) -> &'static str {
        match self {
            Self::Pose => include_str!("../../examples/controllers/README.md"),
            Self::Drives => include_str!("../../examples/controllers/drives/README.md"),
        }
    }
}

/// A project: what it is, how it is built in its folder, what is built, the controller, and the other files.
struct Project {
    about: &'static str,
    build: &'static str,
    program: &'static str,
    /// Path within the folder.
    controller: &'static str,
    files: &'static [(&'static str, &'static str)],
}

const CMAKE: &str = "cmake -S . -B build && cmake --build build";

const PIP: &str = "python3 -m venv .venv && .venv/bin/pip install @PACKAGE@ && chmod +x controller.py";

impl Language {
    const fn project(self) -> Project {
        match self {
            Self::Rust => Project {
                about: "Rust, the crates masseter-controller, masseter-model and masseter-runtime",
                build: "cargo build --release",
                program: "target/release/my_controller",
                controller: "src/main.rs",
                files: &[
                    ("Cargo.toml", include_str!("../../examples/controllers/rust/Cargo.toml")),
                    // Two versions of iceoryx2 do not understand each other.
                    ("Cargo.lock", include_str!("../../Cargo.lock")),
                ],
            },
            Self::Cpp => Project {
                about: "C++17, the header masseter.hpp",
                build: CMAKE,
                program: "build/my_controller",
                controller: "controller.cpp",
                files: &[("CMakeLists.txt", include_str!("../../examples/controllers/cpp/CMakeLists.txt"))],
            },
            Self::C => Project {
                about: "C11, the header masseter.h",
                build: CMAKE,
                program: "build/my_controller",
                controller: "controller.c",
                files: &[("CMakeLists.txt", include_str!("../../examples/controllers/c/CMakeLists.txt"))],
            },
            Self::Python => Project {
                about: "Python, the package masseter",
                build: PIP,
                program: "controller.py",
                controller: "controller.py",
                files: &[(
                    "pyproject.toml",
                    include_str!("../../examples/controllers/python/pyproject.toml"),
                )],
            },
        }
    }

    const fn controller(self, kind: Kind) -> &'static str {
        match (self, kind) {
            (Self::Rust, Kind::Pose) => include_str!("../../examples/controllers/rust/src/main.rs"),
            (Self::Cpp, Kind::Pose) => include_str!("../../examples/controllers/cpp/controller.cpp"),
            (Self::C, Kind::Pose) => include_str!("../../examples/controllers/c/controller.c"),
            (Self::Python, Kind::Pose) => include_str!("../../examples/controllers/python/controller.py"),
            (Self::Rust, Kind::Drives) => include_str!("../../examples/controllers/drives/rust/main.rs"),
            (Self::Cpp, Kind::Drives) => include_str!("../../examples/controllers/drives/cpp/controller.cpp"),
            (Self::C, Kind::Drives) => include_str!("../../examples/controllers/drives/c/controller.c"),
            (Self::Python, Kind::Drives) => {
                include_str!("../../examples/controllers/drives/python/controller.py")
            }
        }
    }
}

/// Writes the project, and prints the next commands.
pub(super) fn new(NewVerb::Controller(args): &NewVerb) -> anyhow::Result<Exit> {
    let sdk = super::sdk::Sdk::new(args.sdk.as_deref())?;
    let package = match args.lang {
        Language::Rust => sdk.demand_crates().map(|()| PathBuf::new())?,
        Language::Python => sdk.python_package()?,
        Language::C | Language::Cpp => PathBuf::new(),
    };
    let folder = std::path::absolute(&args.folder)?;
    let project = args.lang.project();
    let build = project.build.replace("@PACKAGE@", &quoted(&package));
    let readme = args.kind.readme();
    let readme = readme
        .replace("@ABOUT@", project.about)
        .replace("@BUILD@", &build)
        .replace("@PROGRAM@", &format!("./{}", project.program))
        .replace("@FILE@", project.controller);
    let files = project.files.iter().map(|&(path, content)| (path, content.to_owned()));
    let in_place = |(path, content): (_, String)| StarterFile {
        path,
        content: with_interpreter(content, &folder)
            .replace("@LIBRARY@", sdk.cmake())
            .replace("@SOURCE@", &sdk.folder().display().to_string())
            .replace("@PACKAGE@", &in_url(&package))
            .replace("@FOLDER@", &folder.display().to_string()),
    };
    let files = files
        .chain([(project.controller, args.lang.controller(args.kind).to_owned()), ("README.md", readme)]);
    lay_down(&args.folder, &files.map(in_place).collect::<Vec<_>>())?;
    result_line!(
        "{}: the controller; README.md has the next steps\n\
         next: (cd {} && {build}) && masseter run --controller {}",
        args.folder.join(project.controller).display(),
        quoted(&args.folder),
        quoted(&as_program(&args.folder.join(project.program)))
    )?;
    Ok(Exit::Passed)
}

/// The content with a first line that the kernel understands. Its line for an interpreter ends at the first space, and has a
/// greatest length. Where that does not do, a shell starts the interpreter beside the file; so the shell reads no character of the path.
fn with_interpreter(content: String, folder: &Path) -> String {
    const KERNELS: &str = "#!@FOLDER@/.venv/bin/python\n";
    const SHELLS: &str = "#!/bin/sh\n'''exec' \"${0%/*}/.venv/bin/python\" \"$0\" \"$@\"\n' '''\n";
    const MOST_BYTES: usize = 127;
    let path = folder.display().to_string();
    let is_kernels = path.len() + KERNELS.len() <= MOST_BYTES && !path.contains(char::is_whitespace);
    if is_kernels { content } else { content.replacen(KERNELS, SHELLS, 1) }
}

/// A path within a URL: what is neither a letter, a digit, a slash nor one of `-._~` is percent-encoded.
fn in_url(path: &Path) -> String {
    let encoded = path.as_os_str().as_bytes().iter().map(|&byte| match byte {
        b'/' | b'-' | b'.' | b'_' | b'~' => char::from(byte).to_string(),
        _ if byte.is_ascii_alphanumeric() => char::from(byte).to_string(),
        _ => format!("%{byte:02X}"),
    });
    encoded.collect()
}

/// A file of such a folder: its path within, and its content.
struct StarterFile {
    path: &'static str,
    content: String,
}

/// Writes every file, or none.
fn lay_down(folder: &Path, files: &[StarterFile]) -> anyhow::Result<()> {
    refuse_content(folder)?;
    for (index, StarterFile { path, content }) in files.iter().enumerate() {
        let path = folder.join(path);
        if let Err(error) = write_new(&path, content) {
            // So that the same command can be given again.
            files[..=index].iter().for_each(|file| drop(fs::remove_file(folder.join(file.path))));
            return Err(error).with_context(|| format!("cannot write {}", path.display()));
        }
    }
    Ok(())
}

/// Refuses a folder with anything in it.
fn refuse_content(folder: &Path) -> anyhow::Result<()> {
    match fs::read_dir(folder) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        Err(error) => Err(error).with_context(|| format!("cannot read the folder {}", folder.display())),
        Ok(mut entries) => match entries.next() {
            None => Ok(()),
            Some(_) => bail!("{} is not empty, and nothing is replaced; name a new folder", folder.display()),
        },
    }
}

/// Writes a new file, and the folders above it.
fn write_new(path: &Path, content: &str) -> std::io::Result<()> {
    path.parent().map_or(Ok(()), fs::create_dir_all)?;
    File::create_new(path)?.write_all(content.as_bytes())
}

/// A path as a shell takes it for one word that is no option.
fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    crate::run::runner::word(&if text.starts_with('-') { format!("./{text}") } else { text })
}

/// A path as a program in this folder: a shell searches PATH for a name alone.
fn as_program(path: &Path) -> PathBuf {
    if path.is_absolute() { path.to_owned() } else { Path::new(".").join(path) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_command_is_one_that_a_shell_runs() {
        for (path, expected) in [
            ("rig/scenario.toml", "rig/scenario.toml"),
            ("my rig; rm -x/s.toml", "'my rig; rm -x/s.toml'"),
            ("it's/s.toml", "'it'\\''s/s.toml'"),
            ("-dash/s.toml", "./-dash/s.toml"),
        ] {
            assert_eq!(quoted(Path::new(path)), expected);
        }
    }

    #[test]
    fn a_path_in_a_url_is_percent_encoded() {
        for (path, expected) in [
            ("/opt/masseter-0.1_a.whl", "/opt/masseter-0.1_a.whl"),
            ("/größe 2/a#b%c?\"d\\", "/gr%C3%B6%C3%9Fe%202/a%23b%25c%3F%22d%5C"),
        ] {
            assert_eq!(in_url(Path::new(path)), expected);
        }
    }
}
