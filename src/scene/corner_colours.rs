//! Colours of triangles' corners. Each colour is stored in one 32-bit word.

use glam::Vec3;

/// The colours of a triangle's three corners.
pub type CornerColours = [u32; 3];

/// The largest stored value of a colour's channel, which takes 10 bits. The stored value is proportional to
/// the square root of linear light, so that dark colours have finer steps than bright ones. A step is at most
/// half as large as a step of 8-bit sRGB.
pub const COLOUR_STEPS: u32 = 1023;

/// The colours of a triangle whose corners have no colours of their own.
pub(super) const WHITE: CornerColours = [COLOUR_STEPS << 20 | COLOUR_STEPS << 10 | COLOUR_STEPS; 3];

/// Returns the word for a linear colour. Channels are limited to 0 to 1.
pub(super) fn packed(linear: Vec3) -> u32 {
    let step = |channel: f32| (channel.clamp(0.0, 1.0).sqrt() * COLOUR_STEPS as f32).round() as u32;
    let [red, green, blue] = linear.to_array().map(step);
    red << 20 | green << 10 | blue
}

/// Returns the stored values of red, green and blue, from 0 to `COLOUR_STEPS`, in the word of a colour.
pub fn steps(word: u32) -> [u32; 3] {
    [word >> 20, word >> 10, word].map(|channel| channel & COLOUR_STEPS)
}

#[cfg(test)]
mod tests {
    use super::super::files::linear;
    use super::*;

    #[test]
    fn every_8_bit_colour_stays_within_a_fifth_of_its_step() {
        for byte in 0..=255_u16 {
            let value = |byte: f32| linear(byte / 255.0);
            let word = packed(Vec3::new(value(f32::from(byte)), 0.0, 1.0));
            let [red, green, blue] = steps(word);
            assert_eq!((green, blue), (0, COLOUR_STEPS));
            let back = (red as f32 / COLOUR_STEPS as f32).powi(2);
            let (low, high) = (value(f32::from(byte) - 0.2), value(f32::from(byte) + 0.2));
            assert!(low <= back && back <= high, "{byte}: {back}");
        }
        assert_eq!([packed(Vec3::ONE); 3], WHITE);
        assert_eq!(packed(Vec3::new(-1.0, 7.0, f32::NAN)), COLOUR_STEPS << 10);
    }
}
