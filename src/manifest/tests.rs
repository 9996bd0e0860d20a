//! Tests of the manifest against the files under `cl/`, without a device.

use super::*;
use crate::device::{Builtins, LaneOperations};
use crate::program::ProgramSpec;
use crate::program::preprocess::preprocess;
use crate::sources::Sources;
use crate::strategy::{AXES, Axis as _, PRESETS, Strategy, Traversal, Width, Workload};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::BitOrAssign as _;
use std::sync::LazyLock;

/// Returns the presets, and the strategies that differ from a preset on one axis, such as the layout of
/// triangles. Together, these strategies use every file of every family, except files that only some scenes or
/// devices need.
pub(super) fn strategies() -> Vec<Strategy> {
    // The list is computed only once: several tests need it, and it takes long to find out which values
    // contradict each other.
    static ALL: LazyLock<Vec<Strategy>> = LazyLock::new(one_axis_away);
    ALL.clone()
}

/// Computes the list of [`strategies`].
fn one_axis_away() -> Vec<Strategy> {
    let mut all: Vec<Strategy> = PRESETS.iter().map(|preset| preset.strategy).collect();
    for strategy in all.clone() {
        for axis in AXES {
            for (value, _) in axis.values() {
                let mut changed = strategy;
                changed.set(axis.name, value).unwrap_or_else(|error| panic!("{error}"));
                if changed.contradiction().is_none() && !all.contains(&changed) {
                    all.push(changed);
                }
            }
        }
    }
    all
}

pub(super) fn spec(strategy: &Strategy) -> ProgramSpec {
    spec_of(&Sources::Embedded, strategy)
}

pub(super) fn spec_of(sources: &Sources, strategy: &Strategy) -> ProgramSpec {
    spec_for(sources, strategy, Workload::CUBE)
}

/// A scene with textures.
const TEXTURED: Workload = Workload { texture_words: 1, mip_levels: true, ..Workload::CUBE };
/// A scene with colours of corners, in which surfaces emit light.
const COLOURED: Workload = Workload { corner_colours: true, emissive: true, ..Workload::CUBE };
/// A scene with soft lights and a sky, and several samples of each pixel.
const SOFT: Workload = Workload { soft_lights: true, sky: true, many_samples: true, ..Workload::CUBE };
/// The scene of `SOFT`, in which a light is a surface.
const AREA_LIT: Workload = Workload { area_lights: true, ..SOFT };
/// The scene of `SOFT`, but its soft light is cast at half resolution.
const HALF_LIGHT: Workload = Workload { half_light: true, ..SOFT };
/// A scene with cut-outs.
const CUT_OUT: Workload = Workload { cut_outs: true, ..TEXTURED };
/// A scene whose sky is a picture.
const ENVIRONMENT: Workload = Workload { sky_texels: 1, ..SOFT };
/// A scene with smooth shadows.
const SMOOTH_SHADOWS: Workload = Workload { smooth_shadows: true, ..Workload::CUBE };

/// Returns the program of a strategy for the scene that `workload` describes.
fn spec_for(sources: &Sources, strategy: &Strategy, workload: Workload) -> ProgramSpec {
    let workload = Workload { local_size: [32, 1], ..workload };
    let builtins =
        Builtins { reduce: true, prefetch: false, lanes: LaneOperations::Barriers, opencl_3: true };
    ProgramSpec::new(sources, strategy, &workload, builtins).unwrap_or_else(|error| panic!("{error}"))
}

/// Returns the words of a text without its comments.
fn words(text: &str) -> Vec<&str> {
    let code = text.lines().map(|line| line.split("//").next().unwrap_or_default());
    code.flat_map(|line| line.split(|c: char| !c.is_ascii_alphanumeric() && c != '_')).collect()
}

/// Returns true if a text uses a name. Occurrences of the name in `#ifndef`, in `defined(...)` and in `#error` do
/// not count as uses.
fn uses_define(text: &str, name: &str) -> bool {
    let asks = |line: &&str| line.starts_with("#error") || line.starts_with("#ifndef");
    let lines: Vec<_> = text.lines().filter(|line| !asks(line)).collect();
    words(&lines.join("\n").replace(&format!("defined({name})"), "")).contains(&name)
}

/// Returns each kernel's name in a text, and the first word of the kernel's parameter list.
fn kernels_in(text: &str) -> BTreeMap<&str, &str> {
    let words: Vec<_> = words(text).into_iter().filter(|word| !word.is_empty()).collect();
    let heads = words.iter().enumerate().filter(|(_, word)| **word == "__kernel");
    let of_head = |(at, _): (usize, &&str)| {
        let void =
            at + words[at..].iter().position(|word| *word == "void").expect("a kernel returns nothing");
        (words[void + 1], words[void + 2])
    };
    heads.map(of_head).collect()
}

