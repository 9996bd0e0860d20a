//! Cases for testing the rule by which `render` chooses a strategy. For each case, the measured time of the
//! strategy that the rule chooses is compared with the times of the other candidates. A case states a scene,
//! an image size, and whether rays may slip between triangles.

use crate::config::have_one_shape;
use crate::error::{Error, Result};
use crate::reader;
use crate::scene::{Loaded, Scene, Setting, Shot, load_scene_for};
use crate::strategy::Task;
use crate::toml_read::from_text;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::Path;
use std::sync::Arc;

/// Scenes with fewer triangles than this number have the kind `Few`.
const FEW: usize = 50;
/// Scenes with more triangles per pixel than this number have the kind `Dense`.
const DENSE: usize = 4;

/// The kinds of devices on which a case may be measured.
const DEVICES: [&str; 2] = ["cpu", "gpu"];
/// The numbers of pixels across, or down, that `render` accepts.
const SIZES: RangeInclusive<u32> = 1..=65536;

/// The kinds of case for which the choice of a strategy is hard.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// The scene has fewer than 50 triangles.
    Few,
    /// Surfaces lie all around the eye.
    Inside,
    /// No ray may slip between triangles at their edges and corners.
    Watertight,
    /// The scene has more than 4 triangles per pixel of the image.
    Dense,
}

/// A scene and an image size for which the rule's choice is tested.
#[derive(Clone, Debug)]
pub struct Case {
    /// The case's name.
    pub name: String,
    /// The scene's file, relative to the folder of the file that lists the cases.
    pub scene: String,
    /// Keys of the scene file, such as `object.0.triangles`, and their new values.
    pub set: BTreeMap<String, toml::Value>,
    /// The image's width and height in pixels.
    pub size: [u32; 2],
    /// The kinds of case to which this case belongs. `raycl rule` checks this list before it measures the
    /// case: the list must contain exactly the kinds, such as `Few` (few triangles), that follow from the
    /// scene and the image size. Only the kind `Watertight` is not checked.
    pub kinds: Vec<Kind>,
    /// The kinds of device on which strategies are measured for this case.
    pub devices: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    case: Vec<Entry>,
}

/// An entry `[[case]]` of a file that lists cases. An entry with the key `size` stands for one case; an entry
/// with `sizes` stands for one case per size.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    scene: String,
    #[serde(default)]
    set: BTreeMap<String, toml::Value>,
    size: Option<[u32; 2]>,
    #[serde(default)]
    sizes: Vec<[u32; 2]>,
    #[serde(default)]
    kinds: Vec<Kind>,
    devices: Vec<String>,
}

impl Entry {
    /// Returns the entry's cases; `None` if the entry has both `size` and `sizes`, or neither of them. If the entry has
    /// `sizes`, the name of each case ends with the case's size.
    fn cases(self) -> Option<Vec<Case>> {
        let Self { name, scene, set, size, sizes, kinds, devices } = self;
        let case = |name: String, size| Case {
            name,
            scene: scene.clone(),
            set: set.clone(),
            size,
            kinds: kinds.clone(),
            devices: devices.clone(),
        };
        match (size, sizes.is_empty()) {
            (Some(size), true) => Some(vec![case(name.clone(), size)]),
            (None, false) => {
                let of_size = |size: [u32; 2]| case(format!("{name}, {}x{}", size[0], size[1]), size);
                Some(sizes.into_iter().map(of_size).collect())
            }
            _ => None,
        }
    }
}

/// Reads the cases of a file. The error names the file and the mistake.
pub fn cases(path: &Path) -> Result<Vec<Case>> {
    let wrong = |why: &dyn std::fmt::Display| {
        Error::input(format!("cannot read the cases of '{}': {why}", path.display()))
            .with_help("docs/rule.toml is an example of a file with cases")
    };
    let text = reader::text(path, reader::Kind::Toml).map_err(|error| wrong(&error))?;
    let File { case } = from_text(&text).map_err(|error| wrong(&error))?;
    let mut cases = Vec::new();
    for entry in case {
        let unsized_case = format!("the case '{}' needs either `size` or `sizes`", entry.name);
        cases.extend(entry.cases().ok_or_else(|| wrong(&unsized_case))?);
    }
    for Case { name, devices, size, .. } in &cases {
        if let Some(device) = devices.iter().find(|device| !DEVICES.contains(&device.as_str())) {
            return Err(wrong(&format!(
                "the case '{name}' names the device '{device}'; expected cpu or gpu"
            )));
        }
        if size.iter().any(|pixels| !SIZES.contains(pixels)) {
            let [across, down] = size;
            return Err(wrong(&format!(
                "the case '{name}' has {across} x {down} pixels; expected 1 to 65536 across and down"
            )));
        }
    }
    Ok(cases)
}

