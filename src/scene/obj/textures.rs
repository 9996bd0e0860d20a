//! Reads the textures of OBJ meshes: the lines `map_Kd`, `map_d` and `map_Ke` of materials. Assigns textures
//! and texture coordinates to triangles.

use super::asked::{Asked, Wish};
use super::coordinates::Coordinates;
use super::mtl::Reach;
use super::namesakes::Namesakes;
use super::text::{decimal, name_tokens, number, possible_names, possible_paths, quoted, quoted_name, words};
use super::values::{Unfit, unfit_map};
use super::wishes::names_picture;
use crate::scene::few_notes::FewNotes;
use crate::scene::files::{Pictures, Usage, brightness_to_alpha};
use crate::scene::normals::MISSING;
use crate::scene::{Mapped, Mesh, Textures, Wrap};
use crate::words::counted;
use glam::Vec3;
use std::collections::HashMap;
use std::path::PathBuf;

/// Options of `map_Kd`, `map_d` and `map_Ke` that raycl ignores, and that have one argument each.
const OF_ONE_WORD: [&[u8]; 9] =
    [b"-blendu", b"-blendv", b"-cc", b"-texres", b"-bm", b"-imfchan", b"-boost", b"-type", b"-colorspace"];

/// The smallest alpha, or brightness, of a `map_d` at which the surface has no hole.
const LEAST_ALPHA: f32 = 0.5;

/// The textures of a material.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Maps {
    /// The texture of `map_Kd`.
    colour: Option<Map>,
    /// The texture of `map_d`.
    mask: Option<Map>,
    /// The texture of `map_Ke`.
    emission: Option<Map>,
}

impl Maps {
    /// Makes a material's textures, and counts their unsupported options. The settings of one texture (scale,
    /// offset and wrap mode) place all textures of the material. If the mask or the emission texture has
    /// other settings than this one texture, its settings are counted as unsupported.
    pub fn new(colour: Option<Map>, mask: Option<Map>, emission: Option<Map>, asked: &mut Asked) -> Self {
        [&colour, &mask, &emission].into_iter().flatten().for_each(|map| asked.extend(&map.asked));
        let maps = Self { colour, mask, emission };
        let place = maps.mapping().map(Map::placement);
        let others: [(_, &[u8]); 2] = [(&maps.mask, b"map_d"), (&maps.emission, b"map_Ke")];
        for (map, keyword) in others {
            if map.as_ref().is_some_and(|map| Some(map.placement()) != place) {
                asked.add(Wish::TexturePlace, keyword);
            }
        }
        maps
    }

    /// Returns the textures without the locations of the lines that name them.
    pub fn without_lines(&self) -> Self {
        let all = [&self.colour, &self.mask, &self.emission];
        let [colour, mask, emission] = all.map(|map| map.clone().map(|map| Map { at: String::new(), ..map }));
        Self { colour, mask, emission }
    }

    /// Returns true if the material has a colour texture, a mask or an emission texture.
    pub fn has_any(&self) -> bool {
        self.mapping().is_some()
    }

    /// Returns the map whose settings place the textures on a triangle: the first of `map_Kd`, `map_d` and
    /// `map_Ke` that the material has.
    fn mapping(&self) -> Option<&Map> {
        self.colour.as_ref().or(self.mask.as_ref()).or(self.emission.as_ref())
    }

