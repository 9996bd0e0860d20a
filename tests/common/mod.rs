//! What tests on a device share: PoCL, programs, and the check that every point of an experiment passes.

pub mod apart;
pub mod cover;
pub mod edges;

use raycl::device::{Builtins, Device, discover, select};
use raycl::image::Radiance;
use raycl::launch::{Caster, DeviceScene, DeviceTree, LaunchError, Queue};
use raycl::program::{BuiltProgram, ProgramSpec, Sources};
use raycl::reference::{Reference, reference};
use raycl::scene::{Scene, load_scene};
use raycl::strategy::{Culling, Requirements, Strategy, Workload};
use raycl::verify::{Verdict, verify};
use std::collections::HashMap;
use std::path::Path;

/// The device tests run on: PoCL, or what RAYCL_TEST_DEVICE names. A missing device fails the tests.
pub fn device() -> Device {
    let pattern =
        std::env::var("RAYCL_TEST_DEVICE").unwrap_or_else(|_| "portable computing language".to_owned());
    let devices = discover(&Sources::Embedded).expect("an OpenCL platform; `make setup` installs PoCL");
    let chosen = select(&devices, &[pattern]).expect("the test device");
    (*chosen.first().expect("a usable test device")).clone()
}

/// A local size that tests share where any would do, so that PoCL compiles for it once.
pub const COMMON_LOCAL_SIZE: [u32; 2] = [8, 8];

/// Whether this is `make test-long`, which leaves out nothing. `make test` takes samples where compiling takes minutes.
pub fn is_long() -> bool {
    std::env::var_os("RAYCL_TEST_LONG").is_some()
}

/// Whether a strategy is in every run: PoCL takes half a minute to compile tiles that work-items share. `make test` has
/// them in tests of their own, and all their combinations under Oclgrind, which compiles nothing.
pub fn compiles_soon(strategy: &Strategy) -> bool {
    !strategy.shares_tiles() || is_long()
}

/// A scene of the repository.
pub fn scene(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    load_scene(&path).expect("a scene of the repository").scene
}

/// A strategy's program with the scene in its layout, and the tree it walks.
pub struct Built {
    pub workload: Workload,
    pub program: BuiltProgram,
    pub scene: DeviceScene,
    pub tree: Option<DeviceTree>,
}

/// A device with the references of one scene at one size.
pub struct Stand {
    device: Device,
    pub queue: Queue,
    /// What kernels may use of what the compiler has.
    pub builtins: Builtins,
    scene: Scene,
    size: [u32; 2],
    references: HashMap<&'static str, Reference>,
}

impl Stand {
    pub fn new(scene: Scene, size: [u32; 2]) -> Self {
        let device = device();
        let queue = Queue::open(device.platform, device.device).expect("an open device");
        let builtins = device.info.builtins();
        Self { device, queue, builtins, scene, size, references: HashMap::new() }
    }

    /// Whether the device is a CPU.
    pub fn is_cpu(&self) -> bool {
        self.device.info.limits.is_cpu
    }

    /// The local size of a strategy here: `wished` where it has the choice.
    pub fn local_size(&self, strategy: &Strategy, wished: [u32; 2]) -> [u32; 2] {
        strategy.local_size(&self.device.info.limits, wished)
    }

    /// Builds a strategy's program for the scene; none where the device cannot hold it, with why.
    pub fn build(&self, strategy: &Strategy, local_size: [u32; 2]) -> Result<Built, String> {
        let local_size = self.local_size(strategy, local_size);
        let mut workload = Workload::of(&self.scene, self.size, local_size);
        Requirements::check(strategy, &workload, &self.device.info.limits)
            .map_err(|refused| refused.reason)?;
        let tree = DeviceTree::build(&self.queue, &self.scene.mesh, strategy).expect("a tree");
        workload.stack_size = tree.as_ref().map_or(0, |tree| tree.stack_size);
        let spec = ProgramSpec::new(&Sources::Embedded, strategy, &workload, self.builtins);
        let spec = spec.expect("a program");
        let program = BuiltProgram::build(&self.queue.context, self.queue.device, &spec);
        let program = program.unwrap_or_else(|error| panic!("{strategy}: {error}"));
        let uploaded = DeviceScene::upload(&self.queue, &self.scene, strategy).expect("an upload");
        Ok(Built { workload, program, scene: uploaded, tree })
    }

    /// The image of a strategy.
    pub fn cast(&self, strategy: &Strategy, local_size: [u32; 2]) -> Result<Radiance, String> {
        Ok(self.cast_and_count(strategy, local_size)?.0)
    }

    /// The same, and how many pixels hit something.
    pub fn cast_and_count(
        &self,
        strategy: &Strategy,
        local_size: [u32; 2],
    ) -> Result<(Radiance, usize), String> {
        let built = self.build(strategy, local_size)?;
        self.cast_built(strategy, &built)
    }

    /// The same of a program that is there.
    pub fn cast_built(&self, strategy: &Strategy, built: &Built) -> Result<(Radiance, usize), String> {
        let caster = self.caster(strategy, built)?;
        caster.cast().unwrap_or_else(|error| panic!("{strategy}: {error}"));
        Ok(caster.read().expect("an image"))
    }

    /// What casts a program that is there: it has all kernels of a frame.
    pub fn caster(&self, strategy: &Strategy, built: &Built) -> Result<Caster, String> {
        let Built { workload, program, scene, tree } = built;
        match Caster::new(&self.queue, program, strategy, workload, &self.scene, scene, tree.as_ref()) {
            Err(error @ LaunchError::WorkGroup { .. }) => Err(error.to_string()),
            other => {
                Ok(other.unwrap_or_else(|error| panic!("{strategy} at {:?}: {error}", workload.local_size)))
            }
        }
    }

    /// How a strategy's image compares with the reference; an error where the device cannot hold it.
    pub fn check(&mut self, strategy: &Strategy, local_size: [u32; 2]) -> Result<Verdict, String> {
        let image = self.cast(strategy, local_size)?;
        let name = if strategy.culling == Culling::Back { "back" } else { "none" };
        let (scene, size) = (&self.scene, self.size);
        let expected =
            self.references.entry(name).or_insert_with(|| reference(scene, size, strategy.culling));
        Ok(verify(&image, expected, scene.display))
    }
}
