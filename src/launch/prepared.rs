//! A strategy that is ready to cast a scene on a device.

use super::band::Band;
use super::held::Frames;
use super::refused::Refused;
use super::scene::{move_lights, replace_lights};
use super::setup::{Setup, sees_sky};
use super::{Caster, DeviceScene, DeviceTree, LaunchError, Queue, preprocess_for};
use crate::device::LaneOperations;
use crate::error::Result as OrError;
use crate::program::preprocess::Preprocessed;
use crate::program::{BuildError, BuiltProgram, CompiledKernel, ProgramCache, ProgramSpec, frame_kernels};
use crate::scene::{Light, Sampling, Scene};
use crate::strategy::{Requirements, Strategy, Workload};
use ocl::Kernel;
use ocl::core::{create_kernel, get_kernel_work_group_info};
use ocl::enums::{KernelWorkGroupInfo, KernelWorkGroupInfoResult};
use std::sync::Arc;

/// A strategy whose program is built and whose scene is uploaded, made by a [`Session`](super::Session).
pub struct Prepared {
    /// The sizes and features of the scene, the image and the work-groups.
    pub workload: Workload,
    /// Says how many samples each pixel gets.
    pub sampling: Sampling,
    /// The source that was compiled.
    pub spec: ProgramSpec,
    /// The compiled program.
    pub program: BuiltProgram,
    /// The time for building the program or taking it from the cache; 0 if the session was given the built program
    /// ([`Session::with_program`](super::Session::with_program)).
    pub build_wait_ms: f64,
    /// The largest amount of host memory that the strategy needs at any time, as raycl predicts it.
    pub host_bytes: u64,
    pub(super) queue: Queue,
    pub(super) scene: Arc<Scene>,
    pub(super) strategy: Strategy,
    pub(super) uploaded: Arc<DeviceScene>,
    pub(super) tree: Option<Arc<DeviceTree>>,
    pub(super) compute_capability: Option<String>,
    pub(super) frames: Frames,
    /// How work-items that share a tile exchange values.
    pub(super) lanes: LaneOperations,
    /// The paths of the kernel files in the program that the user added or changed.
    pub(super) own_files: Vec<String>,
}

impl Prepared {
    /// Makes a caster for frames of the size for which the strategy was prepared.
    pub fn caster(&self) -> Result<Caster, Refused> {
        self.caster_of(&self.workload, None)
    }

    /// Makes a caster for the frame from another program, which must have the same kernels.
    pub fn caster_of_program(&self, program: &BuiltProgram) -> Result<Caster, Refused> {
        let bytes = self.frames.count(&self.strategy, &self.workload);
        let setup = Setup { program, ..self.setup(&self.workload) };
        Caster::new(setup, None, bytes).map_err(Refused::at("preparing the frame"))
    }

    /// Makes a caster for a frame of another size, or for a band (some of the frame's rows of work-groups).
    pub(super) fn caster_of(&self, workload: &Workload, band: Option<Band>) -> Result<Caster, Refused> {
        let bytes = self.frames.count(&self.strategy, workload);
        Caster::new(self.setup(workload), band, bytes).map_err(Refused::at("preparing the frame"))
    }

    /// Returns the inputs of a frame with this workload.
    pub(super) fn setup<'a>(&'a self, workload: &'a Workload) -> Setup<'a> {
        Setup {
            queue: &self.queue,
            program: &self.program,
            strategy: &self.strategy,
            workload,
            scene: &self.scene,
            uploaded: &self.uploaded,
            tree: self.tree.as_ref(),
            lanes: self.lanes,
            own_files: &self.own_files,
        }
    }

    /// Moves the scene's lights, starting with the next frame. The number of the scene's lights stays the same: all
    /// elements of `lights` beyond this number are ignored. If `lights` has fewer elements, the scene's remaining
    /// lights do not move.
    pub fn move_lights(&self, lights: &[Light]) -> Result<(), LaunchError> {
        move_lights(&self.queue, &self.uploaded.lights, lights)
    }

    /// Replaces lights, sky, background, shadow bias, exposure and tone curve by those of another scene, starting with
    /// the caster's next frame. The camera does not change: [`Caster::cast_samples`] and [`Caster::cast_sample`] get
    /// their camera as an argument. Returns `false` and changes nothing if the scene needs other buffers or kernels,
    /// for example because it has another mesh or another number of lights.
    pub fn show(&mut self, scene: &Arc<Scene>, caster: &Caster) -> Result<bool, LaunchError> {
        if !self.suits(scene) {
            return Ok(false);
        }
        replace_lights(&self.queue, &self.uploaded, [&self.scene, scene])?;
        caster.show_background(scene)?;
        self.scene = Arc::clone(scene);
        Ok(true)
    }

