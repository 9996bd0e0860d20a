//! Reads the nodes of a glTF scene, which place the scene's meshes, cameras and lights.

mod seen;

use super::accessors::Numbers;
use super::left_out::{self, LeftOut};
use super::locals::Local;
use super::materials::uses_alpha;
use super::primitives::{Part, has_other_colours, mode_of};
use super::skins::{self, Skin};
use super::textures::ColourMap;
use super::transforms::{PlacedNode, normal_matrix};
use super::{Flaw, MeshFile, Parsed};
use crate::scene::files::origin::{self, Limit};
use crate::scene::files::{FileLight, colours};
use crate::scene::material::Material;
use crate::scene::mesh::{Mesh, Triangle};
use crate::scene::normals::MISSING;
use crate::scene::obj::{finite, unmapped};
use crate::scene::shapes::MAX_TRIANGLES;
use crate::scene::{Mapped, Texture, Textures};
use glam::{DMat3, DMat4, DVec3, Vec3};
use gltf::json::mesh::Mesh as GltfMesh;
use gltf::json::scene::Node;
use gltf::json::{Index, Root, skin};
use seen::{FileCamera, light_of, lights_of};
use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::ops::Range;

/// The data that were read from the scene's nodes so far. Positions are in the scene's coordinates, in double
/// precision.
pub(super) struct Walk<'a> {
    numbers: Numbers<'a>,
    /// The skins of the scene's nodes, by their indices in the file.
    skins: HashMap<usize, Skin>,
    positions: Vec<DVec3>,
    normals: Vec<Vec3>,
    /// Linear colours, one per position.
    colours: Vec<Vec3>,
    /// Number of vertices that have a colour.
    coloured: usize,
    /// Number of vertices whose colour has channels outside 0 to 1.
    outside: usize,
    triangles: Vec<Triangle>,
    /// The texture of each material, in the file's order.
    maps: &'a [Option<ColourMap>],
    /// True if a material has a texture.
    has_maps: bool,
    /// The texture coordinates of each triangle; empty if no material has a texture.
    mapped: Vec<Mapped>,
    /// The indices of the triangles that have a texture but no texture coordinates.
    unmapped: Vec<usize>,
    /// For each texture that is a mask, by the texture's index: the number of triangles that have this texture but no
    /// texture coordinates.
    unmasked: HashMap<u32, usize>,
    /// The index of the first triangle of each node that has a mesh. If no node has a mesh, the list has the
    /// index of the first triangle of each mesh.
    starts: Vec<u32>,
    cameras: Vec<FileCamera<'a>>,
    lights: Vec<FileLight>,
    /// The meshes, and the pairs of a mesh and a skin, whose parts were counted in `left_out`. Each mesh and each pair
    /// counts once, even if many nodes place it.
    counted: HashSet<(usize, Option<usize>)>,
    left_out: LeftOut,
    limit: Limit,
}

