//! Chooses the strategy of a picture, and whether its tree is built for one frame or for many. A single picture of a
//! large mesh on a CPU gets a strategy that needs little memory and preparation, since preparing the mesh takes
//! longer than casting one frame.

use super::Args;
use crate::accel::TreeUse;
use crate::device::DeviceInfo;
use crate::error::Result;
use crate::scene::Scene;
use crate::strategy::{Candidate, Class, Layout, Strategy, Task};

/// If a mesh has at least `LARGE_TRIANGLES` triangles, a CPU casts a single picture of the mesh tile by tile (the rays
/// of a tile of pixels walk the tree together), and reads the normals from the mesh's own list. The user can choose
/// otherwise. (For smaller meshes, raycl may choose tiles, too.)
///
/// Strategies that cannot read the mesh's list need a copy of the normals in leaf order, which takes 36 bytes
/// per triangle. Without this copy of the normals, a frame takes about 5% longer, but raycl starts to cast
/// earlier. The effect of leaving out the copy was measured on 2 cores of an Intel Xeon (docs/log.md, 2026-11-27). With
/// 4 million triangles, making the buffers takes 29 ms less, and casting the frame takes 5 ms more. With 10 million
/// triangles, making the buffers takes 0.8 s less, and casting the frame takes 14 ms more.
///
/// If there are many triangles per pixel, a frame may be faster with packets of rays than with tiles. But for 10
/// million triangles, a process needs 2.3 GB with packets, and 1.3 GB with tiles. On 2 cores of an AMD EPYC
/// (docs/log.md, 2026-11-28), packets need about 3 s more than tiles for the tree and the buffers, and at most 1.3 s
/// less for casting a frame.
const LARGE_TRIANGLES: usize = 4_000_000;

/// Returns the strategy of a picture, and its local size: the requested ones or, without a request, those that raycl
/// expects to be fastest on the device. For a single picture of a large mesh on a CPU, raycl chooses tiles if the user
/// has chosen no strategy, no axis and no local size. For such a picture, raycl also chooses indexed normals if the
/// strategy casts pictures tile by tile ([`is_tiled`]) and the user has chosen neither a strategy nor a layout.
pub fn strategy(args: &Args, device: &DeviceInfo, task: Task) -> Result<(Strategy, [u32; 2])> {
    let in_vectors = Class::of(&device.limits).is_in_vectors();
    if !in_vectors || task.triangles < LARGE_TRIANGLES || !may_be_indexed(args) {
        return args.subject.strategy(device, task);
    }
    let (mut strategy, local_size) = if args.subject.leaves_strategy_open() {
        Candidate::TILES.strategy(&device.limits, task.watertight)?
    } else {
        args.subject.strategy(device, task)?
    };
    if is_tiled(&strategy) {
        strategy.layout = Layout::INDEXED_32;
    }
    Ok((strategy, local_size))
}

/// Returns true if raycl may choose the layout with indexed normals: the user has chosen neither a strategy
/// nor a layout, and raycl casts a single frame.
fn may_be_indexed(args: &Args) -> bool {
    let subject = &args.subject;
    let are_open = subject.strategy.is_none() && subject.set.iter().all(|(key, _)| key != "layout");
    are_open && casts_one_frame(args)
}

/// Returns true if raycl casts a single frame.
fn casts_one_frame(args: &Args) -> bool {
    args.repeat == 1 && !args.motion.moves()
}

/// A tree is built for a single frame only if the frame has at most `MOST_RAYS_PER_TRIANGLE` rays from the eye per
/// triangle. On 2 cores of an AMD EPYC (docs/log.md, 2026-11-28), a tree for a single frame is built faster than a tree
/// for many frames, by about 40 ns per triangle. But in a tree for a single frame, each ray takes about 3 ns longer.
const MOST_RAYS_PER_TRIANGLE: usize = 8;

/// Returns whether the tree of a picture with `samples` samples per pixel is built for a single frame or for
/// many frames. For a moving picture, the tree is built for many frames, since the mesh, and so the tree,
/// seldom changes from frame to frame.
pub fn tree_use(args: &Args, scene: &Scene, samples: u32) -> TreeUse {
    let [width, height] = args.subject.size().map(|side| side as usize);
    let is_small = width * height * samples as usize <= MOST_RAYS_PER_TRIANGLE * scene.mesh.triangles.len();
    if casts_one_frame(args) && is_small { TreeUse::OneFrame } else { TreeUse::ManyFrames }
}