/// Other tests go through the families in the table `FAMILIES`, so a family that the table lacks would not be
/// tested. The table must also contain the families of strategies that raycl refuses, since the reason for a
/// refusal comes from the rules of the strategy's family.
#[test]
fn the_family_of_every_traversal_and_width_is_in_the_table() {
    for preset in PRESETS {
        for traversal in Traversal::all() {
            for width in Width::all() {
                let family = Strategy { traversal, width, ..preset.strategy }.family();
                let is_listed = FAMILIES.iter().any(|listed| std::ptr::eq(*listed, family));
                assert!(is_listed, "{}: FAMILIES lacks the family {}", preset.name, family.name);
            }
        }
    }
}

#[test]
fn a_program_has_the_kernels_of_its_family_and_takes_their_parameters_from_here() {
    for strategy in strategies() {
        let spec = spec(&strategy);
        for (name, list) in kernels_in(&spec.source) {
            assert_eq!(list, format!("{}_PARAMETERS", name.to_uppercase()));
        }
        let compiled = preprocess(&spec.source, &spec.options, &BTreeMap::new());
        let compiled = compiled.unwrap_or_else(|error| panic!("{error}")).text();
        let actual: BTreeSet<_> = kernels_in(&compiled).into_keys().collect();
        let kernels = strategy.family().kernels.iter().filter(|kernel| strategy.holds(kernel.when));
        let named: BTreeSet<_> = kernels.map(|kernel| kernel.name).collect();
        assert_eq!(actual, named, "{strategy}");
    }
}

/// A frame may have more than 2^31 rays, and more than 2^31 values in its heap.
#[test]
fn kernels_count_in_unsigned_numbers() {
    let kernels = FAMILIES.iter().flat_map(|family| family.kernels);
    let parameters = kernels.flat_map(|kernel| kernel.parameters.iter().copied().flatten());
    let counters: Vec<_> =
        parameters.filter(|of| ["queued", "heap_top", "rough_counter"].contains(&of.name)).collect();
    assert!(counters.len() >= 7, "{counters:?}");
    assert!(counters.iter().all(|of| of.of_type.contains(" uint *")), "{counters:?}");
}

#[test]
fn every_define_has_a_value_and_is_used_by_its_family() {
    let mut uses = BTreeMap::new();
    for family in FAMILIES {
        let members: Vec<_> =
            strategies().into_iter().filter(|strategy| std::ptr::eq(strategy.family(), family)).collect();
        let with = |workload| members.iter().map(move |of| spec_for(&Sources::Embedded, of, workload));
        let of_scenes =
            [TEXTURED, CUT_OUT, SOFT, COLOURED, AREA_LIT, HALF_LIGHT, ENVIRONMENT].into_iter().flat_map(with);
        let texts: Vec<_> = members.iter().map(spec).chain(of_scenes).collect();
        for (_, name) in family.defines.iter().copied().flatten() {
            let option = format!("-D {name}=");
            let given = |spec: &ProgramSpec| spec.options.contains(&option);
            let programs: Vec<_> = texts.iter().filter(|spec| given(spec)).collect();
            let used = programs.iter().any(|spec| uses_define(&spec.source, name));
            assert!(used || programs.is_empty(), "{} has no use for {name}", family.name);
            uses.entry(*name).or_insert(false).bitor_assign(used);
        }
    }
    assert!(uses.values().all(|used| *used), "{uses:?}");
}

/// In an `#if`, a macro that is not defined counts as 0, so the compiler would not report a missing define.
#[test]
fn a_kernel_file_asks_for_each_define() {
    let read = |name: &str| Sources::Embedded.read(name).unwrap_or_else(|error| panic!("{error}"));
    let text: String = Sources::names().into_iter().map(read).collect();
    for (_, name) in FAMILIES.iter().flat_map(|family| family.defines.iter().copied().flatten()) {
        let asks = text.contains(&format!("#ifndef {name}\n")) || text.contains(&format!("!defined({name})"));
        assert!(asks, "no #error for a missing {name}");
    }
}

