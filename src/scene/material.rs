//! The materials of surfaces.

use super::PAPER_EXPOSURE;
use glam::Vec3;

/// The default diffuse reflectance k_L. The ground in the paper has this k_L.
pub const DEFAULT_LAMBERTIAN: f32 = 0.8;
/// The radiance that the default display shows as white. raycl reads the emitted light in mesh files in units of
/// this radiance.
pub(super) const WHITE_RADIANCE: f32 = 1.0 / PAPER_EXPOSURE;
/// The highlight's strength k_G in the paper's figures.
pub const PAPER_GLOSSY: f32 = 0.2;
/// The highlight's exponent s in the paper's figures.
pub const PAPER_SHININESS: f32 = 100.0;

/// The largest k_L and k_G. Real surfaces have a much lower reflectance. Without this limit, products could exceed the
/// range of single precision.
pub const MAX_REFLECTANCE: f32 = 1e6;
/// The largest radiance that a surface emits. Without this limit, sums could exceed the range of single precision.
pub const MAX_EMITTED: f32 = 1e6;
/// The largest exponent s of a highlight; a highlight with this exponent is hardly wider than a point.
pub const MAX_SHININESS: f32 = 1e6;

/// The reflectance formula of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaterialKind {
    /// Diffuse: `k_L / pi`.
    Lambertian,
    /// Diffuse with a highlight: `(k_L + k_G (s + 8) max(0, n.w_h)^s / 8) / pi`. Here n is the surface's
    /// normal, and w_h is the half vector between the directions to the light and to the eye.
    BlinnPhong,
}

/// A surface's reflectance (Hughes et al., *Computer Graphics*, chapter 15) and the radiance that it emits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// k_L, the diffuse reflectance.
    pub lambertian: Vec3,
    /// k_G, the strength of the highlight.
    pub glossy: Vec3,
    /// s, the exponent of the highlight.
    pub shininess: f32,
    /// Which reflectance formula the surface has.
    pub kind: MaterialKind,
    /// The radiance that both sides of the surface emit in every direction. The emitted radiance is added to
    /// the reflected radiance, but does not light other surfaces.
    pub emitted: Vec3,
    /// The index, in [`Textures::list`](super::Textures::list), of the texture by whose colour `emitted` is
    /// multiplied; `None` if the material has no emission texture. A triangle has the same texture
    /// coordinates for this texture as for its colour texture.
    pub emission_texture: Option<u32>,
}

impl Default for Material {
    fn default() -> Self {
        Self::lambertian(Vec3::splat(DEFAULT_LAMBERTIAN))
    }
}

impl Material {
    /// Number of floats of a material on a device, in a scene in which no surface emits light: k_L, k_G, s,
    /// kind.
    pub const FLOATS: usize = 8;
    /// Number of floats of the emitted radiance and its texture. The radiance and the texture follow the
    /// other floats of each material if a surface of the scene emits light.
    pub const EMISSION_FLOATS: usize = 4;

    /// Returns a diffuse material.
    pub const fn lambertian(lambertian: Vec3) -> Self {
        Self {
            lambertian,
            glossy: Vec3::ZERO,
            shininess: 0.0,
            kind: MaterialKind::Lambertian,
            emitted: Vec3::ZERO,
            emission_texture: None,
        }
    }

    /// Returns a diffuse material with a highlight.
    pub const fn blinn_phong(lambertian: Vec3, glossy: Vec3, shininess: f32) -> Self {
        Self { glossy, shininess, kind: MaterialKind::BlinnPhong, ..Self::lambertian(lambertian) }
    }

    /// Gives the material the emission texture that its file names, or no texture if this texture cannot be used.
    /// Without the texture, the surface emits no light: `emitted` alone, without the texture's colours, is usually
    /// white, and would hide the surface's own colour.
    pub(super) fn set_emission_texture(&mut self, texture: Option<u32>) {
        self.emission_texture = texture;
        if texture.is_none() {
            self.emitted = Vec3::ZERO;
        }
    }

    /// Returns true if the surface emits light.
    pub fn is_emissive(&self) -> bool {
        self.emitted != Vec3::ZERO
    }

    /// Returns the number of floats of a material on a device. `emissive` is true if a surface of the scene
    /// emits light.
    pub const fn floats(emissive: bool) -> usize {
        Self::FLOATS + if emissive { Self::EMISSION_FLOATS } else { 0 }
    }

    /// Returns the floats of this material on a device. `emissive` is true if a surface of the scene emits
    /// light.
    pub fn for_device(self, emissive: bool) -> impl Iterator<Item = f32> {
        self.to_floats().into_iter().chain(self.emission_floats()).take(Self::floats(emissive))
    }

    /// Returns the emitted radiance (3 floats), and the index of the emission texture plus 1 (0 without a texture).
    pub fn emission_floats(self) -> [f32; Self::EMISSION_FLOATS] {
        let [r, g, b] = self.emitted.to_array();
        [r, g, b, self.emission_texture.map_or(0.0, |number| (number + 1) as f32)]
    }

    /// Returns the reflectance as floats: k_L (3 floats), k_G (3 floats), s, kind (0 Lambertian, 1 Blinn-Phong).
    pub fn to_floats(self) -> [f32; Self::FLOATS] {
        let kind = match self.kind {
            MaterialKind::Lambertian => 0.0,
            MaterialKind::BlinnPhong => 1.0,
        };
        let [l0, l1, l2] = self.lambertian.to_array();
        let [g0, g1, g2] = self.glossy.to_array();
        [l0, l1, l2, g0, g1, g2, self.shininess, kind]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_gets_both_reflectances_the_exponent_and_the_kind() {
        let glossy = Material::blinn_phong(Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0), 7.0);
        assert_eq!(glossy.to_floats(), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 1.0]);
        assert_eq!(Material::lambertian(Vec3::X).to_floats(), [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn a_device_gets_the_emitted_radiance_only_if_a_surface_emits_light() {
        let lamp = Material {
            emitted: Vec3::new(2.0, 3.0, 4.0),
            emission_texture: Some(0),
            ..Material::lambertian(Vec3::X)
        };
        let floats = |emissive| lamp.for_device(emissive).collect::<Vec<_>>();
        assert_eq!(floats(false), lamp.to_floats());
        assert_eq!(floats(true)[8..], [2.0, 3.0, 4.0, 1.0]);
        assert_eq!((floats(true).len(), Material::default().emission_floats()), (12, [0.0; 4]));
    }
}
