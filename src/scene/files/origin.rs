//! Moves meshes that are far from the origin, such as maps, since single precision could not distinguish many
//! of their points.

use super::mistake;
use crate::error::Result;
use crate::scene::MAX_COORDINATE;
use crate::scene::mesh::Triangle;
use glam::{DVec3, Vec3};

/// A mesh counts as far from the origin if its centre is this many radii away; f32 has then lost four of its
/// 24 bits.
const FAR_RADII: f64 = 16.0;

/// Returns the vector to be subtracted from the positions of a mesh with these bounds: its centre if it is far
/// away (in whole numbers if the mesh is larger than one unit), else zero.
pub(in crate::scene) fn origin_of(low: DVec3, high: DVec3) -> DVec3 {
    let (centre, radius) = ((low + high) / 2.0, (high - low).length() / 2.0);
    let far = centre.is_finite() && centre.length() > FAR_RADII * radius;
    // A small mesh need not contain a point with whole coordinates.
    let rounded = if radius > 1.0 { centre.round() } else { centre };
    if far { rounded } else { DVec3::ZERO }
}

/// Returns positions in single precision, and the vector that was subtracted from them. Positions that no
/// triangle uses need not be finite: scanners write NaN for points that they did not measure.
pub(super) fn settle(name: &str, positions: &[DVec3], triangles: &[Triangle]) -> Result<(Vec<Vec3>, DVec3)> {
    if !positions.iter().all(is_valid) {
        check(name, positions, triangles)?;
    }
    let valid = || positions.iter().copied().filter(is_valid);
    let low = valid().fold(DVec3::INFINITY, DVec3::min);
    let high = valid().fold(DVec3::NEG_INFINITY, DVec3::max);
    let origin = origin_of(low, high);
    // An unused position that is not valid gets a value that does not enlarge the mesh.
    let instead = valid().next().unwrap_or(origin);
    let settled = |position: &DVec3| if is_valid(position) { *position } else { instead } - origin;
    Ok((positions.iter().map(|position| settled(position).as_vec3()).collect(), origin))
}

fn is_valid(position: &DVec3) -> bool {
    position.is_finite() && position.abs().max_element() <= f64::from(MAX_COORDINATE)
}

/// Refuses triangles with a position that is not valid.
fn check(name: &str, positions: &[DVec3], triangles: &[Triangle]) -> Result<()> {
    let mut used = triangles.iter().flat_map(|triangle| triangle.positions).map(|corner| corner as usize);
    let Some(vertex) = used.find(|&vertex| !is_valid(&positions[vertex])) else { return Ok(()) };
    let what = format!("vertex {vertex} is at {}", positions[vertex]);
    Err(mistake(name, format!("{what}; expected finite coordinates within +-{MAX_COORDINATE:e}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_is_settled_with_its_centimetres_and_a_mesh_nearby_keeps_its_bits() {
        let utm = DVec3::new(500_000.0, 5_400_000.0, 200.0);
        let corners = [utm, utm + DVec3::new(0.01, 0.0, 0.0), utm + DVec3::new(100.0, 80.0, 5.0)];
        let (positions, origin) = settle("map", &corners, &[]).expect("finite positions");
        assert_eq!(origin, (utm + DVec3::new(50.0, 40.0, 2.5)).round());
        assert!((positions[1].x - positions[0].x - 0.01).abs() < 1e-5);
        let near = [DVec3::new(0.1, 5.0, 0.0), DVec3::new(1.0, 6.0, 0.0)];
        let (positions, origin) = settle("near", &near, &[]).expect("finite positions");
        assert_eq!((positions[0], origin), (Vec3::new(0.1, 5.0, 0.0), DVec3::ZERO));
    }

    #[test]
    fn what_is_not_finite_or_too_far_is_refused() {
        for x in [f64::NAN, f64::INFINITY, 1e13] {
            let positions = [DVec3::ONE, DVec3::X * x];
            let triangle = |positions| Triangle { positions, normals: [0; 3], material: 0 };
            assert!(settle("odd", &positions, &[triangle([0, 0, 1])]).is_err(), "{x}");
            let (settled, origin) =
                settle("unused", &positions, &[triangle([0; 3])]).expect("valid positions");
            assert_eq!(
                settled.iter().map(|p| p.as_dvec3() + origin).collect::<Vec<_>>(),
                [DVec3::ONE; 2],
                "{x}"
            );
        }
    }
}
