//! `raycl schema`: prints JSON schemas of the files that users write, and of records.

use crate::error::Result;
use crate::{config, record, scene};

/// Arguments of `raycl schema`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl schema scene > scene.schema.json
  raycl schema config > config.schema.json
  raycl schema record > record.schema.json

If the first line of a TOML file is `#:schema PATH`, where PATH is the schema's path relative to the TOML file, editors that support JSON schemas (with Even Better TOML, Taplo or Tombi) complete and check the file. raycl itself ignores this line. raycl's repository has all schemas in docs/schemas. The schema of records describes the type of each field of records.jsonl.")]
pub struct Args {
    /// The files that the schema describes
    #[arg(value_name = "WHAT")]
    what: What,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum What {
    /// Scene files
    Scene,
    /// Configs of experiments, such as configs/quick.toml
    Config,
    /// Lines of records.jsonl, each of which is the result of one point
    Record,
}

/// Prints the schema.
pub fn run(args: Args) -> Result<()> {
    super::print_json(&match args.what {
        What::Scene => scene::schema(),
        What::Config => config::schema(),
        What::Record => record::schema(),
    })
}
