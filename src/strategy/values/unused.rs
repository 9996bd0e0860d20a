//! Refuses the user's kernel files that have no effect, with advice on the path or the folder that is meant.

use super::folders::{FOLDERS, named, names_of, value_in};
use super::includes::{Include, has_name_of, includes_of_all, wrong_include};
use crate::error::{Error, Result, nearest};
use crate::reader::folder_of;
use crate::sources::{Sources, meant_file};
use std::path::Path;

/// Refuses a kernel file that has no effect: the file replaces no built-in file, defines no value of an axis,
/// and is included by no file that has an effect. If raycl accepted such a file, the user would not notice
/// that the file has no effect.
pub fn refuse_unused(sources: &Sources) -> Result<()> {
    let Sources::Folder(folder) = sources else { return Ok(()) };
    let mut unknown = sources.own_files()?;
    unknown.retain(|file| !is_known(file));
    if unknown.is_empty() {
        return Ok(());
    }
    let (files, includes) = (sources.files()?, includes_of_all(sources)?);
    let all = named(&files);
    let includes_file = |include: &Include, file: &str| include.may_be_of(file, |axis| names_of(&all, axis));
    let used = files_with_effect(&files, &includes, includes_file);
    unknown.retain(|file| !used.contains(&file.as_str()));
    // Files that are included only by a file without effect have no effect either. If possible, the error therefore
    // names a file that no file includes.
    let is_included = |file: &String| includes.iter().any(|include| includes_file(include, file));
    match unknown.iter().find(|file| !is_included(file)).or(unknown.first()) {
        Some(file) => Err(unused(folder, file, &includes, is_included(file))),
        None => Ok(()),
    }
}

/// Returns the files that have an effect: the built-in files, the files that define values of axes, and all
/// files that one of these files includes, directly or through other files. `includes_file` returns true if
/// an `#include` may include a file.
fn files_with_effect<'a>(
    files: &'a [String],
    includes: &[Include],
    includes_file: impl Fn(&Include, &str) -> bool,
) -> Vec<&'a str> {
    let (mut used, mut others): (Vec<&str>, Vec<&str>) =
        files.iter().map(String::as_str).partition(|file| is_known(file));
    let mut done = 0;
    while let Some(file) = used.get(done).copied() {
        let own: Vec<_> = includes.iter().filter(|include| include.file == file).collect();
        let (reached, left): (Vec<&str>, Vec<&str>) =
            others.into_iter().partition(|other| own.iter().any(|include| includes_file(include, other)));
        others = left;
        used.extend(reached);
        done += 1;
    }
    used
}

/// Returns true if a kernel file defines a value of an axis or has the path of a built-in file.
fn is_known(file: &str) -> bool {
    Sources::names().contains(&file) || FOLDERS.iter().any(|(folder, _)| value_in(folder, file).is_some())
}

/// Returns the error about a kernel file that has no effect. `is_included` is true if another file, which has
/// no effect either, includes this file.
fn unused(folder: &Path, file: &str, includes: &[Include], is_included: bool) -> Error {
    let (path, folder_name) = (folder.join(file), folder.display());
    let by = if is_included { "only files without effect include it" } else { "no file includes it" };
    let message = format!("has no effect: it replaces no built-in file, it is no value of an axis, and {by}");
    let error = Error::input(format!("{} {message}", path.display()));
    if let Some(include) = wrong_include(file, includes) {
        let Include { path, location, .. } = include;
        return error.with_help(if has_name_of(include, file) {
            format!(
                "{location} includes \"{path}\", but paths in #include are relative to {folder_name}: write #include \"{file}\""
            )
        } else {
            format!("{location} includes \"{path}\", which does not exist: did you mean \"{file}\"?")
        });
    }
    if file.starts_with("cl/") {
        let inner = folder.join("cl");
        let inner = inner.display();
        return error.with_help(format!(
            "{inner} is a folder of kernels inside the folder that --cl-dir names: write --cl-dir {inner}, or remove {inner}"
        ));
    }
    error.with_help(match outer_folder(folder, file) {
        Some(outer) => format!(
            "{folder_name} is only a part of a folder laid out like raycl's cl/: write --cl-dir {}",
            outer.display()
        ),
        None => elsewhere(file),
    })
}

