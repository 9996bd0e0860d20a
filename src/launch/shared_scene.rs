//! The parts of a scene that the strategies of a session share: layouts and trees on the device, each made
//! when it is first needed.

use super::{DeviceScene, DeviceTree, HostTree, LaunchError, Queue};
use crate::scene::Scene;
use crate::strategy::{Layout, LeafSize, NodeWidth, Strategy, Traversal};
use std::collections::HashMap;
use std::sync::Arc;

/// Identifies an upload of a scene: its layout, and whether it includes the triangles.
pub(super) type LayoutKind = (Layout, bool);
/// Identifies a tree of a scene.
pub(super) type TreeKind = (Traversal, NodeWidth, LeafSize);

/// Identifies the parts of a scene that a strategy uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Kind {
    pub layout: LayoutKind,
    pub tree: Option<TreeKind>,
}

impl Kind {
    /// Returns the parts that a strategy uses.
    pub fn of(strategy: &Strategy) -> Self {
        let tree = (strategy.traversal, strategy.node_width, strategy.leaf_size);
        Self { layout: (strategy.layout, strategy.reads_mesh()), tree: strategy.needs_tree().then_some(tree) }
    }
}

/// The layouts and trees of a scene that are on the device.
#[derive(Default)]
pub(super) struct SharedScene {
    layouts: HashMap<LayoutKind, Arc<DeviceScene>>,
    trees: HashMap<TreeKind, Arc<DeviceTree>>,
}

impl SharedScene {
    /// Returns the tree of a strategy if it is on the device.
    pub fn tree(&self, strategy: &Strategy) -> Option<Arc<DeviceTree>> {
        self.trees.get(&Kind::of(strategy).tree?).cloned()
    }

    /// Uploads the tree of a strategy, if the strategy uses a tree. Builds the tree first, unless it was built early.
    pub fn build_tree(
        &mut self,
        queue: &Queue,
        scene: &Scene,
        strategy: &Strategy,
        early: Option<HostTree>,
    ) -> Result<(), LaunchError> {
        let built = match early {
            Some(tree) => Some(tree),
            None => HostTree::build(&scene.mesh, strategy)?,
        };
        if let (Some(kind), Some(tree)) = (Kind::of(strategy).tree, built) {
            let tree = DeviceTree::upload(queue, &scene.mesh, strategy, tree)?;
            self.trees.insert(kind, Arc::new(tree));
        }
        Ok(())
    }

    /// Returns the scene in the layout of a strategy.
    pub fn layout(
        &mut self,
        queue: &Queue,
        scene: &Scene,
        strategy: &Strategy,
    ) -> Result<Arc<DeviceScene>, LaunchError> {
        let kind = Kind::of(strategy).layout;
        if let Some(uploaded) = self.layouts.get(&kind) {
            return Ok(Arc::clone(uploaded));
        }
        let uploaded = Arc::new(DeviceScene::upload(queue, scene, strategy)?);
        self.layouts.insert(kind, Arc::clone(&uploaded));
        Ok(uploaded)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::strategy::preset;

    #[test]
    fn only_strategies_that_read_the_same_parts_of_a_scene_share_its_upload() {
        let upload = |name| Kind::of(&preset(name).unwrap().strategy).layout;
        assert_eq!(upload("bvh"), upload("deferred"));
        assert_eq!(upload("tile"), upload("tile-group"));
        // For tiles, the upload leaves the triangles out.
        assert_ne!(upload("tile"), upload("deferred"));
        assert_ne!(upload("split-vertices"), upload("deferred"));
    }
}
