//! If this process waits for a device lock, a message names the process that holds the lock. This module remembers the
//! named processes, so that each process is named only once.

use super::holder::Holder;
use crate::threads::locked;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// The files of locks for which this process has waited, and the processes that held these locks.
static NAMED: Mutex<BTreeSet<(PathBuf, Holder)>> = Mutex::new(BTreeSet::new());

/// Returns true if this process has not waited before for `holder` to release the lock with this file. Remembers
/// that this process now waits for `holder`.
pub fn is_first(file: &Path, holder: &Holder) -> bool {
    locked(&NAMED).insert((file.to_owned(), holder.clone()))
}
