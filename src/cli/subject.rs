//! The arguments that `render` and `view` share: the scene, the picture's size, and the way to cast it.

mod look;

use super::choice::{
    StrategyText, chosen_strategy, is_axis, parse_assignment, parse_size, refuse_misspelt_axis,
    refuse_option, requested_strategy, whole,
};
use crate::accel::WideBvh;
use crate::device::DeviceInfo;
use crate::error::{Error, Result, shortened};
use crate::filetype::is_standard_input;
use crate::launch::{Prepared, Refused, Session};
use crate::scene::{Loaded, Scene, Setting, Shot, load_scene_for};
use crate::strategy::{Strategy, Task, preset};
use look::Look;
use std::path::PathBuf;

/// The note that raycl prints if the user gives `--plain` with a scene file.
const PLAIN_SCENE: &str =
    "--plain has no effect: it changes only how a bare mesh is shown, and this scene comes from a scene file";

/// A scene, and the options for casting it.
#[derive(Clone, Debug, clap::Args)]
pub struct Subject {
    /// A scene file (TOML), or a bare mesh (OBJ, PLY, STL, glTF or GLB, also compressed as .gz); - stands for standard
    /// input
    pub scene: PathBuf,
    /// Pixels across, 1 to 65,536
    #[arg(long, default_value_t = 1280, value_parser = whole::<u32>(1..=65536))]
    pub width: u32,
    /// Pixels down, 1 to 65,536
    #[arg(long, default_value_t = 800, value_parser = whole::<u32>(1..=65536))]
    pub height: u32,
    /// The device: part of its name, platform or vendor; its label in `raycl devices`; or its kind (cpu, gpu,
    /// accelerator). If several devices match, raycl uses the first of them in the order of `raycl devices` [default:
    /// the device in RAYCL_DEVICE or your settings, else the most capable device]
    #[arg(long)]
    pub device: Option<String>,
    /// The strategy: a preset (naive), values of axes (width=4), or both (deferred,width=4) [default: the strategy that
    /// raycl expects to be fastest on the device]
    #[arg(long, value_parser = StrategyText, hide_possible_values = true)]
    pub strategy: Option<String>,
    /// Local size: work-items per work-group, across and down, 1 to 4096 each; 8 stands for 8x8 [default: a size that
    /// raycl chooses for the strategy and the device]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub local_size: Option<[u32; 2]>,
    /// Change the value of an axis of the strategy, or a value of the scene; may be given several times
    #[arg(long, value_name = "KEY=VALUE", value_parser = parse_assignment)]
    pub set: Vec<(String, String)>,
    #[command(flatten)]
    pub look: Look,
    /// Use the kernel files in this folder instead of the built-in files of the same names. A file with a new name in
    /// the folder of an axis of strategies, such as cast/vectors/, adds a value to this axis
    #[arg(long, value_name = "DIR")]
    pub cl_dir: Option<PathBuf>,
}

impl Subject {
    /// Returns true if the scene comes from standard input, which can only be read once.
    pub fn reads_standard_input(&self) -> bool {
        is_standard_input(&self.scene)
    }

    /// Returns the picture's size: pixels across and down.
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Loads the scene. If an azimuth or an elevation is set, raycl places the camera so that the whole scene is
    /// visible. raycl also places the camera of a bare mesh if the mesh's file has no camera, or if `up` is set. If
    /// `turns` is true, raycl places the camera so far away that the whole scene is visible from several angles all
    /// around (for turntables, and for views whose camera moves). If `dressed` is true, a bare mesh without lights gets
    /// soft light, a sky and usually a ground. If `--plain` has no effect, a note says so.
    ///
    /// # Errors
    ///
    /// Fails if the scene cannot be loaded. If the requested strategy has a mistake, fails before it reads the scene,
    /// because reading a large mesh takes seconds.
    pub fn load(&self, turns: bool, dressed: bool) -> Result<Loaded> {
        let needs_tree = self.requested()?.needs_tree();
        let aspect = f64::from(self.width) / f64::from(self.height);
        let most_triangles = needs_tree.then_some(WideBvh::MAX_INDEX as u64);
        let shot = Shot { aspect, turns, dressed, most_triangles };
        let mut loaded = load_scene_for(&self.scene, &self.overrides()?, shot)?;
        loaded.notes.extend((self.look.plain && !loaded.is_bare).then(|| PLAIN_SCENE.to_owned()));
        Ok(loaded)
    }

    /// Returns the requested strategy. Without `--strategy`, raycl chooses the strategy later, when it knows
    /// the device and the scene. Until then, the preset `tile` with the requested values of axes stands for this
    /// strategy, and is returned: the strategies that raycl chooses for scenes with many triangles need a tree, as
    /// `tile` does.
    ///
    /// # Errors
    ///
    /// Fails if `--strategy` or `--set` has an unknown preset, axis or value, or if values of `--strategy` contradict
    /// each other. Without `--strategy`, contradictions are found later, when raycl has chosen the strategy.
    fn requested(&self) -> Result<Strategy> {
        let text = self.strategy.as_deref();
        let strategy = requested_strategy(text, &self.set, preset("tile")?.strategy)?;
        if text.is_some() {
            strategy.check()?;
        }
        Ok(strategy)
    }

