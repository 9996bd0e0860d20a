//! What commands write where the user says. A file that raycl did not make, or that was changed since, is replaced only
//! with `--force`.
//!
//! A file of its own ([`Target`]: a picture, JSON) holds a [mark]: the hash of the rest of it. A folder of several files
//! ([`OutFolder`]) has a list of their hashes. A folder of results keeps rules of its own: nothing measured is replaced.

mod folder;
pub mod mark;
mod place;
mod results;
mod stale;
mod target;

pub use folder::{LIST, OutFolder};
pub use place::Choice;
pub use results::refuse_other_folders;
pub use target::Target;
