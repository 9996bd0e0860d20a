//! Mip levels of textures: smaller and smaller versions of a picture, for pixels that are larger than its
//! texels (Williams, "Pyramidal Parametrics", SIGGRAPH 1983).

use super::files::linear;
use super::texture::linear_values;
use super::{Material, Mesh, Texture, Textures};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::{Arc, LazyLock};

/// Weight of a fully transparent texel in a mean of texels. The weight is above 0, so that a region without
/// opaque texels has a colour too.
const TRANSPARENT_WEIGHT: f32 = 1e-4;
/// Largest side of a texel in the scene's units. This value replaces infinity where texture
/// coordinates do not vary.
const LARGEST_TEXEL: f64 = 1e18;

static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(linear_values);
/// The thresholds for rounding linear light to 8-bit values. Element i is the linear light of the displayed
/// value i + 0.5, halfway between two 8-bit values.
static BETWEEN: LazyLock<[f32; 255]> =
    LazyLock::new(|| std::array::from_fn(|value| linear((value as f32 + 0.5) / 255.0)));

/// Linear light in red, green and blue, multiplied by the texel's weight, and alpha from 0 to 1.
type Light = [f32; 4];

impl Mesh {
    /// Adds mip levels to the mesh's textures.
    pub(super) fn add_levels(&mut self) {
        self.textures.add_levels(&mut self.materials);
    }
}

impl Textures {
    /// Adds mip levels to all pictures that are used as colours or as emission textures. A texel of a mip level is a
    /// mean of texels. If a picture is both the colour and the mask of a surface, these means are weighted by the
    /// texels' alpha. `materials` are the mesh's materials.
    pub(super) fn add_levels(&mut self, materials: &mut [Material]) {
        let weights = self.separate_weights(materials);
        let mut made: HashMap<(*const [u32], bool), Arc<[u32]>> = HashMap::new();
        for (texture, by_alpha) in self.list.iter_mut().zip(&weights) {
            let Some(by_alpha) = *by_alpha else { continue };
            let key = (Arc::as_ptr(&texture.texels), by_alpha);
            let levels = || with_levels(texture.size, &texture.texels, by_alpha);
            texture.texels = Arc::clone(made.entry(key).or_insert_with(levels));
        }
        // If a mask's picture is also used as a colour, the mask gets the texels of the colour texture, so
        // that a device stores the texels once.
        let masks = self.list.iter_mut().zip(&weights).filter(|(_, by_alpha)| by_alpha.is_none());
        for (texture, _) in masks {
            let key = Arc::as_ptr(&texture.texels);
            if let Some(texels) = made.get(&(key, true)).or_else(|| made.get(&(key, false))) {
                texture.texels = Arc::clone(texels);
            }
        }
    }

    /// Returns one value per texture: true if the means that form its mip levels are weighted by the texels' alpha,
    /// otherwise false. The value is `None` if the texture is used neither as a colour nor as an emission texture. If
    /// some triangles need a texture whose texels are weighted by their alpha, and other triangles need the same
    /// texture unweighted, the texture is copied. The first triangle with the texture decides whether the texels of the
    /// original texture are weighted. Triangles that need the opposite get the copy. The texels of emission textures
    /// are never weighted by their alpha.
    fn separate_weights(&mut self, materials: &mut [Material]) -> Vec<Option<bool>> {
        let Self { list, mapped } = self;
        let mut weights = vec![None; list.len()];
        let mut copies = HashMap::new();
        let mut weighted = |list: &mut Vec<Texture>, number: u32, by_alpha: bool| {
            if *weights[number as usize].get_or_insert(by_alpha) == by_alpha {
                return number;
            }
            *copies.entry(number).or_insert_with(|| {
                let copy = list[number as usize].clone();
                list.push(copy);
                weights.push(Some(by_alpha));
                list.len() as u32 - 1
            })
        };
        for row in mapped {
            let Some(number) = row.texture else { continue };
            let texels = |number: u32| &list[number as usize].texels;
            let by_alpha = row.mask.is_some_and(|mask| Arc::ptr_eq(texels(mask), texels(number)));
            row.texture = Some(weighted(list, number, by_alpha));
        }
        for number in materials.iter_mut().filter_map(|material| material.emission_texture.as_mut()) {
            *number = weighted(list, *number, false);
        }
        weights
    }