impl Case {
    /// Loads the case's scene for images of the case's size. `cases` is the path of the file that lists the cases. The
    /// path of the scene is relative to the folder of this file.
    pub fn load(&self, cases: &Path) -> Result<Loaded> {
        let path = cases.parent().unwrap_or(Path::new("")).join(&self.scene);
        let setting = |(key, value): (&String, &toml::Value)| Setting::new(key, value.clone());
        let set: Vec<Setting> = self.set.iter().map(setting).collect();
        let [width, height] = self.size.map(f64::from);
        load_scene_for(&path, &set, Shot { aspect: width / height, ..Shot::SQUARE })
    }

    /// Returns true if the scene that was loaded for `other` is also this case's scene. If `is_framed` is
    /// true, raycl placed the scene's camera for the shape (the ratio of width to height) of the images of
    /// `other`, so the images of `self` must have the same shape.
    fn has_scene_of(&self, other: &Self, is_framed: bool) -> bool {
        let is_same = (&self.scene, &self.set) == (&other.scene, &other.set);
        is_same && (!is_framed || have_one_shape(self.size, other.size))
    }

    /// Returns the properties of the case that affect which strategy is fastest.
    pub fn task(&self, scene: &Scene) -> Task {
        Task::of(scene, self.size, self.kinds.contains(&Kind::Watertight))
    }

    /// Returns true if the case lists exactly those kinds (such as few triangles) that the properties in
    /// `task` imply. The kind `Watertight` is not checked, since the case's list itself decides whether
    /// `task` is watertight.
    pub fn is_of_its_kinds(&self, task: &Task) -> bool {
        let is = [
            (Kind::Few, task.triangles < FEW),
            (Kind::Inside, task.inside),
            (Kind::Dense, task.triangles > DENSE * task.pixels),
        ];
        is.iter().all(|(kind, holds)| self.kinds.contains(kind) == *holds)
    }
}

/// The scene that was loaded last. Successive cases often have the same scene in several image sizes (an entry with
/// `sizes`); this scene is then loaded only once. The scene is loaded again if raycl has placed the camera for the shape
/// of the images, and the next case's images have another shape.
#[derive(Debug, Default)]
pub struct LastScene(Option<Held>);

/// A scene that was loaded, with the case for which it was loaded.
#[derive(Debug)]
struct Held {
    /// The case for which the scene was loaded.
    case: Case,
    scene: Arc<Scene>,
    /// True if raycl may have placed the scene's camera so that it fits the shape (the ratio of width to
    /// height) of the case's images.
    is_framed: bool,
}

impl LastScene {
    /// Returns the case's scene. Does not load the scene again if the previous call returned the same scene.
    /// `cases` is the file that lists the cases, and must be the same in all calls.
    pub fn of(&mut self, case: &Case, cases: &Path) -> Result<Arc<Scene>> {
        if let Some(last) = &self.0
            && case.has_scene_of(&last.case, last.is_framed)
        {
            return Ok(Arc::clone(&last.scene));
        }
        // The last scene may be large, so its memory is freed before the next scene is loaded.
        self.0 = None;
        let Loaded { scene, is_framed, .. } = case.load(cases)?;
        let scene = Arc::new(scene);
        self.0 = Some(Held { case: case.clone(), scene: Arc::clone(&scene), is_framed });
        Ok(scene)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn only_another_scene_or_other_values_are_loaded() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/rule.toml");
        let case = |scene: &str, triangles: i64, size| Case {
            name: "a".into(),
            scene: format!("../scenes/{scene}.toml"),
            set: BTreeMap::from([("object.0.triangles".to_owned(), toml::Value::Integer(triangles))]),
            size,
            kinds: Vec::new(),
            devices: Vec::new(),
        };
        let mut last = LastScene::default();
        let mut load = |case: Case| last.of(&case, &path).unwrap();
        let one = load(case("sphere", 30, [8, 5]));
        assert!(Arc::ptr_eq(&one, &load(case("sphere", 30, [16, 9]))));
        let more = load(case("sphere", 80, [16, 9]));
        assert!(more.mesh.triangles.len() > one.mesh.triangles.len());
        assert!(!Arc::ptr_eq(&more, &load(case("gourd", 80, [16, 9]))));
    }