    /// Returns true if raycl chooses the strategy, its axes and the local size.
    pub fn leaves_strategy_open(&self) -> bool {
        self.strategy.is_none() && self.local_size.is_none() && !self.set.iter().any(|(key, _)| is_axis(key))
    }

    /// Returns the task: the properties of the scene and the picture that matter for the choice of a strategy.
    pub fn task(&self, scene: &Scene, samples: u32) -> Task {
        Task::of(scene, self.size(), false).sampled(scene, samples)
    }

    /// Returns the strategy and the local size: the requested ones or, without a request, those that raycl expects to
    /// be fastest on the device.
    pub fn strategy(&self, device: &DeviceInfo, task: Task) -> Result<(Strategy, [u32; 2])> {
        let (strategy, usual) = chosen_strategy(self.strategy.as_deref(), &self.set, &device.limits, task)?;
        Ok((strategy, self.local_size.unwrap_or(usual)))
    }

    /// Builds the program and uploads the scene. If no local size is requested, the work-group may become smaller, so
    /// that it fits on the device.
    pub fn prepare(
        &self,
        session: &mut Session,
        strategy: &Strategy,
        local_size: [u32; 2],
    ) -> std::result::Result<Prepared, Refused> {
        match self.local_size {
            Some(_) => session.prepare(strategy, self.size(), local_size),
            None => session.prepare_fitting(strategy, self.size(), local_size),
        }
    }

    /// Returns the options that change how radiance is displayed, as the user wrote them. Returns none if an option
    /// has a mistake, which [`Subject::load`] reports.
    pub fn display_options(&self) -> Vec<String> {
        let is_of_display = |setting: &Setting| setting.path.split('.').next() == Some("display");
        let settings = self.overrides().unwrap_or_default().into_iter().filter(is_of_display);
        settings.map(|setting| shortened(setting.origin)).collect()
    }

    /// Returns the values of the scene that options and `--set` change. A value of `--set` is read
    /// as TOML if it is valid TOML, and otherwise as text.
    ///
    /// # Errors
    ///
    /// Fails if a key of `--set` resembles the name of an axis, or is the name of an option (such as `local_size`) but
    /// not a key of a scene. Also fails if a value of the scene or an axis is set twice. Other unknown keys are found
    /// later, when the scene is loaded.
    fn overrides(&self) -> Result<Vec<Setting>> {
        self.set.iter().filter(|(key, _)| !is_axis(key)).try_for_each(|(key, text)| {
            refuse_option(key, text)?;
            refuse_misspelt_axis(key)
        })?;
        let value = |text: &str| {
            let parsed: Option<toml::Table> = toml::from_str(&format!("value = {text}")).ok();
            parsed.and_then(|mut table| table.remove("value")).unwrap_or_else(|| text.into())
        };
        let set = self.set.iter().map(|(key, text)| Setting {
            path: key.clone(),
            value: value(text),
            origin: format!("--set {key}={text}"),
        });
        let mut all: Vec<Setting> = self.look.values().into_iter().chain(set).collect();
        refuse_second(&all)?;
        all.retain(|setting| !is_axis(&setting.path));
        Ok(all)
    }
}

