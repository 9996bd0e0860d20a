//! Allows one measurement at a time on a device of this machine. A process that measures times, such as
//! `raycl run`, meanwhile holds the device's lock. Without the lock, two simultaneous measurements would slow
//! each other down unnoticed.

mod claim;
mod folder;
mod holder;
mod name;
mod named;

pub use folder::check as check_folder;
pub use name::LockName;

use crate::clock::LOOK_UP;
use crate::error::{Error, Result};
use claim::Claim;
use folder::Folder;
use holder::Holder;
use std::fs::{File, TryLockError};
use std::io::{Error as IoError, ErrorKind, Result as IoResult};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// The locks of the devices, and whether to wait for a lock that another process holds.
#[derive(Clone, Debug)]
pub struct Locks {
    folder: Folder,
    wait: bool,
}

/// A lock on a device. Dropping this value releases the lock. The operating system also releases the lock
/// when the process ends without dropping this value.
pub struct Held {
    file: File,
    /// The right of a thread of this process to take the lock. The right to take the lock is dropped after
    /// the lock is released, so that the next thread of this process finds the lock free. `_claim` is `None`
    /// only in tests in which this process takes the lock in the role of another process.
    _claim: Option<Claim>,
}

/// The largest number of attempts to lock a file. An attempt fails if the file seems to have been removed
/// meanwhile. On a file system that changes the inode numbers of its files, a file always seems to have been removed.
/// Therefore, the last of the `LOCK_ATTEMPTS` attempts to lock a file does not check whether the file was removed.
pub const LOCK_ATTEMPTS: u32 = 10;

