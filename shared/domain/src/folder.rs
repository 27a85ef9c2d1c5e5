//! The private folder of locks and iceoryx2's files, and the errors of a domain and its files. No other user may hold a
//! lock, squat a name or read a file in the folder.
//!
//! The folder is `masseter` below the session's `XDG_RUNTIME_DIR`, `/run/masseter` of root, or `/dev/shm/masseter-UID`.
//! If another user has taken that name, the folder is `/dev/shm/masseter-UID-1`, or a later number.

use std::fs::{self, DirBuilder, File, Metadata, OpenOptions};
use std::io::{self, ErrorKind, Read};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::{env, iter};

use masseter_scenario::input::excerpt;
use rustix::{fs::Mode, process::geteuid};

const ONLY_OWNER: Mode = Mode::RWXU;
/// Permissions of group and others.
const OF_OTHERS: u32 = 0o077;
const WRITE_OF_OTHERS: u32 = 0o022;
/// Longest session folder, bytes. iceoryx2 aborts on paths of more than 255 bytes, and needs most of them for its own
/// names.
pub(crate) const LONGEST_SESSION_FOLDER: usize = 40;
/// Most folders of a user in `/dev/shm`, so that a taken name does not stop another user.
const FOLDERS: usize = 8;

/// Why the claim or the removal of a domain fails.
#[derive(Debug, thiserror::Error)]
pub enum DomainError {
    /// Another run uses the name.
    #[error("a rig named '{0}' is running; wait for it, stop it, or give this one another --name")]
    InUse(String),
    /// The id is not valid as a file name.
    #[error("'{0}' cannot name a rig: use 1 to 32 letters, digits, '-' or '_'")]
    BadName(String),
    /// Another process claims or sweeps domains for too long.
    #[error("{holder} holds the lock {path} for more than 5 s; end it, or let it go on")]
    Busy {
        /// The lock.
        path: PathBuf,
        /// The process that holds it.
        holder: String,
    },
    /// Other users can read or replace the files of a run.
    #[error(
        "{path} is not a private folder of this user (mode 0700): remove it, or have root remove it, or set XDG_RUNTIME_DIR to a private folder{passed_over}"
    )]
    NotPrivate {
        /// The folder, or the file with its name.
        path: PathBuf,
        /// The reason why the session's folder cannot be used, if there is one.
        passed_over: String,
    },
    /// This process uses a file of another user.
    #[error("another user has made {0}: start the rig again, whose files then have other names")]
    Foreign(PathBuf),
    /// This process uses a removed file with an unknown owner.
    #[error(
        "{0} was removed while the rig started, as when one of its processes is killed: start the rig again"
    )]
    Gone(PathBuf),
    /// The file system refused.
    #[error("cannot {action} {path}: {error}")]
    File {
        /// The action.
        action: &'static str,
        /// The path.
        path: PathBuf,
        /// The system's error.
        error: io::Error,
    },
}

/// The error of a file, for `map_err`.
pub fn file_error(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> DomainError {
    move |error| DomainError::File { action, path: path.to_owned(), error }
}

/// The verified folder, created if necessary.
///
/// # Errors
/// [`DomainError::NotPrivate`] if every possible folder belongs to other users or is open to them.
pub(crate) fn folder() -> Result<PathBuf, DomainError> {
    folders().map(|mut folders| folders.swap_remove(0))
}

/// The folder, and further folders of earlier runs.
///
/// # Errors
/// As [`folder`].
pub(crate) fn folders() -> Result<Vec<PathBuf>, DomainError> {
    let own = format!("/dev/shm/masseter-{}", geteuid().as_raw());
    let others = (1..FOLDERS).map(|number| format!("{own}-{number}").into());
    let of_user: Vec<PathBuf> = iter::once(own.clone().into()).chain(others).collect();
    choose(env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from), &of_user)
}