impl<'a> Walk<'a> {
    /// Reads the meshes, cameras and lights of all nodes of the scene. `locals` has the transforms of all nodes of the
    /// file. Vertices must be within `limit`.
    pub fn of(
        numbers: Numbers<'a>,
        (locals, placed): (&[Local], &[PlacedNode]),
        maps: &'a [Option<ColourMap>],
        limit: Limit,
    ) -> Result<Self, Flaw> {
        let skins = skins::of_nodes(numbers, locals, placed)?;
        let mut walk = Self {
            numbers,
            skins: skins.list,
            positions: Vec::new(),
            normals: Vec::new(),
            colours: Vec::new(),
            coloured: 0,
            outside: 0,
            triangles: Vec::new(),
            maps,
            has_maps: maps.iter().any(Option::is_some),
            mapped: Vec::new(),
            unmapped: Vec::new(),
            unmasked: HashMap::new(),
            starts: Vec::new(),
            cameras: Vec::new(),
            lights: Vec::new(),
            counted: HashSet::new(),
            left_out: LeftOut { empty: skins.empty, odd_inverses: skins.rows, ..LeftOut::default() },
            limit,
        };
        for (index, transform) in placed {
            let Some(node) = numbers.root.get(*index) else { continue };
            walk.visit(node, *transform).map_err(|flaw| flaw.within(&format!("node {}", index.value())))?;
        }
        let has_meshes = !walk.starts.is_empty();
        if !has_meshes {
            walk.add_unplaced()?;
        }
        let outside = |has: fn(&Node) -> bool| {
            let shown = placed.iter().filter_map(|(node, _)| numbers.root.get(*node));
            numbers.root.nodes.iter().filter(|node| has(node)).count()
                - shown.filter(|node| has(node)).count()
        };
        let root = numbers.root;
        walk.left_out.other_cameras = outside(|node| node.camera.is_some())
            + unnamed(root, root.cameras.len(), |node| Some(node.camera?.value()));
        walk.left_out.other_lights = outside(|node| light_of(node).is_some())
            + unnamed(root, lights_of(root).len(), |node| Some(light_of(node)?.value()));
        // Without a mesh in the shown scene, all meshes are shown.
        if has_meshes {
            walk.left_out.other_meshes = outside(|node| node.mesh.is_some());
            walk.left_out.nodeless = unnamed(root, root.meshes.len(), |node| Some(node.mesh?.value()));
        }
        walk.left_out.check(walk.triangles.len())?;
        Ok(walk)
    }

    /// Adds all meshes of the file, for a file whose scene contains no mesh, such as a library of meshes.
    fn add_unplaced(&mut self) -> Result<(), Flaw> {
        let meshes = meshes_of(self.numbers.root, &[]);
        self.left_out.unplaced = meshes.len();
        meshes.into_iter().try_for_each(|mesh| {
            let within = |flaw: Flaw| flaw.within(&format!("mesh {}", mesh.value()));
            self.add_mesh(mesh, None, DMat4::IDENTITY).map_err(within)
        })
    }

    fn visit(&mut self, node: &Node, transform: DMat4) -> Result<(), Flaw> {
        if let Some(index) = node.mesh {
            self.add_mesh(index, node.skin, transform)?;
        }
        self.add_camera(node, transform)?;
        Ok(self.add_light(node, transform)?)
    }

    /// Adds a mesh. A primitive that `skin` does not place has the transform of its node.
    fn add_mesh(
        &mut self,
        index: Index<GltfMesh>,
        skin: Option<Index<skin::Skin>>,
        transform: DMat4,
    ) -> Result<(), Flaw> {
        self.starts.push(self.triangles.len() as u32);
        let first = self.positions.len();
        let mesh = self.numbers.root.get(index);
        let mesh = mesh.ok_or_else(|| format!("mesh {} does not exist", index.value()))?;
        let limit = self.limit;
        // The index of a position in a list of raycl is not the index in the file, so errors name only the mesh.
        let invalid =
            |position: &DVec3| limit.invalid(&format!("a vertex of mesh {}", index.value()), position);
        let is_new = self.counted.insert((index.value(), None));
        let is_new_with_skin =
            skin.is_some_and(|skin| self.counted.insert((index.value(), Some(skin.value()))));
        self.left_out.partless += usize::from(is_new && mesh.primitives.is_empty());
        for primitive in &mesh.primitives {
            let has_targets = primitive.targets.as_ref().is_some_and(|targets| !targets.is_empty());
            self.left_out.targets += usize::from(is_new && has_targets);
            self.left_out.other_colours += usize::from(is_new && has_other_colours(primitive));
            let map = primitive.material.and_then(|index| self.maps.get(index.value()).copied().flatten());
            let joints = skin.and_then(|index| self.skins.get(&index.value()));
            match Part::read(&self.numbers, primitive, map.map(|map| map.set), joints.is_some())? {
                Some(part) => {
                    // Positions that are not finite are reported before the transform, because the error shows
                    // the file's numbers.
                    if let Some(position) = part.positions.iter().find(|position| !position.is_finite()) {
                        return Err(invalid(position));
                    }
                    self.left_out.coarse_shapes += usize::from(is_new && part.is_coarse());
                    let part = part.placed(joints);
                    self.left_out.unskinned += usize::from(skin.is_some() && !part.is_placed);
                    let transform = if part.is_placed { DMat4::IDENTITY } else { transform };
                    let material = primitive.material.and_then(|index| self.numbers.root.get(index));
                    let is_clear = part.is_clear && material.is_some_and(uses_alpha);
                    if is_new {
                        self.left_out.clear_colours += usize::from(is_clear);
                        self.outside += part.outside;
                        self.left_out.cornerless += usize::from(part.has_no_corners());
                        self.left_out.add(&part);
                    }
                    if is_new_with_skin {
                        self.left_out.add_skinned(&part);
                    }
                    self.add(part, map, transform, is_new)?;
                }
                None if is_new => self.left_out.add_undrawn(primitive),
                None => {}
            }
        }
        match self.positions[first..].iter().find(|position| !limit.has(position)) {
            Some(position) => Err(invalid(position)),
            None => Ok(()),
        }
    }

