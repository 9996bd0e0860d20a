//! Cut-outs: triangles whose masks have holes. Rays continue through the holes. The counterpart for devices
//! is `cl/common/cutouts.cl`.

use super::intersect::Hit;
use super::leaning::Lean;
use super::ray::Ray;
use super::real::Real;
use super::texture::{Texels, place, texel};
use super::traverse::Finder;
use crate::scene::{Mapped, Texture, Textures};
use std::cmp::Ordering;
use std::sync::Arc;

/// How far rounding may move a point in its mask, relative to the largest coordinate. Devices compute the point
/// from weights, products and sums in single precision, with eight roundings; the constant is about twice the error
/// of eight roundings. The mean of four texels' alpha has as many roundings, so its error is at most this fraction
/// of the largest alpha.
const ROUNDING: f64 = 1e-6;
/// The largest alpha, in steps of an 8-bit channel.
const OPAQUE: u32 = 255;
/// The largest number of texels near a point that are read. If there are more, any alpha may occur among them.
const MOST_TEXELS: usize = 1024;

/// A finder that passes on the hits of another finder, except hits in holes.
pub struct Solid<'a, R: Real> {
    finder: Arc<dyn Finder<R> + 'a>,
    textures: Option<&'a Textures>,
    /// The direction in which rounding moves the edges of triangles and of holes; `None` leaves the edges where they
    /// are.
    lean: Option<Lean>,
}

impl<'a, R: Real> Solid<'a, R> {
    /// Makes a finder for a mesh with these textures.
    pub fn new(finder: impl Finder<R> + 'a, textures: &'a Textures) -> Self {
        let textures = textures.have_holes().then_some(textures);
        Self { finder: Arc::new(finder), textures, lean: None }
    }

    /// Returns two finders. For the first finder, rounding has made triangles larger and holes smaller. For the
    /// second finder, rounding has made triangles smaller and holes larger.
    pub fn leaning(&self) -> [Self; 2] {
        Lean::BOTH.map(|lean| Self { finder: Arc::clone(&self.finder), lean: Some(lean), ..*self })
    }

    /// Passes the hits on triangles that rounding has made larger or smaller (see `lean`) to `visitor`, in the order
    /// of distance.
    fn visit_leaning(&self, ray: &Ray<R>, lean: Lean, visitor: &mut dyn FnMut(Hit<R>) -> R) {
        let (mut found, mut far) = (Vec::new(), ray.far);
        self.finder.visit_larger(ray, &mut |one| {
            if self.textures.is_none_or(|textures| is_solid(textures, &one.hit, Some(lean))) {
                far = one.limit(far);
                found.push(one);
            }
            far
        });
        let mut hits: Vec<Hit<R>> = match lean {
            Lean::Larger => found.iter().map(|one| one.hit).collect(),
            Lean::Smaller => {
                found.iter().filter(|one| one.remains_among(&found)).map(|one| one.hit).collect()
            }
        };
        hits.sort_by(|one, other| one.t.partial_cmp(&other.t).unwrap_or(Ordering::Equal));
        let mut far = ray.far;
        for hit in hits {
            if far > ray.near && hit.t <= far {
                far = visitor(hit);
            }
        }
    }
}

/// Returns true unless a hit is in a hole of its triangle's mask. `lean` is the direction in which rounding moves the
/// edges of holes; `None` leaves the edges where they are.
pub fn is_solid<R: Real>(textures: &Textures, hit: &Hit<R>, lean: Option<Lean>) -> bool {
    let Some(row) = textures.mapped.get(hit.triangle as usize) else { return true };
    let Some(mask) = row.mask.map(|number| &textures.list[number as usize]) else { return true };
    let texels = Texels::at(mask, 0, row, hit.weights);
    let alpha = texels.mix(|texel| R::from((texel >> 24) as f32));
    let alpha = match lean {
        Some(Lean::Larger) => possible_alphas(mask, row, hit.weights, alpha)[1],
        Some(Lean::Smaller) => possible_alphas(mask, row, hit.weights, alpha)[0],
        None => alpha,
    };
    alpha >= R::of(mask.least_step())
}

