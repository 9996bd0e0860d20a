//! Running programs: buffers, arguments, NDRanges, events.
//!
//! A [`Queue`] is a device ready for commands; a [`DeviceScene`] the scene in its memory, in one layout; a
//! [`Caster`] everything one point needs to cast a frame again and again.

mod buffers;
mod caster;
mod frame;
mod queue;
mod scene;
mod steps;

pub use caster::{Caster, LaunchError};
pub use frame::FrameTimes;
pub use queue::Queue;
pub use scene::DeviceScene;
