//! The parts of a scene on the device that the strategies of a session share: uploads of the scene, each in
//! one layout of triangles, and trees. An upload or a tree is made when a strategy first needs it.

use super::{DeviceScene, DeviceTree, HostTree, LaunchError, Queue};
use crate::scene::Scene;
use crate::strategy::{Layout, LeafSize, NodeWidth, Requirements, Strategy, Traversal, Workload};
use std::collections::HashMap;
use std::sync::Arc;

/// Identifies an upload of a scene: the layout, and true if the upload includes the triangles.
pub(super) type LayoutKind = (Layout, bool);
/// Identifies a tree of a scene, with the triangles and normals that are uploaded with the tree.
pub(super) type TreeKind = (Traversal, NodeWidth, LeafSize, Layout);

/// Identifies the parts of a scene that a strategy uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Kind {
    pub layout: LayoutKind,
    pub tree: Option<TreeKind>,
}

impl Kind {
    /// Returns which parts of a scene a strategy uses.
    pub fn of(strategy: &Strategy) -> Self {
        let tree = (strategy.traversal, strategy.node_width, strategy.leaf_size, strategy.layout);
        Self { layout: (strategy.layout, strategy.reads_mesh()), tree: strategy.needs_tree().then_some(tree) }
    }
}

/// The bytes that parts of a scene take on the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct PartBytes {
    /// Bytes of all buffers except those with lists of the mesh, such as its normals.
    pub buffers: u64,
    /// Bytes of the lists of the mesh that kernels read. A device that shares the host's memory reads the
    /// mesh's lists in place.
    pub mesh_lists: u64,
}

/// The uploads of a scene (one per layout) and its trees, each with the number of bytes that it takes on the
/// device.
#[derive(Default)]
pub(super) struct SharedScene {
    layouts: HashMap<LayoutKind, (Arc<DeviceScene>, u64)>,
    trees: HashMap<TreeKind, (Arc<DeviceTree>, PartBytes)>,
}

impl SharedScene {
    /// Returns the tree of a strategy; `None` if the tree is not on the device.
    pub fn tree(&self, strategy: &Strategy) -> Option<Arc<DeviceTree>> {
        self.trees.get(&Kind::of(strategy).tree?).map(|(tree, _)| Arc::clone(tree))
    }

    /// Returns the bytes of the uploads and trees that are on the device but that `strategy` does not use.
    /// `reads_in_place` is true if the device shares the host's memory. If `reads_in_place` is true, all trees with
    /// which kernels read the mesh's lists use the same lists. The bytes of these lists then count once, or not at all
    /// if `strategy` reads the lists too. If `reads_in_place` is false, each of these trees has its own copy of the
    /// lists, and the bytes of every copy are added.
    pub fn bytes_beside(&self, strategy: &Strategy, reads_in_place: bool) -> PartBytes {
        let own = Kind::of(strategy);
        let layouts = self.layouts.iter().filter(|(kind, _)| **kind != own.layout);
        let trees = self.trees.iter().filter(|(kind, _)| Some(**kind) != own.tree);
        let trees: Vec<PartBytes> = trees.map(|(_, (_, bytes))| *bytes).collect();
        let of_layouts: u64 = layouts.map(|(_, (_, bytes))| bytes).sum();
        let of_trees: u64 = trees.iter().map(|tree| tree.buffers).sum();
        let lists = trees.iter().map(|tree| tree.mesh_lists);
        let mesh_lists: u64 = match reads_in_place {
            true if strategy.reads_lists_of_mesh() => 0,
            true => lists.max().unwrap_or(0),
            false => lists.sum(),
        };
        PartBytes { buffers: of_layouts + of_trees, mesh_lists }
    }

    /// Uploads the tree of a strategy. Does nothing if `tree` is `None`, as it is for a strategy that uses no
    /// tree.
    pub fn upload_tree(
        &mut self,
        queue: &Queue,
        scene: &Scene,
        strategy: &Strategy,
        workload: &Workload,
        tree: Option<HostTree>,
    ) -> Result<(), LaunchError> {
        if let (Some(kind), Some(tree)) = (Kind::of(strategy).tree, tree) {
            let tree = DeviceTree::upload(queue, &scene.mesh, strategy, tree)?;
            let mesh_lists = Requirements::mesh_list_bytes(strategy, workload);
            let buffers = Requirements::tree_bytes(strategy, workload) - mesh_lists;
            self.trees.insert(kind, (Arc::new(tree), PartBytes { buffers, mesh_lists }));
        }
        Ok(())
    }

