//! For tests: the arguments of runs, and small experiments.

use super::Args;
use crate::config::{self, Experiment};
use clap::Parser;
use std::path::Path;

#[derive(Parser)]
struct Command {
    #[command(flatten)]
    args: Args,
}

/// Returns the arguments of `raycl run`, parsed from words.
pub fn args(words: &[&str]) -> Args {
    Command::parse_from([&["run"], words].concat()).args
}

/// Returns an experiment that casts pictures of a triangle in two sizes with the preset `naive`. `lines` are
/// further lines of the experiment's config.
pub fn experiment(lines: &str) -> Experiment {
    let text = format!(
        "question = '?'\nexpectation = '!'\nscenes = ['scenes/triangle.toml']\nstrategies = ['naive']\n\
         image_sizes = [[8, 5], [16, 10]]\n{lines}\n"
    );
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("test.toml");
    config::parse(&config, text, &[]).unwrap_or_else(|error| panic!("{error}"))
}
