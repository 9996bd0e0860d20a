//! Writes HTML pages from stored records and pictures, without an OpenCL device.

mod answer;
mod claims;
mod common_names;
mod compare;
mod environment;
mod gallery;
mod growth;
mod merged;
mod microscope;
mod occupancy;
mod one_change;
mod overview;
mod page;
pub mod paper;
pub mod plot;
mod reproduction;
mod roofline;
mod side_by_side;
mod view;
mod words;

pub use claims::OTHER_CONTRADICTIONS;
pub use compare::{Comparison, Pair};
pub(crate) use growth::exponent;
pub use microscope::{MICROSCOPE, microscope_page};
pub use page::Page;
pub use reproduction::Reproduction;

use crate::error::Result;
use crate::output::OutFolder;
use crate::record::{Folder, Record, kernel_tuner_caches, summary_csv, t4_results};
use plot::Plot;
use rayon::prelude::*;
use std::path::PathBuf;

/// The files that a report consists of.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// The path of `report.html`.
    pub page: PathBuf,
    /// The path of the folder `plots`, and the number of plots. Each plot is stored in two files, as SVG and
    /// PNG.
    pub plots: (PathBuf, usize),
    /// The path of the folder `exports`, which contains files for other tools.
    pub exports: PathBuf,
}

/// The file name of a report's page.
pub const PAGE: &str = "report.html";
/// The file names of a comparison's pages.
pub const COMPARISON: [&str; 2] = ["compare.html", "compare.md"];
/// The file names of a reproduction: the page, and the page's content as JSON for programs.
pub const REPRODUCTION: [&str; 2] = ["reproduction.html", "reproduction.json"];
/// The beginnings of the paths of a reproduction's plots.
const REPRODUCTION_PLOTS: [&str; 2] = ["plots/answer-", "plots/figure-"];

/// Files to be written: each file's path, relative to the output folder, and the file's content.
type Files = Vec<(String, Vec<u8>)>;

/// Writes `report.html`, `plots/` and `exports/` for the folders' records into `out`. Also removes those
/// plots and exports of earlier reports that the new report does not contain.
pub fn write(folders: &[Folder], out: &mut OutFolder) -> Result<Written> {
    let page = Page::of(folders);
    let mut files = vec![(PAGE.to_owned(), page.html()?.into_bytes())];
    let plots = page.plots();
    files.extend(plot_files(&plots)?);
    files.extend(exports(&merged::merged(folders))?);
    out.write(&files)?;
    out.remove_stale(&files)?;
    let at = |name: &str| out.path().join(name);
    Ok(Written { page: at(PAGE), plots: (at("plots"), plots.len()), exports: at("exports") })
}

/// Returns files for other tools: the results in T4 (a format of auto-tuners), a cache file of Kernel Tuner for
/// each group of points except baselines, and a CSV file with a row per record.
fn exports(records: &[Record]) -> Result<Files> {
    let mut files = vec![
        ("exports/t4-results.json".to_owned(), t4_results(records).into_bytes()),
        ("exports/points.csv".to_owned(), summary_csv(records)?),
    ];
    let caches = kernel_tuner_caches(records).into_iter();
    files.extend(caches.map(|(name, text)| (format!("exports/kernel-tuner-{name}.json"), text.into_bytes())));
    Ok(files)
}

/// Writes `reproduction.html`, `reproduction.json` and the plots into `out`, and removes those plots of an earlier
/// `raycl reproduce` that the new page does not contain. `folders` contain the results of the paper's configs.
/// Returns the path of `reproduction.html`, and a text with each device's answer: the best memory strategy and local
/// size, why the strategy is the best, and how certain the answer is.
pub fn write_reproduction(folders: &[Folder], out: &mut OutFolder) -> Result<(PathBuf, String)> {
    let page = Reproduction::of(folders)?;
    let [html, json] = REPRODUCTION.map(str::to_owned);
    let mut files = vec![(html, page.html()?.into_bytes()), (json, page.json()?.into_bytes())];
    files.extend(plot_files(&page.plots())?);
    out.write(&files)?;
    // Only old plots of `raycl reproduce` are removed; plots of other pages in the folder stay.
    let is_own = |name: &str| REPRODUCTION_PLOTS.iter().any(|beginning| name.starts_with(beginning));
    let is_written = |name: &str| files.iter().any(|(written, _)| written == name);
    out.remove_listed(|name| is_own(name) && !is_written(name))?;
    Ok((out.path().join(REPRODUCTION[0]), page.answers()))
}

/// Writes `compare.html`, `compare.md` and the plot of a comparison into `out`.
pub fn write_comparison(comparison: &Comparison, out: &mut OutFolder) -> Result<()> {
    let [html, markdown] = COMPARISON.map(str::to_owned);
    let mut files =
        vec![(html, comparison.html()?.into_bytes()), (markdown, comparison.markdown().into_bytes())];
    files.extend(plot_files(&[&comparison.plot()])?);
    out.write(&files)
}

/// Returns two files for each plot: `plots/NAME.svg` and `plots/NAME.png`.
fn plot_files(plots: &[&Plot]) -> Result<Files> {
    let drawn = plots.par_iter().map(|plot| {
        let file = |ending: &str, bytes: Vec<u8>| (format!("plots/{}.{ending}", plot.name), bytes);
        Ok([file("svg", plot.svg.clone().into_bytes()), file("png", plot::png::png(&plot.svg)?)])
    });
    Ok(drawn.collect::<Result<Vec<_>>>()?.into_iter().flatten().collect())
}
