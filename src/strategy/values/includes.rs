//! Reads the lines `#include "path"` of kernel files.

use crate::error::{Result, nearest};
use crate::sources::{SourceLine, Sources, lines, stem};

/// A line `#include "path"` of a kernel file.
pub struct Include {
    /// The path of the included file, as the line states it.
    pub path: String,
    /// The kernel file in which the line occurs.
    pub file: String,
    /// The file that has this line, and the number of the line, as messages show them.
    pub location: String,
    /// True if a file has this path, or if the path contains an axis in braces.
    is_there: bool,
}

impl Include {
    /// Returns true if this path may be the path of `file`. An axis in braces stands for each of the axis's
    /// values, whose names `names_of` returns.
    pub fn may_be_of(&self, file: &str, names_of: impl Fn(&str) -> Vec<String>) -> bool {
        let braces =
            self.path.split_once('{').and_then(|(before, rest)| Some((before, rest.split_once('}')?)));
        let Some((before, (axis, after))) = braces else { return self.path == file };
        let value = file.strip_prefix(before).and_then(|rest| rest.strip_suffix(after));
        value.is_some_and(|value| names_of(axis).iter().any(|name| name.replace('-', "_") == value))
    }
}

/// Returns every `#include` of the built-in kernel files and of the kernel files in the user's folder.
pub fn includes_of_all(sources: &Sources) -> Result<Vec<Include>> {
    let files = sources.files()?;
    let mut all = Vec::new();
    for file in &files {
        let own = includes(&sources.path_of(file), &sources.read(file)?)?;
        all.extend(own.into_iter().map(|include| Include { file: file.clone(), ..include }));
    }
    for include in &mut all {
        include.is_there = include.path.contains('{') || files.contains(&include.path);
    }
    Ok(all)
}

/// Returns the path and the location of each `#include` in a kernel file, except in comments.
fn includes(path: &str, text: &str) -> Result<Vec<Include>> {
    let lines = (1..).zip(lines(path, text)?);
    let include = |(number, line): (usize, SourceLine<'_>)| {
        let location = format!("{path}, line {number}");
        Some(Include { path: line.includes?.to_owned(), file: String::new(), location, is_there: false })
    };
    Ok(lines.filter_map(include).collect())
}

/// Returns true if a kernel file includes the file `other`, directly or through other files. An `#include`
/// path with the name of an axis in braces may stand for any file, so the function also returns true if it
/// finds a path with braces.
pub fn includes_file(sources: &Sources, file: &str, other: &str) -> Result<bool> {
    let mut files = vec![(file.to_owned(), sources.read(file)?)];
    let mut done = 0;
    while let Some((name, text)) = files.get(done).cloned() {
        for (number, line) in (1..).zip(lines(&sources.path_of(&name), &text)?) {
            match line.includes {
                Some(path) if path == other || path.contains('{') => return Ok(true),
                Some(path) if files.iter().all(|(known, _)| known != path) => {
                    let included = sources.read(path);
                    let included =
                        included.map_err(|error| sources.at_include(error, path, &name, number))?;
                    files.push((path.to_owned(), included));
                }
                _ => {}
            }
        }
        done += 1;
    }
    Ok(false)
}

/// Returns the line that probably includes a file by a wrong path. The path in this line names no file, and the path's
/// last part is the file's name or a similar name.
pub fn wrong_include<'a>(file: &str, includes: &'a [Include]) -> Option<&'a Include> {
    let mut wrong = includes.iter().filter(|include| !include.is_there);
    let meant = nearest(stem(file), wrong.clone().map(|include| stem(&include.path)))?;
    wrong.find(|include| stem(&include.path) == meant)
}

/// Returns true if the last part of an include's path is the name of this file. If the path's last part is
/// only similar to the file's name, the include may mean another file.
pub fn has_name_of(include: &Include, file: &str) -> bool {
    stem(&include.path) == stem(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_include_in_a_comment_has_no_effect() {
        let included = |text: &str| -> Vec<_> {
            let includes = includes("a.cl", text).unwrap();
            includes.into_iter().map(|include| (include.path, include.location)).collect()
        };
        let second = ("b.cl".to_owned(), "a.cl, line 2".to_owned());
        assert_eq!(included("int a;\n#include \"b.cl\"\n"), [second]);
        assert!(included("/*\n#include \"b.cl\"\n*/\n").is_empty());
    }
}
