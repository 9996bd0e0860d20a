//! Reads MTL files. raycl checks each line, so that notes can name the line. The crate `tobj` then reads the checked
//! lines with Kd, Ks and Ns.

use super::Permitted;
use super::asked::{Asked, Wish};
use super::flaws::{Definition, FileFlaws, Flaws, LineFlaws};
use super::namesakes::Namesakes;
use super::text::{
    Chunk, Mistake, Seen, Source, keyword, possible_names, possible_paths, quoted_name, tokens, words,
};
use super::textures::{Factor, Map, Maps, paths, picture};
use super::values::{self, Unfit};
use super::wishes;
use crate::error::{Result, why_unread};
use crate::filetype::{FileType, Foreign, MTL};
use crate::reader::{self, Kind, lies_in};
use crate::scene::INPUTS;
use crate::scene::few_notes::FewNotes;
use crate::scene::material::{DEFAULT_LAMBERTIAN, Material, PAPER_SHININESS};
use crate::words::counted_are;
use glam::Vec3;
use std::collections::hash_map::Entry;
use std::collections::{BTreeSet, HashMap};
use std::fmt::Debug;
use std::mem::take;
use std::path::{Path, PathBuf};

/// The materials of all MTL files of a mesh. The material with the index 0 is the default material.
pub(super) struct Materials {
    pub list: Vec<Material>,
    /// The unsupported features of each material.
    pub asked: Vec<Asked>,
    /// The textures of each material.
    pub maps: Vec<Maps>,
    pub by_name: HashMap<String, u32>,
    /// Lines and definitions that raycl ignores or replaces.
    pub flaws: Flaws,
}

/// The rule that decides which files a mesh may read. A mesh from an unknown source must not be
/// able to read arbitrary files.
#[derive(Clone, Copy, Debug)]
pub(in crate::scene) struct Reach<'a> {
    /// The mesh's folder. Names of files in the mesh are relative to this folder.
    pub folder: &'a Path,
    /// The permissions for the mesh, such as to read files outside this folder.
    pub permitted: Permitted,
}

/// Loads all MTL files that can be loaded, and adds notes on files that cannot be loaded. If several files
/// define a material of the same name, the material of the file in the last `mtllib` line is used. If several
/// of these files are in the same line, the material of the line's first file is used. The specification of
/// OBJ demands this order of files. `is_coloured` is true if vertices have colours.
pub(super) fn load_all<'a>(
    reach: Reach<'_>,
    libraries: impl Iterator<Item = &'a String>,
    is_coloured: bool,
    notes: &mut Vec<String>,
) -> Result<Materials> {
    let mut loader = Loader::new(is_coloured);
    // The indices of the files that each `mtllib` line names.
    let mut lines: Vec<Vec<usize>> = Vec::new();
    // The indices of the files that an `mtllib` line names, by the text of the line. Some programs write the
    // same `mtllib` line before each object; this map saves examining such a line again.
    let mut known: HashMap<&str, Vec<usize>> = HashMap::new();
    let mut nameless = 0;
    for library in libraries {
        nameless += usize::from(possible_names(library)[1].is_empty());
        if !known.contains_key(&**library) {
            let texts = reach.file_texts(library);
            let files =
                texts.iter().map(|text| loader.file(reach, text, notes)).collect::<Result<Vec<_>>>()?;
            known.insert(library, files.into_iter().flatten().collect());
        }
        lines.push(known[&**library].clone());
    }
    notes.extend(loader.missing.rest("MTL file"));
    notes.extend(loader.namesakes.note("MTL file", reach.permitted.quotes));
    notes.extend(
        (nameless > 0).then(|| format!("{} ignored", counted_are(nameless, "`mtllib` line without a name"))),
    );
    let order: Vec<usize> = lines.into_iter().rev().flatten().collect();
    Ok(loader.named(&order))
}

/// The materials and files that were loaded so far.
struct Loader {
    materials: Materials,
    /// The index in `names` of each file that was loaded.
    files: HashMap<PathBuf, usize>,
    /// The names of the materials of each file.
    names: Vec<Names>,
    /// The notes on files that cannot be loaded.
    missing: FewNotes,
    /// The files that are perhaps not those that the mesh means.
    namesakes: Namesakes,
    /// True if the vertices of the mesh have colours.
    is_coloured: bool,
}

/// The names of a file's materials, in the file's order, and the materials' indices in `Materials::list`.
#[derive(Default)]
struct Names {
    /// The names as they are in the file.
    whole: Vec<(String, u32)>,
    /// The names as they are in the file, each shortened to the text before its first word that is only `#`.
    /// A word that is only `#` certainly begins a comment (see `possible_names`). The shortened names are
    /// used only if no name in `whole` fits.
    short: Vec<(String, u32)>,
    /// True if messages may contain the names.
    quotes: bool,
    /// The file's name in messages.
    file: String,
}

