//! The scene of each frame of a moving picture, and the key by which raycl recognises the file of a frame
//! that it has rendered already.

use super::super::Args;
use crate::error::{Error, Result};
use crate::program::Sources;
use crate::scene::{Animation, Camera, Display, Loaded, Mesh, Orbit, Sampling, Scene, Sky, SkyPicture};
use crate::strategy::Strategy;
use glam::Vec3;
use std::mem::replace;
use std::sync::Arc;

/// The kind of movement from frame to frame.
pub enum Film {
    /// The eye moves once around the scene.
    Turntable { scene: Arc<Scene>, orbit: Orbit, count: u32 },
    /// Values of the scene change from frame to frame, as the table `[animation]` of the scene's file
    /// describes.
    Animation { animation: Box<Animation>, last: Arc<Scene> },
}

impl Film {
    /// Returns the movement that the arguments ask for: a turntable, or the scene's animation.
    pub fn of(args: &Args, loaded: Loaded) -> Result<Self> {
        let scene = Arc::new(loaded.scene);
        if let Some(count) = args.motion.turntable {
            return Ok(Self::Turntable { scene, orbit: loaded.orbit, count });
        }
        let Some(animation) = loaded.animation else {
            let message = format!("{} has no [animation] table", args.subject.scene.display());
            return Err(Error::input(message).with_help(
                "docs/scenes.md explains how to animate a scene; --turntable 120 moves the camera once around any scene, in 120 frames",
            ));
        };
        Ok(Self::Animation { animation: Box::new(animation), last: scene })
    }

    /// Returns the number of frames.
    pub fn count(&self) -> u32 {
        match self {
            Self::Turntable { count, .. } => *count,
            Self::Animation { animation, .. } => animation.frames,
        }
    }

    /// Returns the frames per second that the scene's file asks for; `None` for a turntable, or if the file states
    /// none.
    pub fn rate(&self) -> Option<u16> {
        match self {
            Self::Turntable { .. } => None,
            Self::Animation { animation, .. } => animation.frames_per_second,
        }
    }

    /// Returns an error if a frame from `first` to `last` has values with which the scene's file is not valid. Also
    /// returns an error if one of these frames has a transparent background but frame 1 has none, or the other way
    /// round. Files of meshes and pictures are not read, so some mistakes are found only when their frame is rendered.
    pub fn check(&self, first: u32, last: u32) -> Result<()> {
        match self {
            Self::Turntable { .. } => Ok(()),
            Self::Animation { animation, .. } => animation.check(first..=last),
        }
    }

    /// Returns the scene of a frame. Consecutive scenes share their mesh if the mesh does not change.
    pub fn scene(&mut self, number: u32) -> Result<Arc<Scene>> {
        match self {
            Self::Turntable { scene, orbit, count } => {
                let (camera, lights) = orbit.at(scene, f64::from(number - 1) / f64::from(*count));
                Ok(Arc::new(Scene { camera, lights, ..Scene::clone(scene) }))
            }
            Self::Animation { animation, last } => {
                *last = Arc::new(animation.scene(number, last)?);
                Ok(Arc::clone(last))
            }
        }
    }

    /// Returns `notes`, the notes on the loaded scene, with those on the rendered frames instead of those on frame 1.
    /// The notes on a turntable stay the same.
    pub fn notes(&self, notes: Vec<String>) -> Vec<String> {
        match self {
            Self::Turntable { .. } => notes,
            Self::Animation { animation, .. } => animation.notes(notes),
        }
    }

    /// Returns the part of a frame's key that distinguishes turntables with different numbers of frames. The key of an
    /// animation's frame does not depend on the number of frames, so a longer animation can use the existing frames of
    /// a shorter one.
    fn kind(&self) -> String {
        match self {
            Self::Turntable { count, .. } => format!("turntable {count}"),
            Self::Animation { .. } => "animation".to_owned(),
        }
    }
}

/// Makes the keys of the frames of an animation or a turntable. A key is a hash of the scene's content, the strategy,
/// the picture's size, the samples, the kind of movement (for a turntable, with its number of frames), the frame's
/// number, raycl's version and the kernels.
pub struct Keys {
    shared: String,
    mesh: LastHash<Mesh>,
    /// The texels of the sky's picture, with their hash.
    texels: LastHash<[[f32; 3]]>,
}

/// A large part of a scene, such as its mesh, with the hash of this part. The stored part belongs to the scene of the
/// frame whose key was made last. If consecutive frames share this part of the scene, its hash is computed only once.
struct LastHash<T: ?Sized>(Option<(Arc<T>, String)>);

