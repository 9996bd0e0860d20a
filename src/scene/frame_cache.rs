//! Keeps the meshes and the pictures of one frame of an animation for the next frame, so that the next frame
//! need not read the same files or build the same meshes again.

use super::Mesh;
use super::assemble::Joined;
use super::files::MeshFile;
use super::sky::{FileTexels, SkyPicture};
use super::validate::MAX_POWER;
use crate::error::Result;
use glam::Vec3;
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use toml::{Table, Value};

/// The keys of an object that transform a mesh and set its materials; the other keys determine the
/// mesh itself.
const PLACING: [&str; 4] = ["scale", "rotation", "translation", "material"];

/// Data that one frame passes on to the next frame.
#[derive(Default)]
pub(super) struct FrameCache {
    /// True once an animation has begun a frame. Without an animation, no meshes, texels or bounds are kept
    /// for a next frame.
    keeps: bool,
    /// For each object of this frame, the text that determines the object's mesh. The list is empty if there is no
    /// animation, or if the animation changes neither an object nor the scene's `crease`.
    keys: Vec<String>,
    /// The meshes of this frame's objects, before transforms and materials are applied. The keys of this map
    /// are the texts in `keys`.
    meshes: HashMap<String, MeshFile>,
    /// The meshes of the previous frame's objects, except those that this frame has already reused.
    earlier: HashMap<String, MeshFile>,
    /// All objects of this frame, and the scene's values that apply to all objects, as one text. Two frames
    /// with the same text have equal objects.
    objects: String,
    /// The value that the field `objects` had when objects were last joined into one mesh, and the joined
    /// objects.
    joined: Option<(String, Joined)>,
    /// The mesh whose bounds were computed last, and these bounds.
    bounds: Option<(Arc<Mesh>, (Vec3, Vec3))>,
    /// The file of the picture that was read last, and its texels.
    picture: Option<(PathBuf, FileTexels)>,
    /// The file of the picture whose texels were last multiplied by a strength, the strength, and the
    /// multiplied texels.
    strengthened: Option<((PathBuf, f32), FileTexels)>,
}

impl FrameCache {
    /// Begins a frame of an animation, and makes the texts that determine the frame's objects. `document` is the
    /// scene file's table with the values of this frame. `objects_change` is true if the animation changes an object
    /// or the scene's `crease`. The meshes in `meshes` become the meshes of the previous frame; older meshes are
    /// dropped.
    pub fn begin(&mut self, document: &Table, objects_change: bool) {
        let (objects, of_all) =
            (document.get("object"), ["crease", "mip_levels", "textures"].map(|key| document.get(key)));
        let list = objects.and_then(Value::as_array).filter(|_| objects_change);
        self.keeps = true;
        self.keys = list.into_iter().flatten().map(|object| making(object, of_all)).collect();
        self.earlier = std::mem::take(&mut self.meshes);
        self.objects = format!("{objects:?} {of_all:?}");
    }

    /// Returns the objects of this frame, joined into one mesh. If the text of all objects is the same as in the
    /// previous frame, returns the previous frame's result. If the text has changed, or if there is no earlier result,
    /// `make` joins the objects.
    pub fn joined(&mut self, make: impl FnOnce(&mut Self) -> Result<Joined>) -> Result<Joined> {
        if let Some((_, joined)) = self.joined.as_ref().filter(|(objects, _)| *objects == self.objects) {
            self.meshes = std::mem::take(&mut self.earlier);
            return Ok(joined.clone());
        }
        let joined = make(self)?;
        self.earlier.clear();
        self.joined = self.keeps.then(|| (self.objects.clone(), joined.clone()));
        Ok(joined)
    }

