//! One owner for a folder that is being written, so that a second process cannot remove or overwrite what the first one is writing.
//!
//! In: a folder. Out: a lock that lasts as long as its value, or the error that names the owner. The lock is the operating system's, on the
//! file `.lock` in the folder, so that it ends with its process however that ends. Readers need no lock: every file appears whole.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use crate::{Error, Result};

/// The lock's file in a folder that is being written.
const LOCK: &str = ".lock";

/// Who writes into a folder.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct Owner {
    /// The program.
    program: String,
    /// Its process number.
    process: u32,
    /// The machine it runs on; empty if the system does not say.
    #[serde(default)]
    machine: String,
    /// When it began, in seconds since 1970.
    since: u64,
}

impl Owner {
    /// This process.
    fn this() -> Self {
        let program = std::env::args_os().next().map(PathBuf::from).unwrap_or_default();
        let machine = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
        Self {
            program: program.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            process: std::process::id(),
            machine: machine.trim().to_owned(),
            since: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs()),
        }
    }
}

impl std::fmt::Display for Owner {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.process == 0 {
            // The owner has locked its file and not yet written its name into it.
            return f.write_str("another process");
        }
        write!(f, "{} (process {}", self.program, self.process)?;
        if !self.machine.is_empty() {
            write!(f, " on {}", self.machine)?;
        }
        let since = chrono::DateTime::from_timestamp(self.since as i64, 0).unwrap_or_default();
        write!(f, ", since {})", since.format("%Y-%m-%d %H:%M:%S UTC"))
    }
}

/// The right to write into a folder, until this value is dropped.
#[derive(Debug)]
pub struct FolderLock {
    path: PathBuf,
    /// Who made it. The child of a fork has a copy of this value, and is not the owner.
    process: u32,
    // Closing the file releases the lock.
    file: File,
}

impl FolderLock {
    /// Makes the folder if it is not there, and this process its owner.
    ///
    /// # Errors
    /// [`Error::Owned`] when another process, or another part of this one, owns the folder; [`Error::Io`].
    pub fn acquire(folder: &Path) -> Result<Self> {
        std::fs::create_dir_all(folder).map_err(Error::io("create", folder))?;
        Self::lock(folder, folder.join(LOCK))
    }

    /// Makes this process the only one that may put something at `place`, which is made elsewhere and moved there when it is whole; the lock's
    /// file lies beside it.
    ///
    /// # Errors
    /// As [`FolderLock::acquire`].
    pub fn acquire_beside(place: &Path) -> Result<Self> {
        let whole = std::path::absolute(place).map_err(Error::io("find", place))?;
        let folder = whole.parent().unwrap_or(&whole);
        std::fs::create_dir_all(folder).map_err(Error::io("create", folder))?;
        let name = whole.file_name().unwrap_or_default().to_string_lossy();
        Self::lock(place, folder.join(format!(".{name}{LOCK}")))
    }

    /// Who owns `place` by [`FolderLock::acquire_beside`], if anybody does.
    pub fn owner_beside(place: &Path) -> Option<String> {
        let whole = std::path::absolute(place).ok()?;
        let name = whole.file_name()?.to_string_lossy();
        let file = File::open(whole.with_file_name(format!(".{name}{LOCK}"))).ok()?;
        // Shared, so that two who ask do not take each other for the owner.
        matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)).then(|| owner_in(file).to_string())
    }

    fn lock(folder: &Path, path: PathBuf) -> Result<Self> {
        loop {
            let mut options = OpenOptions::new();
            options.read(true).write(true).create(true).truncate(false);
            let mut file = options.open(&path).map_err(Error::io("write", &path))?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    return Err(Error::Owned { owner: owner_in(file).to_string(), path: folder.into() });
                }
                Err(TryLockError::Error(error)) => return Err(Error::io("lock", &path)(error)),
            }
            // The owner before removed the file between our opening and our locking it: then the lock is on a file that nobody else can find.
            if is_in_place(&file, &path) {
                let text = serde_json::to_string(&Owner::this()).unwrap_or_default() + "\n";
                let written = file.set_len(0).and_then(|()| file.write_all(text.as_bytes()));
                written.map_err(Error::io("write", &path))?;
                return Ok(Self { path, process: std::process::id(), file });
            }
        }
    }
}

