//! Counts the bytes that the buffers of frames take on a device.

use crate::strategy::{Requirements, Strategy, Workload};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Counts the bytes of the buffers of all existing frames.
#[derive(Clone, Default)]
pub(super) struct Frames {
    bytes: Arc<AtomicU64>,
}

impl Frames {
    /// Returns how many bytes the buffers of all existing frames take.
    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Adds the bytes of one more frame's buffers to the count, until the returned value is dropped.
    pub fn count(&self, strategy: &Strategy, workload: &Workload) -> FrameBytes {
        let own_bytes =
            Requirements::buffer_bytes(strategy, workload) - Requirements::scene_bytes(strategy, workload);
        self.bytes.fetch_add(own_bytes, Ordering::Relaxed);
        FrameBytes { all: self.clone(), own_bytes }
    }
}

/// The bytes of one frame's buffers. When a `FrameBytes` is dropped, its bytes are subtracted from the count
/// of all frames' bytes.
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
    fn a_frame_counts_while_it_lives() {
        let naive = preset("naive-scratch").unwrap_or_else(|error| panic!("{error}")).strategy;
        let frames = Frames::default();
        let frame = frames.count(&naive, &WORKLOAD);
        let own = frames.bytes();
        assert!(own >= (16 + 108) * 1000, "{own}");
        let another = frames.count(&naive, &WORKLOAD);
        assert_eq!(frames.bytes(), 2 * own);
        drop([frame, another]);
        assert_eq!(frames.bytes(), 0);
    }
}
