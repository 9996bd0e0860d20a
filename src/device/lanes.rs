//! Finds out how the 32 work-items that share a tile can exchange values. On a GPU, a test on the device
//! shows whether an implementation of the exchange works. On a CPU, raycl always uses barriers, and tests nothing.

use super::errors::CallError;
use super::panics::{caught, forget_failures};
use super::{DeviceInfo, compile, quieting};
use crate::error::{Error, Result};
use crate::manifest::{GROUP_LANES, PROBE_LANES, parameter_macro};
use crate::sources::{Sources, does_not_compile};
use ocl::{Buffer, Context, Kernel, MemFlags, Queue};
use serde::{Deserialize, Serialize};

/// The implementations of the operations in cl/common/lanes.cl, by which work-items exchange values. The
/// slowest implementation comes first. The macros LANES_BY_* in cl/common/lanes.cl have the numbers of the
/// variants of `LaneOperations`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LaneOperations {
    /// `__local` memory and barriers: this implementation works on any device, with one group of 32
    /// work-items per work-group.
    #[default]
    Barriers,
    /// Functions of OpenCL for sub-groups, if a sub-group has 32 work-items (`cl_khr_subgroups`).
    SubGroups,
    /// Inline PTX with the instructions for votes and shuffles.
    PtxShuffles,
    /// Inline PTX with the instructions for votes, shuffles and reductions.
    Ptx,
}

/// When raycl tests the lane operations of a device (how its work-items exchange values).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LaneTest {
    /// raycl tests all devices while it lists them, before it chooses a device.
    Now,
    /// raycl tests a device when [`Device::test_lanes`](super::Device::test_lanes) is called. Until the test
    /// has run, raycl assumes that the device has the fastest operations that may work on it. A picture whose
    /// kernels do not exchange values between work-items thus does not wait for the test, which takes 0.4 s on a GPU.
    Later,
}

/// Number of lanes in a group of work-items that share a tile.
const LANES: usize = GROUP_LANES as usize;
/// Number of groups of 32 lanes in the tested work-group.
const GROUPS: usize = 4;
/// Number of values that the kernel of the lane test writes per lane.
const ANSWERS: usize = 8;
/// A word with one bit per lane. The test computes each lane's rank among the lanes whose bits are set in this word.
const AMONG: u32 = 0x0f0f_00ff;
/// The value of every answer before the kernel runs. No right answer equals `NO_ANSWER`, so raycl notices an answer
/// that the kernel does not write, and treats it as a wrong answer.
const NO_ANSWER: u32 = u32::MAX;

/// The file of the kernel that tests how work-items exchange values.
const PROBE: &str = "probe/lanes.cl";

/// The result of testing an implementation of lane operations on a device.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Trial {
    /// All answers of the test's kernel are right.
    Right,
    /// Some answers of the test's kernel are wrong or missing.
    Wrong,
    /// The driver refuses the test's kernel, with this message.
    Refused(String),
    /// The device cannot be used now, for example because its memory is full, so it is unknown whether the
    /// implementation of lane operations works.
    Unknown,
}

impl LaneOperations {
    /// Returns the number of tiles per work-group with which kernels are fastest. With barriers, the number
    /// of tiles is 1: barriers make the work-items of a tile wait for those of all tiles in the work-group.
    pub fn usual_groups(self) -> u32 {
        if self == Self::Barriers { 1 } else { GROUPS as u32 }
    }

    /// Returns a short description of the implementation for messages, such as "PTX shuffles".
    pub fn about(self) -> &'static str {
        match self {
            Self::Barriers => "barriers",
            Self::SubGroups => "sub-groups",
            Self::PtxShuffles => "PTX shuffles",
            Self::Ptx => "PTX shuffles and reductions",
        }
    }

    /// Returns the fastest implementation of lane operations that may work on a device, according to
    /// [`hinted`]. Returns barriers if `hinted` returns no implementation.
    pub(super) fn assumed(info: &DeviceInfo) -> Self {
        hinted(info).first().copied().unwrap_or_default()
    }

    /// Returns the fastest implementation that [`hinted`] returns for a device and that passes the test on
    /// this device. Returns barriers if no implementation passes the test, and `None` if the device cannot be
    /// used now.
    ///
    /// # Errors
    ///
    /// Fails if an implementation passes the test with raycl's own files, but not with a kernel file of the
    /// user.
    pub(super) fn find(
        info: &DeviceInfo,
        platform: ocl::Platform,
        device: ocl::Device,
        sources: &Sources,
    ) -> Result<Option<Self>> {
        fastest(hinted(info), sources, |operations, source| {
            try_out(operations, source, info, platform, device)
        })
    }

    /// Returns the compiler option that selects the version of OpenCL C that this implementation of lane
    /// operations needs.
    pub fn standard(self, opencl_3: bool) -> &'static str {
        match (self, opencl_3) {
            (Self::SubGroups, true) => "-cl-std=CL3.0",
            (Self::SubGroups, false) => "-cl-std=CL2.0",
            _ => "-cl-std=CL1.2",
        }
    }
}

