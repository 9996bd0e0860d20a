//! What a strategy asks of a device, with its arithmetic, before anything is compiled.

use super::{Layout, Strategy, Traversal, Triangles, Vectors};
use crate::device::{DeviceLimits, LaneOperations};

/// Nine working vectors of three floats.
const WORKING_BYTES: u64 = 9 * 3 * 4;
/// A triangle of the soup: 26 floats. Its corners, or its normals: 9. Its material: 8.
const SOUP_BYTES: u64 = 26 * 4;
const CORNERS_BYTES: u64 = 9 * 4;
/// What a test reads of a triangle: three float4.
const ROW_BYTES: u64 = 12 * 4;
const MATERIAL_BYTES: u64 = 8 * 4;
const POINT_BYTES: u64 = 3 * 4;

/// Triangles of a tile where triangles are streamed through `__local` memory.
pub const TILE_TRIANGLES: u64 = 128;

/// A ray of a tile: direction, nearness, place; and while it is shaded what arrives and the sum so far.
const TILE_RAY_BYTES: u64 = (5 + 6) * 4;

/// Work-items that share a tile: GROUP_LANES in the kernels.
pub const GROUP_LANES: u32 = 32;
/// An entry of their stack: a child's word and where it is entered.
const STACK_ENTRY_BYTES: u64 = 8;
/// A word a lane, by which they tell each other things where they have no other way.
const BOARD_BYTES: u64 = 4 * GROUP_LANES as u64;
/// A pixel in the queue of shadow rays left over, and its lights.
const QUEUE_ENTRY_BYTES: u64 = 8;

/// What private arrays of a work-group may take on a CPU, whose threads have stacks of 8 MiB:
/// drivers keep what lives across a barrier once for each work-item of a group, and overflow silently.
const CPU_STACK_BYTES: u64 = 4 << 20;

/// The sizes a strategy's needs depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Workload {
    /// Triangles in the scene.
    pub triangles: usize,
    /// Entries of the mesh's set of positions.
    pub positions: usize,
    /// Entries of the mesh's set of normals.
    pub normals: usize,
    /// Entries of the mesh's set of materials.
    pub materials: usize,
    /// Lights in the scene.
    pub lights: usize,
    /// Entries of a traversal's stack; 0 where there is no tree, or none is built yet.
    pub stack_size: usize,
    /// Pixels across and down.
    pub image_size: [u32; 2],
    /// Work-items of a work-group across and down.
    pub local_size: [u32; 2],
}

impl Workload {
    /// Work-items across and down: one a block of pixels or 32 a tile, whole work-groups.
    pub fn global_size(&self, strategy: &Strategy) -> [usize; 2] {
        if strategy.shares_tiles() {
            let (across, down) = strategy.tile.pixels();
            let tiles = (self.image_size[1] as usize).div_ceil(down);
            return [
                (self.image_size[0] as usize).div_ceil(across) * GROUP_LANES as usize,
                tiles.next_multiple_of(self.local_size[1] as usize),
            ];
        }
        let block = if strategy.traversal == Traversal::Tile {
            strategy.tile.pixels()
        } else {
            strategy.width.block()
        };
        let across = |pixels: u32, block: usize, local: u32| {
            (pixels as usize).div_ceil(block).next_multiple_of(local as usize)
        };
        [
            across(self.image_size[0], block.0, self.local_size[0]),
            across(self.image_size[1], block.1, self.local_size[1]),
        ]
    }

    /// Numbers that separate passes hand on: one a pixel, or whole tiles of them.
    pub fn nearest_count(&self, strategy: &Strategy) -> usize {
        if strategy.traversal == Traversal::Tile && !strategy.shares_tiles() {
            let (across, down) = strategy.tile.pixels();
            self.global_size(strategy).iter().product::<usize>() * across * down
        } else {
            self.image_size[0] as usize * self.image_size[1] as usize
        }
    }

