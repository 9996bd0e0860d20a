//! Computes, before anything is compiled, what a strategy needs of a device: above all, bytes of each kind of
//! memory. The bytes of one kind of memory are a sum whose terms are stored, so that messages can show the
//! arithmetic, for example "vectors 108 B x 24 x 24 = 62208 B".

mod fits;

use fits::{counters, groups, indices, shape, soft, textures};

use super::infeasible::{Cause, Infeasible};
use super::sum::Sum;
use super::workload::Workload;
use super::{Copied, Layout, Records, Strategy, WorkingMemory};
use crate::accel::WideBvh;
use crate::device::{DeviceLimits, LaneOperations};
use crate::manifest::{GROUP_LANES, ROW_FLOATS, TILE_TRIANGLES, soup_floats};
use crate::memory::thread_stack_bytes;
use crate::scene::{CornerColours, Material, Triangle};

const CORNERS_BYTES: u64 = 9 * 4;
/// Bytes of the colours of a triangle's corners, on the host and on a device.
pub(super) const CORNER_COLOURS_BYTES: u64 = size_of::<CornerColours>() as u64;
/// Bytes of a triangle in a leaf of the tree, or of the planes for a triangle and an origin (the eye or a light): three
/// float4.
const ROW_BYTES: u64 = ROW_FLOATS as u64 * 4;
/// Size of a triangle's normals in bytes.
const NORMAL_BYTES: u64 = crate::accel::NORMAL_FLOATS as u64 * 4;
const POINT_BYTES: u64 = 3 * 4;

/// Bytes of a ray of a tile: its direction, the inverse distance of its nearest hit, the index of the triangle that it
/// hit, the reciprocals of the direction, and data for the watertight test. During shading, there are also the surface
/// that the ray hit, the arriving light and the sum of the light so far.
const TILE_RAY_BYTES: u64 = (5 + 3 + 2 + 17 + 6) * 4;

/// If surfaces emit light, returns the additional bytes of a material, which are also the additional bytes of
/// the surface that a ray hit. Otherwise, returns 0.
fn emission_bytes(w: &Workload) -> u64 {
    if w.emissive { Material::EMISSION_FLOATS as u64 * 4 } else { 0 }
}

/// Bytes of an entry of the stack with which work-items that share a tile traverse a tree: the word that
/// identifies a child node, and the distance at which rays enter the child's box.
const STACK_ENTRY_BYTES: u64 = 8;
/// Bytes of an array in `__local` memory with two words per lane. Lanes exchange values through this array if the
/// device has no faster way.
const BOARD_BYTES: u64 = 2 * 4 * GROUP_LANES as u64;
/// Bytes of a candidate. A candidate consists of a leaf's triangle that the rays of a tile are still to be tested
/// against, and of the number of the lane that prepared this triangle.
const CANDIDATE_BYTES: u64 = ROW_BYTES + 4;
/// Bytes of an entry in the queue of leftover shadow rays: a ray from the eye, and the lights of its shadow rays.
const QUEUE_ENTRY_BYTES: u64 = 8;
/// Bytes of a word that belongs to a ray from the eye. The word's bits say which lights reach the ray's hit.
const LIT_BYTES: u64 = 4;

/// Returns the largest number of bytes that the private arrays of a work-group may take on a CPU whose
/// threads have stacks of this size: 5 MiB if the stacks have 8 MiB or more. If a value lives across a
/// barrier, drivers keep a copy of the value for each work-item of a work-group. If the copies are larger
/// than the stack, the stack overflows without an error.
fn cpu_stack_bytes(thread_stack_bytes: u64) -> u64 {
    thread_stack_bytes.min(8 << 20) / 8 * 5
}

/// The bytes of memory that a strategy needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Requirements {
    /// Bytes of `__local` memory per work-group.
    pub local_bytes: u64,
    /// Bytes of `__constant` memory that the kernels read.
    pub constant_bytes: u64,
    /// Bytes of global memory for working vectors (a scratch buffer or a heap), in addition to the memory for the scene
    /// and the image.
    pub scratch_bytes: u64,
    /// Bytes of private memory that a whole work-group needs at the same time, for working vectors and the rays of
    /// tiles.
    pub private_bytes: u64,
    /// Bytes of global memory for the scene, the image and the data passed between kernels.
    pub global_bytes: u64,
}

