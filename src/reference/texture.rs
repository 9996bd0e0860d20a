//! Colours of triangles from textures; the counterpart for devices is `cl/common/textures.cl`.

use super::real::{Real, Vector};
use crate::scene::{Mapped, Mesh, Texture, Wrap, linear_values};
use glam::Vec3;
use std::ops::{Add, Mul};
use std::sync::LazyLock;

static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(linear_values);

/// Returns the texture's colour at a point of a triangle with these weights: four texels, mixed in linear
/// light. `None` without a texture.
pub fn texture_colour<R: Real>(mesh: &Mesh, triangle: u32, weights: [R; 3]) -> Option<R::Vector> {
    let row = mesh.textures.mapped.get(triangle as usize)?;
    let texture = &mesh.textures.list[row.texture? as usize];
    Some(Texels::at(texture, row, weights).mix(linear_colour::<R>))
}

/// The four texels around a point of a texture: two in the row above it, two in the row below.
pub struct Texels<R> {
    texels: [u32; 4],
    /// The shares of the right column and of the lower row.
    shares: [R; 2],
}

impl<R: Real> Texels<R> {
    /// Returns the texels at the point of a triangle with these weights.
    pub fn at(texture: &Texture, row: &Mapped, weights: [R; 3]) -> Self {
        let place = |axis: usize| {
            let [a, b, c] = row.corners.map(|corner| R::from(corner[axis]));
            let place = weights[0] * a + weights[1] * b + weights[2] * c;
            // Centres of texels lie at half-integers, like those of pixels.
            within(place, texture.wrap[axis]) * R::of(texture.size[axis].into()) - R::from(0.5)
        };
        let (x, y) = (place(0), place(1));
        let (left, top) = (x.floor(), y.floor());
        let at = |column: i32, row: i32| texel(texture, left.to_i32() + column, top.to_i32() + row);
        Self { texels: [at(0, 0), at(1, 0), at(0, 1), at(1, 1)], shares: [x - left, y - top] }
    }

    /// Returns the mean of the texels' values, weighted by their shares.
    pub fn mix<T: Copy + Add<Output = T> + Mul<R, Output = T>>(&self, value: impl Fn(u32) -> T) -> T {
        let mix = |a: T, b: T, part: R| a * (R::ONE - part) + b * part;
        let [a, b, c, d] = self.texels.map(value);
        let [right, lower] = self.shares;
        mix(mix(a, b, right), mix(c, d, right), lower)
    }
}

/// Returns a texture coordinate wrapped to the range 0 to 1.
fn within<R: Real>(place: R, wrap: Wrap) -> R {
    match wrap {
        Wrap::Repeat => place - place.floor(),
        Wrap::Clamp => least(place.max(R::ZERO), R::ONE),
        Wrap::Mirror => {
            let two = R::from(2.0);
            let twice = place - two * (place * R::from(0.5)).floor();
            least(twice, two - twice)
        }
    }
}

fn least<R: Real>(a: R, b: R) -> R {
    if a < b { a } else { b }
}

fn texel(texture: &Texture, column: i32, row: i32) -> u32 {
    let [width, height] = texture.size;
    let [x, y] = [(column, 0), (row, 1)].map(|(number, axis)| {
        let size = texture.size[axis] as i32;
        let number = match texture.wrap[axis] {
            Wrap::Repeat => number.rem_euclid(size),
            Wrap::Clamp | Wrap::Mirror => number,
        };
        number.clamp(0, size - 1) as u32
    });
    debug_assert!(x < width && y < height);
    texture.texels[y as usize * width as usize + x as usize]
}

fn linear_colour<R: Real>(texel: u32) -> R::Vector {
    let [red, green, blue, _] = texel.to_le_bytes().map(|value| LINEAR[usize::from(value)]);
    R::Vector::of(Vec3::new(red, green, blue))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Mapped, Textures};
    use glam::DVec3;

    /// Returns the colour at `u` of a texture with two texels, black and white.
    fn colour_at(u: f32, wrap: Wrap) -> f64 {
        let texture =
            Texture { size: [2, 1], wrap: [wrap; 2], least_alpha: 0, texels: vec![0, 0xff_ffff].into() };
        let mapped = vec![Mapped { corners: [[u, 0.3]; 3], texture: Some(0), mask: None }];
        let mesh = Mesh { textures: Textures { list: vec![texture], mapped }, ..Mesh::default() };
        let colour = texture_colour::<f64>(&mesh, 0, [0.25, 0.25, 0.5]).unwrap_or(DVec3::NAN);
        assert!(colour.x == colour.y && colour.y == colour.z);
        colour.x
    }

    #[test]
    fn texels_are_mixed_in_linear_light_and_go_on_as_they_are_asked_to() {
        for (u, wrap, expected) in [
            (0.25, Wrap::Clamp, 0.0),
            (0.5, Wrap::Clamp, 0.5),
            (0.625, Wrap::Clamp, 0.75),
            (0.75, Wrap::Clamp, 1.0),
            (3.0, Wrap::Clamp, 1.0),
            (-9.0, Wrap::Clamp, 0.0),
            (0.0, Wrap::Repeat, 0.5),
            (0.875, Wrap::Repeat, 0.75),
            (1.25, Wrap::Repeat, 0.0),
            (-0.25, Wrap::Repeat, 1.0),
            (0.0, Wrap::Mirror, 0.0),
            (1.0, Wrap::Mirror, 1.0),
            (1.25, Wrap::Mirror, 1.0),
            (1.75, Wrap::Mirror, 0.0),
            (-0.5, Wrap::Mirror, 0.5),
        ] {
            assert!((colour_at(u, wrap) - expected).abs() < 1e-12, "{u} {wrap:?}: {}", colour_at(u, wrap));
        }
    }
}
