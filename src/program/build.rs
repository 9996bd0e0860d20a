//! Compiles a [`ProgramSpec`] for a device.

use super::ProgramSpec;
use super::compiled::is_ptx;
use super::stored::{ProgramCache, StoredProgram};
use crate::clock::ms_since;
use crate::device::{CallError, build, compile, forget_failures, quieting};
use crate::sources::Sources;
use ocl::core::create_program_with_binary;
use ocl::enums::{ProgramBuildInfo, ProgramInfo, ProgramInfoResult};
use ocl::{Context, Device, Program};
use std::ffi::CString;
use std::time::Instant;
use thiserror::Error;

/// The option with which NVIDIA's compiler prints each kernel's registers and spills into the build log. The
/// option `-cl-nv-verbose` is not part of a [`ProgramSpec`], since it does not change the compiled code.
const VERBOSE: &str = "-cl-nv-verbose";
/// An environment variable that turns off the cache of NVIDIA's compiler if the variable's value is 1. The
/// compiler prints registers and spills only when it compiles a program, not when it takes the program from
/// its cache.
pub const CACHE_DISABLE: &str = "CUDA_CACHE_DISABLE";

/// The error if the compiler rejected a program, or if the driver could not compile the program.
#[derive(Debug, Error)]
#[error("{log}")]
pub struct BuildError {
    /// The compiler's messages about the program or, if the driver could not compile the program, the
    /// driver's error.
    pub log: String,
    /// True if the program contains a kernel file that the user added or changed. raycl then assumes that the mistake
    /// is in such a file. False until `located` has looked for such files.
    pub has_own_file: bool,
    /// True if the same build may succeed later: the build failed for a reason that has nothing to do with
    /// the program, such as a lack of memory.
    pub may_pass: bool,
}

impl BuildError {
    /// Replaces the names of kernel files in the log by their paths, and sets `has_own_file`. The compiler
    /// names a file relative to `cl/` or to the user's folder, or states only a line number in the whole
    /// program. The log of an error that may not occur again (`may_pass`), such as a lack of memory, stays
    /// unchanged, since such an error says nothing about the program.
    pub(crate) fn located(self, sources: &Sources, spec: &ProgramSpec) -> Self {
        if self.may_pass {
            return self;
        }
        let (log, has_own_file) = sources.located(&self.log, &spec.source, &spec.files);
        Self { log, has_own_file, ..self }
    }
}

/// A program compiled for one device.
#[derive(Debug)]
pub struct BuiltProgram {
    /// The OpenCL object of the compiled program.
    pub program: Program,
    /// The time that the build took. The build is short if the driver takes the program from the driver's own
    /// cache.
    pub build_ms: f64,
    /// True if the program came from raycl's cache, and nothing was compiled.
    pub from_cache: bool,
    device: Device,
    verbose: bool,
    /// The compiler's messages, which were stored with the program; `None` if the program did not come from
    /// raycl's cache.
    cached_log: Option<String>,
    programs: ProgramCache,
    key: String,
    options: String,
    context: Context,
}

impl BuiltProgram {
    /// Takes the program from raycl's cache, or compiles the program if the cache does not contain it. Stores
    /// a compiled program in the cache at once if the driver can return the program's binary without
    /// compiling again.
    pub fn build(
        context: &Context,
        device: Device,
        spec: &ProgramSpec,
        programs: &ProgramCache,
    ) -> Result<Self, BuildError> {
        let start = Instant::now();
        let verbose = prints_resources(device);
        let options = options(device, spec);
        let key = programs.key(&spec.source, &options);
        programs.distrust(&key);
        let cached =
            programs.find(&key).and_then(|stored| Some((load(context, device, &stored, &options)?, stored)));
        let (program, cached_log) = match cached {
            Some((program, stored)) => (program, Some(stored.log)),
            None => (compile(context, device, &spec.source, &options).map_err(refusal)?, None),
        };
        let build_ms = ms_since(start);
        let from_cache = cached_log.is_some();
        let programs = programs.clone();
        let context = context.clone();
        let built = Self {
            program,
            build_ms,
            from_cache,
            device,
            verbose,
            cached_log,
            programs,
            key,
            options,
            context,
        };
        if built.programs.has_binaries_at_hand() {
            built.store();
        }
        Ok(built)
    }

    /// Returns true if raycl's cache contains the program, so that nothing needs to be compiled.
    pub fn is_cached(device: Device, spec: &ProgramSpec, programs: &ProgramCache) -> bool {
        programs.find(&programs.key(&spec.source, &options(device, spec))).is_some()
    }