impl Requirements {
    /// Returns the needs of `strategy` for `workload` on a device whose work-items exchange values by the operations
    /// `lanes`.
    pub fn of(strategy: &Strategy, workload: &Workload, lanes: LaneOperations) -> Self {
        Self {
            local_bytes: local(strategy, workload, lanes).recorded(),
            constant_bytes: constant(strategy, workload).recorded(),
            scratch_bytes: scratch(strategy, workload).recorded(),
            private_bytes: private(strategy, workload).recorded(),
            global_bytes: global(strategy, workload).recorded(),
        }
    }

    /// Returns the bytes of all buffers in the device's global memory.
    pub fn buffer_bytes(strategy: &Strategy, workload: &Workload) -> u64 {
        buffers(strategy, workload).recorded()
    }

    /// Returns the bytes of global memory that the working vectors of a frame and of its half pictures take (in scratch
    /// buffers or heaps); 0 if the working vectors are in other memory.
    pub fn working_bytes(strategy: &Strategy, workload: &Workload) -> u64 {
        scratch(strategy, workload).recorded()
    }

    /// Returns the bytes of global memory for a scene and its tree. Several points of an experiment can share
    /// the memory of a scene and its tree.
    pub fn scene_bytes(strategy: &Strategy, workload: &Workload) -> u64 {
        scene(strategy, workload).recorded()
    }

    /// Returns the bytes of global memory for the strategy's tree alone, including the lists of the mesh that
    /// the kernels read; 0 if the strategy uses no tree. Several points of an experiment can share the tree's
    /// memory.
    pub fn tree_bytes(strategy: &Strategy, workload: &Workload) -> u64 {
        let mut sum = Sum::default();
        add_tree(&mut sum, strategy, workload);
        add_lists_of_mesh(&mut sum, strategy, workload);
        sum.recorded()
    }

    /// Returns the bytes of the lists of the mesh (normals and triangles) that the strategy's kernels read; 0
    /// if they read none. A device that shares the host's memory reads lists of the mesh in place, without a
    /// copy.
    pub fn mesh_list_bytes(strategy: &Strategy, workload: &Workload) -> u64 {
        let mut sum = Sum::default();
        add_lists_of_mesh(&mut sum, strategy, workload);
        sum.recorded()
    }

    /// Returns an error if the needs of `strategy` for `workload` exceed these limits, or if the strategy
    /// does not support the local size or the scene.
    pub fn check(strategy: &Strategy, workload: &Workload, limits: &DeviceLimits) -> Result<(), Infeasible> {
        shape(workload, limits)?;
        groups(strategy, workload, limits)?;
        textures(strategy, workload)?;
        soft(strategy, workload)?;
        indices(strategy, workload)?;
        let lanes = limits.lane_operations;
        let smallest = Workload { local_size: [1, 1], ..*workload };
        local(strategy, workload, lanes)
            .within("__local memory", limits.local_bytes)
            .map_err(|refused| refused.emulated_if(limits.local_is_emulated))
            .map_err(|refused| {
                refused.of_large_group_if(local(strategy, &smallest, lanes).fits(limits.local_bytes))
            })?;
        constant(strategy, workload)
            .within("__constant memory", limits.constant_bytes)
            .map_err(|refused| refused.emulated_if(limits.constant_is_emulated))?;
        if limits.is_cpu {
            let stack_bytes = cpu_stack_bytes(thread_stack_bytes());
            private(strategy, workload).within(Infeasible::CPU_STACK, stack_bytes).map_err(|refused| {
                refused.of_large_group_if(private(strategy, &smallest).fits(stack_bytes))
            })?;
        }
        let all = buffers(strategy, workload);
        all.each_within(limits.allocation_bytes)?;
        all.within(Infeasible::GLOBAL_MEMORY, limits.global_bytes)
            .map_err(|refused| Infeasible { cause: Cause::GlobalMemory, ..refused })?;
        counters(strategy, workload)
    }
}

/// Returns the number of bytes that the strategy's ray-triangle test reads per triangle.
fn record_bytes(strategy: &Strategy) -> u64 {
    4 * strategy.intersector.record_floats() as u64
}