    /// Returns true if the program and all buffers suit another scene. The program and the buffers suit the
    /// other scene if four properties of the two scenes are equal: the mesh, the sizes and features (the
    /// [`Workload`]), whether the background is transparent, and whether rays that hit nothing see a picture
    /// of the sky.
    fn suits(&self, scene: &Arc<Scene>) -> bool {
        let Workload { image_size, local_size, stack_size, given_rays, .. } = self.workload;
        let workload = Workload::of(scene, image_size, local_size).sampled(scene, &self.sampling);
        Arc::ptr_eq(&self.scene.mesh, &scene.mesh)
            && Workload { stack_size, given_rays, ..workload } == self.workload
            && self.scene.transparent == scene.transparent
            && sees_sky(&self.scene) == sees_sky(scene)
    }

    /// Returns properties of a frame's compiled kernels ([`Caster::distinct_kernels`]), from the driver, from the build
    /// log `log` and from `ptx`. `ptx` is the program's binary if this binary is PTX, and is empty otherwise. The
    /// occupancy of each kernel is predicted for the local size with which a frame starts this kernel. The local size
    /// of a kernel may differ from that of the workload: kernels that prepare or rasterise triangles, or that show the
    /// sky, have a local size of their own.
    pub fn made(&self, caster: &Caster, log: &str, ptx: &str) -> Vec<CompiledKernel> {
        let made = |kernel: &Kernel| {
            let made = CompiledKernel::of(kernel, self.queue.device, log, ptx);
            match group_items(kernel) {
                Some(items) => made.predicted(self.compute_capability.as_deref(), items),
                None => made,
            }
        };
        caster.distinct_kernels().map(made).collect()
    }

    /// Returns the largest number of work-items in a work-group that every kernel of a frame supports; `None`
    /// if the driver reports no such number.
    pub(super) fn most_work_items(&self) -> Option<usize> {
        let most = |name: &&str| {
            let kernel = create_kernel(self.program.program.as_core(), *name).ok()?;
            let query = KernelWorkGroupInfo::WorkGroupSize;
            match get_kernel_work_group_info(&kernel, self.queue.device, query).ok()? {
                KernelWorkGroupInfoResult::WorkGroupSize(most) => Some(most),
                _ => None,
            }
        };
        frame_kernels(&self.strategy, &self.workload).iter().filter_map(most).min()
    }

    /// Returns the program after preprocessing, as the device's compiler sees it.
    pub fn preprocessed(&self) -> OrError<Preprocessed> {
        preprocess_for(&self.queue, &self.spec)
    }

    /// Compiles another source for the same device, without storing the program in the cache.
    pub fn build_text(&self, spec: &ProgramSpec) -> Result<BuiltProgram, BuildError> {
        BuiltProgram::build(&self.queue.context, self.queue.device, spec, &ProgramCache::default())
    }

    /// Returns the total size in bytes of the buffers that a frame needs on the device, as raycl predicts it. The size
    /// includes the scene and the tree.
    pub fn device_bytes(&self) -> u64 {
        Requirements::buffer_bytes(&self.strategy, &self.workload)
    }

    /// Returns the time for building the tree on the host; 0 without a tree.
    pub fn tree_ms(&self) -> f64 {
        self.tree.as_ref().map_or(0.0, |tree| tree.build_ms)
    }

    /// Returns the time for uploading the scene and its tree.
    pub fn upload_ms(&self) -> f64 {
        self.uploaded.upload_ms + self.tree.as_ref().map_or(0.0, |tree| tree.upload_ms)
    }
}

