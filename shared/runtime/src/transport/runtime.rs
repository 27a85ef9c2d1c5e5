//! The private folder of locks and iceoryx2's files: no other user may hold a lock, squat a name or read a file in it. And
//! what can go wrong with a domain and its files.
//!
//! It is `masseter` below the session's `XDG_RUNTIME_DIR`, `/run/masseter` of root, or `/dev/shm/masseter-UID`. Where another
//! user has taken that name, it is `/dev/shm/masseter-UID-1`, or one of the next.

use std::env;
use std::fs::{self, DirBuilder, File, Metadata, OpenOptions};
use std::io::{self, ErrorKind, Read};
use std::iter;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

use masseter_scenario::input::excerpt;
use rustix::fs::Mode;
use rustix::process::geteuid;

const ONLY_OWNER: Mode = Mode::RWXU;
/// Permissions of group and others.
const OF_OTHERS: u32 = 0o077;
const WRITE_OF_OTHERS: u32 = 0o022;
/// Longest session folder, bytes: iceoryx2 aborts on paths of more than 255, and needs most of them for its own names.
pub(super) const LONGEST_SESSION_FOLDER: usize = 40;
/// Folders of a user in `/dev/shm`, so that nobody stops another user by taking one name.
const FOLDERS: usize = 8;

/// Why a domain could not be claimed or removed.
#[derive(Debug, thiserror::Error)]
pub enum DomainError {
    /// Another run uses the name.
    #[error("a rig named '{0}' is running; wait for it, stop it, or give this one another --name")]
    InUse(String),
    /// The id cannot be a file name.
    #[error("'{0}' cannot name a rig: use 1 to 32 letters, digits, '-' or '_'")]
    BadName(String),
    /// Another process claims or sweeps domains for longer than that takes.
    #[error("{holder} holds the lock {path} for more than 5 s; end it, or let it go on")]
    Busy {
        /// The lock.
        path: PathBuf,
        /// The process that holds it.
        holder: String,
    },
    /// Other users could read or replace the files of a run.
    #[error(
        "{path} is not a private folder of this user (mode 0700): remove it, or have root remove it, or set XDG_RUNTIME_DIR to a private folder{passed_over}"
    )]
    NotPrivate {
        /// The folder, or what has its name.
        path: PathBuf,
        /// Why the session's folder is of no use, if there is one.
        passed_over: String,
    },
    /// This process uses a file that is not this user's.
    #[error("another user has made {0}: start the rig again, whose files then have other names")]
    Foreign(PathBuf),
    /// This process uses a file that has been removed: nobody knows any more whose it was.
    #[error(
        "{0} was removed while the rig started, as when one of its processes is killed: start the rig again"
    )]
    Gone(PathBuf),
    /// The file system refused.
    #[error("cannot {action} {path}: {error}")]
    File {
        /// What was tried.
        action: &'static str,
        /// Where.
        path: PathBuf,
        /// What the system said.
        error: io::Error,
    },
}

pub(super) fn file_error(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> DomainError {
    move |error| DomainError::File { action, path: path.to_owned(), error }
}

/// The folder, made if it does not exist, and verified.
///
/// # Errors
/// [`DomainError::NotPrivate`] if other users made or may use every folder that it could be.
pub(super) fn folder() -> Result<PathBuf, DomainError> {
    folders().map(|mut folders| folders.swap_remove(0))
}

/// The folder, and further ones that earlier runs may have used.
///
/// # Errors
/// As [`folder`].
pub(super) fn folders() -> Result<Vec<PathBuf>, DomainError> {
    let own = format!("/dev/shm/masseter-{}", geteuid().as_raw());
    let others = (1..FOLDERS).map(|number| format!("{own}-{number}").into());
    let of_user: Vec<PathBuf> = iter::once(own.clone().into()).chain(others).collect();
    choose(env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from), &of_user)
}

/// A session folder of another user, as after `su`, is passed over. Of the user's folders, those that are there come first:
/// the choice holds when another user gives a name back.
fn choose(session: Option<PathBuf>, of_user: &[PathBuf]) -> Result<Vec<PathBuf>, DomainError> {
    let passed_over = session.as_deref().and_then(unusable);
    let of_session = session.filter(|_| passed_over.is_none()).map(|session| session.join("masseter"));
    let of_root = geteuid().is_root().then(|| PathBuf::from("/run/masseter"));
    let preferred = of_session.or(of_root).filter(|path| make(path).is_ok());
    let found: Vec<_> = match &preferred {
        Some(path) => make_folder_private(path)?.then(|| path.clone()).into_iter().collect(),
        None => private_ones(of_user)?,
    };
    if found.is_empty() {
        let path = preferred.unwrap_or_else(|| of_user[0].clone());
        return Err(DomainError::NotPrivate { path, passed_over: passed_over.unwrap_or_default() });
    }
    Ok(found)
}

/// The private ones of these folders, or else the first that can be made; none if all names are taken.
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

/// Whether a folder is private, after the rights of others who could only look into it are taken.
fn make_folder_private(folder: &Path) -> Result<bool, DomainError> {
    if is_own_folder_without(WRITE_OF_OTHERS, folder) {
        fs::set_permissions(folder, PermissionsExt::from_mode(0o700))
            .map_err(file_error("make private", folder))?;
    }
    Ok(is_private(folder))
}

/// Why a session's folder is passed over, if it is.
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

/// Whether it is a folder, not a link, of this user, and nobody has these rights to it.
fn is_own_folder_without(rights: u32, path: &Path) -> bool {
    fs::symlink_metadata(path)
        .is_ok_and(|found| found.is_dir() && found.uid() == geteuid().as_raw() && found.mode() & rights == 0)
}

/// What the system says of a file of this user; none for a link, another user's file, or one that is gone.
pub(super) fn own_file(path: &Path) -> Option<Metadata> {
    fs::symlink_metadata(path).ok().filter(is_own)
}

/// Whether it is a file of this user, and no link.
pub(super) fn is_own(found: &Metadata) -> bool {
    found.is_file() && found.uid() == geteuid().as_raw()
}

/// Takes the rights of others from a file of this user; leaves other files alone.
pub(super) fn make_private(path: &Path) -> Result<(), DomainError> {
    match own_file(path) {
        Some(found) if found.mode() & OF_OTHERS != 0 => {
            let made = fs::set_permissions(path, PermissionsExt::from_mode(0o600));
            made.map_err(file_error("make private", path))
        }
        _ => Ok(()),
    }
}

/// Makes a folder for its owner only, unless something has the name.
pub(super) fn make(path: &Path) -> io::Result<()> {
    match DirBuilder::new().mode(ONLY_OWNER.bits()).create(path) {
        Err(error) if error.kind() != ErrorKind::AlreadyExists => Err(error),
        _ => Ok(()),
    }
}

/// Opens a file for its owner only, makes it if necessary, follows no link and truncates nothing.
pub(super) fn open(path: &Path) -> Result<File, DomainError> {
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

    /// A folder with short path and this mode, removed with the test.
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
