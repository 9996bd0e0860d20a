//! Broken kernels: tests/mutants/kernels.toml lists changes to kernel files. Verification must notice each change that
//! makes a picture wrong. Other tests of this file must notice changes with other effects. `make test` tries some of
//! the listed changes; `make test-long` tries all.

use crate::binary::{WorkFolder, device, has, repository};
use crate::common::apart::apart;
use crate::common::{self, Stand, compiles_soon, is_long, one_preset_of_each_family};
use crate::watertight::faults;
use raycl::device::{Builtins, LaneOperations};
use raycl::program::{ProgramSpec, Sources};
use raycl::strategy::{AXES, Preset, Strategy, Workload};
use serde::Deserialize;
use std::collections::{BTreeMap, HashSet};
use std::sync::OnceLock;

/// `make test` tries every `STEP`th picture.
const STEP: usize = 20;

/// The image's size, which is not a multiple of the size of a tile or of a block of rays.
const SIZE: [u32; 2] = [61, 43];

/// The built-in functions of the test device's compiler.
static BUILTINS: OnceLock<Builtins> = OnceLock::new();

/// Kernel files that no row of tests/mutants/kernels.toml changes, since other tests change them. A folder of
/// kernels cannot replace the anchor (a kernel whose time shows the machine's speed), so a test in
/// src/anchor.rs changes the anchor's kernel. Cut-outs, soft lights, area lights, pictures of skies and
/// several samples need special scenes or options; tests/cutouts.rs, tests/soft.rs, tests/area_lights.rs,
/// tests/environment.rs, tests/samples.rs and tests/shade_once.rs change the files that contain the code of
/// these features. Soft light at half resolution is part of the default look of bare meshes;
/// tests/half_light.rs changes the files of this light. The display transform does not take part in the
/// computation of radiance. A test in src/launch/show.rs changes the file of the display transform.
const UNTOUCHED: [&str; 18] = [
    "common/half_light.cl",
    "common/pixel_rows.cl",
    "anchor/spheres.cl",
    "common/cutouts.cl",
    "common/environment.cl",
    "common/show_sky.cl",
    "common/soft.cl",
    "common/area_light.cl",
    "cast/soft.cl",
    "tile_cpu/soft.cl",
    "tile_cpu/sky.cl",
    "tile_cpu/single_ray.cl",
    "tile_cpu/shade_once.cl",
    "tile_cpu/light_once.cl",
    "common/samples.cl",
    "common/mark_rough.cl",
    "tile_gpu/soft.cl",
    "display/show.cl",
];

/// A row of tests/mutants/kernels.toml: a change to a kernel file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Mutant {
    file: String,
    from: String,
    to: String,
    #[serde(default)]
    with: String,
    bases: Option<Vec<String>>,
    scene: Option<String>,
    width: Option<u32>,
    lanes: Option<Vec<LaneOperations>>,
    command: Option<String>,
    reason: Option<String>,
}

#[derive(Deserialize)]
struct Table {
    mutant: Vec<Mutant>,
}

fn mutants() -> Vec<Mutant> {
    let text = std::fs::read_to_string(repository("tests/mutants/kernels.toml")).expect("the table");
    toml::from_str::<Table>(&text).expect("rows").mutant
}

/// Returns the number of the only row to be tried (the first row is 1), if `tests/mutants/run` has set one.
fn chosen() -> Option<usize> {
    std::env::var("RAYCL_TEST_MUTANT").ok()?.parse().ok()
}

/// Returns the rows of the table that are to be tried and have this `command`. The changes of rows without a
/// command (`None`) are tested by casting pictures. Fails if the table has fewer than `least` rows with this
/// `command`.
fn of_command(command: Option<&str>, least: usize) -> Vec<Mutant> {
    let is_own =
        |(_, mutant): &(usize, Mutant)| mutant.command.as_deref() == command && mutant.reason.is_none();
    let all: Vec<(usize, Mutant)> = (1..).zip(mutants()).filter(is_own).collect();
    assert!(all.len() >= least, "{command:?}: {}", all.len());
    let is_chosen = |(number, _): &(usize, Mutant)| chosen().is_none_or(|chosen| chosen == *number);
    all.into_iter().filter(is_chosen).map(|(_, mutant)| mutant).collect()
}