    fn work_group_items(&self) -> u64 {
        u64::from(self.local_size[0]) * u64::from(self.local_size[1])
    }
}

/// Bytes a strategy needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Requirements {
    /// `__local` bytes a work-group.
    pub local_bytes: u64,
    /// `__constant` bytes.
    pub constant_bytes: u64,
    /// Global scratch or heap bytes beside scene and image.
    pub scratch_bytes: u64,
    /// Private bytes of a whole work-group's working vectors.
    pub private_bytes: u64,
    /// Global bytes of scene, image and what passes between kernels.
    pub global_bytes: u64,
}

/// Why a device cannot hold a point: the arithmetic, as a sentence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Infeasible {
    /// For example "__local memory: vectors 108 B x 24 x 24 = 62208 B > 49152 B".
    pub reason: String,
}

/// A sum of bytes that can explain itself.
#[derive(Default)]
struct Sum {
    bytes: u64,
    terms: Vec<String>,
}

impl Sum {
    fn add(&mut self, what: &str, factors: &[(u64, &str)]) {
        self.bytes += factors.iter().map(|(factor, _)| factor).product::<u64>();
        let factors: Vec<_> = factors.iter().map(|(factor, unit)| format!("{factor}{unit}")).collect();
        self.terms.push(format!("{what} {}", factors.join(" x ")));
    }

    fn within(&self, memory: &str, limit_bytes: u64) -> Result<(), Infeasible> {
        if self.bytes <= limit_bytes {
            return Ok(());
        }
        let (sum, bytes) = (self.terms.join(" + "), self.bytes);
        Err(Infeasible { reason: format!("{memory}: {sum} = {bytes} B > {limit_bytes} B") })
    }
}

impl Requirements {
    /// What `strategy` needs for `workload`.
    pub fn of(strategy: &Strategy, workload: &Workload) -> Self {
        Self {
            local_bytes: local(strategy, workload).bytes,
            constant_bytes: constant(strategy, workload).bytes,
            scratch_bytes: scratch(strategy, workload).bytes,
            private_bytes: private(strategy, workload).bytes,
            global_bytes: global(strategy, workload).bytes,
        }
    }

    /// What `strategy` needs for `workload`, if a device with these limits can hold it.
    pub fn check(
        strategy: &Strategy,
        workload: &Workload,
        limits: &DeviceLimits,
    ) -> Result<Self, Infeasible> {
        shape(workload, limits)?;
        groups(strategy, workload, limits)?;
        indices(strategy, workload)?;
        local(strategy, workload).within("__local memory", limits.local_bytes)?;
        constant(strategy, workload).within("__constant memory", limits.constant_bytes)?;
        let scratch = scratch(strategy, workload);
        scratch.within("largest buffer", limits.allocation_bytes)?;
        if limits.is_cpu {
            private(strategy, workload).within("a CPU thread's stack", CPU_STACK_BYTES)?;
        }
        let mut all = global(strategy, workload);
        all.bytes += scratch.bytes;
        all.terms.extend(scratch.terms);
        all.within("global memory", limits.global_bytes)?;
        Ok(Self::of(strategy, workload))
    }
}

/// Whether a work-group of this shape exists on the device at all.
fn shape(workload: &Workload, limits: &DeviceLimits) -> Result<(), Infeasible> {
    let [x, y] = workload.local_size;
    let items = workload.work_group_items();
    if items > limits.work_group_size as u64 {
        let reason =
            format!("work-group: {x} x {y} = {items} work-items > the device's {}", limits.work_group_size);
        return Err(Infeasible { reason });
    }
    let sizes = limits.work_item_sizes;
    if x as usize > sizes[0] || y as usize > sizes[1] {
        let reason = format!("work-group: {x} x {y} work-items > the device's {} x {}", sizes[0], sizes[1]);
        return Err(Infeasible { reason });
    }
    Ok(())
}

