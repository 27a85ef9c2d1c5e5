//! The file names of a run, the check for living processes of the run, and the removal of the files.
//!
//! iceoryx2 leaves files in two places, both in `/dev/shm`: below a root folder, and beside it with a prefix. Every
//! process of a run holds an inherited lock on `<root>/lock`; while anyone holds it, the run is alive.

use std::fs::{self, File, TryLockError};
use std::io;
use std::ops::Deref;
use std::path::{Path, PathBuf};

use rustix::io::{FdFlags, fcntl_setfd};
use rustix::process::getuid;

const SHARED_MEMORY: &str = "/dev/shm";
const LOCK: &str = "lock";
/// No domain can have this name.
const TURN: &str = ".turn";

/// The names of one run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Domain {
    id: String,
}

/// Why a domain could not be claimed or removed.
#[derive(Debug, thiserror::Error)]
pub enum DomainError {
    /// Another run uses the name.
    #[error("a rig named '{id}' is running; wait for it, stop it, or give this one another `--name`")]
    InUse {
        /// The domain's id.
        id: String,
    },
    /// The id cannot be a file name.
    #[error("'{id}' cannot name a rig: use 1 to 32 letters, digits, '-' or '_'")]
    BadName {
        /// The id as given.
        id: String,
    },
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

/// Exclusive use of a domain; children started meanwhile share it.
#[derive(Debug)]
pub struct DomainLock {
    _lock: File,
}

/// A domain whose files are removed on drop, for tests and measurements.
#[derive(Debug)]
pub struct ScratchDomain {
    domain: Domain,
    claim: Option<DomainLock>,
}

impl ScratchDomain {
    /// Claims a domain of that name that no other process takes.
    pub fn claim(name: &str) -> Result<Self, DomainError> {
        let domain = Domain::named(&format!("{name}-{}", std::process::id()))?;
        let claim = Some(domain.claim()?);
        Ok(Self { domain, claim })
    }
}

impl Deref for ScratchDomain {
    type Target = Domain;

    fn deref(&self) -> &Domain {
        &self.domain
    }
}

impl Drop for ScratchDomain {
    fn drop(&mut self) {
        drop(self.claim.take());
        // What cannot be removed now is left to `masseter clean`.
        let _ = self.domain.sweep();
    }
}

impl Domain {
    /// A domain by its id.
    pub fn named(id: &str) -> Result<Self, DomainError> {
        let fits = (1..=32).contains(&id.len());
        if fits && id.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-' || b == b'_') {
            Ok(Self { id: id.to_owned() })
        } else {
            Err(DomainError::BadName { id: id.to_owned() })
        }
    }

    /// The id.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// The domain's root folder: one folder for each user, so that users never share files.
    pub fn root(&self) -> PathBuf {
        domains_of_this_user().join(&self.id)
    }

    /// The prefix of its shared-memory files. No id contains a dot, so no other domain has this prefix.
    pub fn prefix(&self) -> String {
        format!("masseter_{}_{}.", getuid().as_raw(), self.id)
    }

    /// Locks the domain for this process and its children until all have ended.
    pub fn claim(&self) -> Result<DomainLock, DomainError> {
        let _turn = take_turn()?;
        let path = self.root().join(LOCK);
        let lock = create(&path)?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(DomainError::InUse { id: self.id.clone() }),
            Err(TryLockError::Error(error)) => return Err(file_error("lock", &path)(error)),
        }
        // Children inherit the lock, so the domain counts as alive until the last of them ended.
        fcntl_setfd(&lock, FdFlags::empty()).map_err(io::Error::from).map_err(file_error("share", &path))?;
        Ok(DomainLock { _lock: lock })
    }

    /// Whether any process of the run still lives.
    pub fn is_alive(&self) -> Result<bool, DomainError> {
        let _turn = take_turn()?;
        Ok(self.is_locked())
    }

    /// Removes everything that a domain without a living process left in shared memory and in the file system;
    /// how many files of shared memory that were, none while it is alive.
    pub fn sweep(&self) -> Result<Option<usize>, DomainError> {
        let _turn = take_turn()?;
        if self.is_locked() {
            return Ok(None);
        }
        let prefix = self.prefix();
        let mut removed = 0;
        for path in entries(Path::new(SHARED_MEMORY))? {
            if file_name(&path).starts_with(&prefix) {
                remove(&path, fs::remove_file(&path))?;
                removed += 1;
            }
        }
        let root = self.root();
        remove(&root, fs::remove_dir_all(&root))?;
        Ok(Some(removed))
    }

    /// Asking takes the lock for a moment, which only one may do at a time.
    fn is_locked(&self) -> bool {
        File::open(self.root().join(LOCK))
            .is_ok_and(|lock| matches!(lock.try_lock(), Err(TryLockError::WouldBlock)))
    }

    /// Every domain of this user that left something behind.
    pub fn all() -> Result<Vec<Self>, DomainError> {
        let folder = domains_of_this_user();
        if !folder.exists() {
            return Ok(Vec::new());
        }
        Ok(entries(&folder)?.iter().filter_map(|path| Self::named(file_name(path)).ok()).collect())
    }
}

