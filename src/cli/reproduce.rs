//! `raycl reproduce`: the paper's experiments, and a page that says what held.

use super::choice::parse_assignment;
use super::run;
use crate::error::{Error, Result};
use crate::report::{self, Folder};
use include_dir::{Dir, include_dir};
use std::path::{Path, PathBuf};

/// Arguments of `raycl reproduce`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl reproduce
  raycl reproduce --device nvidia --out results/reproduction-h200
  raycl reproduce --set 'image_sizes=[[200, 125]]' --set timing.time_limit_ms=100
  raycl reproduce --page-only --out results/reproduction")]
pub struct Args {
    /// A word of a device's name, platform or vendor, or cpu, gpu or all [default: the configs' own]
    #[arg(long, value_name = "NAME")]
    device: Vec<String>,
    /// Where to write: a folder of results for each config, and the page
    #[arg(short, long, value_name = "DIR", default_value = "results/reproduction")]
    out: PathBuf,
    /// Change a value of every config
    #[arg(long, value_name = "KEY=VALUE", value_parser = parse_assignment)]
    set: Vec<(String, String)>,
    /// Measure nothing: make the page of the results that are there
    #[arg(long)]
    page_only: bool,
    /// No progress and no tables
    #[arg(short, long)]
    quiet: bool,
}

/// The paper's configs, in the order of its figures; they are part of the program, so it runs anywhere.
const CONFIGS: [(&str, &str); 4] = [
    ("figure-6", include_str!("../../configs/figure-6.toml")),
    ("figure-7", include_str!("../../configs/figure-7.toml")),
    ("figure-8", include_str!("../../configs/figure-8.toml")),
    ("next-steps", include_str!("../../configs/next-steps.toml")),
];

/// The scenes that they may name.
static SCENES: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/scenes");

/// Runs the paper's configs and writes the page. Points that could not be measured are on the page and do not stop it.
pub fn run(args: Args) -> Result<()> {
    let mut failed = Vec::new();
    if !args.page_only {
        unpack(&args.out)?;
        for (name, _) in CONFIGS {
            failed.extend(measure(&args, name)?);
        }
    }
    let page = write_page(&args.out)?;
    if !args.quiet {
        super::print(format!("Reproduction: {}", page.display()))?;
    }
    match failed.as_slice() {
        [] => Ok(()),
        some => {
            Err(Error::run(some.join("; "))
                .with_help("the page was written; each folder's summary.md tells why"))
        }
    }
}

/// Writes the configs and scenes, so that what was run lies beside what was found.
fn unpack(out: &Path) -> Result<()> {
    let scenes = SCENES.files().filter_map(|file| Some((file.path().to_str()?, file.contents_utf8()?)));
    let configs = CONFIGS.iter().map(|(name, text)| (format!("configs/{name}.toml"), *text));
    for (name, text) in configs.chain(scenes.map(|(name, text)| (format!("scenes/{name}"), text))) {
        let path = out.join(name);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)
                .map_err(|error| Error::input(format!("cannot make {}: {error}", folder.display())))?;
        }
        report::put(&path, text.as_bytes())?;
    }
    Ok(())
}

/// Runs a config; what of it failed is given back, unless nothing could be run at all.
fn measure(args: &Args, name: &str) -> Result<Option<String>> {
    let out = args.out.join(name);
    if !args.quiet {
        super::print(format!("\n{name}"))?;
    }
    let config = args.out.join("configs").join(format!("{name}.toml"));
    match run::run(run::Args::of(config, &out, &args.device, &args.set, args.quiet)) {
        Ok(()) => Ok(None),
        Err(Error::Run { message, .. }) if out.join("summary.md").exists() => {
            Ok(Some(format!("{name}: {message}")))
        }
        Err(error) => Err(error),
    }
}

fn write_page(out: &Path) -> Result<PathBuf> {
    let present =
        CONFIGS.iter().map(|(name, _)| out.join(name)).filter(|folder| folder.join("records.jsonl").exists());
    let folders = present.map(|folder| Folder::read(&folder)).collect::<Result<Vec<_>>>()?;
    if folders.is_empty() {
        let error = Error::input(format!("{} holds no results of the paper's configs", out.display()));
        return Err(error.with_help("run `raycl reproduce` without --page-only first"));
    }
    report::write_reproduction(&folders, out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_of_the_papers_configs_is_unpacked() {
        let out = tempfile::tempdir().expect("a folder");
        unpack(out.path()).expect("it writes");
        for (name, _) in CONFIGS {
            crate::config::load(&out.path().join(format!("configs/{name}.toml")), &[])
                .expect("its scenes are there");
        }
    }
}
