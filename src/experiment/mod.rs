//! From an experiment to what is to be measured.

mod plan;

pub use plan::{KeyParts, Plan, Point, Work, key};