/// Skips a session folder of another user, as after `su`. Existing folders of the user come first, so that the choice
/// stays when another user gives a name back.
fn choose(session: Option<PathBuf>, of_user: &[PathBuf]) -> Result<Vec<PathBuf>, DomainError> {
    let passed_over = session.as_deref().and_then(unusable);
    let of_session = session.filter(|_| passed_over.is_none()).map(|session| session.join("masseter"));
    let of_root = geteuid().is_root().then(|| PathBuf::from("/run/masseter"));
    let preferred = of_session.or(of_root).filter(|path| make(path).is_ok());
    let candidates = preferred.map_or_else(|| of_user.to_vec(), |path| vec![path]);
    let found = private_ones(&candidates)?;
    if found.is_empty() {
        let (path, passed_over) = (candidates[0].clone(), passed_over.unwrap_or_default());
        return Err(DomainError::NotPrivate { path, passed_over });
    }
    Ok(found)
}

/// The private folders among these, otherwise the first new folder; none if all names are taken.
fn private_ones(folders: &[PathBuf]) -> Result<Vec<PathBuf>, DomainError> {
    let mut found = Vec::new();
    for path in folders {
        found.extend(make_folder_private(path)?.then(|| path.clone()));
    }
    for path in folders {
        if found.is_empty() {
            make(path).map_err(file_error("create", path))?;
            found.extend(make_folder_private(path)?.then(|| path.clone()));
        }
    }
    Ok(found)
}

/// Whether a folder is private. Takes the rights of others first if these rights do not allow writing.
fn make_folder_private(folder: &Path) -> Result<bool, DomainError> {
    if is_own_folder_without(WRITE_OF_OTHERS, folder) {
        fs::set_permissions(folder, PermissionsExt::from_mode(0o700))
            .map_err(file_error("make private", folder))?;
    }
    Ok(is_private(folder))
}

/// The reason why a session's folder is skipped, if it is.
fn unusable(session: &Path) -> Option<String> {
    let length = session.as_os_str().len();
    let reason = if !session.is_absolute() {
        "it is no absolute path".to_owned()
    } else if length > LONGEST_SESSION_FOLDER {
        format!("its path has {length} bytes, at most {LONGEST_SESSION_FOLDER} are of use")
    } else {
        match fs::symlink_metadata(session) {
            Err(error) => error.to_string(),
            Ok(found) if !found.is_dir() => "it is no folder".to_owned(),
            Ok(found) if found.uid() != geteuid().as_raw() => {
                format!("it is user {}'s, not {}'s", found.uid(), geteuid().as_raw())
            }
            Ok(found) if found.mode() & OF_OTHERS != 0 => {
                format!("its mode is {:04o}, not 0700", found.mode() & 0o7777)
            }
            Ok(_) => return None,
        }
    };
    Some(format!("; XDG_RUNTIME_DIR = {} is passed over: {reason}", excerpt(&session.to_string_lossy())))
}

fn is_private(path: &Path) -> bool {
    is_own_folder_without(OF_OTHERS, path)
}

/// Whether the path is a folder of this user, not a link, without these rights for others.
fn is_own_folder_without(rights: u32, path: &Path) -> bool {
    fs::symlink_metadata(path)
        .is_ok_and(|found| found.is_dir() && found.uid() == geteuid().as_raw() && found.mode() & rights == 0)
}

/// The metadata of a file of this user; none for a link, another user's file, or a missing file.
pub(crate) fn own_file(path: &Path) -> Option<Metadata> {
    fs::symlink_metadata(path).ok().filter(is_own)
}

/// Whether the path is a file of this user, and no link.
pub(crate) fn is_own(found: &Metadata) -> bool {
    found.is_file() && found.uid() == geteuid().as_raw()
}

/// Takes the rights of others from a file of this user; leaves other files alone.
pub(crate) fn make_private(path: &Path) -> Result<(), DomainError> {
    match own_file(path) {
        Some(found) if found.mode() & OF_OTHERS != 0 => {
            let made = fs::set_permissions(path, PermissionsExt::from_mode(0o600));
            made.map_err(file_error("make private", path))
        }
        _ => Ok(()),
    }
}

/// Makes a folder for its owner only, unless the name is taken.
pub(crate) fn make(path: &Path) -> io::Result<()> {
    match DirBuilder::new().mode(ONLY_OWNER.bits()).create(path) {
        Err(error) if error.kind() != ErrorKind::AlreadyExists => Err(error),
        _ => Ok(()),
    }
}

