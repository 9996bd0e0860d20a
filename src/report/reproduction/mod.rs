//! Collects the data for the page of `raycl reproduce`, which repeats the experiments of a student paper. The page has
//! the answer to the paper's question, the paper's figures with raycl's measurements, the paper's claims with verdicts,
//! and the contradictions within the paper.

mod answer;
mod curves;
mod figures;
mod json;
mod predicted;

use super::claims::{Claim, Row, Run, Verdict, claims, table};
use super::common_names::with_common_names;
use super::gallery::Pictures;
use super::merged::merged;
use super::overview::devices;
use super::page::{SCRIPT, STYLE, nonce, notes};
use super::plot::Plot;
use super::view::PAPER_SIZE;
use crate::error::{Error, Result};
use crate::numbers::by;
use crate::record::{Folder, groups};
use answer::Answer;
use askama::Template;
use figures::{Described, Figure};
use std::cmp::Reverse;
use std::collections::HashMap;

/// The page of `raycl reproduce`, which repeats the paper's experiments.
#[derive(Template)]
#[template(path = "reproduction.html")]
pub struct Reproduction {
    style: &'static str,
    script: &'static str,
    nonce: String,
    version: &'static str,
    devices: Vec<Device>,
    /// The notes of the folders that have no results of any device.
    notes: Vec<String>,
    commands: Vec<String>,
    /// The names of those folders next to the page that contain a report.
    reports: Vec<String>,
    /// Maps a device's common name to the name that the driver reports. The map contains only devices for
    /// which the common name and the driver's name differ.
    drivers: HashMap<String, String>,
}

/// The results of one device for the page of `raycl reproduce`.
pub struct Device {
    name: String,
    id: String,
    sizes: String,
    answer: Answer,
    /// The notes of the folders that have results of the device.
    notes: Vec<String>,
    tally: Vec<(&'static str, usize)>,
    figures: Vec<Figure>,
    claims: Vec<Claim>,
}

struct Paper {
    rows: Vec<Row>,
    figures: Vec<Described>,
}

impl Reproduction {
    /// Collects the page's data from the folders. If the folders lack a claim's points, the claim's verdict
    /// is "cannot be tested here". Returns an error if raycl's table of claims or of figures is not valid.
    pub fn of(folders: &[Folder]) -> Result<Self> {
        let paper = Paper { rows: table()?, figures: figures::described()? };
        let (folders, drivers) = with_common_names(folders);
        let folders = &folders[..];
        let records: Vec<_> = folders.iter().map(|folder| merged(std::slice::from_ref(folder))).collect();
        let mut runs: Vec<Run<'_>> = folders
            .iter()
            .zip(&records)
            .flat_map(|(folder, records)| Run::of(folder, groups(records)))
            .collect();
        sort_by_size(&mut runs);
        let names = devices(runs.iter().flat_map(|run| &run.groups));
        let (mut pictures, mut taken) = (Pictures::default(), Vec::new());
        let devices = (0..)
            .zip(&names)
            .map(|(index, name)| Device {
                notes: notes(folders, |folder| has_results(folder, name)),
                ..device(index, name, &runs, &paper, &mut pictures, &mut taken)
            })
            .collect();
        let reports = folders.iter().filter(|folder| folder.path.join(super::PAGE).is_file());
        Ok(Self {
            style: STYLE,
            script: SCRIPT,
            nonce: nonce(),
            version: env!("CARGO_PKG_VERSION"),
            devices,
            notes: notes(folders, |folder| !names.iter().any(|name| has_results(folder, name))),
            commands: commands(folders),
            drivers,
            reports: reports.map(|folder| folder.label.clone()).collect(),
        })
    }

    /// Returns the page as HTML.
    pub fn html(&self) -> Result<String> {
        self.render()
            .map_err(|error| Error::fault(format!("the reproduction page could not be written: {error}")))
    }

    /// Returns each device's name and the four lines of its answer as text.
    pub fn answers(&self) -> String {
        let answer = |device: &Device| {
            let lines = device.answer.lines().map(|(heading, line)| format!("  {heading}: {line}."));
            format!("{}\n{}", device.name, lines.join("\n"))
        };
        self.devices.iter().map(answer).collect::<Vec<_>>().join("\n")
    }

