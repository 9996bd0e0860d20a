//! Meshes of indexed triangles. As in OBJ files, each corner has an index of a position and a separate index
//! of a normal.

use super::corner_colours::{CornerColours, WHITE};
use super::{Material, Textures};
use glam::Vec3;
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};

/// A mesh with fewer than `PARALLEL_TRIANGLES` triangles is processed by one thread.
pub(super) const PARALLEL_TRIANGLES: usize = 1 << 14;

/// One triangle of a [`Mesh`], as indices into the mesh's lists.
///
/// Kernels that use indexed normals read each triangle as 32-bit words (`cl/tile_cpu/layout/indexed32.cl`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::NoUninit)]
#[repr(C)]
pub struct Triangle {
    /// The indices of the triangle's corners in `Mesh::positions`.
    pub positions: [u32; 3],
    /// The indices of the corners' normals in `Mesh::normals`.
    pub normals: [u32; 3],
    /// The index of the triangle's material in `Mesh::materials`.
    pub material: u32,
}

impl Triangle {
    /// Number of 32-bit words of a triangle.
    pub const WORDS: usize = size_of::<Self>() / size_of::<u32>();
    /// Number of 32-bit words of a triangle before its first index of a normal.
    pub const FIRST_NORMAL: usize = std::mem::offset_of!(Self, normals) / size_of::<u32>();
}

/// Triangles with their materials and textures. Normals need not have length 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// The positions to which the corners of triangles refer, in the scene's units.
    pub positions: Vec<Vec3>,
    /// The normals to which the corners of triangles refer.
    pub normals: Vec<Vec3>,
    /// The triangles.
    pub triangles: Vec<Triangle>,
    /// The materials to which triangles refer.
    pub materials: Vec<Material>,
    /// The textures, and the texture coordinates of each triangle.
    pub textures: Textures,
    /// The colours of each triangle's corners, in the order of `triangles`; empty if every triangle has one
    /// colour.
    pub corner_colours: Vec<CornerColours>,
}

/// Returns true if no two of a triangle's corners are equal.
pub(super) fn are_apart<T: PartialEq>([a, b, c]: &[T; 3]) -> bool {
    a != b && b != c && c != a
}

impl Mesh {
    /// Returns the size in bytes of a mesh with these numbers of triangles, positions and normals, without the mesh's
    /// materials, textures and colours of corners.
    pub const fn bytes(triangles: u64, positions: u64, normals: u64) -> u64 {
        triangles * size_of::<Triangle>() as u64 + (positions + normals) * size_of::<Vec3>() as u64
    }

    /// Returns the three corners of a triangle. Without inlining, reading the mesh of a dragon took a sixth more time.
    #[inline(always)]
    pub fn corners(&self, triangle: &Triangle) -> [Vec3; 3] {
        triangle.positions.map(|index| self.positions[index as usize])
    }

    /// Returns the normals at a triangle's corners.
    #[inline]
    pub fn corner_normals(&self, triangle: &Triangle) -> [Vec3; 3] {
        triangle.normals.map(|index| self.normals[index as usize])
    }

    /// Returns a triangle's material.
    pub fn material(&self, triangle: &Triangle) -> &Material {
        &self.materials[triangle.material as usize]
    }

    /// Returns true if a material emits light.
    pub fn is_emissive(&self) -> bool {
        self.materials.iter().any(Material::is_emissive)
    }

    /// Removes the emitted light of materials that no triangle uses, so that [`Mesh::is_emissive`] returns true
    /// only if a surface emits light. Files may contain materials that they do not use.
    pub(super) fn darken_unused_materials(&mut self) {
        if !self.is_emissive() {
            return;
        }
        let used = self.materials_of_triangles();
        for (material, _) in self.materials.iter_mut().zip(used).filter(|(_, is_used)| !is_used) {
            (material.emitted, material.emission_texture) = (Vec3::ZERO, None);
        }
    }

    /// Returns one value for each material: true if a triangle has the material.
    pub(super) fn materials_of_triangles(&self) -> Vec<bool> {
        let mut is_used = vec![false; self.materials.len()];
        self.triangles.iter().for_each(|triangle| is_used[triangle.material as usize] = true);
        is_used
    }

    /// Removes all textures. Surfaces with an emission texture then emit no light.
    pub(super) fn leave_out_textures(&mut self) {
        self.textures = Textures::default();
        let lamps = self.materials.iter_mut().filter(|material| material.emission_texture.is_some());
        lamps.for_each(|lamp| lamp.set_emission_texture(None));
    }

    /// Gives each triangle that has an emission texture but no texture coordinates a copy of its material. The copy
    /// emits no light. `triangles` has the indices of the triangles without texture coordinates. Returns the number of
    /// triangles that got a copy.
    pub(super) fn leave_out_emission_textures(&mut self, triangles: &[usize]) -> usize {
        let (mut copies, mut dark) = (HashMap::new(), 0);
        for &number in triangles {
            let own = self.triangles[number].material;
            if self.materials[own as usize].emission_texture.is_none() {
                continue;
            }
            dark += 1;
            self.triangles[number].material = *copies.entry(own).or_insert_with(|| {
                let mut copy = self.materials[own as usize];
                copy.set_emission_texture(None);
                self.materials.push(copy);
                self.materials.len() as u32 - 1
            });
        }
        dark
    }