    /// Loads the textures; returns `None` if none could be loaded. Adds to `namesakes` the pictures that are perhaps
    /// not those that the file means. Calls `report` for each texture that cannot be read. The first argument of
    /// `report` is a text that names the file and the reason. The second argument is a function that makes a note on
    /// the texture.
    fn load(
        &self,
        reach: Reach<'_>,
        pictures: &mut Pictures,
        namesakes: &mut Namesakes,
        report: &mut dyn FnMut(String, &dyn Fn() -> String),
    ) -> Loaded<'_> {
        let mapping = self.mapping()?;
        let wrap = [mapping.wrap; 2];
        let mut load = |pictures: &mut Pictures, map: Option<&Map>, usage, [what, instead]: [&str; 2]| {
            let map = map?;
            map.load(reach, pictures, namesakes, usage)
                .map_err(|why| {
                    // The text `about` has no line number, so only one note is added if many materials name
                    // the same file. The text `about` has the whole name of the file, so that different files
                    // are counted separately.
                    let about = format!("{what} {} {why}", map.name());
                    report(about, &|| map.note(reach, what, &why, instead));
                })
                .ok()
        };
        let (of_colour, of_mask) = (Usage::colour(wrap), Usage::mask(wrap, LEAST_ALPHA));
        let own = ["texture", "its material's own colour is used"];
        let colour = load(pictures, self.colour.as_ref(), of_colour, own);
        let used = self.mask.as_ref().filter(|mask| !self.is_opaque_colour(mask, colour, reach, pictures));
        let mask = load(pictures, used, of_mask, ["mask", "its surface has no holes"]);
        let dark = "its surface emits no light, unless the scene sets `emitted`";
        let emission = load(pictures, self.emission.as_ref(), of_colour, ["emission texture", dark]);
        if let (Some(map), Some(number), None) = (&self.colour, colour, &self.mask) {
            pictures.leave_out_alpha(number, map.name());
        }
        if let (Some(map), Some(number)) = (&self.mask, mask) {
            brightness_to_alpha(&mut pictures.list[number as usize]);
            pictures.leave_out_opacity(number, map.name());
        }
        let coloured = [(&self.colour, colour), (&self.emission, emission)];
        let is_whitened = coloured.map(|(map, number)| {
            number.is_some() && map.as_ref().is_some_and(|map| map.factor != Factor::Own)
        });
        let all = [colour, mask, emission];
        all.iter().any(Option::is_some).then_some(LoadedMaps { mapping, all, is_whitened })
    }

    /// If `mask` names the file of `map_Kd`, perhaps by another path, and this picture is opaque, records that `mask`
    /// is not used, and returns true. Otherwise, returns false. A program that names the same picture twice means the
    /// picture's alpha, and does not mean that dark colours are holes. `colour` is the index of the colour texture in
    /// `Pictures::list`; `None` if the texture was not read.
    fn is_opaque_colour(
        &self,
        mask: &Map,
        colour: Option<u32>,
        reach: Reach<'_>,
        pictures: &mut Pictures,
    ) -> bool {
        let Some((map, number)) = self.colour.as_ref().zip(colour) else { return false };
        let is_opaque = map.located(reach) == mask.located(reach) && pictures.is_opaque(number);
        if is_opaque {
            pictures.leave_out_mask(mask.name());
        }
        is_opaque
    }
}

/// The textures of a material that could be read; `None` if no texture of the material could be read.
type Loaded<'a> = Option<LoadedMaps<'a>>;

#[derive(Clone, Copy)]
struct LoadedMaps<'a> {
    /// The texture whose settings (scale, offset and wrap mode) place all textures of the material.
    mapping: &'a Map,
    /// The indices of the colour texture, the mask and the emission texture in `Pictures::list`.
    all: [Option<u32>; 3],
    /// Two values, for the colour texture and the emission texture: true if the texture was read and is multiplied by
    /// white (see [`Factor`]).
    is_whitened: [bool; 2],
}

/// The colour of a material by which a texture is multiplied. A texture is multiplied by white if this colour is
/// missing or black, since black would hide the texture and the default grey would darken it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Factor {
    Missing,
    Black,
    Own,
}

impl Factor {
    pub fn of(colour: Option<[f32; 3]>) -> Self {
        match colour {
            None => Self::Missing,
            Some([0.0, 0.0, 0.0]) => Self::Black,
            Some(_) => Self::Own,
        }
    }
}

