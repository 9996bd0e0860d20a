//! The folders in which each kernel file defines a value of an axis, and the values that the files in these
//! folders define.

use crate::entry::entry;
use crate::error::{Error, Result};
use crate::sources::Sources;
use crate::strategy::AXES;

/// The folders of values, each with the axis to which its files belong. A value of an axis may have kernel
/// files in several folders, for different kernel families. If a value has several files, the file in the
/// first of these folders contains the header.
pub const FOLDERS: [(&str, &str); 8] = [
    ("cast/vectors/", "vectors"),
    ("cast/triangles/", "triangles"),
    ("cast/layout/", "layout"),
    ("tile_cpu/layout/", "layout"),
    ("cast/shading/", "shading"),
    ("cast/intersect/", "intersector"),
    ("tile_cpu/intersect/", "intersector"),
    ("tile_gpu/intersect/", "intersector"),
];

/// A value of an axis, before its header is read: the axis, the value's name, and the folders that contain a
/// kernel file of the value.
pub struct Named {
    pub axis: &'static str,
    pub name: String,
    pub folders: Vec<&'static str>,
}

impl Named {
    /// Returns the kernel files that define the value. The first of these files contains the header.
    pub fn files(&self) -> impl Iterator<Item = String> {
        self.folders.iter().map(move |folder| format!("{folder}{}.cl", self.name.replace('-', "_")))
    }
}

/// Returns the name of the value that a file in `folder` defines; `None` if the file does not lie directly in
/// `folder`.
pub fn value_in(folder: &str, file: &str) -> Option<String> {
    let stem = file.strip_prefix(folder)?.strip_suffix(".cl")?;
    (!stem.contains('/')).then(|| stem.replace('_', "-"))
}

/// Returns the values that have files among `files`, in the order of their axes and names.
pub fn named(files: &[String]) -> Vec<Named> {
    let mut all: Vec<Named> = Vec::new();
    for (folder, axis) in FOLDERS {
        for name in files.iter().filter_map(|file| value_in(folder, file)) {
            let is_it = |named: &Named| named.axis == axis && named.name == name;
            let new = || Named { axis, name: name.clone(), folders: Vec::new() };
            entry(&mut all, is_it, new).folders.push(folder);
        }
    }
    let position = |axis: &str| AXES.iter().position(|info| info.name == axis);
    all.sort_by(|a, b| (position(a.axis), &a.name).cmp(&(position(b.axis), &b.name)));
    all
}

/// Returns the names of an axis's values; an empty list if there is no such axis. `all` contains the values
/// (of any axis) that kernel files define.
pub fn names_of(all: &[Named], axis: &str) -> Vec<String> {
    let listed = AXES.iter().filter(|info| info.name == axis).flat_map(|info| info.listed);
    let files = all.iter().filter(|named| named.axis == axis).map(|named| named.name.clone());
    listed.map(|(name, _)| (*name).to_owned()).chain(files).collect()
}

/// Refuses values whose names cannot be written in `--strategy`, in TOML and in records.
pub fn refuse_names(sources: &Sources) -> Result<()> {
    let fits = |name: &str| name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
    for file in sources.own_files()? {
        let Some((folder, axis)) = FOLDERS.iter().find(|(folder, _)| value_in(folder, &file).is_some())
        else {
            continue;
        };
        let name = &file[folder.len()..];
        let stem = name.strip_suffix(".cl").unwrap_or(name);
        if !fits(stem) || stem.is_empty() {
            let path = sources.path_of(&file);
            let message = format!(
                "{path}: this file is a value of the axis '{axis}' and gives the value its name: before '.cl', the \
                 file's name may have only lower-case letters, digits and '_'"
            );
            let plain = stem.to_ascii_lowercase().replace(|c: char| !c.is_ascii_alphanumeric(), "_");
            return Err(Error::input(message)
                .with_help(format!("rename the file, for example to {folder}{plain}.cl")));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategy::values::fixtures::refused;

    #[test]
    fn every_file_of_a_folder_of_values_is_a_value() {
        let files: Vec<_> = Sources::names().into_iter().map(str::to_owned).collect();
        let named = named(&files);
        for (folder, axis) in FOLDERS {
            for file in files.iter().filter(|file| file.starts_with(folder)) {
                let name = value_in(folder, file).unwrap_or_default();
                let own = named.iter().find(|named| named.axis == axis && named.name == name);
                assert!(own.is_some_and(|own| own.folders.contains(&folder)), "{file}");
            }
        }
    }

    #[test]
    fn the_name_of_a_value_can_be_written_anywhere() {
        for name in ["My", "a-b", "a b", "é", "a.cl"] {
            let message = refused(&format!("cast/vectors/{name}.cl"), refuse_names).unwrap_or_default();
            assert!(
                message.contains("a value of the axis 'vectors' and gives the value its name"),
                "{name}: {message}"
            );
        }
        assert_eq!(refused("cast/vectors/my_2.cl", refuse_names), None);
        assert_eq!(refused("My/File.cl", refuse_names), None, "no axis has this folder");
    }

    #[test]
    fn a_file_in_an_inner_folder_is_no_value() {
        assert_eq!(value_in("cast/vectors/", "cast/vectors/my_2.cl").as_deref(), Some("my-2"));
        assert_eq!(value_in("cast/vectors/", "cast/vectors/inner/my_2.cl"), None);
    }
}