impl Loader {
    fn new(is_coloured: bool) -> Self {
        let materials = Materials {
            list: vec![Material::default()],
            asked: vec![Asked::default()],
            maps: vec![Maps::default()],
            by_name: HashMap::new(),
            flaws: Flaws::default(),
        };
        Self {
            materials,
            files: HashMap::new(),
            names: Vec::new(),
            missing: FewNotes::default(),
            namesakes: Namesakes::default(),
            is_coloured,
        }
    }

    /// Loads the file that `text` names, unless it has been loaded, and returns its index in `names`. If the file
    /// cannot be loaded, adds a note and returns `None`.
    fn file(&mut self, reach: Reach<'_>, text: &str, notes: &mut Vec<String>) -> Result<Option<usize>> {
        let name = reach.existing(text).unwrap_or_else(|| possible_names(text)[1]);
        let located = reach.locate(name).and_then(|path| match self.files.get(&path) {
            Some(number) => Ok((*number, None)),
            None => Ok((self.names.len(), Some((open(&path)?, path)))),
        });
        if located.is_ok() {
            self.namesakes.look_at(reach, text, "", name);
        }
        match located {
            Ok((number, None)) => Ok(Some(number)),
            Ok((number, Some((bytes, path)))) => {
                let names = self.materials.add(reach, name, &path, &bytes, notes)?;
                self.names.push(names);
                self.files.insert(path, number);
                Ok(Some(number))
            }
            Err(reason) => {
                let note = || unusable(reach, name, &reason, self.is_coloured);
                self.missing.add(name.to_owned(), note, notes);
                Ok(None)
            }
        }
    }

    /// Returns the materials, after filling `by_name`. If several files have a material of the same name, the
    /// first file in `order` counts; within a file, the last material counts. A name as it is in a file is preferred
    /// to a shortened name (see [`Names`]). Records names whose definitions differ.
    fn named(mut self, order: &[usize]) -> Materials {
        self.materials.flaws.quotes = self.names.iter().all(|names| names.quotes);
        for part in [|names: &mut Names| take(&mut names.whole), |names: &mut Names| take(&mut names.short)] {
            let mut own: HashMap<String, Definition> = HashMap::new();
            for file in order {
                let names = &mut self.names[*file];
                for (name, index) in part(names).into_iter().rev() {
                    if self.materials.by_name.contains_key(&name) {
                        continue;
                    }
                    match own.entry(name) {
                        Entry::Occupied(kept) if self.materials.differ(kept.get().index, index) => {
                            self.materials.flaws.repeated.insert(kept.key().clone(), kept.get().clone());
                        }
                        kept => {
                            kept.or_insert_with(|| Definition { index, file: names.file.clone() });
                        }
                    }
                }
            }
            self.materials.by_name.extend(own.into_iter().map(|(name, definition)| (name, definition.index)));
        }
        self.materials
    }
}

/// Returns a note on an MTL file that cannot be used because of `reason`.
fn unusable(reach: Reach<'_>, name: &str, reason: &str, is_coloured: bool) -> String {
    let (name, hint) = match reach.permitted.quotes {
        true => (format!(" {}", quoted_name(name)), reach.other_case(possible_paths(name))),
        false => (String::new(), String::new()),
    };
    let instead = match is_coloured {
        true => "only the vertices' colours are shown".to_owned(),
        false => {
            format!("its materials are grey, with the default diffuse reflectance k_L = {DEFAULT_LAMBERTIAN}")
        }
    };
    format!("MTL file{name} {reason}{hint}: {instead}")
}

/// Reads the bytes of an MTL file. Returns an error if the file cannot be read, or if it is known to have another
/// format.
fn open(path: &Path) -> std::result::Result<Vec<u8>, String> {
    let bytes = reader::bytes(path, Kind::Materials).map_err(|error| format!("cannot be read ({error})"))?;
    match FileType::of(&bytes, bytes.len() as u64) {
        FileType::Foreign(Foreign { name, .. }) if name != MTL => Err(format!("is {name} and is not read")),
        FileType::Utf16 => Err("is UTF-16 or UTF-32 text and is not read; save it as UTF-8".to_owned()),
        _ => Ok(bytes),
    }
}