/// Returns the source of the kernel that tests how work-items exchange values, and the names of the source's files.
pub(super) fn probe(sources: &Sources) -> Result<(String, Vec<String>)> {
    let list = parameter_macro("probe_lanes", PROBE_LANES.iter());
    let (text, files) = sources.read_joined(PROBE)?;
    Ok((list + &text, files))
}

/// Returns the first implementation in `hinted` that works, or barriers if none works. Returns `None` if an
/// implementation could not be tested. `try_out` tests an implementation with the given source of the test's
/// kernel.
///
/// Returns an error if an implementation of lane operations works with raycl's own kernel files, but not with the
/// user's files. If raycl ignored a mistake in a user's file, raycl would select a slower implementation without
/// saying why.
fn fastest(
    hinted: &[LaneOperations],
    sources: &Sources,
    try_out: impl Fn(LaneOperations, &str) -> Trial,
) -> Result<Option<LaneOperations>> {
    for operations in hinted.iter().copied() {
        let (source, files) = probe(sources)?;
        let trial = try_out(operations, &source);
        match &trial {
            Trial::Right => return Ok(Some(operations)),
            Trial::Unknown => return Ok(None),
            Trial::Wrong | Trial::Refused(_) => {}
        }
        let own = sources.own_files()?;
        let own: Vec<_> = files.iter().filter(|file| own.contains(file)).collect();
        if own.is_empty() {
            continue;
        }
        match (try_out(operations, &probe(&Sources::Embedded)?.0), trial) {
            (Trial::Right, Trial::Refused(log)) => {
                return Err(does_not_compile(&sources.located(&log, &source, &files).0));
            }
            (Trial::Right, _) => {
                let paths: Vec<_> = own.into_iter().map(|file| sources.path_of(file)).collect();
                return Err(wrong_values(operations, &paths));
            }
            (Trial::Unknown, _) => return Ok(None),
            (Trial::Wrong | Trial::Refused(_), _) => {}
        }
    }
    Ok(Some(LaneOperations::default()))
}

/// Returns the error for an implementation of lane operations that gives wrong answers with the user's kernel
/// files. `paths` are the paths of the user's kernel files.
fn wrong_values(operations: LaneOperations, paths: &[String]) -> Error {
    let message = format!(
        "work-items that exchange values by {} get wrong values with {}; with raycl's own files, they get the right \
         ones",
        operations.about(),
        paths.join(" and ")
    );
    Error::input(message)
        .with_help("correct the file; comments in raycl's cl/common/lanes.cl explain the operations")
}

/// Returns the implementations of lane operations that may work on a device, the fastest first. Compilers
/// that produce PTX also accept inline PTX. Returns no implementation if a work-group cannot have as many
/// work-items as the test needs. Also returns no implementation for a CPU: one thread of a CPU executes a
/// whole work-group, and drivers emulate sub-groups by barriers. On PoCL 5.0, kernels that use emulated
/// sub-groups in loops crash or hang, although the test passes.
fn hinted(info: &DeviceInfo) -> &'static [LaneOperations] {
    if info.limits.is_cpu || info.limits.work_group_size < LANES * GROUPS {
        &[]
    } else if info.prints_resources() {
        &[LaneOperations::Ptx, LaneOperations::PtxShuffles]
    } else if info.extensions.iter().any(|extension| extension.starts_with("cl_khr_subgroup")) {
        &[LaneOperations::SubGroups]
    } else {
        &[]
    }
}

