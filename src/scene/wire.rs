//! The types that a scene file's TOML is read into. The number types refuse values out of range during
//! parsing, so that the errors of the crate `toml` contain the values' locations.

mod background;
mod numbers;

pub(super) use background::BackgroundWire;
pub(super) use numbers::*;

use super::animation::AnimationWire;
use super::area::AreaShape;
use super::schema::{ShapeName, both_names_of_mesh};
use super::shapes::{MAX_FINENESS, MAX_TRIANGLES};
use super::tone::Tone;
use glam::DVec3;
use schemars::JsonSchema;
use toml::Spanned;

/// A scene: objects, lights, a camera and perhaps a sky.
#[derive(serde::Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneWire {
    /// The scene's name in records and reports [default: the file's name without its extension].
    #[schemars(with = "Option<String>", length(min = 1))]
    pub name: Option<Spanned<String>>,
    /// A pinhole camera [default: the paper's, at the origin, looking along -z].
    #[serde(default)]
    pub camera: CameraWire,
    /// Meshes, generated shapes, and inline triangles; at least one.
    #[serde(default)]
    #[schemars(with = "Vec<ObjectWire>")]
    pub object: Vec<Spanned<ObjectWire>>,
    /// Lights: points, balls if they have a radius, or surfaces if they have edges [default: none].
    pub light: Option<Vec<LightWire>>,
    /// Light from all directions, unless something occludes it [default: none].
    #[schemars(with = "Option<SkyWire>")]
    pub sky: Option<Spanned<SkyWire>>,
    /// The background: radiance (one number or three), a display colour such as "#204060", or "transparent"
    /// [default: the sky's picture or, if there is none, the paper's radiance, [0.0022, 0.0032, 0.0053]].
    pub background: Option<BackgroundWire>,
    /// Reverse the normals of triangles that face away from the camera, so that these triangles are lit like front
    /// faces. A triangle's front is the side to which the mean of its corners' normals points, whatever the order of
    /// its corners [default: false].
    pub two_sided: Option<bool>,
    /// Use the textures of meshes: colours, masks and emitted light [default: true].
    pub textures: Option<bool>,
    /// Use mip levels, smaller versions of textures, for pixels larger than texels [default: true].
    pub mip_levels: Option<bool>,
    /// Crease angle in degrees: in meshes without normals, an edge stays sharp if the normals of its two faces
    /// differ by more than this angle. The angle is measured in the mesh's own coordinates, before `scale`
    /// [default: all edges are smooth].
    #[schemars(with = "Option<Number<Crease>>")]
    pub crease: Option<Spanned<Number<Crease>>>,
    /// The gap between a hit and the near end of the hit's shadow ray [default: 1e-4 of the diagonal
    /// of the scene's box, but at least 9.5e-7 of the largest coordinate of the surfaces and of the camera's position].
    pub shadow_bias: Option<Number<NonNegative>>,
    /// Compute light and shadows as if hits lay on a smooth surface above their triangles, so that the facets of a
    /// coarse mesh with smooth normals do not shadow each other in steps [default: false].
    pub smooth_shadows: Option<bool>,
    /// How radiance is converted to 8-bit colours.
    #[serde(default)]
    pub display: DisplayWire,
    /// Values that change from frame to frame [default: none].
    pub animation: Option<AnimationWire>,
}