impl Reach<'_> {
    /// Returns the parts of the text after `mtllib` that each name a file. The whole text, with its spaces, is
    /// one name if a file with this name exists (the name may end before a comment). The whole text after
    /// `mtllib` is also one name if its first word neither ends in `.mtl` nor is the name of a file. Otherwise,
    /// each word of the text is the name of a file. Some programs write a blank within a name as `\ `. If the
    /// name of an existing file contains a blank that is written in this way, the text is divided only at
    /// blanks without a `\`. If there is no file with a name, raycl also tries the name without its folders.
    fn file_texts(&self, library: &str) -> Vec<String> {
        let exists = |name: &str| self.locate(name).is_ok();
        let names = possible_names(library);
        let is_whole = names.into_iter().any(exists);
        let unescaped = unescaped_words(names[2]);
        if !is_whole && unescaped.iter().any(|word| word.contains(' ') && self.existing(word).is_some()) {
            return unescaped;
        }
        let words: Vec<&str> = names[2].split_whitespace().collect();
        let is_name = |word: &str| word.to_ascii_lowercase().ends_with(".mtl") || exists(word);
        if is_whole || words.first().is_some_and(|word| !is_name(word)) {
            return vec![library.to_owned()];
        }
        words.into_iter().map(str::to_owned).collect()
    }

    /// Returns the first of the [`possible_paths`] of a text at which there is a file that the mesh may read.
    fn existing<'t>(&self, text: &'t str) -> Option<&'t str> {
        possible_paths(text).find(|path| self.locate(path).is_ok())
    }

    /// Returns true if there is a file with the name `name`, and if this file is not the file `used`. The result does
    /// not depend on whether the mesh may read the file.
    pub(super) fn is_another_file(&self, name: &str, used: &str) -> bool {
        let file = |name: &str| self.path(name).canonicalize().ok().filter(|path| path.is_file());
        file(name).is_some_and(|path| file(used) != Some(path))
    }

    /// Returns the path of the file with the name `name`, after following links. Returns an error if there is no such
    /// file, if it is not an ordinary file, or if the mesh may not read it. Adds the file to [`INPUTS`], unless the
    /// mesh may not read it.
    pub(in crate::scene) fn locate(&self, name: &str) -> std::result::Result<PathBuf, String> {
        let named = self.path(name);
        let path = named.canonicalize();
        if path.as_ref().is_ok_and(|path| !self.permits(path)) {
            return Err(OUTSIDE.to_owned());
        }
        INPUTS.add(&named);
        match path {
            Ok(path) if path.is_dir() => Err("is a folder".to_owned()),
            // Reading a pipe or a device may never end.
            Ok(path) if !path.is_file() => Err("is not an ordinary file".to_owned()),
            path => path.map_err(|error| self.why_unread(&named, &error)),
        }
    }

    /// Returns why the file at `path` could not be read. If the file is a broken link, the text names the link's target
    /// only if messages may quote the mesh, and if the mesh may read files of the link's folder.
    fn why_unread(&self, path: &Path, error: &std::io::Error) -> String {
        match self.permitted.quotes && self.permits(&path.with_file_name(".")) {
            true => why_unread(path, error),
            false => format!("cannot be read ({error})"),
        }
    }

    /// Adds a picture to [`INPUTS`]. Also adds the missing files that raycl would read instead of this picture if they
    /// existed. `names` are the possible names of the picture. Commands thus do not replace a file that the mesh names,
    /// even if raycl does not read it, such as a picture of normals. Nor do commands create such a file if it is
    /// missing, since the next command could not replace it.
    pub(in crate::scene) fn keep(&self, mut names: impl Iterator<Item = String>) {
        // The file is not read, so nobody needs to know whether it can be read.
        let _ = names.any(|name| self.locate(&name).is_ok());
    }

    /// Returns the path of the file with the name `name`, which the mesh may have written with backslashes.
    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name.replace('\\', "/"))
    }

    /// Returns the part of a note that names a file with a similar name. A name is similar if it differs from one of
    /// `names`, the possible names of a file that cannot be used, only in upper and lower case. Returns an empty text
    /// if there is no file with a similar name, or if a file has exactly one of `names`.
    pub(in crate::scene) fn other_case(&self, names: impl Iterator<Item = impl AsRef<str>>) -> String {
        let names: Vec<_> = names.map(|name| self.path(name.as_ref())).collect();
        if names.iter().any(|name| name.exists()) {
            return String::new();
        }
        let mut found = names.iter().filter_map(|name| self.in_other_case(name));
        found.next().map(|found| format!(", but there is a file {}", quoted_name(&found))).unwrap_or_default()
    }

    /// Returns the name, without folders, of a file that differs from that of `named` only in upper and lower
    /// case. Returns `None` if the folder of `named` has no such file, or if the mesh may not read files in
    /// this folder.
    fn in_other_case(&self, named: &Path) -> Option<String> {
        let (folder, wanted) = (named.parent()?, named.file_name()?.to_str()?);
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let folder = folder.canonicalize().ok().filter(|folder| self.permits(folder))?;
        let files = folder.read_dir().ok()?.flatten().filter(|entry| entry.path().is_file());
        let names = files.filter_map(|entry| entry.file_name().into_string().ok());
        // Of several similar names, the first in alphabetical order is returned, so that the note does not
        // depend on the order in which the system lists the folder.
        names.filter(|name| name != wanted && name.to_lowercase() == wanted.to_lowercase()).min()
    }

    /// Returns true if the mesh may read the file at `path`. The path must contain no links.
    fn permits(&self, path: &Path) -> bool {
        self.permitted.beyond || lies_in(path, self.folder)
    }
}

