//! Runs programs: makes their buffers, binds their arguments, starts their kernels, and reads from OpenCL's events how
//! long the kernels took.
//!
//! A [`Queue`] is a device ready for commands. A [`Session`] is a scene on a device. The session turns a strategy into
//! a [`Prepared`], which makes a [`Caster`] for frames of one size. A caster can cast such a frame repeatedly.

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
pub(crate) mod alone;
mod arguments;
mod ask;
mod band;
mod buffers;
mod caster;
mod error;
mod frame;
mod half_light;
mod held;
mod lent;
#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod offsets;
mod parts;
mod prepared;
mod queue;
mod rays;
mod records;
mod refused;
mod samples;
mod scene;
mod session;
mod setup;
mod shared;
mod shared_frame;
mod shared_scene;
mod show;
mod split;
mod staging;
mod steps;
mod subpixels;
mod textures;
mod tree;

pub use ask::preprocess_for;
pub use caster::Caster;
pub use error::LaunchError;
pub use frame::FrameTimes;
pub(crate) use frame::duration_ms;
pub use half_light::LightParts;
pub use prepared::Prepared;
pub use queue::Queue;
pub use rays::Ray;
pub use refused::Refused;
pub use session::{ROUNDED_STACK, Session};
pub use show::ShowProgram;
pub use split::{Casting, LeftOut, Share, Split, Whole};
pub use tree::{HostTree, stack_size};

use scene::DeviceScene;
use tree::DeviceTree;
