//! What a surface does with light.

use glam::Vec3;

/// Which reflectance formula a surface follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaterialKind {
    /// Diffuse only: `k_L / pi`.
    Lambertian,
    /// Diffuse and a highlight: `(k_L + k_G (s + 8) max(0, n.w_h)^s / 8) / pi`.
    BlinnPhong,
}

/// A surface's reflectance (Hughes et al., *Computer Graphics*, chapter 15).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// k_L, the diffuse reflectance.
    pub lambertian: Vec3,
    /// k_G, the highlight's strength.
    pub glossy: Vec3,
    /// s, the highlight's exponent.
    pub shininess: f32,
    /// The formula.
    pub kind: MaterialKind,
}

impl Material {
    /// Floats a material takes on a device: k_L, k_G, s, kind.
    pub const FLOATS: usize = 8;

    /// A diffuse surface.
    pub const fn lambertian(lambertian: Vec3) -> Self {
        Self { lambertian, glossy: Vec3::ZERO, shininess: 0.0, kind: MaterialKind::Lambertian }
    }

    /// The device's form: k_L (3), k_G (3), s, kind (0 Lambertian, 1 Blinn-Phong).
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
