//! Meshes of indexed triangles. As in OBJ files, each corner has an index of a position and a separate index
//! of a normal.

use super::{Material, Textures};
use glam::Vec3;
use rayon::prelude::*;

/// A mesh with fewer triangles than this is processed by one thread.
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
    /// The position, in words from the triangle's beginning, of the first index of a normal.
    pub const FIRST_NORMAL: usize = std::mem::offset_of!(Self, normals) / size_of::<u32>();
}

/// Triangles with their materials and textures. Normals need not have length 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Corner positions, in the scene's units.
    pub positions: Vec<Vec3>,
    /// Corner normals.
    pub normals: Vec<Vec3>,
    /// The triangles.
    pub triangles: Vec<Triangle>,
    /// The triangles' materials.
    pub materials: Vec<Material>,
    /// The triangles' textures.
    pub textures: Textures,
}

impl Mesh {
    /// Returns the size in bytes of a mesh with these numbers of triangles, positions and normals, without
    /// the mesh's materials and textures.
    pub const fn bytes(triangles: u64, positions: u64, normals: u64) -> u64 {
        triangles * size_of::<Triangle>() as u64 + (positions + normals) * size_of::<Vec3>() as u64
    }

    /// Returns the three corners of a triangle.
    pub fn corners(&self, triangle: &Triangle) -> [Vec3; 3] {
        triangle.positions.map(|index| self.positions[index as usize])
    }

    /// Returns the normals at a triangle's corners.
    pub fn corner_normals(&self, triangle: &Triangle) -> [Vec3; 3] {
        triangle.normals.map(|index| self.normals[index as usize])
    }

    /// Returns a triangle's material.
    pub fn material(&self, triangle: &Triangle) -> &Material {
        &self.materials[triangle.material as usize]
    }

    /// Returns one value for each position: true if the position is the corner of a triangle.
    pub(super) fn positions_of_triangles(&self) -> Vec<bool> {
        let mut is_corner = vec![false; self.positions.len()];
        for index in self.triangles.iter().flat_map(|triangle| triangle.positions) {
            is_corner[index as usize] = true;
        }
        is_corner
    }

    /// Returns the smallest and the largest corner of the bounding box; `None` if the mesh has no triangles.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let join = |(a, b): (Vec3, Vec3), (c, d)| (a.min(c), b.max(d));
        let bounds = |t| self.corners(t).map(|p| (p, p)).into_iter().reduce(join);
        self.triangles.par_iter().with_min_len(PARALLEL_TRIANGLES).filter_map(bounds).reduce_with(join)
    }

    /// Assigns the first material to all triangles, and removes all other materials.
    pub fn share_first_material(&mut self) {
        self.materials.truncate(1);
        self.triangles.iter_mut().for_each(|triangle| triangle.material = 0);
    }

    /// Appends the mesh `other`. The indices in the triangles of `other` grow by the lengths of this mesh's
    /// lists.
    pub fn append(&mut self, other: Mesh) {
        if self.positions.is_empty() && self.normals.is_empty() && self.materials.is_empty() {
            *self = other;
            return;
        }
        let position = self.positions.len() as u32;
        let normal = self.normals.len() as u32;
        let material = self.materials.len() as u32;
        self.textures.append(self.triangles.len(), other.textures, other.triangles.len());
        self.triangles.extend(other.triangles.into_iter().map(|t| Triangle {
            positions: t.positions.map(|i| i + position),
            normals: t.normals.map(|i| i + normal),
            material: t.material + material,
        }));
        self.positions.extend(other.positions);
        self.normals.extend(other.normals);
        self.materials.extend(other.materials);
    }
}