/// A texture of a material.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Map {
    /// The part of the line after the keyword and its options: the name of the picture's file, perhaps with a comment.
    named: String,
    /// The location of the line that names the file, for messages.
    at: String,
    /// The folder of the MTL file, relative to the mesh's folder; empty, or with a slash at its end.
    folder: String,
    /// The material's own colour: `Ke` for an emission texture, otherwise `Kd`.
    factor: Factor,
    scale: [f64; 2],
    offset: [f64; 2],
    wrap: Wrap,
    /// The unsupported options of the line.
    asked: Asked,
}

impl Map {
    /// Parses `rest`, the line after its keyword. Returns an error if the line names no file, or if an
    /// option's numbers are not valid.
    pub fn of_line(keyword: &str, rest: &[u8]) -> Result<Self, Unfit> {
        let mut map = Self {
            named: String::new(),
            at: String::new(),
            folder: String::new(),
            factor: Factor::Missing,
            scale: [1.0; 2],
            offset: [0.0; 2],
            wrap: Wrap::Repeat,
            asked: Asked::default(),
        };
        let all: Vec<&[u8]> = name_tokens(rest).collect();
        let mut earlier = Vec::new();
        let at = map.options(keyword, &all, 0, &mut earlier)?;
        let without = || unfit_map(keyword, format!("{keyword} without a file"), "the name of a picture");
        let position = |token: &[u8]| token.as_ptr() as usize - rest.as_ptr() as usize;
        let from = position(all.get(at).ok_or_else(without)?);
        // A file name may contain spaces, so the name is the rest of the line, or ends before options.
        let name = match map.options_after_name(keyword, &all, at, &mut earlier)? {
            Some(option) => rest[from..position(option)].trim_ascii_end(),
            None => &rest[from..],
        };
        map.named = words(name);
        Ok(map)
    }

