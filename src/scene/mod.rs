//! Scenes: triangles, materials, lights, a camera.
//!
//! A [`Scene`] that is loaded from a file is validated: every number is finite, every index is in bounds, and
//! every triangle has normals. (Code that makes a scene without a file should call [`Scene::validate`].) Later
//! code does not check these properties again. Devices and the reference use the same `f32` values.

mod animation;
mod area;
mod assemble;
mod camera;
mod coarse;
mod corner_colours;
mod covered;
mod document;
mod enclosed;
mod facing;
mod few_notes;
mod files;
mod frame_cache;
mod framing;
mod inputs;
mod load;
mod material;
mod mesh;
mod mip;
mod normals;
mod obj;
mod orbit;
mod overrides;
mod samples;
mod schema;
mod setting;
mod shapes;
mod sky;
mod studio;
mod texture;
mod tone;
mod transform;
mod validate;
mod wire;

pub use animation::Animation;
pub use area::{Area, AreaShape};
pub use camera::{Camera, PixelFrame};
pub use corner_colours::{COLOUR_STEPS, CornerColours, steps};
pub(crate) use inputs::{INPUTS, Inputs};
pub use load::{Loaded, Shot, load_scene, load_scene_for, load_scene_named_in, load_scene_with};
pub use material::{Material, MaterialKind};
pub use mesh::{Mesh, Triangle};
pub use mip::{srgb_value, texel_on};
pub use orbit::Orbit;
pub use samples::{Sample, SampleCounts, SampleLight, Sampling, pixel_samples, scrambled, sobol};
pub use setting::Setting;
pub use shapes::{Shape, generate};
pub use sky::{Sky, SkyPicture};
pub use texture::{LEAST_ALPHA_UNIT, Mapped, Texture, Textures, Wrap, linear_values};
pub use tone::Tone;
pub(crate) use validate::MAX_POWER;

use glam::Vec3;
use std::sync::Arc;

/// Returns the JSON schema of a scene's file.
pub fn schema() -> serde_json::Value {
    crate::schema::of::<wire::SceneWire>("raycl scene")
}

/// A light. If pixels get several samples, a light with a radius above 0 is a ball, a light with an area is a
/// surface, and a light with neither is a point. With one sample per pixel, every light shines from a single
/// point; a light with an area then shines like a very small surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// The light's position, in the scene's units.
    pub position: Vec3,
    /// The light's power in red, green and blue.
    pub power: Vec3,
    /// The radius of the ball, in the scene's units; 0 for a point light and for an area light.
    pub radius: f32,
    /// The surface of an area light; `None` for a point or a ball.
    pub area: Option<Area>,
}

impl Light {
    /// Returns true if the light is more than a point: it is sampled if pixels get several samples.
    pub fn has_extent(&self) -> bool {
        self.radius > 0.0 || self.area.is_some()
    }
}

/// How radiance becomes 8-bit values: `trunc(255 * tone(exposure * L)^(1/gamma))`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Display {
    /// The factor by which radiance is multiplied before the tone curve is applied; the paper's
    /// factor is 15.
    pub exposure: f32,
    /// The tone curve; the paper's is [`Tone::Clip`].
    pub tone: Tone,
    /// The gamma of the formula: after the tone curve, values are raised to the power 1 / gamma. In the
    /// paper, gamma is 2.2.
    pub gamma: f32,
}

/// The default exposure, which is the paper's.
const PAPER_EXPOSURE: f32 = 15.0;

impl Default for Display {
    fn default() -> Self {
        Self { exposure: PAPER_EXPOSURE, tone: Tone::Clip, gamma: 2.2 }
    }
}

