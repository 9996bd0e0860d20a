//! The draft of a point: the part of the point's record that is known before the point is tried, including the key.

use super::host::Identity;
use super::key::{KeyParts, key};
use super::{Point, Work};
use crate::accel;
use crate::config::{Experiment, SceneChoice, have_one_shape};
use crate::device::DeviceInfo;
use crate::error::Result;
use crate::peak::describe_test;
use crate::program::{ProgramSpec, Sources};
use crate::record::{HOST, Record};
use crate::scene::{Loaded, Scene, Setting};
use crate::strategy::{Strategy, Workload};
use std::sync::Arc;

/// The inputs that are the same for all drafts (records of points before the points are tried).
#[derive(Clone, Copy)]
pub struct Drafter<'a> {
    /// The experiment whose points get drafts (records before the points are tried).
    pub experiment: &'a Experiment,
    /// The source files of the kernels, from which the points' programs are made.
    pub sources: &'a Sources,
}

/// A scene, the notes from reading its file, and its hash. The scene's hash is stored, because its
/// computation takes time.
pub struct Hashed {
    /// The scene as loaded from its file.
    pub scene: Arc<Scene>,
    /// Notes on what raycl ignored in the scene's file or replaced by defaults, and on other scenes of the config with
    /// the same content.
    pub notes: Vec<String>,
    /// The scene's hash ([`SceneChoice::hash`]).
    pub hash: String,
    /// The image size for whose shape raycl placed the camera; `None` if the camera suits images of all shapes.
    pub framed_for: Option<[u32; 2]>,
}

impl Hashed {
    /// Loads a scene for images of this size.
    pub fn load(choice: &SceneChoice, image_size: [u32; 2]) -> Result<Self> {
        let Loaded { scene, notes, is_framed, .. } = choice.load(image_size)?;
        let framed_for = is_framed.then_some(image_size);
        Ok(Self { hash: choice.hash(&scene), scene: Arc::new(scene), notes, framed_for })
    }

    /// Returns true if the camera of the loaded scene suits images of this size.
    fn suits(&self, image_size: [u32; 2]) -> bool {
        self.framed_for.is_none_or(|size| have_one_shape(size, image_size))
    }
}

/// The scene that a process holds in memory while it handles one point of the experiment after another.
#[derive(Default)]
pub struct HeldScene {
    /// The scene, and its number in the experiment; `None` if no scene is held.
    held: Option<(usize, Hashed)>,
}

impl HeldScene {
    /// Returns true if the held scene is the scene of this point, with the camera for the point's images.
    pub fn is_of(&self, point: &Point) -> bool {
        self.held.as_ref().is_some_and(|(number, at)| *number == point.scene && at.suits(point.image_size))
    }

    /// Returns the scene of a point of the experiment, with the camera for the point's images. Loads this
    /// scene unless it is already held. The scene that was held before is dropped first, since two large
    /// scenes may not fit into memory together.
    ///
    /// # Errors
    ///
    /// Fails if the scene cannot be loaded. After a failure to load a scene, no scene is held.
    pub fn of(&mut self, experiment: &Experiment, point: &Point) -> Result<&Hashed> {
        if !self.is_of(point) {
            self.held = None;
        }
        let (_, at) = match &mut self.held {
            Some(held) => held,
            empty => {
                let at = Hashed::load(&experiment.scenes[point.scene], point.image_size)?;
                empty.insert((point.scene, at))
            }
        };
        Ok(at)
    }
}

