//! A scene's tree in a device's memory.

use super::arguments::Arguments;
use super::buffers::{upload, upload_rows};
use super::lent::Lent;
use super::scene::material_floats;
use super::{LaunchError, Queue, Refused};
use crate::accel::{
    NORMAL_FLOATS, PADDING_ROWS, TRIANGLE_WORDS, TreeUse, WideBvh, write_normal_rows, write_triangle_rows,
};
use crate::clock::ms_since;
use crate::device::DeviceLimits;
use crate::scene::Mesh;
use crate::strategy::{Afterwards, HostNeeds, Requirements, Strategy, Workload};
use ocl::Buffer;
use std::sync::Arc;
use std::time::Instant;

/// Stack sizes are multiples of this many entries, so that scenes whose trees have similar depths share a program.
const STACK_STEP: usize = 32;

/// The nodes of a tree, and the tree's triangles in leaf order, on the device.
#[derive(Debug)]
pub(super) struct DeviceTree {
    pub(super) nodes: Buffer<u32>,
    pub(super) leaves: Buffer<f32>,
    /// The normals and materials, which kernels with `traversal = tile` need for shading; `None` for other traversals.
    pub(super) surfaces: Option<Surfaces>,
    /// Number of entries of the stack with which kernels traverse the tree: enough for the deepest path,
    /// rounded up.
    pub stack_size: usize,
    /// Time for building the tree on the host.
    pub build_ms: f64,
    /// Time for uploading the tree to the device.
    pub upload_ms: f64,
}

/// A tree on the host, and the time for building the tree.
pub struct HostTree {
    wide: WideBvh,
    build_ms: f64,
}

impl HostTree {
    /// Builds a mesh's tree for `strategy`; returns `None` if the strategy uses no tree. `tree_use` says for
    /// how many frames the tree is built.
    pub(super) fn build(
        mesh: &Mesh,
        strategy: &Strategy,
        tree_use: TreeUse,
    ) -> Result<Option<Self>, LaunchError> {
        if !strategy.needs_tree() {
            return Ok(None);
        }
        let start = Instant::now();
        let wide = tree_of(mesh, strategy, tree_use)?;
        Ok(Some(Self { wide, build_ms: ms_since(start) }))
    }

    /// Builds the tree before a session begins; the device need not be open yet. Returns `None` if the host
    /// lacks memory, if the device does not meet the strategy's requirements (memory, for example), or if the
    /// build fails: the session reports the error later. The function also returns `None` if the strategy
    /// uses no tree.
    pub fn ahead(
        mesh: &Mesh,
        strategy: &Strategy,
        workload: &Workload,
        limits: &DeviceLimits,
        tree_use: TreeUse,
    ) -> Option<Self> {
        let needs = HostNeeds::of(strategy, workload, limits.is_cpu, Afterwards::default());
        needs.check_now(0).ok()?;
        Requirements::check(strategy, workload, limits).ok()?;
        Self::build(mesh, strategy, tree_use).ok()?
    }
}

/// The triangles' normals, in the layout that the strategy chooses, and all materials.
#[derive(Debug)]
pub(super) struct Surfaces {
    normals: Normals,
    materials: Buffer<f32>,
    material_count: usize,
}

#[derive(Debug)]
enum Normals {
    /// Three normals per triangle, in leaf order.
    Rows(Buffer<f32>),
    /// The mesh's normals, and the mesh's triangles, which contain the indices of their normals.
    Indexed { set: Lent<f32>, triangles: Lent<u32> },
}

impl Normals {
    fn upload(queue: &Queue, mesh: &Arc<Mesh>, strategy: &Strategy, order: &[u32]) -> ocl::Result<Self> {
        if strategy.layout.index_bits().is_some() {
            let set = Lent::of(queue, mesh, |mesh| bytemuck::cast_slice(&mesh.normals))?;
            let triangles = Lent::of(queue, mesh, |mesh| bytemuck::cast_slice(&mesh.triangles))?;
            return Ok(Self::Indexed { set, triangles });
        }
        Ok(Self::Rows(upload_rows(queue, [order.len() + 1, NORMAL_FLOATS], |range, rows| {
            // The buffer has one row more than there are triangles: kernels that load four floats at once
            // read one float beyond the last triangle's row.
            let order = &order[range.start.min(order.len())..range.end.min(order.len())];
            write_normal_rows(mesh, order, rows);
        })?))
    }
}

