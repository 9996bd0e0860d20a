//! Lists the environment variables that OpenCL drivers read. A run of `raycl run` stores every one of these
//! variables that is set. Variables that affect times or pictures are also part of the keys under which
//! measured points are stored, unless they have a usual value (see `outer_loops.rs`).

use super::outer_loops::is_usual;
use super::threads::{is_set_by_raycl, sets_threads};
use std::sync::OnceLock;

/// The environment variables of one driver that affect its compiled code, its number of threads or its launches of
/// kernels. A name that ends in `*` stands for all names that begin with the part before the `*`.
struct Driver {
    /// A text that the platform's name contains, in lower case.
    platform: &'static str,
    deciding: &'static [&'static str],
}

/// The variables that affect times or pictures, for each driver. The key (a hash) under which a measured
/// point is stored also depends on the variables that are set for the driver of the point's device. Sources:
/// the documentation of PoCL 3.1 and later, the names in PoCL's library, NVIDIA's CUDA programming guide,
/// Intel's guides to its OpenCL and DPC++ runtimes, the flags of AMD's runtime (ROCclr), Mesa's list of
/// environment variables, and Oclgrind's manual. Intel's compiler for GPUs takes each of its flags from a
/// variable that begins with IGC_.
const DRIVERS: [Driver; 6] = [
    Driver {
        platform: "portable computing language",
        deciding: &[
            "POCL_AFFINITY",
            "POCL_BINARY_SPECIALIZE_WG",
            "POCL_CPU_LOCAL_MEM_SIZE",
            "POCL_CPU_MAX_CU_COUNT",
            "POCL_EXTRA_BUILD_FLAGS",
            "POCL_FORCE_PARALLEL_OUTER_LOOP",
            "POCL_FULL_REPLICATION_THRESHOLD",
            "POCL_KERNELLIB_NAME",
            "POCL_LLVM_CPU_NAME",
            "POCL_LLVM_OPT",
            "POCL_MAX_PTHREAD_COUNT",
            "POCL_MAX_WORK_GROUP_SIZE",
            "POCL_PTHREAD_MIN_THREADS",
            "POCL_VECTORIZE_*",
            "POCL_VECTORIZER_*",
            "POCL_WILOOPS_MAX_UNROLL_COUNT",
            "POCL_WORK_GROUP_METHOD",
            "POCL_WORK_GROUP_SPECIALIZATION",
        ],
    },
    Driver {
        platform: "nvidia",
        deciding: &[
            "CUDA_AUTO_BOOST",
            "CUDA_DEVICE_MAX_CONNECTIONS",
            "CUDA_DISABLE_JIT",
            "CUDA_DISABLE_PTX_JIT",
            "CUDA_FORCE_JIT",
            "CUDA_FORCE_PTX_JIT",
            "CUDA_LAUNCH_BLOCKING",
            "CUDA_MPS_ACTIVE_THREAD_PERCENTAGE",
            "CUDA_SCALE_LAUNCH_QUEUES",
        ],
    },
    Driver {
        platform: "intel",
        deciding: &[
            "CL_CONFIG_CPU_FORCE_*",
            "CL_CONFIG_CPU_TARGET_ARCH",
            "CL_CONFIG_CPU_TBB_NUM_WORKERS",
            "CL_CONFIG_CPU_VECTORIZER_MODE",
            "CL_CONFIG_USE_VECTORIZER",
            "DPCPP_CPU_*",
            "IGC_*",
        ],
    },
    Driver {
        platform: "amd accelerated parallel processing",
        deciding: &[
            "AMD_OCL_BUILD_OPTIONS",
            "AMD_OCL_BUILD_OPTIONS_APPEND",
            "GPU_ENABLE_WAVE32_MODE",
            "GPU_ENABLE_WGP_MODE",
        ],
    },
    Driver {
        platform: "rusticl",
        deciding: &[
            "AMD_DEBUG",
            "GALLIVM_*",
            "INTEL_DEBUG",
            "INTEL_SIMD_DEBUG",
            "LP_NATIVE_VECTOR_WIDTH",
            "LP_NUM_THREADS",
            "NIR_DEBUG",
            "RUSTICL_CL_VERSION",
            "RUSTICL_DEVICE_TYPE",
            "RUSTICL_FEATURES",
            "ZINK_DEBUG",
        ],
    },
    // `oclgrind --build-options` sets the variable `OCLGRIND_BUILD_OPTIONS`.
    Driver { platform: "oclgrind", deciding: &["OCLGRIND_BUILD_OPTIONS"] },
];