impl<T: ?Sized> LastHash<T> {
    /// Returns the hash of `part`. If `part` is not the stored part, calls `hash` to compute the hash of `part`, and
    /// stores both.
    fn of(&mut self, part: &Arc<T>, hash: impl FnOnce() -> String) -> &str {
        let known = self.0.take().filter(|(known, _)| Arc::ptr_eq(known, part));
        &self.0.insert(known.unwrap_or_else(|| (Arc::clone(part), hash()))).1
    }
}

impl Keys {
    /// Returns an object that makes the keys of the frames of `film` (an animation or a turntable). The
    /// frames are cast with `kernels`.
    pub fn of(args: &Args, film: &Film, sampling: Sampling, strategy: &Strategy, kernels: &Sources) -> Self {
        let (width, height, version) = (args.subject.width, args.subject.height, env!("CARGO_PKG_VERSION"));
        let Sampling { first, most, half_light } = sampling;
        let shared = format!(
            "{version} {strategy} {width}x{height} samples {first}-{most}, soft {half_light} {} {}",
            film.kind(),
            kernels.hash().unwrap_or_default()
        );
        Self { shared, mesh: LastHash(None), texels: LastHash(None) }
    }

    /// Returns the key (the hash) of the frame `number`. The frame shows `scene`.
    pub fn key(&mut self, scene: &Scene, number: u32) -> String {
        let mut view = Scene { mesh: Arc::default(), ..scene.clone() };
        let picture = view.sky.as_mut().and_then(|sky| sky.picture.as_mut());
        let taken =
            |picture: &mut Arc<SkyPicture>| replace(&mut Arc::make_mut(picture).texels, Arc::from([]));
        let texels = picture.map(taken);
        let view = view.content_hash();
        let mesh = self.mesh.of(&scene.mesh, || alone(&scene.mesh, None).content_hash());
        let texels = match &texels {
            Some(texels) => {
                self.texels.of(texels, || alone(&Arc::default(), Some(Arc::clone(texels))).content_hash())
            }
            None => "no picture",
        };
        let text = format!("{} {mesh} {texels} {view} frame {number}", self.shared);
        blake3::hash(text.as_bytes()).to_hex().to_string()
    }
}