fn index_bytes(layout: Layout) -> u64 {
    u64::from(layout.index_bits().unwrap_or(0)) / 8
}

fn add_vertices(sum: &mut Sum, strategy: &Strategy, w: &Workload) {
    add_corners(sum, strategy, w, ["corners", "positions"], w.positions);
}

fn add_normals(sum: &mut Sum, strategy: &Strategy, w: &Workload) {
    add_corners(sum, strategy, w, ["normals"; 2], w.normals);
}

/// Adds the bytes of the points, or of the normals, at the triangles' corners to `sum`. If each triangle has
/// corners of its own, adds one term to the sum, with the name `own`. If the triangles share `count` points
/// or normals, adds two terms: one with the name `shared`, and one for the indices of the points or normals.
fn add_corners(sum: &mut Sum, strategy: &Strategy, w: &Workload, [own, shared]: [&str; 2], count: usize) {
    if strategy.layout.index_bits().is_none() {
        sum.add(own, &[(CORNERS_BYTES, " B"), (w.triangles as u64, " triangles")]);
    } else {
        sum.add(shared, &[(POINT_BYTES, " B"), (count as u64, "")]);
        let index = index_bytes(strategy.layout);
        sum.add("their indices", &[(3 * index, " B"), (w.triangles as u64, " triangles")]);
    }
}

/// Adds the bytes of the whole scene (positions, normals, triangles and materials), all of which lie in the
/// same kind of memory.
fn add_scene(sum: &mut Sum, strategy: &Strategy, w: &Workload) {
    if strategy.layout.index_bits().is_none() {
        sum.add("scene", &[(soup_floats(w.emissive) as u64 * 4, " B"), (w.triangles as u64, " triangles")]);
        return;
    }
    add_vertices(sum, strategy, w);
    add_normals(sum, strategy, w);
    sum.add("materials", &[(Material::floats(w.emissive) as u64 * 4, " B"), (w.materials as u64, "")]);
    sum.add("their indices", &[(index_bytes(strategy.layout), " B"), (w.triangles as u64, " triangles")]);
}

fn local(strategy: &Strategy, w: &Workload, lanes: LaneOperations) -> Sum {
    let mut sum = Sum::default();
    if strategy.vectors.memory() == WorkingMemory::Local {
        let [x, y] = w.local_size;
        let mut factors = vec![(strategy.vectors.bytes_per_ray(), " B")];
        if strategy.width.rays() > 1 {
            factors.push((strategy.width.rays() as u64, " rays"));
        }
        factors.extend([(u64::from(x), ""), (u64::from(y), "")]);
        sum.add("vectors", &factors);
    }
    if strategy.shares_tiles() {
        let groups = (u64::from(w.local_size[1]), " tiles");
        sum.add("stack", &[(STACK_ENTRY_BYTES, " B"), (w.stack_size as u64, " entries"), groups]);
        sum.add("leaf", &[(CANDIDATE_BYTES, " B"), (GROUP_LANES.into(), " triangles"), groups]);
        if lanes == LaneOperations::Barriers {
            sum.add("board", &[(BOARD_BYTES, " B")]);
        }
    }
    match strategy.triangles.copied() {
        Copied::Nothing => {}
        Copied::Scene => add_scene(&mut sum, strategy, w),
        Copied::Rows => sum.add("tile", &[(record_bytes(strategy), " B"), (TILE_TRIANGLES, " triangles")]),
        Copied::Vertices => add_vertices(&mut sum, strategy, w),
        Copied::Normals => add_normals(&mut sum, strategy, w),
    }
    sum
}

fn constant(strategy: &Strategy, w: &Workload) -> Sum {
    let mut sum = Sum::default();
    if strategy.triangles.are_constant() {
        add_scene(&mut sum, strategy, w);
    }
    sum
}

fn add_working(sum: &mut Sum, what: &str, strategy: &Strategy, items: [u64; 2]) {
    let bytes = strategy.vectors.bytes_per_ray() * strategy.width.rays() as u64;
    sum.add(what, &[(bytes, " B"), (items[0], ""), (items[1], " work-items")]);
}