    /// Reads the options at the end of a line, after the name of the file, which begins with the word `name` of `all`.
    /// The format has options only before the name, but some files have them after it. Returns the first of these
    /// options; `None` if there are none.
    fn options_after_name<'a>(
        &mut self,
        keyword: &str,
        all: &[&'a [u8]],
        name: usize,
        earlier: &mut Vec<&'a [u8]>,
    ) -> Result<Option<&'a [u8]>, Unfit> {
        let is_first = |at: &usize| is_option(&all[*at..]) && has_extension(all[*at - 1]);
        let Some(first) = (name + 1..all.len()).find(is_first) else { return Ok(None) };
        let mut with_options = self.clone();
        if with_options.options(keyword, all, first, earlier)? < all.len() {
            return Ok(None);
        }
        *self = with_options;
        Ok(Some(all[first]))
    }

    /// Reads the options that begin at the word `at` of a line, and adds them to `earlier`, the options that were read
    /// before. Returns the number of the next word.
    fn options<'a>(
        &mut self,
        keyword: &str,
        all: &[&'a [u8]],
        mut at: usize,
        earlier: &mut Vec<&'a [u8]>,
    ) -> Result<usize, Unfit> {
        while let Some(option) = all.get(at).filter(|token| token.starts_with(b"-") && token.len() > 1) {
            at += 1;
            let before = self.placement();
            at += self.option(keyword, option, &all[at..])?;
            if earlier.contains(option) && self.placement() != before {
                let first = [keyword.as_bytes(), b" first ", option].concat();
                self.asked.add(Wish::TextureOption, &first);
            }
            earlier.push(option);
        }
        Ok(at)
    }

    /// Reads an option, or counts the option if raycl does not support it. `after` has the words after the
    /// option. Returns how many of the words in `after` belong to the option.
    fn option(&mut self, keyword: &str, option: &[u8], after: &[&[u8]]) -> Result<usize, Unfit> {
        let count = after.iter().take(3).take_while(|word| is_number(word)).count();
        let numbers = || -> Result<Vec<f64>, Unfit> {
            // At least one number must follow. Texture coordinates become single precision, so a number that
            // is infinite in single precision is not valid.
            let finite = |word: &&[u8]| {
                let found = || format!("{} after {keyword} {}", quoted(word), words(option));
                let value = number(word).and_then(|_| decimal(word));
                value.ok_or_else(|| unfit_map(keyword, found(), "one to three finite numbers"))
            };
            after.iter().take(count.max(1)).map(finite).collect()
        };
        let is = |expected: &[u8]| after.first().is_some_and(|word| word.eq_ignore_ascii_case(expected));
        let mut unsupported = |value: &[u8]| {
            let name = [keyword.as_bytes(), option, value].join(&b' ');
            self.asked.add(Wish::TextureOption, name.trim_ascii_end());
        };
        Ok(match option {
            // A picture has only two directions, so the third number, w, has no effect.
            b"-s" | b"-o" => {
                let (numbers, usual) = (numbers()?, if option == b"-s" { 1.0 } else { 0.0 });
                if numbers.get(2).is_some_and(|number| *number != usual) {
                    unsupported(b"w");
                }
                let placed = if option == b"-s" { &mut self.scale } else { &mut self.offset };
                *placed = pair(&numbers, usual);
                count
            }
            b"-clamp" if is(b"on") || is(b"off") => {
                self.wrap = if is(b"on") { Wrap::Clamp } else { Wrap::Repeat };
                1
            }
            // Neither `on` nor `off` follows. If only one word follows, this word is the name of the file.
            b"-clamp" => {
                unsupported(after.first().copied().unwrap_or_default());
                usize::from(after.len() > 1)
            }
            other => {
                let words = match other {
                    b"-t" => count,
                    b"-mm" => 2,
                    _ => usize::from(OF_ONE_WORD.contains(&other)),
                };
                if !is_usual(other, &after[..words.min(after.len())]) {
                    unsupported(b"");
                }
                words
            }
        })
    }

    /// Sets the fields `at`, `folder` and `factor`.
    pub fn with_context(self, at: String, folder: &str, factor: Factor) -> Self {
        Self { at, folder: folder.to_owned(), factor, ..self }
    }

    /// Returns the name of the picture's file for messages. If a part of the text is certainly a comment,
    /// this part is left out.
    fn name(&self) -> &str {
        possible_names(&self.named)[1]
    }

    /// Returns a note on a picture that cannot be used. `what` is the picture's purpose, `why` is the reason,
    /// and `instead` says what is shown instead.
    fn note(&self, reach: Reach<'_>, what: &str, why: &str, instead: &str) -> String {
        let (name, hint) = match reach.permitted.quotes {
            true => (format!(" {}", quoted_name(self.name())), reach.other_case(self.paths())),
            false => (String::new(), String::new()),
        };
        format!("{}: {what}{name} {why}{hint}: {instead}", self.at)
    }

    /// Returns the [`paths`] at which raycl looks for the picture.
    fn paths(&self) -> impl Iterator<Item = String> {
        paths(&self.named, &self.folder)
    }

    /// Returns the first file of [`Self::paths`] that the mesh may read, after following links.
    fn located(&self, reach: Reach<'_>) -> Option<PathBuf> {
        self.paths().find_map(|path| reach.locate(&path).ok())
    }

    /// Returns the settings that place the picture on a triangle: scale, offset and wrap mode.
    fn placement(&self) -> ([f64; 2], [f64; 2], Wrap) {
        (self.scale, self.offset, self.wrap)
    }

    /// Returns the index, in `Pictures::list`, of the map's texture: the first file of [`Self::paths`] that
    /// can be used. If no file can be used, returns what is wrong with the first file that the mesh may read.
    /// If there are no such files, or if the mesh may read none of them, returns what is wrong with the file
    /// [`Self::name`].
    fn load(
        &self,
        reach: Reach<'_>,
        pictures: &mut Pictures,
        namesakes: &mut Namesakes,
        usage: Usage,
    ) -> Result<u32, String> {
        let mut unusable = None;
        for path in self.paths().filter(|path| reach.locate(path).is_ok()) {
            match pictures.file(reach, &path, usage) {
                Ok(number) => {
                    namesakes.look_at(reach, &self.named, &self.folder, &path);
                    return Ok(number);
                }
                Err(why) => unusable = unusable.or(Some(why)),
            }
        }
        unusable.map_or_else(|| pictures.file(reach, self.name(), usage), Err)
    }

    /// Applies scale and offset to a corner's texture coordinates. Also converts v, which OBJ measures from
    /// the texture's lower edge, to the distance from the upper edge.
    fn texture_coordinates(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        [self.offset[0] + self.scale[0] * u, 1.0 - (self.offset[1] + self.scale[1] * v)]
    }
}

