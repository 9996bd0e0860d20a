//! The files that commands write for the user. Outside folders of results (the output of `raycl run`), a file
//! that raycl did not make, or that somebody has changed, is replaced only with `--force`.
//!
//! If a command writes a single file ([`Target`]: a picture, JSON), the file contains a [mark], which is a
//! hash of the rest of the file. If a command writes several files into a folder ([`OutFolder`]), it also
//! writes a list of the files' hashes. A folder of results has no such list: raycl replaces a page there even
//! if somebody has changed the page, and appends new records to the old ones.

mod folder;
pub mod mark;
mod replace;
mod results;
mod stale;
mod target;
mod unfinished;

pub use folder::OutFolder;
pub use replace::Choice;
pub use results::refuse_other_folders;
#[cfg(test)]
pub use stale::is_of_report;
pub use target::{Target, in_memory};
