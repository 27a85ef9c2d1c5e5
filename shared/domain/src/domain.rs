//! The file names of a run, the check for its living processes, and the removal of the files.
//!
//! iceoryx2 leaves files in a private root folder, and in `/dev/shm` with a prefix. The prefix contains a random number
//! of the claim, so no other user can squat a name. Every process of a run holds an inherited lock on `<root>/lock`,
//! whose text is that number. The run is alive while any process holds the lock.

use std::fs::{self, File, Metadata, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::{ops::Deref, os::unix::fs::MetadataExt, thread, time::Duration};

use rustix::fs::{major, minor};
use rustix::io::{FdFlags, fcntl_setfd};
use rustix::process::getuid;

use crate::folder::{self, DomainError, file_error};

const SHARED_MEMORY: &str = "/dev/shm";
const LOCK: &str = "lock";
/// A name that is not valid for a domain.
const TURN: &str = ".turn";
/// Claims and sweeps take milliseconds.
const TURN_TIMEOUT: Duration = Duration::from_secs(5);
const TURN_POLL: Duration = Duration::from_millis(5);

/// The names of one run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Domain {
    id: String,
    root: PathBuf,
}

/// Exclusive use of a domain; children started meanwhile share it.
#[derive(Debug)]
pub struct DomainLock {
    _lock: File,
}

/// The result of a sweep.
#[derive(Debug, Default)]
pub struct Swept {
    /// Removed files of shared memory.
    pub removed: usize,
    /// Reasons for remaining files, such as files of another user.
    pub remaining: Vec<DomainError>,
}

impl Swept {
    fn remove_path(&mut self, path: &Path, remove: impl FnOnce(&Path) -> io::Result<()>) -> bool {
        let error = remove(path).err().filter(|error| error.kind() != io::ErrorKind::NotFound);
        let is_gone = error.is_none();
        self.remaining.extend(error.map(file_error("remove", path)));
        is_gone
    }
}

/// A domain that removes its files on drop, for tests and measurements.
#[derive(Debug)]
pub struct ScratchDomain {
    domain: Domain,
    claim: Option<DomainLock>,
}

impl ScratchDomain {
    /// Claims a domain with a name that no other process takes.
    ///
    /// # Errors
    /// As [`Domain::named`] and [`Domain::claim`].
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
        // `masseter clean` removes the remaining files.
        let _ = self.domain.sweep();
    }
}

impl Domain {
    /// A domain by its id, in the private folder of this user.
    ///
    /// # Errors
    /// [`DomainError::BadName`], and [`DomainError::NotPrivate`] without a private folder.
    pub fn named(id: &str) -> Result<Self, DomainError> {
        if is_id(id) {
            Ok(Self { id: id.to_owned(), root: folder::folder()?.join(id) })
        } else {
            Err(DomainError::BadName(id.to_owned()))
        }
    }

    /// The id.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// The domain's root folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The prefix of the files in shared memory of the domain's claim.
    ///
    /// # Errors
    /// For a domain without a claim.
    pub fn prefix(&self) -> io::Result<String> {
        let secret = fs::read_to_string(self.root.join(LOCK))?;
        Ok(format!("masseter_{}_{}.{secret}_", getuid().as_raw(), self.id))
    }

    /// Locks the domain for this process and its children until the end of all.
    ///
    /// # Errors
    /// [`DomainError::InUse`] for a domain of living processes, [`DomainError::Busy`], or a refusal of the file system.
    pub fn claim(&self) -> Result<DomainLock, DomainError> {
        let _turn = self.take_turn()?;
        if self.is_locked() {
            return Err(DomainError::InUse(self.id.clone()));
        }
        self.remove_files()?;
        let path = self.root.join(LOCK);
        folder::make(&self.root).map_err(file_error("create", &self.root))?;
        let mut lock = folder::open(&path)?;
        lock.try_lock().map_err(io::Error::from).map_err(file_error("lock", &path))?;
        folder::secret()
            .and_then(|secret| lock.write_all(secret.as_bytes()))
            .map_err(file_error("write", &path))?;
        // Children inherit the lock, so the domain counts as alive until the end of the last child.
        fcntl_setfd(&lock, FdFlags::empty()).map_err(io::Error::from).map_err(file_error("share", &path))?;
        Ok(DomainLock { _lock: lock })
    }

