//! A session: a scene on an open device. A session prepares strategies for casting the scene.

use super::held::Frames;
use super::prepared::Prepared;
use super::refused::Refused;
use super::shared_scene::SharedScene;
use super::{HostTree, Queue};
use crate::accel::TreeUse;
use crate::cache::Cache;
use crate::device::{Builtins, Device, DeviceInfo, DeviceLimits};
use crate::error::Result;
use crate::program::{BuiltProgram, ProgramCache, ProgramSpec, Sources};
use crate::scene::{Sampling, Scene};
use crate::strategy::{Afterwards, Cause, HostNeeds, Infeasible, Requirements, Strategy, Workload};
use std::sync::Arc;

/// A scene on an open device. The session checks that a strategy is valid for the image size and the local
/// size, and that its buffers fit into the memory of device and host. The session then builds the tree and
/// the program, uploads the scene and the tree, and returns a `Prepared`, which makes casters. All strategies
/// of a session share the scene.
pub struct Session {
    queue: Queue,
    scene: Arc<Scene>,
    sources: Sources,
    limits: DeviceLimits,
    builtins: Builtins,
    compute_capability: Option<String>,
    afterwards: Afterwards,
    sampling: Sampling,
    twins_before: usize,
    programs: ProgramCache,
    early: Option<(ProgramSpec, BuiltProgram)>,
    early_tree: Option<(Strategy, HostTree)>,
    tree_use: TreeUse,
    rounds_stacks: bool,
    shared: SharedScene,
    frames: Frames,
    bytes_beside: u64,
}

/// Kernels traverse a tree with a stack. [`Session::rounding_stacks`] rounds the sizes of stacks in private
/// memory up to multiples of this number of entries. Most trees need stacks of fewer than `ROUNDED_STACK`
/// entries.
pub const ROUNDED_STACK: usize = 128;

impl Session {
    /// Opens a device for a scene.
    pub fn open(device: &Device, sources: &Sources, scene: Arc<Scene>) -> Result<Self> {
        Ok(Self::new(Queue::open(device)?, &device.info, sources, scene))
    }

    /// Makes a session on a device that is already open.
    pub fn new(queue: Queue, info: &DeviceInfo, sources: &Sources, scene: Arc<Scene>) -> Self {
        Self {
            queue,
            scene,
            sources: sources.clone(),
            limits: info.limits,
            builtins: info.builtins(),
            compute_capability: info.hardware.compute_capability.clone(),
            afterwards: Afterwards::default(),
            sampling: Sampling::ONE,
            twins_before: 0,
            programs: ProgramCache::of(Cache::of_user(), info),
            early: None,
            early_tree: None,
            tree_use: TreeUse::ManyFrames,
            rounds_stacks: false,
            shared: SharedScene::default(),
            frames: Frames::default(),
            bytes_beside: 0,
        }
    }

    /// Replaces the device's limits by others, usually by lower limits, such as those of a smaller device.
    #[must_use]
    pub fn limited(self, limits: DeviceLimits) -> Self {
        Self { limits, ..self }
    }

    /// Sets the compiler's built-in functions that kernels may use.
    #[must_use]
    pub fn with_builtins(self, builtins: Builtins) -> Self {
        Self { builtins, ..self }
    }

    /// Replaces the session's cache of compiled programs.
    #[must_use]
    pub fn with_cache(self, programs: ProgramCache) -> Self {
        Self { programs, ..self }
    }

    /// Sets `twins_before`, the number that makes the session's programs differ from those of other devices
    /// with the same name ([`DeviceInfo::program_twin`]). If this number is above 0, the session's programs
    /// get an additional define. PoCL 5.0 is aborted by an assertion (`pocl_release_dlhandle_cache`) if two
    /// of PoCL's devices run the same program in one process.
    #[must_use]
    pub fn among_twins(self, twins_before: usize) -> Self {
        Self { twins_before, ..self }
    }

    /// Adds a program that was built before the session began, for the next strategy that needs this program.
    #[must_use]
    pub fn with_program(self, early: Option<(ProgramSpec, BuiltProgram)>) -> Self {
        Self { early, ..self }
    }

    /// Adds a tree that was built before the session began, with the strategy for which it was built.
    #[must_use]
    pub fn with_tree(self, early_tree: Option<(Strategy, HostTree)>) -> Self {
        Self { early_tree, ..self }
    }

