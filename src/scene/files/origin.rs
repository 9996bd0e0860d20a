//! Moves meshes that are far from the origin, such as maps, since single precision could not distinguish many
//! of their points.

use super::mistake;
use crate::error::Result;
use crate::scene::MAX_COORDINATE;
use glam::{DVec3, Vec3};

/// A mesh counts as far from the origin if its centre is this many radii away; f32 has then lost four of its
/// 24 bits.
const FAR_RADII: f64 = 16.0;

/// Returns the vector to be subtracted from the positions of a mesh with these bounds: its centre in whole
/// numbers if it is far away, else zero.
pub(in crate::scene) fn origin_of(low: DVec3, high: DVec3) -> DVec3 {
    let (centre, radius) = ((low + high) / 2.0, (high - low).length() / 2.0);
    let far = centre.is_finite() && centre.length() > FAR_RADII * radius;
    // A small mesh need not contain a point with whole coordinates.
    let rounded = if radius > 1.0 { centre.round() } else { centre };
    if far { rounded } else { DVec3::ZERO }
}

/// Returns positions in single precision, and the vector that was subtracted from them.
pub(super) fn settle(name: &str, positions: &[DVec3]) -> Result<(Vec<Vec3>, DVec3)> {
    let most = f64::from(MAX_COORDINATE);
    let odd = positions.iter().position(|p| !(p.is_finite() && p.abs().max_element() <= most));
    if let Some(vertex) = odd {
        let what = format!("vertex {vertex} is at {}", positions[vertex]);
        return Err(mistake(
            name,
            format!("{what}; expected finite coordinates within +-{MAX_COORDINATE:e}"),
        ));
    }
    let low = positions.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = positions.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let origin = origin_of(low, high);
    Ok((positions.iter().map(|position| (position - origin).as_vec3()).collect(), origin))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_is_settled_with_its_centimetres_and_a_mesh_nearby_keeps_its_bits() {
        let utm = DVec3::new(500_000.0, 5_400_000.0, 200.0);
        let corners = [utm, utm + DVec3::new(0.01, 0.0, 0.0), utm + DVec3::new(100.0, 80.0, 5.0)];
        let (positions, origin) = settle("map", &corners).expect("finite positions");
        assert_eq!(origin, (utm + DVec3::new(50.0, 40.0, 2.5)).round());
        assert!((positions[1].x - positions[0].x - 0.01).abs() < 1e-5);
        let near = [DVec3::new(0.1, 5.0, 0.0), DVec3::new(1.0, 6.0, 0.0)];
        let (positions, origin) = settle("near", &near).expect("finite positions");
        assert_eq!((positions[0], origin), (Vec3::new(0.1, 5.0, 0.0), DVec3::ZERO));
    }

    #[test]
    fn what_is_not_finite_or_too_far_is_refused() {
        for x in [f64::NAN, f64::INFINITY, 1e13] {
            assert!(settle("odd", &[DVec3::ZERO, DVec3::X * x]).is_err(), "{x}");
        }
    }
}
