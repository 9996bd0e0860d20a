//! Reads the nodes of a glTF scene, which place the scene's meshes, cameras and lights.

use super::accessors::Numbers;
use super::left_out::{self, LeftOut};
use super::materials::uses_alpha;
use super::primitives::{Part, mode_of};
use super::skins::{self, Skin};
use super::textures::ColourMap;
use super::transforms::{PlacedNode, normal_matrix};
use super::{Flaw, MeshFile, Parsed};
use crate::scene::files::{FileLight, Placement, colours, origin};
use crate::scene::material::Material;
use crate::scene::mesh::{Mesh, Triangle, are_apart};
use crate::scene::normals::MISSING;
use crate::scene::obj::{finite, unmapped};
use crate::scene::shapes::MAX_TRIANGLES;
use crate::scene::{Camera, Mapped, Texture, Textures, validate};
use glam::{DMat3, DMat4, DVec3, Vec3};
use gltf::json::camera::{Perspective, Type};
use gltf::json::extensions::scene::khr_lights_punctual as punctual;
use gltf::json::mesh::Mesh as GltfMesh;
use gltf::json::scene::Node;
use gltf::json::validation::Checked;
use gltf::json::{Index, Root, skin};
use std::collections::{HashMap, HashSet};

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
    /// The index of the first triangle of each node that has a mesh. If no node has a mesh, the list has the
    /// index of the first triangle of each mesh.
    starts: Vec<u32>,
    /// For each perspective camera: its position in double precision, the camera moved to the origin, and the file's
    /// values.
    cameras: Vec<(DVec3, Camera, &'a Perspective)>,
    lights: Vec<FileLight>,
    /// The meshes whose parts were counted, and the pairs of a mesh and a skin. Each counts once, even if many nodes
    /// place it.
    counted: HashSet<(usize, Option<usize>)>,
    left_out: LeftOut,
}

