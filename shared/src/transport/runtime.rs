//! The private folder of locks and iceoryx2's files: no other user may hold a lock, squat a name or read a file in it.
//!
//! It is `masseter` below the session's `XDG_RUNTIME_DIR`, `/run/masseter` of root, or `/dev/shm/masseter-UID`.

use std::env;
use std::fs::{self, DirBuilder, File, OpenOptions};
use std::io::{self, ErrorKind, Read};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

use rustix::fs::Mode;
use rustix::process::geteuid;

use super::error::{DomainError, file_error};

const ONLY_OWNER: Mode = Mode::RWXU;
/// Permissions of group and others.
const OF_OTHERS: u32 = 0o077;
const WRITE_OF_OTHERS: u32 = 0o022;
/// Longest session folder, bytes: iceoryx2 aborts on paths of more than 255, and needs most of them for its own names.
pub(super) const LONGEST_SESSION_FOLDER: usize = 40;

/// The folder, made if it does not exist, and verified.
///
/// # Errors
/// [`DomainError::NotPrivate`] if another user made it or may use it.
pub(super) fn folder() -> Result<PathBuf, DomainError> {
    choose(env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from))
}

/// A session folder of another user, as after `su`, is passed over.
fn choose(session: Option<PathBuf>) -> Result<PathBuf, DomainError> {
    let is_usable = |path: &PathBuf| {
        path.is_absolute() && path.as_os_str().len() <= LONGEST_SESSION_FOLDER && is_private(path)
    };
    let of_session = session.filter(is_usable).map(|session| session.join("masseter"));
    let of_root = geteuid().is_root().then(|| PathBuf::from("/run/masseter"));
    let preferred = of_session.or(of_root).filter(|path| make(path).is_ok());
    let folder = preferred.unwrap_or_else(|| format!("/dev/shm/masseter-{}", geteuid().as_raw()).into());
    make(&folder).map_err(file_error("create", &folder))?;
    if is_own_folder_without(WRITE_OF_OTHERS, &folder) {
        // Others could only look into it.
        fs::set_permissions(&folder, PermissionsExt::from_mode(0o700))
            .map_err(file_error("make private", &folder))?;
    }
    if is_private(&folder) { Ok(folder) } else { Err(DomainError::NotPrivate { path: folder }) }
}

fn is_private(path: &Path) -> bool {
    is_own_folder_without(OF_OTHERS, path)
}

/// Whether it is a folder, not a link, of this user, and nobody has these rights to it.
fn is_own_folder_without(rights: u32, path: &Path) -> bool {
    fs::symlink_metadata(path)
        .is_ok_and(|found| found.is_dir() && found.uid() == geteuid().as_raw() && found.mode() & rights == 0)
}

/// Takes the rights of others from a file of this user.
///
/// # Errors
/// [`DomainError::Foreign`] if it is a link or another user's.
pub(super) fn make_private(path: &Path) -> Result<(), DomainError> {
    // iceoryx2 may have removed it since it was listed.
    let Ok(found) = fs::symlink_metadata(path) else { return Ok(()) };
    if !found.is_file() || found.uid() != geteuid().as_raw() {
        return Err(DomainError::Foreign { path: path.to_owned() });
    }
    if found.mode() & OF_OTHERS == 0 {
        return Ok(());
    }
    fs::set_permissions(path, PermissionsExt::from_mode(0o600)).map_err(file_error("make private", path))
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
        let found = choose(Some(own.0.clone())).unwrap();
        assert_eq!(found, own.0.join("masseter"));
        assert!(is_private(&found));
        for unusable in
            [Some(open.0.clone()), Some("relative".into()), Some(own.0.join("x".repeat(99))), None]
        {
            assert!(!choose(unusable).unwrap().starts_with(env::temp_dir()));
        }
    }

    #[test]
    fn a_folder_that_others_may_write_or_a_link_is_refused() {
        let session = Session::new("refused", 0o700);
        let folder = session.0.join("masseter");
        make(&folder).unwrap();
        let refused = || matches!(choose(Some(session.0.clone())), Err(DomainError::NotPrivate { path }) if path == folder);
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