/// Returns true if the strategy casts pictures tile by tile, with the rays of a tile in vectors. Only the kernels of
/// such strategies can read the mesh's own list of normals.
fn is_tiled(strategy: &Strategy) -> bool {
    strategy.traversal.casts_tiles() && !strategy.shares_tiles()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::device::{DeviceKind, DeviceLimits, EXAMPLE_LIMITS, tests::example};
    use crate::reference::fixtures;
    use crate::strategy::Traversal;
    use clap::Parser;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    fn layout(more: &[&str], triangles: usize, kind: DeviceKind) -> Layout {
        chosen(more, triangles, kind, [1920, 1080]).layout
    }

    fn chosen(more: &[&str], triangles: usize, kind: DeviceKind, size: [usize; 2]) -> Strategy {
        let args = Command::parse_from([&["render", "mesh.obj"], more].concat()).args;
        let is_cpu = kind == DeviceKind::Cpu;
        let limits = DeviceLimits { is_cpu, native_width: 16, ..EXAMPLE_LIMITS };
        let device = DeviceInfo { limits, ..example("PoCL", "a device", kind, 2) };
        let pixels = size[0] * size[1];
        let task = Task { triangles, pixels, covered_pixels: pixels, ..Task::default() };
        strategy(&args, &device, task).unwrap().0
    }

    #[test]
    fn a_cpu_casts_a_single_picture_of_a_large_mesh_with_the_meshs_own_normals() {
        let of = |more: &[&str], triangles| layout(more, triangles, DeviceKind::Cpu);
        assert_eq!(
            [3_999_999, 4_000_000].map(|triangles| of(&[], triangles)),
            [Layout::SOUP, Layout::INDEXED_32]
        );
        assert_eq!(layout(&[], LARGE_TRIANGLES, DeviceKind::Gpu), Layout::SOUP);
    }

    #[test]
    fn a_cpu_casts_a_single_small_picture_of_a_large_mesh_by_tiles() {
        let of = |more: &[&str], triangles| chosen(more, triangles, DeviceKind::Cpu, [64, 64]);
        let large = of(&[], LARGE_TRIANGLES);
        assert!(is_tiled(&large) && large.layout == Layout::INDEXED_32, "{large:?}");
        let packets = [
            of(&[], LARGE_TRIANGLES - 1),
            of(&["--repeat", "2"], LARGE_TRIANGLES),
            of(&["--turntable", "2"], LARGE_TRIANGLES),
            of(&["--set", "node_width=8"], LARGE_TRIANGLES),
        ];
        assert!(packets.iter().all(|strategy| strategy.traversal == Traversal::Bvh), "{packets:?}");
    }

    #[test]
    fn a_tree_is_built_for_one_frame_if_one_with_few_rays_is_cast() {
        let mut scene = fixtures::single_triangle();
        let mesh = std::sync::Arc::make_mut(&mut scene.mesh);
        mesh.triangles.resize(1000, mesh.triangles[0]);
        let of = |more: &[&str], samples| {
            let size = ["render", "a.obj", "--width", "20", "--height", "100"];
            tree_use(&Command::parse_from([&size[..], more].concat()).args, &scene, samples)
        };
        assert_eq!([4, 5].map(|samples| of(&[], samples)), [TreeUse::OneFrame, TreeUse::ManyFrames]);
        let moving = [&["--repeat", "2"][..], &["--turntable", "2"]];
        assert_eq!(moving.map(|more| of(more, 1)), [TreeUse::ManyFrames; 2]);
    }

    #[test]
    fn a_requested_strategy_or_layout_is_kept_and_many_frames_have_normals_in_leaf_order() {
        for more in [
            &["--strategy", "tile"][..],
            &["--strategy", "bvh-packet"],
            &["--set", "layout=soup"],
            &["--repeat", "2"],
            &["--turntable", "2"],
        ] {
            assert_eq!(layout(more, LARGE_TRIANGLES, DeviceKind::Cpu), Layout::SOUP, "{more:?}");
        }
    }
}