    /// Returns the scene on the device, in the layout of a strategy. Uploads the scene first if the device
    /// does not have it in this layout.
    pub fn layout(
        &mut self,
        queue: &Queue,
        scene: &Scene,
        strategy: &Strategy,
        workload: &Workload,
    ) -> Result<Arc<DeviceScene>, LaunchError> {
        let kind = Kind::of(strategy).layout;
        if let Some((uploaded, _)) = self.layouts.get(&kind) {
            return Ok(Arc::clone(uploaded));
        }
        let uploaded = Arc::new(DeviceScene::upload(queue, scene, strategy)?);
        let bytes =
            Requirements::scene_bytes(strategy, workload) - Requirements::tree_bytes(strategy, workload);
        self.layouts.insert(kind, (Arc::clone(&uploaded), bytes));
        Ok(uploaded)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::accel::TreeUse;
    use crate::device::discover;
    use crate::program::Sources;
    use crate::scene::load_scene;
    use crate::strategy::preset;
    use std::path::Path;

    #[test]
    fn only_strategies_that_read_the_same_parts_of_a_scene_share_its_upload() {
        let upload = |name| Kind::of(&preset(name).unwrap().strategy).layout;
        assert_eq!(upload("bvh"), upload("deferred"));
        assert_eq!(upload("tile"), upload("tile-group"));
        // For a strategy that casts tiles, the upload leaves the triangles out, since its kernels read the
        // triangles from the tree.
        assert_ne!(upload("tile"), upload("deferred"));
        assert_ne!(upload("split-vertices"), upload("deferred"));
    }

    #[test]
    fn parts_that_two_strategies_share_count_once_for_a_third() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let queue = Queue::open(&device).unwrap();
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/pyramid-lower.toml");
        let scene = load_scene(&path).unwrap().scene;
        let workload = Workload::of(&scene, [8, 8], [1, 1]);
        let [without, with, other] = ["deferred", "bvh", "tile"].map(|name| preset(name).unwrap().strategy);
        let beside = |shared: &SharedScene, strategy| {
            let PartBytes { buffers, mesh_lists } = shared.bytes_beside(strategy, true);
            assert_eq!(mesh_lists, 0);
            buffers
        };
        let tree = |strategy| HostTree::build(&scene.mesh, strategy, TreeUse::ManyFrames).unwrap();
        let mut shared = SharedScene::default();
        shared.layout(&queue, &scene, &without, &workload).unwrap();
        assert_eq!(beside(&shared, &without), 0);
        let layout = beside(&shared, &other);
        assert_eq!(layout, Requirements::scene_bytes(&without, &workload));
        shared.upload_tree(&queue, &scene, &with, &workload, tree(&with)).unwrap();
        let both = beside(&shared, &other);
        assert_eq!(both - layout, Requirements::tree_bytes(&with, &workload));
        shared.layout(&queue, &scene, &with, &workload).unwrap();
        assert_eq!((beside(&shared, &other), beside(&shared, &with)), (both, 0));
        assert_eq!(beside(&shared, &without), both - layout);
    }

    #[test]
    fn lists_of_the_mesh_count_once_if_the_device_reads_them_in_place() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let queue = Queue::open(&device).unwrap();
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/pyramid-lower.toml");
        let scene = load_scene(&path).unwrap().scene;
        let workload = Workload::of(&scene, [8, 8], [1, 1]);
        let [rows, other] = ["tile", "deferred"].map(|name| preset(name).unwrap().strategy);
        let indexed = |leaf_size| Strategy { layout: Layout::INDEXED_32, leaf_size, ..rows };
        let [first, second, third] = [LeafSize::L4, LeafSize::L8, LeafSize::L16].map(indexed);
        let tree = |strategy| HostTree::build(&scene.mesh, strategy, TreeUse::ManyFrames).unwrap();
        let mut shared = SharedScene::default();
        for strategy in [&first, &second] {
            shared.upload_tree(&queue, &scene, strategy, &workload, tree(strategy)).unwrap();
        }
        let once = Requirements::mesh_list_bytes(&first, &workload);
        let all = [&first, &second].map(|strategy| Requirements::tree_bytes(strategy, &workload));
        let buffers = all[0] + all[1] - 2 * once;
        assert!(once > 0 && buffers > 0);
        let beside = |strategy: &Strategy, reads_in_place| {
            let beside = shared.bytes_beside(strategy, reads_in_place);
            (beside.buffers, beside.mesh_lists)
        };
        for strategy in [&rows, &other] {
            assert_eq!(beside(strategy, true), (buffers, once));
            assert_eq!(beside(strategy, false), (buffers, 2 * once));
        }
        assert_eq!([true, false].map(|at| beside(&third, at)), [(buffers, 0), (buffers, 2 * once)]);
        let of_second = all[1] - once;
        assert_eq!([true, false].map(|at| beside(&first, at)), [(of_second, 0), (of_second, once)]);
    }
}
