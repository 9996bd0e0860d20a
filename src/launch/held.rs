//! Counts the bytes that the strategies of a session hold on their device: shared parts of the scene, and the
//! buffers of each frame.

use super::shared_scene::{Kind, LayoutKind, TreeKind};
use crate::strategy::{Requirements, Strategy, Workload};
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// The bytes that one session holds on its device.
#[derive(Default)]
pub(super) struct Held {
    layout_bytes: HashMap<LayoutKind, u64>,
    tree_bytes: HashMap<TreeKind, u64>,
    frames: Frames,
}

impl Held {
    /// Returns the bytes of all frames, plus those of the scene's parts that are on the device but that `strategy`
    /// does not use.
    pub fn beside(&self, strategy: &Strategy) -> u64 {
        let own = Kind::of(strategy);
        let layouts =
            self.layout_bytes.iter().filter(|(kind, _)| **kind != own.layout).map(|(_, bytes)| bytes);
        let trees =
            self.tree_bytes.iter().filter(|(kind, _)| Some(**kind) != own.tree).map(|(_, bytes)| bytes);
        self.frames.bytes.load(Ordering::Relaxed) + layouts.chain(trees).sum::<u64>()
    }

    /// Counts the bytes of a strategy's tree, which is now on the device.
    pub fn share_tree(&mut self, strategy: &Strategy, workload: &Workload) {
        if let Some(kind) = Kind::of(strategy).tree {
            self.tree_bytes.insert(kind, Requirements::tree_bytes(strategy, workload));
        }
    }

    /// Counts the bytes of a strategy's layout of the scene, without the tree. The layout is now on the device.
    pub fn share_layout(&mut self, strategy: &Strategy, workload: &Workload) {
        let all_bytes = Requirements::scene_bytes(strategy, workload);
        let own_bytes = all_bytes - Requirements::tree_bytes(strategy, workload);
        self.layout_bytes.insert(Kind::of(strategy).layout, own_bytes);
    }

    /// Returns the counter for frames that are made later.
    pub fn frames(&self) -> Frames {
        self.frames.clone()
    }
}

/// Counts the bytes of all existing frames.
#[derive(Clone, Default)]
pub(super) struct Frames {
    bytes: Arc<AtomicU64>,
}

impl Frames {
    /// Counts the bytes of one more frame, until the returned value is dropped.
    pub fn count(&self, strategy: &Strategy, workload: &Workload) -> FrameBytes {
        let own_bytes =
            Requirements::buffer_bytes(strategy, workload) - Requirements::scene_bytes(strategy, workload);
        self.bytes.fetch_add(own_bytes, Ordering::Relaxed);
        FrameBytes { all: self.clone(), own_bytes }
    }
}

/// The bytes of one frame. Dropping this value subtracts them from the count.
pub(super) struct FrameBytes {
    all: Frames,
    own_bytes: u64,
}

impl Drop for FrameBytes {
    fn drop(&mut self) {
        self.all.bytes.fetch_sub(self.own_bytes, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategy::preset;

    const WORKLOAD: Workload = Workload { triangles: 100, image_size: [100, 10], ..Workload::CUBE };

    #[test]
    fn a_frame_counts_while_it_lives_and_what_is_shared_counts_for_others() {
        let of = |name| preset(name).unwrap_or_else(|error| panic!("{error}")).strategy;
        let (naive, tiles) = (of("naive-scratch"), of("tile"));
        let mut held = Held::default();
        held.share_layout(&naive, &WORKLOAD);
        assert_eq!(held.beside(&naive), 0);
        let shared = held.beside(&tiles);
        assert!(shared >= 104 * 100, "{shared}");
        let frame = held.frames().count(&naive, &WORKLOAD);
        let own = held.beside(&naive);
        assert!(own >= (16 + 108) * 1000, "{own}");
        assert_eq!(held.beside(&tiles), shared + own);
        drop(frame);
        assert_eq!(held.beside(&naive), 0);
    }

    #[test]
    fn parts_that_two_strategies_share_count_once_for_a_third() {
        let of = |name| preset(name).unwrap_or_else(|error| panic!("{error}")).strategy;
        let (without, with, other) = (of("deferred"), of("bvh"), of("tile"));
        let mut held = Held::default();
        held.share_layout(&without, &WORKLOAD);
        let layout = held.beside(&other);
        held.share_tree(&with, &WORKLOAD);
        let both = held.beside(&other);
        assert_eq!(both - layout, Requirements::tree_bytes(&with, &WORKLOAD));
        held.share_layout(&with, &WORKLOAD);
        assert_eq!((held.beside(&other), held.beside(&with)), (both, 0));
        assert_eq!(held.beside(&without), both - layout);
    }
}