impl Display {
    /// Returns a radiance that is displayed as the 8-bit colour `colour`. With an extreme exposure or gamma,
    /// it is possible that no radiance from 0 to `MAX_POWER` is displayed as `colour`. In this case, the
    /// result is another radiance from 0 to `MAX_POWER`.
    pub fn radiance_of(self, colour: [u8; 3]) -> Vec3 {
        // Half a step is added, since displayed values are rounded down.
        let shown = |value: u8| if value == 0 { 0.0 } else { (f64::from(value) + 0.5).min(255.0) / 255.0 };
        let radiance = |value| {
            let exposed = self.tone.inverse(shown(value).powf(self.gamma.into()));
            let nearest = (exposed / f64::from(self.exposure)) as f32;
            // No half step is added for the displayed value 255, the largest one. If rounding to f32 makes the
            // radiance for 255 too small, it is displayed as 254. The next larger f32 then replaces it.
            let brightness = self.tone.apply(f64::from(self.exposure) * f64::from(nearest));
            let is_too_dark = value == u8::MAX && brightness < 1.0;
            if is_too_dark { nearest.next_up() } else { nearest }
        };
        let radiance = Vec3::from_array(colour.map(radiance));
        // With an exposure of 0, the radiance is not finite. Pictures are then black whatever the radiance is.
        if radiance.is_finite() { radiance.min(Vec3::splat(MAX_POWER)) } else { Vec3::ZERO }
    }
}

/// The radiance of a ray that hits nothing, as in the paper's figures.
pub const PAPER_BACKGROUND: Vec3 = Vec3::new(0.0022, 0.0032, 0.0053);

/// A validated scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The scene's name in reports.
    pub name: String,
    /// All triangles, with their positions, normals and materials. Frames of an animation share the mesh as
    /// long as it does not change.
    pub mesh: Arc<Mesh>,
    /// The lights, in the order of the scene file.
    pub lights: Vec<Light>,
    /// The sky, if there is one.
    pub sky: Option<Sky>,
    /// The camera.
    pub camera: Camera,
    /// The radiance of a ray that hits nothing, unless the ray sees the sky's picture.
    pub background: Vec3,
    /// True if pictures have an alpha channel. Alpha is the share of a pixel that surfaces cover. If the
    /// field is true, the background's radiance is 0.
    pub transparent: bool,
    /// The gap between a hit and the near end of the hit's shadow ray, in the scene's units.
    pub shadow_bias: f32,
    /// True if hits are lit on a smooth surface above their triangles, so that the facets of coarse meshes do
    /// not shadow each other in steps.
    pub smooth_shadows: bool,
    /// How radiance is displayed.
    pub display: Display,
}

impl Scene {
    /// Returns a mutable reference to the mesh. If other scenes share the mesh, it is copied first.
    pub fn mesh_mut(&mut self) -> &mut Mesh {
        Arc::make_mut(&mut self.mesh)
    }

    /// Returns the number of shadow rays of each hit: one to every light, and one to the sky if
    /// there is a sky.
    pub fn shadow_rays_per_hit(&self) -> usize {
        self.lights.len() + usize::from(self.sky.is_some())
    }

    /// Returns true if at least one light has a radius above 0 or an area.
    pub fn has_soft_lights(&self) -> bool {
        self.lights.iter().any(Light::has_extent)
    }

    /// Returns true if at least one light has an area.
    pub fn has_area_lights(&self) -> bool {
        self.lights.iter().any(|light| light.area.is_some())
    }