impl Mutant {
    /// Returns the strategies whose programs contain the changed file, at most one for each family. Each strategy is
    /// returned as the text after `--strategy`, and as a value.
    fn strategies(&self) -> Vec<(String, Strategy)> {
        let is_base = |usual: &&Preset| {
            self.bases.as_ref().is_none_or(|bases| bases.iter().any(|base| base == usual.name))
        };
        let usual = one_preset_of_each_family().into_iter().filter(is_base);
        let named = usual.map(|usual| match self.with.as_str() {
            "" => (usual.name.to_owned(), usual.strategy),
            with => (format!("{},{with}", usual.name), with_values(usual.strategy, with)),
        });
        named.filter(|(_, strategy)| strategy.contradiction().is_none() && self.is_in(strategy)).collect()
    }

    /// Returns true if a device with these lane operations compiles the changed code; otherwise prints a
    /// line.
    fn is_about(&self, lanes: LaneOperations) -> bool {
        let is = self.lanes.as_ref().is_none_or(|those| those.contains(&lanes));
        if !is {
            println!("{}: not tried with {}: {}", self.file, lanes.about(), self.from);
        }
        is
    }

    fn is_in(&self, strategy: &Strategy) -> bool {
        files(strategy).contains(&self.file)
    }

    /// Casts an image with this row's change to a kernel, and fails if verification does not notice the
    /// change.
    fn must_be_noticed_in(&self, name: &str, strategy: &Strategy) {
        let work_folder = WorkFolder::new();
        let [across, down] = local_size(strategy);
        let local_size = format!("{across}x{down}");
        let scene = repository("scenes").join(self.scene.as_deref().unwrap_or("still-life.toml"));
        let scene = scene.to_str().expect("UTF-8");
        let device = device();
        let cast = ["render", scene, "--device", &device, "--local-size", &local_size, "--strategy", name];
        let folder = self.folder(&work_folder);
        let width = self.width.unwrap_or(SIZE[0]).to_string();
        let size = ["--width", &width, "--height", &SIZE[1].to_string()];
        let ends = ["--verify", "--quiet", "-o", "wrong.png", "--cl-dir", &folder];
        let message = work_folder.mistake(&[&cast[..], &size, &ends].concat(), 1);
        has(&message, &["the picture is wrong: "]);
    }

    /// Returns a folder for `--cl-dir` that applies the change to the built-in kernels.
    fn folder(&self, folder: &WorkFolder) -> String {
        folder.kernels(&self.file, &self.from, &self.to)
    }
}

/// Returns the local size of all pictures of a strategy.
fn local_size(strategy: &Strategy) -> [u32; 2] {
    match strategy.family().name {
        "tile-cpu" => [1, 1],
        "tile-gpu" => [32, 1],
        _ => [4, 4],
    }
}

/// Returns the strategy `strategy` with the values that `with` lists, such as `width=4`.
fn with_values(mut strategy: Strategy, with: &str) -> Strategy {
    for assignment in with.split(',') {
        let (axis, value) = assignment.split_once('=').expect("axis=value");
        strategy.set(axis, value).expect("a value of the axis");
    }
    strategy
}

/// Returns the files from which a strategy's program is built for a scene with textures, colours of corners and smooth
/// shadows.
fn files(strategy: &Strategy) -> Vec<String> {
    let textured = Workload { texture_words: 1, mip_levels: true, corner_colours: true, ..Workload::CUBE };
    let workload = Workload { local_size: [32, 1], smooth_shadows: true, ..textured };
    let builtins = *BUILTINS.get_or_init(|| common::device().info.builtins());
    ProgramSpec::new(&Sources::Embedded, strategy, &workload, builtins).expect("a program").files
}

/// `make test` tries only some rows of the table. This test checks all rows of tests/mutants/kernels.toml,
/// and finds those whose text is no longer in the kernel file.
#[test]
fn each_row_changes_a_text_that_its_file_has_once() {
    for Mutant { file, from, to, .. } in mutants() {
        let count = Sources::Embedded.read(&file).expect("a kernel file").matches(&from).count();
        assert!(count == 1 && from != to, "{file}: {from:?} is there {count} times");
    }
}