    /// Returns all plots of the page.
    pub fn plots(&self) -> Vec<&Plot> {
        self.devices
            .iter()
            .flat_map(|device| {
                let figures = device.figures.iter().flat_map(|figure| &figure.plots);
                device.answer.plots.iter().chain(figures)
            })
            .collect()
    }
}

/// Sorts runs by their image size: first the size of the paper's figures, then all further sizes in the order
/// of the runs. The answer, the curves of each figure and each comparison of a claim use the first of these image sizes
/// at which enough of their points were measured. If possible, all of them thus use the same image size.
fn sort_by_size(runs: &mut [Run<'_>]) {
    let mut sizes = vec![PAPER_SIZE];
    sizes.extend(runs.iter().map(Run::image_size));
    runs.sort_by_key(|run| sizes.iter().position(|size| *size == run.image_size()));
}

/// Returns the run for which `count` returns the largest number; if several runs have this number, returns
/// the last of them. Runs for which `count` returns less than `least` are left out. If the remaining runs
/// have several image sizes, only runs with the size that comes first in `runs` are considered. Returns
/// `None` if no run remains.
fn with_most<'r, 'a>(
    runs: &'r [Run<'a>],
    least: usize,
    count: impl Fn(&Run<'a>) -> usize,
) -> Option<&'r Run<'a>> {
    let size = |run: &Run<'_>| runs.iter().position(|other| other.image_size() == run.image_size());
    runs.iter().filter(|run| count(run) >= least).max_by_key(|run| (Reverse(size(run)), count(run)))
}

/// Returns the commands that measured the results in the folders, without repetitions.
fn commands(folders: &[Folder]) -> Vec<String> {
    let mut commands: Vec<String> = Vec::new();
    for command in folders.iter().map(|folder| super::environment::view(folder).command) {
        if !command.is_empty() && !commands.contains(&command) {
            commands.push(command);
        }
    }
    commands
}

/// Returns true if a folder has results of a device.
fn has_results(folder: &Folder, device: &str) -> bool {
    folder.records.iter().any(|record| record.device == device)
}

/// Returns the results of a device, without notes. `index` is the device's index on the page. `taken`
/// contains the names of the plots that the page already has for other devices. The function adds to
/// `taken` the names of the plots in the answer for this device.
fn device(
    index: usize,
    name: &str,
    runs: &[Run<'_>],
    paper: &Paper,
    pictures: &mut Pictures,
    taken: &mut Vec<String>,
) -> Device {
    let claims = claims(paper.rows.clone(), runs, name);
    let own = runs.iter().flat_map(|run| &run.groups).filter(|group| group.device == name);
    let mut sizes: Vec<[u32; 2]> = own.map(|group| group.image_size).collect();
    sizes.sort_unstable();
    sizes.dedup();
    let count = |verdict| claims.iter().filter(|claim| claim.verdict == verdict).count();
    let suffix = if index == 0 { String::new() } else { format!("-{}", index + 1) };
    let figures = paper.figures.iter().cloned();
    Device {
        name: name.to_owned(),
        id: format!("device-{index}"),
        sizes: sizes.into_iter().map(by).collect::<Vec<_>>().join(", "),
        answer: answer::answer(runs, name, &suffix, taken),
        notes: Vec::new(),
        tally: Verdict::ALL.map(|(verdict, word, ..)| (word, count(verdict))).to_vec(),
        figures: figures.map(|about| figures::figure(about, runs, name, &suffix, pictures)).collect(),
        claims,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Record;
    use crate::record::fixtures::{judged, measured};

    fn at(image_size: [u32; 2], name: &str, side: u32, ms: f64) -> Record {
        let record = measured("gpu", name, side, ms);
        Record { key: format!("{image_size:?} {}", record.key), image_size, ..record }
    }

    fn page(records: &[Record]) -> Device {
        let folder = Folder { records: judged(records), ..Folder::default() };
        Reproduction::of(&[folder]).expect("the tables are right").devices.remove(0)
    }

    /// Returns two texts of the row for the teapot and 4 x 4 work-items in the table of Figure 6: raycl's
    /// time and the ratio.
    fn row(device: &Device) -> [&str; 2] {
        let figure = device.figures.iter().find(|figure| figure.about.number == 6).expect("a figure");
        let is_own = |row: &&[String; 5]| row[0].starts_with("Teapot") && row[1] == "4 x 4";
        let row = figure.rows.iter().find(is_own).expect("a row");
        [&row[3], &row[4]]
    }

    fn compares(device: &Device, start: &str) -> bool {
        let mut lines = device.claims.iter().flat_map(|claim| &claim.lines);
        lines.any(|line| line.text.starts_with(start) && line.text.contains(" as long as "))
    }

    #[test]
    fn the_notes_of_a_devices_folders_are_directly_below_its_four_lines() {
        let run = |label: &str, records: &[Record]| Folder {
            path: label.into(),
            label: label.into(),
            records: judged(records),
            notes: vec!["disturbed".to_owned()],
            ..Folder::default()
        };
        let on =
            |device: &str| [("naive", 2.0), ("private", 1.0)].map(|(name, ms)| measured(device, name, 8, ms));
        let folders = [run("figure-8", &on("gpu")), run("figure-6", &on("cpu")), run("figure-7", &[])];
        let html = |folders: &[Folder]| {
            Reproduction::of(folders).and_then(|page| page.html()).unwrap_or_else(|error| panic!("{error}"))
        };
        let html_of_all = html(&folders);
        let mut rest = html_of_all.as_str();
        let order = [
            "<dt>How sure</dt>",
            "figure-8: disturbed",
            "class=\"counts\"",
            "<dt>How sure</dt>",
            "figure-6: disturbed",
            "class=\"counts\"",
            "<section id=\"notes\">",
            "figure-7: disturbed",
        ];
        for part in order {
            let (_, after) = rest.split_once(part).unwrap_or_else(|| panic!("{part:?} is not in its place"));
            rest = after;
        }
        assert_eq!(html_of_all.matches(": disturbed").count(), 3);
        let html_of_one = html(&folders[..1]);
        let after = html_of_one.split_once("<dt>How sure</dt>").expect("the four lines").1;
        let below = after.split_once("</dl>").expect("the end of the four lines").1.trim_start();
        assert!(below.starts_with("<p class=\"note\">disturbed</p>"), "the note is not directly below");
        assert!(!html_of_one.contains("<section id=\"notes\">"));
    }

    #[test]
    fn the_plots_of_all_devices_have_names_of_their_own() {
        let on = |device: &str, scene: &str, name: &str, ms| Record {
            key: format!("{device} {scene} {name}"),
            scene: scene.into(),
            ..measured(device, name, 8, ms)
        };
        let both = |device: &'static str, scene: &'static str| {
            [("naive", 10.0), ("private", 2.0)].map(|(name, ms)| on(device, scene, name, ms))
        };
        let pairs = [("gpu", "teapot"), ("gpu", "teapot-2"), ("cpu", "teapot"), ("cpu", "teapot-2")];
        let records = pairs.map(|(device, scene)| both(device, scene)).concat();
        let folder = Folder { records: judged(records), ..Folder::default() };
        let page = Reproduction::of(&[folder]).expect("the tables are right");
        let mut names: Vec<&str> = page.plots().into_iter().map(|plot| plot.name.as_str()).collect();
        assert_eq!(names.iter().filter(|name| name.starts_with("answer-")).count(), 4, "{names:?}");
        names.sort_unstable();
        let all = names.len();
        names.dedup();
        assert_eq!(names.len(), all, "{names:?}");
    }

    #[test]
    fn all_parts_of_the_page_are_of_the_papers_image_size_if_it_was_measured() {
        let small = [("naive", 4, 0.2), ("naive", 8, 0.3), ("private", 8, 0.1)];
        let small = small.map(|(name, side, ms)| at([200, 125], name, side, ms));
        // In this test, one point was measured only with the smaller images, for example because it exceeded
        // a time limit with the larger images.
        let large = [("naive", 4, 2.0), ("private", 8, 1.0)];
        let large = large.map(|(name, side, ms)| at(PAPER_SIZE, name, side, ms));
        for records in [[&small[..], &large].concat(), [&large[..], &small].concat()] {
            let both = page(&records);
            let best = "on teapot, private (vectors private, triangles global): 1.000 ms";
            assert_eq!(both.answer.strategy, best);
            let [ours, ratio] = row(&both);
            assert!(ours == "2.000" && ratio.ends_with('×'), "{ours} {ratio}");
            // The point `naive at 8 x 8` was measured only with the smaller images.
            assert!(compares(&both, "naive at 8 x 8 on teapot at 200 x 125 ("));
        }
        let only = page(&small);
        let expected = "on teapot at 200 x 125, private (vectors private, triangles global): 0.1000 ms";
        assert_eq!(only.answer.strategy, expected);
        assert_eq!(row(&only), ["0.2000", "other image size"]);
        let plots = only.figures.iter().flat_map(|figure| &figure.plots);
        let titles = plots.filter(|plot| plot.svg.contains("gpu, 200 x 125 (the paper: 800 x 500)"));
        assert_eq!(titles.count(), 2, "the two plots of Figure 6");
    }

    #[test]
    fn each_command_is_listed_once_and_a_folder_without_a_command_has_none() {
        let with = |words: &[&str]| Folder {
            environment: serde_json::json!({ "command_line": words }),
            ..Folder::default()
        };
        let [first, second] =
            [["raycl", "run", "a.toml"], ["raycl", "run", "b.toml"]].map(|words| with(&words));
        let folders = [first.clone(), Folder::default(), second, first];
        assert_eq!(commands(&folders), ["raycl run a.toml", "raycl run b.toml"]);
    }
}