    /// Returns a hash of everything in the scene that determines the picture. The scene's name is not hashed.
    pub fn content_hash(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        let mesh = &self.mesh;
        let counts = [mesh.positions.len(), mesh.normals.len(), mesh.materials.len(), self.lights.len()];
        hash_words(&mut hasher, counts.into_iter().map(|count| count as u32));
        let vectors = mesh.positions.iter().chain(&mesh.normals);
        hash_words(&mut hasher, vectors.flat_map(|vector| vector.to_array()).map(f32::to_bits));
        let materials = mesh.materials.iter();
        hash_words(&mut hasher, materials.flat_map(|material| material.to_floats()).map(f32::to_bits));
        let lights = self.lights.iter().flat_map(|light| [light.position, light.power]);
        let camera = &self.camera;
        let view = [camera.position, camera.right, camera.up, camera.forward, self.background];
        hash_words(&mut hasher, lights.chain(view).flat_map(|vector| vector.to_array()).map(f32::to_bits));
        let vertical = f32::from(camera.fov_is_vertical);
        let display = [self.display.exposure, self.display.gamma];
        // Scenes with the usual tone curve keep the hash that they had before there were other tone curves.
        let tone = (self.display.tone != Tone::Clip).then_some(self.display.tone as u32);
        hash_words(&mut hasher, tone.into_iter());
        let numbers = [camera.tan_half_fov, vertical, camera.z_near, self.shadow_bias];
        hash_words(&mut hasher, numbers.into_iter().chain(display).map(f32::to_bits));
        let indices = mesh.triangles.iter().flat_map(|t| {
            let ([a, b, c], [d, e, f]) = (t.positions, t.normals);
            [a, b, c, d, e, f, t.material]
        });
        hash_words(&mut hasher, indices);
        // Seven features add to the hash only if the scene has them: textures, transparency, smooth shadows,
        // soft lights, a sky, emitted light and colours of corners. Older versions of raycl did not have these
        // features, so scenes without them have the same hash as in records of older versions.
        for texture in &mesh.textures.list {
            let [across, down] = texture.wrap.map(|wrap| wrap as u32);
            hash_words(&mut hasher, texture.size.into_iter().chain([across, down]));
            hash_words(&mut hasher, texture.texels.iter().copied());
            hash_words(&mut hasher, Some(texture.least_alpha.into()).filter(|least| *least > 0).into_iter());
        }
        if self.transparent {
            hash_words(&mut hasher, [u32::MAX].into_iter());
        }
        if self.smooth_shadows {
            hash_words(&mut hasher, [u32::from_be_bytes(*b"even")].into_iter());
        }
        self.hash_soft_light(&mut hasher);
        hash_words(&mut hasher, mesh.textures.mapped.iter().flat_map(|row| row.to_words()));
        // A marker word comes before emitted light, and another one before the colours of corners, so that
        // the hash distinguishes the two.
        if mesh.is_emissive() {
            hash_words(&mut hasher, [u32::from_be_bytes(*b"emit")].into_iter());
            let emitted = mesh.materials.iter().flat_map(|material| material.emission_floats());
            hash_words(&mut hasher, emitted.map(f32::to_bits));
        }
        if !mesh.corner_colours.is_empty() {
            hash_words(&mut hasher, [u32::from_be_bytes(*b"rgb ")].into_iter());
            hash_words(&mut hasher, mesh.corner_colours.as_flattened().iter().copied());
        }
        hasher.finalize().to_hex()[..16].to_string()
    }

    /// Adds the radii and surfaces of lights, and the sky, to a hash. A scene without soft lights and without
    /// a sky adds nothing to the hash.
    fn hash_soft_light(&self, hasher: &mut blake3::Hasher) {
        if self.has_soft_lights() {
            hash_words(hasher, self.lights.iter().map(|light| light.radius.to_bits()));
        }
        for (number, light) in (0..).zip(&self.lights) {
            let Some(Area { shape, edges }) = light.area else { continue };
            hash_words(hasher, [u32::from_be_bytes(*b"area"), number, shape as u32].into_iter());
            hash_words(hasher, edges.into_iter().flat_map(|edge| edge.to_array()).map(f32::to_bits));
        }
        if let Some(picture) = self.sky.as_ref().and_then(|sky| sky.picture.as_ref()) {
            hash_words(hasher, picture.size.into_iter().chain([picture.is_seen.into()]));
            let numbers =
                picture.ahead.to_array().into_iter().chain(picture.texels.iter().flatten().copied());
            hash_words(hasher, numbers.map(f32::to_bits));
        }
        if let Some(Sky { zenith, horizon, up, reach, .. }) = &self.sky {
            let numbers = [zenith, horizon, up].into_iter().flat_map(|vector| vector.to_array());
            // A marker word comes before the sky's numbers. Without this marker word, the numbers of a sky
            // could result in the same hash as the radii of lights.
            hash_words(hasher, [u32::from_be_bytes(*b"sky ")].into_iter());
            hash_words(hasher, numbers.chain([*reach]).map(f32::to_bits));
        }
    }
}