/// Returns the text that names the picture of an MTL line, even if raycl does not use this picture. Returns `None` if
/// the line names no picture, or has options with numbers that are not valid.
pub(super) fn picture(keyword: &[u8], rest: &[u8]) -> Option<String> {
    let map = names_picture(keyword).then(|| Map::of_line(&words(keyword), rest))?;
    map.ok().map(|map| map.named)
}

/// Returns the paths at which raycl looks for a picture, in this order, each path once. `named` is the text that names
/// the picture. The paths are relative to the mesh's folder. A picture may be in the mesh's folder or in the folder of
/// the MTL file, `folder`.
pub(super) fn paths(named: &str, folder: &str) -> impl Iterator<Item = String> {
    let mut all: Vec<String> = Vec::new();
    for path in possible_paths(named).flat_map(|name| [name.to_owned(), format!("{folder}{name}")]) {
        if !all.contains(&path) {
            all.push(path);
        }
    }
    all.into_iter()
}

/// Returns true if words begin with an option of a texture and, if it is an option of numbers, with a number after it.
fn is_option(words: &[&[u8]]) -> bool {
    match words {
        [b"-s" | b"-o" | b"-t" | b"-mm", next, ..] => is_number(next),
        [b"-clamp", _, ..] => true,
        [option, _, ..] => OF_ONE_WORD.contains(option),
        _ => false,
    }
}

/// Returns true if an option of a texture has the values that count without this option.
fn is_usual(option: &[u8], values: &[&[u8]]) -> bool {
    let is = |word: &str| values.iter().all(|value| value.eq_ignore_ascii_case(word.as_bytes()));
    let are = |usual: &[f32]| values.iter().map(|value| number(value)).eq(usual.iter().copied().map(Some));
    match option {
        _ if values.is_empty() => false,
        b"-blendu" | b"-blendv" => is("on"),
        b"-cc" => is("off"),
        b"-bm" => are(&[1.0]),
        b"-mm" => are(&[0.0, 1.0]),
        b"-t" => values.iter().all(|value| number(value) == Some(0.0)),
        _ => false,
    }
}

/// Returns true if a word ends like the name of a file: with a dot and two to four letters or digits.
fn has_extension(word: &[u8]) -> bool {
    let dot = word.iter().rposition(|byte| *byte == b'.').filter(|dot| *dot > 0);
    let extension = dot.map(|dot| &word[dot + 1..]);
    extension.is_some_and(|end| (2..=4).contains(&end.len()) && end.iter().all(u8::is_ascii_alphanumeric))
}

/// Returns true if a word is a number, finite or not.
fn is_number(word: &[u8]) -> bool {
    words(word).parse::<f32>().is_ok()
}

/// Returns the first two numbers of a list. `usual` replaces missing numbers.
fn pair(numbers: &[f64], usual: f64) -> [f64; 2] {
    [0, 1].map(|axis| numbers.get(axis).copied().unwrap_or(usual))
}

/// The texture coordinates of faces.
pub(super) struct FaceCoordinates {
    /// All texture coordinates (`vt`) of the file.
    pub coordinates: Coordinates,
    /// For each triangle, the indices of its corners' texture coordinates.
    pub corners: Vec<[u32; 3]>,
}