/// Builds the test's kernel with this implementation of lane operations, runs the kernel, and compares its
/// answers with the right answers.
fn try_out(
    operations: LaneOperations,
    source: &str,
    info: &DeviceInfo,
    platform: ocl::Platform,
    device: ocl::Device,
) -> Trial {
    // If the crate `ocl` panics in this test, the panic is caught, so that raycl can still use other devices.
    let asked = caught(|| ask(operations, source, info, platform, device));
    forget_failures();
    judged(asked)
}

/// Decides whether the answers of the test's kernel are right. `asked` is an error if the crate `ocl`
/// panicked.
fn judged(asked: std::result::Result<std::result::Result<Vec<u32>, CallError>, String>) -> Trial {
    match asked {
        Err(_) => Trial::Unknown,
        Ok(Err(error)) if error.may_pass() => Trial::Unknown,
        Ok(Err(error)) => Trial::Refused(error.message),
        Ok(Ok(answers)) if answers == expected() => Trial::Right,
        Ok(Ok(_)) => Trial::Wrong,
    }
}

/// Returns the answers of the test's kernel, built with this implementation of lane operations.
fn ask(
    operations: LaneOperations,
    source: &str,
    info: &DeviceInfo,
    platform: ocl::Platform,
    device: ocl::Device,
) -> std::result::Result<Vec<u32>, CallError> {
    let options = format!(
        "-D LANE_OPERATIONS={} -D GROUP_LANES={LANES} -D LOCAL_X={LANES} -D LOCAL_Y={GROUPS} {} {}",
        operations as u32,
        operations.standard(info.speaks_opencl_3()),
        quieting(device)
    );
    let context = Context::builder().platform(platform).devices(device).build()?;
    let program = compile(&context, device, source, &options)?;
    let queue = Queue::new(&context, device, None)?;
    let answers = Buffer::<u32>::builder()
        .queue(queue.clone())
        .flags(MemFlags::READ_WRITE)
        .len(LANES * GROUPS * ANSWERS)
        .fill_val(NO_ANSWER)
        .build()?;
    let kernel = Kernel::builder()
        .program(&program)
        .name("probe_lanes")
        .queue(queue)
        .global_work_size([LANES, GROUPS])
        .local_work_size([LANES, GROUPS])
        .arg(&answers)
        .build()?;
    // SAFETY: the kernel has the one argument that its source declares, and the buffer is as long as the
    // kernel's output.
    unsafe { kernel.enq()? };
    let mut values = vec![0; answers.len()];
    answers.read(&mut values).enq()?;
    Ok(values)
}

/// Returns the answers that the test's kernel must give for every lane of every group of 32 lanes.
fn expected() -> Vec<u32> {
    let lanes = (0..GROUPS as u32).flat_map(|group| (0..LANES as u32).map(move |lane| (group, lane)));
    lanes.flat_map(|(group, lane)| answers(group, lane)).collect()
}