/// Divides a text at its blanks, except those that follow a `\`. A blank after a `\` belongs to a name, and
/// the `\` is removed.
fn unescaped_words(text: &str) -> Vec<String> {
    let joined = text.replace("\\ ", "\0");
    joined.split_whitespace().map(|word| word.replace('\0', " ")).collect()
}

const OUTSIDE: &str = "lies outside the mesh's folder and is not read (to allow it, set outside_materials = true in the mesh's \
     [[object]] or, for a bare mesh, --set object.0.outside_materials=true)";

impl Materials {
    /// Adds the materials of a file, and returns their names. Adds notes on lines whose values are ignored. `name` is
    /// the file's name in the mesh. If the file defines several materials of the same name, the last one counts.
    fn add(
        &mut self,
        reach: Reach<'_>,
        name: &str,
        path: &Path,
        bytes: &[u8],
        notes: &mut Vec<String>,
    ) -> Result<Names> {
        let text = super::text::normalise(bytes);
        let quotes = reach.permitted.quotes && lies_in(path, reach.folder);
        let relative = name.replace('\\', "/");
        let folder = &relative[..relative.rfind('/').map_or(0, |slash| slash + 1)];
        // The name comes from the mesh's text, so messages contain the name only if they may quote the mesh.
        let name = &match reach.permitted.quotes {
            true => reach.folder.join(&relative).display().to_string(),
            false => "its MTL file".to_owned(),
        };
        let mut names = Names { quotes, file: name.clone(), ..Names::default() };
        let source = Source { name, text: &text, quotes };
        let checked = check(&text);
        let early = "lines before the first newmtl are not read";
        notes.extend(source.note_on_lines(&format!("{name}:"), checked.early, early));
        checked.pictures.iter().for_each(|picture| reach.keep(paths(picture, folder)));
        let (list, _) = tobj::load_mtl_buf(&mut checked.plain.as_bytes())
            .map_err(|error| source.error(Mistake::new(0, format!("not an MTL file: {error}"))))?;
        let (first, mut materials) = (self.list.len(), Vec::new());
        for (material, extras) in list.iter().zip(checked.extras) {
            let Extras { name: own, mut asked, model, colour, mask, emission, emitted, flaws, .. } = extras;
            let number = self.list.len() as u32;
            let [_, short, _] = possible_names(&own);
            names.short.push((short.to_owned(), number));
            names.whole.push((own, number));
            let completed = |map: Option<(usize, Map)>, own: Option<[f32; 3]>| {
                map.map(|(line, map)| map.with_context(format!("{name}:{line}"), folder, Factor::of(own)))
            };
            let own = material.diffuse;
            let emission = completed(emission, emitted);
            self.maps.push(Maps::new(completed(colour, own), completed(mask, own), emission, &mut asked));
            let emitted = Vec3::from_array(emitted.unwrap_or_default());
            if has_even_highlight(material) {
                asked.add(Wish::EvenHighlight, b"Ns 0");
            }
            let material = Material { emitted, ..convert(material) };
            wishes::of_model(&mut asked, model.as_deref(), material.glossy != Vec3::ZERO);
            self.list.push(material);
            self.asked.push(asked);
            materials.push(flaws);
        }
        if !materials.iter().all(LineFlaws::is_empty) {
            let name = name.clone();
            self.flaws.files.push(FileFlaws { name, text: text.into_owned(), quotes, first, materials });
        }
        Ok(names)
    }

    /// Returns true if two materials differ in anything but their places in MTL files.
    fn differ(&self, a: u32, b: u32) -> bool {
        let [a, b] = [a as usize, b as usize];
        self.list[a] != self.list[b]
            || self.asked[a] != self.asked[b]
            || self.maps[a].without_lines() != self.maps[b].without_lines()
    }
}

/// A checked MTL file.
#[derive(Default)]
struct Checked {
    /// The lines for `tobj`.
    plain: String,
    /// For each material, the properties that `tobj` does not read.
    extras: Vec<Extras>,
    /// For each line that names a picture, used or not, the text that names it.
    pictures: BTreeSet<String>,
    /// Lines before the first `newmtl`.
    early: Seen,
}

/// The properties of a material that raycl reads without `tobj`.
#[derive(Default)]
struct Extras {
    name: String,
    asked: Asked,
    /// The value of `illum`, the number of an illumination model.
    model: Option<Vec<u8>>,
    /// The number of the line with `map_Kd`, from 1, and the value of `map_Kd`.
    colour: Option<(usize, Map)>,
    /// The number of the line with `map_d`, from 1, and the value of `map_d`.
    mask: Option<(usize, Map)>,
    /// The number of the line with `map_Ke`, from 1, and the value of `map_Ke`.
    emission: Option<(usize, Map)>,
    /// The value of `Ke`: the emitted light, in units of the radiance that the default display shows as
    /// white; `None` without `Ke`.
    emitted: Option<[f32; 3]>,
    /// The values of the lines that were read, as text, by the lines' keywords.
    values: HashMap<String, String>,
    /// The lines that raycl ignores or replaces.
    flaws: LineFlaws,
}