/// Variables, besides those in `DRIVERS`, that select devices or a number of threads. If the variables in
/// `SELECTING` are not set to the same values again, a repeated command may measure on other devices, or with
/// another number of threads. `SELECTING` leaves out variables that schedulers set for each job, such as
/// `CUDA_VISIBLE_DEVICES`.
const SELECTING: [&str; 8] = [
    "OCL_ICD_FILENAMES",
    "OCL_ICD_VENDORS",
    "OPENCL_VENDOR_PATH",
    "POCL_CPU_MIN_CU_COUNT",
    "POCL_DEVICES",
    "POCL_MAX_COMPUTE_UNITS",
    "RAYON_NUM_THREADS",
    "RUSTICL_ENABLE",
];

/// Variables that match a pattern in `DRIVERS`, but only make the driver print messages or write files.
const LOGS: [&str; 4] =
    ["IGC_DumpToCurrentDir", "IGC_DumpToCustomDir", "IGC_ShaderDumpEnable", "POCL_VECTORIZER_REMARKS"];

/// The beginning of the setting (`NAME=VALUE`) that chooses the cores on which PoCL's threads run. `DRIVERS`
/// contains the variable `POCL_AFFINITY`. The choice of cores affects times, but not the compiled code.
const PLACES: &str = "POCL_AFFINITY=";

/// Prefixes of variables that drivers, loaders and the thread library Rayon read, including variables for caches, for
/// logs and for hiding devices. The `environment.json` of a run contains every variable that is set and has one of
/// these prefixes.
const PREFIXES: [&str; 24] = [
    "AMD_",
    "CL_CONFIG_",
    "CUDA_",
    "DPCPP_CPU_",
    "GALLIVM_",
    "GPU_",
    "HIP_",
    "HSA_",
    "IGC_",
    "INTEL_",
    "LD_PRELOAD",
    "LP_",
    "MESA_",
    "NIR_",
    "NVIDIA_",
    "OCLGRIND_",
    "OCL_ICD_",
    "OPENCL_",
    "POCL_",
    "RAYON_",
    "ROCR_",
    "RUSTICL_",
    "ZE_",
    "ZINK_",
];

/// An environment variable and its value, as `NAME=VALUE`.
pub type Setting = String;

/// Returns the variables that affect times or pictures on a device of this platform, sorted by name.
pub fn deciding(platform: &str) -> Vec<Setting> {
    deciding_of(platform, variables())
}

/// Returns true if a variable that is set may affect the driver's compiled code.
pub fn compiles(setting: &Setting) -> bool {
    !setting.starts_with(PLACES)
}

/// Returns every variable that is set and has one of the prefixes in `PREFIXES`, sorted by name.
pub fn all() -> Vec<Setting> {
    let known = |name: &str| PREFIXES.iter().any(|prefix| name.starts_with(prefix));
    settings(variables(), known)
}

/// The environment variables of the user that a repeated command needs. Their values are those from before raycl itself
/// set any variables.
static OF_USER: OnceLock<Vec<Setting>> = OnceLock::new();

/// Returns the variables that must be set to the same values when a user repeats a command, sorted by name.
/// The function remembers the variables that are set at its first call, which must be before raycl itself
/// sets variables of drivers.
pub fn of_user() -> &'static [Setting] {
    OF_USER.get_or_init(|| without_usual(settings(variables(), is_to_be_repeated)))
}

/// Returns the variables among `settings`, the variables of a device, that raycl itself has set because the
/// user had not set them.
pub fn set_by_raycl(settings: &[Setting]) -> Vec<Setting> {
    not_of(settings, of_user())
}

