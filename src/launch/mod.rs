//! Running programs: buffers, arguments, NDRanges, events.
//!
//! A [`Queue`] is a device ready for commands; a [`DeviceScene`] the scene in its memory, in one layout; a
//! [`Caster`] everything one point needs to cast a frame again and again.

mod arguments;
mod ask;
mod band;
mod buffers;
mod caster;
mod error;
mod frame;
mod parts;
mod queue;
mod rays;
mod rounds;
mod scene;
mod setup;
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
pub use setup::Setup;
pub use split::{Share, Split};
pub use tree::DeviceTree;