    /// Rounds the sizes of stacks in private memory up to multiples of [`ROUNDED_STACK`] entries. Kernels use
    /// a stack in private or `__local` memory to traverse a tree. With rounded sizes, most scenes need stacks
    /// of the same size, so a program can be built before the scene's tree is known. Stacks in `__local`
    /// memory are not rounded, since larger ones slow a kernel down.
    #[must_use]
    pub fn rounding_stacks(self) -> Self {
        Self { rounds_stacks: true, ..self }
    }

    /// Sets for how many frames trees are built. If this function is not called, trees are built as for many
    /// frames.
    #[must_use]
    pub fn with_tree_use(self, tree_use: TreeUse) -> Self {
        Self { tree_use, ..self }
    }

    /// Sets whether images are verified, which takes additional memory on the host.
    #[must_use]
    pub fn verifying(self, verified: bool) -> Self {
        Self { afterwards: Afterwards { verified, ..self.afterwards }, ..self }
    }

    /// Sets whether layers of images are computed, which takes additional memory on the host.
    #[must_use]
    pub fn with_layers(self, layers: bool) -> Self {
        Self { afterwards: Afterwards { layers, ..self.afterwards }, ..self }
    }

    /// Sets how many samples each pixel gets. With several samples, lights with an extent cast soft shadows.
    /// `sampling` may ask for soft light at half resolution. The session ignores this request if each pixel
    /// gets one sample, if the scene has no soft light, or if the sky is a picture.
    #[must_use]
    pub fn with_sampling(self, sampling: Sampling) -> Self {
        let sky = self.scene.sky.as_ref();
        let is_soft = sky.is_some() || self.scene.has_soft_lights();
        // Surfaces with highlights mirror a picture of the sky. raycl does not compute the unoccluded part of
        // this mirrored light, but soft light at half resolution needs it.
        let has_picture = sky.is_some_and(|sky| sky.picture.is_some());
        let can = is_soft && !has_picture && sampling.most > 1;
        let half_light = if can { sampling.half_light } else { 0 };
        Self { sampling: Sampling { half_light, ..sampling }, ..self }
    }

    /// Sets how many bytes of the host's memory this process uses for data that belong to no session. A strategy cannot
    /// use these bytes.
    pub fn set_bytes_beside(&mut self, bytes: u64) {
        self.bytes_beside = bytes;
    }

    /// Returns true if `scene` is the session's scene itself, not an equal copy.
    pub fn is_of(&self, scene: &Arc<Scene>) -> bool {
        Arc::ptr_eq(&self.scene, scene)
    }

    /// Returns the compiler's built-in functions that kernels may use.
    pub fn builtins(&self) -> Builtins {
        self.builtins
    }

    /// Prepares a strategy: does the three steps `workload`, `spec` and `build`.
    pub fn prepare(
        &mut self,
        strategy: &Strategy,
        image_size: [u32; 2],
        local_size: [u32; 2],
    ) -> std::result::Result<Prepared, Refused> {
        let workload = self.workload(strategy, image_size, local_size)?;
        self.prepare_workload(strategy, &workload)
    }

    /// Prepares a strategy like [`Self::prepare`], at a local size that the user did not choose. If
    /// work-items share tiles, the number of tiles in a work-group is halved until the work-group fits on the
    /// device. If the work-group has more work-items than one of the compiled kernels supports, the
    /// work-group is halved further, as far as the strategy allows.
    pub fn prepare_fitting(
        &mut self,
        strategy: &Strategy,
        image_size: [u32; 2],
        mut local_size: [u32; 2],
    ) -> std::result::Result<Prepared, Refused> {
        loop {
            let [across, down] = local_size;
            let prepared = match self.prepare(strategy, image_size, local_size) {
                Err(Refused::Device(_)) if strategy.shares_tiles() && down > 1 => {
                    local_size = [across, down / 2];
                    continue;
                }
                other => other?,
            };
            let most = prepared.most_work_items().unwrap_or(usize::MAX);
            let fitting = halved(strategy.shares_tiles(), local_size, most);
            if fitting == local_size {
                return Ok(prepared);
            }
            local_size = fitting;
        }
    }

    /// Prepares a strategy like [`Self::prepare`], and also for rays that the caller provides
    /// ([`Prepared::cast_rays`]). Rays that the caller provides need a kernel that no frame needs, so the
    /// programs of [`Self::prepare`] lack this kernel.
    pub fn prepare_for_rays(
        &mut self,
        strategy: &Strategy,
        image_size: [u32; 2],
        local_size: [u32; 2],
    ) -> std::result::Result<Prepared, Refused> {
        let workload = self.workload(strategy, image_size, local_size)?;
        self.prepare_workload(strategy, &Workload { given_rays: true, ..workload })
    }

