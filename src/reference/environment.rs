//! A sky that is a picture of all directions; the counterpart for devices is `cl/common/environment.cl`.

use super::real::{Real, Vector};
use crate::scene::{Sky, SkyPicture};
use glam::Vec3;

/// Returns the sky's radiance in a direction: a bilinear mean of four texels.
pub fn radiance_of_picture<R: Real>(sky: &Sky, picture: &SkyPicture, way: R::Vector) -> R::Vector {
    let [width, height] = picture.size.map(|side| R::of(side.into()));
    let (middle, up) = (R::Vector::of(picture.ahead), R::Vector::of(sky.up));
    let (ahead, right) = (way.dot(middle), way.dot(middle.cross(up)));
    let half = R::from(0.5);
    let around = half + half * right.atan2(ahead) * (R::ONE / R::PI);
    let below = (right * right + ahead * ahead).sqrt().atan2(way.dot(up)) * (R::ONE / R::PI);
    let (x, y) = (around * width - half, below * height - half);
    let (left, top) = (x.floor(), y.floor());
    let at = |column: i32, row: i32| texel::<R>(picture, left.to_i32() + column, top.to_i32() + row);
    let mix = |a: R::Vector, b: R::Vector, part: R| a * (R::ONE - part) + b * part;
    let (upper, lower) = (mix(at(0, 0), at(1, 0), x - left), mix(at(0, 1), at(1, 1), x - left));
    mix(upper, lower, y - top)
}

/// Returns a texel; columns wrap around, rows are clamped at the zenith and the nadir.
fn texel<R: Real>(picture: &SkyPicture, column: i32, row: i32) -> R::Vector {
    let [width, height] = picture.size.map(|side| side as i32);
    let (x, y) = (column.rem_euclid(width), row.clamp(0, height - 1));
    R::Vector::of(Vec3::from_array(picture.texels[(y * width + x) as usize]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    const SKY: Sky = Sky { zenith: Vec3::ZERO, horizon: Vec3::ZERO, up: Vec3::Y, reach: 1.0, picture: None };

    #[test]
    fn the_left_edge_is_the_right_one() {
        let texels = [1.0, 2.0, 3.0, 8.0].map(|value| [value; 3]);
        let picture = SkyPicture { size: [4, 1], texels: texels.into(), ahead: Vec3::Z, is_seen: true };
        let behind = radiance_of_picture::<f64>(&SKY, &picture, DVec3::NEG_Z);
        assert!((behind.x - 4.5).abs() < 1e-9, "{behind}");
    }

    #[test]
    fn rows_lead_from_the_zenith_to_the_nadir() {
        let texels = [1.0, 3.0].map(|value| [value; 3]);
        let picture = SkyPicture { size: [1, 2], texels: texels.into(), ahead: Vec3::Z, is_seen: true };
        for (way, expected) in [(DVec3::Y, 1.0), (DVec3::Z, 2.0), (DVec3::NEG_Y, 3.0)] {
            let radiance = radiance_of_picture::<f64>(&SKY, &picture, way);
            assert!((radiance.x - expected).abs() < 1e-9, "{way}: {radiance}");
        }
    }
}
