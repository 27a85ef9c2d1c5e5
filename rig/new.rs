//! `masseter new controller`: a project with a working pose controller in the user's language. Nothing is built here.

use std::path::{Path, PathBuf};

use anyhow::ensure;
use clap::{Args, Subcommand, ValueEnum};
use masseter_terminal::{Exit, result_line};

use crate::starter::{StarterFile, as_program, lay_down, quoted};

/// What to make.
#[derive(Debug, Clone, Subcommand)]
pub(crate) enum NewVerb {
    /// A project with a working pose controller
    Controller(NewControllerArgs),
}

/// The arguments of `new controller`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example:\n  masseter new controller --lang cpp my_controller")]
pub(crate) struct NewControllerArgs {
    /// New or empty folder
    folder: PathBuf,
    /// Language
    #[arg(long, value_enum)]
    lang: Language,
    /// Masseter's source [default: that of this program]
    #[arg(long, value_name = "DIR")]
    source: Option<PathBuf>,
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

/// A project: what it is, how it is built in its folder, what is built, and its files; the first one has the law.
struct Project {
    about: &'static str,
    build: &'static str,
    program: &'static str,
    files: &'static [(&'static str, &'static str)],
}

const README: &str = include_str!("../examples/controllers/README.md");
const CMAKE: &str = "cmake -S . -B build && cmake --build build";

const PIP: &str =
    "python3 -m venv .venv && .venv/bin/pip install @SOURCE@/shared/python && chmod +x controller.py";

impl Language {
    const fn project(self) -> Project {
        match self {
            Self::Rust => Project {
                about: "Rust, the crates masseter-controller, masseter-model and masseter-runtime",
                build: "cargo build --release",
                program: "target/release/my_controller",
                files: &[
                    ("src/main.rs", include_str!("../examples/controllers/rust/src/main.rs")),
                    ("Cargo.toml", include_str!("../examples/controllers/rust/Cargo.toml")),
                    // Two versions of iceoryx2 do not understand each other.
                    ("Cargo.lock", include_str!("../Cargo.lock")),
                ],
            },
            Self::Cpp => Project {
                about: "C++17, the header masseter.hpp",
                build: CMAKE,
                program: "build/my_controller",
                files: &[
                    ("controller.cpp", include_str!("../examples/controllers/cpp/controller.cpp")),
                    ("CMakeLists.txt", include_str!("../examples/controllers/cpp/CMakeLists.txt")),
                ],
            },
            Self::C => Project {
                about: "C11, the header masseter.h",
                build: CMAKE,
                program: "build/my_controller",
                files: &[
                    ("controller.c", include_str!("../examples/controllers/c/controller.c")),
                    ("CMakeLists.txt", include_str!("../examples/controllers/c/CMakeLists.txt")),
                ],
            },
            Self::Python => Project {
                about: "Python, the package masseter",
                build: PIP,
                program: "controller.py",
                files: &[
                    ("controller.py", include_str!("../examples/controllers/python/controller.py")),
                    ("pyproject.toml", include_str!("../examples/controllers/python/pyproject.toml")),
                ],
            },
        }
    }
}

/// Writes the project, and prints the next commands.
pub(crate) fn new(NewVerb::Controller(args): &NewVerb) -> anyhow::Result<Exit> {
    let source = args.source.clone().unwrap_or_else(|| env!("CARGO_MANIFEST_DIR").into());
    ensure!(
        source.join("shared/interface/masseter.h").is_file(),
        "{} is not Masseter's source: give it by --source",
        source.display()
    );
    let (source, folder) = (std::path::absolute(source)?, std::path::absolute(&args.folder)?);
    let project = args.lang.project();
    lay_down(&args.folder, &files(&project, &source, &folder))?;
    result_line!(
        "{}: the controller; README.md has the next steps\n\
         next: (cd {} && {}) && masseter run --controller {}",
        args.folder.join(project.files[0].0).display(),
        quoted(&args.folder),
        project.build.replace("@SOURCE@", &quoted(&source)),
        quoted(&as_program(&args.folder.join(project.program)))
    )?;
    Ok(Exit::Passed)
}

fn files(project: &Project, source: &Path, folder: &Path) -> Vec<StarterFile> {
    let readme = README
        .replace("@ABOUT@", project.about)
        .replace("@BUILD@", project.build)
        .replace("@PROGRAM@", &format!("./{}", project.program))
        .replace("@FILE@", project.files[0].0);
    let files = project.files.iter().map(|&(path, content)| (path, content.to_owned()));
    let in_place = |(path, content): (_, String)| StarterFile {
        path,
        content: content
            .replace("@SOURCE@", &source.display().to_string())
            .replace("@TARGET@", &source.join("target").display().to_string())
            .replace("@FOLDER@", &folder.display().to_string()),
    };
    files.chain([("README.md", readme)]).map(in_place).collect()
}
