//! Computes how many builders (groups of child processes that compile programs) fit into memory.

use crate::device::DeviceLimits;
use crate::strategy::{Afterwards, HostNeeds, Requirements, Strategy, Workload};

/// How many builders fit into memory. The processes of a builder hold a scene of the experiment while they
/// compile programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    /// The largest number of builders that may build programs for the scene at the same time; at least 1.
    pub builders: usize,
    /// The number of builders that would fit if their processes needed memory only for the scene, and not for
    /// the program and the driver; at least 1.
    pub scenes: usize,
}

impl Room {
    /// The numbers of builders if memory is not limited.
    pub const UNLIMITED: Self = Self { builders: usize::MAX, scenes: usize::MAX };

    /// Returns how many builders of programs for `workload` fit into memory. The workload describes the
    /// scene, the image size and the local size.
    ///
    /// Each process of a builder holds the scene and the scene's tree, in the memory of the host and of one
    /// device. A builder usually has `devices * folders` processes: for each device, one process per folder of
    /// kernels. All builders together may use half of the `available_bytes` of the host's memory, and half of
    /// each device's memory. The other half of the host's and of the devices' memory is left for two kinds of
    /// processes: for the workers that measure, and for those processes of builders that compile without the
    /// driver's cache.
    pub fn of(
        strategy: &Strategy,
        workload: &Workload,
        limits: &DeviceLimits,
        available_bytes: u64,
        [devices, folders]: [usize; 2],
    ) -> Self {
        let host_needs = HostNeeds::of(strategy, workload, limits.is_cpu, Afterwards::default());
        let device_bytes = Requirements::scene_bytes(strategy, workload);
        let fit = |all_bytes: u64, bytes: u64, processes: usize| {
            all_bytes / 2 / bytes.saturating_mul(processes as u64).max(1)
        };
        let on_device = fit(limits.global_bytes, device_bytes, folders);
        let most = |host_bytes: u64| {
            let on_host = fit(available_bytes, host_bytes, devices * folders);
            usize::try_from(on_host.min(on_device)).unwrap_or(usize::MAX).max(1)
        };
        Self { builders: most(host_needs.bytes()), scenes: most(host_needs.bytes_beside_program()) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::PLENTY;
    use super::*;
    use crate::device::EXAMPLE_LIMITS;
    use crate::strategy::preset;

    #[test]
    fn builders_use_at_most_half_of_the_hosts_and_of_the_devices_memory() {
        let strategy = preset("bvh").unwrap().strategy;
        let workload = Workload { triangles: 1_000_000, image_size: [1, 1], ..Workload::CUBE };
        let host_bytes = HostNeeds::of(&strategy, &workload, false, Afterwards::default()).bytes();
        let device_bytes = Requirements::scene_bytes(&strategy, &workload);
        let most = |available_bytes: u64, global_bytes: u64, processes: [usize; 2]| {
            let limits = DeviceLimits { global_bytes, ..EXAMPLE_LIMITS };
            Room::of(&strategy, &workload, &limits, available_bytes, processes).builders
        };
        let all = u64::MAX;
        assert_eq!([7, 8].map(|scenes| most(scenes * host_bytes, all, [1, 1])), [3, 4]);
        assert_eq!([[2, 1], [2, 2]].map(|processes| most(8 * host_bytes, all, processes)), [2, 1]);
        assert_eq!([5, 6].map(|scenes| most(all, scenes * device_bytes, [1, 1])), [2, 3]);
        // Each device has its own memory, so the number of devices does not matter here.
        assert_eq!([[2, 1], [1, 2]].map(|processes| most(all, 8 * device_bytes, processes)), [4, 2]);
        assert_eq!([most(0, all, [1, 1]), most(all, 0, [1, 1])], [1, 1]);
    }

    #[test]
    fn a_small_scene_limits_no_builders() {
        let strategy = preset("bvh").unwrap().strategy;
        let limits = DeviceLimits { global_bytes: 16 << 30, ..EXAMPLE_LIMITS };
        let room = Room::of(&strategy, &Workload::CUBE, &limits, 16 << 30, [1, 1]);
        assert!(room.builders >= 16, "{room:?}");
    }

    #[test]
    fn idle_builders_of_a_small_scene_keep_their_processes_although_their_programs_take_much_memory() {
        let strategy = preset("bvh").unwrap().strategy;
        let limits = DeviceLimits { global_bytes: 16 << 30, ..EXAMPLE_LIMITS };
        let of = |triangles| {
            let workload = Workload { triangles, image_size: [1, 1], ..Workload::CUBE };
            Room::of(&strategy, &workload, &limits, 8 << 30, [1, 1])
        };
        let (small, large) = (of(12), of(1_000_000));
        assert!(small.builders < PLENTY * 16 && small.scenes >= PLENTY * 16, "{small:?}");
        assert!(large.scenes < PLENTY * 16, "{large:?}");
    }
}
