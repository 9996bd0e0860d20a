//! The code that is common to all tests on a device: the choice of the device, and pictures that are compared
//! with the reference.

pub mod apart;
pub mod cover;
pub mod edges;
pub mod mock;

use raycl::device::{Builtins, Device, discover, select};
use raycl::image::Radiance;
use raycl::launch::{LaunchError, Prepared, Refused, Session};
use raycl::program::Sources;
use raycl::reference::{Reference, reference};
use raycl::scene::{Sampling, Scene, load_scene};
use raycl::strategy::{Culling, PRESETS, Preset, Shading, Strategy};
use raycl::verify::{Verdict, verify};
use std::cell::RefCell;
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// Returns the device on which tests run: PoCL, or the device that RAYCL_TEST_DEVICE names. Panics if this
/// device is missing.
pub fn device() -> Device {
    let pattern =
        std::env::var("RAYCL_TEST_DEVICE").unwrap_or_else(|_| "portable computing language".to_owned());
    let devices = discover(&Sources::Embedded).expect("an OpenCL platform; `make setup` installs PoCL");
    let chosen = select(&devices, &[pattern], &Sources::Embedded).expect("the test device");
    chosen.into_iter().next().expect("a usable test device")
}

/// The local size of most tests that work with any local size. They use the same size, so that PoCL compiles their
/// kernels for only one size.
pub const COMMON_LOCAL_SIZE: [u32; 2] = [8, 8];

/// Returns true if the tests run as `make test-long`, which runs all tests completely. `make test` leaves out
/// a part of the tests whose kernels take minutes to compile.
pub fn is_long() -> bool {
    std::env::var_os("RAYCL_TEST_LONG").is_some()
}

/// Returns the strategies, or the changes to kernel files, that this run of the tests tries. Each needs a program of
/// its own, which takes PoCL seconds to compile and is in no cache of a new machine. `make test` therefore tries the
/// first of every eight; `make test-long` tries all, and `make mutants` tries all changes. Every family except the
/// rasteriser casts all features together even in `make test` (tests/all_features.rs).
pub fn due<T>(all: impl IntoIterator<Item = T>) -> impl Iterator<Item = T> {
    all.into_iter().step_by(if is_long() { 1 } else { 8 })
}

/// Returns the names of the strategies that `make test` tries on PoCL: all of the list except those that take
/// long to compile (see [`compiles_soon`]). `make test-long` tries the whole list.
pub fn soon<'a>(names: impl IntoIterator<Item = &'a str>) -> impl Iterator<Item = &'a str> {
    names.into_iter().filter(|name| is_long() || !name.starts_with("tile-group"))
}

/// Returns true if `make test` tests a strategy on PoCL, and false if only `make test-long` does. PoCL takes half a
/// minute to compile a strategy in which work-items share tiles. `make test` compiles such strategies only in a few
/// tests of their own and in tests/all_features.rs. If such a strategy is in the pairwise cover (see [`cover`]),
/// `make test` also runs it under the simulator Oclgrind, which need not compile kernels to machine code.
pub fn compiles_soon(strategy: &Strategy) -> bool {
    !strategy.shares_tiles() || is_long()
}

/// Returns the usual preset of each kernel family: the first that shades only the nearest hit of each ray. A test in
/// src/strategy/rules.rs checks that every family has presets.
pub fn one_preset_of_each_family() -> Vec<&'static Preset> {
    let family = |preset: &Preset| preset.strategy.family().name;
    let mut usual: Vec<&Preset> = Vec::new();
    for preset in PRESETS.iter().filter(|preset| preset.strategy.shading == Shading::DEFERRED) {
        if usual.iter().all(|known| family(known) != family(preset)) {
            usual.push(preset);
        }
    }
    usual
}

/// Returns a scene of the repository.
pub fn scene(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    load_scene(&path).expect("a scene of the repository").scene
}

