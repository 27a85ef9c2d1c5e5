//! The folder of a run and the names of its files. Also new files and folders for the output of a command, which
//! creates them before it computes. Existing ones are never overwritten.

use std::fs::{self, File, TryLockError};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::{os::unix::fs::symlink, time::UNIX_EPOCH};

use masseter_runtime::clock;

const MANIFEST: &str = "manifest.json";
const RECORDING: &str = "recording.mcap";

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

/// Why a run folder could not be made, or a past run is not found.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// Nothing has the name.
    #[error("{} does not exist: name the folder of a run, or its {RECORDING}", .0.display())]
    Missing(PathBuf),
    /// A link leads nowhere.
    #[error("{} is a link to {}, which does not exist any more: name another run", path.display(), target.display())]
    LostTarget {
        /// The link.
        path: PathBuf,
        /// What it names.
        target: PathBuf,
    },
    /// It is something else.
    #[error("{} is no run: it has neither a {RECORDING} nor a {MANIFEST}; name the folder of a run", .0.display())]
    NoRun(PathBuf),
    /// The recorder has written nothing, as when it or the run ended early.
    #[error("{} does not exist: the run ended before its recorder wrote; {MANIFEST} says how it ended", .0.display())]
    Unwritten(PathBuf),
    /// A recording alone is no run.
    #[error("{} is no {RECORDING} with a {MANIFEST} beside it, so no whole run: name the folder of a run", .0.display())]
    NoFolder(PathBuf),
    /// The user may not look into it.
    #[error(
        "{} cannot be read: {error}; its owner can make it readable: chmod -R a+rX, or masseter run --readable-by", path.display()
    )]
    Unreadable {
        /// The folder or file.
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

/// The recording that a path names: the file itself or that in a run's folder, also through a link.
///
/// # Errors
/// [`FolderError`] names the missing file.
pub fn recording_at(path: &Path) -> Result<PathBuf, FolderError> {
    let refused = |error: io::Error| match (error.kind(), fs::read_link(path)) {
        (ErrorKind::NotFound, Err(_))
            if path.ends_with(RECORDING) && path.with_file_name(MANIFEST).exists() =>
        {
            FolderError::Unwritten(path.to_owned())
        }
        (ErrorKind::NotFound, Ok(target)) => FolderError::LostTarget { path: path.to_owned(), target },
        (ErrorKind::NotFound, Err(_)) => FolderError::Missing(path.to_owned()),
        _ => FolderError::Unreadable { path: path.to_owned(), error },
    };
    if !fs::metadata(path).map_err(refused)?.is_dir() {
        return Ok(path.to_owned());
    }
    let recording = path.join(RECORDING);
    match fs::metadata(&recording) {
        Ok(file) if file.is_file() => Ok(recording),
        Err(error) if error.kind() == ErrorKind::PermissionDenied => {
            Err(FolderError::Unreadable { path: path.to_owned(), error })
        }
        _ if path.join(MANIFEST).exists() => Err(FolderError::Unwritten(recording)),
        _ => Err(FolderError::NoRun(path.to_owned())),
    }
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
        let folder = recording.parent().filter(|folder| !folder.as_os_str().is_empty());
        Self(folder.unwrap_or(Path::new(".")).to_owned())
    }

    /// Opens a past run by its folder, by the recording in it, or by a link to either.
    ///
    /// # Errors
    /// [`FolderError`] names the missing file.
    pub fn open(path: &Path) -> Result<Self, FolderError> {
        let recording = recording_at(path)?;
        if recording != path {
            return Ok(Self(path.to_owned()));
        }
        // A link may lie elsewhere.
        let is_of_run = |file: &PathBuf| file.ends_with(RECORDING) && file.with_file_name(MANIFEST).exists();
        let found = [Some(path.to_owned()), path.canonicalize().ok()].into_iter().flatten().find(is_of_run);
        found.map(|file| Self::of_recording(&file)).ok_or(FolderError::NoFolder(recording))
    }

    /// Writes one of its files by [`write_whole`], so that a power cut leaves the scenario and the manifest of a recording.
    pub fn keep(&self, path: &Path, content: &(impl AsRef<[u8]> + ?Sized)) -> io::Result<()> {
        write_whole(path, content)
    }

    /// Shows others that its run goes on, until the file is dropped or the process has died. None where the file
    /// cannot be locked.
    pub fn occupy(&self) -> Option<File> {
        // Open for writing: NFS locks no other file.
        let scenario = File::options().read(true).write(true).open(self.scenario());
        scenario.ok().filter(|file| file.try_lock().is_ok())
    }

    /// Whether its run goes on.
    pub fn is_occupied(&self) -> bool {
        let scenario = File::open(self.scenario());
        scenario.is_ok_and(|file| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)))
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
        self.0.join(MANIFEST)
    }

    /// Every message of the run.
    pub fn recording(&self) -> PathBuf {
        self.0.join(RECORDING)
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

/// Writes a file completely or not at all, also when the power is cut.
pub fn write_whole(path: &Path, content: &(impl AsRef<[u8]> + ?Sized)) -> io::Result<()> {
    let unfinished = path.with_extension("part");
    let write = || {
        let mut file = File::create(&unfinished)?;
        file.write_all(content.as_ref())?;
        file.sync_all()?;
        fs::rename(&unfinished, path)
    };
    write().inspect_err(|_| {
        let _ = fs::remove_file(&unfinished);
    })?;
    path.parent().map(secure_names);
    Ok(())
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
    /// The path leads through a file.
    #[error("{} is no folder; choose another --out", .0.display())]
    NoFolder(PathBuf),
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
        fs::create_dir_all(parent).map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists | ErrorKind::NotADirectory => OutputError::NoFolder(parent.to_owned()),
            _ => OutputError::Create { path: path.to_owned(), error },
        })?;
    }
    fs::create_dir(path).map_err(OutputError::creating(path))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(path: &Path) -> String {
        RunFolder::open(path).unwrap_err().to_string()
    }

    #[test]
    fn a_run_has_many_names_and_one_folder() {
        let parent = tempfile::tempdir().unwrap();
        let [run, to_run, to_file] = ["run", "latest", "link.mcap"].map(|name| parent.path().join(name));
        let folder = RunFolder::create(&run).unwrap();
        fs::write(folder.manifest(), "{}").unwrap();
        fs::write(folder.recording(), "").unwrap();
        symlink("run", &to_run).unwrap();
        symlink("run/recording.mcap", &to_file).unwrap();
        let same = fs::canonicalize(&run).unwrap();
        for name in [&run, &to_run, &to_file, &run.join(RECORDING), &to_run.join(RECORDING)] {
            let opened = RunFolder::open(name).unwrap();
            assert_eq!(fs::canonicalize(opened.path()).unwrap(), same, "{}", name.display());
            assert_eq!(fs::canonicalize(recording_at(name).unwrap()).unwrap(), same.join(RECORDING));
        }
        assert_eq!(
            RunFolder::open(&to_run).unwrap().path(),
            to_run,
            "files are shown under the name that was given"
        );
    }

    #[test]
    fn a_recording_alone_can_be_read_but_is_no_run() {
        let parent = tempfile::tempdir().unwrap();
        let golden = parent.path().join("golden.mcap");
        fs::write(&golden, "").unwrap();
        assert_eq!(recording_at(&golden).unwrap(), golden);
        let said = refusal(&golden);
        assert!(said.contains("golden.mcap is no recording.mcap with a manifest.json beside it"), "{said}");
        fs::write(parent.path().join(MANIFEST), "{}").unwrap();
        assert_eq!(refusal(&golden), said, "a report of it would be one of another recording");
    }

    #[test]
    fn what_is_missing_is_said() {
        let parent = tempfile::tempdir().unwrap();
        let path = |name: &str| parent.path().join(name);
        assert!(refusal(&path("none")).contains("none does not exist: name the folder of a run"));
        symlink("gone", path("latest")).unwrap();
        assert!(refusal(&path("latest")).contains("latest is a link to gone, which does not exist any more"));
        let run = RunFolder::create(&path("run")).unwrap();
        assert!(refusal(run.path()).contains("run is no run: it has neither"), "{}", refusal(run.path()));
        fs::write(run.manifest(), "{}").unwrap();
        let said = refusal(run.path());
        assert!(
            said.contains("run/recording.mcap does not exist: the run ended before its recorder wrote"),
            "{said}"
        );
        assert_eq!(refusal(&run.recording()), said);
    }
}
