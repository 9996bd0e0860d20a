//! Textures: pictures that give surfaces their colours or, as masks, their holes.

use super::Material;
use super::files::linear;
use crate::manifest::TEXTURE_HEAD_WORDS;
use std::sync::Arc;

/// How a texture continues beyond its edges, along an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// The texture is repeated.
    #[default]
    Repeat = 0,
    /// The texels at the edge continue beyond the edge.
    Clamp = 1,
    /// The texture is repeated, and every second copy is mirrored.
    Mirror = 2,
}

/// The number of units of [`Texture::least_alpha`] (65535ths) in one step of an 8-bit channel (255ths).
pub const LEAST_ALPHA_UNIT: u16 = u16::MAX / 255;

/// A picture with 8 bits per channel, as displayed (sRGB), row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Number of texels across and down.
    pub size: [u32; 2],
    /// How the texture continues beyond its edges, across and down.
    pub wrap: [Wrap; 2],
    /// For a mask (a texture whose alpha defines holes): the least alpha of a point that is not in a hole, in
    /// 65535ths. For a texture that is no mask: 0.
    pub least_alpha: u16,
    /// One word per texel: red in the lowest 8 bits, then green, blue and alpha. Mip levels, if there are
    /// any, follow the picture's own texels.
    pub texels: Arc<[u32]>,
}

impl Texture {
    /// Returns the alpha, in steps of an 8-bit channel, below which a point counts as a hole. The returned
    /// alpha is one unit of `least_alpha` (a 257th of a step) smaller than `least_alpha`. Otherwise, rounding
    /// could make holes where all texels have exactly the least alpha.
    pub fn least_step(&self) -> f64 {
        (f64::from(self.least_alpha) - 1.0) / f64::from(LEAST_ALPHA_UNIT)
    }

    /// Returns the size of a mip level; level 0 is the picture itself.
    pub fn level_size(&self, level: u32) -> [u32; 2] {
        self.size.map(|side| (side >> level).max(1))
    }

    /// Returns the index of a level's first texel.
    pub fn level_start(&self, level: u32) -> usize {
        let texels = |level| self.level_size(level).iter().map(|side| *side as usize).product::<usize>();
        (0..level).map(texels).sum()
    }

    /// Returns the number of the last mip level; 0 if there are no levels.
    pub fn last_level(&self) -> u32 {
        let has_levels = self.texels.len() > self.level_start(1);
        if has_levels { self.size[0].max(self.size[1]).ilog2() } else { 0 }
    }

    /// Returns true if at least one texel is so transparent that it makes a hole.
    pub(in crate::scene) fn has_holes(&self) -> bool {
        let least = self.least_step();
        self.texels[..self.level_start(1)].iter().any(|texel| f64::from(texel >> 24) < least)
    }

    /// Returns true if the alpha of all texels is 1.
    pub(in crate::scene) fn is_opaque(&self) -> bool {
        self.texels[..self.level_start(1)].iter().all(|texel| texel >> 24 == 0xff)
    }
}

/// A triangle's texture coordinates: (0, 0) is the texture's upper left corner, (1, 1) the lower right one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mapped {
    /// Each corner's coordinates across and down.
    pub corners: [[f32; 2]; 3],
    /// The texture's number in [`Textures::list`]; `None` if the triangle has no colour texture.
    pub texture: Option<u32>,
    /// The number of the mask that defines the triangle's holes; `None` if the triangle has no mask.
    pub mask: Option<u32>,
}

impl Mapped {
    /// Number of floats per triangle on a device, without the floats for mip levels.
    const FLOATS: usize = 8;
    /// The largest absolute value of a coordinate that need not be read in double precision. Up to this
    /// value, single precision has steps of at most 2^-18.
    pub(super) const NEAR: f64 = 64.0;
    /// A triangle without a texture.
    pub const NONE: Self = Self { corners: [[0.0; 2]; 3], texture: None, mask: None };

    /// Returns a triangle's coordinates in a texture with the wrap modes `wrap`. If the texture is repeated
    /// or mirrored, the coordinates are shifted close to 0 before they are rounded to single precision,
    /// because single precision is finest there. The coordinates are shifted by a whole number of copies of
    /// the texture (an even number if it is mirrored), so the triangle looks the same.
    pub fn new(corners: [[f64; 2]; 3], texture: Option<u32>, mask: Option<u32>, wrap: [Wrap; 2]) -> Self {
        // Coordinates near 0 are also rounded to single precision before they are shifted, so that they get
        // the same bits whether they were read in single or in double precision.
        let rounded = |value: f64| if value.abs() > Self::NEAR { value } else { f64::from(value as f32) };
        let mut corners = corners.map(|corner| corner.map(rounded));
        for (axis, wrap) in wrap.into_iter().enumerate() {
            let least = corners.iter().map(|corner| corner[axis]).fold(f64::INFINITY, f64::min);
            let whole = match wrap {
                Wrap::Repeat => least.floor(),
                Wrap::Clamp => 0.0,
                Wrap::Mirror => 2.0 * (least / 2.0).floor(),
            };
            corners.iter_mut().for_each(|corner| corner[axis] -= whole);
        }
        let corners = corners.map(|corner| corner.map(|value| value as f32));
        Self { corners, texture, mask }
    }