    /// Adds a part of a mesh. `is_new` is true if no other node has placed the mesh so far.
    fn add(&mut self, part: Part, map: Option<ColourMap>, transform: DMat4, is_new: bool) -> Parsed<()> {
        let first = self.positions.len() as u32;
        let first_normal = self.normals.len() as u32;
        if self.triangles.len() + part.triangles.len() > MAX_TRIANGLES as usize {
            return Err(format!(
                "the file has more than {MAX_TRIANGLES} triangles; export it with fewer triangles"
            ));
        }
        self.positions.extend(part.positions.iter().map(|position| transform.transform_point3(*position)));
        let linear = DMat3::from_mat4(transform);
        let across = normal_matrix(linear);
        self.normals.extend(part.normals.iter().map(|n| (across * *n).normalize_or_zero().as_vec3()));
        self.coloured += part.coloured;
        self.colours.extend_from_slice(&part.colours);
        self.colours.resize(self.positions.len(), Vec3::ONE);
        let mirrored = linear.determinant() < 0.0;
        self.triangles.extend(part.triangles.iter().map(|corners| {
            let [a, b, c] = *corners;
            let corners = if mirrored { [a, c, b] } else { [a, b, c] };
            let normals =
                if part.normals.is_empty() { [MISSING; 3] } else { corners.map(|i| i + first_normal) };
            Triangle { positions: corners.map(|i| i + first), normals, material: part.material }
        }));
        if self.has_maps {
            let coarse = self.add_texture_coordinates(&part, map, mirrored);
            self.left_out.coarse += if is_new { coarse } else { 0 };
        }
        Ok(())
    }

    /// Adds the texture coordinates of a part's triangles. If the part is mirrored, the second and the third
    /// corner of each triangle are swapped. Returns the number of triangles whose coordinates are inexact.
    fn add_texture_coordinates(&mut self, part: &Part, map: Option<ColourMap>, mirrored: bool) -> usize {
        let Self { mapped, unmapped, unmasked, .. } = self;
        let (first, mut coarse) = (mapped.len(), 0);
        mapped.extend(part.triangles.iter().enumerate().map(|(number, corners)| {
            let Some(map) = map else { return Mapped::NONE };
            let mapped = || {
                let [a, b, c] = corners.map(|corner| part.coordinates[corner as usize]);
                let row = finite(map.mapped(if mirrored { [a, c, b] } else { [a, b, c] }));
                row.inspect(|_| coarse += usize::from(map.is_coarse([a, b, c])))
            };
            let row = (!part.coordinates.is_empty()).then(mapped).flatten();
            row.unwrap_or_else(|| {
                unmapped.push(first + number);
                map.mask().into_iter().for_each(|mask| *unmasked.entry(mask).or_default() += 1);
                Mapped::NONE
            })
        }));
        coarse
    }

    /// Returns the triangles of each node with a mesh, as ranges of indices.
    fn of_nodes(&self) -> impl Iterator<Item = Range<usize>> {
        let ends = self.starts.iter().skip(1).copied().chain([self.triangles.len() as u32]);
        self.starts.iter().zip(ends).map(|(start, end)| *start as usize..end as usize)
    }