    /// Whether any process of the run still lives.
    ///
    /// # Errors
    /// [`DomainError::Busy`], or a refusal of the file system.
    pub fn is_alive(&self) -> Result<bool, DomainError> {
        let _turn = self.take_turn()?;
        Ok(self.is_locked())
    }

    /// Removes the files of a domain without a living process from shared memory and the file system. Keeps the files
    /// of a living domain.
    ///
    /// # Errors
    /// [`DomainError::Busy`], or a refusal of the file system.
    pub fn sweep(&self) -> Result<Option<Swept>, DomainError> {
        let _turn = self.take_turn()?;
        if self.is_locked() { Ok(None) } else { self.remove_files().map(Some) }
    }

    fn remove_files(&self) -> Result<Swept, DomainError> {
        let mut swept = Swept::default();
        for path in self.shared_memory()? {
            swept.removed += usize::from(swept.remove_path(&path, |path| fs::remove_file(path)));
        }
        swept.remove_path(&self.root, |path| fs::remove_dir_all(path));
        Ok(swept)
    }

    /// The files in shared memory of the domain's claim, if any.
    ///
    /// # Errors
    /// When shared memory cannot be listed.
    pub fn shared_memory(&self) -> Result<Vec<PathBuf>, DomainError> {
        let Ok(prefix) = self.prefix() else { return Ok(Vec::new()) };
        let files = entries(Path::new(SHARED_MEMORY))?;
        Ok(files.into_iter().filter(|path| file_name(path).starts_with(&prefix)).collect())
    }

    /// Takes the rights of other users from this user's files in shared memory. iceoryx2 makes one file for everybody,
    /// for any umask. Until this call, others may change its only content, the count of the nodes so far.
    ///
    /// # Errors
    /// When shared memory cannot be listed, or the system refuses.
    pub fn make_private(&self) -> Result<(), DomainError> {
        self.own_shared_memory()?.iter().try_for_each(|path| folder::make_private(path))
    }

    /// The files of this user among [`Self::shared_memory`].
    ///
    /// # Errors
    /// When shared memory cannot be listed.
    pub fn own_shared_memory(&self) -> Result<Vec<PathBuf>, DomainError> {
        Ok(self.shared_memory()?.into_iter().filter(|path| folder::own_file(path).is_some()).collect())
    }

    /// A file of another user in shared memory with the prefix. The first own file shows the prefix to everybody.
    ///
    /// # Errors
    /// When shared memory cannot be listed.
    pub fn foreign_file(&self) -> Result<Option<PathBuf>, DomainError> {
        let files = self.shared_memory()?;
        // One query for each file: iceoryx2 may remove an own file at any time, and a second query then finds no owner.
        let is_foreign = |path: &PathBuf| path.symlink_metadata().is_ok_and(|found| !folder::is_own(&found));
        Ok(files.into_iter().find(is_foreign))
    }

    /// Refuses shared memory of another user in this process. Unused files do no harm. Nobody can exchange an own file,
    /// because the folder is sticky.
    ///
    /// # Errors
    /// [`DomainError::Foreign`] for another user's file, [`DomainError::Gone`] for a removed file.
    pub fn check_mapped(&self) -> Result<(), DomainError> {
        let maps = Path::new("/proc/self/maps");
        let text = fs::read_to_string(maps).map_err(file_error("read", maps))?;
        let prefix = self.prefix().map_err(file_error("read", &self.root))?;
        let prefix = format!("{SHARED_MEMORY}/{prefix}");
        let mut mapped = text.lines().filter_map(|line| Some((line, &line[line.find(&prefix)?..])));
        mapped.try_for_each(|(line, path)| check_mapped_file(line, path))
    }

    /// The query takes the lock for a moment, so only one query may run at a time.
    fn is_locked(&self) -> bool {
        File::open(self.root.join(LOCK))
            .is_ok_and(|lock| matches!(lock.try_lock(), Err(TryLockError::WouldBlock)))
    }

