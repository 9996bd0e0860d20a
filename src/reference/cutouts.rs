//! Cut-outs: triangles whose masks have holes, through which rays continue; the counterpart for devices is
//! `cl/common/cutouts.cl`.

use super::intersect::Hit;
use super::leaning::Lean;
use super::ray::Ray;
use super::real::Real;
use super::texture::Texels;
use super::traverse::Finder;
use crate::scene::{Mapped, Texture, Textures};
use std::cmp::Ordering;
use std::sync::Arc;

/// How far rounding may move a point in its mask, relative to the largest coordinate: up to twice the error of
/// weights, products and sums in single precision. That error is eight roundings.
const ROUNDING: f64 = 1e-6;

/// A finder that passes on the hits of another finder, except those in holes.
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

    /// Returns two finders. For one, rounding has made triangles larger and holes smaller; for the other, it has made
    /// triangles smaller and holes larger.
    pub fn leaning(&self) -> [Self; 2] {
        Lean::BOTH.map(|lean| Self { finder: Arc::clone(&self.finder), lean: Some(lean), ..*self })
    }

    /// Passes hits to `visitor` in the order of distance: those on triangles that rounding has made larger or smaller.
    fn visit_leaning(&self, ray: &Ray<R>, lean: Lean, visitor: &mut dyn FnMut(Hit<R>) -> R) {
        let (mut found, mut far) = (Vec::new(), ray.far);
        self.finder.visit_larger(ray, &mut |one| {
            if self.textures.is_none_or(|textures| self.has(textures, &one.hit)) {
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

    fn has(&self, textures: &Textures, hit: &Hit<R>) -> bool {
        let Some(row) = textures.mapped.get(hit.triangle as usize) else { return true };
        let Some(mask) = row.mask.map(|number| &textures.list[number as usize]) else { return true };
        let texels = Texels::at(mask, 0, row, hit.weights);
        let alpha = texels.mix(|texel| R::from((texel >> 24) as f32));
        let lean = match self.lean {
            Some(Lean::Larger) => 1.0,
            Some(Lean::Smaller) => -1.0,
            None => 0.0,
        };
        alpha >= R::of(mask.least_step() - lean * ROUNDING * steepness(mask, row))
    }
}

/// Returns by how much a mask's alpha may change if each texture coordinate changes by as much as its own largest
/// value. The unit is a step of an 8-bit channel; alpha changes by at most 255 steps from texel to texel.
fn steepness(mask: &Texture, row: &Mapped) -> f64 {
    let along = |axis: usize| {
        let largest = row.corners.iter().map(|corner| f64::from(corner[axis].abs())).fold(1.0, f64::max);
        f64::from(mask.size[axis]) * largest
    };
    255.0 * (along(0) + along(1))
}

impl<R: Real> Finder<R> for Solid<'_, R> {
    fn visit(&self, ray: &Ray<R>, visitor: &mut dyn FnMut(Hit<R>) -> R) {
        if let Some(lean) = self.lean {
            return self.visit_leaning(ray, lean, visitor);
        }
        let Some(textures) = self.textures else { return self.finder.visit(ray, visitor) };
        let mut far = ray.far;
        self.finder.visit(ray, &mut |hit| {
            if self.has(textures, &hit) {
                far = visitor(hit);
            }
            far
        });
    }

    /// Without holes, the inner finder does the search, which may be faster.
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
