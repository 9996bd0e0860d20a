//! The settings of glibc's memory allocator for a child process that shows pictures.

/// The environment variable for settings of glibc's memory allocator. glibc reads the variable only when a process
/// starts, so raycl sets it for the child process of `render` or `view`. If the user has set
/// `GLIBC_TUNABLES`, raycl leaves the variable unchanged. glibc 2.35 and later obey all settings of
/// [`allocator_settings`]; older versions do not know `hugetlb`. Other C libraries ignore the variable.
pub const ALLOCATOR: &str = "GLIBC_TUNABLES";

/// Returns the value of [`ALLOCATOR`] for a machine with this number of processors.
///
/// `hugetlb` lets the allocator ask the system for huge pages. The first access to each page of new memory
/// causes a page fault, and the faults of small pages took a fifth of the time of a short command. `top_pad`
/// lets the allocator extend its heaps by 2 MiB at a time. With `mmap_threshold`, the memory of an allocation
/// of at least 4 MiB is not part of a heap, and goes back to the system when the allocation is freed. Without
/// `mmap_threshold`, glibc raises the least size of such allocations to as much as 32 MiB, and a picture of
/// ten million triangles took 125 MiB more memory. `arena_max` limits the number of heaps to the number of
/// processors; without `arena_max`, glibc makes up to eight times as many heaps. With two heaps instead of
/// five, and a `top_pad` of 2 MiB instead of 16 MiB, the picture of ten million triangles took 50 MiB less
/// memory and the same time.
pub fn allocator_settings(processors: usize) -> String {
    let malloc = ["hugetlb=1", "top_pad=2097152", "mmap_threshold=4194304"].map(str::to_owned);
    let settings = malloc.into_iter().chain([format!("arena_max={processors}")]);
    settings.map(|setting| format!("glibc.malloc.{setting}")).collect::<Vec<_>>().join(":")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_allocator_has_at_most_one_heap_per_processor() {
        let expected = "glibc.malloc.hugetlb=1:glibc.malloc.top_pad=2097152:glibc.malloc.mmap_threshold=4194304:glibc.malloc.arena_max=16";
        assert_eq!(allocator_settings(16), expected);
    }
}