    /// Returns a function that tells which triangles count for the size of the mesh. Usually, these are the triangles
    /// with three corners at different positions: no ray hits any other triangle, and some programs leave triangles
    /// with two corners at the same position far from the object. If rounding has joined corners, for example because
    /// the mesh is far from its origin, there may be no triangle with three corners at different positions. The
    /// triangles with three different indices of positions then count. If no triangle has three different indices
    /// either, all triangles count.
    fn counts_for_size(&self) -> impl Fn(&Triangle) -> bool + Sync {
        let by_position = |triangle: &Triangle| are_apart(&self.corners(triangle));
        let by_index = |triangle: &Triangle| are_apart(&triangle.positions);
        let has_positions = self.triangles.iter().any(by_position);
        let has_indices = !has_positions && self.triangles.iter().any(by_index);
        move |triangle| match (has_positions, has_indices) {
            (true, _) => by_position(triangle),
            (_, true) => by_index(triangle),
            _ => true,
        }
    }

    /// Returns one value for each position: true if the position is the corner of a triangle.
    pub(super) fn positions_of_triangles(&self) -> Vec<bool> {
        self.positions_of(|_| true)
    }

    /// Returns one value for each position: true if the position is the corner of a triangle that
    /// [counts](Self::counts_for_size) for the size of the mesh.
    pub(super) fn visible_positions(&self) -> Vec<bool> {
        self.positions_of(self.counts_for_size())
    }

    fn positions_of(&self, counts: impl Fn(&Triangle) -> bool + Sync) -> Vec<bool> {
        let is_corner: Vec<_> = self.positions.iter().map(|_| AtomicBool::new(false)).collect();
        let mark = |index: u32| is_corner[index as usize].store(true, Ordering::Relaxed);
        let counted = |triangles: &[Triangle]| {
            for triangle in triangles.iter().filter(|triangle| counts(triangle)) {
                triangle.positions.into_iter().for_each(mark);
            }
        };
        self.triangles.par_chunks(PARALLEL_TRIANGLES).for_each(counted);
        is_corner.into_iter().map(AtomicBool::into_inner).collect()
    }

    /// Returns the smallest and the largest corner of the mesh's bounding box; `None` if the mesh has no triangles.
    /// Triangles with two corners at the same position are left out, unless the mesh has only such triangles. No ray
    /// hits such a triangle, and some programs leave such triangles far from the object.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        type Bounds = (Vec3, Vec3);
        let none = || (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let join =
            |(low, high): Bounds, (other_low, other_high): Bounds| (low.min(other_low), high.max(other_high));
        let counts = self.counts_for_size();
        // A parallel iterator over single triangles would take several times as long as this loop.
        let of_chunk = |triangles: &[Triangle]| {
            let mut bounds = none();
            for triangle in triangles.iter().filter(|triangle| counts(triangle)) {
                for corner in self.corners(triangle) {
                    bounds = join(bounds, (corner, corner));
                }
            }
            bounds
        };
        let bounds = self.triangles.par_chunks(PARALLEL_TRIANGLES).map(of_chunk).reduce(none, join);
        (!self.triangles.is_empty()).then_some(bounds)
    }

    /// Assigns the first material to all triangles, and removes all other materials.
    pub fn share_first_material(&mut self) {
        self.materials.truncate(1);
        self.triangles.iter_mut().for_each(|triangle| triangle.material = 0);
    }

    /// Appends the mesh `other`. All indices in `other`, including those of emission textures, grow by the lengths of
    /// this mesh's lists. If exactly one of the two meshes has colours of corners, the corners of the mesh without
    /// colours become white.
    pub fn append(&mut self, other: Mesh) {
        if self.positions.is_empty() && self.normals.is_empty() && self.materials.is_empty() {
            *self = other;
            return;
        }
        let position = self.positions.len() as u32;
        let normal = self.normals.len() as u32;
        let material = self.materials.len() as u32;
        let texture = self.textures.list.len() as u32;
        self.append_colours(other.corner_colours, other.triangles.len());
        self.textures.append(self.triangles.len(), other.textures, other.triangles.len());
        self.triangles.extend(other.triangles.into_iter().map(|t| Triangle {
            positions: t.positions.map(|i| i + position),
            normals: t.normals.map(|i| i + normal),
            material: t.material + material,
        }));
        self.positions.extend(other.positions);
        self.normals.extend(other.normals);
        self.materials.extend(other.materials.into_iter().map(|own| Material {
            emission_texture: own.emission_texture.map(|number| number + texture),
            ..own
        }));
    }

    /// Appends the corners' colours of some triangles; `triangles` is the number of these triangles.
    /// `colours` is empty if their corners have no colours.
    fn append_colours(&mut self, colours: Vec<CornerColours>, triangles: usize) {
        if self.corner_colours.is_empty() && colours.is_empty() {
            return;
        }
        self.corner_colours.resize(self.triangles.len(), WHITE);
        self.corner_colours.extend(colours);
        self.corner_colours.resize(self.triangles.len() + triangles, WHITE);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Shape, Texture, Wrap, generate};

