//! Casts rays through scenes of triangles with OpenCL, and finds by experiment the fastest way to do so.
//!
//! # The stable API
//!
//! The items listed here stay compatible between versions, as [Semantic Versioning](https://semver.org) says;
//! the programs in `examples/` show how to use them.
//!
//! | | |
//! |---|---|
//! | [`load_scene`] | reads a scene or a mesh, and returns it as [`Loaded`], which contains a [`Scene`] |
//! | [`Raycaster`] | casts a [`Picture`] of a scene on a device; the picture contains [`Radiance`] |
//! | [`hits`] | finds the hit of each pixel's ray, and returns [`Layers`]; without a hit, the numbers of the triangle and the object are [`NOTHING`] |
//! | [`run_experiment`], [`serve_if_worker`] | measure the points of a config; the result is one [`Record`] per point, with an [`Outcome`] |
//! | [`Error`], [`InputError`], [`Result`] | what a function returns if it fails |
//!
//! The types of the module [`scene`] that occur in fields of [`Loaded`] and [`Scene`] are internal, and so are the
//! functions that make an [`Error`].
//!
//! The text of an [`Error`] (`Display`) is its message alone. [`Error::in_a_line`] returns the message with
//! the file and the line of a mistake, and [`Error::remedy`] a next step for the user. The crate `miette`,
//! with its feature `fancy` or `fancy-no-backtrace`, prints the message, the location and the remedy together
//! with the lines of the file, as the programs in `examples/` do.
//!
//! ```no_run
//! # fn main() -> raycl::Result<()> {
//! let loaded = raycl::load_scene("scenes/teapot.toml".as_ref())?;
//! let mut caster = raycl::Raycaster::open(loaded.scene, None)?;
//! caster.cast(Some("naive"), [800, 500])?.save("teapot.png".as_ref())?;
//! # Ok(())
//! # }
//! ```
//!
//! # Internals
//!
//! All modules are internal, and may change without notice. [`scene`] is public, since fields of the stable API
//! have its types. Other modules that raycl's own binary and tests use are public too, but hidden in these
//! pages. All remaining modules are private.
//!
//! The following sentences, up to `measure`, name the modules in the order in which an experiment uses them.
//! [`config`] reads a TOML experiment. [`scene`] loads the scenes that the experiment names. [`experiment`]
//! plans the points of the experiment; each point is a [`strategy`] on a [`device`] at a local size.
//! [`program`] assembles the source of kernels from the files of `cl/` (which `sources` provides), according
//! to the table of kernels in `manifest`, and builds the kernels. [`launch`] runs the kernels. [`verify`]
//! compares the kernels' image with the [`reference`](mod@reference). [`experiment`] also times the kernels,
//! together with the `anchor`, and `measure` computes statistics of these times.
//!
//! [`printer`] replaces control characters in text that is printed to terminals. `reader` opens the files
//! that users name, `existing` finds out whether files exist, and `filetype` recognises their formats.
//! `memory` measures the host's free memory, and `load` measures the processor time that other processes
//! take. [`record`] stores the results. [`image`] turns radiance into pictures. `output` writes files for the
//! user. A file that raycl did not make, or that somebody has changed, is replaced only with `--force`.
//! (Folders of results have rules of their own.) [`shard`] splits an experiment among machines and merges
//! their results. [`cli`] has a file for each subcommand; [`documents`] computes numbers in this repository's
//! documents from stored records. `cache` stores data that raycl can recompute, so that later runs need not
//! compute it again. `threads` starts the threads of parallel iterators.

mod accel;
mod anchor;
mod cache;
mod child;
#[doc(hidden)]
pub mod cli;
mod clock;
#[doc(hidden)]
pub mod config;
#[doc(hidden)]
pub mod device;
#[doc(hidden)]
pub mod device_lock;
#[doc(hidden)]
pub mod documents;
mod entry;
mod error;
mod existing;
#[doc(hidden)]
pub mod experiment;
mod filetype;
#[doc(hidden)]
pub mod image;
#[doc(hidden)]
pub mod inherited;
#[doc(hidden)]
pub mod launch;
mod library;
mod load;
mod manifest;
mod measure;
mod memory;
mod microscope;
mod numbers;
mod output;
mod own_program;
mod peak;
#[doc(hidden)]
pub mod printer;
#[doc(hidden)]
pub mod program;
mod reader;
#[doc(hidden)]
pub mod record;
#[doc(hidden)]
pub mod reference;
mod report;
#[doc(hidden)]
pub mod rule;
pub mod scene;
mod schema;
mod sensor;
mod settings;
#[doc(hidden)]
pub mod shard;
mod sources;
#[doc(hidden)]
pub mod strategy;
mod threads;
mod toml_error;
mod toml_read;
#[doc(hidden)]
pub mod verify;
mod view;
mod words;
mod xdg;

pub use error::{Error, InputError, Result};
pub use image::Radiance;
pub use library::{Picture, Raycaster, hits, run_experiment, serve_if_worker};
pub use record::{Outcome, Record};
pub use reference::layers::{Layers, NOTHING};
pub use scene::{Loaded, Scene, load_scene};