/// A pinhole camera.
#[derive(Default, serde::Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraWire {
    /// The position of the camera's eye [default: the origin, if no azimuth or elevation is set].
    #[schemars(with = "Option<Position>")]
    pub position: Option<Spanned<Position>>,
    /// The point in the middle of the picture [default: position + [0, 0, -1], if no azimuth or elevation is set].
    #[schemars(with = "Option<Position>")]
    pub look_at: Option<Spanned<Position>>,
    /// The direction that points up in the picture [default: [0, 1, 0]].
    #[schemars(with = "Option<Vector>")]
    pub up: Option<Spanned<Vector>>,
    /// Field of view across the width [default: 90, or 35 across the height if an azimuth or elevation is set].
    #[schemars(with = "Option<Number<Angle>>")]
    pub fov_x_degrees: Option<Spanned<Number<Angle>>>,
    /// Field of view across the height, instead of fov_x_degrees.
    #[schemars(with = "Option<Number<Angle>>")]
    pub fov_y_degrees: Option<Spanned<Number<Angle>>>,
    /// The camera ignores surfaces whose depth along its viewing direction is at most this distance [default:
    /// 0].
    pub z_near: Option<Number<NonNegative>>,
    /// Place the camera so that it sees the whole scene from this direction, in degrees to the right of the
    /// scene's front (+z, or -y if +z or -z is up).
    pub azimuth_degrees: Option<Number<Finite>>,
    /// Place the camera so that it sees the whole scene from this angle above the horizon, in degrees.
    pub elevation_degrees: Option<Number<Elevation>>,
    /// The scene's origin in the file's coordinates; zero unless the scene lies far from the file's origin.
    #[serde(skip)]
    pub origin: DVec3,
}

/// A mesh file, a generated shape, or inline triangles; scaled, rotated, then translated.
#[derive(serde::Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = both_names_of_mesh)]
pub(super) struct ObjectWire {
    /// The path of a mesh file (OBJ, PLY, STL, glTF or GLB; may be compressed as .gz), relative to the scene file.
    #[serde(alias = "mesh")]
    #[schemars(with = "Option<String>")]
    pub obj: Option<Spanned<String>>,
    /// The name of a shape that raycl generates.
    #[schemars(with = "Option<ShapeName>")]
    pub shape: Option<Spanned<String>>,
    /// With a shape other than `ground` and `pyramid`: the target number of triangles.
    #[schemars(with = "Option<u32>", range(min = 1, max = MAX_TRIANGLES))]
    pub triangles: Option<Spanned<Whole<1, MAX_TRIANGLES>>>,
    /// With the shape `teapot`: the number of quads along a side of each of the teapot's 32 patches.
    #[schemars(with = "Option<u32>", range(min = 1, max = MAX_FINENESS))]
    pub fineness: Option<Spanned<Whole<1, MAX_FINENESS>>>,
    /// With the shape `terrain`: the seed for the random shape of the hills.
    #[schemars(with = "Option<u32>")]
    pub seed: Option<Spanned<Whole<0, { u32::MAX }>>>,
    /// Positions of the corners of inline triangles.
    #[schemars(with = "Option<Vec<Position>>")]
    pub vertices: Option<Spanned<Vec<Position>>>,
    /// For each face: the indices of its three or more corners in `vertices`, from 0.
    #[schemars(with = "Option<Vec<Vec<u32>>>")]
    pub faces: Option<Spanned<Vec<Spanned<Vec<u32>>>>>,
    /// Normals of inline triangles. Without `face_normals`, there is one normal for each of `vertices`.
    #[schemars(with = "Option<Vec<Vector>>")]
    pub normals: Option<Spanned<Vec<Vector>>>,
    /// For each corner of each face: the index of the corner's normal in `normals`, from 0.
    #[schemars(with = "Option<Vec<Vec<u32>>>")]
    pub face_normals: Option<Spanned<Vec<Spanned<Vec<u32>>>>>,
    /// Scale along the object's own axes, applied before rotation and translation; a negative scale mirrors
    /// [default: 1].
    pub scale: Option<Triple<NonZero>>,
    /// Rotation of the object in degrees about x, then y, then z, applied after scale and before translation.
    pub rotation: Option<Vector>,
    /// Translation of the object, applied after scale and rotation.
    pub translation: Option<Position>,
    /// Give every triangle its own normal, so that facets are visible [default: false].
    #[serde(default)]
    pub flat: bool,
    /// With a mesh or vertices: the object's crease angle in degrees, instead of the scene's. The crease
    /// angle is measured before `scale`.
    #[schemars(with = "Option<Number<Crease>>")]
    pub crease: Option<Spanned<Number<Crease>>>,
    /// Values that replace those of all materials of the object.
    pub material: Option<MaterialWire>,
    /// With a mesh: also read MTL files, pictures and glTF buffers outside the mesh's folder [default: false].
    #[schemars(with = "Option<bool>")]
    pub outside_materials: Option<Spanned<bool>>,
}

