//! Colours of triangles from textures; the counterpart for devices is `cl/common/textures.cl`.

use super::intersect::Hit;
use super::real::{Real, Vector};
use crate::scene::{COLOUR_STEPS, Mapped, Mesh, Texture, Wrap, linear_values, steps};
use glam::Vec3;
use std::ops::{Add, Mul};
use std::sync::LazyLock;

static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(linear_values);

/// Returns the colour at a hit, interpolated between the colours of the triangle's corners, in linear light; white
/// if corners have no colours. The counterpart for devices is `cl/common/corner_colours.cl`.
pub fn corner_colour<R: Real>(mesh: &Mesh, hit: &Hit<R>) -> R::Vector {
    let Some(corners) = mesh.corner_colours.get(hit.triangle as usize) else {
        return R::Vector::of(Vec3::ONE);
    };
    let linear = |word: u32| {
        let channels = steps(word).map(|step| step as f32);
        let root = R::Vector::of(Vec3::from_array(channels)) * R::of(1.0 / f64::from(COLOUR_STEPS));
        root * root
    };
    let [a, b, c] = corners.map(linear);
    let [w0, w1, w2] = hit.weights;
    a * w0 + b * w1 + c * w2
}

/// Returns the colour of a triangle's texture, in linear light, where a pixel's cone of this direction and width meets
/// the triangle; `None` without a texture.
pub fn texture_colour<R: Real>(
    mesh: &Mesh,
    hit: &Hit<R>,
    direction: R::Vector,
    width: R,
) -> Option<R::Vector> {
    let row = mesh.textures.mapped.get(hit.triangle as usize)?;
    Some(filtered_colour(mesh, row.texture?, hit, direction, width))
}

/// Returns the colour of the triangle's emission texture where a pixel's cone meets the hit; `None` without an
/// emission texture. The hit's emitted radiance is multiplied by this colour.
pub fn emission_colour<R: Real>(
    mesh: &Mesh,
    hit: &Hit<R>,
    direction: R::Vector,
    width: R,
) -> Option<R::Vector> {
    let number = mesh.material(&mesh.triangles[hit.triangle as usize]).emission_texture?;
    Some(filtered_colour(mesh, number, hit, direction, width))
}

/// Returns the colour of the texture `number`, in linear light, where a pixel's cone of this direction and width
/// meets a triangle. Usually, the texels of one mip level are smaller than the pixel, and the texels of the next mip
/// level are larger; the colour is a mean of these two levels.
fn filtered_colour<R: Real>(
    mesh: &Mesh,
    number: u32,
    hit: &Hit<R>,
    direction: R::Vector,
    width: R,
) -> R::Vector {
    let row = &mesh.textures.mapped[hit.triangle as usize];
    let texture = &mesh.textures.list[number as usize];
    let colour = |level| Texels::at(texture, level, row, hit.weights).mix(linear_colour::<R>);
    let last = texture.last_level();
    if last == 0 {
        return colour(0);
    }
    let corners = mesh.corners(&mesh.triangles[hit.triangle as usize]).map(R::Vector::of);
    let level = (width / texel_side(texture, row, corners, direction)).log2();
    let level = least(level.max(R::ZERO), R::of(last.into()));
    let (finer, part) = (level.floor().to_i32() as u32, level - level.floor());
    let coarser = (finer + 1).min(last);
    colour(finer) * (R::ONE - part) + colour(coarser) * part
}

/// Returns the side length of a texel of level 0 on a triangle, foreshortened as it appears from this direction.
fn texel_side<R: Real>(
    texture: &Texture,
    row: &Mapped,
    [a, b, c]: [R::Vector; 3],
    direction: R::Vector,
) -> R {
    let normal = (b - a).cross(c - a);
    let area = normal.dot(normal).sqrt();
    let [p, q, r] = row
        .corners
        .map(|corner| [0, 1].map(|axis: usize| R::from(corner[axis]) * R::of(texture.size[axis].into())));
    let texels = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
    let texels = texels.max(R::ZERO - texels);
    let cosine = direction.dot(normal.normalize_or_zero());
    cosine.max(R::ZERO - cosine) * (area / texels).sqrt()
}

/// The four texels around a point of a texture: two in the row above it, two in the row below.
pub struct Texels<R> {
    texels: [u32; 4],
    /// The shares (weights) of the right column and of the lower row, from 0 to 1.
    shares: [R; 2],
}