/// Opens a file for its owner only, or creates the file. Follows no link and truncates nothing.
pub(crate) fn open(path: &Path) -> Result<File, DomainError> {
    let mut options = OpenOptions::new();
    options.read(true).write(true).create(true).truncate(false);
    options.mode(0o600).custom_flags(libc::O_NOFOLLOW).open(path).map_err(file_error("create", path))
}

/// 16 hexadecimal digits that nobody can guess.
///
/// # Errors
/// When `/dev/urandom` cannot be read.
pub fn secret() -> io::Result<String> {
    let mut bytes = [0; 8];
    File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    Ok(format!("{:016x}", u64::from_ne_bytes(bytes)))
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    /// A folder with a short path and this mode, removed with the test.
    struct Session(PathBuf);

    impl Session {
        fn new(name: &str, mode: u32) -> Self {
            let path = env::temp_dir().join(format!("m-{name}-{}", std::process::id()));
            fs::create_dir(&path).unwrap();
            fs::set_permissions(&path, PermissionsExt::from_mode(mode)).unwrap();
            Self(path)
        }
    }

    impl Drop for Session {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    #[test]
    fn a_private_session_folder_is_used_and_another_one_passed_over() {
        let (own, open) = (Session::new("own", 0o700), Session::new("open", 0o750));
        let found = choose(Some(own.0.clone()), &[]).unwrap();
        assert_eq!(found, [own.0.join("masseter")]);
        assert!(is_private(&found[0]));
        let long = own.0.join("x".repeat(99));
        for (unusable, reason) in [
            (open.0.clone(), "its mode is 0750, not 0700"),
            ("relative".into(), "it is no absolute path"),
            (long, "bytes, at most 40 are of use"),
            (own.0.join("none"), "No such file"),
        ] {
            let said = super::unusable(&unusable).unwrap();
            assert!(said.contains(reason), "{said}");
            let of_user = [own.0.join("user")];
            assert!(!choose(Some(unusable), &of_user).unwrap().contains(&own.0.join("masseter")));
        }
        assert_eq!(super::unusable(&own.0), None);
    }

    #[test]
    fn a_folder_that_is_taken_gives_way_to_the_next_for_as_long_as_that_is_there() {
        let session = Session::new("taken", 0o700);
        let [taken, next, third] = ["a", "b", "c"].map(|name| session.0.join(name));
        let of_user = [taken.clone(), next.clone(), third.clone()];
        fs::write(&taken, "").unwrap();
        let chosen = || private_ones(&of_user).unwrap();
        assert_eq!(chosen(), vec![next.clone()]);
        fs::remove_file(&taken).unwrap();
        assert_eq!(chosen(), vec![next.clone()]);
        make(&third).unwrap();
        assert_eq!(chosen(), vec![next, third]);
    }

    #[test]
    fn a_folder_that_others_may_write_or_a_link_is_refused() {
        let session = Session::new("refused", 0o700);
        let folder = session.0.join("masseter");
        make(&folder).unwrap();
        let refused = || matches!(choose(Some(session.0.clone()), &[]), Err(DomainError::NotPrivate { path, .. }) if path == folder);
        fs::set_permissions(&folder, PermissionsExt::from_mode(0o755)).unwrap();
        assert!(!refused() && is_private(&folder), "others only looked into it");
        fs::set_permissions(&folder, PermissionsExt::from_mode(0o775)).unwrap();
        assert!(refused());
        fs::remove_dir(&folder).unwrap();
        symlink(&session.0, &folder).unwrap();
        assert!(refused());
    }

    #[test]
    fn a_file_keeps_its_content_and_is_no_link() {
        let session = Session::new("file", 0o700);
        let (file, link) = (session.0.join("file"), session.0.join("link"));
        fs::write(&file, "content").unwrap();
        open(&file).unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"content");
        symlink(&file, &link).unwrap();
        assert!(open(&link).is_err());
        assert_eq!(open(&session.0.join("new")).unwrap().metadata().unwrap().mode() & 0o777, 0o600);
    }

    #[test]
    fn no_secret_comes_twice() {
        assert_ne!(secret().unwrap(), secret().unwrap());
    }
}
