//! Starts background processes with low priority, which store data for later commands. The command that casts the
//! picture does not wait for the background processes. Every background process lists the devices, unless an up-to-date
//! list is stored. A background process may also store a program, in two cases: the driver takes long to return the
//! program's binary, or the program was not compiled in time for this picture.

use super::hurry::Later;
use super::{Args, guess, hurry, turn};
use crate::cache::Cache;
use crate::device::{Device, DeviceInfo, LaneOperations, LaneTest, pick_one};
use crate::error::{Error, Result};
use crate::inherited::leave_files;
use crate::launch::{Prepared, Queue};
use crate::own_program::own_worker;
use crate::program::{BuiltProgram, CACHE_DISABLE, ProgramCache, ProgramSpec};
use crate::sources::Sources;
use crate::strategy::{Strategy, preset_of};
use serde::{Deserialize, Serialize};
use std::io::{Read, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::{Builder, sleep};
use std::time::{Duration, SystemTime};

/// The kind of cache entries that record when a background process began to store a program or to list the devices.
const KIND: &str = "order";
/// raycl assumes that a background process is dead if it began longer ago than `LONGEST`.
const LONGEST: Duration = Duration::from_secs(120);
/// The interval at which a background process checks whether the cache's folder still exists.
const LOOK_UP: Duration = Duration::from_millis(50);
/// The environment variables with paths that a driver, its loader or the system's linker read.
#[cfg(unix)]
const PATHS: [&str; 6] = [
    "LD_LIBRARY_PATH",
    "OCL_ICD_FILENAMES",
    "OCL_ICD_VENDORS",
    "OPENCL_VENDOR_PATH",
    "POCL_CACHE_DIR",
    "TMPDIR",
];

/// A task for a background process: to list the devices and, if the task names a program, to compile and
/// store this program.
#[derive(Serialize, Deserialize)]
struct Order {
    /// The text that identifies the device.
    device: String,
    /// The lane operations (such as ballots among work-items that execute together) for which the program was
    /// made. If raycl has not tested yet which lane operations work on the device, `lanes` contains the
    /// fastest lane operations that the device's extensions suggest.
    lanes: LaneOperations,
    /// The program to compile and store; `None` if the process only lists the devices.
    program: Option<Source>,
    /// True if the driver must compile the program instead of taking it from the driver's own cache. raycl stores the
    /// build log together with the program, and a driver prints a build log only if it compiles the program.
    recompile: bool,
}

/// A program's source and compiler options.
#[derive(Clone, Serialize, Deserialize)]
struct Source {
    source: String,
    options: String,
}

/// Starts background processes that store data for later commands. Background processes may store the program that cast
/// the picture. Background processes may also compile the fastest strategy's program (`later`) and the program for the
/// display transform (`show_later`). If no program is stored or compiled, and the device's lane operations are not
/// tested yet, a background process only lists the devices, which includes this test. Also stores in the cache which
/// program the scene needs. Returns notes for the user about the background processes.
pub fn for_the_next_start(
    args: &Args,
    device: &Device,
    prepared: &Prepared,
    strategy: &Strategy,
    (later, show_later): (Option<Later>, Option<ProgramSpec>),
) -> Vec<String> {
    // With --cl-dir or --watch, the user is probably editing kernels or the scene, so storing the program is not
    // worth it.
    let stores = args.subject.cl_dir.is_none() && !args.watch && order(prepared, device);
    let shows = show_later.is_some_and(|spec| compile_later(&Cache::of_user(), &spec, &device.info));
    // Every background process also lists the devices. A process that only lists the devices is needed only
    // if no other background process starts.
    if !stores && !shows && later.is_none() && !device.lanes_are_tested {
        list_later(&device.info);
    }
    let mut notes: Vec<String> = stores.then(|| STORES.to_owned()).into_iter().collect();
    let (mut strategy, mut workload) = (*strategy, prepared.workload);
    if let Some(later) = later {
        notes.push(hurried(&later.strategy));
        let compiles = compile_later(&Cache::of_user(), &later.spec, &device.info);
        notes.extend(compiles.then(|| COMPILES.to_owned()));
        (strategy, workload) = (later.strategy, later.workload);
    }
    guess::remember(&guess::cache(args), args, &device.info, &strategy, &workload);
    notes
}

const STORES: &str =
    "another process is storing the compiled program, so that raycl need not compile it the next time";

/// Returns the note for a picture that was cast with [`hurry::QUICK`].
fn hurried(fastest: &Strategy) -> String {
    let name = preset_of(fastest).map_or_else(|| fastest.to_string(), str::to_owned);
    format!(
        "the fastest strategy ({name}) is not compiled yet, so this picture was cast with the preset {}",
        hurry::QUICK
    )
}

const COMPILES: &str =
    "another process is compiling the fastest strategy, so that raycl can use it the next time";

/// Starts a background process that stores the program of `prepared`, if this is worthwhile
/// ([`is_worth_storing`]). Returns true if the process has started.
fn order(prepared: &Prepared, device: &Device) -> bool {
    let cache = Cache::of_user();
    let worth = is_worth_storing(&cache, prepared.program.from_cache, &device.info);
    worth && in_background(&cache, &prepared.spec, &device.info)
}

/// Returns true if a background process should store a program. Three conditions must hold: raycl can use the
/// cache, the program did not come from the cache, and the driver needs a long time to return the program's
/// binary.
fn is_worth_storing(cache: &Cache, from_cache: bool, device: &DeviceInfo) -> bool {
    !from_cache && !device.has_binaries_at_hand() && cache.is_usable()
}

/// Starts a background process that compiles and stores a program, unless another process is already doing
/// this work. Returns false if raycl cannot use the cache, and true otherwise, even if the background process
/// could not start. If the background process could not start, the next command also finds the program uncompiled, and
/// casts its picture without this program.
fn compile_later(cache: &Cache, spec: &ProgramSpec, device: &DeviceInfo) -> bool {
    if cache.is_usable() {
        in_background(cache, spec, device);
    }
    cache.is_usable()
}

/// Starts a background process that tests the device's lane operations and stores the list of devices. If the process
/// cannot start, the next command lists the devices again.
fn list_later(device: &DeviceInfo) {
    let cache = Cache::of_user();
    if cache.is_usable() && begin(&cache, &device.identity()) {
        let _ = start(&order_for(device, None));
    }
}

fn in_background(cache: &Cache, spec: &ProgramSpec, device: &DeviceInfo) -> bool {
    let [source, options] = [&spec.source, &spec.options].map(Clone::clone);
    begin(cache, &spec.hash()) && start(&order_for(device, Some(Source { source, options }))).is_ok()
}

fn order_for(device: &DeviceInfo, program: Option<Source>) -> Order {
    Order { device: device.identity(), lanes: device.limits.lane_operations, program, recompile: false }
}

/// Records that a background process will do the work that `name` identifies. Returns `false` if another
/// process is already doing this work, or if the record cannot be written.
fn begin(cache: &Cache, name: &str) -> bool {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    let since = cache.get(KIND, name).and_then(|bytes| bytes.try_into().ok()).map(u64::from_le_bytes);
    // If the clock was ahead when `since` was stored, `since` may be later than `now`. Therefore the sign of
    // the difference between `now` and `since` does not matter below.
    let free = since.is_none_or(|since| now.as_secs().abs_diff(since) > LONGEST.as_secs());
    free && cache.put(KIND, name, &now.as_secs().to_le_bytes())
}

/// Starts the background process, and waits until the background process has closed the files that it
/// inherited from raycl. If the inherited files stayed open, locks and pipes of the program that started
/// raycl would stay in use after raycl has ended.
fn start(order: &Order) -> std::io::Result<()> {
    let text = serde_json::to_vec(order)?;
    let mut child = background(order).map_err(std::io::Error::other)?.spawn()?;
    child.stdin.take().map_or(Ok(()), |mut input| input.write_all(&text))?;
    if let Some(mut output) = child.stdout.take() {
        // The background process prints nothing. Reading the background process's output ends when that
        // process closes the files that it inherited, or when it ends.
        let _ = std::io::copy(&mut output, &mut std::io::sink());
    }
    Ok(())
}

/// Returns the command that starts the background process.
fn background(order: &Order) -> Result<Command> {
    let mut command = own_worker()?;
    if order.recompile {
        command.env(CACHE_DISABLE, "1");
    }
    command.arg("--keep").stdin(Stdio::piped()).stderr(Stdio::null());
    detach(&mut command);
    Ok(command)
}

/// Separates the background process from this command's caller. A signal for the process group of the command, such
/// as Ctrl-C, does not reach the background process. The background process also leaves the current folder, so that
/// it does not keep the folder's disk in use. The background process stays in the current folder only if an environment
/// variable for drivers names an existing file or folder relative to the current folder.
#[cfg(unix)]
fn detach(command: &mut Command) {
    use std::os::unix::process::CommandExt as _;
    command.process_group(0).stdout(Stdio::piped());
    if !PATHS.iter().filter_map(std::env::var_os).any(|paths| names_relative(&paths)) {
        command.current_dir("/");
    }
}

/// Discards the background process's output. On systems other than Unix, the background process closes no
/// inherited files, so nobody waits for the end of its output.
#[cfg(not(unix))]
fn detach(command: &mut Command) {
    command.stdout(Stdio::null());
}

/// Returns true if one of `paths` (separated as in the variable `PATH`) exists and is relative to the current
/// folder.
#[cfg(unix)]
fn names_relative(paths: &std::ffi::OsStr) -> bool {
    std::env::split_paths(paths).any(|path| path.is_relative() && path.exists())
}

/// Does the work of the background process: reads the task ([`Order`]) from standard input, and lists the devices if
/// no list is stored. If the task has a program, also builds and stores this program. The process ends early if the
/// cache's folder is removed: a user who removed the folder would not expect raycl to make it again. No driver may be
/// loaded before this function is called, since the function closes all open files except the standard streams, and
/// would close the driver's files, too.
pub fn serve() -> Result<()> {
    leave_files();
    // The command that starts this process waits until this process has closed the files that it inherited.
    let order = read_order(std::io::stdin())?;
    yield_to_others();
    let cache = Cache::of_user().only_while_it_exists();
    let Some(folder) = cache.folder().filter(|folder| folder.is_dir()) else { return Ok(()) };
    end_without(folder.to_owned())?;
    // If another process compiles for too long, this process ends; the next command orders this work again.
    let Some(_turn) = turn::wait(folder, LONGEST) else { return Ok(()) };
    let choose = |infos: &[DeviceInfo]| Ok(infos.iter().position(|info| info.identity() == order.device));
    let device = pick_one(&cache, &Sources::Embedded, LaneTest::Now, choose)?;
    // A device's identity contains the version of its driver, so a device whose driver has changed is not
    // found.
    let device = device.ok_or_else(|| {
        Error::run("no driver lists the device of this background process: the device has disappeared, or its driver has changed")
    })?;
    // The test of the device may have found other lane operations (by which work-items exchange values) than
    // those for which the program was made. In this case, the next command needs another program, so this process does
    // not store the program.
    let Some(Source { source, options }) = program_for(&order, &device.info) else { return Ok(()) };
    let queue = Queue::open(&device)?;
    let spec = ProgramSpec { source, options, files: Vec::new() };
    let programs = ProgramCache::of(cache, &device.info);
    let built = BuiltProgram::build(&queue.context, queue.device, &spec, &programs);
    let built = built.map_err(|error| Error::run(error.to_string()))?;
    if built.lacks_log() && !order.recompile {
        return start(&Order { recompile: true, ..order }).map_err(|error| Error::run(error.to_string()));
    }
    built.store();
    built.rehearse();
    Ok(())
}

/// Starts a thread that ends this process as soon as the cache's folder no longer exists.
fn end_without(folder: PathBuf) -> Result<()> {
    let watch = move || wait_while_it_exists(&folder);
    Builder::new().spawn(watch).map_err(|error| Error::no_thread(&error))?;
    Ok(())
}

/// Ends this process as soon as a folder no longer exists.
fn wait_while_it_exists(folder: &Path) {
    while folder.is_dir() {
        sleep(LOOK_UP);
    }
    signal_hook::low_level::exit(0);
}

/// Reads the task of the background process.
fn read_order(input: impl Read) -> Result<Order> {
    serde_json::from_reader(input)
        .map_err(|error| Error::fault(format!("the task of the background process is not valid: {error}")))
}

/// Returns the program that the background process is to store. Returns `None` if the order (the task of the process)
/// contains no program. Also returns `None` if the program uses other lane operations (by which work-items
/// exchange values) than raycl uses on the device.
fn program_for(order: &Order, device: &DeviceInfo) -> Option<Source> {
    order.program.clone().filter(|_| order.lanes == device.limits.lane_operations)
}

/// Lowers this process's priority, since users may be waiting for other processes but not for this one.
#[cfg(unix)]
fn yield_to_others() {
    // If the system does not allow a lower priority, the process continues with normal priority.
    let _ = rustix::process::nice(19);
}

#[cfg(not(unix))]
fn yield_to_others() {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::{DeviceKind, tests::example};
    use std::ffi::OsStr;

    #[test]
    fn a_program_for_assumed_lane_operations_is_stored_only_if_the_device_has_them() {
        let mut device = example("CUDA", "H200", DeviceKind::Gpu, 132);
        device.limits.lane_operations = LaneOperations::Ptx;
        let source = Source { source: "kernel".into(), options: "-D A=1".into() };
        let order = order_for(&device, Some(source));
        assert_eq!(order.device, device.identity());
        let stored = program_for(&order, &device).map(|program| program.source + " " + &program.options);
        assert_eq!(stored.as_deref(), Some("kernel -D A=1"));
        device.limits.lane_operations = LaneOperations::Barriers;
        assert!(program_for(&order, &device).is_none());
        assert!(program_for(&order_for(&device, None), &device).is_none());
    }

    #[test]
    fn a_task_is_read_as_it_was_sent_even_if_it_has_no_program() {
        let device = example("CUDA", "H200", DeviceKind::Gpu, 132);
        let sent = serde_json::to_vec(&order_for(&device, None)).expect("a task");
        let read = read_order(&sent[..]).expect("a task");
        assert!(read.device == device.identity() && read.program.is_none());
        let error = read_order(&b"{"[..]).err().expect("half a task").to_string();
        assert!(error.contains("the task of the background process is not valid: "), "{error}");
    }

    #[test]
    fn a_process_stores_only_what_is_not_stored_yet_and_takes_long_to_return() {
        let folder = tempfile::tempdir().expect("a folder");
        let cache = Cache::at(&folder.path().join("cache"), 1 << 20);
        let slow = example("Portable Computing Language", "cpu", DeviceKind::Cpu, 2);
        let fast = example("CUDA", "H200", DeviceKind::Gpu, 132);
        assert!(is_worth_storing(&cache, false, &slow));
        assert!(!is_worth_storing(&cache, true, &slow) && !is_worth_storing(&cache, false, &fast));
        assert!(!is_worth_storing(&Cache::none(), false, &slow));
    }

    #[test]
    fn a_program_that_another_process_is_compiling_is_reported_and_not_compiled_twice() {
        let folder = tempfile::tempdir().expect("a folder");
        let cache = Cache::at(&folder.path().join("cache"), 1 << 20);
        let device = example("CUDA", "H200", DeviceKind::Gpu, 132);
        let spec = ProgramSpec { source: "kernel".into(), options: "-D A=1".into(), files: Vec::new() };
        assert!(begin(&cache, &spec.hash()));
        assert!(!in_background(&cache, &spec, &device), "another process has begun");
        assert!(compile_later(&cache, &spec, &device));
        assert!(!compile_later(&Cache::none(), &spec, &device), "without a cache, nothing can be stored");
        let file = folder.path().join("file");
        std::fs::write(&file, "").expect("a file");
        assert!(!compile_later(&Cache::at(&file, 1 << 20), &spec, &device), "nor in a file");
    }

    #[test]
    fn a_process_uses_the_drivers_cache_unless_the_program_has_to_be_compiled_anew() {
        let device = example("CUDA", "H200", DeviceKind::Gpu, 132);
        let command = |recompile: bool| {
            background(&Order { recompile, ..order_for(&device, None) }).expect("a command")
        };
        let disabled = |recompile: bool| {
            let of = |(name, value): (&OsStr, Option<&OsStr>)| {
                (name == CACHE_DISABLE).then(|| value == Some("1".as_ref()))
            };
            command(recompile).get_envs().find_map(of)
        };
        assert_eq!((disabled(false), disabled(true)), (None, Some(true)));
        assert!(command(false).get_args().eq(["worker", "--keep"]));
        #[cfg(unix)]
        assert_eq!(command(false).get_current_dir(), Some(Path::new("/")), "the caller's folder stays free");
        assert!(!order_for(&device, None).recompile, "at first, the driver's cache is used");
    }

    #[test]
    #[cfg(unix)]
    fn only_a_path_that_is_there_depends_on_the_current_folder() {
        // Tests run in the folder of Cargo.toml.
        for (paths, expected) in
            [("src", true), ("/usr/lib:./src", true), ("/", false), ("", false), ("no-such-file", false)]
        {
            assert_eq!(names_relative(paths.as_ref()), expected, "{paths}");
        }
    }

    #[test]
    fn a_note_names_the_fastest_strategy_and_the_one_that_was_used() {
        let strategy = crate::strategy::preset("deferred").expect("a preset").strategy;
        let expected = "the fastest strategy (deferred) is not compiled yet, so this picture was cast with the preset bvh";
        assert_eq!(hurried(&strategy), expected);
    }

    #[test]
    fn work_is_begun_again_only_after_its_process_must_have_died() {
        let folder = tempfile::tempdir().expect("a folder");
        let cache = Cache::at(&folder.path().join("cache"), 1 << 20);
        assert!(begin(&cache, "a") && !begin(&cache, "a") && begin(&cache, "b"));
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).expect("a clock").as_secs();
        let began_s_ago = |ago: u64| {
            cache.put(KIND, "a", &(now - ago).to_le_bytes());
            begin(&cache, "a")
        };
        // The limit LONGEST is two minutes. The test itself takes less than half a minute, so a background
        // process that began one minute ago does not count as dead.
        assert!(began_s_ago(121) && !began_s_ago(60));
        // The stored time at which the background process began lies an hour in the future, as if the clock had been
        // ahead when the time was stored.
        cache.put(KIND, "a", &(now + 3600).to_le_bytes());
        assert!(begin(&cache, "a"));
    }
}