impl Surfaces {
    fn upload(queue: &Queue, mesh: &Arc<Mesh>, strategy: &Strategy, order: &[u32]) -> ocl::Result<Self> {
        Ok(Self {
            normals: Normals::upload(queue, mesh, strategy, order)?,
            materials: upload(queue, &material_floats(mesh))?,
            material_count: mesh.materials.len(),
        })
    }

    /// Adds the buffers of normals and materials to `arguments`.
    pub fn add_to<'a>(&'a self, arguments: Arguments<'a>) -> Arguments<'a> {
        let arguments = match &self.normals {
            Normals::Rows(rows) => arguments.with("surfaces", rows),
            Normals::Indexed { set, triangles } => {
                arguments.with("normal_set", set.buffer()).with("mesh_triangles", triangles.buffer())
            }
        };
        arguments.with("materials", &self.materials).with("material_count", self.material_count as i32)
    }
}

/// Builds a mesh's tree for `strategy`.
fn tree_of(mesh: &Mesh, strategy: &Strategy, tree_use: TreeUse) -> Result<WideBvh, LaunchError> {
    WideBvh::of_mesh_for(tree_use, mesh, strategy.node_width.children(), strategy.leaf_size.triangles())
        .map_err(|error| LaunchError::Tree(error.to_string()))
}

/// Returns the number of stack entries for the deepest path of a tree, rounded up.
fn stack_size_of(tree: &WideBvh) -> usize {
    tree.stack_size().next_multiple_of(STACK_STEP)
}

/// Returns the number of stack entries for a strategy's tree over a mesh; 0 if the strategy uses no tree. The
/// tree is built for many frames. No device is needed.
pub fn stack_size(mesh: &Mesh, strategy: &Strategy) -> Result<usize, Refused> {
    if !strategy.needs_tree() {
        return Ok(0);
    }
    tree_of(mesh, strategy, TreeUse::ManyFrames)
        .map(|tree| stack_size_of(&tree))
        .map_err(Refused::at("building the tree"))
}

impl DeviceTree {
    /// Uploads a mesh's tree for `strategy`, with the triangles in leaf order. If the strategy has `traversal = tile`,
    /// also uploads the normals and materials.
    pub fn upload(
        queue: &Queue,
        mesh: &Arc<Mesh>,
        strategy: &Strategy,
        HostTree { wide, build_ms }: HostTree,
    ) -> Result<Self, LaunchError> {
        let start = Instant::now();
        let stack_size = stack_size_of(&wide);
        let WideBvh { nodes: host_nodes, order, .. } = wide;
        let nodes = upload(queue, &host_nodes)?;
        // Nodes of large meshes take hundreds of megabytes, so the host's copy of the nodes is freed before
        // the triangles are written.
        drop(host_nodes);
        let triangles = order.len();
        let leaves = upload_rows(queue, [triangles + PADDING_ROWS, TRIANGLE_WORDS], |range, rows| {
            // Rows after the last triangle become zero.
            let order = &order[range.start.min(triangles)..range.end.min(triangles)];
            write_triangle_rows(mesh, order, rows);
        })?;
        let tiles = strategy.traversal.casts_tiles();
        let surfaces = tiles.then(|| Surfaces::upload(queue, mesh, strategy, &order)).transpose()?;
        queue.commands.finish()?;
        Ok(Self { nodes, leaves, surfaces, stack_size, build_ms, upload_ms: ms_since(start) })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::device::EXAMPLE_LIMITS;
    use crate::reference::fixtures;
    use crate::strategy::preset;

    #[test]
    fn no_tree_is_built_ahead_for_a_scene_that_does_not_fit_into_the_hosts_memory() {
        let mesh = fixtures::single_triangle().mesh;
        let strategy = preset("bvh").unwrap().strategy;
        let limits = DeviceLimits { global_bytes: u64::MAX, allocation_bytes: u64::MAX, ..EXAMPLE_LIMITS };
        let is_built = |materials: usize| {
            let workload = Workload { materials, ..Workload::CUBE };
            Requirements::check(&strategy, &workload, &limits).unwrap();
            HostTree::ahead(&mesh, &strategy, &workload, &limits, TreeUse::ManyFrames).is_some()
        };
        assert_eq!([1, 1 << 44].map(is_built), [true, false]);
    }
}