#[test]
fn a_broken_kernel_is_a_wrong_picture() {
    let lanes = common::device().info.builtins().lanes;
    let mut pictures = 0;
    for mutant in &of_command(None, 70) {
        if !mutant.is_about(lanes) {
            continue;
        }
        let strategies = mutant.strategies();
        assert!(!strategies.is_empty(), "{}: no strategy uses it", mutant.file);
        let soon = strategies.iter().any(|(_, strategy)| compiles_soon(strategy));
        for (name, strategy) in strategies {
            pictures += 1;
            let is_due = match chosen() {
                Some(_) => compiles_soon(&strategy) || !soon,
                None => pictures % STEP == 0 && compiles_soon(&strategy),
            };
            if is_due || is_long() {
                println!("{}: {name}", mutant.file);
                mutant.must_be_noticed_in(&name, &strategy);
            }
        }
    }
    assert!(pictures > 100 || chosen().is_some(), "{pictures}");
}

/// Returns the pictures that show the changes of the table's rows. For each scene and each width of its
/// picture in pixels, these are the strategies that cast the picture.
fn pictures() -> BTreeMap<(String, u32), Vec<Strategy>> {
    let mut pictures: BTreeMap<(String, u32), Vec<Strategy>> = BTreeMap::new();
    for mutant in mutants().iter().filter(|mutant| mutant.command.is_none() && mutant.reason.is_none()) {
        let scene = mutant.scene.as_deref().unwrap_or("still-life.toml").to_owned();
        let known = pictures.entry((scene, mutant.width.unwrap_or(SIZE[0]))).or_default();
        for (_, strategy) in mutant.strategies() {
            if !known.contains(&strategy) {
                known.push(strategy);
            }
        }
    }
    pictures
}