pub(super) fn scratch(strategy: &Strategy, w: &Workload) -> Sum {
    let mut sum = Sum::default();
    let items = w.global_size(strategy).map(|n| n as u64);
    match strategy.vectors.memory() {
        WorkingMemory::Private | WorkingMemory::Local => {}
        WorkingMemory::Scratch => add_working(&mut sum, "vectors", strategy, items),
        WorkingMemory::Heap => add_working(&mut sum, "heap", strategy, items),
    }
    for half in half_pictures(w) {
        sum.join(scratch(strategy, &half));
    }
    sum
}

/// Returns the workloads of the two half pictures if soft light is cast at half resolution; otherwise none.
fn half_pictures(w: &Workload) -> impl Iterator<Item = Workload> {
    std::iter::repeat_n(w.halved(), if w.half_light { 2 } else { 0 })
}

/// Returns the bytes of private memory that a work-group needs at the same time: the rays of tiles, and working vectors
/// that are stored for all work-items at once.
fn private(strategy: &Strategy, w: &Workload) -> Sum {
    let mut sum = Sum::default();
    if strategy.traversal.casts_tiles() {
        let (across, down) = strategy.tile.pixels();
        // The sum counts the tiles of all work-items of a work-group. PoCL 3.1 was observed to store the values
        // of all work-items at the same time, even if the kernel has no barriers.
        let [x, y] = w.local_size.map(u64::from);
        let x = if strategy.shares_tiles() { 1 } else { x };
        sum.add(
            "tiles",
            &[
                (TILE_RAY_BYTES + emission_bytes(w), " B"),
                ((across * down) as u64, " rays"),
                (x, ""),
                (y, ""),
            ],
        );
    }
    // A value that lives across a barrier is stored for all work-items at the same time. PoCL 3.1 also stores packets
    // of rays for all work-items at the same time.
    let packets = !strategy.traversal.casts_tiles() && strategy.width.rays() > 1;
    let at_once = strategy.triangles.copied() != Copied::Nothing || packets;
    if strategy.vectors.memory() == WorkingMemory::Private && at_once {
        add_working(&mut sum, "vectors", strategy, w.local_size.map(u64::from));
    }
    sum
}

/// Returns the global memory for the scene and its tree. Each term of the sum is one buffer.
pub(super) fn scene(strategy: &Strategy, w: &Workload) -> Sum {
    let mut sum = scene_beside_mesh(strategy, w);
    add_lists_of_mesh(&mut sum, strategy, w);
    sum
}

/// Returns the same memory as [`scene`], but without lists of the mesh, which a device that shares the host's
/// memory reads in place.
pub(super) fn scene_beside_mesh(strategy: &Strategy, w: &Workload) -> Sum {
    let mut sum = Sum::default();
    if strategy.reads_mesh() {
        add_scene(&mut sum, strategy, w);
    }
    add_tree(&mut sum, strategy, w);
    if w.is_textured() {
        sum.add("textures", &[(4, " B"), (w.texture_words as u64, " words")]);
        sum.add("places in textures", &[(w.texture_row_bytes(), " B"), (w.triangles as u64, " triangles")]);
    }
    if w.corner_colours {
        sum.add("corner colours", &[(CORNER_COLOURS_BYTES, " B"), (w.triangles as u64, " triangles")]);
    }
    if w.sky_texels > 0 {
        sum.add("sky", &[(12, " B"), (w.sky_texels as u64, " texels")]);
    }
    sum
}

/// Adds the lists of the mesh that kernels read ([`Strategy::reads_lists_of_mesh`]).
fn add_lists_of_mesh(sum: &mut Sum, strategy: &Strategy, w: &Workload) {
    if strategy.reads_lists_of_mesh() {
        sum.add("normals", &[(POINT_BYTES, " B"), (w.normals as u64, "")]);
        sum.add("their indices", &[(size_of::<Triangle>() as u64, " B"), (w.triangles as u64, " triangles")]);
    }
}

