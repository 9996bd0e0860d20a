//! Documents that name code agree with the code: the table of kernels in ARCHITECTURE.md, the table of the parts of a
//! sample in docs/methodology.md, and the steps to a new traversal in CONTRIBUTING.md.

use crate::binary::repository;
use crate::common::one_preset_of_each_family;
use crate::schemas::{names, table};
use raycl::program::Sources;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::read_to_string;

/// A kernel's name, and its file.
type Place = (String, String);
/// The families to which a kernel belongs, and the kernel's role.
type Use = (BTreeSet<String>, String);

/// The role of a kernel that belongs to no family.
const NO_ROLE: &str = "none";

/// Returns all kernels in cl/.
fn kernels() -> BTreeSet<Place> {
    let of_file = |file: &'static str| {
        let text = Sources::Embedded.read(file).expect("a kernel file");
        let heads = text.split("__kernel ").skip(1).filter_map(|rest| rest.split_once("void "));
        let found = heads.filter_map(|(_, rest)| rest.split('(').next());
        found.map(|name| (name.to_owned(), format!("cl/{file}"))).collect::<Vec<_>>()
    };
    Sources::names().into_iter().flat_map(of_file).collect()
}

/// Returns all kernels in cl/, each with its families and its role in the manifest.
fn kernels_in_families() -> BTreeMap<Place, Use> {
    let unused = |place| (place, (BTreeSet::new(), NO_ROLE.to_owned()));
    let mut all: BTreeMap<Place, Use> = kernels().into_iter().map(unused).collect();
    for preset in one_preset_of_each_family() {
        let family = preset.strategy.family();
        let folder = family.entry.split('/').next().expect("a folder");
        for kernel in family.kernels {
            let places: Vec<Place> = all.keys().filter(|(name, _)| name == kernel.name).cloned().collect();
            // If kernels of two families have the same name, each of these kernels is in the folder of its
            // family.
            let is_own = |(_, file): &&Place| places.len() == 1 || file.starts_with(&format!("cl/{folder}/"));
            let place = places.iter().find(is_own).unwrap_or_else(|| panic!("no kernel {}", kernel.name));
            let (families, role) = all.get_mut(place).expect("a kernel");
            let own_role = format!("{:?}", kernel.role);
            assert!(families.is_empty() || *role == own_role, "{} has two roles", kernel.name);
            families.insert(family.name.to_owned());
            *role = own_role;
        }
    }
    all
}

#[test]
fn the_table_of_kernels_is_that_of_the_manifest_and_of_the_kernel_files() {
    let rows = table("ARCHITECTURE.md", "\n| kernel | file |");
    let listed = rows.iter().map(|row| {
        let [kernel, file] = [&row[0], &row[1]].map(|cell| names(cell).concat());
        let families: BTreeSet<String> = names(&row[2]).into_iter().collect();
        let role = row[3].trim_matches('`').to_owned();
        ((kernel, file), (families, role))
    });
    let listed: BTreeMap<Place, Use> = listed.collect();
    assert_eq!(listed.len(), rows.len(), "a kernel is listed twice");
    assert_eq!(listed, kernels_in_families());
}

/// In the table of the parts of a sample (docs/methodology.md), the last cell of a row names files. After
/// each file, the cell names functions that this file contains.
#[test]
fn the_table_of_the_parts_of_a_sample_names_functions_that_are_there() {
    let rows = table("docs/methodology.md", "\n| part | sample |");
    let mut seen = 0;
    for row in &rows {
        let mut source: Option<String> = None;
        for name in names(row.last().expect("a cell")) {
            if name.ends_with(".rs") {
                let text = read_to_string(repository(&format!("src/{name}")));
                source = Some(text.unwrap_or_else(|error| panic!("src/{name}: {error}")));
                continue;
            }
            let function = name.rsplit("::").next().expect("a name");
            let is_there = source.as_ref().is_some_and(|text| {
                [format!("fn {function}("), format!("fn {function}<")].iter().any(|head| text.contains(head))
            });
            assert!(is_there, "{row:?}: there is no function {name}");
            seen += 1;
        }
    }
    assert!(seen > 15, "{seen}");
}

/// The steps to a new traversal (CONTRIBUTING.md) name tests, and the files that contain these tests. A name
/// with at least four underscores is that of a test, or of a function for tests.
#[test]
fn the_steps_to_a_new_traversal_name_tests_that_are_there() {
    let text = read_to_string(repository("CONTRIBUTING.md")).expect("the page");
    let section = text.split_once("\n## A new traversal\n").expect("the section").1;
    let named = names(section.split("\n## ").next().expect("the section"));
    let files = named.iter().filter(|name| name.ends_with(".rs"));
    let read = |file: &String| read_to_string(repository(file)).unwrap_or_else(|why| panic!("{file}: {why}"));
    let sources: String = files.map(read).collect();
    let tests: Vec<_> = named.iter().filter(|name| name.matches('_').count() >= 4).collect();
    assert!(tests.len() > 10, "{tests:?}");
    for test in tests {
        assert!(sources.contains(&format!("fn {test}()")), "no file of the section has {test}");
    }
}