    /// Returns a mesh whose only material emits the light of its only texture.
    fn lamp() -> Mesh {
        let mut mesh = generate(&Shape::Ground);
        let texels = vec![0].into();
        mesh.textures.list = vec![Texture { size: [1, 1], wrap: [Wrap::Repeat; 2], least_alpha: 0, texels }];
        mesh.materials[0] = Material { emitted: Vec3::ONE, emission_texture: Some(0), ..mesh.materials[0] };
        mesh
    }

    #[test]
    fn an_appended_material_keeps_its_emission_texture_and_a_triangle_its_colours() {
        let [mut all, mut coloured] = [lamp(), lamp()];
        coloured.corner_colours = vec![[1, 2, 3]; coloured.triangles.len()];
        all.append(coloured.clone());
        all.append(lamp());
        let textures: Vec<_> = all.materials.iter().map(|material| material.emission_texture).collect();
        assert_eq!(textures, [Some(0), Some(1), Some(2)]);
        let count = lamp().triangles.len();
        let expected = [vec![WHITE; count], coloured.corner_colours, vec![WHITE; count]].concat();
        assert_eq!(all.corner_colours, expected);
    }

    /// A triangle with two corners at the same position is counted only if all triangles of the mesh are of this kind.
    #[test]
    fn triangles_that_no_ray_hits_do_not_enlarge_a_mesh() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::splat(9.0), Vec3::splat(9.0)];
        let triangle = |positions| Triangle { positions, normals: [0; 3], material: 0 };
        let of = |triangles: &[[u32; 3]]| Mesh {
            positions: positions.clone(),
            triangles: triangles.iter().copied().map(triangle).collect(),
            ..Mesh::default()
        };
        let small = (Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0));
        for collapsed in [[3, 3, 3], [3, 3, 0], [0, 3, 3], [3, 0, 3], [3, 4, 1]] {
            let mesh = of(&[collapsed, [0, 1, 2]]);
            assert_eq!(mesh.bounds(), Some(small), "{collapsed:?}");
            assert_eq!(mesh.visible_positions(), [true, true, true, false, false], "{collapsed:?}");
        }
        // The positions 3 and 4 are equal, but not their indices.
        let joined = of(&[[3, 4, 4], [0, 3, 4]]);
        assert_eq!(joined.visible_positions(), [true, false, false, true, true]);
        assert_eq!(joined.bounds(), Some((Vec3::ZERO, Vec3::splat(9.0))));
        let alone = of(&[[3, 3, 0]]);
        assert_eq!(alone.bounds(), Some((Vec3::ZERO, Vec3::splat(9.0))));
        assert_eq!(alone.visible_positions(), [true, false, false, true, false]);
        assert_eq!(of(&[]).bounds(), None);
        assert_eq!(of(&[[3, 3, 3], [0, 1, 2]]).positions_of_triangles(), [true, true, true, true, false]);
    }

    #[test]
    fn materials_that_no_triangle_uses_emit_no_light() {
        let mut mesh = lamp();
        mesh.materials[0].emitted = Vec3::X;
        let [used, unused] = [0_usize, 1];
        mesh.materials.push(mesh.materials[used]);
        mesh.darken_unused_materials();
        let emission = |index: usize| (mesh.materials[index].emitted, mesh.materials[index].emission_texture);
        assert_eq!([used, unused].map(emission), [(Vec3::X, Some(0)), (Vec3::ZERO, None)]);
        mesh.triangles.iter_mut().for_each(|triangle| triangle.material = unused as u32);
        mesh.darken_unused_materials();
        assert!(!mesh.is_emissive());
    }

    #[test]
    fn triangles_without_texture_coordinates_share_a_copy_of_their_material_and_emit_no_light() {
        let mut mesh = lamp();
        mesh.triangles.push(mesh.triangles[0]);
        assert_eq!(mesh.leave_out_emission_textures(&[0, 2]), 2);
        assert_eq!(
            mesh.leave_out_emission_textures(&[0, 2]),
            0,
            "their material has no emission texture now"
        );
        let numbers: Vec<_> = mesh.triangles.iter().map(|triangle| triangle.material).collect();
        assert_eq!((numbers, mesh.materials.len()), (vec![1, 0, 1], 2));
        assert_eq!([0, 1].map(|i: usize| mesh.materials[i].emission_texture), [Some(0), None]);
        assert_eq!([0, 1].map(|i: usize| mesh.materials[i].emitted), [Vec3::ONE, Vec3::ZERO]);
    }

    #[test]
    fn without_textures_only_surfaces_without_an_emission_texture_emit_light() {
        let mut mesh = lamp();
        mesh.materials.push(Material { emitted: Vec3::X, ..Material::default() });
        mesh.leave_out_textures();
        assert!(mesh.materials.iter().all(|material| material.emission_texture.is_none()));
        assert_eq!([0, 1].map(|i: usize| mesh.materials[i].emitted), [Vec3::ZERO, Vec3::X]);
        assert!(mesh.textures.list.is_empty());
    }
}