    #[test]
    fn the_camera_of_a_mesh_without_a_scene_file_is_placed_for_the_images_shape() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.obj"), "v 0 0 0\nv 4 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        let mut last = LastScene::default();
        let load = |size| {
            let (set, kinds, devices) = (BTreeMap::new(), Vec::new(), Vec::new());
            let case = Case { name: "a".into(), scene: "a.obj".into(), set, size, kinds, devices };
            last.of(&case, &folder.path().join("cases.toml")).unwrap()
        };
        let [square, larger, wide] = [[8, 8], [16, 16], [16, 8]].map(load);
        assert!(Arc::ptr_eq(&square, &larger), "images of one shape have one camera");
        assert_ne!(square.camera, wide.camera);
    }

    #[test]
    fn a_case_for_no_device_or_of_no_pixels_is_a_mistake() {
        let refused = |devices: &str, size: &str| {
            let file = tempfile::NamedTempFile::new().unwrap();
            let case =
                format!("[[case]]\nname = \"a\"\nscene = \"a.toml\"\nsize = {size}\ndevices = {devices}\n");
            std::fs::write(file.path(), case).unwrap();
            cases(file.path()).err().map(|error| error.to_string()).unwrap_or_default()
        };
        assert!(
            refused("[\"gpus\"]", "[8, 5]")
                .ends_with("the case 'a' names the device 'gpus'; expected cpu or gpu")
        );
        assert!(refused("[]", "[0, 5]").ends_with("has 0 x 5 pixels; expected 1 to 65536 across and down"));
        assert_eq!(refused("[\"gpu\"]", "[8, 5]"), "");
        assert!(
            refused("[]", "[8, 5]\nsizes = [[8, 5]]")
                .ends_with("the case 'a' needs either `size` or `sizes`")
        );
    }

    #[test]
    fn each_of_several_sizes_makes_a_case() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let case = "[[case]]\nname = 'a'\nscene = 'a.toml'\nsizes = [[8, 5], [16, 9]]\ndevices = ['gpu']\n";
        std::fs::write(file.path(), case).unwrap();
        let cases = cases(file.path()).unwrap();
        let of: Vec<_> =
            cases.iter().map(|case| (case.name.as_str(), case.size, case.scene.as_str())).collect();
        assert_eq!(of, [("a, 8x5", [8, 5], "a.toml"), ("a, 16x9", [16, 9], "a.toml")]);
    }

    const KINDS: [Kind; 4] = [Kind::Few, Kind::Inside, Kind::Watertight, Kind::Dense];

    #[test]
    fn the_repositorys_cases_are_of_their_kinds_and_there_are_enough_of_each() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/rule.toml");
        let cases = cases(&path).unwrap();
        for (device, least) in [("cpu", 15), ("gpu", 10)] {
            let of_device = || cases.iter().filter(|case| case.devices.iter().any(|name| name == device));
            assert!(of_device().count() >= least, "{device}");
            for kind in KINDS {
                let count = of_device().filter(|case| case.kinds.contains(&kind)).count();
                assert!(count >= 5, "{device}: {count} of {kind:?}");
            }
        }
        // Generating millions of triangles takes seconds. This test therefore leaves out large scenes. The
        // command `raycl rule` checks the kinds of the cases with large scenes when it measures these cases.
        let is_small = |case: &&Case| !case.set.values().any(|value| value.as_integer() > Some(300_000));
        let mut scenes: Vec<(&Case, Loaded)> = Vec::new();
        for case in cases.iter().filter(is_small) {
            let is_own = |(other, loaded): &(&Case, Loaded)| case.has_scene_of(other, loaded.is_framed);
            let index = scenes.iter().position(is_own).unwrap_or_else(|| {
                scenes.push((case, case.load(&path).unwrap()));
                scenes.len() - 1
            });
            let task = case.task(&scenes[index].1.scene);
            assert!(case.is_of_its_kinds(&task), "{}: {task:?}", case.name);
        }
    }

    #[test]
    fn a_case_is_of_the_kinds_that_hold_and_of_no_others() {
        let case = |kinds: &[Kind]| Case {
            name: "a".into(),
            scene: "a.toml".into(),
            set: BTreeMap::new(),
            size: [10, 10],
            kinds: kinds.to_vec(),
            devices: Vec::new(),
        };
        let task = |triangles, inside| Task { inside, ..Task::covering(triangles, 100) };
        let is = |kinds: &[Kind], task: Task| case(kinds).is_of_its_kinds(&task);
        assert!(is(&[Kind::Few], task(49, false)) && !is(&[Kind::Few], task(50, false)));
        assert!(is(&[Kind::Dense], task(401, false)) && !is(&[Kind::Dense], task(400, false)));
        assert!(is(&[], task(400, false)) && !is(&[], task(49, false)) && !is(&[], task(401, false)));
        assert!(is(&[Kind::Inside], task(100, true)) && !is(&[], task(100, true)));
        assert!(is(&[Kind::Watertight], task(100, false)), "the task takes this kind from the case");
    }
}