/// Returns the variables among `settings` that raycl itself sets and that are not among the user's variables,
/// `of_user`.
fn not_of(settings: &[Setting], of_user: &[Setting]) -> Vec<Setting> {
    let is_own = |setting: &&Setting| is_set_by_raycl(name_of(setting)) && !of_user.contains(*setting);
    settings.iter().filter(is_own).cloned().collect()
}

/// Returns true if a variable that is set determines the number of PoCL's threads.
pub fn determines_threads(setting: &str) -> bool {
    sets_threads(name_of(setting))
}

fn name_of(setting: &str) -> &str {
    setting.split_once('=').map_or(setting, |(name, _)| name)
}

/// Returns true if a repeated command needs the variable with this name, and shells can assign a value to a
/// variable of this name.
pub fn is_to_be_repeated(name: &str) -> bool {
    let mut deciding = DRIVERS.iter().flat_map(|driver| driver.deciding);
    name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        && (SELECTING.contains(&name) || deciding.any(|pattern| matches(pattern, name)))
}

/// Returns all environment variables that are set, with invalid UTF-8 replaced.
fn variables() -> impl Iterator<Item = (String, String)> {
    std::env::vars_os()
        .map(|(name, value)| (name.to_string_lossy().into_owned(), value.to_string_lossy().into_owned()))
}

fn deciding_of(platform: &str, variables: impl Iterator<Item = (String, String)>) -> Vec<Setting> {
    let platform = platform.to_lowercase();
    let own = DRIVERS.iter().filter(|driver| platform.contains(driver.platform));
    let names: Vec<&str> = own.flat_map(|driver| driver.deciding).copied().collect();
    without_usual(settings(variables, |name| names.iter().any(|pattern| matches(pattern, name))))
}

fn without_usual(mut settings: Vec<Setting>) -> Vec<Setting> {
    settings.retain(|setting| !is_usual(setting));
    settings
}

fn settings(
    variables: impl Iterator<Item = (String, String)>,
    wanted: impl Fn(&str) -> bool,
) -> Vec<Setting> {
    let set = variables.filter(|(name, _)| wanted(name));
    let mut settings: Vec<_> = set.map(|(name, value)| format!("{name}={value}")).collect();
    settings.sort();
    settings
}