/// What a process reports while it waits for a lock. A process that waits for another of its own threads
/// reports only `Still` (the wait goes on).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LockWait<'a> {
    /// The wait for the lock begins, or another process has taken the lock during the wait. The text
    /// describes the process that holds the lock.
    For(&'a str),
    /// Another process holds the lock, but this process has already reported the text that describes the
    /// other process. A run waits for locks before each group of points. Without `Again`, the run would print
    /// the same line for every group.
    Again(&'a str),
    /// The wait for the lock goes on. A waiting process reports `Still` several times per second.
    Still,
}

/// Returns true if an attempt to lock a file failed because its file system does not support locks, as is the
/// case for some network file systems. If NFS has no lock service, `flock` fails with `ENOLCK` (Linux's
/// manual, `fcntl(2)`: "a remote locking protocol failed (e.g., locking over NFS)").
pub fn lacks_locks(error: &IoError) -> bool {
    #[cfg(unix)]
    let has_no_service = error.raw_os_error() == Some(rustix::io::Errno::NOLCK.raw_os_error());
    #[cfg(not(unix))]
    let has_no_service = false;
    has_no_service || error.kind() == ErrorKind::Unsupported
}

impl Drop for Held {
    fn drop(&mut self) {
        // If emptying the lock's file fails, the next holder overwrites the file's contents. The lock is
        // released explicitly, since closing the file might not release it: a child process that is being
        // started shares the open file.
        let _ = self.file.set_len(0);
        let _ = self.file.unlock();
    }
}

impl Locks {
    /// Returns the locks in the folder that `RAYCL_LOCK_DIR` names, or else in the shared folder. If `wait` is
    /// false, taking a lock that another process holds causes an error.
    pub fn of_machine(wait: bool) -> Self {
        Self { folder: Folder::of_machine(), wait }
    }

    /// Returns the locks whose files are in `folder`. `wait` has the same meaning as for
    /// [`of_machine`](Self::of_machine).
    pub fn in_folder(folder: &Path, wait: bool) -> Self {
        Self { folder: Folder::named(folder), wait }
    }

    /// Takes a device's lock as soon as no other process and no other thread holds the lock. If `wait` is
    /// false and another process holds the lock, returns an error instead of waiting. While waiting, this
    /// function calls `tells`. An interruption ends the wait with an error.
    pub fn take(
        &self,
        device: &LockName,
        tells: &mut dyn FnMut(LockWait<'_>),
        interrupted: &AtomicBool,
    ) -> Result<Held> {
        let claim = self.claim(device, tells, interrupted)?;
        let mut reported = None;
        loop {
            let failed = |error| self.folder.unusable(device.file(), &error);
            let attempt =
                |must_be_there| self.try_hold(self.folder.open(device.file())?, device, must_be_there);
            if let Attempt::Held(file) = unless_removed(attempt).map_err(failed)? {
                return Ok(Held { file, _claim: Some(claim) });
            }
            let holder = Holder::read(&self.folder.path(device.file()));
            if !self.wait {
                return Err(refused(&holder, device));
            }
            if reported.as_ref() != Some(&holder) {
                let line = format!("waiting for {holder}: the process is measuring on {device}");
                match named::is_first(&self.folder.path(device.file()), &holder) {
                    true => tells(LockWait::For(&line)),
                    false => tells(LockWait::Again(&line)),
                }
                reported = Some(holder);
            }
            pause(device, tells, interrupted).map_err(|error| error.with_help(
                "run the command again when the other process has ended; with --no-wait, raycl ends immediately instead of waiting",
            ))?;
        }
    }

    /// Waits until no other thread of this process holds the device's lock or waits for this lock. A wait for
    /// another thread of the same command needs no message, and `--no-wait` does not forbid it.
    fn claim(
        &self,
        device: &LockName,
        tells: &mut dyn FnMut(LockWait<'_>),
        interrupted: &AtomicBool,
    ) -> Result<Claim> {
        let file = self.folder.path(device.file());
        loop {
            match Claim::of(&file) {
                Some(claim) => return Ok(claim),
                None => pause(device, tells, interrupted)?,
            }
        }
    }

    /// For tests: takes a device's lock, which must be free. After this call, this process has to wait for
    /// the lock as if another process held the lock.
    #[cfg(test)]
    pub(crate) fn held_by_another_process(&self, device: &LockName) -> Held {
        let file = self.folder.open(device.file()).expect("a lock's file");
        match self.try_hold(file, device, true).expect("a lock") {
            Attempt::Held(file) => Held { file, _claim: None },
            Attempt::Busy | Attempt::Removed => panic!("the lock is not free"),
        }
    }

    /// Takes the locks of several devices. While waiting for a lock, calls `says` with each line that
    /// describes a process that holds the lock, unless this process has already reported the line.
    pub fn take_all(
        &self,
        devices: Vec<LockName>,
        says: &mut dyn FnMut(&str),
        interrupted: &AtomicBool,
    ) -> Result<Vec<Held>> {
        let mut tells = |waiting: LockWait<'_>| {
            if let LockWait::For(line) = waiting {
                says(line);
            }
        };
        self.take_all_telling(devices, &mut tells, interrupted)
    }

    /// Takes the locks of several devices, each lock once: two drivers may list the same GPU under different
    /// labels, and a thread that took this GPU's lock twice would wait for itself. Outside of tests, every
    /// thread of every process takes locks with this function, which takes the locks in the order of their
    /// files' names. No two threads can therefore wait for each other. While waiting, this function calls
    /// `tells`.
    pub fn take_all_telling(
        &self,
        mut devices: Vec<LockName>,
        tells: &mut dyn FnMut(LockWait<'_>),
        interrupted: &AtomicBool,
    ) -> Result<Vec<Held>> {
        devices.sort();
        devices.dedup();
        devices.iter().map(|device| self.take(device, tells, interrupted)).collect()
    }

    /// Makes one attempt to lock `file`, the file of the device's lock. If `must_be_there` is true, the
    /// attempt fails if somebody has removed the file after it was opened.
    fn try_hold(&self, mut file: File, device: &LockName, must_be_there: bool) -> IoResult<Attempt> {
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Ok(Attempt::Busy),
            // If the file system does not support locks, raycl measures without a lock.
            Err(TryLockError::Error(error)) if lacks_locks(&error) => {}
            Err(TryLockError::Error(error)) => return Err(error),
        }
        // If the lock's file was removed after this process opened it, this process's lock does not stop
        // other processes, since other processes lock a new file. The next attempt opens the new file.
        if must_be_there && !self.folder.still_has(device.file(), &file) {
            return Ok(Attempt::Removed);
        }
        // The holder's description in the lock's file is only for messages of waiting processes, and a full
        // disk must not stop a measurement.
        let _ = Holder::of_this_process().write(&mut file);
        Ok(Attempt::Held(file))
    }
}

/// Attempts to lock a file, and tries again if the file was removed after it was opened ([`Attempt::Removed`]). Makes
/// at most [`LOCK_ATTEMPTS`] attempts. The argument of `attempt` is true if the file must still be there: true for
/// every attempt except the last.
fn unless_removed(attempt: impl Fn(bool) -> IoResult<Attempt>) -> IoResult<Attempt> {
    for _ in 1..LOCK_ATTEMPTS {
        match attempt(true)? {
            Attempt::Removed => {}
            held_or_busy => return Ok(held_or_busy),
        }
    }
    attempt(false)
}

/// Waits for a moment for a device's lock. An interruption causes an error.
fn pause(device: &LockName, tells: &mut dyn FnMut(LockWait<'_>), interrupted: &AtomicBool) -> Result<()> {
    if interrupted.load(Ordering::Relaxed) {
        return Err(Error::interrupted(format!("raycl was waiting for {device}")));
    }
    std::thread::sleep(LOOK_UP);
    tells(LockWait::Still);
    Ok(())
}

/// The result of one attempt to take a lock.
enum Attempt {
    /// This process now holds the lock. The variant contains the lock's open file.
    Held(File),
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
    use crate::device::{DeviceKind, tests::example};
    use std::cell::Cell;
    use std::sync::atomic::AtomicUsize;

    static OFF: AtomicBool = AtomicBool::new(false);

    fn cpu() -> LockName {
        LockName::of(None)
    }

    #[test]
    fn one_holds_a_device_and_another_is_refused_or_waits_and_says_for_whom() {
        let folder = tempfile::tempdir().unwrap();
        let locks = Locks::in_folder(&folder.path().join("locks"), false);
        let held = locks.held_by_another_process(&cpu());
        let refused = locks.take(&cpu(), &mut |_| {}, &OFF).err().unwrap();
        let process = format!("process {}", std::process::id());
        assert_eq!(refused.exit_code(), 1);
        assert!(refused.to_string().contains(&process), "{refused}");

        let mut held = Some(held);
        let mut said = Vec::new();
        let mut tells = |waiting: LockWait<'_>| match waiting {
            LockWait::For(line) => said.push(line.to_owned()),
            LockWait::Again(line) => panic!("this process was not named before: {line}"),
            LockWait::Still => {
                said.push("still".to_owned());
                if said.len() == 3 {
                    held = None;
                }
            }
        };
        let second = Locks { wait: true, ..locks }.take(&cpu(), &mut tells, &OFF).unwrap();
        assert!(said[0].starts_with(&format!("waiting for {process}, `")), "{said:?}");
        assert_eq!(said[1..], ["still", "still"]);
        drop(second);
    }

    #[test]
    fn a_process_is_named_once_however_often_others_wait_for_it() {
        let folder = tempfile::tempdir().unwrap();
        let locks = Locks::in_folder(folder.path(), true);
        // Waits once for a process that holds the lock. If `text` is given, the lock's file contains this
        // text, which describes another process.
        let wait_once = |text: Option<&str>| {
            let mut held = Some(locks.held_by_another_process(&cpu()));
            if let Some(text) = text {
                std::fs::write(locks.folder.path(cpu().file()), text).unwrap();
            }
            let mut told = Vec::new();
            let mut tells = |waiting: LockWait<'_>| match waiting {
                LockWait::For(_) => told.push("for"),
                LockWait::Again(_) => told.push("again"),
                LockWait::Still => held = None,
            };
            drop(locks.take(&cpu(), &mut tells, &OFF).unwrap());
            told
        };
        let other = Some("{\"process\": 7}");
        let told = [None, None, other, None, other].map(wait_once);
        assert_eq!(told, [["for"], ["again"], ["for"], ["again"], ["again"]]);
    }

    #[test]
    fn a_gpu_that_two_drivers_list_is_locked_once() {
        let listed = |platform: &str| {
            let mut gpu = example(platform, "Arc", DeviceKind::Gpu, 32);
            gpu.label = format!("Arc ({platform})");
            gpu.hardware.uuid = Some("00ff".into());
            LockName::of(Some(&gpu))
        };
        let names = vec![listed("Intel"), cpu(), listed("rusticl")];
        let folder = tempfile::tempdir().unwrap();
        let held = Locks::in_folder(folder.path(), false).take_all(names, &mut |_| {}, &OFF).unwrap();
        assert_eq!(held.len(), 2, "the GPU's lock and that of the host's processors");
    }

    #[test]
    fn a_holder_that_cannot_be_described_holds_the_device_all_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let locks = Locks::in_folder(folder.path(), false);
        // The lock's file describes an earlier holder only until this holder has released the lock.
        drop(locks.take(&cpu(), &mut |_| {}, &OFF).unwrap());
        // The test opens the lock's file only for reading. The file can then be locked but not written, like
        // a file on a full disk.
        let file = File::open(locks.folder.path(cpu().file())).unwrap();
        let Attempt::Held(_file) = locks.try_hold(file, &cpu(), true).unwrap() else { panic!("it is free") };
        let refused = locks.take(&cpu(), &mut |_| {}, &OFF).err().unwrap();
        assert!(refused.to_string().starts_with("another process is measuring"), "{refused}");
    }

    #[cfg(unix)]
    #[test]
    fn file_systems_without_locks_are_told_apart_from_other_failures() {
        const ENOLCK: i32 = rustix::io::Errno::NOLCK.raw_os_error();
        assert!(lacks_locks(&IoError::from_raw_os_error(ENOLCK)));
        assert!(lacks_locks(&IoError::from(ErrorKind::Unsupported)));
        assert!(!lacks_locks(&IoError::from(ErrorKind::PermissionDenied)));
    }

    #[test]
    fn an_interruption_ends_the_waiting() {
        let folder = tempfile::tempdir().unwrap();
        let locks = Locks::in_folder(folder.path(), true);
        let ended = || locks.take(&cpu(), &mut |_| {}, &AtomicBool::new(true)).err().unwrap();
        let held = locks.held_by_another_process(&cpu());
        assert!(ended().exit_code() == 130 && ended().remedy().contains("--no-wait"), "{}", ended().remedy());
        drop(held);
        let _held = locks.take(&cpu(), &mut |_| {}, &OFF).unwrap();
        assert!(
            ended().exit_code() == 130 && !ended().remedy().contains("--no-wait"),
            "{}",
            ended().remedy()
        );
    }

    #[test]
    fn a_thread_waits_for_another_one_without_a_word_and_even_with_no_wait() {
        let folder = tempfile::tempdir().unwrap();
        let locks = Locks::in_folder(folder.path(), false);
        let mut held = Some(locks.take(&cpu(), &mut |_| {}, &OFF).unwrap());
        let mut tells = |waiting: LockWait<'_>| {
            assert_eq!(waiting, LockWait::Still);
            held = None;
        };
        assert!(locks.take(&cpu(), &mut tells, &OFF).is_ok() && held.is_none());
    }

    #[test]
    fn a_thread_that_was_refused_leaves_the_lock_to_others() {
        let folder = tempfile::tempdir().unwrap();
        let locks = Locks::in_folder(folder.path(), false);
        let held = locks.held_by_another_process(&cpu());
        assert!(locks.take(&cpu(), &mut |_| {}, &OFF).is_err());
        drop(held);
        assert!(locks.take(&cpu(), &mut |_| panic!("it is free"), &OFF).is_ok());
    }

    /// If each of two threads took the locks in the order of its own list, each thread would soon hold one
    /// lock and wait for the other lock.
    #[test]
    fn threads_that_need_the_same_locks_take_them_in_one_order() {
        let folder = tempfile::tempdir().unwrap();
        let gpu = LockName::of(Some(&example("CUDA", "H200", DeviceKind::Gpu, 132)));
        std::thread::scope(|scope| {
            for names in [[cpu(), gpu.clone()], [gpu.clone(), cpu()]] {
                let folder = folder.path();
                scope.spawn(move || {
                    let (locks, mut waits) = (Locks::in_folder(folder, false), 0);
                    let mut tells = |_: LockWait<'_>| {
                        waits += 1;
                        assert!(waits < 1200, "the threads wait for each other");
                    };
                    for _ in 0..5 {
                        let held = locks.take_all_telling(names.to_vec(), &mut tells, &OFF).unwrap();
                        assert_eq!(held.len(), 2);
                        std::thread::yield_now();
                    }
                });
            }
        });
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
        assert!(matches!(locks.try_hold(file, &cpu(), true).unwrap(), Attempt::Removed));
        assert!(locks.take(&cpu(), &mut |_| {}, &OFF).is_ok());
    }

    /// On a file system that changes the inode numbers of its files, every file seems to have been removed.
    #[test]
    fn a_lock_whose_file_always_seems_to_be_removed_is_taken_all_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let (locks, attempts) = (Locks::in_folder(folder.path(), false), Cell::new(0));
        let attempt = |must_be_there| {
            attempts.set(attempts.get() + 1);
            let file = locks.folder.open(cpu().file())?;
            std::fs::remove_file(locks.folder.path(cpu().file()))?;
            locks.try_hold(file, &cpu(), must_be_there)
        };
        assert!(matches!(unless_removed(attempt).unwrap(), Attempt::Held(_)));
        assert_eq!(attempts.get(), LOCK_ATTEMPTS);
    }
}