/// Returns the folder that the user should have named with `--cl-dir` instead of `folder`. The folder that is
/// returned contains `folder`. Relative to the returned folder, the file's path is the path of a built-in
/// file, or of a file that defines a value of an axis. Returns `None` if there is no such folder.
fn outer_folder<'a>(folder: &'a Path, file: &str) -> Option<&'a Path> {
    let (mut outer, mut inner) = (folder, file.to_owned());
    while !is_known(&inner) {
        inner = format!("{}/{inner}", outer.file_name()?.to_str()?);
        outer = folder_of(outer);
    }
    Some(outer)
}

/// Returns the help for a kernel file that has no effect: the path that the user probably meant, if there is
/// one, and the folders in which files define values of axes.
fn elsewhere(file: &str) -> String {
    let folders = FOLDERS.map(|(folder, _)| folder);
    let expected = format!("the file of an axis's value lies in one of the folders {}", folders.join(", "));
    let (own_folder, name) = file.split_at(file.rfind('/').map_or(0, |at| at + 1));
    let as_value = nearest(own_folder, folders).map(|folder| format!("{folder}{name}"));
    let candidates = Sources::names().into_iter().chain(as_value.as_deref());
    match meant_file(file, candidates) {
        Some(meant) => format!("did you mean {meant}? {expected}"),
        None => expected,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategy::values::fixtures::{checked, refused, refused_of};

    #[test]
    fn a_kernel_file_in_a_wrong_folder_is_sent_to_the_right_one() {
        for (folder, file, remedy) in [
            ("k", "cast/moller_trumbore.cl", "did you mean cast/intersect/moller_trumbore.cl? the file of"),
            ("k", "cast/layuot/suop.cl", "did you mean cast/layout/suop.cl? the file of"),
            ("k", "cast/exhaustve.cl", "did you mean cast/exhaustive.cl? the file of"),
            ("k", "cast/my_own.cl", "the file of an axis's value lies in one of the folders cast/vectors/,"),
            ("k", "cl/cast/layout/soup.cl", "k/cl is a folder of kernels inside the folder that --cl-dir"),
            ("k/cast", "intersect/mine.cl", "k/cast is only a part of a folder laid out like raycl's cl/: "),
        ] {
            let error = unused(Path::new(folder), file, &[], false);
            assert!(error.remedy().starts_with(remedy), "{file}: {}", error.remedy());
        }
        for (folder, file, outer) in [
            ("k/cast", "intersect/mine.cl", Some("k")),
            ("cast/intersect", "mine.cl", Some(".")),
            ("k/cast", "mine.cl", None),
        ] {
            assert_eq!(outer_folder(Path::new(folder), file), outer.map(Path::new), "{folder}");
        }
        let error = unused(Path::new("k/cast"), "intersect/mine.cl", &[], false);
        assert!(error.remedy().ends_with(": write --cl-dir k"), "{}", error.remedy());
    }

    #[test]
    fn a_wrong_path_in_an_include_is_reported_with_its_line() {
        let value = "cast/vectors/mine.cl";
        for path in ["../helper.cl", "helper.cl"] {
            let text = format!("int a;\n#include \"{path}\"\n");
            let error = refused_of(&[(value, &text), ("cast/helper.cl", "")]);
            assert!(
                error.to_string().contains("cast/helper.cl has no effect: it replaces no built-in file"),
                "{error}"
            );
            let line = format!("{value}, line 2 includes \"{path}\", but paths in #include are relative to ");
            let help = error.remedy();
            assert!(help.contains(&line) && help.ends_with("write #include \"cast/helper.cl\""), "{help}");
        }
        // The user may mean another file than the one with the similar name, so the help asks only whether
        // the similar name is meant.
        let error = refused_of(&[(value, "int a;\n#include \"cast/helpr.cl\"\n"), ("cast/helper.cl", "")]);
        let asked =
            "line 2 includes \"cast/helpr.cl\", which does not exist: did you mean \"cast/helper.cl\"?";
        assert!(error.remedy().ends_with(asked), "{}", error.remedy());
        // raycl cannot follow other forms of #include.
        for text in ["#include <cast/helper.cl>\n", "#define H \"cast/helper.cl\"\n#include H\n"] {
            let error = refused_of(&[(value, text), ("cast/helper.cl", "")]);
            assert!(error.to_string().ends_with("does not support this form of #include"), "{error}");
            assert!(error.remedy().contains("write #include \"FOLDER/FILE.cl\""), "{}", error.remedy());
        }
    }

    #[test]
    fn a_file_that_has_no_effect_is_refused() {
        let message = refused("cast/other.cl", refuse_unused).unwrap_or_default();
        assert!(message.contains("other.cl has no effect: it replaces no built-in file"), "{message}");
        assert_eq!(refused("cast/vectors/mine.cl", refuse_unused), None, "a value");
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join("cast/vectors")).unwrap();
        std::fs::write(folder.path().join("cast/other.cl"), "int a;\n").unwrap();
        std::fs::write(folder.path().join("cast/vectors/mine.cl"), "#include \"cast/other.cl\"\n").unwrap();
        assert!(refuse_unused(&Sources::Folder(folder.path().to_owned())).is_ok(), "a value includes it");
    }

    #[test]
    fn an_axis_in_an_includes_path_stands_for_each_of_its_values() {
        let value = Sources::Embedded.read("cast/vectors/private.cl").unwrap();
        let text = format!("{value}\n#include \"my/a_{{vectors}}.cl\"\n");
        let with = |file: &str| checked(&[("cast/vectors/mine.cl", &text), (file, "int a;\n")]);
        for file in ["my/a_private.cl", "my/a_mine.cl"] {
            assert!(with(file).is_ok(), "{file}");
        }
        for file in ["my/a_privat.cl", "my/private.cl", "my/a_watertight.cl", "your/a_private.cl"] {
            let message = with(file).unwrap_err().to_string();
            assert!(
                message.contains(&format!("{file} has no effect: it replaces no built-in file")),
                "{message}"
            );
        }
        // In the paths of files, names of values have underscores instead of dashes.
        let files = [("cast/vectors/my_own.cl", text.as_str()), ("my/a_my_own.cl", "int a;\n")];
        assert!(checked(&files).is_ok());
    }

    /// The built-in file cast/parts.cl includes "cast/vectors/{vectors}.cl", which is the path of no file.
    #[test]
    fn an_include_with_an_axis_is_no_wrong_path() {
        let error = refused_of(&[("my/vectors.cl", "int a;\n")]);
        assert!(!error.remedy().contains("which does not exist"), "{}", error.remedy());
    }

    #[test]
    fn files_that_only_include_each_other_have_no_effect() {
        let (one, two) =
            (("my/one.cl", "#include \"my/two.cl\"\n"), ("my/two.cl", "#include \"my/one.cl\"\n"));
        let error = refused_of(&[one, two]);
        let said = "my/one.cl has no effect: it replaces no built-in file, it is no value of an axis, and only files without effect";
        assert!(error.to_string().contains(said), "{error}");
        // If one file includes the other, the error is about the file that nothing includes.
        let error = refused_of(&[("my/a.cl", "int a;\n"), ("my/z.cl", "#include \"my/a.cl\"\n")]);
        assert!(error.to_string().contains("my/z.cl has no effect"), "{error}");
        assert!(error.to_string().ends_with("and no file includes it"), "{error}");
    }
}
