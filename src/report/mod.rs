//! From records to a page that a person would rather look at. Reads records and pictures, never a device.

mod answer;
mod claims;
mod compare;
mod environment;
mod gallery;
mod growth;
mod merged;
mod occupancy;
mod overview;
mod page;
pub mod paper;
pub mod plot;
mod reproduction;
mod stale;
mod view;
mod words;

pub use claims::OTHER_CONTRADICTIONS;
pub use compare::{Comparison, Pair};
pub use environment::quote;
pub use page::Page;
pub use reproduction::Reproduction;

use crate::error::{Error, Result};
use crate::record::{Folder, Record, kernel_tuner_caches, own_folder, summary_csv, t4_results, write_page};
use plot::Plot;
use rayon::prelude::*;
use stale::remove_stale;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// What was written.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// The page.
    pub page: PathBuf,
    /// The folder of plots, and how many there are.
    pub plots: (PathBuf, usize),
    /// The folder of files for other tools.
    pub exports: PathBuf,
}

/// Writes `report.html`, `plots/` and `exports/` of the folders' records into `out`.
pub fn write(folders: &[Folder], out: &Path) -> Result<Written> {
    std::fs::create_dir_all(out).map_err(|error| cannot("make", out, &error))?;
    let page = Page::of(folders);
    let path = out.join("report.html");
    put(&path, page.html()?.as_bytes())?;
    let plots = write_plots(&page.plots(), out)?;
    let names = page.plots().into_iter().flat_map(file_names);
    remove_stale(&plots.0, &names.collect());
    let exports = write_exports(&merged::merged(folders), out)?;
    Ok(Written { page: path, plots, exports })
}

/// Writes what other tools read under `out/exports`: T4 results, a Kernel Tuner cache a group, CSV.
fn write_exports(records: &[Record], out: &Path) -> Result<PathBuf> {
    let folder = out.join("exports");
    own_folder(&folder).map_err(|error| cannot("make", &folder, &error))?;
    put(&folder.join("t4-results.json"), t4_results(records).as_bytes())?;
    let mut written = HashSet::new();
    for (name, text) in kernel_tuner_caches(records) {
        let name = format!("kernel-tuner-{name}.json");
        put(&folder.join(&name), text.as_bytes())?;
        written.insert(name);
    }
    remove_stale(&folder, &written);
    put(&folder.join("points.csv"), &summary_csv(records)?)?;
    Ok(folder)
}

/// Writes `reproduction.html` and its plots of folders made with the paper's configs into `out`; returns the page's path.
pub fn write_reproduction(folders: &[Folder], out: &Path) -> Result<PathBuf> {
    std::fs::create_dir_all(out).map_err(|error| cannot("make", out, &error))?;
    let page = Reproduction::of(folders);
    let path = out.join("reproduction.html");
    put(&path, page.html()?.as_bytes())?;
    write_plots(&page.plots(), out)?;
    Ok(path)
}

/// Writes `compare.html`, `compare.md` and the plot into `out`.
pub fn write_comparison(comparison: &Comparison, out: &Path) -> Result<()> {
    std::fs::create_dir_all(out).map_err(|error| cannot("make", out, &error))?;
    put(&out.join("compare.html"), comparison.html()?.as_bytes())?;
    put(&out.join("compare.md"), comparison.markdown().as_bytes())?;
    write_plots(&[&comparison.plot()], out).map(|_| ())
}

/// Writes every plot as SVG and PNG under `out/plots`.
pub fn write_plots(plots: &[&Plot], out: &Path) -> Result<(PathBuf, usize)> {
    let folder = out.join("plots");
    own_folder(&folder).map_err(|error| cannot("make", &folder, &error))?;
    plots.par_iter().try_for_each(|plot| {
        let [svg, png] = file_names(plot);
        put(&folder.join(svg), plot.svg.as_bytes())?;
        put(&folder.join(png), &plot::png::png(&plot.svg)?)
    })?;
    Ok((folder, plots.len()))
}

fn file_names(plot: &Plot) -> [String; 2] {
    [format!("{}.svg", plot.name), format!("{}.png", plot.name)]
}

/// Writes a file, or says which one could not be written.
pub fn put(path: &Path, bytes: &[u8]) -> Result<()> {
    write_page(path, bytes)
}

fn cannot(what: &str, path: &Path, error: &std::io::Error) -> Error {
    Error::run(format!("cannot {what} {}: {error}", path.display()))
}
