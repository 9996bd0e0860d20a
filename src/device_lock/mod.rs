//! Allows one measurement at a time on a device of this machine. A process holds the device's lock while it
//! measures times that it reports. Without the lock, two simultaneous measurements would slow each other down
//! unnoticed.

mod folder;
mod holder;
mod name;

pub use name::LockName;

use crate::error::{Error, Result};
use folder::Folder;
use holder::Holder;
use std::fs::{File, TryLockError};
use std::io::ErrorKind;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// The interval at which a waiting process checks whether the device is free or the user has interrupted the
/// process.
const LOOK_UP: Duration = Duration::from_millis(100);

/// The locks of the devices, and whether to wait for a lock that another process holds.
#[derive(Clone, Debug)]
pub struct Locks {
    folder: Folder,
    wait: bool,
}

/// A lock on a device, released when dropped. The operating system releases the lock, however the process ends.
pub struct Held {
    file: File,
}

impl Drop for Held {
    fn drop(&mut self) {
        // If emptying the file fails, the next holder overwrites its contents. Closing the file might not release the
        // lock, since a child process that is being started shares the open file.
        let _ = self.file.set_len(0);
        let _ = self.file.unlock();
    }
}

impl Locks {
    /// Returns the locks in the folder that `RAYCL_LOCK_DIR` names, or else in the shared folder. If `wait` is
    /// false, a device that is in use causes an error.
    pub fn of_machine(wait: bool) -> Self {
        Self { folder: Folder::of_machine(), wait }
    }

    /// Returns the locks of a folder.
    pub fn in_folder(folder: &Path, wait: bool) -> Self {
        Self { folder: Folder::named(folder), wait }
    }

    /// Takes a device's lock as soon as no other process holds the lock. If `wait` is false, returns an error instead
    /// of waiting. While waiting, this function calls `says` with a line that describes the holder. An interruption
    /// ends the wait.
    pub fn take(
        &self,
        device: &LockName,
        says: &mut dyn FnMut(&str),
        interrupted: &AtomicBool,
    ) -> Result<Held> {
        let mut told = None;
        loop {
            let failed = |error| self.folder.unusable(&error);
            let file = self.folder.open(device.file()).map_err(failed)?;
            match self.try_hold(file, device).map_err(failed)? {
                Attempt::Held(held) => return Ok(held),
                Attempt::Removed => continue,
                Attempt::Busy => {}
            }
            let holder = Holder::read(&self.folder.path(device.file()));
            if !self.wait {
                return Err(refused(&holder, device));
            }
            if told.as_ref() != Some(&holder) {
                says(&format!("waiting for {holder}, which is measuring on {device}"));
                told = Some(holder);
            }
            if interrupted.load(Ordering::Relaxed) {
                return Err(Error::interrupted(format!("raycl was waiting for {device}")).with_help(
                    "run the command again when the other process has ended; with --no-wait, raycl ends immediately instead of waiting",
                ));
            }
            std::thread::sleep(LOOK_UP);
        }
    }

    /// Takes the locks of several devices. All processes take the locks in the same order, so no two processes can
    /// wait for each other.
    pub fn take_all(
        &self,
        mut devices: Vec<LockName>,
        says: &mut dyn FnMut(&str),
        interrupted: &AtomicBool,
    ) -> Result<Vec<Held>> {
        devices.sort();
        devices.dedup();
        devices.iter().map(|device| self.take(device, says, interrupted)).collect()
    }

    /// Tries to take the lock once.
    fn try_hold(&self, mut file: File, device: &LockName) -> std::io::Result<Attempt> {
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Ok(Attempt::Busy),
            // Some network file systems do not support locks; raycl then measures without a lock.
            Err(TryLockError::Error(error)) if error.kind() == ErrorKind::Unsupported => {}
            Err(TryLockError::Error(error)) => return Err(error),
        }
        // If the file was removed meanwhile, its lock does not stop other processes, since they lock a new file. The
        // next attempt opens the new file.
        if !self.folder.still_has(device.file(), &file) {
            return Ok(Attempt::Removed);
        }
        Holder::of_this_process().write(&mut file)?;
        Ok(Attempt::Held(Held { file }))
    }
}

/// The result of one attempt to take a lock.
enum Attempt {
    Held(Held),
    /// Another process holds the lock.
    Busy,
    /// The lock's file was removed after it was opened.
    Removed,
}

fn refused(holder: &Holder, device: &LockName) -> Error {
    Error::run(format!("{holder} is measuring on {device}")).with_help(
        "without --no-wait, raycl waits until the other process has ended; two measurements at the same time would disturb each other",
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicUsize;

    static OFF: AtomicBool = AtomicBool::new(false);

    fn cpu() -> LockName {
        LockName::of(None)
    }

    #[test]
    fn one_holds_a_device_and_another_is_refused_or_waits_and_says_for_whom() {
        let folder = tempfile::tempdir().unwrap();
        let locks = Locks::in_folder(&folder.path().join("locks"), false);
        let held = locks.take(&cpu(), &mut |_| {}, &OFF).unwrap();
        let refused = locks.take(&cpu(), &mut |_| {}, &OFF).err().unwrap();
        let process = format!("process {}", std::process::id());
        assert_eq!(refused.exit_code(), 1);
        assert!(refused.to_string().contains(&process), "{refused}");

        let mut held = Some(held);
        let mut said = Vec::new();
        let mut says = |line: &str| {
            said.push(line.to_owned());
            held = None;
        };
        let second = Locks { wait: true, ..locks }.take(&cpu(), &mut says, &OFF).unwrap();
        assert_eq!(said.len(), 1, "{said:?}");
        assert!(said[0].starts_with(&format!("waiting for {process}, `")), "{said:?}");
        drop(second);
    }

    #[test]
    fn an_interruption_ends_the_waiting() {
        let folder = tempfile::tempdir().unwrap();
        let locks = Locks::in_folder(folder.path(), true);
        let _held = locks.take(&cpu(), &mut |_| {}, &OFF).unwrap();
        let ended = locks.take(&cpu(), &mut |_| {}, &AtomicBool::new(true)).err().unwrap();
        assert_eq!(ended.exit_code(), 130);
    }

    #[test]
    fn threads_that_take_it_again_and_again_never_meet() {
        let folder = tempfile::tempdir().unwrap();
        let inside = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    let locks = Locks::in_folder(folder.path(), true);
                    for _ in 0..5 {
                        let held = locks.take(&cpu(), &mut |_| {}, &OFF).unwrap();
                        assert_eq!(inside.fetch_add(1, Ordering::SeqCst), 0, "two at once");
                        std::thread::yield_now();
                        inside.fetch_sub(1, Ordering::SeqCst);
                        drop(held);
                    }
                });
            }
        });
    }

    #[test]
    fn a_lock_whose_file_was_removed_is_not_taken_for_the_new_one() {
        let folder = tempfile::tempdir().unwrap();
        let locks = Locks::in_folder(folder.path(), false);
        let file = locks.folder.open(cpu().file()).unwrap();
        std::fs::remove_file(locks.folder.path(cpu().file())).unwrap();
        assert!(matches!(locks.try_hold(file, &cpu()).unwrap(), Attempt::Removed));
        assert!(locks.take(&cpu(), &mut |_| {}, &OFF).is_ok());
    }
}