/// Assigns textures to the triangles of a mesh, and emission textures to its materials. Textures of materials that no
/// triangle uses are not read. Adds notes on textures that cannot be used, and on triangles that have a texture but no
/// texture coordinates.
pub(super) fn apply(
    mesh: &mut Mesh,
    maps: &[Maps],
    faces: &FaceCoordinates,
    reach: Reach<'_>,
    notes: &mut Vec<String>,
) {
    let used = mesh.materials_of_triangles();
    let mut pictures = Pictures::default();
    let mut loaded = vec![None; maps.len()];
    let (mut unusable, mut namesakes) = (FewNotes::default(), Namesakes::default());
    for (material, maps) in maps.iter().enumerate().filter(|(material, _)| used[*material]) {
        loaded[material] = maps
            .load(reach, &mut pictures, &mut namesakes, &mut |about, note| unusable.add(about, note, notes));
    }
    notes.extend(unusable.rest("texture"));
    notes.extend(namesakes.note("texture", reach.permitted.quotes));
    notes.extend(pictures.notes(reach.permitted.quotes, &[]));
    note_black(maps, &loaded, notes);
    let (mut without, mut unmasked) = (Vec::new(), 0);
    let rows = mesh.triangles.iter().zip(&faces.corners).enumerate().map(|(number, (triangle, corners))| {
        let Some(LoadedMaps { mapping: map, all: [colour, mask, _], .. }) =
            loaded[triangle.material as usize]
        else {
            return Mapped::NONE;
        };
        let coordinates = |corner: u32| map.texture_coordinates(faces.coordinates.at(corner));
        let all = (!corners.contains(&MISSING)).then(|| corners.map(coordinates));
        let row = all.and_then(|corners| finite(Mapped::new(corners, colour, mask, [map.wrap; 2])));
        row.unwrap_or_else(|| {
            without.push(number);
            unmasked += usize::from(mask.is_some());
            Mapped::NONE
        })
    });
    let rows = rows.collect();
    for ((material, maps), loaded) in mesh.materials.iter_mut().zip(maps).zip(&loaded) {
        if maps.emission.is_some() {
            material.set_emission_texture(loaded.and_then(|loaded| loaded.all[2]));
        }
    }
    mesh.textures = Textures::of(pictures.list, rows, &mesh.materials);
    whiten(mesh, &loaded, &without);
    let dark = mesh.leave_out_emission_textures(&without);
    if !without.is_empty() {
        notes.push(unmapped(without.len(), unmasked, dark));
    }
}