    /// Returns true if at least one picture has mip levels.
    pub fn have_levels(&self) -> bool {
        self.list.iter().any(|texture| texture.last_level() > 0)
    }
}

/// Returns a triangle's unit normal multiplied by the side of a texel on the triangle, in the scene's units.
/// A ray cone that is as wide as a texel's side covers one texel if the cone meets the triangle at a right
/// angle. Returns zeros if the triangle has no area or no texture. For a triangle that has only an emission
/// texture, the texels of this texture count.
pub fn texel_on(mesh: &Mesh, triangle: usize) -> [f32; 3] {
    let row = &mesh.textures.mapped[triangle];
    let emission = || mesh.material(&mesh.triangles[triangle]).emission_texture;
    let Some(number) = row.texture.or_else(emission) else { return [0.0; 3] };
    let [a, b, c] = mesh.corners(&mesh.triangles[triangle]).map(|corner| corner.as_dvec3());
    let normal = (b - a).cross(c - a);
    let size = mesh.textures.list[number as usize].size.map(f64::from);
    let [p, q, r] = row.corners.map(|[u, v]| DVec2::new(f64::from(u) * size[0], f64::from(v) * size[1]));
    let texels = (q - p).perp_dot(r - p).abs();
    let side = (normal.length() / texels).sqrt().min(LARGEST_TEXEL);
    (normal.try_normalize().unwrap_or(DVec3::ZERO) * side).as_vec3().to_array()
}

/// Returns a picture's texels, followed by the texels of its mip levels, down to a single texel.
fn with_levels(mut size: [u32; 2], texels: &[u32], by_alpha: bool) -> Arc<[u32]> {
    let mut levels = Vec::new();
    let mut lights = Vec::new();
    while size != [1, 1] {
        // Each level is made from the unrounded values of the previous one, so that rounding errors do not
        // add up.
        lights = match lights.is_empty() {
            true => halved(size, |index| light_of(texels[index], by_alpha)),
            false => halved(size, |index: usize| lights[index]),
        };
        levels.par_extend(lights.par_iter().map(|light| texel_of(*light, by_alpha)));
        size = size.map(half);
    }
    texels.iter().chain(&levels).copied().collect()
}

/// Returns the width or the height of the next level, in texels, from the width or the height of a level.
fn half(side: u32) -> u32 {
    (side / 2).max(1)
}

/// Returns a level of half the width and half the height, rounded down but at least 1. Each texel of the
/// result is the mean of the part of the larger level that the texel covers.
fn halved(size: [u32; 2], light: impl Fn(usize) -> Light + Sync) -> Vec<Light> {
    let [width, height] = size.map(half);
    let columns: Vec<_> = (0..width).map(|column| covered(size[0], column)).collect();
    let mean = |(down, across): (&Covered, &Covered)| {
        let mut sum = [0.0; 4];
        for (row, share_down) in down.texels() {
            for (column, share_across) in across.texels() {
                let light = light(row * size[0] as usize + column);
                (0..4).for_each(|channel| sum[channel] += share_down * share_across * light[channel]);
            }
        }
        sum
    };
    let mean = &mean;
    let rows = (0..height).into_par_iter().map(|row| covered(size[1], row));
    rows.flat_map_iter(|down| columns.iter().map(move |across| mean((&down, across)))).collect()
}

/// The texels of a level that one texel of the next level covers along an axis.
struct Covered {
    /// The index of the first covered texel.
    first: usize,
    /// The weights of three texels in the mean that becomes the texel of the next level. The weights add up
    /// to 1; a texel that is not covered has the weight 0.
    shares: [f32; 3],
}

impl Covered {
    fn texels(&self) -> impl Iterator<Item = (usize, f32)> {
        (self.first..).zip(self.shares).filter(|(_, share)| *share > 0.0)
    }
}