    /// Returns the mesh of the object with the index `object`, before the object's transform and materials
    /// are applied. If this frame or the previous frame has a mesh for the same text (`keys`), this mesh is
    /// reused. If neither frame has a mesh for this text, `make` builds the mesh.
    pub fn mesh(&mut self, object: usize, make: impl FnOnce() -> Result<MeshFile>) -> Result<MeshFile> {
        let Some(key) = self.keys.get(object) else { return make() };
        let mesh = match self.meshes.entry(key.clone()) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(free) => free.insert(self.earlier.remove(key).map_or_else(make, Ok)?),
        };
        Ok(mesh.clone())
    }

    /// Returns the smallest and the largest corner of a mesh's bounding box; zeros if the mesh has
    /// no triangles.
    pub fn bounds(&mut self, mesh: &Arc<Mesh>) -> (Vec3, Vec3) {
        if let Some((_, bounds)) = self.bounds.as_ref().filter(|(known, _)| Arc::ptr_eq(known, mesh)) {
            return *bounds;
        }
        let bounds = mesh.bounds().unwrap_or_default();
        self.bounds = self.keeps.then(|| (Arc::clone(mesh), bounds));
        bounds
    }

    /// Returns the texels of a sky's picture, multiplied by `strength`. Consecutive frames with the same picture
    /// and strength share the multiplied texels. The text of an error continues a sentence that begins with the
    /// file's name.
    pub fn picture(&mut self, path: &Path, strength: f32) -> std::result::Result<FileTexels, String> {
        let wanted = (path.to_owned(), strength);
        if let Some((_, texels)) = self.strengthened.as_ref().filter(|(of, _)| *of == wanted) {
            return Ok(texels.clone());
        }
        let read = self.read(path)?;
        let texels = SkyPicture::strengthened(&read, strength, MAX_POWER)?;
        self.strengthened = self.keeps.then(|| (wanted, texels.clone()));
        Ok(texels)
    }

    /// Returns the texels of the sky's picture in the file `path`, without multiplying them by a strength.
    fn read(&mut self, path: &Path) -> std::result::Result<FileTexels, String> {
        if let Some((_, texels)) = self.picture.as_ref().filter(|(known, _)| known == path) {
            return Ok(texels.clone());
        }
        let texels = SkyPicture::read(path)?;
        self.picture = self.keeps.then(|| (path.to_owned(), texels.clone()));
        Ok(texels)
    }
}

/// Returns the text that determines an object's mesh: the object without the keys in `PLACING`, and the
/// scene's values that apply to all objects (`of_all`).
fn making(object: &Value, of_all: [Option<&Value>; 3]) -> String {
    let keys = object.as_table().into_iter().flatten();
    let making: Table = keys
        .filter(|(key, _)| !PLACING.contains(&key.as_str()))
        .map(|(key, value)| (key.clone(), value.clone()))
        .collect();
    format!("{making:?} {of_all:?}")
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    const OBJECT: &str = "crease = 30\n[[object]]\nfile = 'a.obj'\nscale = 1\n";

    /// Builds a frame with the scene file `OBJECT`, then a frame with the scene file `text`. Returns true if
    /// the object's mesh is built again for the second frame.
    fn is_made_again(text: &str) -> bool {
        let mut cache = FrameCache::default();
        let mut made = 0;
        for text in [OBJECT, text] {
            cache.begin(&text.parse().unwrap(), true);
            let make = || {
                made += 1;
                Ok(MeshFile::default())
            };
            cache.mesh(0, make).unwrap();
        }
        made > 1
    }

    #[test]
    fn a_mesh_is_made_again_where_what_makes_it_changes_and_not_where_it_only_moves() {
        assert!(!is_made_again(OBJECT));
        for placing in ["scale = 2", "scale = 1\ntranslation = [1, 2, 3]", "scale = 1\nmaterial = 'red'"] {
            assert!(!is_made_again(&OBJECT.replace("scale = 1", placing)), "{placing}");
        }
        for (from, to) in [
            ("a.obj", "b.obj"),
            ("crease = 30", "crease = 60"),
            ("crease = 30\n", ""),
            ("crease = 30\n", "crease = 30\nmip_levels = false\n"),
            ("crease = 30\n", "crease = 30\ntextures = false\n"),
        ] {
            assert!(is_made_again(&OBJECT.replace(from, to)), "{to}");
        }
    }

    #[test]
    fn another_picture_of_the_sky_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let [dark, bright] = [("dark.exr", 0.25), ("bright.exr", 4.0)].map(|(name, value)| {
            let path = folder.path().join(name);
            image::Rgb32FImage::from_pixel(4, 2, image::Rgb([value; 3])).save(&path).unwrap();
            path
        });
        let mut cache = FrameCache::default();
        cache.begin(&Table::new(), true);
        let red = |cache: &mut FrameCache, path: &Path| cache.picture(path, 1.0).unwrap().texels[0][0];
        assert_eq!(
            [red(&mut cache, &dark), red(&mut cache, &bright), red(&mut cache, &dark)],
            [0.25, 4.0, 0.25]
        );
        // The texels of the picture that was read last are kept, so its file is not read again.
        std::fs::remove_file(&dark).unwrap();
        assert_eq!(red(&mut cache, &dark), 0.25);
        // If two requests in a row have the same picture and the same strength, they also share the texels that
        // were multiplied by this strength.
        let mut texels = |strength| cache.picture(&dark, strength).unwrap().texels;
        let [one, again, stronger] = [2.0, 2.0, 4.0].map(&mut texels);
        assert!(Arc::ptr_eq(&one, &again));
        assert_eq!([one[0][0], stronger[0][0], texels(2.0)[0][0]], [0.5, 1.0, 0.5]);
    }
}
