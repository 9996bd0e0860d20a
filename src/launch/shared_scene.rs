//! What the strategies of a session share of its scene: layouts and trees on the device, each made when first asked for.

use super::{DeviceScene, DeviceTree, HostTree, LaunchError, Queue};
use crate::scene::Scene;
use crate::strategy::{Layout, LeafSize, NodeWidth, Strategy, Traversal};
use std::collections::HashMap;
use std::sync::Arc;

/// What tells one upload of a scene from another: a layout, and whether the triangles are in it.
type LayoutKind = (Layout, bool);
/// What tells one tree of a scene from another.
type TreeKind = (Traversal, NodeWidth, LeafSize);

/// What tells what one strategy shares with others from what another does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Kind {
    layout: LayoutKind,
    tree: Option<TreeKind>,
}

impl Kind {
    /// That of a strategy.
    pub fn of(strategy: &Strategy) -> Self {
        let tree = (strategy.traversal, strategy.node_width, strategy.leaf_size);
        Self { layout: (strategy.layout, strategy.reads_mesh()), tree: strategy.needs_tree().then_some(tree) }
    }
}

/// A scene's layouts and trees that are there.
#[derive(Default)]
pub(super) struct SharedScene {
    layouts: HashMap<LayoutKind, Arc<DeviceScene>>,
    trees: HashMap<TreeKind, Arc<DeviceTree>>,
}

impl SharedScene {
    /// The tree that a strategy walks, if it is there.
    pub fn tree(&self, strategy: &Strategy) -> Option<Arc<DeviceTree>> {
        self.trees.get(&Kind::of(strategy).tree?).cloned()
    }

    /// Uploads the tree that a strategy walks, where it walks one: the one that was built early, or one that is built now.
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

    /// The scene as a strategy reads it.
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