/// Returns the number of work-items in a kernel's work-groups; `None` if the driver chooses this number.
fn group_items(kernel: &Kernel) -> Option<u32> {
    let [x, y, z] = kernel.default_local_work_size().to_lens().ok()?;
    u32::try_from(x * y * z).ok()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::accel::TreeUse;
    use crate::device::{discover, sub_group_size};
    use crate::image::Radiance;
    use crate::launch::alone::reports_local_memory;
    use crate::launch::{HostTree, Session};
    use crate::program::Sources;
    use crate::reference::reference;
    use crate::scene::{Sky, SkyPicture, load_scene};
    use crate::strategy::{Intersector, preset};
    use crate::verify::verify;
    use glam::Vec3;
    use std::path::Path;

    const SIZE: [u32; 2] = [45, 29];

    fn scene(name: &str) -> Scene {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
        load_scene(&path).unwrap().scene
    }

    fn deferred() -> Strategy {
        preset("deferred").unwrap().strategy
    }

    /// Prepares a strategy in a new session on the first device, without the cache of compiled programs.
    fn prepare(scene: &Arc<Scene>, strategy: &Strategy) -> (Prepared, Caster) {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let session = Session::open(&device, &Sources::Embedded, Arc::clone(scene)).unwrap();
        let mut session = session.with_cache(ProgramCache::default());
        let prepared = session.prepare(strategy, SIZE, [1, 1]).map_err(|refused| refused.reason()).unwrap();
        let caster = prepared.caster().map_err(|refused| refused.reason()).unwrap();
        (prepared, caster)
    }

    fn cast(caster: &Caster) -> (Radiance, usize) {
        caster.cast().unwrap();
        caster.read().unwrap()
    }

    #[test]
    fn a_changed_sky_lights_the_next_picture_as_in_a_new_session() {
        let triangle = scene("triangle.toml");
        let under_sky = |radiance: f32| {
            let [zenith, horizon] = [Vec3::splat(radiance); 2];
            let sky = Sky { zenith, horizon, up: Vec3::Y, reach: 10.0, picture: None };
            Arc::new(Scene { sky: Some(sky), ..triangle.clone() })
        };
        let [dim, bright] = [0.1, 0.2].map(under_sky);
        let (mut prepared, caster) = prepare(&dim, &deferred());
        let before = cast(&caster);
        assert!(prepared.show(&bright, &caster).unwrap());
        let after = cast(&caster);
        let (_, new) = prepare(&bright, &deferred());
        assert!(after != before && after == cast(&new));
    }

    /// PoCL 3.1 has no sub-groups, and crashes if it is asked for their size.
    #[test]
    fn the_size_of_sub_groups_is_asked_only_where_a_device_has_them() {
        let (prepared, caster) = prepare(&Arc::new(scene("triangle.toml")), &deferred());
        for kernel in caster.kernels() {
            let size = sub_group_size(prepared.queue.device, kernel, [1, 1]);
            assert!(size.is_none_or(|size| size > 0), "{size:?}");
        }
    }

    #[test]
    fn a_kernel_that_the_users_file_lacks_or_changes_is_the_users_mistake() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("cast")).unwrap();
        let file = folder.path().join("cast/entry.cl");
        let text = Sources::Embedded.read("cast/entry.cl").unwrap();
        let sources = Sources::Folder(folder.path().to_owned());
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let triangle = Arc::new(scene("triangle.toml"));
        for (from, to, said) in [
            ("void cast_primary(", "void cast_first(", "defines no kernel `cast_primary`, which raycl needs"),
            ("(CAST_PRIMARY_PARAMETERS)", "(CAST_PRIMARY_PARAMETERS, int more)", "has other parameters than"),
        ] {
            assert_eq!(text.matches(from).count(), 1, "{from}");
            std::fs::write(&file, text.replace(from, to)).unwrap();
            let session = Session::open(&device, &sources, Arc::clone(&triangle)).unwrap();
            let mut session = session.with_cache(ProgramCache::default());
            let prepared = session.prepare(&deferred(), SIZE, [1, 1]).map_err(|refused| refused.reason());
            let error = prepared.unwrap().caster().err().unwrap().into_error(&device.info);
            let message = error.to_string();
            assert_eq!(error.exit_code(), 2, "{message}");
            assert!(message.contains(said) && message.contains(&file.display().to_string()), "{message}");
        }
    }

    #[test]
    fn a_header_of_the_users_file_that_states_too_few_bytes_is_the_users_mistake() {
        let (folder, file) = (tempfile::tempdir().unwrap(), "cast/vectors/heap.cl");
        std::fs::create_dir_all(folder.path().join("cast/vectors")).unwrap();
        let text = Sources::Embedded.read(file).unwrap();
        let fewer = text.replace("// bytes_per_ray: 108\n", "// bytes_per_ray: 104\n");
        assert!(fewer != text);
        std::fs::write(folder.path().join(file), fewer).unwrap();
        let sources = Sources::Folder(folder.path().to_owned());
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let naive = preset("naive").unwrap().strategy;
        let error = sources.values().unwrap().during(|| {
            let session = Session::open(&device, &sources, Arc::new(scene("triangle.toml"))).unwrap();
            let mut session = session.with_cache(ProgramCache::default());
            let prepared = session.prepare(&naive, SIZE, [1, 1]).map_err(|refused| refused.reason()).unwrap();
            let caster = prepared.caster().map_err(|refused| refused.reason()).unwrap();
            caster.cast().unwrap();
            Refused::at("reading the image")(caster.read().err().unwrap()).into_error(&device.info)
        });
        assert_eq!(error.exit_code(), 2, "{error}");
        assert!(error.to_string().contains("correct `bytes_per_ray`"), "{error}");
        assert!(error.remedy().contains("docs/own-kernels.md"), "{}", error.remedy());
    }

    #[test]
    fn a_header_of_the_users_file_that_states_too_little_local_memory_is_the_users_mistake() {
        let file = "cast/vectors/local.cl";
        let text = Sources::Embedded.read(file).unwrap();
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let local = preset("local-vectors").unwrap().strategy;
        let is_reported = reports_local_memory();
        for (from, to, stated) in [
            ("// memory: local\n", "// memory: private\n", Some(0)),
            ("// bytes_per_ray: 108\n", "// bytes_per_ray: 4\n", Some(4 * 64)),
            ("// bytes_per_ray: 108\n", "// bytes_per_ray: 112\n", None),
        ] {
            let folder = tempfile::tempdir().unwrap();
            std::fs::create_dir_all(folder.path().join("cast/vectors")).unwrap();
            assert_eq!(text.matches(from).count(), 1, "{from}");
            std::fs::write(folder.path().join(file), text.replace(from, to)).unwrap();
            let sources = Sources::Folder(folder.path().to_owned());
            let error = sources.values().unwrap().during(|| {
                let session = Session::open(&device, &sources, Arc::new(scene("triangle.toml"))).unwrap();
                let mut session = session.with_cache(ProgramCache::default());
                let prepared = session.prepare(&local, SIZE, [8, 8]).map_err(|refused| refused.reason());
                prepared.unwrap().caster().err().map(|refused| refused.into_error(&device.info))
            });
            let message = error.as_ref().map(ToString::to_string);
            // raycl notices that the file's header states too little memory only if the driver reports how much memory
            // the kernel uses.
            let expected = stated.filter(|_| is_reported).map(|stated| {
                format!(
                    " B of __local memory, but according to the header of {}, it uses {stated} B: correct the key `memory`, ",
                    folder.path().join(file).display()
                )
            });
            assert_eq!(message.is_some(), expected.is_some(), "{to}: {message:?}");
            if let (Some(error), Some(expected)) = (error, expected) {
                assert_eq!(error.exit_code(), 2, "{error}");
                assert!(error.to_string().contains(&expected), "{error}");
                assert!(error.remedy().contains("docs/own-kernels.md"), "{}", error.remedy());
            }
        }
    }

    /// With the ray-triangle test `common-origin`, a shadow ray reads planes that were prepared for the light to which
    /// the ray goes.
    #[test]
    fn shadows_by_prepared_planes_are_those_of_the_reference() {
        let strategy = Strategy { intersector: Intersector::COMMON_ORIGIN, ..deferred() };
        let scene = Arc::new(scene("pyramid-lower.toml"));
        let (_, caster) = prepare(&scene, &strategy);
        let (image, hits) = cast(&caster);
        let expected = reference(&scene, SIZE, strategy.culling);
        let verdict = verify(&image, Some(hits), &expected, scene.display);
        assert!(verdict.ok, "{verdict:?}");
    }

    #[test]
    fn each_kernels_occupancy_is_that_of_the_local_size_with_which_it_is_started() {
        let scene = Arc::new(scene("pyramid-lower.toml"));
        let planes = Strategy { intersector: Intersector::COMMON_ORIGIN, ..deferred() };
        let raster = preset("raster").unwrap().strategy;
        for (strategy, expected) in [
            (planes, [("prepare_origins", 64), ("cast_primary", 1), ("shade_nearest", 1)]),
            (raster, [("raster_depth", 64), ("raster_nearest", 64), ("shade_nearest", 1)]),
        ] {
            let (mut prepared, caster) = prepare(&scene, &strategy);
            prepared.compute_capability = Some("9.0".to_owned());
            let entry = |(name, _): &(&str, u32)| {
                format!("Compiling entry function '{name}' for 'sm_90'\nUsed 48 registers\n")
            };
            let log: String = expected.iter().map(entry).collect();
            let made = prepared.made(&caster, &log, "");
            assert_eq!(made.len(), expected.len());
            for (kernel, (name, items)) in made.iter().zip(expected) {
                assert_eq!(kernel.name, name);
                assert!(kernel.occupancy.is_some(), "{name}");
                assert_eq!(kernel.clone().predicted(Some("9.0"), items), *kernel, "{name}");
            }
        }
    }

    /// Kernels that rasterise triangles or show the sky usually have work-groups of 64 work-items. Neither the number
    /// of triangles nor the image's width is a multiple of 64.
    #[test]
    fn work_groups_that_reach_beyond_the_triangles_or_the_image_change_nothing() {
        let lower = Arc::new(scene("pyramid-lower.toml"));
        let raster = preset("raster").unwrap().strategy;
        let (_, rasterising) = prepare(&lower, &raster);
        let (image, hits) = cast(&rasterising);
        let verdict = verify(&image, Some(hits), &reference(&lower, SIZE, raster.culling), lower.display);
        assert!(verdict.ok, "{verdict:?}");
        let texels = vec![[0.125; 3]; 2].into();
        let picture = Some(Arc::new(SkyPicture { size: [2, 1], texels, ahead: Vec3::X, is_seen: true }));
        let sky = Sky { zenith: Vec3::ZERO, horizon: Vec3::ZERO, up: Vec3::Y, reach: 10.0, picture };
        let under_sky = Arc::new(Scene { sky: Some(sky), ..scene("triangle.toml") });
        let (_, showing_sky) = prepare(&under_sky, &deferred());
        let (image, hits) = cast(&showing_sky);
        let is_sky = |pixel: &&[f32; 3]| pixel.iter().all(|channel| (channel - 0.125).abs() < 1e-5);
        assert_eq!(image.pixels.iter().filter(is_sky).count() + hits, image.pixels.len());
        for caster in [rasterising, showing_sky] {
            assert!(caster.kernels().all(|kernel| group_items(kernel).is_some()));
        }
    }

    #[test]
    fn the_tree_is_uploaded_with_the_scene_but_building_it_has_a_time_of_its_own() {
        let local = preset("local-vectors").unwrap().strategy;
        let (mut prepared, _) = prepare(&Arc::new(scene("triangle.toml")), &local);
        let scene_ms = prepared.uploaded.upload_ms;
        assert_eq!([prepared.tree_ms(), prepared.upload_ms()], [0.0, scene_ms]);
        let (bvh, mesh) = (preset("bvh").unwrap().strategy, &prepared.scene.mesh);
        let host = HostTree::build(mesh, &bvh, TreeUse::ManyFrames).unwrap().expect("a tree");
        let tree = DeviceTree::upload(&prepared.queue, mesh, &bvh, host).unwrap();
        prepared.tree = Some(Arc::new(DeviceTree { build_ms: 3.0, upload_ms: 5.0, ..tree }));
        assert_eq!([prepared.tree_ms(), prepared.upload_ms()], [3.0, scene_ms + 5.0]);
    }

    #[test]
    fn each_size_of_a_kernel_is_the_one_that_the_driver_reports_under_its_name() {
        use KernelWorkGroupInfoResult::{LocalMemSize, PrivateMemSize};
        let local = preset("local-vectors").unwrap().strategy;
        let (prepared, caster) = prepare(&Arc::new(scene("triangle.toml")), &local);
        for (kernel, made) in caster.distinct_kernels().zip(prepared.made(&caster, "", "")) {
            let bytes = |query| match kernel.wg_info(prepared.queue.device, query) {
                Ok(LocalMemSize(bytes) | PrivateMemSize(bytes)) => Some(bytes),
                _ => None,
            };
            let queries = [KernelWorkGroupInfo::LocalMemSize, KernelWorkGroupInfo::PrivateMemSize];
            assert_eq!([made.local_bytes, made.private_bytes], queries.map(bytes), "{}", made.name);
        }
    }
}
