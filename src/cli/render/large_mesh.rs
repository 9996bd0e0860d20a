//! Chooses the strategy of a picture. If the mesh is large, a CPU reads the normals directly from the mesh's own list
//! of normals, not from a copy in leaf order.

use super::Args;
use crate::device::DeviceInfo;
use crate::error::Result;
use crate::strategy::{Layout, Strategy, Task, Traversal};

/// From this number of triangles on, a CPU casts a single picture with the mesh's own normals. Without a copy of the
/// normals in leaf order, raycl needs 36 bytes per triangle less, and starts to cast earlier. A frame then takes about
/// 5% longer. These times were measured on 2 cores of an Intel Xeon (docs/log.md, 2026-11-27). With 4 million
/// triangles, making the buffers takes 29 ms less, and casting the frame takes 5 ms more. With 10 million triangles,
/// making the buffers takes 0.8 s less, and casting the frame takes 14 ms more.
const LARGE_TRIANGLES: usize = 4_000_000;

/// Returns the strategy of a picture, and its local size: the requested ones or, without a request, those
/// that raycl expects to be fastest on the device. For a single picture of a large mesh on a CPU, the layout
/// is changed to indexed normals, unless the user has chosen a strategy or a layout.
pub fn strategy(args: &Args, device: &DeviceInfo, task: Task) -> Result<(Strategy, [u32; 2])> {
    let (mut strategy, local_size) = args.subject.strategy(device, task)?;
    if device.limits.is_cpu
        && task.triangles >= LARGE_TRIANGLES
        && may_be_indexed(args)
        && is_tiled(&strategy)
    {
        strategy.layout = Layout::INDEXED_32;
    }
    Ok((strategy, local_size))
}

/// Returns true if the layout may be changed to indexed normals: the user has chosen neither a strategy nor a
/// layout, and raycl casts a single frame.
fn may_be_indexed(args: &Args) -> bool {
    let subject = &args.subject;
    let is_chosen = subject.strategy.is_none() && subject.set.iter().all(|(key, _)| key != "layout");
    is_chosen && args.repeat == 1 && !args.motion.moves()
}

/// Returns true if the strategy casts tiles whose rays are in vectors. Only the kernels of these tiles can
/// read the mesh's own list of normals.
fn is_tiled(strategy: &Strategy) -> bool {
    strategy.traversal == Traversal::Tile && !strategy.shares_tiles()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::device::{DeviceKind, DeviceLimits, EXAMPLE_LIMITS, tests::example};
    use clap::Parser;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    fn layout(more: &[&str], triangles: usize, kind: DeviceKind) -> Layout {
        let args = Command::parse_from([&["render", "mesh.obj"], more].concat()).args;
        let is_cpu = kind == DeviceKind::Cpu;
        let limits = DeviceLimits { is_cpu, native_width: 16, ..EXAMPLE_LIMITS };
        let device = DeviceInfo { limits, ..example("PoCL", "a device", kind, 2) };
        let pixels = 1920 * 1080;
        let task = Task { triangles, pixels, covered_pixels: pixels, ..Task::default() };
        strategy(&args, &device, task).unwrap().0.layout
    }

    #[test]
    fn a_cpu_casts_a_single_picture_of_a_large_mesh_with_the_meshs_own_normals() {
        let of = |more: &[&str], triangles| layout(more, triangles, DeviceKind::Cpu);
        assert_eq!(
            [LARGE_TRIANGLES - 1, LARGE_TRIANGLES].map(|triangles| of(&[], triangles)),
            [Layout::SOUP, Layout::INDEXED_32]
        );
        assert_eq!(layout(&[], LARGE_TRIANGLES, DeviceKind::Gpu), Layout::SOUP);
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