/// Whether a work-group consists of groups that can share tiles.
fn groups(strategy: &Strategy, workload: &Workload, limits: &DeviceLimits) -> Result<(), Infeasible> {
    let [x, y] = workload.local_size;
    if !strategy.shares_tiles() {
        return Ok(());
    }
    if x != GROUP_LANES {
        let reason = format!(
            "work-group: {x} x {y}, but traversal = tile with width = 1 shares a tile among {GROUP_LANES} work-items across: 32 x 1 to 32 x 8"
        );
        return Err(Infeasible { reason });
    }
    if y > 1 && limits.lane_operations == LaneOperations::Barriers {
        let reason = format!(
            "work-group: {x} x {y}, but this device has only barriers to share a tile by, one tile a work-group: 32 x 1"
        );
        return Err(Infeasible { reason });
    }
    Ok(())
}

/// Whether 16-bit indices reach every entry.
fn indices(strategy: &Strategy, workload: &Workload) -> Result<(), Infeasible> {
    let largest = workload.positions.max(workload.normals).max(workload.materials);
    if strategy.layout == Layout::Indexed16 && largest > 1 << 16 {
        let reason = format!("16-bit indices: {largest} entries > {}", 1 << 16);
        return Err(Infeasible { reason });
    }
    Ok(())
}

fn index_bytes(layout: Layout) -> u64 {
    if layout == Layout::Indexed16 { 2 } else { 4 }
}

fn add_vertices(sum: &mut Sum, strategy: &Strategy, w: &Workload) {
    if strategy.layout == Layout::Soup {
        sum.add("corners", &[(CORNERS_BYTES, " B"), (w.triangles as u64, " triangles")]);
    } else {
        sum.add("positions", &[(POINT_BYTES, " B"), (w.positions as u64, "")]);
        let index = index_bytes(strategy.layout);
        sum.add("their indices", &[(3 * index, " B"), (w.triangles as u64, " triangles")]);
    }
}

fn add_normals(sum: &mut Sum, strategy: &Strategy, w: &Workload) {
    if strategy.layout == Layout::Soup {
        sum.add("normals", &[(CORNERS_BYTES, " B"), (w.triangles as u64, " triangles")]);
    } else {
        sum.add("normals", &[(POINT_BYTES, " B"), (w.normals as u64, "")]);
        let index = index_bytes(strategy.layout);
        sum.add("their indices", &[(3 * index, " B"), (w.triangles as u64, " triangles")]);
    }
}

/// The whole scene in one memory.
fn add_scene(sum: &mut Sum, strategy: &Strategy, w: &Workload) {
    if strategy.layout == Layout::Soup {
        sum.add("scene", &[(SOUP_BYTES, " B"), (w.triangles as u64, " triangles")]);
        return;
    }
    add_vertices(sum, strategy, w);
    add_normals(sum, strategy, w);
    sum.add("materials", &[(MATERIAL_BYTES, " B"), (w.materials as u64, "")]);
    sum.add("their indices", &[(index_bytes(strategy.layout), " B"), (w.triangles as u64, " triangles")]);
}

fn local(strategy: &Strategy, w: &Workload) -> Sum {
    let mut sum = Sum::default();
    if strategy.vectors == Vectors::Local {
        let [x, y] = w.local_size;
        let mut factors = vec![(WORKING_BYTES, " B")];
        if strategy.width.rays() > 1 {
            factors.push((strategy.width.rays() as u64, " rays"));
        }
        factors.extend([(u64::from(x), ""), (u64::from(y), "")]);
        sum.add("vectors", &factors);
    }
    if strategy.shares_tiles() {
        let groups = (u64::from(w.local_size[1]), " tiles");
        sum.add("stack", &[(STACK_ENTRY_BYTES, " B"), (w.stack_size as u64, " entries"), groups]);
        sum.add("leaf", &[(ROW_BYTES, " B"), (GROUP_LANES.into(), " triangles"), groups]);
        sum.add("board", &[(BOARD_BYTES, " B")]);
    }
    match strategy.triangles {
        Triangles::Global | Triangles::Constant => {}
        Triangles::Local => add_scene(&mut sum, strategy, w),
        Triangles::Tiled => sum.add("tile", &[(ROW_BYTES, " B"), (TILE_TRIANGLES, " triangles")]),
        Triangles::SplitVertices => add_vertices(&mut sum, strategy, w),
        Triangles::SplitNormals => add_normals(&mut sum, strategy, w),
    }
    sum
}