fn answers(group: u32, lane: u32) -> [u32; ANSWERS] {
    let number = |lane: u32| (7 * lane + group) % 32;
    let own = number(lane);
    let bits =
        |wanted: &dyn Fn(u32) -> bool| (0..32).filter(|&lane| wanted(lane)).map(|lane| 1 << lane).sum();
    let multiples: u32 = bits(&|lane| number(lane) % 3 == 0);
    let smaller: u32 = bits(&|lane| AMONG >> lane & 1 == 1 && number(lane) < own);
    let ends = [-15.5_f32, 15.5].map(f32::to_bits);
    [multiples, number(5), 100, smaller.count_ones(), ends[0], ends[1], number(31 - lane), own]
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::device::tests::example;
    use crate::device::{Device, DeviceKind, DeviceLimits, discover};

    #[test]
    fn extensions_hint_at_what_to_try() {
        let mut device = example("A", "gpu", DeviceKind::Gpu, 1);
        assert!(hinted(&device).is_empty());
        device.extensions.push("cl_khr_subgroups".into());
        assert_eq!(hinted(&device), [LaneOperations::SubGroups]);
        device.extensions.push("cl_nv_compiler_options".into());
        assert_eq!(hinted(&device)[0], LaneOperations::Ptx);
        let cpu = DeviceLimits { is_cpu: true, ..device.limits };
        assert!(hinted(&DeviceInfo { limits: cpu, ..device.clone() }).is_empty());
        device.limits.work_group_size = LANES * GROUPS;
        assert_eq!(hinted(&device)[0], LaneOperations::Ptx);
        device.limits.work_group_size -= 1;
        assert!(hinted(&device).is_empty());
    }

    #[test]
    fn each_lane_has_answers_of_its_own() {
        let expected = expected();
        let rows: std::collections::HashSet<_> = expected.chunks(ANSWERS).collect();
        assert_eq!(rows.len(), LANES * GROUPS);
        assert!(!expected.contains(&NO_ANSWER));
    }

    /// In this test, macros replace OpenCL's functions for sub-groups, so the device need not have
    /// sub-groups. The first three macros return the size of a sub-group, a work-item's lane in its sub-group,
    /// and the sub-group's number.
    #[test]
    fn sub_groups_of_another_size_write_no_answers() {
        let Device { info, platform, device, .. } = discover(&Sources::Embedded).unwrap().remove(0);
        let ask_with = |lanes: usize| {
            let functions = format!(
                "#define get_sub_group_size() {lanes}u
                 #define get_sub_group_local_id() (get_local_id(0) % {lanes})
                 #define get_sub_group_id() ((get_local_id(1) * LOCAL_X + get_local_id(0)) / {lanes})
                 #define sub_group_barrier(fence) barrier(fence)
                 #define sub_group_broadcast(value, from) (value)
                 #define sub_group_ballot(yes) (uint4)(yes)
                 #define sub_group_reduce_add(value) (value)
                 #define sub_group_reduce_min(value) (value)\n"
            );
            let source = functions + &probe(&Sources::Embedded).unwrap().0;
            ask(LaneOperations::SubGroups, &source, &info, platform, device).unwrap()
        };
        // In the test's kernel, the last two answers of a lane are the number that another lane has stored,
        // and the lane's own number. Only the last two answers of each lane are compared, since the macros do
        // not make the earlier answers right.
        let last = |all: &[u32]| {
            all.chunks(ANSWERS).map(|answers| answers[ANSWERS - 2..].to_vec()).collect::<Vec<_>>()
        };
        assert_eq!(last(&ask_with(LANES)), last(&expected()));
        assert!([64, 16].iter().all(|lanes| ask_with(*lanes).iter().all(|answer| *answer == NO_ANSWER)));
    }

    #[test]
    fn only_a_wrong_or_refused_kernel_means_that_an_implementation_does_not_work() {
        const HINTED: [LaneOperations; 2] = [LaneOperations::Ptx, LaneOperations::PtxShuffles];
        let outcome = |trials: [Trial; 2]| {
            let trial =
                |operations: LaneOperations, _: &str| trials[usize::from(operations == HINTED[1])].clone();
            fastest(&HINTED, &Sources::Embedded, trial).unwrap()
        };
        let refused = || Trial::Refused("no".to_owned());
        assert_eq!(outcome([Trial::Right, Trial::Right]), Some(LaneOperations::Ptx));
        assert_eq!(outcome([refused(), Trial::Right]), Some(LaneOperations::PtxShuffles));
        assert_eq!(outcome([Trial::Wrong, refused()]), Some(LaneOperations::Barriers));
        assert_eq!(outcome([Trial::Unknown, Trial::Right]), None);
        assert_eq!(outcome([refused(), Trial::Unknown]), None);
        assert_eq!(
            fastest(&[], &Sources::Embedded, |_, _| Trial::Wrong).unwrap(),
            Some(LaneOperations::Barriers)
        );
    }

    #[test]
    fn a_mistake_in_the_users_file_is_reported_if_raycls_own_file_works() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("common/lanes.cl");
        std::fs::create_dir(folder.path().join("common")).unwrap();
        std::fs::write(&file, "mine\n").unwrap();
        let sources = Sources::Folder(folder.path().to_owned());
        let find = |own: Trial, raycls: Trial| {
            let trial = |_, source: &str| if source.contains("mine") { own.clone() } else { raycls.clone() };
            fastest(&[LaneOperations::Ptx], &sources, trial)
        };
        let refused = || Trial::Refused("common/lanes.cl:1:1: error: no".to_owned());
        for (own, expected) in [(refused(), "does not compile: "), (Trial::Wrong, "get wrong values with ")] {
            let error = find(own.clone(), Trial::Right).unwrap_err();
            let message = error.to_string();
            assert_eq!(error.exit_code(), 2, "{message}");
            assert!(message.contains(expected) && message.contains(&file.display().to_string()), "{message}");
            assert_eq!(find(own.clone(), Trial::Wrong).unwrap(), Some(LaneOperations::Barriers));
            assert_eq!(find(own, Trial::Unknown).unwrap(), None);
        }
    }

    #[test]
    fn assumed_operations_are_replaced_by_those_that_pass_the_test() {
        let mut gpu = example("A", "gpu", DeviceKind::Gpu, 1);
        assert_eq!(LaneOperations::assumed(&gpu), LaneOperations::Barriers);
        gpu.extensions.push("cl_nv_compiler_options".into());
        assert_eq!(LaneOperations::assumed(&gpu), LaneOperations::Ptx);
        // A CPU does not support PTX, so a test of `Ptx` would fail on a CPU.
        let mut device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        assert!(device.lanes_are_tested);
        device.info.limits.lane_operations = LaneOperations::Ptx;
        device.test_lanes(&Sources::Embedded).unwrap();
        assert_eq!(
            device.info.limits.lane_operations,
            LaneOperations::Ptx,
            "a tested device is not tested again"
        );
        device.lanes_are_tested = false;
        device.test_lanes(&Sources::Embedded).unwrap();
        assert_eq!(device.info.limits.lane_operations, LaneOperations::Barriers);
        assert!(device.lanes_are_tested);
    }

    #[test]
    fn a_device_that_could_not_be_tested_gets_barriers_and_is_tested_again() {
        let mut device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        device.info.extensions.push("cl_nv_compiler_options".into());
        device.info.limits = DeviceLimits { is_cpu: false, work_group_size: 1024, ..device.info.limits };
        let hints = hinted(&device.info);
        for (tested, lanes, is_tested) in [
            (None, LaneOperations::Barriers, false),
            (Some(LaneOperations::Ptx), LaneOperations::Ptx, true),
            (Some(LaneOperations::Barriers), LaneOperations::Barriers, true),
        ] {
            device.info.limits.lane_operations = LaneOperations::Ptx;
            device.take_lanes(tested);
            assert_eq!((device.info.limits.lane_operations, device.lanes_are_tested), (lanes, is_tested));
            assert_eq!(hinted(&device.info), hints, "the next test tries the same operations");
        }
    }

    #[test]
    fn what_a_device_has_was_tried() {
        for device in discover(&Sources::Embedded).expect("the tests need PoCL: make setup") {
            let has = device.info.limits.lane_operations;
            let tried = hinted(&device.info).contains(&has);
            assert!(tried || has == LaneOperations::Barriers, "{:?}", device.info);
        }
    }

    /// The expected answers of lane 2 of group 1 are written out as arithmetic. In group 1, lane n has the
    /// number (7 n + 1) mod 32.
    #[test]
    fn a_lane_answers_with_its_own_number_and_those_of_others() {
        let [_, fifth, _, smaller, _, _, mirrored, own] = answers(1, 2);
        assert_eq!([own, fifth, mirrored], [15, 36 - 32, 7 * 29 + 1 - 6 * 32]);
        // Lane 2 has the number 15. Six of the lanes in `AMONG` have smaller numbers: the lanes 0, 1, 5, 6,
        // 19 and 24 of group 1 have the numbers 1, 8, 4, 11, 6 and 9.
        assert_eq!(smaller, 6);
    }

    #[test]
    fn a_device_that_lacks_memory_now_says_nothing_about_an_implementation() {
        use ocl::enums::Status;
        let failed = |status| Ok(Err(CallError { message: "no".to_owned(), status }));
        assert_eq!(judged(failed(Some(Status::CL_OUT_OF_RESOURCES))), Trial::Unknown);
        for status in [None, Some(Status::CL_INVALID_VALUE)] {
            assert_eq!(judged(failed(status)), Trial::Refused("no".to_owned()));
        }
        assert_eq!(judged(Err("a panic".to_owned())), Trial::Unknown);
        assert_eq!(
            [expected(), vec![NO_ANSWER]].map(|all| judged(Ok(Ok(all)))),
            [Trial::Right, Trial::Wrong]
        );
    }
}
