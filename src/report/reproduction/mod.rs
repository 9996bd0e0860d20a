//! Collects the data for the reproduction of the paper: the answer, the paper's figures with our
//! measurements, the paper's claims with verdicts, and its contradictions.

mod answer;
mod curves;
mod figures;
mod json;
mod predicted;

use super::claims::{Claim, Row, Run, Verdict, claims, table};
use super::gallery::Pictures;
use super::merged::merged;
use super::page::{SCRIPT, STYLE, nonce, notes};
use super::plot::Plot;
use crate::error::{Error, Result};
use crate::record::{Folder, HOST, by, groups};
use answer::Answer;
use askama::Template;
use figures::{Described, Figure};

/// The page of the reproduction.
#[derive(Template)]
#[template(path = "reproduction.html")]
pub struct Reproduction {
    style: &'static str,
    script: &'static str,
    nonce: String,
    version: &'static str,
    devices: Vec<Device>,
    notes: Vec<String>,
    commands: Vec<String>,
    /// Names of the folders next to the page that have their own reports.
    reports: Vec<String>,
}

/// The results of one device.
pub struct Device {
    name: String,
    id: String,
    sizes: String,
    answer: Answer,
    tally: Vec<(&'static str, usize)>,
    figures: Vec<Figure>,
    claims: Vec<Claim>,
}

/// The paper's claims and figures.
struct Paper {
    rows: Vec<Row>,
    figures: Vec<Described>,
}

impl Reproduction {
    /// Collects the page's data from these folders. More claims can be tested if the folders have
    /// results of more of the paper's configs.
    pub fn of(folders: &[Folder]) -> Result<Self> {
        let paper = Paper { rows: table()?, figures: figures::described()? };
        let records: Vec<_> = folders.iter().map(|folder| merged(std::slice::from_ref(folder))).collect();
        let runs: Vec<Run<'_>> = folders
            .iter()
            .zip(&records)
            .flat_map(|(folder, records)| Run::of(folder, groups(records)))
            .collect();
        let mut names: Vec<&str> = Vec::new();
        for group in runs.iter().flat_map(|run| &run.groups).filter(|group| group.device != HOST) {
            if !names.contains(&group.device) {
                names.push(group.device);
            }
        }
        let mut pictures = Pictures::default();
        let devices = (0..)
            .zip(&names)
            .map(|(place, name)| device(place, name, &runs, &paper, &mut pictures))
            .collect();
        let reports = folders.iter().filter(|folder| folder.path.join("report.html").is_file());
        Ok(Self {
            style: STYLE,
            script: SCRIPT,
            nonce: nonce(),
            version: env!("CARGO_PKG_VERSION"),
            devices,
            notes: notes(folders),
            commands: commands(folders),
            reports: reports.map(|folder| folder.label.clone()).collect(),
        })
    }

    /// Returns the page as HTML.
    pub fn html(&self) -> Result<String> {
        self.render()
            .map_err(|error| Error::fault(format!("the reproduction page could not be written: {error}")))
    }

    /// Returns every plot of the page.
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

/// Returns the commands that wrote the folders, without repetitions.
fn commands(folders: &[Folder]) -> Vec<String> {
    let mut commands: Vec<String> = Vec::new();
    for command in folders.iter().map(|folder| super::environment::view(folder).command) {
        if !command.is_empty() && !commands.contains(&command) {
            commands.push(command);
        }
    }
    commands
}

fn device(place: usize, name: &str, runs: &[Run<'_>], paper: &Paper, pictures: &mut Pictures) -> Device {
    let claims = claims(paper.rows.clone(), runs, name);
    let own = runs.iter().flat_map(|run| &run.groups).filter(|group| group.device == name);
    let mut sizes: Vec<[u32; 2]> = own.map(|group| group.image_size).collect();
    sizes.sort_unstable();
    sizes.dedup();
    let count = |verdict| claims.iter().filter(|claim| claim.verdict == verdict).count();
    let suffix = if place == 0 { String::new() } else { format!("-{}", place + 1) };
    let figures = paper.figures.iter().cloned();
    Device {
        name: name.to_owned(),
        id: format!("device-{place}"),
        sizes: sizes.into_iter().map(by).collect::<Vec<_>>().join(", "),
        answer: answer::answer(runs, name, &suffix),
        tally: Verdict::ALL.map(|(verdict, word, ..)| (word, count(verdict))).to_vec(),
        figures: figures.map(|about| figures::figure(about, runs, name, &suffix, pictures)).collect(),
        claims,
    }
}