    /// Every domain of this user with files.
    ///
    /// # Errors
    /// [`DomainError::NotPrivate`] without a private folder, or a refusal of the file system.
    pub fn all() -> Result<Vec<Self>, DomainError> {
        let mut domains = Vec::new();
        for folder in folder::folders()? {
            let found = entries(&folder)?.into_iter().map(|root| (file_name(&root).to_owned(), root));
            domains.extend(found.filter(|(id, _)| is_id(id)).map(|(id, root)| Self { id, root }));
        }
        Ok(domains)
    }

    /// The domains with a living process and a file of this name, such as a socket, in the root folder.
    ///
    /// # Errors
    /// As [`Self::all`].
    pub fn serving(name: &str) -> Result<Vec<Self>, DomainError> {
        let serves = |domain: &Self| domain.root.join(name).exists() && domain.is_alive().unwrap_or(false);
        Ok(Self::all()?.into_iter().filter(serves).collect())
    }

    /// Waits until no other process of this user claims or sweeps a domain. A lock before its acquisition must not look
    /// like a released lock. The turn ends with the drop of the file.
    fn take_turn(&self) -> Result<File, DomainError> {
        let path = self.root.with_file_name(TURN);
        let turn = folder::open(&path)?;
        // The clock is above this crate.
        let mut polls = TURN_TIMEOUT.as_millis() / TURN_POLL.as_millis();
        loop {
            match turn.try_lock() {
                Ok(()) => return Ok(turn),
                Err(TryLockError::Error(error)) => return Err(file_error("lock", &path)(error)),
                Err(TryLockError::WouldBlock) if polls > 0 => {
                    polls -= 1;
                    thread::sleep(TURN_POLL);
                }
                Err(TryLockError::WouldBlock) => {
                    let holder = turn.metadata().ok().and_then(|file| lock_holder(&file));
                    let holder = holder.unwrap_or_else(|| "an unknown process".to_owned());
                    return Err(DomainError::Busy { path, holder });
                }
            }
        }
    }
}

fn is_id(id: &str) -> bool {
    (1..=32).contains(&id.len()) && id.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-' || b == b'_')
}

/// Refuses a line of `/proc/self/maps` with another user's file: `7f00-7f01 rw-s 00000000 00:1a 12345 /dev/shm/…`.
fn check_mapped_file(line: &str, path: &str) -> Result<(), DomainError> {
    let inode = line.split_whitespace().nth(4).and_then(|inode| inode.parse().ok());
    // The kernel marks removed files.
    let (path, is_removed) = path.strip_suffix(" (deleted)").map_or((path, false), |path| (path, true));
    match fs::symlink_metadata(path) {
        Ok(found) if folder::is_own(&found) && Some(found.ino()) == inode && !is_removed => Ok(()),
        Ok(found) if !folder::is_own(&found) => Err(DomainError::Foreign(path.into())),
        _ => Err(DomainError::Gone(path.into())),
    }
}

/// The process with the lock on the file, by its id and name.
fn lock_holder(file: &Metadata) -> Option<String> {
    let locks = fs::read_to_string("/proc/locks").ok()?;
    // 1: FLOCK  ADVISORY  WRITE 4711 00:1a:12345 0 EOF
    let place = format!("{:02x}:{:02x}:{}", major(file.dev()), minor(file.dev()), file.ino());
    let of_file = |line: &&str| line.split_whitespace().nth(5) == Some(&place);
    let id = locks.lines().find(of_file)?.split_whitespace().nth(4)?;
    let name = fs::read_to_string(format!("/proc/{id}/comm")).unwrap_or_default();
    Some(format!("process {id} ({})", name.trim_end()))
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>, DomainError> {
    let list = fs::read_dir(folder).map_err(file_error("list", folder))?;
    Ok(list.filter_map(|entry| Some(entry.ok()?.path())).collect())
}

fn file_name(path: &Path) -> &str {
    path.file_name().and_then(|name| name.to_str()).unwrap_or_default()
}

#[cfg(test)]
mod tests;