    /// Stores the compiled program in raycl's cache. Returns true if the cache now contains the program. Does
    /// not store a program whose compiler messages are missing ([`Self::lacks_log`]). Storing may take long,
    /// because some drivers compile every kernel again to return the binary.
    pub fn store(&self) -> bool {
        if self.from_cache || !self.programs.is_usable() {
            return self.from_cache;
        }
        if self.lacks_log() {
            return false;
        }
        let binary = self.binary();
        !binary.is_empty() && self.programs.store(&self.key, &StoredProgram { log: self.log(), binary })
    }

    /// Returns true if the compiler can print the kernels' registers, but printed nothing. The compiler prints
    /// registers only when it compiles. If the compiler printed nothing, the driver has probably taken the program from
    /// the driver's own cache.
    pub fn lacks_log(&self) -> bool {
        self.verbose && !self.from_cache && self.log().is_empty()
    }

    /// Stores the program if raycl's cache does not contain it yet. Returns the program's key; `None` if the
    /// program cannot be stored.
    pub fn stored_as(&self) -> Option<&str> {
        self.store().then_some(&self.key)
    }

    /// Loads the program from raycl's cache and drops it again. Does nothing unless this process has compiled
    /// and stored the program, and the program's binary is PTX. A driver whose binaries are PTX compiles the
    /// PTX to machine code when the program is loaded. Loading the program now puts this machine code into
    /// the driver's cache, where the next process finds it.
    pub fn rehearse(&self) {
        if self.from_cache || self.ptx().is_empty() {
            return;
        }
        if let Some(stored) = self.programs.find(&self.key) {
            drop(load(&self.context, self.device, &stored, &self.options));
        }
    }

    /// Returns the compiler's messages about the program, or an empty text if the compiler printed no
    /// messages.
    pub fn log(&self) -> String {
        if let Some(log) = &self.cached_log {
            return log.clone();
        }
        let log = self.program.build_info(self.device, ProgramBuildInfo::BuildLog);
        let log = log.map(|log| log.to_string()).unwrap_or_default();
        log.trim_matches(|c: char| c == '\0' || c.is_whitespace()).to_owned()
    }

    /// Returns the program's binary, or no bytes if the driver does not return a binary. To return the
    /// binary, some drivers recompile every kernel.
    pub fn binary(&self) -> Vec<u8> {
        match self.program.info(ProgramInfo::Binaries) {
            Ok(ProgramInfoResult::Binaries(binaries)) => {
                binaries.into_iter().find(|binary| !binary.is_empty()).unwrap_or_default()
            }
            _ => Vec::new(),
        }
    }

    /// Returns the program's binary if the binary is PTX text, else an empty text. Queries the binary only if
    /// the compiler can print registers (NVIDIA's can), since other drivers do not return PTX.
    pub fn ptx(&self) -> String {
        let binary = if self.verbose { self.binary() } else { Vec::new() };
        if is_ptx(&binary) { String::from_utf8_lossy(&binary).into_owned() } else { String::new() }
    }
}

/// Returns a program's compiler options, and the option that makes the device's compiler print the kernels'
/// resources. If the compiler cannot print resources, but has an option that stops the compiler's output to
/// the terminal, adds that option instead.
fn options(device: Device, spec: &ProgramSpec) -> String {
    let more = if prints_resources(device) { VERBOSE } else { quieting(device) };
    format!("{} {more}", spec.options).trim_end().to_owned()
}

fn refusal(error: CallError) -> BuildError {
    let may_pass = error.may_pass();
    BuildError { log: error.message, has_own_file: false, may_pass }
}

/// Loads a program from a stored binary; `None` if the driver does not accept the binary.
fn load(context: &Context, device: Device, stored: &StoredProgram, options: &str) -> Option<Program> {
    let options = CString::new(options).ok()?;
    let program = create_program_with_binary(context.as_core(), &[device], &[&stored.binary]).ok()?;
    // If loading fails, the caller compiles the program instead, so the driver's messages about the failure
    // are dropped.
    build(program, device, &options).inspect_err(|_| forget_failures()).ok()
}