impl Drop for FolderLock {
    fn drop(&mut self) {
        // While the lock is still held, and not another owner's file in a folder that took this one's place. A file that stays is harmless: the
        // next owner locks it again. The child of a fork drops its copy while its parent still writes, and without the file a third process would make
        // another and lock that.
        if self.process == std::process::id() && is_in_place(&self.file, &self.path) {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Who wrote its name into the lock's file.
fn owner_in(mut file: File) -> Owner {
    let mut text = String::new();
    let read = file.read_to_string(&mut text).ok();
    read.and_then(|_| serde_json::from_str(&text).ok()).unwrap_or_default()
}

/// Whether the open file is the one that has this name now.
fn is_in_place(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (file.metadata(), std::fs::metadata(path)) {
        (Ok(open), Ok(named)) => (open.dev(), open.ino()) == (named.dev(), named.ino()),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_second_owner_is_refused_by_name_and_the_next_one_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().join("recording");
        let first = FolderLock::acquire(&folder).unwrap();
        let Err(Error::Owned { owner, path }) = FolderLock::acquire(&folder) else { panic!("two owners") };
        assert_eq!(path, folder);
        assert!(owner.contains(&format!("(process {} on ", std::process::id())), "{owner}");
        assert!(owner.ends_with(" UTC)"), "{owner}");
        drop(first);
        assert!(!folder.join(LOCK).exists(), "nothing is left in a finished folder");
        FolderLock::acquire(&folder).unwrap();
    }

    #[test]
    fn what_is_made_elsewhere_has_one_maker_and_its_parent_many() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("export");
        let first = FolderLock::acquire_beside(&place).unwrap();
        assert!(matches!(FolderLock::acquire_beside(&place), Err(Error::Owned { .. })));
        assert!(FolderLock::owner_beside(&place).unwrap().contains("process"));
        FolderLock::acquire_beside(&folder.path().join("other")).unwrap();
        drop(first);
        assert_eq!(FolderLock::owner_beside(&place), None);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_killed_owners_file_locks_nobody_out() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(LOCK), r#"{"program":"vibes-collect","process":1,"since":0}"#).unwrap();
        FolderLock::acquire(folder.path()).unwrap();
    }

    #[test]
    fn the_child_of_a_fork_leaves_its_parents_lock_in_place() {
        let folder = tempfile::tempdir().unwrap();
        let parents = FolderLock::acquire(folder.path()).unwrap();
        // What the child has: the same open file, and a process number that is not its own.
        let file = parents.file.try_clone().unwrap();
        drop(FolderLock { path: parents.path.clone(), process: parents.process + 1, file });
        assert!(folder.path().join(LOCK).exists());
        assert!(matches!(FolderLock::acquire(folder.path()), Err(Error::Owned { .. })));
        drop(parents);
        assert!(!folder.path().join(LOCK).exists());
    }

    #[test]
    fn of_many_who_begin_at_once_one_wins_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let inside = std::sync::atomic::AtomicUsize::new(0);
        let wins = std::sync::atomic::AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    for _ in 0..200 {
                        let Ok(_lock) = FolderLock::acquire(folder.path()) else { continue };
                        assert_eq!(inside.fetch_add(1, std::sync::atomic::Ordering::SeqCst), 0, "two owners at once");
                        wins.fetch_add(1, std::sync::atomic::Ordering::SeqCst);
                        inside.fetch_sub(1, std::sync::atomic::Ordering::SeqCst);
                    }
                });
            }
        });
        assert!(wins.into_inner() > 0);
    }
}