/// The material of a surface.
#[derive(serde::Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct MaterialWire {
    /// The diffuse reflectance, one number or three [default: the mesh's own, else 0.8].
    pub k_l: Option<Triple<Reflectance>>,
    /// The highlight's strength, one number or three [default: 0.2 with shininess, else the mesh's own, else none].
    pub k_g: Option<Triple<Reflectance>>,
    /// The highlight's exponent [default: 100 with k_g, else the mesh's own, else none].
    pub shininess: Option<Number<Shininess>>,
    /// The radiance that the surface emits in linear light, one number or three. Emitted light makes the
    /// surface itself bright, but lights no other surface [default: the mesh's own, else 0].
    pub emitted: Option<Triple<Emission>>,
}

/// A light. From a point light, a surface at distance r that faces the light receives power / (4 pi r^2).
#[derive(serde::Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct LightWire {
    /// The position of the light's centre.
    #[schemars(with = "Position")]
    pub position: Spanned<Position>,
    /// The light's power: one number is white, three are red, green and blue.
    #[schemars(with = "Triple<Power>")]
    pub power: Spanned<Triple<Power>>,
    /// The radius of the ball that replaces the point light if there are several samples per pixel [default:
    /// 0, a point].
    pub radius: Option<Number<NonNegative>>,
    /// Two edges of a rectangle around the position, instead of a radius. A light with edges is an area
    /// light, which emits light only to the side to which the cross product of the edges points.
    #[schemars(with = "Option<[Vector; 2]>")]
    pub edges: Option<Spanned<Edges>>,
    /// With edges: a rectangle, or the disc that touches the rectangle's sides [default: rectangle].
    #[schemars(with = "Option<AreaShape>")]
    pub shape: Option<Spanned<AreaShape>>,
}

/// Light from all directions: under a uniform sky that nothing occludes, a surface with a k_L of 1 has the sky's
/// radiance.
#[derive(serde::Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SkyWire {
    /// Radiance from directly above: one number is white, three are red, green and blue [required without a picture].
    pub zenith: Option<Triple<Power>>,
    /// Radiance from the horizon and below [default: the zenith's].
    pub horizon: Option<Triple<Power>>,
    /// A picture of the light from all directions, instead of zenith and horizon: the path of a Radiance HDR
    /// or OpenEXR file, relative to the scene file.
    #[schemars(with = "Option<String>")]
    pub picture: Option<Spanned<String>>,
    /// A factor for the picture's radiance [default: 1].
    pub strength: Option<Number<NonNegative>>,
    /// Degrees by which the picture is turned around the zenith, counter-clockwise as seen from above [default: 0].
    pub turn_degrees: Option<Number<Finite>>,
    /// The distance from a hit beyond which surfaces do not occlude the sky [default: surfaces at any
    /// distance occlude it].
    pub reach: Option<Number<Positive>>,
}

/// How radiance is converted to 8-bit colours: 255 * tone(exposure * L)^(1 / gamma).
#[derive(Default, serde::Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct DisplayWire {
    /// The factor by which radiance L is multiplied, before the tone curve is applied [default: 15].
    pub exposure: Option<Number<NonNegative>>,
    /// The tone curve: clip cuts what is brighter than 1; filmic keeps shades in bright parts [default: clip].
    pub tone: Option<Tone>,
    /// Gamma: after the tone curve, each channel is raised to the power 1 / gamma [default: 2.2].
    pub gamma: Option<Number<Positive>>,
}

impl SceneWire {
    /// Stores the scene's origin (in the file's coordinates) in the camera, in the camera's positions and in the
    /// lights' positions.
    pub(super) fn set_origin(&mut self, origin: DVec3) {
        self.camera.origin = origin;
        let camera = [&mut self.camera.position, &mut self.camera.look_at].into_iter().flatten();
        let lights = self.light.iter_mut().flatten().map(|light| &mut light.position);
        camera.chain(lights).for_each(|position| position.get_mut().origin = origin);
    }

    /// Returns true if pictures of the scene have an alpha channel.
    pub(super) fn is_transparent(&self) -> bool {
        matches!(self.background, Some(BackgroundWire::Transparent))
    }
}