/// If a picture were wrong even without a change to a kernel, verification would seem to notice every change.
#[test]
fn without_a_change_each_picture_is_right() {
    apart!();
    let (mut count, mut failures) = (0, Vec::new());
    for ((scene, width), strategies) in pictures() {
        let is_due = |strategy: &Strategy| {
            count += 1;
            is_long() || (count % STEP == 0 && compiles_soon(strategy))
        };
        let due: Vec<Strategy> = strategies.into_iter().filter(is_due).collect();
        if due.is_empty() {
            continue;
        }
        let mut stand = Stand::new(common::scene(&scene), [width, SIZE[1]]);
        for strategy in due {
            let picture = format!("{scene}, {width} pixels wide, {strategy}");
            match stand.check(&strategy, local_size(&strategy)) {
                Ok(verdict) if verdict.ok => {}
                Ok(verdict) => failures.push(format!("{picture}: wrong: {verdict:?}")),
                Err(why) => failures.push(format!("{picture}: not cast: {why}")),
            }
        }
    }
    assert!(count > 60, "{count}");
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// Changes to kernels that make rays slip between neighbouring triangles, or stop rays beside a triangle,
/// because of rounding. Pictures do not show such faults at edges.
#[test]
fn a_broken_edge_leaks() {
    apart!();
    for mutant in of_command(Some("leaks"), 6).iter().take(if is_long() { usize::MAX } else { 1 }) {
        let work_folder = WorkFolder::new();
        let folder = work_folder.path(&mutant.folder(&work_folder));
        let strategies = mutant.strategies();
        assert!(!strategies.is_empty(), "{}: no strategy uses it", mutant.file);
        for (name, strategy) in strategies {
            let faults = faults(&Sources::Folder(folder.clone()), &strategy);
            println!("{}: {name}: {faults:?}", mutant.file);
            assert!(faults.iter().any(|fault| *fault > 0), "{}: {:?}: {name}", mutant.file, mutant.to);
        }
    }
}

/// With these changes to kernels, an eye that lies in a surface's plane sees the surface. Rounding decides what such an
/// eye sees, so verification accepts the picture. The surface fills a large part of the picture.
#[test]
fn a_broken_plane_is_seen_from_within() {
    apart!();
    let most = if is_long() { usize::MAX } else { 1 };
    for mutant in of_command(Some("planes"), 5).iter().take(most) {
        let work_folder = WorkFolder::new();
        let folder = work_folder.path(&mutant.folder(&work_folder));
        let scene = common::scene(mutant.scene.as_deref().expect("a scene"));
        let hits = |sources: &Sources, strategy: &Strategy| {
            let stand = Stand::of(sources, scene.clone(), SIZE, |builtins| builtins);
            stand.cast_and_count(strategy, local_size(strategy)).expect("an image").1
        };
        let strategies = mutant.strategies();
        assert!(!strategies.is_empty(), "{}: no strategy uses it", mutant.file);
        let soon = strategies.iter().any(|(_, strategy)| compiles_soon(strategy));
        let due = strategies.iter().filter(|(_, strategy)| compiles_soon(strategy) || !soon);
        for (name, strategy) in due.take(most) {
            let right = hits(&Sources::Embedded, strategy);
            let wrong = hits(&Sources::Folder(folder.clone()), strategy);
            println!("{}: {name}: {right} hits, {wrong} with the change", mutant.file);
            assert!(wrong > 2 * right, "{}: {:?}: {name}: {wrong} hits", mutant.file, mutant.to);
        }
    }
}

/// Some rows of the table have `command = "probe"`. These rows change code that is compiled only for devices
/// with lane operations other than barriers.
#[test]
fn broken_lane_operations_are_the_users_mistake() {
    let lanes = common::device().info.builtins().lanes;
    for mutant in of_command(Some("probe"), 3).iter().filter(|mutant| mutant.is_about(lanes)) {
        let work_folder = WorkFolder::new();
        let folder = mutant.folder(&work_folder);
        let message =
            work_folder.mistake(&["kernel", "tile-group", "--device", &device(), "--cl-dir", &folder], 2);
        has(&message, &["get wrong values with ", "lanes.cl", "help: "]);
    }
}

/// `raycl peak` measures rates before it reports a wrong result, so testing one changed kernel takes seconds.
/// `make test` therefore tests only one of the changed kernels.
#[test]
fn a_broken_kernel_of_peak_is_no_figure() {
    for mutant in of_command(Some("peak"), 6).iter().take(if is_long() { usize::MAX } else { 1 }) {
        let work_folder = WorkFolder::new();
        let folder = mutant.folder(&work_folder);
        let message = work_folder.mistake(&["peak", "--device", &device(), "--cl-dir", &folder], 1);
        has(&message, &[" returned ", ", not "]);
    }
}

#[test]
fn every_file_is_broken_in_every_family_that_is_made_of_it() {
    let all = mutants();
    let broken: HashSet<(String, &str)> = all
        .iter()
        .flat_map(|mutant| {
            let strategies = mutant.strategies();
            strategies.into_iter().map(|(_, strategy)| (mutant.file.clone(), strategy.family().name))
        })
        .collect();
    for usual in one_preset_of_each_family() {
        for strategy in one_value_away(usual.strategy) {
            let family = strategy.family().name;
            for file in files(&strategy) {
                assert!(broken.contains(&(file.clone(), family)), "{file}: nothing breaks it in {family}");
            }
        }
    }
    let named: HashSet<&str> = all.iter().map(|mutant| mutant.file.as_str()).collect();
    for file in Sources::names() {
        assert!(named.contains(file) != UNTOUCHED.contains(&file), "{file}: break it, or say why not");
    }
}

/// Returns the strategy `base`, and every strategy that differs from `base` on one axis and has no values
/// that contradict each other.
fn one_value_away(base: Strategy) -> Vec<Strategy> {
    let changed = AXES.iter().flat_map(|axis| axis.values().into_iter().map(|(value, _)| (axis.name, value)));
    let changed = changed.map(|(axis, value)| {
        let mut strategy = base;
        strategy.set(axis, value).expect("a value of the axis");
        strategy
    });
    changed.filter(|strategy| strategy.contradiction().is_none()).collect()
}