/// Returns a scene that contains only the mesh and, if `texels` is given, a picture of the sky with these
/// texels.
fn alone(mesh: &Arc<Mesh>, texels: Option<Arc<[[f32; 3]]>>) -> Scene {
    let sky = |texels| {
        let picture = SkyPicture { size: [0, 0], texels, ahead: Vec3::ZERO, is_seen: false };
        let [zenith, horizon, up] = [Vec3::ZERO; 3];
        Sky { zenith, horizon, up, reach: 0.0, picture: Some(Arc::new(picture)) }
    };
    Scene {
        name: String::new(),
        mesh: Arc::clone(mesh),
        lights: Vec::new(),
        sky: texels.map(sky),
        camera: Camera::PAPER,
        background: Vec3::ZERO,
        transparent: false,
        shadow_bias: 0.0,
        smooth_shadows: false,
        display: Display::default(),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::reference::fixtures;
    use clap::Parser;
    use glam::DVec3;

    #[test]
    fn the_frames_of_a_turntable_are_equal_parts_of_one_turn() {
        let scene = Arc::new(fixtures::single_triangle());
        let orbit =
            Orbit { centre: DVec3::new(0.0, 0.0, -2.0), up: DVec3::Y, radius: 1.0, with_lights: false };
        let mut film = Film::Turntable { scene: Arc::clone(&scene), orbit, count: 4 };
        for (number, part) in [(1, 0.0), (2, 0.25), (3, 0.5), (4, 0.75)] {
            assert_eq!(film.scene(number).unwrap().camera, orbit.at(&scene, part).0, "frame {number}");
        }
        assert_eq!((film.count(), film.rate(), film.check(1, 4).is_ok()), (4, None, true));
    }

    #[derive(clap::Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    /// Returns a turntable of `count` frames around a triangle.
    fn turntable(count: u32) -> Film {
        let orbit = Orbit { centre: DVec3::ZERO, up: DVec3::Y, radius: 1.0, with_lights: false };
        Film::Turntable { scene: Arc::new(fixtures::single_triangle()), orbit, count }
    }

    #[test]
    fn everything_that_changes_a_frames_picture_changes_its_key() {
        let folder = tempfile::tempdir().unwrap();
        let kernels = folder.path().join("cl");
        std::fs::create_dir_all(kernels.join("cast")).unwrap();
        std::fs::write(kernels.join("cast/shade.cl"), "// Edited.").unwrap();
        let of = |size: [&str; 2], count, sampling, strategy: &str, sources: &Sources| {
            let args =
                Command::parse_from(["render", "a.toml", "--width", size[0], "--height", size[1]]).args;
            let strategy = crate::strategy::preset(strategy).unwrap().strategy;
            Keys::of(&args, &turntable(count), sampling, &strategy, sources)
        };
        let (scene, size, one) = (fixtures::single_triangle(), ["40", "25"], Sampling::ONE);
        let usual = || of(size, 4, one, "naive", &Sources::Embedded);
        let of_mesh = |mesh: Mesh| usual().key(&Scene { mesh: Arc::new(mesh), ..scene.clone() }, 1);
        let keys = [
            usual().key(&scene, 1),
            usual().key(&scene, 2),
            usual().key(&Scene { background: Vec3::ONE, ..scene.clone() }, 1),
            of_mesh(Mesh::default()),
            of(["41", "25"], 4, one, "naive", &Sources::Embedded).key(&scene, 1),
            of(["40", "26"], 4, one, "naive", &Sources::Embedded).key(&scene, 1),
            of(size, 5, one, "naive", &Sources::Embedded).key(&scene, 1),
            of(size, 4, Sampling { first: 2, ..one }, "naive", &Sources::Embedded).key(&scene, 1),
            of(size, 4, Sampling { most: 2, ..one }, "naive", &Sources::Embedded).key(&scene, 1),
            of(size, 4, Sampling { half_light: 2, ..one }, "naive", &Sources::Embedded).key(&scene, 1),
            of(size, 4, one, "deferred", &Sources::Embedded).key(&scene, 1),
            of(size, 4, one, "naive", &Sources::Folder(kernels)).key(&scene, 1),
        ];
        let distinct: std::collections::HashSet<_> = keys.iter().collect();
        assert_eq!(distinct.len(), keys.len(), "{keys:?}");
        // The key of a frame does not depend on the frames before it.
        let mut keys_of_film = usual();
        keys_of_film.key(&Scene { mesh: Arc::default(), ..scene.clone() }, 1);
        assert_eq!(keys_of_film.key(&scene, 1), keys[0]);
    }

    /// Returns a scene under a sky. The sky's picture consists of `texels`, and the picture's middle lies in
    /// the direction `ahead`.
    fn under_sky(texels: &Arc<[[f32; 3]]>, ahead: Vec3) -> Scene {
        let picture = SkyPicture { size: [2, 1], texels: Arc::clone(texels), ahead, is_seen: true };
        let [zenith, horizon, up] = [Vec3::ZERO, Vec3::ZERO, Vec3::Y];
        let sky = Sky { zenith, horizon, up, reach: 1.0, picture: Some(Arc::new(picture)) };
        Scene { sky: Some(sky), ..fixtures::single_triangle() }
    }

    #[test]
    fn the_picture_of_the_sky_belongs_to_the_key_and_is_hashed_once() {
        let args = Command::parse_from(["render", "a.toml"]).args;
        let strategy = crate::strategy::preset("naive").unwrap().strategy;
        let mut keys = Keys::of(&args, &turntable(4), Sampling::ONE, &strategy, &Sources::Embedded);
        let [dark, bright]: [Arc<[[f32; 3]]>; 2] = [0.25, 4.0].map(|value| Arc::from([[value; 3]; 2]));
        let scenes = [
            under_sky(&dark, Vec3::X),
            under_sky(&bright, Vec3::X),
            under_sky(&dark, Vec3::Z),
            fixtures::single_triangle(),
        ];
        let all: Vec<String> = scenes.iter().map(|scene| keys.key(scene, 1)).collect();
        let distinct: std::collections::HashSet<_> = all.iter().collect();
        assert_eq!(distinct.len(), all.len(), "{all:?}");
        assert_eq!(keys.key(&scenes[0], 1), all[0], "a key does not depend on the frames before");
        let last = keys.texels.0.as_mut().unwrap();
        assert!(Arc::ptr_eq(&last.0, &dark));
        last.1 = "another hash".to_owned();
        assert_ne!(keys.key(&scenes[2], 1), all[2], "the same texels are not hashed again");
    }
}
