//! Chooses the strategy for a picture on a GPU, if the fastest strategy's program is not compiled yet.
//!
//! Compiling the fastest strategy's program takes seconds. The program of the preset [`QUICK`] compiles in a
//! fraction of this time, and both programs cast a picture in milliseconds. Therefore raycl casts the picture with
//! [`QUICK`]. Then raycl starts a background process, which compiles the fastest strategy's program for later commands.

use super::Args;
use crate::device::DeviceInfo;
use crate::launch::Session;
use crate::program::ProgramSpec;
use crate::scene::{Sampling, Scene};
use crate::strategy::{Strategy, Workload, preset};

/// The preset whose program compiles in the shortest time, among the presets that cast every scene fast.
pub const QUICK: &str = "bvh";
/// Work-items per work-group with [`QUICK`], across and down.
const QUICK_LOCAL: [u32; 2] = [8, 8];
/// The largest number of primary rays of a picture that is cast with [`QUICK`]. With more rays, casting with
/// [`QUICK`] may take longer than compiling the fastest strategy's program.
const MOST_RAYS: u64 = 200_000_000;
/// The largest number of triangles of a scene that is cast with [`QUICK`]. With more triangles, it takes too
/// long to build a tree for [`QUICK`] besides the fastest strategy's tree.
const MOST_TRIANGLES: usize = 1_000_000;

/// A program that a background process compiles for later commands, with the program's strategy and workload.
pub struct Later {
    pub strategy: Strategy,
    pub workload: Workload,
    pub spec: ProgramSpec,
}

/// Returns [`QUICK`]'s strategy and local size on a device.
pub fn quick(device: &DeviceInfo) -> Option<(Strategy, [u32; 2])> {
    let strategy = preset(QUICK).ok()?.strategy;
    Some((strategy, strategy.local_size(&device.limits, QUICK_LOCAL)))
}

/// Returns true if a picture may be cast with [`QUICK`] instead of the fastest strategy. Three conditions must hold:
/// the user has chosen no strategy, no axis and no local size; the command casts a single frame once; and the picture
/// is small enough. Returns false with `--cl-dir` or `--watch`: the user is then probably editing kernels (perhaps
/// the kernels of the fastest strategy) or the scene. Returns false for a CPU, because the program of `tile`, the usual
/// strategy on CPUs, compiles in a short time.
pub fn may(args: &Args, device: &DeviceInfo, sampling: Sampling) -> bool {
    !device.limits.is_cpu && may_on_a_gpu(args, sampling)
}

/// Returns what [`may`] returns for a device that is not a CPU.
pub fn may_on_a_gpu(args: &Args, sampling: Sampling) -> bool {
    let pixels: u64 = args.subject.size().map(u64::from).iter().product();
    args.subject.leaves_strategy_open()
        && args.subject.cl_dir.is_none()
        && !args.watch
        && !args.motion.moves()
        && args.repeat == 1
        && pixels * u64::from(sampling.most) <= MOST_RAYS
}

/// Returns true if [`may`] returns true and the scene has at most `MOST_TRIANGLES` triangles.
pub fn may_cast(args: &Args, device: &DeviceInfo, scene: &Scene, sampling: Sampling) -> bool {
    scene.mesh.triangles.len() <= MOST_TRIANGLES && may(args, device, sampling)
}

/// Returns the strategy and the local size with which to cast a picture. As the second value, returns the program to
/// compile for later pictures, if there is one. Three conditions decide: [`may_cast`] returns true, [`QUICK`] is not
/// itself the fastest strategy, and the fastest strategy's program must still be compiled ([`not_built`]). If all three
/// hold, returns [`QUICK`]'s strategy and local size, and the fastest strategy's program as the second value.
/// Otherwise, returns `fastest` and `None`.
pub fn choose(
    args: &Args,
    device: &DeviceInfo,
    scene: &Scene,
    session: &mut Session,
    fastest: (Strategy, [u32; 2]),
) -> ((Strategy, [u32; 2]), Option<Later>) {
    let quick = quick(device).filter(|_| may_cast(args, device, scene, session.sampling()));
    let Some(quick) = quick.filter(|(quick, _)| *quick != fastest.0) else { return (fastest, None) };
    match not_built(session, fastest, args.subject.size()) {
        Some(later) => (quick, Some(later)),
        None => (fastest, None),
    }
}

