//! Computes how many work-groups a multiprocessor of an NVIDIA GPU holds at the same time. Figure 5 of the student
//! paper that raycl reproduces makes a similar prediction for one GPU: how many threads a multiprocessor holds.
//! Supports the compute capabilities in `table.rs`.

mod table;

pub use table::{Multiprocessor, capabilities, multiprocessor};

/// The number of registers per thread that the student paper states.
pub const PAPER_REGISTERS: u32 = 63;
/// The compute capability that raycl assumes for the paper's GPU, since the paper does not name its GPU.
pub const PAPER_CAPABILITY: &str = "2.0";
/// Threads per warp.
const WARP: u64 = 32;
/// Largest number of threads in a work-group, on every compute capability in `table.rs`.
const MAX_GROUP_THREADS: u32 = 1024;
/// Bytes of `__local` memory that a work-group may have. CUDA programs can ask the driver for more `__local`
/// (shared) memory per work-group, but OpenCL programs cannot.
const MAX_GROUP_LOCAL_BYTES: u64 = 48 * 1024;
/// Largest number of registers of a work-group from compute capability 3.0 on. Below compute capability 3.0,
/// a work-group may use all registers of the multiprocessor.
const MAX_GROUP_REGISTERS: u64 = 64 * 1024;

/// The limit that prevents a multiprocessor from holding one more work-group.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Limiter {
    /// The hardware's largest number of work-groups that a multiprocessor holds.
    GroupCap,
    /// The hardware's largest number of warps that a multiprocessor holds.
    Warps,
    /// The multiprocessor's number of registers.
    Registers,
    /// The size of the multiprocessor's `__local` memory.
    Local,
    /// Not even one work-group fits on a multiprocessor. The text is the arithmetic that shows why no
    /// work-group fits.
    CannotLaunch(String),
}

impl std::fmt::Display for Limiter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::GroupCap => f.write_str("groups"),
            Self::Warps => f.write_str("warps"),
            Self::Registers => f.write_str("registers"),
            Self::Local => f.write_str("local memory"),
            Self::CannotLaunch(reason) => write!(f, "cannot launch: {reason}"),
        }
    }
}

impl Limiter {
    /// Returns the limit in words for pages and tables, such as "limited by registers".
    pub fn words(&self) -> String {
        match self {
            Self::CannotLaunch(_) => self.to_string(),
            limit => format!("limited by {limit}"),
        }
    }
}

/// The work-groups and warps that a multiprocessor holds at the same time.
#[derive(Clone, Debug, PartialEq)]
pub struct Occupancy {
    /// The number of work-groups that the multiprocessor holds.
    pub groups: u64,
    /// The number of warps that the multiprocessor holds.
    pub warps: u64,
    /// The number of threads that the multiprocessor holds.
    pub threads: u64,
    /// The number of warps that the multiprocessor holds, divided by the largest number of warps that it can hold.
    pub fraction: f64,
    /// The limit that prevents more work-groups. If several limits prevent more work-groups, `limiter` is the
    /// first of these limits in the order of [`Limiter`].
    pub limiter: Limiter,
}

/// Returns how many work-groups of `threads_per_group` threads the multiprocessor `sm` holds. Each thread has
/// `registers_per_thread` registers, and each work-group has `local_bytes_per_group` bytes of `__local` memory.
pub fn occupancy(
    sm: &Multiprocessor,
    registers_per_thread: u32,
    local_bytes_per_group: u64,
    threads_per_group: u32,
) -> Occupancy {
    let warps_per_group = u64::from(threads_per_group).div_ceil(WARP);
    let limits = || -> Fits<_> {
        allowed(sm, registers_per_thread, local_bytes_per_group, threads_per_group)?;
        let by_registers = groups_by_registers(sm, registers_per_thread, warps_per_group)?;
        Ok([
            (sm.groups, Limiter::GroupCap),
            (sm.warps / warps_per_group, Limiter::Warps),
            (by_registers, Limiter::Registers),
            (groups_by_local(sm, local_bytes_per_group), Limiter::Local),
        ])
    };
    let (groups, limiter) = match limits() {
        Ok(limits) => limits.into_iter().min_by_key(|(groups, _)| *groups).unwrap_or((0, Limiter::GroupCap)),
        Err(reason) => (0, Limiter::CannotLaunch(reason)),
    };
    let warps = groups * warps_per_group;
    Occupancy {
        groups,
        warps,
        threads: groups * u64::from(threads_per_group),
        fraction: warps as f64 / sm.warps as f64,
        limiter,
    }
}

