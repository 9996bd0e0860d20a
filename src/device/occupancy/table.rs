//! The hardware limits of a multiprocessor of each CUDA compute capability. The numbers are from NVIDIA's
//! CUDA C++ Programming Guide, "Compute Capabilities", and from NVIDIA's occupancy calculator.

use crate::error::{Error, Result};

/// The limits of a multiprocessor of one compute capability.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Multiprocessor {
    /// The CUDA compute capability of the multiprocessor, such as "8.6".
    pub compute_capability: &'static str,
    /// Largest number of resident warps on the multiprocessor.
    pub warps: u64,
    /// Largest number of resident work-groups on the multiprocessor.
    pub groups: u64,
    /// Number of 32-bit registers of the multiprocessor.
    pub registers: u64,
    /// Largest number of registers of a thread.
    pub registers_per_thread: u32,
    /// Bytes of `__local` memory of the multiprocessor.
    pub local_bytes: u64,
    /// `__local` memory is allocated in multiples of this many bytes.
    pub local_unit_bytes: u64,
    /// The number of warps for which the multiprocessor has registers is rounded down to a multiple of this number. To
    /// compute how many registers a single work-group needs, the number of the group's warps is rounded up to such a
    /// multiple.
    pub warp_granularity: u64,
}

/// Makes an element of `MULTIPROCESSORS` from numbers in the units of that table.
const fn row(
    compute_capability: &'static str,
    [warps, groups]: [u64; 2],
    [kilo_registers, registers_per_thread]: [u64; 2],
    [local_kib, local_unit_bytes]: [u64; 2],
    warp_granularity: u64,
) -> Multiprocessor {
    Multiprocessor {
        compute_capability,
        warps,
        groups,
        registers: kilo_registers * 1024,
        registers_per_thread: registers_per_thread as u32,
        local_bytes: local_kib * 1024,
        local_unit_bytes,
        warp_granularity,
    }
}

/// All supported compute capabilities.
#[rustfmt::skip] // a table
pub const MULTIPROCESSORS: &[Multiprocessor] = &[
    // capability, [warps, groups], [Ki registers, registers per thread], [KiB local, unit], warp granularity
    row("2.0", [48,  8], [ 32,  63], [ 48, 128], 2),
    row("2.1", [48,  8], [ 32,  63], [ 48, 128], 2),
    row("3.0", [64, 16], [ 64,  63], [ 48, 256], 4),
    row("3.5", [64, 16], [ 64, 255], [ 48, 256], 4),
    row("3.7", [64, 16], [128, 255], [112, 256], 4),
    row("5.0", [64, 32], [ 64, 255], [ 64, 256], 4),
    row("5.2", [64, 32], [ 64, 255], [ 96, 256], 4),
    row("6.0", [64, 32], [ 64, 255], [ 64, 256], 2),
    row("6.1", [64, 32], [ 64, 255], [ 96, 256], 4),
    row("7.0", [64, 32], [ 64, 255], [ 96, 256], 4),
    row("7.5", [32, 16], [ 64, 255], [ 64, 256], 4),
    row("8.0", [64, 32], [ 64, 255], [164, 128], 4),
    row("8.6", [48, 16], [ 64, 255], [100, 128], 4),
    row("8.9", [48, 24], [ 64, 255], [100, 128], 4),
    row("9.0", [64, 32], [ 64, 255], [228, 128], 4),
];

/// Returns the supported compute capabilities, as in "2.0, 2.1".
pub fn capabilities() -> String {
    let names: Vec<_> = MULTIPROCESSORS.iter().map(|sm| sm.compute_capability).collect();
    names.join(", ")
}

/// Returns the limits of a compute capability, which is written as MAJOR.MINOR. If raycl does not support
/// this compute capability, the error suggests a supported capability: the one that differs only by its dot
/// (8.6 for "86") or, if none does, the one with the nearest number. If the text is not a number, the
/// error's advice says only how to write a compute capability.
pub fn multiprocessor(compute_capability: &str) -> Result<&'static Multiprocessor> {
    let wanted = compute_capability.trim();
    if let Some(sm) = MULTIPROCESSORS.iter().find(|sm| sm.compute_capability == wanted) {
        return Ok(sm);
    }
    let error = Error::input(format!(
        "'{compute_capability}' is not a supported compute capability; expected one of {}",
        capabilities()
    ));
    Err(error.with_help(match (with_dot(wanted), nearest_capability(wanted)) {
        (Some(name), _) => format!("write the compute capability with a dot: {name}"),
        (None, Some(name)) => format!("the nearest is {name}"),
        (None, None) => "write the compute capability as MAJOR.MINOR, such as 8.6".to_owned(),
    }))
}