#[test]
fn every_file_belongs_to_a_family_or_serves_all() {
    let mut named: BTreeSet<String> = strategies().iter().flat_map(|strategy| spec(strategy).files).collect();
    let others = ["probe/", "peak/", "anchor/", "display/"];
    named.extend(
        Sources::names()
            .into_iter()
            .filter(|name| others.iter().any(|folder| name.starts_with(folder)))
            .map(str::to_owned),
    );
    named.insert("common/lanes.cl".to_owned());
    // Only programs of scenes with textures, cut-outs, colours of corners, soft lights, area lights, a sky,
    // smooth shadows or several samples use the files that are added below.
    let of_scenes = ["textures", "cutouts", "corner_colours", "area_light"];
    named.extend(of_scenes.map(|name| format!("common/{name}.cl")));
    named.extend(PICTURE_FILES.map(str::to_owned));
    named.extend(SOFT_FILES.map(str::to_owned));
    named.extend(SAMPLE_FILES.map(str::to_owned));
    named.extend([HALF_LIGHT_FILE, "common/pixel_rows.cl"].map(str::to_owned));
    named.insert("common/smooth_shadows.cl".to_owned());
    named.extend(["tile_cpu/sky.cl", "tile_cpu/single_ray.cl"].map(str::to_owned));
    named.extend(["tile_cpu/shade_once.cl", "tile_cpu/light_once.cl"].map(str::to_owned));
    let all: BTreeSet<_> = Sources::names().into_iter().map(str::to_owned).collect();
    assert_eq!(all, named);
}

#[test]
fn a_program_holds_no_file_of_another_family() {
    for strategy in strategies() {
        let own = match strategy.family().name {
            "exhaustive" | "bvh" => &["common/", "cast/"][..],
            "raster" => &["common/", "cast/", "raster/"],
            // With `intersector = watertight`, the family `tile-cpu` uses the watertight test of `cl/cast/`
            // for a vector of rays if there is no coordinate axis along which all rays of the vector run in
            // the same direction. The watertight test of `cl/cast/` chooses an axis for each ray.
            "tile-cpu" => &["common/", "tile_cpu/", "cast/intersect/watertight.cl"],
            _ => &["common/", "tile_gpu/"],
        };
        for file in spec(&strategy).files {
            assert!(own.iter().any(|folder| file.starts_with(folder)), "{strategy}: {file}");
        }
    }
}

/// The kernel files that only programs for a sky with a picture use.
const PICTURE_FILES: [&str; 2] = ["common/environment.cl", "common/show_sky.cl"];
const SOFT_FILES: [&str; 4] = ["common/soft.cl", "cast/soft.cl", "tile_cpu/soft.cl", "tile_gpu/soft.cl"];
const SAMPLE_FILES: [&str; 2] = ["common/samples.cl", "common/mark_rough.cl"];
const HALF_LIGHT_FILE: &str = "common/half_light.cl";

#[test]
fn textures_and_soft_lights_are_in_the_programs_of_scenes_that_have_them_and_in_no_others() {
    let [textures, cutouts] = ["common/textures.cl", "common/cutouts.cl"].map(str::to_owned);
    let soft =
        |spec: &ProgramSpec| spec.files.iter().filter(|file| SOFT_FILES.contains(&file.as_str())).count();
    for strategy in strategies() {
        let [without, textured, lit] =
            [Workload::CUBE, TEXTURED, SOFT].map(|of| spec_for(&Sources::Embedded, &strategy, of));
        assert!(!without.files.contains(&textures) && soft(&without) == 0, "{strategy}");
        let taken = [Fact::Textured, Fact::Soft].map(|fact| strategy.family().takes(fact));
        assert_eq!([textured.files.contains(&textures), soft(&lit) == 2], taken, "{strategy}");
        let coloured = spec_for(&Sources::Embedded, &strategy, COLOURED);
        let has_colours =
            |spec: &ProgramSpec| spec.files.iter().any(|file| file == "common/corner_colours.cl");
        assert_eq!([&without, &coloured].map(has_colours), [false, true], "{strategy}");
        let cut_out = spec_for(&Sources::Embedded, &strategy, CUT_OUT);
        let has_cutouts = [&textured, &cut_out].map(|spec| spec.files.contains(&cutouts));
        assert_eq!(has_cutouts, [false, taken[0]], "{strategy}");
        let pictured = spec_for(&Sources::Embedded, &strategy, ENVIRONMENT);
        let has_all =
            |spec: &ProgramSpec| PICTURE_FILES.iter().all(|file| spec.files.iter().any(|own| own == file));
        assert_eq!([&lit, &pictured].map(has_all), [false, taken[1]], "{strategy}");
        let many = Workload { many_samples: true, ..Workload::CUBE };
        let [many, half] = [many, HALF_LIGHT].map(|of| spec_for(&Sources::Embedded, &strategy, of).files);
        assert!(SAMPLE_FILES.iter().all(|file| many.iter().any(|own| own == file)), "{strategy}");
        let one = without.files;
        assert!(SAMPLE_FILES.iter().all(|file| one.iter().all(|own| own != file)), "{strategy}");
        let of_half = [&lit.files, &half].map(|files| files.iter().any(|own| own == HALF_LIGHT_FILE));
        assert_eq!(of_half, [false, taken[1]], "{strategy}");
    }
    for fact in [Fact::Textured, Fact::Soft] {
        let without: Vec<_> = FAMILIES.iter().filter(|family| !family.takes(fact)).map(|f| f.name).collect();
        assert_eq!(without, ["raster"]);
    }
}