    /// Does the last two steps of [`Self::prepare`]: `spec` and `build`.
    fn prepare_workload(
        &mut self,
        strategy: &Strategy,
        workload: &Workload,
    ) -> std::result::Result<Prepared, Refused> {
        let spec = self.spec(strategy, workload)?;
        self.build(strategy, workload, spec)
    }

    /// Does the first step of [`Self::prepare`]: checks the strategy and determines the workload. The workload contains
    /// the stack size, which depends on the strategy's tree. If the device does not have the tree yet, this function
    /// therefore checks that everything fits into the memory of device and host, and uploads the tree. The tree is that
    /// of [`Self::with_tree`], if it was built for this strategy; otherwise, this function builds the tree.
    pub fn workload(
        &mut self,
        strategy: &Strategy,
        image_size: [u32; 2],
        local_size: [u32; 2],
    ) -> std::result::Result<Workload, Refused> {
        strategy.check()?;
        let mut workload =
            Workload::of(&self.scene, image_size, local_size).sampled(&self.scene, &self.sampling);
        if strategy.needs_tree() && self.shared.tree(strategy).is_none() {
            self.fits(strategy, &workload)?;
            let early = self.early_tree.take_if(|(of, _)| of == strategy).map(|(_, tree)| tree);
            let tree = match early {
                Some(tree) => Ok(Some(tree)),
                None => HostTree::build(&self.scene.mesh, strategy, self.tree_use),
            };
            let (queue, scene) = (&self.queue, &self.scene);
            let upload = |tree| self.shared.upload_tree(queue, scene, strategy, &workload, tree);
            tree.and_then(upload).map_err(Refused::at("preparing the tree"))?;
        }
        let stack_size = self.shared.tree(strategy).map_or(0, |tree| tree.stack_size);
        let step = if self.rounds_stacks && !strategy.shares_tiles() { ROUNDED_STACK } else { 1 };
        workload.stack_size = stack_size.next_multiple_of(step);
        Ok(workload)
    }

    /// Does the second step of [`Self::prepare`]: determines the source to be compiled.
    pub fn spec(&self, strategy: &Strategy, workload: &Workload) -> Result<ProgramSpec> {
        let mut spec = ProgramSpec::new(&self.sources, strategy, workload, self.builtins)?;
        if self.twins_before > 0 {
            spec.options += &format!(" -D TWINS_BEFORE={}", self.twins_before);
        }
        Ok(spec)
    }

    /// Does the last step of [`Self::prepare`]: checks that everything fits into the memory of device and host,
    /// compiles the program, and uploads the scene.
    pub fn build(
        &mut self,
        strategy: &Strategy,
        workload: &Workload,
        spec: ProgramSpec,
    ) -> std::result::Result<Prepared, Refused> {
        self.fits(strategy, workload)?;
        let (program, build_wait_ms) = self.program(&spec)?;
        let uploaded = self.shared.layout(&self.queue, &self.scene, strategy, workload);
        let uploaded = uploaded.map_err(Refused::at("uploading the scene"))?;
        Ok(Prepared {
            queue: self.queue.clone(),
            scene: Arc::clone(&self.scene),
            strategy: *strategy,
            workload: *workload,
            sampling: self.sampling,
            own_files: self.sources.changed_paths(&spec.files),
            spec,
            program,
            build_wait_ms,
            host_bytes: self.host_needs(strategy, workload).bytes(),
            uploaded,
            tree: self.shared.tree(strategy),
            compute_capability: self.compute_capability.clone(),
            frames: self.frames.clone(),
            lanes: strategy.lane_operations(self.builtins),
        })
    }

    /// Returns true if the program need not be compiled, because it was built before the session began or is
    /// in the cache.
    pub fn has_built(&self, spec: &ProgramSpec) -> bool {
        let early = self.early.as_ref().is_some_and(|(known, _)| known == spec);
        early || BuiltProgram::is_cached(self.queue.device, spec, &self.programs)
    }

    /// Returns how many samples each pixel gets.
    pub fn sampling(&self) -> Sampling {
        self.sampling
    }

