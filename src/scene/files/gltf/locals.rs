//! Reads the transforms of nodes in double precision. The crate `gltf-json` reads them in single precision, in which
//! neighbouring nodes far from the origin, as in maps, would coincide.

use super::transforms::affine;
use glam::{DMat4, DQuat, DVec3};
use serde::Deserialize;

/// The transform from a node's coordinates to the coordinates of its parent.
#[derive(Deserialize)]
#[serde(from = "Stated")]
pub(super) struct Local(pub DMat4);

/// The numbers of a node in the file that state its transform.
#[derive(Deserialize)]
struct Stated {
    matrix: Option<[f64; 16]>,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
}

/// The nodes of a file, without its other parts.
#[derive(Deserialize)]
struct Nodes {
    #[serde(default)]
    nodes: Vec<Local>,
}

/// Returns the transforms of all nodes in the JSON of a file, in the file's order.
pub(super) fn read(json: &[u8]) -> serde_json::Result<Vec<Local>> {
    serde_json::from_slice(json).map(|Nodes { nodes }| nodes)
}

impl From<Stated> for Local {
    fn from(Stated { matrix, translation, rotation, scale }: Stated) -> Self {
        if let Some(matrix) = matrix {
            return Self(affine(DMat4::from_cols_array(&matrix)));
        }
        let vector = |values: Option<[f64; 3]>, usual| values.map_or(usual, DVec3::from_array);
        let rotation = rotation.map_or(DQuat::IDENTITY, DQuat::from_array);
        let rotation = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
        Self(DMat4::from_scale_rotation_translation(
            vector(scale, DVec3::ONE),
            rotation,
            vector(translation, DVec3::ZERO),
        ))
    }
}