/// The keyword and the value of a line; `None` if the line has no value that raycl uses.
type Read = std::result::Result<Option<(String, String)>, Unfit>;

impl Extras {
    /// Reads a line. Returns the line's keyword and value if raycl uses this value.
    fn read(&mut self, line: usize, keyword: &[u8], rest: &[u8]) -> Read {
        let is = |key: &str| keyword.eq_ignore_ascii_case(key.as_bytes());
        let map = |key| Map::of_line(key, rest).map(|map| (line, map));
        let value = |key: &str, value: &dyn Debug| Ok(Some((key.to_owned(), format!("{value:?}"))));
        match keyword {
            b"illum" => {
                self.model = tokens(rest).next().map(<[u8]>::to_vec);
                value("illum", &self.model)
            }
            _ if is("map_Kd") => value("map_Kd", &self.colour.insert(map("map_Kd")?).1),
            _ if is("map_d") => value("map_d", &self.mask.insert(map("map_d")?).1),
            _ if is("map_Ke") => value("map_Ke", &self.emission.insert(map("map_Ke")?).1),
            _ if is("Ke") => value("Ke", self.emitted.insert(values::colour("Ke", rest)?)),
            _ => {
                wishes::of_material(&mut self.asked, keyword, rest);
                Ok(None)
            }
        }
    }

    /// Records the value of a line, and counts the line if it replaces another value.
    fn record(&mut self, offset: usize, key: String, value: String) {
        let old = self.values.insert(key.clone(), value.clone());
        if old.is_some_and(|old| old != value) {
            self.flaws.replaced(offset, key);
        }
    }
}

impl Checked {
    /// Reads a line. Returns the line's keyword and value if raycl uses this value.
    fn read(&mut self, line: usize, name: &[u8], rest: &[u8]) -> Read {
        let mut plain = |key: &str, numbers: &[f32]| {
            let value = numbers.iter().map(f32::to_string).collect::<Vec<_>>().join(" ");
            self.plain += &format!("{key} {value}\n");
            Ok(Some((key.to_owned(), value)))
        };
        match name {
            b"newmtl" => {
                // The name is not given to `tobj`, which refuses the empty name that some exporters write, and
                // removes Unicode blanks around a name. Names after `usemtl` keep such blanks, so names after
                // `newmtl` must keep them, too. (A name that is not UTF-8 is decoded as Latin-1. A byte of a letter
                // may then become a Unicode blank.)
                self.plain += "newmtl m\n";
                self.extras.push(Extras { name: words(rest), ..Extras::default() });
                Ok(None)
            }
            b"Kd" => plain("Kd", &values::colour("Kd", rest)?),
            b"Ks" => plain("Ks", &values::colour("Ks", rest)?),
            b"Ns" => plain("Ns", &[values::shininess(rest)?]),
            _ => {
                let last = self.extras.last_mut();
                let read = last.map_or(Ok(None), |last| last.read(line, name, rest))?;
                values::unused(name, rest)?;
                Ok(read)
            }
        }
    }
}

/// Checks the lines of an MTL file, and converts those with newmtl, Kd, Ks and Ns to a form that `tobj` accepts.
/// `tobj` refuses a single grey value, a comment within a line, and Latin-1 text.
fn check(text: &[u8]) -> Checked {
    let mut checked = Checked::default();
    for (number, (offset, line)) in (1..).zip(Chunk::whole(text).lines()) {
        let (name, rest) = keyword(line);
        let name = with_usual_case(name);
        checked.pictures.extend(picture(name, rest));
        if checked.extras.is_empty() && name != b"newmtl" {
            let is_statement = !name.is_empty() && !name.starts_with(b"#");
            checked.early.at_if(is_statement, offset);
            continue;
        }
        let read = checked.read(number, name, rest);
        let Some(material) = checked.extras.last_mut() else { continue };
        match read {
            Err(unfit) => material.flaws.ignored.add(offset, unfit),
            Ok(read) => {
                material.flaws.look_at(offset, name, rest);
                read.into_iter().for_each(|(key, value)| material.record(offset, key, value));
            }
        }
    }
    checked
}

/// Returns a keyword in the usual upper and lower case, if it is one that raycl reads. Keywords that begin with `map_`
/// are compared without regard to case where they are read.
fn with_usual_case(keyword: &[u8]) -> &[u8] {
    const KEYWORDS: [&[u8]; 6] = [b"newmtl", b"Kd", b"Ks", b"Ns", b"Ke", b"illum"];
    KEYWORDS.into_iter().find(|known| known.eq_ignore_ascii_case(keyword)).unwrap_or(keyword)
}