/// Returns true if the device's compiler has an option to print a kernel's registers and spills. The function
/// [`DeviceInfo::prints_resources`](crate::device::DeviceInfo::prints_resources) returns the same answer, but
/// needs a `DeviceInfo` instead of a device handle.
fn prints_resources(device: Device) -> bool {
    let extensions = ocl::core::get_device_info(device, ocl::core::DeviceInfo::Extensions);
    extensions
        .is_ok_and(|names| names.to_string().split_whitespace().any(|name| name == "cl_nv_compiler_options"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cache::Cache;
    use crate::device::discover;

    #[test]
    fn an_error_is_the_users_if_the_program_contains_a_file_of_the_folder() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::create_dir(folder.path().join("cast")).expect("a folder");
        std::fs::write(folder.path().join("cast/shade.cl"), "").expect("a file");
        let sources = Sources::Folder(folder.path().to_owned());
        let files = ["cast/shade.cl".to_owned(), "cast/scene.cl".to_owned()];
        let source = "#line 1 \"cast/shade.cl\"\none\ntwo\n#line 1 \"cast/scene.cl\"\n";
        let spec = |files: &[String]| ProgramSpec {
            source: source.to_owned(),
            options: String::new(),
            files: files.to_vec(),
        };
        let error = |log: &str| BuildError { log: log.to_owned(), has_own_file: false, may_pass: false };
        let located = |log: &str| {
            let located = error(log).located(&sources, &spec(&files));
            assert!(located.has_own_file, "{log}");
            located.log
        };
        let shade = format!("{}/cast/shade.cl", folder.path().display());
        // NVIDIA's compiler names no file, only a line of the whole program.
        assert_eq!(located("<kernel>:3:1: error: no"), format!("{shade}:2:1: error: no"));
        assert_eq!(located("error: cast/shade.cl:1:1: no"), format!("error: {shade}:1:1: no"));
        // The next two messages of the compiler do not name the user's file, so raycl's message must add the
        // file's name. The first of these two messages names a built-in file, which may use a name that the
        // user's file defines wrongly. The second of these two messages names no file.
        let why =
            format!("the built-in kernel files compile by themselves, but this program contains {shade}: ");
        let note = "\nnote: cast/shade.cl:2:2: it is declared here";
        let other = located(&format!("error: cast/scene.cl:1:1: no{note}"));
        let note = format!("\nnote: {shade}:2:2: it is declared here");
        assert_eq!(other, format!("{why}error: cl/cast/scene.cl:1:1: no{note}"));
        assert_eq!(located("error: no"), format!("{why}error: no"));
        // If the program contains no file from the user's folder, the mistake is not in a user's file.
        let built_in = error("error: cast/scene.cl:1:1: no").located(&sources, &spec(&files[1..]));
        assert!(!built_in.has_own_file && built_in.log.starts_with("error: cl/cast/scene.cl"), "{built_in}");
        // The driver's lack of memory says nothing about the program.
        let status = "Status error code: CL_OUT_OF_HOST_MEMORY (-6)";
        let lacking = BuildError { may_pass: true, ..error(status) }.located(&sources, &spec(&files));
        assert_eq!((lacking.log.as_str(), lacking.has_own_file), (status, false));
        // An unchanged copy of a built-in file in the user's folder is not reported as the cause.
        let copied = Sources::Embedded.read("cast/shade.cl").expect("a kernel file");
        std::fs::write(folder.path().join("cast/shade.cl"), copied).expect("a file");
        let copy = error("error: cast/scene.cl:1:1: no").located(&sources, &spec(&files));
        assert_eq!((copy.log.as_str(), copy.has_own_file), ("error: cl/cast/scene.cl:1:1: no", false));
    }

    /// Only NVIDIA's compiler prints registers. So that the test runs with any compiler, the test gives the
    /// program the messages of NVIDIA's compiler.
    #[test]
    fn a_program_whose_messages_are_missing_is_not_stored() {
        let device = discover(&Sources::Embedded).expect("the tests need PoCL: make setup").remove(0);
        let folder = tempfile::tempdir().expect("a folder");
        let programs = ProgramCache::of(Cache::at(folder.path(), 1 << 28), &device.info);
        let context = Context::builder().platform(device.platform).devices(device.device).build();
        let spec = ProgramSpec {
            source: "__kernel void nothing(void) {}\n".to_owned(),
            options: String::new(),
            files: Vec::new(),
        };
        let built = BuiltProgram::build(&context.expect("a context"), device.device, &spec, &programs);
        let mut built = BuiltProgram { verbose: true, ..built.expect("a program") };
        for (log, is_stored) in [("", false), ("Used 8 registers", true)] {
            (built.key, built.cached_log) = (format!("key of '{log}'"), Some(log.to_owned()));
            assert_eq!(built.store(), is_stored, "{log}");
            assert_eq!(
                programs.find(&built.key).map(|program| program.log),
                is_stored.then(|| log.to_owned())
            );
        }
    }
}