    /// Returns the program that was built before the session began ([`Self::with_program`]), or gets the
    /// program from the cache, or builds it now. Also returns how long this took, in milliseconds; 0 if the
    /// program was built before the session began.
    fn program(&mut self, spec: &ProgramSpec) -> std::result::Result<(BuiltProgram, f64), Refused> {
        if let Some((_, program)) = self.early.take_if(|(known, _)| known == spec) {
            return Ok((program, 0.0));
        }
        let Queue { context, device, .. } = &self.queue;
        let program = BuiltProgram::build(context, *device, spec, &self.programs)
            .map_err(|error| Refused::Build(error.located(&self.sources, spec)))?;
        let build_ms = program.build_ms;
        Ok((program, build_ms))
    }

    /// Returns the memory that a strategy needs on the host.
    fn host_needs(&self, strategy: &Strategy, workload: &Workload) -> HostNeeds {
        HostNeeds::of(strategy, workload, self.queue.shares_memory, self.afterwards)
    }

    /// Refuses a strategy that does not fit into the free memory of the device or the host. Memory is not free if
    /// other strategies or existing frames of the session use it.
    fn fits(&self, strategy: &Strategy, workload: &Workload) -> std::result::Result<(), Refused> {
        let beside_own = self.shared.bytes_beside(strategy, self.queue.shares_memory);
        let held_beside_mesh = self.frames.bytes() + beside_own.buffers;
        let held_bytes = held_beside_mesh + beside_own.mesh_lists;
        let limits =
            DeviceLimits { global_bytes: self.limits.global_bytes.saturating_sub(held_bytes), ..self.limits };
        Requirements::check(strategy, workload, &limits).map_err(|refused| {
            // The bytes of the session's other strategies and frames count only against the device's limit of global
            // memory. If another limit is exceeded, the reason therefore does not state how many bytes they take.
            let shared = refused.cause == Cause::GlobalMemory;
            Refused::Device(if shared { beside(refused, held_bytes) } else { refused })
        })?;
        // The memory that the strategy needs on the host includes the mesh. `held_of_host` therefore leaves
        // out lists of the mesh that the device reads in place.
        let held_of_host = self.bytes_beside + if self.queue.shares_memory { held_beside_mesh } else { 0 };
        self.host_needs(strategy, workload)
            .check_now(held_of_host)
            .map_err(|refused| Refused::Host(beside(refused, held_of_host)))
    }
}

/// Adds to a refusal's reason the number of bytes that other strategies, existing frames and other data use.
fn beside(refused: Infeasible, held_bytes: u64) -> Infeasible {
    if held_bytes == 0 {
        return refused;
    }
    let others = Infeasible::BESIDE_OTHERS;
    Infeasible::beyond(format!("{}, in addition to {held_bytes} B {others}", refused.reason))
}