/// Converts a material: Kd is k_L, Ks is k_G, and Ns is the highlight's exponent s. Without Ks, or with an exponent of
/// 0, the material has no highlight.
fn convert(material: &tobj::Material) -> Material {
    let lambertian = material.diffuse.map_or(Vec3::splat(DEFAULT_LAMBERTIAN), Vec3::from_array);
    if !has_highlight(material) || has_even_highlight(material) {
        return Material::lambertian(lambertian);
    }
    let glossy = material.specular.map_or(Vec3::ZERO, Vec3::from_array);
    Material::blinn_phong(lambertian, glossy, material.shininess.unwrap_or(PAPER_SHININESS))
}

fn has_highlight(material: &tobj::Material) -> bool {
    material.specular.is_some_and(|glossy| Vec3::from_array(glossy) != Vec3::ZERO)
}

/// Returns true if the material has a highlight with the exponent 0. Programs such as MeshLab write this exponent
/// together with a white Ks if a material has no highlight. A highlight with the exponent 0 would be equally bright at
/// all angles, and thus make the whole surface paler.
fn has_even_highlight(material: &tobj::Material) -> bool {
    has_highlight(material) && material.shininess == Some(0.0)
}

#[cfg(test)]
mod tests {
    use super::super::parse;
    use super::*;

