//! All textures of a scene in a device's memory, in one buffer of words laid out as in
//! `cl/common/textures.cl`.

use super::Queue;
use super::arguments::{Arguments, MASK_ROWS, TEXTURE_ROWS};
use super::buffers::{upload, upload_rows};
use crate::manifest::TEXTURE_HEAD_WORDS;
use crate::scene::{Mapped, Texture, Textures, linear_values};
use ocl::Buffer;
use rayon::prelude::*;
use std::sync::Arc;

/// The textures, and the triangles' texture coordinates.
#[derive(Debug)]
pub(super) struct DeviceTextures {
    pub words: Buffer<u32>,
    /// One row per triangle, in the mesh's order.
    pub rows: Buffer<f32>,
    /// True if some of them make holes in triangles.
    cut_outs: bool,
}

impl DeviceTextures {
    /// Uploads the textures; `None` if there are none.
    pub fn upload(queue: &Queue, textures: &Textures) -> ocl::Result<Option<Self>> {
        if textures.list.is_empty() {
            return Ok(None);
        }
        let rows = upload_rows(queue, [textures.mapped.len(), Mapped::FLOATS], |places, rows| {
            let rows = rows.par_chunks_exact_mut(Mapped::FLOATS).zip(&textures.mapped[places]);
            rows.for_each(|(row, mapped)| row.copy_from_slice(&mapped.to_words().map(f32::from_bits)));
        })?;
        Ok(Some(Self { words: upload(queue, &words(textures))?, rows, cut_outs: textures.have_holes() }))
    }

    /// Adds the textures' arguments: once for shading and, if there are cut-outs, once for rays through their
    /// holes.
    pub fn add_to<'a>(&'a self, arguments: Arguments<'a>) -> Arguments<'a> {
        let arguments = arguments.with(TEXTURE_ROWS, &self.rows).with("texture_words", &self.words);
        if !self.cut_outs {
            return arguments;
        }
        arguments.with(MASK_ROWS, &self.rows).with("mask_words", &self.words)
    }
}

/// Returns the number of words before the first texel.
fn head_words(textures: &Textures) -> usize {
    linear_values().len() + TEXTURE_HEAD_WORDS * textures.list.len()
}

/// Returns the number of words of all textures; 0 if there are none.
pub(super) fn word_count(textures: &Textures) -> usize {
    if textures.list.is_empty() {
        return 0;
    }
    let all = textures.list.iter().enumerate();
    let own = all.filter(|(number, texture)| shares(textures, *number, texture).is_none());
    head_words(textures) + own.map(|(_, texture)| texture.texels.len()).sum::<usize>()
}

/// Returns the first texture, if it comes before this one, that has the same texels: a picture with two wrap
/// modes, or one that is both a colour and a mask.
fn shares(textures: &Textures, number: usize, texture: &Texture) -> Option<usize> {
    textures.list[..number].iter().position(|other| Arc::ptr_eq(&other.texels, &texture.texels))
}

fn words(textures: &Textures) -> Vec<u32> {
    let mut words = Vec::with_capacity(word_count(textures));
    words.extend(linear_values().map(f32::to_bits));
    let mut next = head_words(textures) as u32;
    let mut starts = Vec::new();
    let mut texels = Vec::new();
    for (number, texture) in textures.list.iter().enumerate() {
        let start = shares(textures, number, texture).map_or(next, |other| starts[other]);
        if start == next {
            next += texture.texels.len() as u32;
            texels.push(&texture.texels);
        }
        starts.push(start);
        let ([width, height], [across, down]) = (texture.size, texture.wrap.map(|wrap| wrap as u32));
        words.extend([start, width, height, across | down << 8 | u32::from(texture.least_alpha) << 16]);
    }
    texels.into_iter().for_each(|texels| words.extend_from_slice(texels));
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Wrap;

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
        let words = words(&textures);
        assert_eq!(words.len(), word_count(&textures));
        assert_eq!(words[256..264], [264, 2, 3, 0x100, 270, 1, 1, 2]);
        assert_eq!((words[264], words[269], words[270]), (7, 7, 9));
        assert_eq!((f32::from_bits(words[0]), f32::from_bits(words[255])), (0.0, 1.0));
        assert_eq!(word_count(&Textures::default()), 0);
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
        let words = words(&textures);
        assert_eq!(words.len(), word_count(&textures));
        assert_eq!(words[256..], [264, 1, 2, 0x200, 264, 1, 2, 0x8000_0200, 7, 8]);
    }
}
