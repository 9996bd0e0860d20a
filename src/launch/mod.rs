//! Running programs: buffers, arguments, NDRanges, events.
//!
//! A [`Queue`] is a device ready for commands; a [`DeviceScene`] the scene in its memory, in one layout; a
//! [`Caster`] everything one point needs to cast a frame again and again.

mod ask;
mod band;
mod buffers;
mod caster;
mod error;
mod frame;
mod parts;
mod queue;
mod rays;
mod scene;
mod shared;
mod split;
mod steps;
mod tree;

pub use ask::preprocess_for;
pub use band::{Band, cut};
pub use caster::Caster;
pub use error::LaunchError;
pub use frame::FrameTimes;
pub use queue::Queue;
pub use rays::{Ray, cast_rays};
pub use scene::DeviceScene;
pub use split::{Share, Split};
pub use tree::DeviceTree;

/// The kernels' mark for a ray that hits nothing: NO_HIT in cl/shared/hit.cl.
const NO_HIT: i32 = i32::MAX;
/// Floats of a triangle's planes for one origin: ROW_FLOATS in cl/layout/rows.cl.
const ROW_FLOATS: usize = 12;