/// Returns the texels of a mip level that the texel `index` of the next level covers along an axis. The mip
/// level is `side` texels long, and the next level about half as long. If `side` is odd, two neighbouring
/// texels of the next level may each cover a part of the same texel.
fn covered(side: u32, index: u32) -> Covered {
    // The unit of length is chosen so that all coordinates are whole numbers: each of the `side` texels of
    // this level is `next` units long, and each of the `next` texels of the next level is `side` units long.
    let next = half(side);
    let (start, end) = (index * side, (index + 1) * side);
    let first = start / next;
    let share =
        |texel: u32| end.min((texel + 1) * next).saturating_sub(start.max(texel * next)) as f32 / side as f32;
    Covered { first: first as usize, shares: [0, 1, 2].map(|more| share(first + more)) }
}

fn light_of(texel: u32, by_alpha: bool) -> Light {
    let [red, green, blue, alpha] = texel.to_le_bytes();
    let alpha = f32::from(alpha) / 255.0;
    let [red, green, blue] =
        [red, green, blue].map(|value| LINEAR[usize::from(value)] * weight(alpha, by_alpha));
    [red, green, blue, alpha]
}

/// Returns the 8-bit value of an sRGB channel that is nearest to this linear light.
pub fn srgb_value(light: f32) -> u8 {
    BETWEEN.partition_point(|between| *between < light) as u8
}

fn texel_of([red, green, blue, alpha]: Light, by_alpha: bool) -> u32 {
    let displayed = |light: f32| srgb_value(light / weight(alpha, by_alpha));
    u32::from_le_bytes([displayed(red), displayed(green), displayed(blue), (255.0 * alpha).round() as u8])
}