fn constant(strategy: &Strategy, w: &Workload) -> Sum {
    let mut sum = Sum::default();
    if strategy.triangles == Triangles::Constant {
        add_scene(&mut sum, strategy, w);
    }
    sum
}

fn add_working(sum: &mut Sum, what: &str, strategy: &Strategy, items: [u64; 2]) {
    let bytes = WORKING_BYTES * strategy.width.rays() as u64;
    sum.add(what, &[(bytes, " B"), (items[0], ""), (items[1], " work-items")]);
}

fn scratch(strategy: &Strategy, w: &Workload) -> Sum {
    let mut sum = Sum::default();
    let items = w.global_size(strategy).map(|n| n as u64);
    match strategy.vectors {
        Vectors::Private | Vectors::Local => {}
        Vectors::Global => add_working(&mut sum, "vectors", strategy, items),
        Vectors::Heap => add_working(&mut sum, "heap", strategy, items),
    }
    sum
}

/// What lives across barriers, if the strategy has any, and the rays of tiles.
fn private(strategy: &Strategy, w: &Workload) -> Sum {
    let mut sum = Sum::default();
    if strategy.traversal == Traversal::Tile {
        let (across, down) = strategy.tile.pixels();
        let [x, y] = w.local_size.map(u64::from);
        let x = if strategy.shares_tiles() { 1 } else { x };
        sum.add("tiles", &[(TILE_RAY_BYTES, " B"), ((across * down) as u64, " rays"), (x, ""), (y, "")]);
    }
    let barriers = !matches!(strategy.triangles, Triangles::Global | Triangles::Constant);
    if strategy.vectors == Vectors::Private && barriers {
        add_working(&mut sum, "vectors", strategy, w.local_size.map(u64::from));
    }
    sum
}