impl<'a> Walk<'a> {
    /// Reads the meshes, cameras and lights of all nodes of the scene.
    pub fn of(
        numbers: Numbers<'a>,
        placed: &[PlacedNode],
        maps: &'a [Option<ColourMap>],
    ) -> Result<Self, Flaw> {
        let skins = skins::of_nodes(numbers, placed)?;
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
            starts: Vec::new(),
            cameras: Vec::new(),
            lights: Vec::new(),
            counted: HashSet::new(),
            left_out: LeftOut { empty: skins.empty, odd_inverses: skins.rows, ..LeftOut::default() },
        };
        for (index, transform) in placed {
            let Some(node) = numbers.root.get(*index) else { continue };
            walk.visit(node, *transform).map_err(|flaw| flaw.within(&format!("node {}", index.value())))?;
        }
        if walk.starts.is_empty() {
            walk.add_unplaced()?;
        }
        let outside = |has: fn(&Node) -> bool| {
            let shown = placed.iter().filter_map(|(node, _)| numbers.root.get(*node));
            numbers.root.nodes.iter().filter(|node| has(node)).count()
                - shown.filter(|node| has(node)).count()
        };
        walk.left_out.other_cameras = outside(|node| node.camera.is_some());
        walk.left_out.other_lights = outside(|node| light_of(node).is_some());
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
        // The index of a position in a list of raycl is not the index in the file, so errors name only the mesh.
        let invalid =
            |position: &DVec3| origin::invalid(&format!("a vertex of mesh {}", index.value()), position);
        let is_new = self.counted.insert((index.value(), None));
        let is_new_with_skin =
            skin.is_some_and(|skin| self.counted.insert((index.value(), Some(skin.value()))));
        for primitive in &mesh.primitives {
            let has_targets = primitive.targets.as_ref().is_some_and(|targets| !targets.is_empty());
            self.left_out.targets += usize::from(is_new && has_targets);
            let map = primitive.material.and_then(|index| self.maps.get(index.value()).copied().flatten());
            let joints = skin.and_then(|index| self.skins.get(&index.value()));
            match Part::read(&self.numbers, primitive, map.map(|map| map.set), joints.is_some())? {
                Some(part) => {
                    // Positions are checked before the transform. After the transform, they would no longer have
                    // the file's numbers.
                    if let Some(position) = part.positions.iter().find(|position| !position.is_finite()) {
                        return Err(invalid(position));
                    }
                    let part = part.placed(joints);
                    self.left_out.unskinned += usize::from(skin.is_some() && !part.is_placed);
                    let transform = if part.is_placed { DMat4::IDENTITY } else { transform };
                    let material = primitive.material.and_then(|index| self.numbers.root.get(index));
                    let is_clear = part.is_clear && material.is_some_and(uses_alpha);
                    if is_new {
                        self.left_out.clear_colours += usize::from(is_clear);
                        self.outside += part.outside;
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
        match self.positions[first..].iter().find(|position| !origin::is_valid(position)) {
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
        let Self { mapped, unmapped, .. } = self;
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
                Mapped::NONE
            })
        }));
        coarse
    }

    /// Adds the camera of a node. The camera looks along the node's -z axis. A camera that is not a perspective camera,
    /// or whose directions the node's transform makes zero or parallel, is counted but not added. A camera with an
    /// impossible field of view is counted, and gets a field of view of 45 degrees. A camera with an impossible znear is
    /// counted, and gets a znear of 0.
    fn add_camera(&mut self, node: &Node, transform: DMat4) -> Parsed<()> {
        let Some(index) = node.camera else { return Ok(()) };
        let camera =
            self.numbers.root.get(index).ok_or_else(|| format!("camera {} does not exist", index.value()))?;
        let (Checked::Valid(Type::Perspective), Some(lens)) = (camera.type_, &camera.perspective) else {
            match camera.type_ {
                Checked::Valid(Type::Orthographic) => self.left_out.orthographic += 1,
                _ => self.left_out.odd_cameras += 1,
            }
            return Ok(());
        };
        let position = transform.transform_point3(DVec3::ZERO);
        let [ahead, up] =
            [DVec3::NEG_Z, DVec3::Y].map(|axis| transform.transform_vector3(axis).normalize_or_zero());
        let degrees = lens.yfov.to_degrees();
        let valid = degrees > 1e-3 && degrees < 179.99;
        self.left_out.odd_views += usize::from(!valid);
        let degrees = if valid { degrees } else { 45.0 };
        let looking = Camera::looking_at(Vec3::ZERO, ahead.as_vec3(), up.as_vec3(), degrees, true);
        self.left_out.flat_cameras += usize::from(looking.is_none());
        let is_odd_near = !lens.znear.is_finite() || lens.znear < 0.0;
        self.left_out.odd_nears += usize::from(is_odd_near && looking.is_some());
        let z_near = if is_odd_near { 0.0 } else { lens.znear };
        self.cameras.extend(looking.map(|looking| (position, Camera { z_near, ..looking }, lens)));
        Ok(())
    }

    /// Adds the light of a node. A directional light shines along the node's -z axis.
    fn add_light(&mut self, node: &Node, transform: DMat4) -> Parsed<()> {
        let Some(index) = light_of(node) else { return Ok(()) };
        let lights = self
            .numbers
            .root
            .extensions
            .as_ref()
            .and_then(|extensions| extensions.khr_lights_punctual.as_ref());
        let light = lights.and_then(|lights| lights.lights.get(index.value()));
        let light = light.ok_or_else(|| format!("light {} does not exist", index.value()))?;
        let strength = Vec3::from_array(light.color).as_dvec3() * f64::from(light.intensity);
        if !strength.is_finite() || strength.min_element() < 0.0 {
            return Err(format!(
                "light {} has a strength of {strength}; expected finite numbers, 0 or more",
                index.value()
            ));
        }
        // A light without strength is left out, so that raycl adds its own lights if no light of the file
        // shines.
        if strength == DVec3::ZERO {
            self.left_out.dark += 1;
            return Ok(());
        }
        self.left_out.ranges += usize::from(light.range.is_some());
        let position = transform.transform_point3(DVec3::ZERO);
        self.lights.push(match light.type_ {
            Checked::Valid(punctual::Type::Directional) => {
                let direction = transform.transform_vector3(DVec3::NEG_Z);
                self.left_out.flat_lights += usize::from(direction.try_normalize().is_none());
                FileLight::direction(direction, strength)
            }
            other => {
                self.left_out.spots += usize::from(other == Checked::Valid(punctual::Type::Spot));
                self.left_out.odd_lights += usize::from(other == Checked::Invalid);
                FileLight::point(position, strength)
            }
        });
        Ok(())
    }

    /// Returns true if the file's first camera and the file's lights, scaled like the mesh, are within
    /// raycl's limits. If the result is false, the mesh is not scaled. If scaling moves a camera beyond
    /// the limits, the camera is at least 1e11 radii of the mesh away, so the mesh covers less than a pixel.
    fn seen_fits(&self, placement: &Placement) -> bool {
        let camera = self.cameras.first().map(|(position, camera, _)| placement.camera(*position, camera));
        camera.is_none_or(|camera| validate::check_camera(&camera).is_ok())
            && self.lights.iter().all(|light| light.placed_by(placement).is_valid())
    }

    /// Returns the notes that are shown if the picture is seen from the file's first camera.
    fn camera_notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        let cameras = self.cameras.len();
        notes.extend((cameras > 1).then(|| format!("of {cameras} cameras, the first is used")));
        if let Some((eye, camera, lens)) = self.cameras.first() {
            let depth = |position: &DVec3| (*position - *eye).dot(camera.forward.as_dvec3());
            let corners =
                |triangle: &Triangle| triangle.positions.map(|index| self.positions[index as usize]);
            let visible = || self.triangles.iter().map(corners).filter(are_apart).flatten();
            let is_beyond = |end: f32| visible().any(|position| depth(&position) > f64::from(end));
            let unseen =
                "the file's camera sees no part of the mesh: --azimuth 31 uses raycl's own camera instead";
            notes.extend((!is_beyond(camera.z_near)).then(|| unseen.to_owned()));
            let note = |far| format!("the camera's zfar of {far} is not used: surfaces beyond it are drawn");
            notes.extend(lens.zfar.filter(|far| is_beyond(*far)).map(note));
            let note = |ratio| {
                format!("the camera's aspectRatio of {ratio} is not used: the picture's size decides")
            };
            notes.extend(lens.aspect_ratio.map(note));
        }
        notes
    }

    /// Returns the mesh in single precision, with the first camera and all lights of the file.
    /// `note_materials` adds notes on the materials of the mesh.
    pub fn settled(
        self,
        (materials, pictures): (Vec<Material>, Vec<Texture>),
        note_materials: &mut dyn FnMut(&Mesh, &mut Vec<String>),
    ) -> Result<MeshFile, Flaw> {
        let (positions, placement) =
            origin::settle_if(&self.positions, &self.triangles, |placed| self.seen_fits(placed))?;
        let camera_notes = self.camera_notes();
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
        notes.extend((!self.unmapped.is_empty()).then(|| unmapped(self.unmapped.len(), dark)));
        notes.extend(self.left_out.notes());
        notes.extend(left_out::other_scenes(self.numbers.root));
        let camera = self.cameras.first().map(|(position, camera, _)| placement.camera(*position, camera));
        let lights = self.lights.into_iter().map(|light| light.placed_by(&placement)).collect();
        let more_starts = self.starts.into_iter().skip(1).collect();
        Ok(MeshFile {
            mesh,
            placement,
            more_starts,
            camera,
            camera_notes,
            lights,
            notes,
            ..MeshFile::default()
        })
    }
}

/// Returns the index of a node's light; `None` if the node has none.
fn light_of(node: &Node) -> Option<Index<punctual::Light>> {
    node.extensions.as_ref()?.khr_lights_punctual.as_ref().map(|named| named.light)
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