/// Adds notes on the materials whose black colour is replaced by white (see [`Factor`]).
fn note_black(maps: &[Maps], loaded: &[Loaded<'_>], notes: &mut Vec<String>) {
    let count = |number: usize, map: fn(&Maps) -> &Option<Map>| {
        let is_loaded = |loaded: &Loaded<'_>| loaded.is_some_and(|loaded| loaded.all[number].is_some());
        let is_black = |maps: &Maps| map(maps).as_ref().is_some_and(|map| map.factor == Factor::Black);
        maps.iter().zip(loaded).filter(|(maps, loaded)| is_loaded(loaded) && is_black(maps)).count()
    };
    for (key, count) in [("Kd", count(0, |maps| &maps.colour)), ("Ke", count(2, |maps| &maps.emission))] {
        let note = || {
            format!(
                "{key} 0 0 0 beside map_{key} is read as {key} 1 1 1, since black would hide the texture ({})",
                counted(count, "material")
            )
        };
        notes.extend((count > 0).then(note));
    }
}

/// Makes a material white if its `Kd` colour is missing or black and its colour texture was read. Makes a
/// material's emitted light white if its `Ke` colour is missing or black and its emission texture was read.
/// `unmapped` has the indices of the triangles that have no texture coordinates, and thus show no texture. If
/// the material of such a triangle is changed, the triangle gets a copy of the unchanged material.
fn whiten(mesh: &mut Mesh, loaded: &[Loaded<'_>], unmapped: &[usize]) {
    let whitened = |material: usize| loaded[material].map_or([false; 2], |maps| maps.is_whitened);
    let is_whitened = |material: usize| whitened(material) != [false; 2];
    let mut copies = HashMap::new();
    for &number in unmapped {
        let material = mesh.triangles[number].material;
        if is_whitened(material as usize) {
            let copy = copies.entry(material).or_insert_with(|| {
                let own = mesh.materials[material as usize];
                mesh.materials.push(own);
                mesh.materials.len() as u32 - 1
            });
            mesh.triangles[number].material = *copy;
        }
    }
    for material in (0..loaded.len()).filter(|material| is_whitened(*material)) {
        let [colour, emission] = whitened(material);
        let own = &mut mesh.materials[material];
        if colour {
            own.lambertian = Vec3::ONE;
        }
        if emission {
            own.emitted = Vec3::ONE;
        }
    }
}

/// Returns `row` if all of its texture coordinates are finite; otherwise `None`.
pub(in crate::scene) fn finite(row: Mapped) -> Option<Mapped> {
    row.corners.as_flattened().iter().all(|value| value.is_finite()).then_some(row)
}

/// Returns a note on `count` triangles that have a texture but no texture coordinates. `unmasked` of these triangles
/// have a mask, and `dark` of them have an emission texture.
pub(in crate::scene) fn unmapped(count: usize, unmasked: usize, dark: usize) -> String {
    let (have, their) = if count == 1 { ("has", "its material's") } else { ("have", "their materials'") };
    let of_them = |what: &str, some: usize| match (some, count) {
        (0, _) => String::new(),
        (_, 1) => format!("; {what} it"),
        _ => format!("; {what} {some} of them"),
    };
    format!(
        "{} {have} a texture but no texture coordinates: {their} own colour is used{}{}",
        counted(count, "triangle"),
        of_them("the mask makes no holes in", unmasked),
        of_them("the emission texture gives no light on", dark)
    )
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    fn map(rest: &str) -> Option<(String, [f64; 2], [f64; 2], Wrap)> {
        let map = Map::of_line("map_Kd", rest.as_bytes()).ok()?;
        Some((map.name().to_owned(), map.scale, map.offset, map.wrap))
    }

    #[test]
    fn options_come_before_a_name_with_spaces() {
        let usual = |name: &str| Some((name.to_owned(), [1.0; 2], [0.0; 2], Wrap::Repeat));
        assert_eq!(map(" a b.png # c"), usual("a b.png"));
        assert_eq!(map(" wood#2 b#.png #c # d"), usual("wood#2 b#.png #c"));
        assert_eq!(map(" -blendu off -mm 0 1 a.png"), usual("a.png"));
        assert_eq!(
            map(" -s 2 3 4 -o 0.5 -clamp on 1.png"),
            Some(("1.png".to_owned(), [2.0, 3.0], [0.5, 0.0], Wrap::Clamp))
        );
        assert_eq!(map(" # none"), None);
        assert_eq!(map(" -s 1 1 1"), None);
        assert_eq!(map(" -s nan a.png"), None);
        assert_eq!(map(" -o 1 inf a.png"), None);
        assert_eq!(map(" -o 1e39 a.png"), None);
        assert_eq!(map(" -o 1000000.1 a.png").map(|(_, _, offset, _)| offset), Some([1_000_000.1, 0.0]));
        let clamped = Some(("a.png".to_owned(), [1.0; 2], [0.0; 2], Wrap::Clamp));
        assert_eq!([map(" -clamp ON a.png"), map(" -clamp Off a.png")], [clamped, usual("a.png")]);
        for (rest, options) in [
            (" -bm 2 -clamp off a.png", &[" (map_Kd -bm)"][..]),
            (" -clamp off a.png", &[]),
            (" -blendu on -blendv on -cc off -bm 1.0 -t 0 0 0 -mm 0 1 a.png", &[]),
            (" -t 0 0.5 0 a.png", &[" (map_Kd -t)"]),
            (" -t a.png", &[" (map_Kd -t)"]),
            (" -blendu off -mm 0 2 a.png", &[" (map_Kd -blendu 1, map_Kd -mm 1)"]),
            (" -s 2 2 1 -o 1 1 0 a.png", &[]),
            (" -s 2 2 2 a.png", &[" (map_Kd -s w)"]),
            (" -o 1 1 1 a.png", &[" (map_Kd -o w)"]),
            (" -s 2 -s 2 a.png", &[]),
            (" -s 2 -o 1 -s 3 a.png", &[" (map_Kd first -s)"]),
            (" -clamp yes a.png", &[" (map_Kd -clamp yes)"]),
            (" -clamp a.png", &[" (map_Kd -clamp a.png)"]),
        ] {
            let map = Map::of_line("map_Kd", rest.as_bytes()).unwrap();
            let notes: Vec<_> = map.asked.notes("material", true).collect();
            assert_eq!(notes.len(), options.len(), "{rest}: {notes:?}");
            let names_option =
                |(note, option): (&String, &&str)| note.contains(&format!("options of textures{option}"));
            assert!(notes.iter().zip(options).all(names_option), "{rest}: {notes:?}");
            assert_eq!(map.name(), "a.png", "{rest}");
        }
    }

    #[test]
    fn options_may_come_after_the_name() {
        let placed = |name: &str| Some((name.to_owned(), [2.0, 3.0], [0.5, 0.0], Wrap::Clamp));
        assert_eq!(map(" a b.png -s 2 3 1 -o 0.5 -clamp on"), placed("a b.png"));
        assert_eq!(map(" -s 2 3 a b.png -o 0.5 -clamp on # c"), placed("a b.png"));
        let usual = |name: &str| Some((name.to_owned(), [1.0; 2], [0.0; 2], Wrap::Repeat));
        for name in [
            "wood -s 2 3 1.png",
            "a.png -s 2 b.png",
            "a.png -x 2",
            "a -s 2",
            "v1.5 -o 1 b.png",
            "No.12 -o view.png",
            "No.1 -s 2",
            "wood.large -s 2",
            "wood.a+b -s 2",
            "a.png -s",
        ] {
            assert_eq!(map(&format!(" {name}")), usual(name));
        }
        assert_eq!(map(" a.png -s nan"), None);
        let bump = Map::of_line("map_Kd", b" a.png -bm 2").unwrap();
        assert_eq!(bump.name(), "a.png");
        assert!(bump.asked.notes("material", true).any(|note| note.contains("map_Kd -bm")));
        let twice = Map::of_line("map_Kd", b" -s 2 a.png -s 3").unwrap();
        assert!(twice.asked.notes("material", true).any(|note| note.contains("map_Kd first -s")));
    }

    #[test]
    fn a_picture_is_searched_beside_the_mesh_and_its_material_file_with_and_without_its_folders() {
        let paths = |rest: &str| {
            let map = Map::of_line("map_Kd", rest.as_bytes()).unwrap();
            map.with_context(String::new(), "mats/", Factor::Own).paths().collect::<Vec<_>>()
        };
        let expected = [
            "C:\\x\\a #2.png",
            "mats/C:\\x\\a #2.png",
            "C:\\x\\a",
            "mats/C:\\x\\a",
            "a #2.png",
            "mats/a #2.png",
            "a",
            "mats/a",
        ];
        assert_eq!(paths(" -s 1 1 1 C:\\x\\a #2.png"), expected);
        // Only a comment names the file `b.png`, so raycl does not look for this file.
        let all = paths(" a.png # was x/b.png");
        assert!(!all.iter().any(|path| path == "b.png" || path == "mats/b.png"), "{all:?}");
    }

    #[test]
    fn rows_are_counted_from_the_top() {
        let map = Map::of_line("map_Kd", b" -s 2 2 -o 0 0.25 a.png").unwrap();
        assert_eq!(map.texture_coordinates([0.5, 0.125]), [1.0, 0.5]);
    }
}
