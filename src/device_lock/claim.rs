//! Keeps a list of the locks that threads of this process hold or wait for. The list is needed because a
//! locked file does not show who holds the lock: another process, or another thread of this process.

use crate::threads::locked;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard};

/// The files of the locks that threads of this process hold or wait for.
static CLAIMED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// The right of one thread of this process to take a lock. Dropping a `Claim` gives up the right to take the
/// lock.
pub struct Claim(PathBuf);

impl Claim {
    /// Claims the lock that has the file `file`; returns `None` if another thread of this process has claimed
    /// this lock.
    pub fn of(file: &Path) -> Option<Self> {
        claimed().insert(file.to_owned()).then(|| Self(file.to_owned()))
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        claimed().remove(&self.0);
    }
}

fn claimed() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    locked(&CLAIMED)
}
