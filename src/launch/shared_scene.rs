//! The parts of a scene that the strategies of a session share: layouts and trees on the device, each made
//! when it is first needed.

use super::{DeviceScene, DeviceTree, HostTree, LaunchError, Queue};
use crate::scene::Scene;
use crate::strategy::{Layout, LeafSize, NodeWidth, Requirements, Strategy, Traversal, Workload};
use std::collections::HashMap;
use std::sync::Arc;

/// Identifies an upload of a scene: its layout, and whether it includes the triangles.
pub(super) type LayoutKind = (Layout, bool);
/// Identifies a tree of a scene, with its triangles and normals.
pub(super) type TreeKind = (Traversal, NodeWidth, LeafSize, Layout);

/// Identifies the parts of a scene that a strategy uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Kind {
    pub layout: LayoutKind,
    pub tree: Option<TreeKind>,
}

impl Kind {
    /// Returns the parts that a strategy uses.
    pub fn of(strategy: &Strategy) -> Self {
        let tree = (strategy.traversal, strategy.node_width, strategy.leaf_size, strategy.layout);
        Self { layout: (strategy.layout, strategy.reads_mesh()), tree: strategy.needs_tree().then_some(tree) }
    }
}

/// The layouts and trees of a scene that are on the device, each with the bytes that it takes there.
#[derive(Default)]
pub(super) struct SharedScene {
    layouts: HashMap<LayoutKind, (Arc<DeviceScene>, u64)>,
    trees: HashMap<TreeKind, (Arc<DeviceTree>, u64)>,
}

impl SharedScene {
    /// Returns the tree of a strategy if it is on the device.
    pub fn tree(&self, strategy: &Strategy) -> Option<Arc<DeviceTree>> {
        self.trees.get(&Kind::of(strategy).tree?).map(|(tree, _)| Arc::clone(tree))
    }

    /// Returns the bytes of the parts that are on the device but that `strategy` does not use.
    pub fn bytes_beside(&self, strategy: &Strategy) -> u64 {
        let own = Kind::of(strategy);
        let layouts = self.layouts.iter().filter(|(kind, _)| **kind != own.layout);
        let trees = self.trees.iter().filter(|(kind, _)| Some(**kind) != own.tree);
        layouts.map(|(_, (_, bytes))| bytes).chain(trees.map(|(_, (_, bytes))| bytes)).sum()
    }

    /// Uploads the tree of a strategy, if the strategy uses a tree. Builds the tree first, unless `early` contains a
    /// tree that was built before.
    pub fn build_tree(
        &mut self,
        queue: &Queue,
        scene: &Scene,
        strategy: &Strategy,
        workload: &Workload,
        early: Option<HostTree>,
    ) -> Result<(), LaunchError> {
        let built = match early {
            Some(tree) => Some(tree),
            None => HostTree::build(&scene.mesh, strategy)?,
        };
        if let (Some(kind), Some(tree)) = (Kind::of(strategy).tree, built) {
            let tree = DeviceTree::upload(queue, &scene.mesh, strategy, tree)?;
            self.trees.insert(kind, (Arc::new(tree), Requirements::tree_bytes(strategy, workload)));
        }
        Ok(())
    }

    /// Returns the scene in the layout of a strategy.
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
        // For tiles, the upload leaves the triangles out.
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
        let mut shared = SharedScene::default();
        shared.layout(&queue, &scene, &without, &workload).unwrap();
        assert_eq!(shared.bytes_beside(&without), 0);
        let layout = shared.bytes_beside(&other);
        assert_eq!(layout, Requirements::scene_bytes(&without, &workload));
        shared.build_tree(&queue, &scene, &with, &workload, None).unwrap();
        let both = shared.bytes_beside(&other);
        assert_eq!(both - layout, Requirements::tree_bytes(&with, &workload));
        shared.layout(&queue, &scene, &with, &workload).unwrap();
        assert_eq!((shared.bytes_beside(&other), shared.bytes_beside(&with)), (both, 0));
        assert_eq!(shared.bytes_beside(&without), both - layout);
    }
}