impl Drafter<'_> {
    /// Returns the draft of a point on `device`: the point's record before the point is tried. If the records of two
    /// points have equal keys ([`Record::key`]), the same work is measured for both points, in the same way.
    pub fn draft(&self, point: &Point, device: Option<&DeviceInfo>, at: &Hashed) -> Result<Record> {
        let Self { experiment, .. } = self;
        let chosen = &experiment.scenes[point.scene];
        let mut tree = "";
        let mut record = Record {
            image_size: point.image_size,
            triangles: Some(at.scene.mesh.triangles.len() as u64),
            lights: Some(at.scene.lights.len() as u64),
            scene_notes: at.notes.clone(),
            seed: Some(experiment.timing.seed),
            revision: option_env!("RAYCL_GIT_REVISION").map(str::to_owned),
            device: device.map_or(HOST, |device| &device.label).to_owned(),
            device_kind: device.map(|device| device.kind.name().to_owned()),
            threads: device.and_then(|device| device.threads),
            ..of_scene(chosen, at)
        };
        match point.work {
            Work::Host(baseline) => {
                record.name = baseline.name().to_owned();
                record.strategy = baseline.strategy().to_owned();
            }
            Work::Kernel { strategy, local_size } => {
                let named = &experiment.strategies[strategy];
                record.name = named.name.clone();
                record.preset = named.preset.clone();
                record.strategy = named.strategy.to_string();
                record.local_size = Some(local_size);
                describe_test(&mut record);
                let workload = Workload::of(&at.scene, point.image_size, local_size);
                let workload = workload.sampled(&at.scene, &chosen.sampling());
                let builtins = device.map(DeviceInfo::builtins).unwrap_or_default();
                // The tree is not built yet, so the program's hash does not contain the tree's depth. The
                // point's key is computed from the scene, the strategy and the code that builds trees, which
                // together determine the tree's depth.
                let spec = ProgramSpec::new(self.sources, &named.strategy, &workload, builtins)?;
                record.program_hash = Some(spec.hash());
                tree = builder_of(&named.strategy);
            }
        }
        record.key = self.key(device, at, &record, tree);
        Ok(record)
    }

    fn key(&self, device: Option<&DeviceInfo>, at: &Hashed, record: &Record, tree: &str) -> String {
        let by = |[x, y]: [u32; 2]| format!("{x}x{y}");
        let (device, state, program_hash) = match (device, &record.program_hash) {
            (Some(device), Some(hash)) => (device.identity(), device.state(), hash.clone()),
            (_, hash) => {
                let Identity { device, state, program } = Identity::of_this_process();
                (device, state, hash.clone().unwrap_or(program))
            }
        };
        key(&KeyParts {
            scene_hash: &at.hash,
            device: &device,
            state: &state,
            emulate: &self.experiment.emulate.to_string(),
            strategy: &record.strategy,
            local_size: &record.local_size.map_or(String::new(), by),
            image_size: &by(record.image_size),
            program_hash: &program_hash,
            timing: &self.experiment.timing.to_string(),
            tree,
        })
    }
}

/// Returns a record that only identifies a scene: by its name, its hash, its file, the values that the config sets in
/// the file, and the number of samples per pixel.
pub(super) fn of_scene(chosen: &SceneChoice, at: &Hashed) -> Record {
    let value = |set: &Setting| format!("{} = {}", set.path, set.value);
    Record {
        scene: at.scene.name.clone(),
        scene_hash: Some(at.hash.clone()),
        scene_file: Some(chosen.path.display().to_string()),
        scene_values: chosen.overrides.iter().map(value).collect(),
        samples_per_pixel: Some(chosen.samples).filter(|samples| *samples > 1),
        ..Record::default()
    }
}

/// Returns the fingerprint of the code that builds a strategy's tree; empty if the strategy uses no tree.
fn builder_of(strategy: &Strategy) -> &'static str {
    if strategy.needs_tree() { accel::FINGERPRINT } else { "" }
}

#[cfg(test)]
mod tests {
    use super::super::{Plan, asleep};
    use super::*;
    use crate::config;
    use crate::scene::load_scene;
    use std::path::Path;

    /// Makes a config that ends with `lines`, and returns the key of the config's point.
    fn key_with(lines: &str) -> String {
        key_on(&asleep::device(1.0), lines)
    }

    fn key_on(device: &DeviceInfo, lines: &str) -> String {
        let text = format!(
            "question = '?'\nexpectation = '!'\nscenes = ['scenes/triangle.toml']\nstrategies = ['naive']\n\
             image_sizes = [[8, 5]]\nlocal_sizes = [4]\n{lines}"
        );
        let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("test.toml");
        let experiment = config::parse(&config, text, &[]).unwrap();
        let at = Hashed::load(&experiment.scenes[0], [8, 5]).unwrap();
        let point = Plan::new(&experiment, 1).points[0];
        let drafter = Drafter { experiment: &experiment, sources: &Sources::Embedded };
        drafter.draft(&point, Some(device), &at).unwrap().key
    }

    #[test]
    fn results_of_a_device_with_other_limits_have_another_key() {
        let emulated = ["local_bytes = 16384", "local_bytes = 32768", "constant_bytes = 16384"];
        let mut keys = emulated.map(|limit| key_with(&format!("[emulate]\n{limit}\n"))).to_vec();
        keys.push(key_with(""));
        assert_eq!(keys[3], key_with(""));
        keys.sort();
        keys.dedup();
        assert_eq!(keys.len(), 4, "{keys:?}");
    }