/// Adds the buffers of the strategy's tree, if the strategy uses a tree. Lists of the mesh that the kernels read are
/// not among these buffers.
fn add_tree(sum: &mut Sum, strategy: &Strategy, w: &Workload) {
    if strategy.needs_tree() {
        let (bytes, nodes) = node_bytes(strategy, w);
        sum.add("leaves", &[(ROW_BYTES, " B"), ((w.triangles + crate::accel::PADDING_ROWS) as u64, " rows")]);
        sum.add("about", &[(bytes, " B"), (nodes, " nodes")]);
    }
    if strategy.traversal.casts_tiles() && strategy.layout.index_bits().is_none() {
        sum.add("normals in leaf order", &[(NORMAL_BYTES, " B"), (w.triangles as u64 + 1, " rows")]);
    }
}

/// Returns the global memory that all buffers take; each term of the sum is one buffer.
fn buffers(strategy: &Strategy, workload: &Workload) -> Sum {
    let mut all = global(strategy, workload);
    all.join(scratch(strategy, workload));
    all
}

/// Returns the global memory for the scene, the image and the data passed between kernels. Each term of the sum is one
/// buffer.
pub(super) fn global(strategy: &Strategy, w: &Workload) -> Sum {
    let mut sum = global_beside_mesh(strategy, w);
    add_lists_of_mesh(&mut sum, strategy, w);
    sum
}

/// Returns the same memory as [`global`], but without lists of the mesh, which a device that shares the
/// host's memory reads in place.
pub(super) fn global_beside_mesh(strategy: &Strategy, w: &Workload) -> Sum {
    let mut sum = scene_beside_mesh(strategy, w);
    add_frame(&mut sum, strategy, w);
    for half in half_pictures(w) {
        add_frame(&mut sum, strategy, &half);
    }
    if w.half_light {
        let [across, down] = w.halved().image_size.map(u64::from);
        sum.add("ratios of soft light", &[(16, " B"), (across, ""), (down, " pixels")]);
    }
    sum
}

/// Adds the bytes of the buffers of one frame to the sum.
fn add_frame(sum: &mut Sum, strategy: &Strategy, w: &Workload) {
    let pixels = w.pixels();
    sum.add("image", &[(16, " B"), (pixels, " pixels")]);
    if w.many_samples {
        let blocks = w.sampled_blocks().map(u64::from);
        sum.add("samples", &[(4, " B"), (blocks[0], ""), (blocks[1], " blocks")]);
        sum.add("rough blocks", &[(4, " B"), (blocks[0], ""), (blocks[1], " blocks")]);
        if w.sky_texels > 0 {
            sum.add("samples that hit", &[(4, " B"), (pixels, " pixels")]);
        }
    }
    if strategy.passes == super::Passes::Separate || strategy.shares_tiles() {
        sum.add("nearest triangles", &[(4, " B"), (w.nearest_count(strategy) as u64, " pixels")]);
    }
    if strategy.traversal.rasterises() {
        sum.add("depth", &[(4, " B"), (pixels, " pixels")]);
    }
    if strategy.shares_tiles() {
        let rays = w.shared_rays(strategy) as u64;
        sum.add("queue", &[(QUEUE_ENTRY_BYTES, " B"), (rays, " rays")]);
        sum.add("lights that reach hits", &[(LIT_BYTES, " B"), (rays, " rays")]);
    }
    if strategy.records == Records::Once {
        sum.add("records", &[(record_bytes(strategy), " B"), (w.triangles as u64, " triangles")]);
    }
    let origins = w.prepared_origins(strategy) as u64;
    if origins > 0 {
        sum.add("planes", &[(ROW_BYTES, " B"), (origins, " origins"), (w.triangles as u64, " triangles")]);
    }
}

/// Returns the bytes of a tree node, and an estimate of the number of nodes. The number of nodes is first
/// computed for full nodes, and for leaves that are half full but have at least four triangles. This number
/// of nodes is then multiplied by three, because leaves usually have fewer triangles than assumed: in trees
/// with fewer than 32 children per node, a leaf is split if a node would otherwise have unused slots.
fn node_bytes(strategy: &Strategy, w: &Workload) -> (u64, u64) {
    let children = strategy.node_width.children() as u64;
    let leaf = strategy.leaf_size.triangles().div_ceil(2).max(4) as u64;
    let nodes = (w.triangles as u64).saturating_mul(3) / (leaf * (children - 1)) + 1;
    (4 * WideBvh::stride(strategy.node_width.children()) as u64, nodes)
}

#[cfg(test)]
mod exact;
#[cfg(test)]
mod tests;