/// Adds 32-bit words to a hash. Many words are added to the hash at a time, since adding single words would
/// be slow.
fn hash_words(hasher: &mut blake3::Hasher, words: impl Iterator<Item = u32>) {
    let mut piece = Vec::with_capacity(1 << 16);
    for word in words {
        if piece.len() == piece.capacity() {
            hasher.update(&piece);
            piece.clear();
        }
        piece.extend_from_slice(&word.to_le_bytes());
    }
    hasher.update(&piece);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::fixtures::single_triangle;

    /// docs/scenes.md states these values: the defaults of a scene, and the near plane of the paper's scenes.
    #[test]
    fn the_defaults_of_a_scene_are_those_of_the_documents() {
        use super::material::{PAPER_GLOSSY, PAPER_SHININESS};
        assert_eq!(Display::default(), Display { exposure: 15.0, tone: Tone::Clip, gamma: 2.2 });
        assert_eq!(PAPER_BACKGROUND.to_array(), [0.0022, 0.0032, 0.0053]);
        assert_eq!([PAPER_GLOSSY, PAPER_SHININESS], [0.2, 100.0]);
        let Camera { tan_half_fov, z_near, fov_is_vertical, .. } = Camera::PAPER;
        assert_eq!((tan_half_fov, z_near, fov_is_vertical), (1.0, 0.1, false));
    }

    #[test]
    fn scenes_whose_masks_have_different_cutoffs_have_different_hashes() {
        let hash = |least_alpha: u16| {
            let mask = Texture { size: [1, 1], wrap: [Wrap::Repeat; 2], least_alpha, texels: Arc::from([0]) };
            let masked = Mapped { mask: Some(0), ..Mapped::NONE };
            let mut scene = single_triangle();
            scene.mesh_mut().textures = Textures { list: vec![mask], mapped: vec![masked] };
            scene.content_hash()
        };
        assert_ne!(hash(1000), hash(2000));
    }

    #[test]
    fn scenes_with_different_backgrounds_have_different_hashes() {
        let scene = single_triangle();
        let bright = Scene { background: Vec3::ONE, ..scene.clone() };
        assert_ne!(scene.content_hash(), bright.content_hash());
    }

    #[test]
    fn the_hash_of_many_words_is_that_of_their_bytes() {
        let words = 0..40_000_u32;
        let bytes: Vec<u8> = words.clone().flat_map(u32::to_le_bytes).collect();
        let mut hasher = blake3::Hasher::new();
        hash_words(&mut hasher, words);
        assert_eq!(hasher.finalize(), blake3::hash(&bytes));
    }

    #[test]
    fn a_displayed_colour_is_the_radiance_of_the_middle_of_its_step() {
        let display = Display { exposure: 2.0, tone: Tone::Clip, gamma: 2.0 };
        // Displayed values are rounded down, so the middle of the values that are displayed as 127 is 127.5,
        // which is half of 255.
        assert_eq!(display.radiance_of([0, 127, 255]), Vec3::new(0.0, 0.125, 0.5));
        assert_eq!(Display { exposure: 0.0, ..display }.radiance_of([0, 127, 255]), Vec3::ZERO);
        let paper = Display { exposure: 15.0, tone: Tone::Clip, gamma: 2.2 };
        assert_eq!(Display::default(), paper, "as in the paper");
    }

    #[test]
    fn whatever_changes_the_picture_changes_the_hash_and_the_name_does_not() {
        let mut scene = single_triangle();
        scene.sky = Some(Sky { zenith: Vec3::X, horizon: Vec3::Y, up: Vec3::Y, reach: 5.0, picture: None });
        scene.lights[0].area = Some(Area { shape: AreaShape::Rectangle, edges: [Vec3::X, Vec3::Y] });
        let changed = |change: &dyn Fn(&mut Scene)| {
            let mut other = scene.clone();
            change(&mut other);
            other.content_hash() != scene.content_hash()
        };
        assert!(!changed(&|scene| scene.name.push('a')));
        type Change = &'static dyn Fn(&mut Scene);
        let changes: [(&str, Change); 30] = [
            ("position", &|scene| scene.mesh_mut().positions[1].z += 1.0),
            ("normal", &|scene| scene.mesh_mut().normals[0] = Vec3::new(0.5, 0.5, 0.5)),
            ("corners", &|scene| scene.mesh_mut().triangles[0].positions.swap(1, 2)),
            ("triangles", &|scene| scene.mesh_mut().triangles.clear()),
            ("k_L", &|scene| scene.mesh_mut().materials[0].lambertian.y += 0.1),
            ("k_G", &|scene| scene.mesh_mut().materials[0].glossy.z += 0.1),
            ("s", &|scene| scene.mesh_mut().materials[0].shininess += 1.0),
            ("emitted", &|scene| scene.mesh_mut().materials[0].emitted.x = 1.0),
            ("emission texture", &|scene| {
                let material = &mut scene.mesh_mut().materials[0];
                (material.emitted, material.emission_texture) = (Vec3::X, Some(1));
            }),
            ("corner colours", &|scene| scene.mesh_mut().corner_colours = vec![[1, 2, 3]]),
            ("position of a light", &|scene| scene.lights[0].position.x += 1.0),
            ("power", &|scene| scene.lights[0].power.z += 1.0),
            ("radius", &|scene| scene.lights[0].radius = 0.5),
            ("area", &|scene| scene.lights[0].area = None),
            ("edges", &|scene| scene.lights[0].area.as_mut().unwrap().edges[1].z = 3.0),
            ("shape", &|scene| scene.lights[0].area.as_mut().unwrap().shape = AreaShape::Disc),
            ("eye", &|scene| scene.camera.position.x += 1.0),
            ("forward", &|scene| scene.camera.forward = Vec3::X),
            ("field of view", &|scene| scene.camera.tan_half_fov *= 2.0),
            ("vertical", &|scene| scene.camera.fov_is_vertical = !scene.camera.fov_is_vertical),
            ("near", &|scene| scene.camera.z_near += 0.1),
            ("transparent", &|scene| scene.transparent = true),
            ("bias", &|scene| scene.shadow_bias *= 2.0),
            ("smooth shadows", &|scene| scene.smooth_shadows = true),
            ("exposure", &|scene| scene.display.exposure = 7.0),
            ("gamma", &|scene| scene.display.gamma = 1.0),
            ("tone", &|scene| scene.display.tone = Tone::Filmic),
            ("sky", &|scene| scene.sky = None),
            ("horizon", &|scene| scene.sky.as_mut().unwrap().horizon = Vec3::Z),
            ("reach", &|scene| scene.sky.as_mut().unwrap().reach = 6.0),
        ];
        for (what, change) in changes {
            assert!(changed(change), "{what}");
        }
    }

    #[test]
    fn a_hit_casts_a_shadow_ray_to_each_light_and_to_the_sky() {
        let mut scene = single_triangle();
        let lights = scene.lights.len();
        assert_eq!(scene.shadow_rays_per_hit(), lights);
        scene.sky = Some(Sky { zenith: Vec3::X, horizon: Vec3::X, up: Vec3::Y, reach: 5.0, picture: None });
        assert_eq!(scene.shadow_rays_per_hit(), lights + 1);
    }

    /// The expected hashes are those of records in docs/results, from several machines. If a scene or the
    /// hash function changed, the stored times would no longer belong to the scenes in the repository, and
    /// raycl would measure everything again.
    #[test]
    fn the_scenes_of_stored_records_are_those_of_the_repository() {
        let thousand = [("object.0.triangles".to_owned(), toml::Value::Integer(1000))];
        for (name, values, expected) in [
            ("triangle", &[][..], "12aeae492fcd81c3"),
            ("figure-4", &[], "0084ce7bf0fe2074"),
            ("pyramid-upper", &[], "01ff83f22368085b"),
            ("pyramid-lower", &[], "ca4fa660a1b59130"),
            ("gourd", &[], "d70e9b73854276ef"),
            ("teapot", &[], "7483843f6ce33b13"),
            ("still-life", &[], "3fbfcd9bd93a4bb5"),
            ("atrium", &[], "a6450b75a1d5868f"),
            ("terrain", &thousand, "7d20f80ffa3f561f"),
        ] {
            let path = format!("{}/scenes/{name}.toml", env!("CARGO_MANIFEST_DIR"));
            let scene = load_scene_with(std::path::Path::new(&path), values).unwrap().scene;
            assert_eq!(scene.content_hash(), expected, "{name}");
        }
    }
}