/// A device with one scene, and the reference's pictures of this scene at one size.
pub struct Stand {
    device: Device,
    /// The scene on the open device, for which strategies are prepared.
    pub session: RefCell<Session>,
    scene: Arc<Scene>,
    size: [u32; 2],
    references: HashMap<&'static str, Reference>,
}

impl Stand {
    pub fn new(scene: Scene, size: [u32; 2]) -> Self {
        Self::of(&Sources::Embedded, scene, size, |builtins| builtins)
    }

    /// Returns a `Stand` (a device with one scene) whose kernels come from `sources`. `change` may change the
    /// set of built-in functions that the device's compiler is said to have.
    pub fn of(
        sources: &Sources,
        scene: Scene,
        size: [u32; 2],
        change: impl Fn(Builtins) -> Builtins,
    ) -> Self {
        let (device, scene) = (device(), Arc::new(scene));
        let session = Session::open(&device, sources, Arc::clone(&scene)).expect("an open device");
        let builtins = change(session.builtins());
        let session = RefCell::new(session.with_builtins(builtins));
        Self { device, session, scene, size, references: HashMap::new() }
    }

    /// Sets how many samples pixels get.
    pub fn with_sampling(self, sampling: Sampling) -> Self {
        let session = RefCell::new(self.session.into_inner().with_sampling(sampling));
        Self { session, ..self }
    }

    pub fn is_cpu(&self) -> bool {
        self.device.info.limits.is_cpu
    }

    /// Builds a strategy's program for the scene. If the device cannot hold the strategy, returns the reason.
    pub fn build(&self, strategy: &Strategy, local_size: [u32; 2]) -> Result<Prepared, String> {
        let local_size = strategy.local_size(&self.device.info.limits, local_size);
        let prepared = self.session.borrow_mut().prepare(strategy, self.size, local_size);
        fits(strategy, prepared)
    }

    /// Builds a strategy's program for rays that the caller provides. Returns errors like `build`.
    pub fn build_for_rays(&self, strategy: &Strategy, local_size: [u32; 2]) -> Result<Prepared, String> {
        let local_size = strategy.local_size(&self.device.info.limits, local_size);
        let prepared = self.session.borrow_mut().prepare_for_rays(strategy, self.size, local_size);
        fits(strategy, prepared)
    }

    /// Returns the image of a strategy.
    pub fn cast(&self, strategy: &Strategy, local_size: [u32; 2]) -> Result<Radiance, String> {
        Ok(self.cast_and_count(strategy, local_size)?.0)
    }

    /// Returns the image of a strategy, and the number of pixels whose rays hit something.
    pub fn cast_and_count(
        &self,
        strategy: &Strategy,
        local_size: [u32; 2],
    ) -> Result<(Radiance, usize), String> {
        let caster = fits(strategy, self.build(strategy, local_size)?.caster())?;
        caster.cast().unwrap_or_else(|error| panic!("{strategy}: {error}"));
        Ok(caster.read().expect("an image"))
    }

    /// Compares a strategy's image with the reference; returns an error if the device cannot hold the strategy.
    pub fn check(&mut self, strategy: &Strategy, local_size: [u32; 2]) -> Result<Verdict, String> {
        let (image, hits) = self.cast_and_count(strategy, local_size)?;
        let name = if strategy.culling == Culling::Back { "back" } else { "none" };
        let (scene, size) = (&self.scene, self.size);
        let expected =
            self.references.entry(name).or_insert_with(|| reference(scene, size, strategy.culling));
        Ok(verify(&image, Some(hits), expected, scene.display))
    }
}

/// Returns the result of a step, or the reason why the device cannot hold the strategy. Panics if the
/// strategy is refused for a reason other than the device's limits.
fn fits<T>(strategy: &Strategy, step: Result<T, Refused>) -> Result<T, String> {
    step.map_err(|refused| match refused {
        Refused::Device(_) | Refused::Launch { error: LaunchError::WorkGroup { .. }, .. } => refused.reason(),
        other => panic!("{strategy}: {}", other.reason()),
    })
}