    /// Returns the mesh in single precision, with the first camera and the lights of the scene.
    /// `note_materials` adds notes on the materials of the mesh.
    pub fn settled(
        self,
        (materials, pictures): (Vec<Material>, Vec<Texture>),
        note_materials: &mut dyn FnMut(&Mesh, &mut Vec<String>),
    ) -> Result<MeshFile, Flaw> {
        let (positions, placement) =
            origin::settle_if(&self.positions, &self.triangles, self.limit, |placed| self.seen_fits(placed))?;
        let distorted = |range: &Range<usize>| {
            let triangles = &self.triangles[range.clone()];
            origin::inexact(triangles, &positions, placement.scale, || Cow::from(&self.positions)).is_some()
        };
        let distorted = self.of_nodes().filter(distorted).count();
        let with_holes = self.unmasked.iter().filter(|(mask, _)| pictures[**mask as usize].has_holes());
        let unmasked = with_holes.map(|(_, count)| count).sum();
        let camera_notes = self.camera_notes();
        let light_notes = self.left_out.light_notes().collect();
        let textures = Textures::of(pictures, self.mapped, &materials);
        let mut mesh = Mesh {
            positions,
            normals: self.normals,
            triangles: self.triangles,
            materials,
            textures,
            corner_colours: Vec::new(),
        };
        let mut notes = Vec::new();
        note_materials(&mesh, &mut notes);
        let dark = mesh.leave_out_emission_textures(&self.unmapped);
        if self.coloured > 0 {
            colours::paint(&mut mesh, &self.colours);
            notes.extend(colours::note_outside(self.outside, "vertex"));
        }
        notes.extend((!self.unmapped.is_empty()).then(|| unmapped(self.unmapped.len(), unmasked, dark)));
        notes.extend(LeftOut { distorted, ..self.left_out }.notes());
        notes.extend(left_out::other_scenes(self.numbers.root));
        let camera = self.cameras.first().map(|camera| camera.placed_by(&placement));
        let camera_aspect = self.cameras.first().and_then(|camera| camera.lens.aspect_ratio);
        let lights = self.lights.into_iter().map(|light| light.placed_by(&placement)).collect();
        let more_starts = self.starts.into_iter().skip(1).collect();
        Ok(MeshFile {
            mesh,
            placement,
            more_starts,
            camera,
            camera_aspect,
            camera_notes,
            lights,
            light_notes,
            notes,
            ..MeshFile::default()
        })
    }
}

/// Returns how many of `count` things (meshes, cameras or lights) no node names. `named_by` returns the index of a
/// node's thing.
fn unnamed(root: &Root, count: usize, named_by: impl Fn(&Node) -> Option<usize>) -> usize {
    let named: HashSet<usize> = root.nodes.iter().filter_map(named_by).collect();
    (0..count).filter(|index| !named.contains(index)).count()
}

/// Returns the mesh of each node in `placed` that has a mesh. If no node has a mesh, returns all meshes of
/// the file.
pub(super) fn meshes_of(root: &Root, placed: &[PlacedNode]) -> Vec<Index<GltfMesh>> {
    let of_nodes: Vec<_> = placed.iter().filter_map(|(node, _)| root.get(*node)?.mesh).collect();
    if of_nodes.is_empty() { (0..root.meshes.len() as u32).map(Index::new).collect() } else { of_nodes }
}

/// Returns the indices of the materials that are used by triangles of the nodes `placed`.
pub(super) fn materials_of(root: &Root, placed: &[PlacedNode]) -> HashSet<usize> {
    // Each mesh is examined only once, even if many nodes place it.
    let meshes: HashSet<usize> = meshes_of(root, placed).iter().map(Index::value).collect();
    let meshes = meshes.into_iter().filter_map(|mesh| root.meshes.get(mesh));
    let primitives = meshes.flat_map(|mesh| &mesh.primitives);
    let materials = primitives.filter_map(|primitive| mode_of(primitive).and(primitive.material));
    materials.map(|material| material.value()).collect()
}