/// Returns an error if two settings have the same path, since one of them would have no effect.
fn refuse_second(settings: &[Setting]) -> Result<()> {
    for (index, second) in settings.iter().enumerate() {
        if let Some(first) = settings[..index].iter().find(|first| first.path == second.path) {
            let [one, other] = [first, second].map(|setting| shortened(&*setting.origin));
            let message = format!("'{}' is set twice: by {one} and by {other}", second.path);
            return Err(Error::input(message).with_help("leave out one of the two"));
        }
    }
    Ok(())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::device::{DeviceLimits, discover};
    use crate::program::Sources;
    use crate::reference::fixtures;
    use std::sync::Arc;

    fn subject(scene: PathBuf, [width, height]: [u32; 2]) -> Subject {
        Subject {
            scene,
            width,
            height,
            device: None,
            strategy: None,
            local_size: None,
            set: Vec::new(),
            look: Look::default(),
            cl_dir: None,
        }
    }

    #[test]
    fn a_tree_is_needed_unless_the_strategy_says_otherwise() {
        let needs_tree = |strategy: Option<&str>, set: &[(&str, &str)]| {
            let set = set.iter().map(|(key, value)| (key.to_string(), value.to_string())).collect();
            let strategy = strategy.map(str::to_owned);
            let subject = Subject { strategy, set, ..subject(PathBuf::new(), [1, 1]) };
            subject.requested().unwrap().needs_tree()
        };
        assert!(needs_tree(None, &[]) && needs_tree(Some("bvh"), &[("object.0.triangles", "7")]));
        assert!(!needs_tree(Some("raster"), &[]) && !needs_tree(Some("naive"), &[]));
        assert!(!needs_tree(None, &[("traversal", "exhaustive")]));
        assert!(needs_tree(Some("deferred,traversal=bvh"), &[]));
    }

    #[test]
    fn a_mistake_in_the_strategy_is_reported_before_the_scene_is_read() {
        let error = |strategy: Option<&str>, set: &[(&str, &str)]| {
            let set = set.iter().map(|(key, value)| (key.to_string(), value.to_string())).collect();
            let strategy = strategy.map(str::to_owned);
            let subject = Subject { strategy, set, ..subject("missing.obj".into(), [1, 1]) };
            subject.load(false, false).map(|_| ()).unwrap_err().to_string()
        };
        assert!(error(Some("nothing"), &[]).contains("'nothing'"), "{}", error(Some("nothing"), &[]));
        assert!(error(None, &[("width", "7")]).contains("width"), "{}", error(None, &[("width", "7")]));
        let contradiction = error(Some("tile,intersector=moller-trumbore"), &[]);
        assert!(contradiction.contains("not allowed"), "{contradiction}");
        assert!(error(Some("tile"), &[]).contains("missing.obj"), "{}", error(Some("tile"), &[]));
        // Without `--strategy`, raycl may later choose a strategy that allows the ray-triangle test
        // `moller-trumbore`, so this test is no mistake.
        let chosen_later = error(None, &[("intersector", "moller-trumbore")]);
        assert!(chosen_later.contains("missing.obj"), "{chosen_later}");
    }

    #[test]
    fn a_value_that_is_set_twice_is_a_mistake_but_a_part_of_a_value_may_follow_the_whole() {
        #[derive(clap::Parser)]
        struct Command {
            #[command(flatten)]
            subject: Subject,
        }
        let overrides = |words: &str| {
            let words = format!("render a.toml {words}");
            <Command as clap::Parser>::parse_from(words.split_whitespace()).subject.overrides()
        };
        for (words, message) in [
            (
                "--set background=white --set name=a --background black",
                "'background' is set twice: by --background black and by --set background=white",
            ),
            (
                "--set light.0.power=1 --set light.0.power=2",
                "'light.0.power' is set twice: by --set light.0.power=1 and by --set light.0.power=2",
            ),
            ("--set width=4 --set width=8", "'width' is set twice: by --set width=4 and by --set width=8"),
        ] {
            let error = overrides(words).unwrap_err();
            assert_eq!((error.exit_code(), error.to_string().as_str()), (2, message));
        }
        let settings = overrides("--set width=4 --set sky={} --set sky.zenith=1 --background black").unwrap();
        let paths: Vec<_> = settings.iter().map(|setting| setting.path.as_str()).collect();
        assert_eq!(paths, ["background", "sky", "sky.zenith"]);
    }

    #[test]
    fn a_mesh_is_seen_from_farther_away_in_a_narrow_picture() {
        let folder = tempfile::tempdir().unwrap();
        let mesh = folder.path().join("triangle.obj");
        std::fs::write(&mesh, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        let away = |size| {
            let loaded = subject(mesh.clone(), size).load(false, false).unwrap();
            loaded.scene.camera.position.length()
        };
        assert!(away([10, 40]) > 1.5 * away([40, 10]), "{} {}", away([10, 40]), away([40, 10]));
    }

    #[test]
    fn plain_is_for_bare_meshes() {
        let folder = tempfile::tempdir().unwrap();
        let mesh = folder.path().join("triangle.obj");
        std::fs::write(&mesh, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        let scene = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenes/triangle.toml");
        let has_note = |path: &PathBuf, plain: bool| {
            let mut subject = subject(path.clone(), [8, 8]);
            subject.look.plain = plain;
            let notes = subject.load(false, !plain).unwrap().notes;
            notes.iter().any(|note| note == PLAIN_SCENE)
        };
        assert!(has_note(&scene, true) && !has_note(&scene, false) && !has_note(&mesh, true));
    }

    /// In this test, not even a work-group that casts a single tile of rays fits on the device, so the error
    /// message names the last local size that raycl tried.
    #[test]
    fn a_local_size_is_made_smaller_unless_it_was_requested() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let scene = Arc::new(fixtures::single_triangle());
        let limits = DeviceLimits { work_group_size: 16, ..device.info.limits };
        let mut session = Session::open(&device, &Sources::Embedded, scene).unwrap().limited(limits);
        let strategy = preset("tile-group").unwrap().strategy;
        let mut refusal = |local_size| {
            let subject = Subject { local_size, ..subject(PathBuf::new(), [8, 8]) };
            subject.prepare(&mut session, &strategy, [32, 4]).err().unwrap().reason()
        };
        let reason = "work-group: 32 x 4 = 128 work-items > the device's limit of 16";
        assert_eq!(refusal(Some([32, 4])), reason);
        assert_eq!(refusal(None), "work-group: 32 x 1 = 32 work-items > the device's limit of 16");
    }
}
