//! Casts rays through triangle scenes with OpenCL and finds out, by experiment, how best to do it.
//!
//! The rooms, in the order an experiment passes through them:
//! [`config`] reads a TOML experiment; [`scene`] loads what it names;
//! [`experiment`] plans its points (a [`strategy`] on a [`device`] at a local size);
//! [`program`] assembles and builds kernels from `cl/` as the [`manifest`] says ([`sources`] has their files); [`launch`] runs them;
//! [`verify`] compares their image with the [`reference`](mod@reference); [`measure`] times them, the [`anchor`] beside them;
//! [`printer`] keeps control characters from terminals; [`reader`] opens the files that users name, [`filetype`] names
//! those that are something else; [`memory`] says what the host can hold, [`load`] what else it does; [`record`] keeps what
//! was found. [`image`] turns radiance into pictures; [`output`] writes files where the user says, and replaces nothing of
//! anybody else's.
//! [`shard`] splits an experiment among machines and puts the pieces together. [`cli`] holds one file per subcommand;
//! [`documents`] makes the figures of this repository's documents of its stored records. [`cache`] keeps between runs what can
//! be made again.

pub mod accel;
pub mod anchor;
pub mod cache;
pub mod cli;
pub mod config;
pub mod device;
pub mod device_lock;
pub mod documents;
pub mod error;
pub mod experiment;
pub mod filetype;
pub mod image;
pub mod launch;
pub mod load;
pub mod manifest;
pub mod measure;
pub mod memory;
pub mod output;
pub mod peak;
pub mod printer;
pub mod program;
pub mod reader;
pub mod record;
pub mod reference;
pub mod report;
pub mod scene;
pub mod sensor;
pub mod shard;
pub mod sources;
pub mod strategy;
mod toml_error;
pub mod verify;
pub mod words;

pub use error::{Error, Result};