    /// Earlier versions of raycl always cast one sample per pixel; the keys of their records must not change.
    #[test]
    fn only_several_samples_per_pixel_are_in_the_key_and_in_the_record() {
        let drafted = |lines: &str| {
            let entry = format!("[[scene]]\nfile = 'scenes/triangle.toml'\n{lines}\n");
            let experiment = super::super::fixtures::experiment_of(&format!(
                "baselines = ['serial']\n{entry}[[strategy]]\npreset = 'naive'\nlocal_sizes = [4]"
            ));
            let at = Hashed::load(&experiment.scenes[0], [8, 5]).unwrap();
            let drafter = Drafter { experiment: &experiment, sources: &Sources::Embedded };
            let points = Plan::new(&experiment, 1).points;
            let device = asleep::device(1.0);
            [(0, None), (1, Some(&device))].map(|(index, of)| drafter.draft(&points[index], of, &at).unwrap())
        };
        let [usual, one, four, five] = ["", "samples = 1", "samples = 4", "samples = 5"].map(drafted);
        assert_eq!(usual, one);
        assert!(usual.iter().all(|record| record.samples_per_pixel.is_none()));
        assert!(!serde_json::to_string(&usual[1]).unwrap().contains("samples_per_pixel"));
        let content = load_scene(Path::new("scenes/triangle.toml")).unwrap().scene.content_hash();
        assert_eq!(usual[1].scene_hash, Some(content));
        for (own, samples) in [(&four, 4), (&five, 5)] {
            assert!(own.iter().all(|record| record.samples_per_pixel == Some(samples)));
            assert_eq!(own[1].scene, format!("triangle+samples={samples}"));
        }
        let mut keys: Vec<_> = [&one, &four, &five].into_iter().flatten().map(|record| &record.key).collect();
        keys.sort();
        keys.dedup();
        assert_eq!(keys.len(), 6, "{keys:?}");
        // The program for several samples per pixel differs from the program for one sample, but is the same
        // for every number of samples above one.
        let programs = [&one, &four, &five].map(|records| records[1].program_hash.clone());
        assert!(programs[0] != programs[1] && programs[1] == programs[2], "{programs:?}");
    }

    #[test]
    fn results_of_a_device_in_another_state_have_another_key() {
        let device = asleep::device(1.0);
        let fewer = DeviceInfo { cores: Some(1), ..device.clone() };
        let set = DeviceInfo { settings: vec!["POCL_WORK_GROUP_METHOD=cbs".into()], ..device.clone() };
        let mut keys = [&device, &fewer, &set].map(|device| key_on(device, "")).to_vec();
        keys.sort();
        keys.dedup();
        assert_eq!(keys.len(), 3, "{keys:?}");
    }

    #[test]
    fn a_draft_names_its_scene_its_device_and_its_strategy() {
        let folder = tempfile::tempdir().unwrap();
        let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/triangle.toml");
        let text = format!(
            "question = '?'\nexpectation = '!'\nimage_sizes = [[8, 5]]\nbaselines = ['serial']\n\
             timing.seed = 77\n[[scene]]\nfile = {scene:?}\nset = {{ shadow_bias = 0.25 }}\n\
             [[strategy]]\nname = 'mine'\npreset = 'naive'\nlocal_sizes = [[4, 2]]\n"
        );
        let experiment = config::parse(&folder.path().join("a.toml"), text, &[]).unwrap();
        let hash = experiment.scenes[0].load([8, 5]).unwrap().scene.content_hash();
        let loaded = Hashed::load(&experiment.scenes[0], [8, 5]).unwrap();
        let at = Hashed { notes: vec!["a note".into()], ..loaded };
        let drafter = Drafter { experiment: &experiment, sources: &Sources::Embedded };
        let device = DeviceInfo { label: "a device".into(), threads: Some(3), ..asleep::device(1.0) };
        let points = Plan::new(&experiment, 1).points;
        let [host, kernel] = [(0, None), (1, Some(&device))]
            .map(|(index, device)| drafter.draft(&points[index], device, &at).unwrap());
        for record in [&host, &kernel] {
            assert_eq!((&record.scene_hash, &record.scene_notes), (&Some(hash.clone()), &at.notes));
            assert_eq!((record.triangles, record.lights, record.seed), (Some(1), Some(1), Some(77)));
            assert_eq!(
                (record.image_size, &record.scene_values[..]),
                ([8, 5], &["shadow_bias = 0.25".to_owned()][..])
            );
            assert_eq!(record.scene_file, Some(scene.display().to_string()));
        }
        assert_eq!((host.device.as_str(), host.device_kind, host.threads), (HOST, None, None));
        assert_eq!(
            (host.name.as_str(), host.strategy.as_str(), host.local_size),
            ("serial", "serial-f32", None)
        );
        assert_eq!((kernel.device.as_str(), kernel.threads), ("a device", Some(3)));
        assert_eq!(kernel.device_kind.as_deref(), Some("gpu"));
        assert_eq!((kernel.name.as_str(), kernel.local_size), ("mine", Some([4, 2])));
        assert_eq!(kernel.strategy, crate::strategy::preset("naive").unwrap().strategy.to_string());
        assert_eq!((kernel.preset.as_deref(), host.preset), (Some("naive"), None));
        assert!(kernel.program_hash.is_some() && host.program_hash.is_none() && kernel.key != host.key);
    }

