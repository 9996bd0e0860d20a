//! Textures: pictures that surfaces take their colour from.

use super::files::linear;
use std::sync::Arc;

/// How a texture continues beyond its edges, along an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// Repeated from the beginning.
    #[default]
    Repeat = 0,
    /// The texels at the edge continue.
    Clamp = 1,
    /// Mirrored.
    Mirror = 2,
}

/// A picture with 8 bits per channel, as displayed (sRGB), row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Number of texels across and down.
    pub size: [u32; 2],
    /// How it continues across and down.
    pub wrap: [Wrap; 2],
    /// Red in the lowest 8 bits, then green, blue and alpha.
    pub texels: Arc<[u32]>,
}

/// A triangle's texture coordinates: (0, 0) is the texture's upper left corner, (1, 1) the lower right one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mapped {
    /// Each corner's coordinates across and down.
    pub corners: [[f32; 2]; 3],
    /// The texture's number in [`Textures::list`]; `None` if the triangle only has its material's colour.
    pub texture: Option<u32>,
}

impl Mapped {
    /// Number of floats on a device.
    pub const FLOATS: usize = 8;
    /// A triangle without a texture.
    pub const NONE: Self = Self { corners: [[0.0; 2]; 3], texture: None };

    /// Returns a triangle's coordinates in a texture with these wrap modes, shifted close to the beginning,
    /// where single precision is finest.
    pub fn new(corners: [[f32; 2]; 3], texture: u32, wrap: [Wrap; 2]) -> Self {
        let mut corners = corners;
        for (axis, wrap) in wrap.into_iter().enumerate() {
            let least = corners.iter().map(|corner| corner[axis]).fold(f32::INFINITY, f32::min);
            let whole = match wrap {
                Wrap::Repeat => least.floor(),
                Wrap::Clamp => 0.0,
                Wrap::Mirror => 2.0 * (least / 2.0).floor(),
            };
            corners.iter_mut().for_each(|corner| corner[axis] -= whole);
        }
        Self { corners, texture: Some(texture) }
    }

    /// Returns the words for a device: u and v of the corners, the texture's number or -1, an unused word.
    pub fn to_words(self) -> [u32; Self::FLOATS] {
        let [[a, b], [c, d], [e, f]] = self.corners.map(|corner| corner.map(f32::to_bits));
        [a, b, c, d, e, f, self.texture.unwrap_or(u32::MAX), 0]
    }
}

/// All textures of a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Textures {
    /// The pictures.
    pub list: Vec<Texture>,
    /// One per triangle, in the mesh's order; empty if no triangle has a texture.
    pub mapped: Vec<Mapped>,
}

impl Textures {
    /// Makes textures with the mapping of each triangle; empty if no triangle has a texture.
    pub fn of(list: Vec<Texture>, mapped: Vec<Mapped>) -> Self {
        if mapped.iter().all(|row| row.texture.is_none()) { Self::default() } else { Self { list, mapped } }
    }

    /// Adds the textures of a mesh whose triangles follow this one's.
    pub fn append(&mut self, own_triangles: usize, other: Self, other_triangles: usize) {
        if self.list.is_empty() && other.list.is_empty() {
            return;
        }
        let first = self.list.len() as u32;
        self.mapped.resize(own_triangles, Mapped::NONE);
        let shifted = |row: Mapped| Mapped { texture: row.texture.map(|number| number + first), ..row };
        self.mapped.extend(other.mapped.into_iter().map(shifted));
        self.mapped.resize(own_triangles + other_triangles, Mapped::NONE);
        self.list.extend(other.list);
    }

    /// Swaps the second and the third corner of every triangle.
    pub fn mirror(&mut self) {
        self.mapped.iter_mut().for_each(|row| row.corners.swap(1, 2));
    }
}

/// Returns the linear light of each value of a channel.
pub fn linear_values() -> [f32; 256] {
    std::array::from_fn(|value| linear(value as f32 / 255.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texture() -> Texture {
        Texture { size: [1, 1], wrap: [Wrap::Repeat; 2], texels: Arc::from([0]) }
    }

    #[test]
    fn coordinates_move_by_whole_textures_only() {
        let corners = [[7.25, -3.5], [7.5, -3.25], [9.0, -1.0]];
        let of = |wrap| Mapped::new(corners, 0, [wrap; 2]).corners;
        assert_eq!(of(Wrap::Repeat), [[0.25, 0.5], [0.5, 0.75], [2.0, 3.0]]);
        assert_eq!(of(Wrap::Mirror), [[1.25, 0.5], [1.5, 0.75], [3.0, 3.0]]);
        assert_eq!(of(Wrap::Clamp), corners);
    }

    #[test]
    fn meshes_with_and_without_textures_are_joined() {
        let mapped = Mapped::new([[0.0; 2]; 3], 0, [Wrap::Repeat; 2]);
        let one = Textures::of(vec![texture()], vec![mapped]);
        let mut all = Textures::default();
        all.append(2, Textures::default(), 3);
        assert_eq!(all, Textures::default());
        all.append(5, one.clone(), 1);
        all.append(6, one, 2);
        let numbers: Vec<_> = all.mapped.iter().map(|row| row.texture).collect();
        assert_eq!(numbers, [None, None, None, None, None, Some(0), Some(1), None]);
        assert_eq!(Textures::of(vec![texture()], vec![Mapped::NONE]), Textures::default());
    }
}