impl<R: Real> Texels<R> {
    /// Returns the texels of a mip level at the point of a triangle with these weights.
    pub fn at(texture: &Texture, level: u32, row: &Mapped, weights: [R; 3]) -> Self {
        let (x, y) = (place(texture, level, row, weights, 0), place(texture, level, row, weights, 1));
        let (left, top) = (x.floor(), y.floor());
        let at = |column: i32, row: i32| texel(texture, level, [left.to_i32() + column, top.to_i32() + row]);
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

/// Returns where the point of a triangle with these weights lies along an axis of a mip level, in texels from the
/// centre of the first texel.
pub fn place<R: Real>(texture: &Texture, level: u32, row: &Mapped, weights: [R; 3], axis: usize) -> R {
    let [a, b, c] = row.corners.map(|corner| R::from(corner[axis]));
    let place = weights[0] * a + weights[1] * b + weights[2] * c;
    // Centres of texels lie at half-integers, like centres of pixels.
    within(place, texture.wrap[axis]) * R::of(texture.level_size(level)[axis].into()) - R::from(0.5)
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

/// Returns the texel in this column and row of a mip level. For a place beyond an edge, returns the texel with which
/// the texture continues there.
pub fn texel(texture: &Texture, level: u32, place: [i32; 2]) -> u32 {
    let [width, height] = texture.level_size(level);
    let [x, y] = [(width, 0), (height, 1)].map(|(size, axis)| {
        let (size, number) = (size as i32, place[axis]);
        let number = match texture.wrap[axis] {
            Wrap::Repeat => number.rem_euclid(size),
            Wrap::Clamp | Wrap::Mirror => number,
        };
        number.clamp(0, size - 1) as u32
    });
    debug_assert!(x < width && y < height);
    texture.texels[texture.level_start(level) + y as usize * width as usize + x as usize]
}

fn linear_colour<R: Real>(texel: u32) -> R::Vector {
    let [red, green, blue, _] = texel.to_le_bytes().map(|value| LINEAR[usize::from(value)]);
    R::Vector::of(Vec3::new(red, green, blue))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Mapped, Textures, Triangle};
    use glam::DVec3;

    /// Returns the colour at `u` of a texture with two texels, black and white.
    fn colour_at(u: f32, wrap: Wrap) -> f64 {
        let texture =
            Texture { size: [2, 1], wrap: [wrap; 2], least_alpha: 0, texels: vec![0, 0xff_ffff].into() };
        let mapped = vec![Mapped { corners: [[u, 0.3]; 3], texture: Some(0), mask: None }];
        let mesh = Mesh { textures: Textures { list: vec![texture], mapped }, ..Mesh::default() };
        let hit = Hit { t: 1.0, weights: [0.25, 0.25, 0.5], triangle: 0 };
        let colour = texture_colour::<f64>(&mesh, &hit, DVec3::Z, 0.0).unwrap_or(DVec3::NAN);
        assert!(colour.x == colour.y && colour.y == colour.z);
        colour.x
    }

    /// Returns half a rectangle with a texture of these texels, each of which has a side of 2.
    fn half_rectangle([across, down]: [u32; 2], texels: Vec<u32>) -> Mesh {
        let texture =
            Texture { size: [across, down], wrap: [Wrap::Repeat; 2], least_alpha: 0, texels: texels.into() };
        let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        Mesh {
            positions: vec![Vec3::ZERO, Vec3::X * 2.0 * across as f32, Vec3::Y * 2.0 * down as f32],
            triangles: vec![Triangle { positions: [0, 1, 2], normals: [0; 3], material: 0 }],
            textures: Textures {
                list: vec![texture],
                mapped: vec![Mapped { corners, texture: Some(0), mask: None }],
            },
            ..Mesh::default()
        }
    }

    #[test]
    fn a_cone_of_texels_is_seen_from_between_two_levels() {
        // Levels of 4, 2 and 1 texels across, each of one colour.
        let texels = [[0xff_u32; 16].as_slice(), &[0xff00; 4], &[0xff_0000]].concat();
        let mesh = half_rectangle([4, 4], texels);
        let hit = Hit { t: 1.0, weights: [0.25, 0.25, 0.5], triangle: 0 };
        let at_60_degrees = DVec3::new(0.75_f64.sqrt(), 0.0, -0.5);
        for (width, direction, expected) in [
            (1.0, DVec3::Z, [1.0, 0.0, 0.0]),
            (2.0, DVec3::Z, [1.0, 0.0, 0.0]),
            (2.0 * 2.0_f64.powf(0.25), DVec3::Z, [0.75, 0.25, 0.0]),
            (4.0, DVec3::NEG_Z, [0.0, 1.0, 0.0]),
            (2.0, at_60_degrees, [0.0, 1.0, 0.0]),
            (4.0 * 2.0_f64.sqrt(), DVec3::Z, [0.0, 0.5, 0.5]),
            (100.0, DVec3::Z, [0.0, 0.0, 1.0]),
        ] {
            let colour = texture_colour::<f64>(&mesh, &hit, direction, width).unwrap_or(DVec3::NAN);
            assert!(colour.abs_diff_eq(expected.into(), 1e-12), "{width} {direction}: {colour}");
        }
    }

    #[test]
    fn a_level_follows_from_the_texels_down_as_well_as_from_those_across() {
        for size in [[4, 2], [2, 4]] {
            // Levels of 8, 2 and 1 texels, each of one colour.
            let texels = [[0xff_u32; 8].as_slice(), &[0xff00; 2], &[0xff_0000]].concat();
            let hit = Hit { t: 1.0, weights: [0.25, 0.25, 0.5], triangle: 0 };
            let colour = texture_colour::<f64>(&half_rectangle(size, texels), &hit, DVec3::Z, 4.0);
            assert!(colour.unwrap_or(DVec3::NAN).abs_diff_eq(DVec3::Y, 1e-12), "{size:?}: {colour:?}");
        }
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

    #[test]
    fn a_triangle_looks_the_same_wherever_it_lies() {
        let texels = [[0xff_u32; 16].as_slice(), &[0xff00; 4], &[0xff_0000]].concat();
        let mut mesh = half_rectangle([4, 4], texels);
        mesh.positions.iter_mut().for_each(|position| *position += Vec3::new(10.0, -20.0, 30.0));
        mesh.textures.mapped[0]
            .corners
            .iter_mut()
            .for_each(|corner| *corner = [corner[0] + 3.0, corner[1] - 2.0]);
        let hit = Hit { t: 1.0, weights: [0.25, 0.25, 0.5], triangle: 0 };
        let colour = texture_colour::<f64>(&mesh, &hit, DVec3::Z, 4.0 * 2.0_f64.sqrt());
        assert!(colour.unwrap_or(DVec3::NAN).abs_diff_eq(DVec3::new(0.0, 0.5, 0.5), 1e-6), "{colour:?}");
    }
}