    /// Returns the number of floats per triangle on a device. With mip levels, a triangle has four more
    /// floats: the triangle's normal times the side of a texel (from `texel_on` in `mip.rs`), and a zero.
    pub fn floats(mip_levels: bool) -> usize {
        if mip_levels { Self::FLOATS + 4 } else { Self::FLOATS }
    }

    /// Returns the words for a device: u and v of the corners, the texture's number (-1 without a texture),
    /// and the mask's number plus 1 (0 without a mask).
    pub fn to_words(self) -> [u32; Self::FLOATS] {
        let [[a, b], [c, d], [e, f]] = self.corners.map(|corner| corner.map(f32::to_bits));
        [a, b, c, d, e, f, self.texture.unwrap_or(u32::MAX), self.mask.map_or(0, |mask| mask + 1)]
    }
}

/// All textures of a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Textures {
    /// The textures: pictures with their wrap modes.
    pub list: Vec<Texture>,
    /// The texture coordinates, texture and mask of each triangle, in the order of the mesh's triangles; empty
    /// if no triangle has a texture or a mask, and no material has an emission texture.
    pub mapped: Vec<Mapped>,
}

impl Textures {
    /// Makes textures from a list, the mapping of each triangle, and the triangles' materials. A mask that
    /// makes no holes is removed from the mappings of its triangles. The returned textures are empty if no
    /// triangle has a texture or a mask with holes, and no material has an emission texture.
    pub fn of(list: Vec<Texture>, mut mapped: Vec<Mapped>, materials: &[Material]) -> Self {
        let have_holes: Vec<bool> = list.iter().map(Texture::has_holes).collect();
        for row in &mut mapped {
            row.mask = row.mask.filter(|mask| have_holes[*mask as usize]);
        }
        let is_bare = |row: &Mapped| row.texture.is_none() && row.mask.is_none();
        let emits = materials.iter().any(|material| material.emission_texture.is_some());
        if !emits && mapped.iter().all(is_bare) { Self::default() } else { Self { list, mapped } }
    }

    /// Returns the number of 32-bit words of all textures on a device; 0 if there are no textures. Textures
    /// with the same texels in memory share these texels on the device.
    pub fn word_count(&self) -> usize {
        if self.list.is_empty() {
            return 0;
        }
        let own = self.list.iter().enumerate().filter(|(number, _)| self.same_as(*number).is_none());
        self.head_words() + own.map(|(_, texture)| texture.texels.len()).sum::<usize>()
    }

    /// Returns the number of words before the first texel on a device.
    pub(crate) fn head_words(&self) -> usize {
        linear_values().len() + TEXTURE_HEAD_WORDS * self.list.len()
    }

    /// Returns the number of the first texture whose texels in memory are those of the texture `number`;
    /// `None` if this first texture is the texture `number` itself. Two textures of one picture may differ in
    /// their wrap mode, or one may be a colour and the other a mask.
    pub(crate) fn same_as(&self, number: usize) -> Option<usize> {
        let texels = &self.list[number].texels;
        self.list[..number].iter().position(|other| Arc::ptr_eq(&other.texels, texels))
    }

    /// Returns true if at least one triangle has a mask.
    pub fn have_holes(&self) -> bool {
        self.mapped.iter().any(|row| row.mask.is_some())
    }

    /// Adds the textures of another mesh, whose triangles follow those of this mesh. This mesh has
    /// `own_triangles` triangles, and the other mesh has `other_triangles`.
    pub fn append(&mut self, own_triangles: usize, other: Self, other_triangles: usize) {
        if self.list.is_empty() && other.list.is_empty() {
            return;
        }
        let first = self.list.len() as u32;
        self.mapped.resize(own_triangles, Mapped::NONE);
        let shifted = |row: Mapped| Mapped {
            texture: row.texture.map(|number| number + first),
            mask: row.mask.map(|number| number + first),
            ..row
        };
        self.mapped.extend(other.mapped.into_iter().map(shifted));
        self.mapped.resize(own_triangles + other_triangles, Mapped::NONE);
        self.list.extend(other.list);
    }

    /// Swaps the texture coordinates of every triangle's second and third corner, since mirroring a mesh
    /// swaps these corners.
    pub fn mirror(&mut self) {
        self.mapped.iter_mut().for_each(|row| row.corners.swap(1, 2));
    }
}