/// The result of a computation for work-groups on a multiprocessor, or an error with the arithmetic that
/// shows why not even one work-group fits.
type Fits<T> = std::result::Result<T, String>;

/// Returns an error if a work-group exceeds a limit of a single work-group or thread.
fn allowed(sm: &Multiprocessor, registers: u32, local_bytes: u64, threads: u32) -> Fits<()> {
    if threads == 0 {
        return Err("a group needs threads".into());
    }
    if threads > MAX_GROUP_THREADS {
        return Err(format!("{threads} threads > {MAX_GROUP_THREADS} per group"));
    }
    if registers > sm.registers_per_thread {
        return Err(format!("{registers} registers > {} per thread", sm.registers_per_thread));
    }
    if local_bytes > MAX_GROUP_LOCAL_BYTES {
        return Err(format!("__local: {local_bytes} B > {MAX_GROUP_LOCAL_BYTES} B per group"));
    }
    Ok(())
}

/// Returns the number of work-groups for which a multiprocessor has enough registers. Registers are allocated to whole
/// warps, in units of 64 registers on compute capability 2.x and of 256 registers from 3.0 on. The number of warps for
/// which a multiprocessor has registers is rounded down to a multiple of `warp_granularity`. To compute how
/// many registers a single work-group needs, the number of the group's warps is rounded up to such a multiple.
fn groups_by_registers(sm: &Multiprocessor, registers: u32, warps: u64) -> Fits<u64> {
    let wanted = WARP * u64::from(registers.max(1));
    let granularity = sm.warp_granularity;
    let (warp_registers, group_registers) = if before_3(sm) {
        (wanted.next_multiple_of(64), sm.registers)
    } else {
        (wanted.next_multiple_of(256), MAX_GROUP_REGISTERS)
    };
    let needed = warp_registers * warps.next_multiple_of(granularity);
    if needed > group_registers {
        return Err(format!(
            "registers: {warp_registers} per warp x {} warps = {needed} > {group_registers} per group",
            warps.next_multiple_of(granularity)
        ));
    }
    let resident_warps = if before_3(sm) {
        sm.registers / warp_registers / granularity * granularity
    } else {
        sm.registers / granularity / warp_registers * granularity
    };
    Ok(resident_warps / warps)
}

fn groups_by_local(sm: &Multiprocessor, local_bytes: u64) -> u64 {
    let taken = (local_bytes + reserved_local_bytes(sm)).next_multiple_of(sm.local_unit_bytes);
    sm.local_bytes.checked_div(taken).unwrap_or(u64::MAX)
}

/// Returns the bytes of `__local` memory that CUDA reserves in each work-group: 1 KiB from compute capability
/// 8.0 on.
fn reserved_local_bytes(sm: &Multiprocessor) -> u64 {
    if major(sm) >= 8 { 1024 } else { 0 }
}

fn before_3(sm: &Multiprocessor) -> bool {
    major(sm) < 3
}