/// Returns the supported compute capability from which `wished` differs only by a missing dot; `None` if no
/// supported capability matches.
fn with_dot(wished: &str) -> Option<&'static str> {
    let mut names = MULTIPROCESSORS.iter().map(|sm| sm.compute_capability);
    names.find(|name| name.replace('.', "") == wished)
}

/// Returns the supported compute capability that is nearest to the number `wished`; `None` if `wished` is not a finite
/// number.
fn nearest_capability(wished: &str) -> Option<&'static str> {
    let wished: f64 = wished.trim().parse().ok().filter(|number: &f64| number.is_finite())?;
    let distance =
        |sm: &Multiprocessor| sm.compute_capability.parse().map_or(f64::MAX, |own: f64| (own - wished).abs());
    MULTIPROCESSORS.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).map(|sm| sm.compute_capability)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The expected numbers of the last two comparisons are from NVIDIA's occupancy calculator. All other expected
    /// numbers are rows of the table "Technical Specifications per Compute Capability" in NVIDIA's CUDA C++ Programming
    /// Guide.
    #[test]
    fn the_limits_are_those_of_nvidias_guide() {
        let names = "2.0, 2.1, 3.0, 3.5, 3.7, 5.0, 5.2, 6.0, 6.1, 7.0, 7.5, 8.0, 8.6, 8.9, 9.0";
        assert_eq!(capabilities(), names);
        let of = |limit: fn(&Multiprocessor) -> u64| MULTIPROCESSORS.iter().map(limit).collect::<Vec<u64>>();
        assert_eq!(of(|sm| sm.warps), [48, 48, 64, 64, 64, 64, 64, 64, 64, 64, 32, 64, 48, 48, 64]);
        assert_eq!(of(|sm| sm.groups), [8, 8, 16, 16, 16, 32, 32, 32, 32, 32, 16, 32, 16, 24, 32]);
        let kilo_registers = of(|sm| sm.registers / 1024);
        assert_eq!(kilo_registers, [32, 32, 64, 64, 128, 64, 64, 64, 64, 64, 64, 64, 64, 64, 64]);
        let of_thread = of(|sm| sm.registers_per_thread.into());
        assert_eq!(of_thread, [63, 63, 63, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255]);
        let local_kib = of(|sm| sm.local_bytes / 1024);
        assert_eq!(local_kib, [48, 48, 48, 48, 112, 64, 96, 64, 96, 96, 64, 164, 100, 100, 228]);
        let local_unit = of(|sm| sm.local_unit_bytes);
        assert_eq!(local_unit, [128, 128, 256, 256, 256, 256, 256, 256, 256, 256, 256, 128, 128, 128, 128]);
        assert_eq!(of(|sm| sm.warp_granularity), [2, 2, 4, 4, 4, 4, 4, 2, 4, 4, 4, 4, 4, 4, 4]);
    }

    #[test]
    fn an_unknown_capability_names_the_nearest() {
        let error = multiprocessor("8.7").expect_err("unknown");
        assert_eq!(error.exit_code(), 2);
        assert!(format!("{:?}", miette::Report::new(error)).contains("the nearest is 8."));
        assert!(multiprocessor("volta").is_err());
        assert_eq!(nearest_capability("12.0"), Some("9.0"));
    }

    #[test]
    fn a_capability_without_its_dot_is_answered_with_the_dot() {
        let help = |wished: &str| {
            let error = multiprocessor(wished).expect_err("not supported");
            format!("{:?}", miette::Report::new(error))
        };
        assert!(help("86").contains("with a dot: 8.6"), "{}", help("86"));
        assert!(help(" 90 ").contains("with a dot: 9.0"), "{}", help(" 90 "));
        assert!(help("12").contains("the nearest is 9.0"), "{}", help("12"));
        assert!(help("volta").contains("MAJOR.MINOR"), "{}", help("volta"));
    }
}