fn global(strategy: &Strategy, w: &Workload) -> Sum {
    let mut sum = Sum::default();
    add_scene(&mut sum, strategy, w);
    let pixels = u64::from(w.image_size[0]) * u64::from(w.image_size[1]);
    sum.add("image", &[(16, " B"), (pixels, " pixels")]);
    if strategy.passes == super::Passes::Separate {
        sum.add("nearest triangles", &[(4, " B"), (w.nearest_count(strategy) as u64, " pixels")]);
    }
    if strategy.traversal == Traversal::Raster {
        sum.add("depth", &[(4, " B"), (pixels, " pixels")]);
    }
    if strategy.shares_tiles() {
        sum.add("queue", &[(QUEUE_ENTRY_BYTES, " B"), (pixels, " pixels")]);
    }
    if strategy.needs_tree() {
        let children = strategy.node_width.children() as u64;
        // Full nodes over full leaves, and half as many again for those that are not.
        let nodes = 3 * (w.triangles as u64) / (strategy.leaf_size.triangles() as u64 * (children - 1)) + 1;
        sum.add("leaves", &[(ROW_BYTES, " B"), (w.triangles as u64, " triangles")]);
        sum.add("about", &[(8 * children * 4, " B"), (nodes, " nodes")]);
    }
    if strategy.intersector == super::Intersector::CommonOrigin {
        let origins = 1 + w.lights as u64;
        sum.add(
            "planes",
            &[(CORNERS_BYTES, " B"), (origins, " origins"), (w.triangles as u64, " triangles")],
        );
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::super::{PRESETS, preset};
    use super::*;

    const PAPER_DEVICE: DeviceLimits = DeviceLimits {
        local_bytes: 48 << 10,
        constant_bytes: 64 << 10,
        global_bytes: 1 << 30,
        allocation_bytes: 1 << 28,
        work_group_size: 1024,
        work_item_sizes: [1024, 1024, 64],
        compute_units: 16,
        native_width: 1,
        is_cpu: false,
        lane_operations: LaneOperations::Barriers,
    };

    fn workload(triangles: usize, local: u32) -> Workload {
        Workload {
            triangles,
            positions: triangles,
            normals: triangles,
            materials: 2,
            lights: 1,
            stack_size: 0,
            image_size: [800, 500],
            local_size: [local, local],
        }
    }

    fn check(name: &str, triangles: usize, local: u32) -> Result<Requirements, Infeasible> {
        let strategy = preset(name).map_err(|e| Infeasible { reason: e.to_string() })?.strategy;
        Requirements::check(&strategy, &workload(triangles, local), &PAPER_DEVICE)
    }

    #[test]
    fn optimisation_2_holds_472_triangles_in_48_kib() {
        assert_eq!(check("local-triangles", 472, 16).map(|r| r.local_bytes), Ok(49088));
        let refused = check("local-triangles", 473, 16).unwrap_err();
        assert_eq!(refused.reason, "__local memory: scene 104 B x 473 triangles = 49192 B > 49152 B");
    }

    #[test]
    fn compounded_holds_206_triangles_beside_16x16_vectors() {
        assert!(check("compounded", 206, 16).is_ok());
        assert!(check("compounded", 207, 16).is_err());
    }

    #[test]
    fn vectors_of_24x24_do_not_fit_48_kib() {
        let refused = check("local-vectors", 1, 24).unwrap_err();
        assert_eq!(refused.reason, "__local memory: vectors 108 B x 24 x 24 = 62208 B > 49152 B");
    }

    #[test]
    fn work_items_of_a_wide_strategy_cover_blocks_of_pixels() {
        let wide = preset("wide").unwrap().strategy;
        assert_eq!(workload(1, 6).global_size(&wide), [204, 126]);
    }

    #[test]
    fn every_preset_fits_one_triangle() {
        for preset in PRESETS {
            let mut workload = workload(1, 8);
            workload.local_size = preset.strategy.local_size(&PAPER_DEVICE, workload.local_size);
            let fits = Requirements::check(&preset.strategy, &workload, &PAPER_DEVICE);
            assert!(fits.is_ok(), "{}: {fits:?}", preset.name);
        }
    }

    #[test]
    fn a_shared_tile_has_32_work_items_and_room_for_its_stack() {
        let strategy = preset("tile-group").unwrap().strategy;
        let check = |local_size, stack_size, lane_operations| {
            let workload = Workload { local_size, stack_size, ..workload(1, 8) };
            let limits = DeviceLimits { lane_operations, ..PAPER_DEVICE };
            Requirements::check(&strategy, &workload, &limits).map(|needs| needs.local_bytes)
        };
        let [barriers, ptx] = [LaneOperations::Barriers, LaneOperations::Ptx];
        assert_eq!(check([32, 4], 192, ptx), Ok((192 * 8 + 1536) * 4 + 128));
        assert!(check([8, 8], 192, ptx).unwrap_err().reason.contains("32 work-items across"));
        assert!(check([32, 4], 192, barriers).unwrap_err().reason.contains("only barriers"));
        assert!(check([32, 1], 192, barriers).is_ok());
        let refused = check([32, 4], 1600, ptx).unwrap_err();
        assert!(
            refused.reason.starts_with("__local memory: stack 8 B x 1600 entries x 4 tiles"),
            "{refused:?}"
        );
    }

    #[test]
    fn a_shared_tile_is_32_work_items_of_the_frame() {
        let strategy = preset("tile-group").unwrap().strategy;
        let workload = Workload { image_size: [45, 29], local_size: [32, 3], ..workload(1, 8) };
        assert_eq!(workload.global_size(&strategy), [6 * 32, 6]);
    }
}