fn matches(pattern: &str, name: &str) -> bool {
    match pattern.strip_suffix('*') {
        Some(beginning) => name.starts_with(beginning) && !LOGS.contains(&name),
        None => name == pattern,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(platform: &str, names: &[&str]) -> Vec<Setting> {
        deciding_of(platform, names.iter().map(|name| ((*name).to_owned(), "1".to_owned())))
    }

    #[test]
    fn a_driver_has_its_own_variables_and_no_other_drivers() {
        let set = ["POCL_WORK_GROUP_METHOD", "CUDA_FORCE_PTX_JIT", "POCL_AFFINITY", "PATH"];
        let pocl = of("Portable Computing Language", &set);
        assert_eq!(pocl, ["POCL_AFFINITY=1", "POCL_WORK_GROUP_METHOD=1"]);
        assert_eq!(of("NVIDIA CUDA", &set), ["CUDA_FORCE_PTX_JIT=1"]);
        assert!(of("another", &set).is_empty());
        assert_eq!(of("Oclgrind", &["OCLGRIND_BUILD_OPTIONS", "OCLGRIND_LOG"]), ["OCLGRIND_BUILD_OPTIONS=1"]);
        let set =
            ["AMD_OCL_BUILD_OPTIONS_APPEND", "GPU_ENABLE_WAVE32_MODE", "IGC_VISAOptions", "LP_NUM_THREADS"];
        let amds = of("AMD Accelerated Parallel Processing", &set);
        assert_eq!(amds, ["AMD_OCL_BUILD_OPTIONS_APPEND=1", "GPU_ENABLE_WAVE32_MODE=1"]);
        assert!(amds.iter().all(compiles), "programs with other options differ");
        assert_eq!(of("Intel(R) OpenCL Graphics", &set), ["IGC_VISAOptions=1"]);
        assert_eq!(of("rusticl", &set), ["LP_NUM_THREADS=1"]);
        assert!(of("Portable Computing Language", &set).is_empty());
    }

    #[test]
    fn the_setting_that_raycl_makes_for_loops_decides_nothing() {
        let of = |value: &str| {
            let set = [("POCL_FORCE_PARALLEL_OUTER_LOOP".to_owned(), value.to_owned())];
            deciding_of("Portable Computing Language", set.into_iter())
        };
        assert!(of("0").is_empty());
        assert_eq!(of("1"), ["POCL_FORCE_PARALLEL_OUTER_LOOP=1"]);
    }

    #[test]
    fn every_driver_has_all_of_its_variables() {
        // The names come from the sources that the comment on `DRIVERS` lists. For each pattern in `DRIVERS` that ends
        // in `*`, the lists contain one name that matches the pattern.
        let lists = [
            (
                "Portable Computing Language",
                "POCL_AFFINITY POCL_BINARY_SPECIALIZE_WG POCL_CPU_LOCAL_MEM_SIZE POCL_CPU_MAX_CU_COUNT \
                 POCL_EXTRA_BUILD_FLAGS POCL_FORCE_PARALLEL_OUTER_LOOP POCL_FULL_REPLICATION_THRESHOLD \
                 POCL_KERNELLIB_NAME POCL_LLVM_CPU_NAME POCL_LLVM_OPT POCL_MAX_PTHREAD_COUNT \
                 POCL_MAX_WORK_GROUP_SIZE POCL_PTHREAD_MIN_THREADS POCL_VECTORIZE_WI POCL_VECTORIZER_FORCE \
                 POCL_WILOOPS_MAX_UNROLL_COUNT POCL_WORK_GROUP_METHOD POCL_WORK_GROUP_SPECIALIZATION",
            ),
            (
                "NVIDIA CUDA",
                "CUDA_AUTO_BOOST CUDA_DEVICE_MAX_CONNECTIONS CUDA_DISABLE_JIT CUDA_DISABLE_PTX_JIT CUDA_FORCE_JIT \
                 CUDA_FORCE_PTX_JIT CUDA_LAUNCH_BLOCKING CUDA_MPS_ACTIVE_THREAD_PERCENTAGE CUDA_SCALE_LAUNCH_QUEUES",
            ),
            (
                "Intel(R) OpenCL",
                "CL_CONFIG_CPU_FORCE_LOCAL_MEM_SIZE CL_CONFIG_CPU_TARGET_ARCH CL_CONFIG_CPU_TBB_NUM_WORKERS \
                 CL_CONFIG_CPU_VECTORIZER_MODE CL_CONFIG_USE_VECTORIZER DPCPP_CPU_NUM_CUS IGC_VISAOptions",
            ),
            (
                "AMD Accelerated Parallel Processing",
                "AMD_OCL_BUILD_OPTIONS AMD_OCL_BUILD_OPTIONS_APPEND GPU_ENABLE_WAVE32_MODE GPU_ENABLE_WGP_MODE",
            ),
            (
                "rusticl",
                "AMD_DEBUG GALLIVM_PERF INTEL_DEBUG INTEL_SIMD_DEBUG LP_NATIVE_VECTOR_WIDTH LP_NUM_THREADS NIR_DEBUG \
                 RUSTICL_CL_VERSION RUSTICL_DEVICE_TYPE RUSTICL_FEATURES ZINK_DEBUG",
            ),
            ("Oclgrind", "OCLGRIND_BUILD_OPTIONS"),
        ];
        let all: Vec<&str> = lists.iter().flat_map(|(_, names)| names.split_whitespace()).collect();
        for (platform, names) in lists {
            let mut expected: Vec<String> =
                names.split_whitespace().map(|name| format!("{name}=1")).collect();
            expected.sort();
            assert_eq!(of(platform, &all), expected, "{platform}");
        }
    }

    #[test]
    fn a_command_is_repeated_with_the_variables_that_decide_or_select_and_no_others() {
        for name in ["POCL_MAX_PTHREAD_COUNT", "POCL_VECTORIZER_X", "POCL_DEVICES", "OCL_ICD_VENDORS"] {
            assert!(is_to_be_repeated(name), "{name}");
        }
        let selecting = "OCL_ICD_FILENAMES OCL_ICD_VENDORS OPENCL_VENDOR_PATH POCL_CPU_MIN_CU_COUNT POCL_DEVICES POCL_MAX_COMPUTE_UNITS \
                         RAYON_NUM_THREADS RUSTICL_ENABLE";
        assert!(selecting.split_whitespace().all(is_to_be_repeated));
        for name in ["PATH", "POCL_CACHE_DIR", "CUDA_VISIBLE_DEVICES", "POCL_VECTORIZER_$(id)"] {
            assert!(!is_to_be_repeated(name), "{name}");
        }
    }

    /// docs/format.md says which variables `environment.json` contains.
    #[test]
    fn variables_of_drivers_loaders_and_rayon_are_stored() {
        let prefixes = "AMD_ CL_CONFIG_ CUDA_ DPCPP_CPU_ GALLIVM_ GPU_ HIP_ HSA_ IGC_ INTEL_ LD_PRELOAD LP_ MESA_ NIR_ \
                        NVIDIA_ OCLGRIND_ OCL_ICD_ OPENCL_ POCL_ RAYON_ ROCR_ RUSTICL_ ZE_ ZINK_";
        assert_eq!(PREFIXES.join(" "), prefixes);
    }

    #[test]
    fn raycls_own_variables_are_those_that_it_sets_and_the_user_has_not_set() {
        let set = |settings: &[&str]| settings.iter().map(|&setting| setting.to_owned()).collect::<Vec<_>>();
        let all = set(&["POCL_AFFINITY=1", "POCL_MAX_PTHREAD_COUNT=2", "POCL_WORK_GROUP_METHOD=cbs"]);
        assert_eq!(not_of(&all, &[]), all[..2]);
        assert_eq!(not_of(&all, &set(&["POCL_MAX_PTHREAD_COUNT=2"])), all[..1]);
        assert!(determines_threads(&all[1]) && !determines_threads(&all[0]));
    }

    #[test]
    fn caches_logs_and_masks_decide_nothing() {
        let recorded = [
            "AMD_LOG_LEVEL",
            "HSA_ENABLE_SDMA",
            "IGC_DumpToCurrentDir",
            "IGC_DumpToCustomDir",
            "IGC_ShaderDumpEnable",
            "LP_DEBUG",
            "MESA_SHADER_CACHE_DIR",
            "POCL_CACHE_DIR",
            "POCL_KERNEL_CACHE",
            "POCL_DEBUG",
            "POCL_DEVICES",
            "POCL_VECTORIZER_REMARKS",
            "CUDA_CACHE_PATH",
            "CUDA_CACHE_DISABLE",
            "CUDA_VISIBLE_DEVICES",
            "GPU_DEVICE_ORDINAL",
            "HIP_VISIBLE_DEVICES",
            "OCL_ICD_VENDORS",
            "OPENCL_VENDOR_PATH",
            "ROCR_VISIBLE_DEVICES",
            "RUSTICL_ENABLE",
            "ZE_AFFINITY_MASK",
        ];
        for platform in [
            "Portable Computing Language",
            "NVIDIA CUDA",
            "Intel(R) OpenCL",
            "AMD Accelerated Parallel Processing",
            "rusticl",
        ] {
            assert!(of(platform, &recorded).is_empty(), "{platform}");
        }
        let known = |name: &&str| PREFIXES.iter().any(|prefix| name.starts_with(prefix));
        assert!(recorded.iter().all(known), "each is stored in the environment of a run");
        let deciding = DRIVERS.iter().flat_map(|driver| driver.deciding);
        assert!(SELECTING.iter().all(known), "each variable of a repeated command is stored there too");
        assert!(
            deciding.clone().all(known),
            "each variable that affects compilation or launches is stored there too"
        );
    }
}