    #[test]
    fn a_draft_counts_triangles_and_lights() {
        let lights = "set = { light = [[{ position = [1, 3, 1], power = 9 }, { position = [0, 3, 1], power = 9 }, \
                      { position = [0, 9, 1], power = 9 }]] }";
        let scene = format!("[[scene]]\nfile = 'scenes/triangle.toml'\n{lights}\n");
        let experiment = super::super::fixtures::experiment_of(&format!(
            "{scene}[[strategy]]\npreset = 'naive'\nlocal_sizes = [4]"
        ));
        let at = Hashed::load(&experiment.scenes[0], [8, 5]).unwrap();
        let drafter = Drafter { experiment: &experiment, sources: &Sources::Embedded };
        let point = Plan::new(&experiment, 1).points[0];
        let record = drafter.draft(&point, Some(&asleep::device(1.0)), &at).unwrap();
        assert_eq!((record.triangles, record.lights), (Some(1), Some(3)));
    }

    #[test]
    fn a_held_scene_is_loaded_once_and_dropped_before_another_one_is_loaded() {
        let mut experiment = super::super::fixtures::experiment("local_sizes = [4, 8]");
        experiment.scenes.push(SceneChoice::file("no/such/scene.toml"));
        let points = Plan::new(&experiment, 1).points;
        let (first, second) = (points[0], points[1]);
        assert_eq!([first.scene, second.scene], [0; 2]);
        let mut held = HeldScene::default();
        assert!(!held.is_of(&first));
        let scene = Arc::clone(&held.of(&experiment, &first).unwrap().scene);
        assert!(Arc::ptr_eq(&scene, &held.of(&experiment, &second).unwrap().scene) && held.is_of(&second));
        let dropped = Arc::downgrade(&scene);
        drop(scene);
        assert!(dropped.upgrade().is_some(), "the scene is still held");
        // The second scene cannot be loaded. The first scene was dropped before the attempt to load the
        // second scene.
        let missing = Point { scene: 1, ..first };
        assert!(held.of(&experiment, &missing).is_err());
        assert!(dropped.upgrade().is_none() && !held.is_of(&first));
    }

    #[test]
    fn keys_follow_the_builder_of_trees_only_where_there_is_a_tree() {
        let of = |name: &str| builder_of(&crate::strategy::preset(name).unwrap().strategy);
        assert_eq!((of("naive"), of("bvh")), ("", accel::FINGERPRINT));
        assert!(!accel::FINGERPRINT.is_empty());
    }

    #[test]
    fn a_key_is_computed_from_all_that_affects_the_measurement() {
        let experiment = super::super::fixtures::experiment_of(
            "scenes = ['scenes/triangle.toml']\n[[strategy]]\npreset = 'bvh'\nlocal_sizes = [[4, 2]]",
        );
        let (point, device) = (Plan::new(&experiment, 1).points[0], asleep::device(1.0));
        let at = Hashed::load(&experiment.scenes[0], point.image_size).unwrap();
        let drafter = Drafter { experiment: &experiment, sources: &Sources::Embedded };
        let record = drafter.draft(&point, Some(&device), &at).unwrap();
        let [width, height] = point.image_size;
        let parts = KeyParts {
            scene_hash: &at.hash,
            device: &device.identity(),
            state: &device.state(),
            emulate: &experiment.emulate.to_string(),
            strategy: &record.strategy,
            local_size: "4x2",
            image_size: &format!("{width}x{height}"),
            program_hash: record.program_hash.as_deref().unwrap(),
            timing: &experiment.timing.to_string(),
            tree: accel::FINGERPRINT,
        };
        assert_eq!(record.key, key(&parts));
    }
}
