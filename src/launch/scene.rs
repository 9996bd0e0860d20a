//! A scene in a device's memory, in one layout (arrangement of the triangles in buffers).

use super::arguments::{Argument, Arguments};
use super::buffers::{upload, upload_joined, upload_rows, write_joined};
use super::textures::DeviceTextures;
use super::{LaunchError, Queue};
use crate::clock::ms_since;
use crate::manifest::{AREA_LIGHT_FLOATS, LIGHT_FLOATS, SOFT_HEAD_FLOATS, soup_floats};
use crate::scene::{Area, Light, Mesh, Scene, Sky, SkyPicture, Triangle};
use crate::strategy::Strategy;
use glam::Vec3;
use ocl::Buffer;
use rayon::prelude::*;
use std::borrow::Cow;
use std::time::Instant;

/// The buffers of the scene's triangles; the layout determines which buffers these are.
#[derive(Debug)]
pub(super) enum Geometry {
    Soup(Buffer<f32>),
    Indexed16(Sets<u16>),
    Indexed32(Sets<u32>),
}

/// The mesh's sets of positions, normals and materials, and the triangles' indices into these sets.
#[derive(Debug)]
pub(super) struct Sets<I: ocl::OclPrm> {
    pub positions: Buffer<f32>,
    pub normals: Buffer<f32>,
    pub position_indices: Buffer<I>,
    pub normal_indices: Buffer<I>,
    pub material_indices: Buffer<I>,
    pub materials: Buffer<f32>,
}

impl<I: ocl::OclPrm> Sets<I> {
    /// Returns kernel arguments for the buffers of the mesh's sets (positions, normals and materials), and of
    /// the triangles' indices into these sets. `of` turns a buffer of indices into an argument.
    pub fn arguments<'a>(&'a self, of: impl Fn(&'a Buffer<I>) -> Argument<'a>) -> Arguments<'a> {
        Arguments::default()
            .with("position_set", &self.positions)
            .with("normal_set", &self.normals)
            .with("position_indices", of(&self.position_indices))
            .with("normal_indices", of(&self.normal_indices))
            .with("material_indices", of(&self.material_indices))
            .with("material_set", &self.materials)
    }
}

/// A scene that was uploaded to a device in one layout.
#[derive(Debug)]
pub(super) struct DeviceScene {
    pub(super) geometry: Geometry,
    pub(super) lights: Buffer<f32>,
    pub(super) light_count: usize,
    /// The sky, followed by the lights' radii and, if the sky has a picture, by the picture's texels.
    pub(super) soft: Buffer<f32>,
    pub(super) triangle_count: usize,
    pub(super) textures: Option<DeviceTextures>,
    /// The colours of the triangles' corners, in the mesh's order; `None` if the corners have no colours.
    pub(super) corner_colours: Option<Buffer<u32>>,
    /// Time for making and uploading the scene's buffers.
    pub upload_ms: f64,
}

impl DeviceScene {
    /// Uploads the parts of `scene` that the kernels of `strategy` read. Triangles are left out if the
    /// strategy's kernels read triangles only from the tree.
    pub fn upload(queue: &Queue, scene: &Scene, strategy: &Strategy) -> Result<Self, LaunchError> {
        let start = Instant::now();
        let mesh = &scene.mesh;
        let geometry = match strategy.layout.index_bits() {
            _ if !strategy.reads_mesh() => Geometry::Soup(upload(queue, &[])?),
            None => Geometry::Soup(soup(queue, mesh)?),
            Some(16) => Geometry::Indexed16(sets(queue, mesh, |index| index as u16)?),
            Some(_) => Geometry::Indexed32(sets(queue, mesh, |index| index)?),
        };
        let lights = upload(queue, &light_floats(&scene.lights))?;
        let soft = upload_joined(queue, &soft_floats(scene))?;
        let textures = DeviceTextures::upload(queue, mesh)?;
        let colours = mesh.corner_colours.as_flattened();
        let corner_colours = (!colours.is_empty()).then(|| upload(queue, colours)).transpose()?;
        queue.commands.finish()?;
        Ok(Self {
            geometry,
            lights,
            light_count: scene.lights.len(),
            soft,
            triangle_count: mesh.triangles.len(),
            textures,
            corner_colours,
            upload_ms: ms_since(start),
        })
    }
}

/// Replaces the lights on a device, up to the number that the buffer holds.
pub(super) fn move_lights(queue: &Queue, buffer: &Buffer<f32>, lights: &[Light]) -> Result<(), LaunchError> {
    let mut floats = light_floats(lights);
    floats.truncate(buffer.len());
    if !lights.is_empty() {
        buffer.write(&floats).queue(&queue.commands).enq()?;
    }
    Ok(())
}

/// Replaces the lights on a device by those of another scene. Both scenes must have the same number of
/// lights, and either both or neither must have area lights. Also replaces the sky and the lights' radii if
/// the sky or a radius has changed. The size of the sky's picture must stay the same.
pub(super) fn replace_lights(
    queue: &Queue,
    uploaded: &DeviceScene,
    [last, scene]: [&Scene; 2],
) -> Result<(), LaunchError> {
    move_lights(queue, &uploaded.lights, &scene.lights)?;
    let radii = |scene: &Scene| scene.lights.iter().map(radius).collect::<Vec<_>>();
    if radii(scene) != radii(last) || scene.sky != last.sky {
        write_joined(queue, &uploaded.soft, &soft_floats(scene))?;
    }
    Ok(())
}

