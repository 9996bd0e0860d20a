//! The materials of surfaces.

use glam::Vec3;

/// The default diffuse reflectance k_L. The ground in the paper has this k_L.
pub const DEFAULT_LAMBERTIAN: f32 = 0.8;
/// The highlight's strength k_G in the paper's figures.
pub const PAPER_GLOSSY: f32 = 0.2;
/// The highlight's exponent s in the paper's figures.
pub const PAPER_SHININESS: f32 = 100.0;

/// The largest k_L and k_G. Real surfaces have a much lower reflectance. The limit keeps products within
/// single precision.
pub const MAX_REFLECTANCE: f32 = 1e6;
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

/// A surface's reflectance (Hughes et al., *Computer Graphics*, chapter 15).
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
}

impl Default for Material {
    fn default() -> Self {
        Self::lambertian(Vec3::splat(DEFAULT_LAMBERTIAN))
    }
}

impl Material {
    /// Number of floats of a material on a device: k_L, k_G, s, kind.
    pub const FLOATS: usize = 8;

    /// Returns a diffuse material.
    pub const fn lambertian(lambertian: Vec3) -> Self {
        Self { lambertian, glossy: Vec3::ZERO, shininess: 0.0, kind: MaterialKind::Lambertian }
    }

    /// Returns a diffuse material with a highlight.
    pub const fn blinn_phong(lambertian: Vec3, glossy: Vec3, shininess: f32) -> Self {
        Self { lambertian, glossy, shininess, kind: MaterialKind::BlinnPhong }
    }

    /// Returns the floats for a device: k_L (3), k_G (3), s, kind (0 Lambertian, 1 Blinn-Phong).
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
}