/// Returns the weight of a texel with this alpha. The weight is linear in alpha, so that the weight of a mean
/// alpha equals the mean of the weights.
fn weight(alpha: f32, by_alpha: bool) -> f32 {
    if by_alpha { alpha + TRANSPARENT_WEIGHT } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Mapped, Triangle, Wrap};
    use glam::Vec3;

    fn random_texels(count: u32) -> Vec<u32> {
        (0..count).map(|index| index.wrapping_mul(2_654_435_761) ^ 0x5bd1_e995).collect()
    }

    fn texture(size: [u32; 2], texels: &Arc<[u32]>, least_alpha: u16) -> Texture {
        Texture { size, wrap: [Wrap::Repeat; 2], least_alpha, texels: Arc::clone(texels) }
    }

    fn mean(lights: &[Light]) -> Light {
        let sum = |channel: usize| lights.iter().map(|light| f64::from(light[channel])).sum::<f64>();
        [0, 1, 2, 3].map(|channel| (sum(channel) / lights.len() as f64) as f32)
    }

    fn are_close(a: Light, b: Light, most: f32) -> bool {
        a.into_iter().zip(b).all(|(a, b)| (a - b).abs() <= most)
    }

    #[test]
    fn every_level_has_the_mean_of_the_picture_down_to_a_single_texel() {
        for size in [[8, 8], [16, 2], [1, 9], [5, 3], [7, 13], [1, 1], [30, 26]] {
            let texels = random_texels(size[0] * size[1]);
            let lights: Vec<_> = texels.iter().map(|texel| light_of(*texel, false)).collect();
            let all = with_levels(size, &texels, false);
            let texture = texture(size, &all, 0);
            assert_eq!(all[..texels.len()], texels);
            assert_eq!(texture.level_start(texture.last_level() + 1), all.len());
            assert_eq!(texture.level_size(texture.last_level()), [1, 1], "{size:?}");
            for level in 1..=texture.last_level() {
                let texels = &all[texture.level_start(level)..texture.level_start(level + 1)];
                let of_level: Vec<_> = texels.iter().map(|texel| light_of(*texel, false)).collect();
                // Rounding to 8 bits moves a channel by at most half a step, which is 0.0045 of linear light
                // near white.
                assert!(are_close(mean(&of_level), mean(&lights), 0.0046), "{size:?}, level {level}");
            }
            // Before rounding, a level has the mean of the picture, up to the error of single
            // precision.
            let half = halved(size, |index| lights[index]);
            assert!(are_close(mean(&half), mean(&lights), 1e-6), "{size:?}");
        }
    }

    #[test]
    fn a_texel_of_a_level_is_the_mean_of_the_area_that_it_covers() {
        let shares = |side, index| covered(side, index).texels().collect::<Vec<_>>();
        assert_eq!(shares(4, 1), [(2, 0.5), (3, 0.5)]);
        assert_eq!(shares(5, 0), [(0, 0.4), (1, 0.4), (2, 0.2)]);
        assert_eq!(shares(5, 1), [(2, 0.2), (3, 0.4), (4, 0.4)]);
        assert_eq!((shares(3, 0).len(), shares(1, 0)), (3, vec![(0, 1.0)]));
        // Two texels are black and two are white. The mean is computed in linear light, so it is displayed as
        // 188.
        let all = with_levels([2, 2], &[0xff00_0000, 0xffff_ffff, 0xffff_ffff, 0xff00_0000], false);
        assert_eq!(all[4..], [0xffbc_bcbc]);
    }

    #[test]
    fn transparent_texels_do_not_colour_a_cut_out() {
        let (green, clear) = (0xff00_ff00, 0x0000_00ff);
        let of = |texels: [u32; 4], by_alpha| with_levels([2, 2], &texels, by_alpha)[4];
        assert_eq!(of([green, clear, clear, clear], true), 0x4000_ff01);
        // If a picture is not used as a mask, alpha does not change the weights of its texels.
        assert_eq!(of([green, clear, clear, clear], false), 0x4000_89e1);
        // If all texels are transparent, a colour remains.
        assert_eq!(of([clear; 4], true), clear);
    }

    #[test]
    fn colours_get_levels_and_masks_alone_do_not() {
        let pictures: Vec<Arc<[u32]>> = (0..3).map(|_| [0xff00_ff00, 0x0000_00ff].into()).collect();
        let colour = texture([2, 1], &pictures[0], 0);
        let mirrored = Texture { wrap: [Wrap::Mirror; 2], ..colour.clone() };
        let mask = texture([2, 1], &pictures[1], 0x8000);
        let both = texture([2, 1], &pictures[2], 0x8000);
        let row = |texture, mask| Mapped { texture, mask, ..Mapped::NONE };
        let mapped = vec![row(Some(0), Some(2)), row(Some(1), None), row(Some(3), Some(3))];
        let mut textures = Textures { list: vec![colour, mirrored, mask, both], mapped };
        assert!(!textures.have_levels());
        textures.add_levels(&mut []);
        let texels = |number: usize| &textures.list[number].texels;
        assert!(textures.have_levels() && Arc::ptr_eq(texels(0), texels(1)));
        let levels: Vec<_> = textures.list.iter().map(Texture::last_level).collect();
        assert_eq!((levels, texels(2).len()), (vec![1, 1, 0, 1], 2));
        // Only the last picture is used both as a colour and as the mask of the same surface. Only the texels
        // of the last picture are therefore weighted by their alpha.
        assert_eq!((texels(0)[2], texels(3)[2]), (0x8000_bcbc, 0x8000_ff00));
    }

    #[test]
    fn a_mask_changes_the_colour_of_no_surface_but_its_own() {
        let picture: Arc<[u32]> = [0xff00_ff00, 0x00ff_00ff].into();
        let of = |least_alpha| texture([2, 1], &picture, least_alpha);
        let row = |texture, mask| Mapped { texture: Some(texture), mask, ..Mapped::NONE };
        let levels = |list: Vec<Texture>, mapped: &[Mapped]| {
            let mut textures = Textures { list, mapped: mapped.to_vec() };
            textures.add_levels(&mut []);
            let texels = |row: &Mapped| Some(Arc::clone(&textures.list[row.texture? as usize].texels));
            let shown: Vec<_> = textures.mapped.iter().filter_map(texels).collect();
            (shown, textures)
        };
        let [plain, by_alpha] = [false, true].map(|by_alpha| with_levels([2, 1], &picture, by_alpha));
        assert_ne!(plain, by_alpha);
        let expected = [plain.clone(), by_alpha.clone()];
        // In glTF, a surface with a mask does not share its colour texture with surfaces without a mask.
        let (shown, textures) = levels(vec![of(0), of(0x8000)], &[row(0, None), row(1, Some(1))]);
        assert_eq!((shown, textures.list.len()), (expected.to_vec(), 2));
        // In OBJ, surfaces with and without a mask share a colour texture, which becomes two textures. The mask
        // gets the texels of its own surface's colour texture.
        for swapped in [false, true] {
            let mut mapped = [row(0, None), row(0, Some(1)), row(0, None)];
            let mut expected = [&plain, &by_alpha, &plain].map(Arc::clone);
            if swapped {
                mapped.swap(0, 1);
                expected.swap(0, 1);
            }
            let (shown, textures) = levels(vec![of(0), of(0x8000)], &mapped);
            assert_eq!((shown, textures.list.len()), (expected.to_vec(), 3), "{swapped}");
            assert!(textures.mapped.iter().all(|row| row.mask.is_none_or(|mask| mask == 1)));
            assert_eq!(textures.list[1].texels, by_alpha);
        }
        // If a surface's mask is another picture than its colour texture, the texels of the colour texture
        // are not weighted by alpha.
        let other: Arc<[u32]> = [0xff00_ff00, 0x00ff_00ff].into();
        let (shown, _) = levels(vec![of(0), texture([2, 1], &other, 0x8000)], &[row(0, Some(1))]);
        assert_eq!(shown, [plain]);
    }

    #[test]
    fn the_texels_of_an_emission_texture_are_not_weighted_by_their_alpha() {
        let picture: Arc<[u32]> = [0xff00_ff00, 0x00ff_00ff].into();
        // The surface's colour texture, its mask and its emission texture are the same picture.
        let list = vec![texture([2, 1], &picture, 0), texture([2, 1], &picture, 0x8000)];
        let row = Mapped { texture: Some(0), mask: Some(1), ..Mapped::NONE };
        let mut textures = Textures { list, mapped: vec![row] };
        let mut materials = [Material { emission_texture: Some(0), ..Material::default() }];
        textures.add_levels(&mut materials);
        let texels = |number: Option<u32>| &textures.list[number.unwrap_or(0) as usize].texels;
        assert_eq!(materials[0].emission_texture, Some(2));
        assert_eq!(texels(textures.mapped[0].texture), &with_levels([2, 1], &picture, true));
        assert_eq!(texels(materials[0].emission_texture), &with_levels([2, 1], &picture, false));
    }

    #[test]
    fn a_texel_on_a_triangle_is_as_large_as_its_areas_say() {
        let row = |scale: f32| Mapped {
            corners: [[0.0, 0.0], [scale, 0.0], [0.0, scale]],
            texture: Some(0),
            mask: None,
        };
        let texels: Arc<[u32]> = vec![0; 32].into();
        let mesh = |scale| Mesh {
            positions: vec![Vec3::ZERO, Vec3::X * 2.0, Vec3::Z * 4.0],
            triangles: vec![Triangle { positions: [0, 1, 2], normals: [0; 3], material: 0 }],
            materials: vec![Material::default()],
            textures: Textures { list: vec![texture([8, 4], &texels, 0)], mapped: vec![row(scale)] },
            ..Mesh::default()
        };
        // An area of 2 x 4 units has 8 x 4 texels, so a texel has an area of 1/4.
        assert_eq!(texel_on(&mesh(1.0), 0), [0.0, -0.5, 0.0]);
        assert_eq!(texel_on(&mesh(0.5), 0), [0.0, -1.0, 0.0]);
        assert_eq!(texel_on(&mesh(0.0), 0), [0.0, -(LARGEST_TEXEL as f32), 0.0]);
    }
}