/// Returns the linear light, from 0 to 1, of each 8-bit value of an sRGB channel.
pub fn linear_values() -> [f32; 256] {
    std::array::from_fn(|value| linear(value as f32 / 255.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texture() -> Texture {
        Texture { size: [1, 1], wrap: [Wrap::Repeat; 2], least_alpha: 0, texels: Arc::from([0]) }
    }

    #[test]
    fn coordinates_move_by_whole_textures_only() {
        let corners = [[7.25, -3.5], [7.5, -3.25], [9.0, -1.0]];
        let of = |wrap| Mapped::new(corners, Some(0), None, [wrap; 2]).corners;
        assert_eq!(of(Wrap::Repeat), [[0.25, 0.5], [0.5, 0.75], [2.0, 3.0]]);
        assert_eq!(of(Wrap::Mirror), [[1.25, 0.5], [1.5, 0.75], [3.0, 3.0]]);
        assert_eq!(of(Wrap::Clamp).map(|corner| corner.map(f64::from)), corners);
    }

    #[test]
    fn coordinates_far_from_0_move_before_they_are_rounded_and_those_near_0_are_rounded_first() {
        let near = [[0.1, 0.2], [0.7, 2.3], [1.4, 0.9]];
        let far = near.map(|[u, v]| [u + 1e6, v - 1e6]);
        for wrap in [Wrap::Repeat, Wrap::Mirror] {
            let [near, far] = [near, far].map(|corners| Mapped::new(corners, Some(0), None, [wrap; 2]));
            assert_eq!(far, near);
        }
        // If coordinates near 0 were not rounded before they are shifted, the first corner's coordinate would
        // be one unit in the last place smaller.
        let corners = [[1.0 - f64::from(0.001_f32), 0.0], [-0.5, 0.0], [0.0, 0.0]];
        let moved = Mapped::new(corners, Some(0), None, [Wrap::Repeat; 2]).corners;
        assert_eq!(moved.map(|[u, _]| u), [(1.0_f32 - 0.001) + 1.0, 0.5, 1.0]);
    }

    #[test]
    fn meshes_with_and_without_textures_are_joined() {
        let mapped = Mapped::new([[0.0; 2]; 3], Some(0), None, [Wrap::Repeat; 2]);
        let one = Textures::of(vec![texture()], vec![mapped], &[]);
        let mut all = Textures::default();
        all.append(2, Textures::default(), 3);
        assert_eq!(all, Textures::default());
        all.append(5, one.clone(), 1);
        all.append(6, one, 2);
        let numbers: Vec<_> = all.mapped.iter().map(|row| row.texture).collect();
        assert_eq!(numbers, [None, None, None, None, None, Some(0), Some(1), None]);
        assert_eq!(Textures::of(vec![texture()], vec![Mapped::NONE], &[]), Textures::default());
    }

    #[test]
    fn masks_of_joined_meshes_are_their_own_textures() {
        let masked = Mapped { mask: Some(0), ..Mapped::NONE };
        let one = Textures { list: vec![texture()], mapped: vec![masked] };
        let mut all = one.clone();
        all.append(1, one, 1);
        assert_eq!(all.mapped.iter().map(|row| row.mask).collect::<Vec<_>>(), [Some(0), Some(1)]);
    }

    #[test]
    fn masks_that_hide_nothing_are_left_out() {
        let mask = |alpha: u32, least_alpha| Texture {
            least_alpha,
            texels: Arc::from([0xff00_0000, alpha << 24]),
            size: [2, 1],
            ..texture()
        };
        let row = |number| Mapped { mask: Some(number), ..Mapped::NONE };
        let list = vec![mask(128, 128 * 257), mask(127, 128 * 257), mask(0, 0), mask(255, u16::MAX)];
        let made = Textures::of(list, (0..4).map(row).collect(), &[]);
        let masks: Vec<_> = made.mapped.iter().map(|row| row.mask).collect();
        assert_eq!(masks, [None, Some(1), None, None]);
        assert!(made.have_holes());
    }

    #[test]
    fn a_device_gets_the_coordinates_and_the_numbers_of_both_textures() {
        let corners = [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]];
        let words = |texture, mask| Mapped { corners, texture, mask }.to_words();
        let floats = [1.0_f32, 2.0, 3.0, 4.0, 5.0, 6.0].map(f32::to_bits);
        assert_eq!(words(Some(7), Some(8))[..6], floats);
        assert_eq!(words(Some(7), Some(8))[6..], [7, 9]);
        assert_eq!(words(None, None)[6..], [u32::MAX, 0]);
        // With mip levels, each triangle has four more floats: three for its normal times the side of a
        // texel, and one that is 0.
        assert_eq!([false, true].map(Mapped::floats), [8, 12]);
    }

    #[test]
    fn a_mirrored_triangle_has_its_corners_in_the_other_order() {
        let corners = [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]];
        let mapped = vec![Mapped { corners, ..Mapped::NONE }];
        let mut textures = Textures { list: vec![texture()], mapped };
        textures.mirror();
        assert_eq!(textures.mapped[0].corners, [[1.0, 2.0], [5.0, 6.0], [3.0, 4.0]]);
    }

    /// `least_alpha` counts 65535ths, so 257 of its units are one step of an 8-bit channel. `least_step`
    /// subtracts one unit, so that rounding makes no holes where all texels have exactly the least alpha.
    #[test]
    fn the_least_alpha_is_one_unit_below_its_step() {
        let least_step = |least_alpha| Texture { least_alpha, ..texture() }.least_step();
        assert!((least_step(128 * 257) - (128.0 - 1.0 / 257.0)).abs() < 1e-12);
    }
}
