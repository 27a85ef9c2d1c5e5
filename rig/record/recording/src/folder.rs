//! The folder of a run and the names of its files. Also new files and folders for the output of a command, which
//! creates them before it computes. Existing ones are never overwritten.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use masseter_runtime::clock;

/// The folder of a run.
///
/// ```
/// use masseter_recording::RunFolder;
///
/// let parent = tempfile::tempdir()?;
/// let folder = RunFolder::create(&parent.path().join("run"))?;
/// folder.keep(&folder.scenario(), "seed = 1\n")?;
/// assert!(RunFolder::open(folder.path()).is_err(), "there is no recording in it yet");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunFolder(PathBuf);

/// Why a run folder could not be made or opened.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// It is no run folder.
    #[error("{} is no folder with a recording.mcap; name the folder of a run", .0.display())]
    NoRun(PathBuf),
    /// The user may not look into it.
    #[error(
        "{} cannot be read: {error}; its owner can make it readable: chmod -R a+rX, or masseter run --readable-by", path.display()
    )]
    Unreadable {
        /// The folder.
        path: PathBuf,
        /// The system's reason.
        error: io::Error,
    },
    /// It could not be made.
    #[error(transparent)]
    New(#[from] OutputError),
}

/// The time as names of folders have it, such as 20260131T093000.000Z.
pub fn time_in_names() -> String {
    let time = humantime::format_rfc3339_millis(UNIX_EPOCH + clock::wall_time()).to_string();
    time.replace([':', '-'], "")
}

impl RunFolder {
    /// Creates `<parent>/<UTC time>-<name>/` and points `<parent>/latest` at it.
    pub fn create_in(parent: &Path, name: &str) -> Result<Self, FolderError> {
        let file_name = format!("{}-{name}", time_in_names());
        let folder = Self::create(&parent.join(&file_name))?;
        let latest = parent.join("latest");
        // A folder of the user under that name stays; the report names the run.
        if latest.is_symlink() || !latest.exists() {
            let _ = fs::remove_file(&latest);
            let _ = symlink(&file_name, &latest);
        }
        Ok(folder)
    }

    /// Creates this very folder, which must not exist.
    pub fn create(path: &Path) -> Result<Self, FolderError> {
        new_folder(path)?;
        let folder = path.canonicalize().map_err(OutputError::creating(path))?;
        folder.parent().map(secure_names);
        Ok(Self(folder))
    }

    /// The folder of a run that is to be recorded in this file.
    pub fn of_recording(recording: &Path) -> Self {
        Self(recording.parent().map_or_else(PathBuf::new, Path::to_owned))
    }

    /// Opens the folder of a past run.
    pub fn open(path: &Path) -> Result<Self, FolderError> {
        let folder = Self(path.to_owned());
        match fs::metadata(folder.recording()) {
            Ok(file) if file.is_file() => Ok(folder),
            Err(error) if error.kind() == ErrorKind::PermissionDenied => {
                Err(FolderError::Unreadable { path: path.to_owned(), error })
            }
            _ => Err(FolderError::NoRun(path.to_owned())),
        }
    }

    /// Writes one of its files completely or not at all, so that a power cut leaves the scenario and the manifest of a
    /// recording.
    pub fn keep(&self, path: &Path, text: &str) -> io::Result<()> {
        let unfinished = path.with_extension("part");
        let write = || {
            let mut file = File::create(&unfinished)?;
            file.write_all(text.as_bytes())?;
            file.sync_all()?;
            fs::rename(&unfinished, path)
        };
        write().inspect_err(|_| {
            let _ = fs::remove_file(&unfinished);
        })?;
        secure_names(&self.0);
        Ok(())
    }

    /// The folder itself.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// The scenario as resolved; it runs the same again.
    pub fn scenario(&self) -> PathBuf {
        self.0.join("scenario.toml")
    }

    /// Scenario, machine, scheduling and end of the run.
    pub fn manifest(&self) -> PathBuf {
        self.0.join("manifest.json")
    }

    /// Every message of the run.
    pub fn recording(&self) -> PathBuf {
        self.0.join("recording.mcap")
    }

    /// Verdict and figures.
    pub fn summary(&self) -> PathBuf {
        self.0.join("summary.json")
    }

    /// Another file of this name.
    pub fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

/// Makes the names in a folder survive a power cut, on file systems that support it.
fn secure_names(folder: &Path) {
    let _ = File::open(folder).and_then(|folder| folder.sync_all());
}

/// Why a file or folder cannot be created.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// It exists.
    #[error("{} exists and is not overwritten; choose another --out", .0.display())]
    Exists(PathBuf),
    /// The system refused to create it.
    #[error("cannot create {}: {error}", path.display())]
    Create {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        #[source]
        error: io::Error,
    },
}

impl OutputError {
    /// Converts the system's error for `path`.
    pub fn creating(path: &Path) -> impl Fn(io::Error) -> Self {
        move |error| match error.kind() {
            ErrorKind::AlreadyExists => Self::Exists(path.to_owned()),
            _ => Self::Create { path: path.to_owned(), error },
        }
    }
}

/// Creates an empty file.
///
/// # Errors
/// When it exists, or the system refuses it.
pub fn new_file(path: &Path) -> Result<File, OutputError> {
    File::create_new(path).map_err(OutputError::creating(path))
}

/// Creates a folder, and missing folders above it.
///
/// # Errors
/// When it exists, or the system refuses it.
pub fn new_folder(path: &Path) -> Result<(), OutputError> {
    if let Some(parent) = path.parent() {
        fs::create_dir_all(parent).map_err(|error| OutputError::Create { path: path.to_owned(), error })?;
    }
    fs::create_dir(path).map_err(OutputError::creating(path))
}
