//! All textures of a scene in a device's memory, in one buffer of words laid out as in
//! `cl/common/textures.cl`.

use super::Queue;
use super::buffers::{upload, upload_rows};
use crate::manifest::TEXTURE_HEAD_WORDS;
use crate::scene::{Mapped, Textures, linear_values};
use ocl::Buffer;
use rayon::prelude::*;

/// The textures, and the triangles' texture coordinates.
#[derive(Debug)]
pub(super) struct DeviceTextures {
    pub words: Buffer<u32>,
    /// One row per triangle, in the mesh's order.
    pub rows: Buffer<f32>,
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
        Ok(Some(Self { words: upload(queue, &words(textures))?, rows }))
    }
}

/// Returns the number of words before the first texel.
fn head_words(textures: &Textures) -> usize {
    linear_values().len() + TEXTURE_HEAD_WORDS * textures.list.len()
}

/// Returns the number of words of all textures; 0 if there are none.
pub(super) fn word_count(textures: &Textures) -> usize {
    match textures.list.is_empty() {
        true => 0,
        false => {
            head_words(textures) + textures.list.iter().map(|texture| texture.texels.len()).sum::<usize>()
        }
    }
}

fn words(textures: &Textures) -> Vec<u32> {
    let mut words = Vec::with_capacity(word_count(textures));
    words.extend(linear_values().map(f32::to_bits));
    let mut first = head_words(textures) as u32;
    for texture in &textures.list {
        let ([width, height], [across, down]) = (texture.size, texture.wrap.map(|wrap| wrap as u32));
        words.extend([first, width, height, across | down << 8]);
        first += texture.texels.len() as u32;
    }
    textures.list.iter().for_each(|texture| words.extend_from_slice(&texture.texels));
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Texture, Wrap};

    #[test]
    fn heads_say_where_texels_are() {
        let texture = |size: [u32; 2], wrap, texel: u32| Texture {
            size,
            wrap,
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
}