/// Returns the program of a strategy if this program must still be compiled, and otherwise `None`. Also returns
/// `None` if the strategy cannot be prepared: raycl reports the reason later, when it prepares the strategy for the
/// picture.
fn not_built(
    session: &mut Session,
    (strategy, local_size): (Strategy, [u32; 2]),
    image_size: [u32; 2],
) -> Option<Later> {
    let workload = session.workload(&strategy, image_size, local_size).ok()?;
    let spec = session.spec(&strategy, &workload).ok()?;
    (!session.has_built(&spec)).then_some(Later { strategy, workload, spec })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::cache::Cache;
    use crate::device::{Device, DeviceLimits, discover};
    use crate::program::{ProgramCache, Sources};
    use crate::scene::load_scene;
    use clap::Parser;
    use std::path::Path;
    use std::sync::Arc;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    fn args(more: &[&str]) -> Args {
        Command::parse_from([&["render", "a.obj"], more].concat()).args
    }

    /// Returns this machine's first device, changed so that it counts as a GPU.
    fn gpu() -> Device {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let limits = DeviceLimits { is_cpu: false, ..device.info.limits };
        Device { info: DeviceInfo { limits, ..device.info.clone() }, ..device }
    }

    #[test]
    fn only_a_single_small_picture_on_a_gpu_is_hurried_and_no_choice_of_the_user_is_changed() {
        let gpu = gpu().info;
        let may = |more: &[&str]| may(&args(more), &gpu, Sampling::all(4));
        assert!(may(&[]) && may(&["--set", "camera.position=[0, 1, 1]"]) && may(&["--verify"]));
        for more in [
            &["--strategy", "tile"][..],
            &["--set", "width=4"],
            &["--local-size", "8x8"],
            &["--repeat", "2"],
            &["--watch"],
            &["--turntable", "9"],
            &["--cl-dir", "cl"],
            &["--width", "16384", "--height", "16384"],
        ] {
            assert!(!may(more), "{more:?}");
        }
        let cpu = DeviceInfo { limits: DeviceLimits { is_cpu: true, ..gpu.limits }, ..gpu.clone() };
        assert!(!super::may(&args(&[]), &cpu, Sampling::ONE));
        // The limits `MOST_RAYS` and `MOST_TRIANGLES` are 200 million primary rays and one million triangles.
        let large = args(&["--width", "8192", "--height", "8192"]);
        assert!(super::may(&large, &gpu, Sampling::all(2)) && !super::may(&large, &gpu, Sampling::all(4)));
        let of = |count: usize| {
            let scene = crate::reference::fixtures::single_triangle();
            let triangles = vec![scene.mesh.triangles[0]; count];
            let mesh = Arc::new(crate::scene::Mesh { triangles, ..Default::default() });
            may_cast(&args(&[]), &gpu, &Scene { mesh, ..scene }, Sampling::ONE)
        };
        assert!(of(1_000_000) && !of(1_000_001));
    }

    /// In this test, `deferred` stands for the fastest strategy.
    #[test]
    fn a_picture_is_hurried_until_the_fastest_strategys_program_is_in_the_cache() {
        let (device, folder) = (gpu(), tempfile::tempdir().unwrap());
        let programs = ProgramCache::of(Cache::at(&folder.path().join("raycl"), 1 << 28), &device.info);
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/triangle.toml");
        let scene = Arc::new(load_scene(&path).unwrap().scene);
        let fastest = (preset("deferred").unwrap().strategy, [8, 8]);
        let session = || {
            let session = Session::open(&device, &Sources::Embedded, Arc::clone(&scene)).unwrap();
            session.with_cache(programs.clone())
        };
        let choose = |session: &mut Session| choose(&args(&[]), &device.info, &scene, session, fastest);
        let mut first = session();
        let (chosen, later) = choose(&mut first);
        assert_eq!(chosen, quick(&device.info).unwrap());
        let later = later.unwrap();
        assert_eq!(later.strategy, fastest.0);
        let prepared = first.build(&later.strategy, &later.workload, later.spec.clone());
        assert!(prepared.map_err(|refused| refused.reason()).unwrap().program.store());
        let (chosen, later) = choose(&mut session());
        assert!(chosen == fastest && later.is_none());
        // If the strategy of the preset `QUICK` is itself the fastest strategy, this strategy is chosen, and
        // no other program is compiled later.
        let quick = (preset(QUICK).unwrap().strategy, [4, 4]);
        let mut session = session();
        let (chosen, later) = super::choose(&args(&[]), &device.info, &scene, &mut session, quick);
        assert!(chosen == quick && later.is_none());
    }
}