/// The folder of the locks, in shared memory beside the files of the domains: temporary folders may differ between
/// processes.
fn domains_of_this_user() -> PathBuf {
    Path::new(SHARED_MEMORY).join(format!("masseter-{}", getuid().as_raw()))
}

/// Waits until no other process of this user claims or sweeps a domain: a lock not yet taken must not look like one
/// that was let go. The turn ends with the file.
fn take_turn() -> Result<File, DomainError> {
    let path = domains_of_this_user().join(TURN);
    let turn = create(&path)?;
    turn.lock().map_err(file_error("lock", &path))?;
    Ok(turn)
}

/// Creates a file and the folders above it.
fn create(path: &Path) -> Result<File, DomainError> {
    let folder = path.parent().expect("the file is in a folder");
    fs::create_dir_all(folder).and_then(|()| File::create(path)).map_err(file_error("create", path))
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>, DomainError> {
    let list = fs::read_dir(folder).map_err(file_error("list", folder))?;
    Ok(list.filter_map(|entry| Some(entry.ok()?.path())).collect())
}

fn file_name(path: &Path) -> &str {
    path.file_name().and_then(|name| name.to_str()).unwrap_or_default()
}

fn remove(path: &Path, result: io::Result<()>) -> Result<(), DomainError> {
    result.or_else(|error| match error.kind() {
        io::ErrorKind::NotFound => Ok(()),
        _ => Err(file_error("remove", path)(error)),
    })
}

fn file_error(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> DomainError {
    move |error| DomainError::File { action, path: path.to_owned(), error }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::*;

    fn unique(name: &str) -> Domain {
        Domain::named(&format!("test-{name}-{}", std::process::id())).unwrap()
    }

    #[test]
    fn a_claimed_domain_is_alive_refused_to_others_and_not_swept() {
        let domain = unique("claim");
        let claim = domain.claim().unwrap();
        assert!(domain.is_alive().unwrap());
        assert!(matches!(domain.claim(), Err(DomainError::InUse { .. })));
        assert_eq!(domain.sweep().unwrap(), None);
        assert!(domain.root().exists());
        drop(claim);
        assert!(!domain.is_alive().unwrap());
        assert_eq!(domain.sweep().unwrap(), Some(0));
        assert!(!domain.root().exists());
    }

    #[test]
    fn a_scratch_domain_leaves_nothing_behind() {
        let scratch = ScratchDomain::claim("test-scratch").unwrap();
        let domain = (*scratch).clone();
        let file = Path::new(SHARED_MEMORY).join(format!("{}segment", domain.prefix()));
        fs::write(&file, "").unwrap();
        assert!(domain.is_alive().unwrap());
        drop(scratch);
        assert!(!file.exists() && !domain.root().exists());
    }

    #[test]
    fn a_domain_whose_id_begins_another_ones_leaves_it_its_files() {
        let (short, long) =
            (unique("prefix"), Domain::named(&format!("{}_2", unique("prefix").id())).unwrap());
        let file = Path::new(SHARED_MEMORY).join(format!("{}segment", long.prefix()));
        let claim = long.claim().unwrap();
        fs::write(&file, "").unwrap();
        assert_eq!(short.sweep().unwrap(), Some(0));
        assert!(file.exists());
        drop(claim);
        assert_eq!(long.sweep().unwrap(), Some(1));
    }

    #[test]
    fn a_permanent_sweep_never_removes_a_domain_that_is_being_claimed() {
        let domain = unique("race");
        let is_over = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !is_over.load(Ordering::Relaxed) {
                    domain.sweep().unwrap();
                }
            });
            for _ in 0..500 {
                let claim = domain.claim();
                let is_whole =
                    claim.is_ok() && domain.root().join(LOCK).exists() && domain.is_alive().unwrap();
                if !is_whole {
                    is_over.store(true, Ordering::Relaxed);
                }
                assert!(is_whole, "{claim:?}");
            }
            is_over.store(true, Ordering::Relaxed);
        });
        domain.sweep().unwrap();
    }

    #[test]
    fn names_that_could_leave_their_folder_are_refused() {
        for id in ["", "..", "a/b", "a b", &"x".repeat(33)] {
            assert!(matches!(Domain::named(id), Err(DomainError::BadName { .. })), "{id}");
        }
    }
}