    /// Reads a mesh of one triangle, whose folder has the MTL files `files`. `library` is the text after
    /// `mtllib` in the mesh. Returns the notes, and the triangle's material.
    fn read(library: &str, files: &[(&str, &str)], quotes: bool) -> (Vec<String>, Material) {
        let folder = tempfile::tempdir().unwrap();
        files.iter().for_each(|(name, text)| std::fs::write(folder.path().join(name), text).unwrap());
        let reach =
            Reach { folder: folder.path(), permitted: Permitted { beyond: false, quotes, scaled: false } };
        let text = format!("mtllib {library}\nusemtl paint\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
        let mut file = parse("a.obj", reach, text.as_bytes()).unwrap();
        file.keep_notes(|_| true);
        (file.notes, *file.mesh.material(&file.mesh.triangles[0]))
    }

    #[test]
    fn a_highlight_with_the_exponent_0_is_left_out_with_a_note() {
        let read = |values: &str| read("m.mtl", &[("m.mtl", &format!("newmtl paint\n{values}\n"))], true);
        let note = "1 material asks for a highlight as bright at all angles (Ns 0), which raycl does not support: there \
                    is no highlight";
        let (notes, material) = read("Kd 0.2 0.1 0.1\nKs 1 1 1\nNs 0");
        assert_eq!(
            (notes, material),
            (vec![note.to_owned()], Material::lambertian(Vec3::new(0.2, 0.1, 0.1)))
        );
        assert_eq!(read("Ks 0 0 0\nNs 0").0, [""; 0]);
        let (notes, material) = read("Ks 1 1 1\nNs 1");
        assert_eq!((notes.len(), material.glossy, material.shininess), (0, Vec3::ONE, 1.0));
    }

    #[test]
    fn the_case_of_keywords_does_not_matter() {
        let read = |text: &str| read("m.mtl", &[("m.mtl", text)], true);
        let expected = read("newmtl paint\nKd 0.2 0.1 0.1\nKs 1 1 1\nNs 3\nKe 1 0 0\nillum 2\n");
        assert_eq!(expected.0, [""; 0]);
        assert_eq!(read("NEWMTL paint\nkd 0.2 0.1 0.1\nKS 1 1 1\nns 3\nKE 1 0 0\nIllum 2\n"), expected);
    }

    #[test]
    fn names_of_missing_files_and_materials_are_quoted_only_where_that_is_permitted() {
        let (notes, _) = read("none.mtl", &[], true);
        assert!(notes[0].starts_with("MTL file `none.mtl` cannot be read ("), "{notes:?}");
        assert!(
            notes[1]
                .starts_with("1 material named by `usemtl` is defined in no MTL file (material `paint`): "),
            "{notes:?}"
        );
        let (notes, _) = read("none.mtl", &[], false);
        assert!(notes[0].starts_with("MTL file cannot be read ("), "{notes:?}");
        assert!(
            notes[1].starts_with("1 material named by `usemtl` is defined in no MTL file: "),
            "{notes:?}"
        );
    }

    #[cfg(unix)]
    #[test]
    fn a_broken_link_is_named_with_its_target_only_where_the_mesh_may_read_it_and_be_quoted() {
        use std::os::unix::fs::symlink;
        let outer = tempfile::tempdir().unwrap();
        let folder = outer.path().join("mesh");
        std::fs::create_dir(&folder).unwrap();
        symlink("gone.mtl", folder.join("m.mtl")).unwrap();
        symlink("secret.mtl", outer.path().join("m.mtl")).unwrap();
        std::fs::write(folder.join("t.mtl"), "newmtl paint\nmap_Kd w.png\n").unwrap();
        symlink("gone.png", folder.join("w.png")).unwrap();
        let note = |library: &str, quotes: bool| {
            let permitted = Permitted { beyond: false, quotes, scaled: false };
            let text = format!("mtllib {library}\nusemtl paint\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
            let mut file = parse("a.obj", Reach { folder: &folder, permitted }, text.as_bytes()).unwrap();
            file.keep_notes(|_| true);
            file.notes.swap_remove(0)
        };
        let own = note("m.mtl", true);
        assert!(own.starts_with("MTL file `m.mtl` is a link to `gone.mtl`, which is missing: its "), "{own}");
        let texture = note("t.mtl", true);
        assert!(texture.contains("texture `w.png` is a link to `gone.png`, which is missing: "), "{texture}");
        for hidden in [note("m.mtl", false), note("t.mtl", false), note("../m.mtl", true)] {
            assert!(hidden.contains(" cannot be read ("), "{hidden}");
        }
    }

    #[test]
    fn a_material_file_in_a_subfolder_is_the_users_own_whichever_slash_its_name_has() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("sub")).unwrap();
        std::fs::write(folder.path().join("sub/m.mtl"), "newmtl paint\nKd x\nmap_Kd no.png\n").unwrap();
        let notes = |library: &str, quotes: bool| {
            let permitted = Permitted { beyond: false, quotes, scaled: false };
            let text = format!("mtllib {library}\nusemtl paint\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
            let reach = Reach { folder: folder.path(), permitted };
            let mut file = parse("a.obj", reach, text.as_bytes()).unwrap();
            file.keep_notes(|_| true);
            file.notes
        };
        let path = folder.path().join("sub/m.mtl");
        for library in ["sub/m.mtl", "sub\\m.mtl"] {
            let noted = notes(library, true);
            let start = format!("{}:2: `x` in Kd (expected ", path.display());
            assert!(noted[0].starts_with(&start), "{noted:?}");
            assert!(noted[1].starts_with(&format!("{}:3: texture `no.png` ", path.display())), "{noted:?}");
            // The mesh contains the name of the MTL file, so notes that must not quote the mesh leave
            // the name out.
            let noted = notes(library, false);
            let start = "its MTL file:2: a line with Kd cannot be used (expected ";
            assert!(noted[0].starts_with(start), "{noted:?}");
            assert!(noted[1].starts_with("its MTL file:3: texture cannot be read ("), "{noted:?}");
            assert!(!noted.concat().contains("m.mtl"), "{noted:?}");
        }
    }

    #[test]
    fn a_line_names_one_file_with_spaces_or_several_files() {
        let (paint, other) = ("newmtl paint\nKd 0.25 0.25 0.25\n", "newmtl other\n");
        for (library, files) in [
            ("my paints.mtl", [("my paints.mtl", paint), ("paints.mtl", other)]),
            ("other.mtl paints.mtl", [("other.mtl", other), ("paints.mtl", paint)]),
        ] {
            let (notes, material) = read(library, &files, true);
            assert_eq!((notes, material.lambertian), (Vec::new(), Vec3::splat(0.25)), "{library}");
        }
    }

    #[test]
    fn a_blank_after_a_backslash_belongs_to_the_name_if_there_is_such_a_file() {
        let (paint, other) = ("newmtl paint\nKd 0.25 0.25 0.25\n", "newmtl other\n");
        let missing = |notes: &[String]| -> Vec<String> {
            let missing = notes.iter().filter_map(|note| note.strip_prefix("MTL file `"));
            missing.map(|note| note.split('`').next().unwrap_or_default().to_owned()).collect()
        };
        let (notes, material) = read(r"a\ b.mtl", &[("a b.mtl", paint)], true);
        assert_eq!((notes, material.lambertian), (Vec::new(), Vec3::splat(0.25)));
        let files = [("my a b.mtl", paint), ("other.mtl", other)];
        let (notes, material) = read(r"no\ such.mtl other.mtl my\ a\ b.mtl", &files, true);
        assert_eq!(missing(&notes), ["no such.mtl"]);
        assert_eq!(material.lambertian, Vec3::splat(0.25));
        // There is no file whose name has a blank.
        let (notes, material) = read(r"a\ b.mtl", &[("b.mtl", paint)], true);
        assert_eq!(missing(&notes), [r"a\ b.mtl"]);
        assert_eq!(material, Material::default());
    }

    #[test]
    fn missing_files_whose_long_names_begin_alike_are_counted_separately_and_named_by_their_ends() {
        let folder = "a_very_long_folder_name_for_the_materials_of_a_mesh/";
        let names = ["one", "two", "three", "four", "five"].map(|name| format!("{folder}{name}.mtl"));
        let library = names.join(" ");
        let (notes, _) = read(&library, &[], true);
        for (note, name) in notes.iter().zip(&names[..3]) {
            assert!(note.starts_with(&format!("MTL file `{name}` cannot be read (")), "{notes:?}");
        }
        assert_eq!(notes[3], "2 more MTL files cannot be used either");
        // The names must not be quoted, so the first three notes would be equal, and only one of them is
        // shown.
        let (notes, _) = read(&library, &[], false);
        assert!(notes[0].starts_with("MTL file cannot be read ("), "{notes:?}");
        assert_eq!(notes[1], "4 more MTL files cannot be used either");
    }

    #[test]
    fn a_note_names_a_file_whose_name_differs_in_upper_and_lower_case() {
        let paint = "newmtl paint\nmap_Kd Tex.PNG\n";
        // The picture `broken.png` exists, so `BROKEN.PNG` is not the missing file.
        let broken = "newmtl paint\nmap_Kd broken.png\n";
        let files = [
            ("case.mtl", "newmtl other\n"),
            ("Paint.mtl", paint),
            ("tex.png", ""),
            ("Broken.mtl", broken),
            ("broken.png", "no picture"),
            ("BROKEN.PNG", ""),
        ];
        let hint = |library: &str, quotes: bool| -> Vec<String> {
            let (notes, _) = read(library, &files, quotes);
            let hints = notes.iter().filter_map(|note| note.split_once(", but there is a file "));
            hints.map(|(_, end)| end.to_owned()).collect()
        };
        let found = hint(r"C:\x\Case.MTL", true);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].starts_with("`case.mtl`: its materials are grey, "), "{found:?}");
        assert_eq!(hint("Paint.mtl", true), ["`tex.png`: its material's own colour is used"]);
        let none = [("no.mtl", true), ("Case.MTL", false), ("Paint.mtl", false), ("Broken.mtl", true)];
        for (library, quotes) in none {
            assert!(hint(library, quotes).is_empty(), "{library}");
        }
    }

    #[test]
    fn a_material_file_of_another_computer_is_searched_in_the_folder_of_the_mesh() {
        let (paint, other) = ("newmtl paint\nKd 0.25 0.25 0.25\n", "newmtl other\n");
        let files = [("m.mtl", paint), ("my m.mtl", paint), ("other.mtl", other)];
        for library in [r"C:\x\m.mtl", "/home/me/m.mtl", r"C:\My Files\my m.mtl", r"C:\x\m.mtl # mine"] {
            let (notes, material) = read(library, &files, true);
            assert_eq!((notes.len(), material.lambertian), (1, Vec3::splat(0.25)), "{library}: {notes:?}");
            assert!(notes[0].contains("another file may be meant: `"), "{library}: {notes:?}");
        }
        let (notes, material) = read(r"C:\x\other.mtl C:\x\m.mtl", &files, true);
        assert_eq!(material.lambertian, Vec3::splat(0.25));
        let expected = "for 2 MTL files, another file may be meant: for example, `m.mtl` is used, not ";
        assert!(notes.len() == 1 && notes[0].starts_with(expected), "{notes:?}");
    }

    #[test]
    fn a_missing_file_whose_name_has_spaces_is_one_file() {
        let (notes, _) = read("my paints.mtl", &[], true);
        let missing: Vec<_> = notes.iter().filter(|note| note.starts_with("MTL file")).collect();
        assert_eq!(missing.len(), 1, "{notes:?}");
        assert!(missing[0].starts_with("MTL file `my paints.mtl` cannot be read ("), "{notes:?}");
        // The file `paints.mtl` is not read: its name is only the last word of the text `my paints.mtl` after
        // `mtllib`.
        let (notes, material) = read("my paints.mtl", &[("paints.mtl", "newmtl paint\nKd 1 0 0\n")], true);
        assert!(notes[0].starts_with("MTL file `my paints.mtl` "), "{notes:?}");
        assert_eq!(material, Material::default());
        // The materials of the file that the first word names are used, even if there are no files with the
        // names that the other words state.
        for library in ["body.mtl hair.mat", "body.mtl by Jane", "body hair.mat"] {
            let paint = "newmtl paint\nKd 0.25 0.25 0.25\n";
            let (notes, material) = read(library, &[("body.mtl", paint), ("body", paint)], true);
            assert_eq!(material.lambertian, Vec3::splat(0.25), "{library}");
            assert!(notes.iter().all(|note| note.starts_with("MTL file `")), "{notes:?}");
            assert_eq!(notes.len(), library.split(' ').count() - 1, "{notes:?}");
        }
        // Two words that end in `.mtl` are the names of two files.
        let (notes, _) = read("a.mtl b.MTL", &[], true);
        assert!(notes[0].contains(" `a.mtl` ") && notes[1].contains(" `b.MTL` "), "{notes:?}");
    }

    #[test]
    fn of_several_files_that_differ_in_upper_and_lower_case_the_first_in_alphabetical_order_is_named() {
        let files = ["case.mtl", "CASE.mtl", "cASE.mtl"].map(|name| (name, "newmtl other\n"));
        let (notes, _) = read("Case.mtl", &files, true);
        assert!(notes[0].contains(", but there is a file `CASE.mtl`: "), "{notes:?}");
    }
}