/// Returns the position and power of each light. If any of the lights has an area, each light also gets the
/// floats that `cl/common/area_light.cl` describes, which are 0 for a light without an area.
fn light_floats(lights: &[Light]) -> Vec<f32> {
    let have_areas = lights.iter().any(|light| light.area.is_some());
    let stride = if have_areas { AREA_LIGHT_FLOATS } else { LIGHT_FLOATS };
    let floats = |light: &Light| {
        let mut floats = [light.position.to_array(), light.power.to_array()].concat();
        if let Some(area @ Area { shape, edges: [first, second] }) = &light.area {
            floats.extend([4.0 * area.front(), *first, *second].iter().flat_map(|vector| vector.to_array()));
            floats.push(f32::from(*shape as u8));
        }
        floats.resize(stride, 0.0);
        floats
    };
    lights.iter().flat_map(floats).collect()
}

/// Returns the factor by which the kernels multiply the offset of a sample point from the light's position. For a light
/// with the shape of a ball, the factor is the light's radius. For an area light, the factor is 1, since the vectors of
/// the light's edges already have the edges' lengths.
fn radius(light: &Light) -> f32 {
    if light.area.is_some() { 1.0 } else { light.radius }
}

/// Returns two parts. The first part has the sky (zeros if there is none), then the lights' radii, in the layout of
/// `cl/common/soft.cl`. If the sky has a picture, the first part has the layout of `cl/common/environment.cl`, and the
/// second part has the picture's texels.
fn soft_floats(scene: &Scene) -> [Cow<'_, [f32]>; 2] {
    let mut floats = vec![0.0; SOFT_HEAD_FLOATS];
    let picture = scene.sky.as_ref().and_then(|sky| sky.picture.as_deref());
    if let Some(Sky { zenith, horizon, up, reach, .. }) = &scene.sky {
        let first = (SOFT_HEAD_FLOATS + scene.lights.len()) as f32;
        let header = |picture: &SkyPicture| {
            let [width, height] = picture.size.map(|side| side as f32);
            [Vec3::new(first, width, height), picture.ahead]
        };
        let [first, second] = picture.map_or([*zenith, *horizon], header);
        floats.clear();
        floats.extend([first, second, *up].into_iter().flat_map(|vector| vector.to_array()));
        floats.push(*reach);
    }
    floats.extend(scene.lights.iter().map(radius));
    let texels = picture.map(|picture| picture.texels.as_flattened()).unwrap_or_default();
    [Cow::Owned(floats), Cow::Borrowed(texels)]
}

/// Uploads the triangles as 104 bytes each: three corners, their normals, and the material (16 bytes more if
/// surfaces emit light). No triangles share corners, as in the data of the student paper that raycl
/// reproduces.
fn soup(queue: &Queue, mesh: &Mesh) -> ocl::Result<Buffer<f32>> {
    let emissive = mesh.is_emissive();
    let stride = soup_floats(emissive);
    let write = |(row, triangle): (&mut [f32], &Triangle)| {
        let points = mesh.corners(triangle).into_iter().chain(mesh.corner_normals(triangle));
        for (floats, point) in row.chunks_exact_mut(3).zip(points) {
            floats.copy_from_slice(&point.to_array());
        }
        row[18..]
            .iter_mut()
            .zip(mesh.material(triangle).for_device(emissive))
            .for_each(|(to, from)| *to = from);
    };
    upload_rows(queue, [mesh.triangles.len(), stride], |triangles, rows| {
        rows.par_chunks_exact_mut(stride).zip(&mesh.triangles[triangles]).for_each(write);
    })
}

/// Returns all materials as a device reads them.
pub(super) fn material_floats(mesh: &Mesh) -> Vec<f32> {
    let emissive = mesh.is_emissive();
    mesh.materials.iter().flat_map(|material| material.for_device(emissive)).collect()
}

fn sets<I: ocl::OclPrm>(queue: &Queue, mesh: &Mesh, index: impl Fn(u32) -> I + Sync) -> ocl::Result<Sets<I>> {
    Ok(Sets {
        positions: upload(queue, bytemuck::cast_slice(&mesh.positions))?,
        normals: upload(queue, bytemuck::cast_slice(&mesh.normals))?,
        position_indices: indices(queue, mesh, |triangle| triangle.positions.map(&index))?,
        normal_indices: indices(queue, mesh, |triangle| triangle.normals.map(&index))?,
        material_indices: indices(queue, mesh, |triangle| [index(triangle.material)])?,
        materials: upload(queue, &material_floats(mesh))?,
    })
}

/// Uploads `N` indices of each triangle, which `of` returns.
fn indices<I: ocl::OclPrm, const N: usize>(
    queue: &Queue,
    mesh: &Mesh,
    of: impl Fn(&Triangle) -> [I; N] + Sync,
) -> ocl::Result<Buffer<I>> {
    upload_rows(queue, [mesh.triangles.len(), N], |triangles, rows| {
        rows.par_chunks_exact_mut(N)
            .zip(&mesh.triangles[triangles])
            .for_each(|(row, triangle)| row.copy_from_slice(&of(triangle)));
    })
}
