//! All tests outside `src/`. All these files form one program of tests, so that only one program is linked,
//! and all cores stay busy until the last test. `cargo test --test all kernels::` runs the tests of one file.
#![allow(missing_docs, reason = "a test program has no documentation")]
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod binary;
mod common;

mod all_features;
mod animation;
mod architecture;
mod area_lights;
mod bad_input;
mod book;
mod cache;
mod commands;
mod compiled;
mod corner_colours;
mod cutouts;
#[cfg(unix)]
mod device_lock;
mod edits;
mod emission;
mod environment;
mod examples;
mod experiments;
#[cfg(unix)]
mod faults;
mod figures;
mod formats;
mod fuzzed;
mod goldens;
#[cfg(unix)]
mod guarded;
mod half_light;
mod host_mutants;
mod hosted;
#[cfg(unix)]
mod hostile;
#[cfg(target_os = "linux")]
mod inherited;
mod kernel;
mod kernels;
mod launches;
mod layers;
mod meshes;
mod microscope;
mod mips;
mod motion;
mod mutants;
mod near;
mod numbers;
mod oclgrind;
mod overlay;
mod overwrite;
mod peak;
mod planes;
mod readme;
mod render;
mod report;
mod reproduce;
mod resuming;
mod run;
mod sampled_experiments;
mod samples;
mod scenes;
mod schemas;
#[cfg(unix)]
mod scripts;
mod session;
mod settings;
mod shade_once;
#[cfg(unix)]
mod shards;
mod smooth_shadows;
mod soft;
mod split;
#[cfg(unix)]
mod statuses;
mod supervisor;
mod textures;
mod torture;
mod transparent;
mod trees;
mod turns;
#[cfg(unix)]
mod view;
mod watertight;
#[cfg(unix)]
mod x_server;
