//! The settings of glibc's memory allocator for a child process that shows pictures.

/// The environment variable for settings of glibc's memory allocator. glibc reads the variable only when a process
/// starts, so raycl sets it for the child process of `render` or `view`. If the user has set
/// `GLIBC_TUNABLES`, raycl leaves the variable unchanged. glibc 2.35 and later obey all settings of
/// [`allocator_settings`]; older versions do not know `hugetlb`. Other C libraries ignore the variable.
pub const ALLOCATOR: &str = "GLIBC_TUNABLES";

/// The size in bytes of a large scene file. For a scene file of this size or more, raycl saves memory rather than time.
/// An OBJ of this size has about seven million triangles.
const LARGE_BYTES: u64 = 256 << 20;

/// Returns the value of [`ALLOCATOR`] for a machine with this number of processors, and a scene file of `bytes` bytes.
///
/// `hugetlb` lets the allocator ask the system for huge pages. The first access to each page of new memory causes a
/// page fault. With small pages, page faults took a fifth of the time of a short command. `top_pad` lets the allocator
/// extend its heaps by 2 MiB at a time. `arena_max` limits the number of heaps to the number of processors; without
/// `arena_max`, glibc makes up to eight times as many heaps. With two heaps and a `top_pad` of 2 MiB, the picture of
/// ten million triangles took 50 MiB less memory than with five heaps and a `top_pad` of 16 MiB, and the same time.
///
/// An allocation of at least `mmap_threshold` bytes is not part of a heap, and its memory goes back to the system when
/// the allocation is freed. The heaps return free memory at their ends to the system if there is more of it than
/// `trim_threshold`. For most scenes, both values are so large that the heaps keep their memory: memory that raycl used
/// to read a mesh needs no new page faults when raycl builds the tree. The picture of a mesh of 200,000 triangles then
/// takes a tenth less time. For scene files of [`LARGE_BYTES`] and more, `mmap_threshold` is small, and
/// `trim_threshold` keeps the value that glibc chooses. With these values, the picture of an OBJ of ten million
/// triangles takes 50 to 70 MB less memory, and the same time. A large mesh takes up to 100 MB more memory if its scene
/// file is small: a TOML that names or describes the mesh, a compressed mesh, or standard input.
pub fn allocator_settings(processors: usize, bytes: u64) -> String {
    let keeps: &[&str] = if bytes < LARGE_BYTES {
        &["mmap_threshold=33554432", "trim_threshold=33554432"]
    } else {
        &["mmap_threshold=4194304"]
    };
    let heaps = format!("arena_max={processors}");
    let malloc = ["hugetlb=1", "top_pad=2097152"].into_iter().chain(keeps.iter().copied()).chain([&*heaps]);
    malloc.map(|setting| format!("glibc.malloc.{setting}")).collect::<Vec<_>>().join(":")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_allocator_has_at_most_one_heap_per_processor() {
        let small = "glibc.malloc.hugetlb=1:glibc.malloc.top_pad=2097152:glibc.malloc.mmap_threshold=33554432:glibc.malloc.trim_threshold=33554432:glibc.malloc.arena_max=16";
        assert_eq!(allocator_settings(16, 1 << 20), small);
    }

    #[test]
    fn memory_of_large_scenes_goes_back_to_the_system() {
        let large = "glibc.malloc.hugetlb=1:glibc.malloc.top_pad=2097152:glibc.malloc.mmap_threshold=4194304:glibc.malloc.arena_max=2";
        assert_eq!(allocator_settings(2, LARGE_BYTES), large);
    }
}
