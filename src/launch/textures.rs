//! Puts all textures of a scene into a device's memory, in one buffer of words laid out as in `cl/common/textures.cl`.

use super::Queue;
use super::arguments::Arguments;
use super::buffers::{upload_joined, upload_rows};
use crate::scene::{Mapped, Mesh, Textures, linear_values, texel_on};
use ocl::Buffer;
use rayon::prelude::*;
use std::borrow::Cow;

/// The textures, and the triangles' texture coordinates.
#[derive(Debug)]
pub(super) struct DeviceTextures {
    pub words: Buffer<u32>,
    /// One row per triangle, in the mesh's order. A row contains texture coordinates, and the numbers of the
    /// triangle's texture and mask.
    pub rows: Buffer<f32>,
    /// True if some textures make holes in triangles.
    cut_outs: bool,
}

impl DeviceTextures {
    /// Uploads the textures of a mesh; returns `None` if the mesh has no textures.
    pub fn upload(queue: &Queue, mesh: &Mesh) -> ocl::Result<Option<Self>> {
        let textures = &mesh.textures;
        if textures.list.is_empty() {
            return Ok(None);
        }
        let floats = Mapped::floats(textures.have_levels());
        let rows = upload_rows(queue, [textures.mapped.len(), floats], |triangles, rows| {
            rows.par_chunks_exact_mut(floats)
                .zip(triangles)
                .for_each(|(row, triangle)| write_row(row, mesh, triangle));
        })?;
        let words = upload_joined(queue, &words(textures))?;
        Ok(Some(Self { words, rows, cut_outs: textures.have_holes() }))
    }

    /// Adds the textures' arguments for shading. If there are cut-outs, adds the same two buffers again as
    /// `mask_rows` and `mask_words`, for the test whether rays pass through holes.
    pub fn add_to<'a>(&'a self, arguments: Arguments<'a>) -> Arguments<'a> {
        let arguments = arguments.with("texture_rows", &self.rows).with("texture_words", &self.words);
        if !self.cut_outs {
            return arguments;
        }
        arguments.with("mask_rows", &self.rows).with("mask_words", &self.words)
    }
}

/// Writes a triangle's row: its texture coordinates, and the numbers of its texture and mask. If textures
/// have mip levels, rows also contain the triangle's normal, with the side of a texel on the triangle as its
/// length.
fn write_row(row: &mut [f32], mesh: &Mesh, triangle: usize) {
    let words = mesh.textures.mapped[triangle].to_words();
    let (mapping, texel) = row.split_at_mut(words.len());
    mapping.copy_from_slice(&words.map(f32::from_bits));
    if !texel.is_empty() {
        let [x, y, z] = texel_on(mesh, triangle);
        texel.copy_from_slice(&[x, y, z, 0.0]);
    }
}

/// Returns all textures as a device reads them, in parts: the words before the first texel, then the texels of each
/// picture.
fn words(textures: &Textures) -> Vec<Cow<'_, [u32]>> {
    let mut words = Vec::with_capacity(textures.head_words());
    words.extend(linear_values().map(f32::to_bits));
    let mut next = textures.head_words() as u32;
    let mut starts = Vec::new();
    let mut texels = Vec::new();
    for (number, texture) in textures.list.iter().enumerate() {
        let start = textures.same_as(number).map_or(next, |other| starts[other]);
        if start == next {
            next += texture.texels.len() as u32;
            texels.push(Cow::Borrowed(&texture.texels[..]));
        }
        starts.push(start);
        let ([width, height], [across, down]) = (texture.size, texture.wrap.map(|wrap| wrap as u32));
        let (last, least_alpha) = (texture.last_level(), u32::from(texture.least_alpha));
        words.extend([start, width, height, across | down << 8 | last << 12 | least_alpha << 16]);
    }
    std::iter::once(Cow::Owned(words)).chain(texels).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Texture, Triangle, Wrap};
    use glam::Vec3;

    #[test]
    fn heads_say_where_texels_are() {
        let texture = |size: [u32; 2], wrap, texel: u32| Texture {
            size,
            wrap,
            least_alpha: 0,
            texels: vec![texel; (size[0] * size[1]) as usize].into(),
        };
        let list = vec![
            texture([2, 3], [Wrap::Repeat, Wrap::Clamp], 7),
            texture([1, 1], [Wrap::Mirror, Wrap::Repeat], 9),
        ];
        let textures = Textures { list, mapped: vec![Mapped::NONE] };
        let words = words(&textures).concat();
        assert_eq!(words.len(), textures.word_count());
        assert_eq!(words[256..264], [264, 2, 3, 0x100, 270, 1, 1, 2]);
        assert_eq!((words[264], words[269], words[270]), (7, 7, 9));
        assert_eq!((f32::from_bits(words[0]), f32::from_bits(words[255])), (0.0, 1.0));
        assert_eq!(Textures::default().word_count(), 0);
    }

    #[test]
    fn mip_levels_are_counted_in_the_head_and_lengthen_rows() {
        let texture = Texture {
            size: [2, 1],
            wrap: [Wrap::Clamp, Wrap::Mirror],
            least_alpha: 0x8000,
            texels: vec![7, 8, 9].into(),
        };
        let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        let mapped = vec![Mapped { corners, texture: Some(0), mask: Some(0) }];
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X * 4.0, Vec3::Y * 2.0],
            triangles: vec![Triangle { positions: [0, 1, 2], normals: [0; 3], material: 0 }],
            textures: Textures { list: vec![texture], mapped },
            ..Mesh::default()
        };
        assert_eq!(words(&mesh.textures).concat()[256..], [260, 2, 1, 0x8000_1201, 7, 8, 9]);
        let mut row = vec![f32::NAN; Mapped::floats(true)];
        write_row(&mut row, &mesh, 0);
        // The triangle has a right angle. Its legs are 4 and 2 units long, and cover 2 texels and 1 texel.
        assert_eq!(row[..6], [0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
        assert_eq!((row[6].to_bits(), row[7].to_bits()), (0, 1));
        assert_eq!(row[8..11], [0.0, 0.0, 2.0]);
        let mut short = vec![f32::NAN; Mapped::floats(false)];
        write_row(&mut short, &mesh, 0);
        assert_eq!(short[..6], row[..6]);
    }

    #[test]
    fn one_picture_is_uploaded_once_as_colour_and_mask() {
        let colour = Texture {
            size: [1, 2],
            wrap: [Wrap::Repeat, Wrap::Mirror],
            least_alpha: 0,
            texels: vec![7, 8].into(),
        };
        let mask = Texture { least_alpha: 0x8000, ..colour.clone() };
        let textures = Textures { list: vec![colour, mask], mapped: vec![Mapped::NONE] };
        let words = words(&textures).concat();
        assert_eq!(words.len(), textures.word_count());
        assert_eq!(words[256..], [264, 1, 2, 0x200, 264, 1, 2, 0x8000_0200, 7, 8]);
    }
}