/// Halves the longer side of a local size until the local size has at most `most` work-items, or until the strategy
/// supports no smaller size. If work-items share tiles, each row of a work-group casts the rays of one tile, so only
/// the number of rows is halved.
fn halved(shares_tiles: bool, [mut across, mut down]: [u32; 2], most: usize) -> [u32; 2] {
    while across as usize * down as usize > most {
        if across > down && !shares_tiles {
            across /= 2;
        } else if down > 1 {
            down /= 2;
        } else {
            break;
        }
    }
    [across, down]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::discover;
    use crate::reference::fixtures;
    use crate::scene::{Sky, SkyPicture, load_scene};
    use crate::strategy::{Layout, LeafSize, preset};
    use glam::Vec3;
    use std::path::Path;

    #[test]
    fn a_work_group_is_halved_until_the_kernel_supports_it() {
        let sizes = [64, 63, 16, 2, 1, 0].map(|most| halved(false, [16, 8], most));
        assert_eq!(sizes, [[8, 8], [8, 4], [4, 4], [2, 1], [1, 1], [1, 1]]);
        assert_eq!(halved(false, [16, 8], 128), [16, 8]);
        assert_eq!([64, 16].map(|most| halved(true, [32, 4], most)), [[32, 2], [32, 1]]);
    }

    #[test]
    fn the_kernels_of_a_prepared_strategy_support_some_work_items() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let scene = Arc::new(fixtures::single_triangle());
        let mut session = Session::open(&device, &Sources::Embedded, scene).unwrap();
        let strategy = preset("deferred").unwrap().strategy;
        let prepared = session.prepare(&strategy, [8, 8], [1, 1]).map_err(|refused| refused.reason());
        let prepared = prepared.unwrap();
        assert!(prepared.most_work_items().is_some_and(|most| most >= 1));
        // `host_bytes` includes the memory of raycl itself, of its libraries and of the driver.
        let workload = session.workload(&strategy, [8, 8], [1, 1]).map_err(|refused| refused.reason());
        assert_eq!(prepared.host_bytes, session.host_needs(&strategy, &workload.unwrap()).bytes());
    }

    #[test]
    fn a_session_builds_trees_for_many_frames_unless_it_is_told_otherwise() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let scene = Arc::new(fixtures::single_triangle());
        let session = Session::open(&device, &Sources::Embedded, scene).unwrap();
        assert_eq!(session.tree_use, TreeUse::ManyFrames);
        assert_eq!(session.with_tree_use(TreeUse::OneFrame).tree_use, TreeUse::OneFrame);
    }

    #[test]
    fn twins_run_programs_of_their_own_and_a_single_device_the_ordinary_one() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/triangle.toml");
        let scene = Arc::new(load_scene(&path).unwrap().scene);
        let strategy = preset("deferred").unwrap().strategy;
        let spec = |twins_before| {
            let session = Session::open(&device, &Sources::Embedded, Arc::clone(&scene)).unwrap();
            let mut session = session.among_twins(twins_before);
            let workload = session.workload(&strategy, [8, 8], [1, 1]).map_err(|refused| refused.reason());
            session.spec(&strategy, &workload.unwrap()).unwrap()
        };
        let workload = Workload::of(&scene, [8, 8], [1, 1]);
        let ordinary =
            ProgramSpec::new(&Sources::Embedded, &strategy, &workload, device.info.builtins()).unwrap();
        let specs = [0, 1, 2].map(spec);
        assert_eq!(specs[0], ordinary);
        assert!(specs.iter().all(|spec| spec.source == ordinary.source));
        assert_ne!(specs[1].hash(), specs[0].hash());
        assert_ne!(specs[2].hash(), specs[1].hash());
    }

    #[test]
    fn only_stacks_in_private_memory_are_rounded() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/teapot.toml");
        let scene = Arc::new(load_scene(&path).unwrap().scene);
        let of = |name, rounds| {
            let session = Session::open(&device, &Sources::Embedded, Arc::clone(&scene)).unwrap();
            let mut session = if rounds { session.rounding_stacks() } else { session };
            let workload = session.workload(&preset(name).unwrap().strategy, [8, 8], [32, 1]);
            workload.map_err(|refused| refused.reason()).unwrap().stack_size
        };
        let [exact, shared] = ["bvh", "tile-group"].map(|name| of(name, false));
        assert!((1..ROUNDED_STACK).contains(&exact) && (1..ROUNDED_STACK).contains(&shared));
        assert_eq!([of("bvh", true), of("tile-group", true)], [ROUNDED_STACK, shared]);
        assert_eq!(of("deferred", true), 0);
    }

    #[test]
    fn nothing_is_cast_at_half_resolution_with_one_sample_without_soft_light_or_under_a_picture() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let half_light = |sky: Option<Sky>, samples| {
            let scene = Arc::new(Scene { sky, ..fixtures::single_triangle() });
            let session = Session::open(&device, &Sources::Embedded, scene).unwrap();
            session.with_sampling(Sampling { half_light: 2, ..Sampling::all(samples) }).sampling.half_light
        };
        let under = |picture| {
            let [zenith, horizon, up] = [Vec3::ONE, Vec3::ONE, Vec3::Y];
            Some(Sky { zenith, horizon, up, reach: 1.0, picture })
        };
        let texels = Arc::from([[1.0; 3]; 2]);
        let picture = SkyPicture { size: [2, 1], texels, ahead: Vec3::X, is_seen: false };
        assert_eq!(half_light(under(None), 4), 2);
        assert_eq!(half_light(under(None), 1), 0);
        assert_eq!(half_light(None, 4), 0);
        assert_eq!(half_light(under(Some(Arc::new(picture))), 4), 0);
    }

    /// A picture that is far too large for the host is refused while the buffers of a small picture exist.
    #[test]
    fn what_other_points_hold_counts_as_the_hosts_if_the_device_shares_its_memory() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/triangle.toml");
        let scene = Arc::new(load_scene(&path).unwrap().scene);
        let strategy = preset("deferred").unwrap().strategy;
        let limits =
            DeviceLimits { global_bytes: u64::MAX, allocation_bytes: u64::MAX, ..device.info.limits };
        for shares_memory in [true, false] {
            let queue = Queue { shares_memory, ..Queue::open(&device).unwrap() };
            let session = Session::new(queue, &device.info, &Sources::Embedded, Arc::clone(&scene));
            let mut session = session.limited(limits).with_cache(ProgramCache::default());
            let mut prepare =
                |side| session.prepare(&strategy, [side; 2], [1, 1]).map_err(|refused| refused.reason());
            let small = prepare(8).unwrap();
            let _held = small.caster().map_err(|refused| refused.reason()).unwrap();
            let reason = prepare(1 << 20).err().unwrap();
            assert!(reason.starts_with("the host's memory"), "{reason}");
            assert_eq!(reason.contains("in addition to"), shares_memory, "{reason}");
        }
    }

    #[test]
    fn bytes_of_the_process_that_belong_to_no_session_are_not_free() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let limits =
            DeviceLimits { global_bytes: u64::MAX, allocation_bytes: u64::MAX, ..device.info.limits };
        let queue = Queue { shares_memory: false, ..Queue::open(&device).unwrap() };
        let scene = Arc::new(fixtures::single_triangle());
        let mut session = Session::new(queue, &device.info, &Sources::Embedded, scene).limited(limits);
        session.set_bytes_beside(123);
        let workload = session.workload(&preset("tile").unwrap().strategy, [1 << 20; 2], [1, 1]);
        let reason = workload.map_err(|refused| refused.reason()).err().unwrap();
        assert!(reason.starts_with("the host's memory"), "{reason}");
        assert!(reason.contains(", in addition to 123 B "), "{reason}");
    }

    /// Two strategies with trees of their own read the normals and triangles of one mesh.
    #[test]
    fn lists_of_the_mesh_that_other_points_read_in_place_do_not_count_beside_the_mesh() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/pyramid-lower.toml");
        let scene = Arc::new(load_scene(&path).unwrap().scene);
        let tile = preset("tile").unwrap().strategy;
        let of = |leaf_size| Strategy { layout: Layout::INDEXED_32, leaf_size, ..tile };
        let [first, second] = [LeafSize::L4, LeafSize::L8].map(of);
        let limits =
            DeviceLimits { global_bytes: u64::MAX, allocation_bytes: u64::MAX, ..device.info.limits };
        let queue = Queue { shares_memory: true, ..Queue::open(&device).unwrap() };
        let mut session = Session::new(queue, &device.info, &Sources::Embedded, scene).limited(limits);
        let mut workload = |strategy: &Strategy, side| {
            session.workload(strategy, [side; 2], [1, 1]).map_err(|refused| refused.reason())
        };
        let small = workload(&first, 8).unwrap();
        let lists = Requirements::mesh_list_bytes(&first, &small);
        let held = Requirements::tree_bytes(&first, &small) - lists;
        let reason = workload(&second, 1 << 20).err().unwrap();
        assert!(lists > 0 && reason.starts_with("the host's memory"), "{reason}");
        assert!(reason.contains(&format!(", in addition to {held} B ")), "{reason}");
    }

    /// A strategy is refused if the device has no room for the strategy's buffers in addition to lists of the
    /// mesh, even if the strategy does not read these lists.
    #[test]
    fn lists_of_the_mesh_that_other_points_read_in_place_count_as_the_devices() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/pyramid-lower.toml");
        let scene = Arc::new(load_scene(&path).unwrap().scene);
        let [tile, deferred] = ["tile", "deferred"].map(|name| preset(name).unwrap().strategy);
        let indexed = Strategy { layout: Layout::INDEXED_32, ..tile };
        let queue = Queue { shares_memory: true, ..Queue::open(&device).unwrap() };
        let mut session = Session::new(queue, &device.info, &Sources::Embedded, scene);
        let workload = session.workload(&indexed, [8, 8], [1, 1]).map_err(|refused| refused.reason());
        let workload = workload.unwrap();
        let held = Requirements::tree_bytes(&indexed, &workload);
        assert!(Requirements::mesh_list_bytes(&indexed, &workload) > 0);
        let mut full = session.limited(DeviceLimits { global_bytes: held, ..device.info.limits });
        let refused = full.prepare(&deferred, [8, 8], [1, 1]).err().unwrap();
        let reason = refused.reason();
        assert!(reason.starts_with("global memory"), "{reason}");
        assert!(reason.contains(&format!(", in addition to {held} B ")), "{reason}");
    }
}