#[test]
fn smooth_shadows_are_in_the_programs_of_scenes_that_have_them_and_in_no_others() {
    for strategy in strategies() {
        let has = |workload| {
            let files = spec_for(&Sources::Embedded, &strategy, workload).files;
            files.iter().any(|file| file == "common/smooth_shadows.cl")
        };
        assert_eq!([SOFT, SMOOTH_SHADOWS].map(has), [false, true], "{strategy}");
    }
}

#[test]
fn area_lights_are_in_the_programs_of_scenes_that_have_them_and_in_no_others() {
    let point = Workload { area_lights: true, ..Workload::CUBE };
    for strategy in strategies() {
        let has = |of| {
            let spec = spec_for(&Sources::Embedded, &strategy, of);
            let floats = if spec.options.contains("-D LIGHT_FLOATS=16") { 16 } else { 6 };
            (spec.files.iter().any(|file| file == "common/area_light.cl"), floats)
        };
        assert_eq!([Workload::CUBE, SOFT].map(has), [(false, 6); 2], "{strategy}");
        assert_eq!([point, AREA_LIT].map(has), [(true, 16); 2], "{strategy}");
    }
}

/// If programs without soft light at half resolution had the defines of this light, these programs would be
/// compiled again whenever a value of such a define changes.
#[test]
fn the_defines_of_light_at_half_resolution_are_in_its_programs_alone() {
    for strategy in PRESETS.iter().map(|preset| preset.strategy).filter(|of| of.family().takes(Fact::Soft)) {
        let [whole, half] = [SOFT, HALF_LIGHT].map(|of| spec_for(&Sources::Embedded, &strategy, of).options);
        for name in ["HALF_LIGHT_SHARPNESS", "INTERLEAVED"] {
            let given = [&whole, &half].map(|options| options.contains(&format!("-D {name}=")));
            assert_eq!(given, [false, true], "{strategy}: {name}");
        }
    }
}

#[test]
fn a_value_that_is_a_file_is_in_the_program_and_no_other_of_its_axis_is() {
    for strategy in strategies() {
        let files = spec(&strategy).files;
        for axis in ["vectors", "triangles", "layout", "shading", "intersect"] {
            let in_folder: Vec<_> = files.iter().filter(|file| file.contains(&format!("/{axis}/"))).collect();
            let own = |file: &&&String| {
                let value = file.rsplit('/').next().unwrap_or_default().trim_end_matches(".cl");
                strategy.axes().iter().any(|(_, own)| own.replace('-', "_").starts_with(value))
            };
            assert_eq!(in_folder.iter().filter(own).count(), in_folder.len(), "{strategy}: {in_folder:?}");
        }
    }
}

#[test]
fn a_family_takes_the_values_of_its_list_or_of_its_files() {
    let take = |values: Supported, has_file: bool, holds: bool| values.take("a", |_| has_file, |_| holds);
    assert!(take(Supported::Only(&["a"]), false, false) && !take(Supported::Only(&["b"]), true, false));
    assert!(!take(Supported::AllBut(&["a"]), true, false) && take(Supported::AllBut(&["b"]), false, false));
    let files = |but| {
        [(true, false), (true, true), (false, false)]
            .map(|(has, holds)| take(Supported::FilesIn("x", but), has, holds))
    };
    assert_eq!(files(None), [true, true, false]);
    assert_eq!(files(Some(Fact::Planes)), [true, false, false]);
}

#[test]
fn a_family_has_one_main_kernel_for_each_way_to_cast() {
    for family in FAMILIES {
        for role in [Role::Frame, Role::Primary] {
            assert!(
                family.kernels.iter().filter(|kernel| kernel.role == role).count() <= 1,
                "{}",
                family.name
            );
        }
        assert!(family.kernel(Role::Primary).is_some() && family.kernel(Role::Shade).is_some());
    }
    for name in ["cast_frame", "cast_primary", "raster_depth", "tile_frame", "tile_primary", "tile_cast"] {
        assert!(is_main(name), "{name}");
    }
    for name in [
        "prepare_origins",
        "tile_prepare",
        "tile_shadow",
        "shade_nearest",
        "raster_nearest",
        "cast_rays",
        "x",
    ] {
        assert!(!is_main(name), "{name}");
    }
}