/// The point of a triangle with these weights has the exact alpha `alpha`. Returns the least and the greatest alpha
/// that rounding may give this point. Alphas are in steps of an 8-bit channel. From texel to texel, alpha changes by
/// at most the difference of the least and the greatest alpha near the point, and alpha never leaves the range
/// between these two.
fn possible_alphas<R: Real>(mask: &Texture, row: &Mapped, weights: [R; 3], alpha: R) -> [R; 2] {
    let reach = [0, 1].map(|axis: usize| {
        let largest = row.corners.iter().map(|corner| f64::from(corner[axis].abs())).fold(1.0, f64::max);
        ROUNDING * f64::from(mask.size[axis]) * largest
    });
    let [least, greatest] = alphas_near(mask, row, weights, reach).map(|alpha| R::from(alpha as f32));
    let change = (greatest - least) * R::of(reach[0] + reach[1]);
    let rounding = R::of(ROUNDING * f64::from(OPAQUE));
    [(alpha - change).max(least) - rounding, (alpha + change).min(greatest) + rounding]
}

/// Returns the least and the greatest alpha of the texels that a point's alpha may depend on if rounding moves the
/// point. `reach` is how far rounding may move the point along each axis, in texels.
fn alphas_near<R: Real>(mask: &Texture, row: &Mapped, weights: [R; 3], reach: [f64; 2]) -> [u32; 2] {
    let [columns, rows] = [0, 1].map(|axis: usize| {
        let size = mask.size[axis] as i32;
        let (centre, reach) = (place(mask, 0, row, weights, axis), R::of(reach[axis].min(size.into())));
        let (first, end) = ((centre - reach).floor().to_i32(), (centre + reach).floor().to_i32() + 2);
        if end - first > size { 0..size } else { first..end }
    });
    if columns.len() * rows.len() > MOST_TEXELS {
        return [0, OPAQUE];
    }
    let alphas = rows.flat_map(|y| columns.clone().map(move |x| texel(mask, 0, [x, y]) >> 24));
    alphas.fold([OPAQUE, 0], |[least, greatest], alpha| [alpha.min(least), alpha.max(greatest)])
}

impl<R: Real> Finder<R> for Solid<'_, R> {
    fn visit(&self, ray: &Ray<R>, visitor: &mut dyn FnMut(Hit<R>) -> R) {
        if let Some(lean) = self.lean {
            return self.visit_leaning(ray, lean, visitor);
        }
        let Some(textures) = self.textures else { return self.finder.visit(ray, visitor) };
        let mut far = ray.far;
        self.finder.visit(ray, &mut |hit| {
            if is_solid(textures, &hit, None) {
                far = visitor(hit);
            }
            far
        });
    }

    /// If there are no holes, and no triangles are made larger or smaller, the inner finder's own `any` does the
    /// search, which may be faster.
    fn any(&self, ray: &Ray<R>) -> bool {
        if self.textures.is_none() && self.lean.is_none() {
            return self.finder.any(ray);
        }
        let mut found = false;
        self.visit(ray, &mut |_| {
            found = true;
            ray.near
        });
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Wrap;

    #[test]
    fn the_alphas_near_a_point_are_those_of_the_texels_that_it_may_depend_on() {
        let near = |size: [u32; 2], wrap: Wrap, place: f32, reach: f64| {
            let texels: Vec<u32> = (1..=size[0] * size[1]).map(|number| (number % 100) << 24).collect();
            let mask = Texture { size, wrap: [wrap; 2], least_alpha: 1, texels: texels.into() };
            let row = Mapped { corners: [[(place + 0.5) / size[0] as f32, 0.5]; 3], ..Mapped::NONE };
            alphas_near::<f64>(&mask, &row, [1.0, 0.0, 0.0], [reach; 2])
        };
        for (wrap, place, reach, expected) in [
            (Wrap::Repeat, 1.25, 0.125, [2, 3]),
            (Wrap::Repeat, 1.25, 0.5, [1, 3]),
            (Wrap::Repeat, 1.75, 0.5, [2, 4]),
            (Wrap::Repeat, 0.25, 0.5, [1, 8]),
            (Wrap::Clamp, 0.25, 0.5, [1, 2]),
            (Wrap::Mirror, 6.75, 0.5, [7, 8]),
            (Wrap::Repeat, 6.75, 0.5, [1, 8]),
            (Wrap::Clamp, 1.25, 1e9, [1, 8]),
        ] {
            assert_eq!(near([8, 1], wrap, place, reach), expected, "{wrap:?} {place} {reach}");
        }
        // The point may depend on any of the 2500 texels. These are too many to read them all.
        assert_eq!(near([50, 50], Wrap::Repeat, 24.5, 100.0), [0, OPAQUE]);
    }
}
