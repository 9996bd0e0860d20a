//! Tests the labels of programs (hashes and values of axes) without a device. A change to a file must change
//! the hashes of the programs that include the file, and no other hashes. Two values of a strategy's axis
//! must never result in the same program and the same tree.

use super::FAMILIES;
use super::tests::{spec, spec_of, strategies};
use crate::accel::WideBvh;
use crate::program::frame_kernels;
use crate::program::preprocess::{canonical, preprocess};
use crate::scene::load_scene;
use crate::sources::Sources;
use crate::strategy::{AXES, AxisInfo, PRESETS, Strategy, Workload};
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

/// Makes a folder of kernel files that replaces one built-in file by a copy with an additional comment.
fn with_a_comment_in(file: &str) -> (tempfile::TempDir, Sources) {
    let folder = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
    let text = Sources::Embedded.read(file).unwrap_or_else(|error| panic!("{error}"));
    let path = folder.path().join(file);
    let written = std::fs::create_dir_all(path.parent().unwrap_or(folder.path()))
        .and_then(|()| std::fs::write(&path, format!("{text}// changed\n")));
    written.unwrap_or_else(|error| panic!("{file}: {error}"));
    let sources = Sources::of(Some(folder.path().to_owned())).unwrap_or_else(|error| panic!("{error}"));
    (folder, sources)
}

/// For each kernel file, checks that a change of the file changes the hashes of the presets whose programs
/// include the file, and no other hashes.
#[test]
fn a_files_change_changes_the_hash_of_what_is_made_of_it_and_no_other() {
    let presets: Vec<_> = PRESETS.iter().map(|preset| (preset.name, preset.strategy)).collect();
    let before: Vec<_> = presets.iter().map(|(_, strategy)| spec(strategy).hash()).collect();
    let made_of: Vec<_> = presets.iter().map(|(_, strategy)| spec(strategy).files).collect();
    let mut changes = 0;
    for file in Sources::names() {
        let (_folder, sources) = with_a_comment_in(file);
        for (((name, strategy), before), files) in presets.iter().zip(&before).zip(&made_of) {
            let changed = spec_of(&sources, strategy).hash() != *before;
            assert_eq!(changed, files.iter().any(|own| own == file), "{file}, {name}");
            changes += usize::from(changed);
        }
    }
    assert!(changes > 10 * PRESETS.len(), "only {changes}");
}

/// Returns everything that a value of a strategy's axis can change in the program for a fixed scene: the
/// preprocessed source, the options, and the kernels that frames need.
fn decided(strategy: &Strategy) -> String {
    let spec = spec(strategy);
    let text =
        preprocess(&spec.source, &spec.options, &BTreeMap::new()).unwrap_or_else(|error| panic!("{error}"));
    let options: Vec<_> = spec.options.split(' ').filter(|word| word.starts_with("-cl")).collect();
    format!("{options:?} {:?}\n{}", frame_kernels(strategy, &Workload::CUBE), canonical(&text.text()))
}

/// Returns the tree of a scene that is large enough for every leaf size and node width to make a difference.
fn tree(strategy: &Strategy) -> (Vec<u32>, usize) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/gourd.toml");
    let mesh = load_scene(&path).unwrap_or_else(|error| panic!("{error}")).scene.mesh;
    let tree = WideBvh::of_mesh(&mesh, strategy.node_width.children(), strategy.leaf_size.triangles());
    let tree = tree.unwrap_or_else(|error| panic!("{error}"));
    (tree.nodes.clone(), tree.stack_size())
}

/// Returns the values of a strategy's axis that the strategy's family accepts if the values on all other axes
/// stay the same.
fn taken(base: &Strategy, axis: &AxisInfo) -> Vec<(&'static str, Strategy)> {
    let changed = |value| {
        let mut strategy = *base;
        strategy.set(axis.name, value).unwrap_or_else(|error| panic!("{error}"));
        strategy
    };
    let values = axis.values().into_iter().map(|(value, _)| (value, changed(value)));
    let own = |strategy: &Strategy| std::ptr::eq(strategy.family(), base.family());
    values.filter(|(_, strategy)| strategy.contradiction().is_none() && own(strategy)).collect()
}

/// Checks, for every axis of strategies and every kernel family, all values that the family accepts: values
/// with different names must result in different programs or trees.
#[test]
fn values_of_another_name_are_another_program_or_another_tree() {
    let mut seen: HashMap<(&str, &str), usize> = HashMap::new();
    for base in strategies() {
        let family = base.family().name;
        for axis in AXES {
            let values = taken(&base, axis);
            let known = seen.entry((family, axis.name)).or_default();
            // The strategy `base` is skipped if the family accepts only one value of the axis, or accepted at
            // least as many values with an earlier `base`.
            if values.len() <= *known.max(&mut 1) {
                continue;
            }
            *known = values.len();
            let of_tree = axis.name == "leaf_size";
            let mut decided_by: HashMap<String, &str> = HashMap::new();
            for (value, strategy) in values {
                let what = if of_tree { format!("{:?}", tree(&strategy)) } else { decided(&strategy) };
                let other = decided_by.insert(what, value);
                assert_eq!(other, None, "{family}: {} = {value} is the same as", axis.name);
            }
        }
    }
    let axes = |family: &str| seen.iter().filter(|((of, _), most)| *of == family && **most > 1).count();
    for family in FAMILIES {
        assert!(axes(family.name) >= 3, "{}: {seen:?}", family.name);
    }
}