/// Returns the number before the dot of the compute capability. The number before the dot can have several digits: 10
/// for "10.0".
fn major(sm: &Multiprocessor) -> u32 {
    let number = sm.compute_capability.split('.').next();
    number.and_then(|number| number.parse().ok()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::table::MULTIPROCESSORS;
    use super::*;

    fn of(capability: &str, registers: u32, local_bytes: u64, threads: u32) -> Occupancy {
        occupancy(multiprocessor(capability).expect("known"), registers, local_bytes, threads)
    }

    #[test]
    fn sixty_three_registers_contradict_figure_5() {
        let sixteen = of("2.0", 63, 0, 256);
        assert_eq!((sixteen.groups, sixteen.threads, sixteen.limiter), (2, 512, Limiter::Registers));
        let Limiter::CannotLaunch(reason) = of("2.0", 63, 0, 1024).limiter else { panic!("it launches") };
        assert_eq!(reason, "registers: 2048 per warp x 32 warps = 65536 > 32768 per group");
        let words = Limiter::CannotLaunch(reason).words();
        assert_eq!(words, "cannot launch: registers: 2048 per warp x 32 warps = 65536 > 32768 per group");
        assert_eq!(Limiter::Local.words(), "limited by local memory");
    }

    #[test]
    fn small_groups_reach_the_cap_on_groups() {
        let two = of("2.0", 63, 0, 4);
        assert_eq!((two.groups, two.warps, two.threads, two.limiter), (8, 8, 32, Limiter::GroupCap));
        assert_eq!(of("2.0", 20, 0, 256).threads, 1536);
        // Groups of one warp: 48 warps would fit on both multiprocessors.
        assert_eq!([of("8.6", 16, 0, 32).groups, of("8.9", 16, 0, 32).groups], [16, 24]);
    }

    #[test]
    fn values_of_nvidias_calculator() {
        let full = of("8.6", 32, 0, 256);
        assert_eq!((full.groups, full.fraction, full.limiter), (6, 1.0, Limiter::Warps));
        assert_eq!(of("7.5", 64, 0, 256).groups, 4);
        assert_eq!(of("9.0", 32, 0, 1024).groups, 2);
        assert_eq!(of("8.0", 64, 0, 256).groups, 4);
        assert_eq!(of("3.5", 33, 0, 256).groups, 6); // 33 registers become 40; 51 warps fit, rounded down to 48
        assert_eq!(of("5.0", 33, 0, 96).groups, 16); // 48 warps, 3 per group; 51 warps would be 17 groups
        assert_eq!(of("3.7", 128, 0, 256).groups, 4); // 128 Ki registers for 32 warps, 8 per group
        assert_eq!(of("6.0", 40, 0, 64).groups, 25); // 50 warps, 2 per group; in fours, 48 warps would fit
    }

    #[test]
    fn local_memory_counts_with_its_unit_and_reserve() {
        let vectors = of("2.0", 20, 108 * 256, 256);
        assert_eq!((vectors.groups, vectors.limiter), (1, Limiter::Local));
        assert_eq!(of("3.5", 16, 5461, 64).groups, 8); // nine of 5461 B would fit, nine of 5632 B do not
        assert_eq!(of("8.6", 16, 48 * 1024, 64).groups, 2); // 49 KiB per group, 100 KiB in all
        assert_eq!(of("7.0", 16, 48 * 1024, 64).groups, 2); // 48 KiB per group, 96 KiB in all
        assert_eq!(of("9.0", 16, 12 * 1024, 64).groups, 17); // 13 KiB per group, 228 KiB in all
        assert_eq!(of("8.0", 16, 16 * 1024, 64).groups, 9); // 17 KiB per group, 164 KiB in all
    }

    #[test]
    fn a_compute_capability_of_two_digits_is_later_than_9() {
        for compute_capability in ["10.0", "12.0", "20.0"] {
            let sm = Multiprocessor { compute_capability, ..*multiprocessor("9.0").expect("known") };
            assert_eq!(occupancy(&sm, 16, 12 * 1024, 64).groups, 17, "1 KiB per group is reserved");
            assert_eq!(occupancy(&sm, 33, 0, 256).groups, 6, "registers are allocated in units of 256");
        }
    }

    #[test]
    fn what_no_group_may_have_cannot_launch() {
        for (registers, local_bytes, threads, part) in [
            (16, 0, 1025, "1025 threads"),
            (64, 0, 64, "63 per thread"),
            (16, 49153, 64, "49152 B"),
            (16, 0, 0, "needs threads"),
        ] {
            let Occupancy { groups, limiter, .. } = of("3.0", registers, local_bytes, threads);
            assert_eq!(groups, 0);
            assert!(limiter.to_string().contains(part), "{limiter}");
        }
        // A multiprocessor of compute capability 3.7 has 128 Ki registers in total. A work-group may use only
        // half of these 128 Ki registers.
        assert!(matches!(of("3.7", 128, 0, 1024).limiter, Limiter::CannotLaunch(_)));
    }

    #[test]
    fn every_capability_fills_up_and_never_overflows() {
        for sm in MULTIPROCESSORS {
            for registers in [1, 16, 32, 63] {
                for threads in 1..=MAX_GROUP_THREADS {
                    let got = occupancy(sm, registers, 0, threads);
                    assert!(got.warps <= sm.warps && got.groups <= sm.groups, "{sm:?} {got:?}");
                }
            }
            assert_eq!(occupancy(sm, 16, 0, 256).fraction, 1.0, "{sm:?}");
        }
    }
}
