//! Running programs: buffers, arguments, NDRanges, events.
//!
//! A [`Queue`] is a device ready for commands; a [`Session`] a scene on it, and the one way from a strategy to a [`Caster`]:
//! everything one point needs to cast a frame again and again.

mod arguments;
mod ask;
mod band;
mod buffers;
mod caster;
mod error;
mod frame;
mod held;
mod parts;
mod prepared;
mod queue;
mod rays;
mod records;
mod refused;
mod rounds;
mod scene;
mod session;
mod setup;
mod shared;
mod shared_scene;
mod show;
mod split;
mod staging;
mod steps;
mod textures;
mod tree;

pub use ask::preprocess_for;
pub use caster::Caster;
pub use error::LaunchError;
pub use frame::FrameTimes;
pub(crate) use frame::duration_ms;
pub use prepared::Prepared;
pub use queue::Queue;
pub use rays::Ray;
pub use refused::Refused;
pub use session::Session;
pub use show::ShowProgram;
pub use split::{Casting, LeftOut, Share, Split, Whole};
pub use tree::{HostTree, stack_size};

use scene::DeviceScene;
use tree::DeviceTree;
