//! Collects, from records, the data that the page of `raycl report` shows.

use super::answer::{Answer, answers, headline, is_shown};
use super::common_names::{name_of_driver, with_common_names};
use super::environment::{self, EnvironmentView, Program};
use super::gallery::{self, Pictures};
use super::merged::{Origins, labels, merged};
use super::plot::Plot;
use super::plot::scale::Kind;
use super::words::{Looks, first_line, group_title, interval_text, series_name, size_name};
use super::{growth, microscope, occupancy, one_change, overview, roofline, side_by_side, view};
use crate::error::{Error, Result};
use crate::numbers::{by, ms, significant};
use crate::record::{
    AtHost, BUILT_IN, Folder, Group, HOST, Outcome, Record, apart_note, controls, file_names, groups,
    interval, is_shown_as, median, not_enough, percent, ratio, to_mind, two_modes,
};
use askama::Template;
use serde_json::Value;
use std::hash::{BuildHasher as _, Hasher as _, RandomState};

/// The style sheet of every page.
pub const STYLE: &str = include_str!("templates/page.css");
/// The JavaScript of every page. Pages can also be read without JavaScript.
pub const SCRIPT: &str = include_str!("templates/page.js");

/// The data of the page of `raycl report`.
#[derive(Template)]
#[template(path = "report.html")]
pub struct Page {
    style: &'static str,
    script: &'static str,
    nonce: String,
    title: String,
    questions: Vec<(String, String)>,
    headline: String,
    notes: Vec<String>,
    counts: Vec<(String, String)>,
    answers: Vec<(Answer, Option<String>)>,
    overview: Vec<Plot>,
    changes: Vec<one_change::Table>,
    views: Vec<View>,
    gallery: Vec<gallery::Scene>,
    hosts: Vec<HostRow>,
    environments: Vec<EnvironmentView>,
    programs: Vec<Program>,
    version: &'static str,
}

/// The plots and the table of one group of points (one scene at one image size on one device).
pub struct View {
    id: String,
    /// True for the view that a browser shows when it opens the page: the view of a group whose scene has the most
    /// triangles.
    first: bool,
    title: String,
    /// Notes that raycl made when it read the group's scene.
    notes: Vec<String>,
    heat: Option<Plot>,
    lines: Option<[Plot; 2]>,
    others: Vec<Plot>,
    rows: Vec<Row>,
    /// The command (`raycl compile`) that shows the instructions of the fastest point. The command is empty if
    /// no point has a rank (enough samples, none of which is 0), if the report is on several folders, or if
    /// `raycl compile` cannot show the point (see [`microscope::command`]).
    microscope: String,
}

/// A point's row in the table of a group.
pub struct Row {
    name: String,
    strategy: String,
    size: String,
    items: u32,
    median: String,
    two_modes: bool,
    interval: String,
    n: usize,
    slower: String,
    frame_rays: String,
    primary_rays: String,
    tests: String,
    made: String,
    peak: String,
    outcome: &'static str,
    why: String,
    wins: bool,
}

/// A row of the table of hosts: the time of a control point on one host. (Every block of a group measures the group's
/// control point, so that points of different blocks can be compared.)
pub struct HostRow {
    point: String,
    host: String,
    blocks: usize,
    median: String,
    interval: String,
    slower: String,
    differs: bool,
}

impl Page {
    /// Collects the data of the page from the folders' records.
    pub fn of(folders: &[Folder]) -> Self {
        let (folders, drivers) = with_common_names(folders);
        let folders = &folders[..];
        let records = merged(folders);
        let groups = groups(&records);
        let looks = Looks::of(&groups);
        let (mut pictures, origins) = (Pictures::default(), Origins::of(folders));
        let answers = answers(&groups, &origins);
        let headline = headline(&answers);
        let shown = groups.iter().filter(|group| is_shown(group, &groups));
        let thumbnails = shown.map(|group| thumbnail(group, &mut pictures, &origins));
        let answers: Vec<_> = answers.into_iter().zip(thumbnails).collect();
        let mut overview = overview::scenes(&groups, &looks, &origins);
        let (pairs, left_out) = overview::device_against_device(&groups, &looks);
        overview.extend(pairs);
        overview.extend(side_by_side::side_by_side(&groups));
        overview.extend(growth::growth(&groups, &looks));
        overview.extend(roofline::rooflines(&groups, &looks, folders, &drivers));
        Self {
            style: STYLE,
            script: SCRIPT,
            nonce: nonce(),
            title: folders.iter().map(|folder| folder.label.as_str()).collect::<Vec<_>>().join(", "),
            questions: questions(folders),
            headline,
            notes: all_notes(folders, &origins, &records).into_iter().chain(left_out).collect(),
            counts: counts(&records, &groups),
            answers,
            overview,
            changes: one_change::tables(&records, &groups),
            views: views(&groups, &looks, folders, &origins),
            gallery: pictures.gallery(&records, &origins),
            hosts: folders.iter().flat_map(hosts).collect(),
            environments: folders.iter().map(environment::view).collect(),
            programs: environment::programs(&records),
            version: env!("CARGO_PKG_VERSION"),
        }
    }

    /// Returns the page as HTML.
    pub fn html(&self) -> Result<String> {
        self.render().map_err(|error| Error::fault(format!("the report could not be written: {error}")))
    }

    /// Returns all plots of the page.
    pub fn plots(&self) -> Vec<&Plot> {
        let views = self
            .views
            .iter()
            .flat_map(|view| view.heat.iter().chain(view.lines.iter().flatten()).chain(&view.others));
        self.overview.iter().chain(views).collect()
    }
}

/// Returns a small version of the picture that a group's fastest point cast. Returns `None` if no point of
/// the group has a rank (enough samples, none of which is 0), or if the picture is missing.
fn thumbnail(group: &Group<'_>, pictures: &mut Pictures, origins: &Origins<'_>) -> Option<String> {
    let best = group.ranking().winners.first().copied()?;
    pictures.thumbnail(origins.folder(best)?, best.image.as_deref()?)
}

/// Returns a nonce, which is a random number of 128 bits. The browser runs only those scripts of the page
/// that state this nonce. Scripts in texts of the page, such as scene names, do not run, because nobody can
/// predict the nonce: the standard library derives the nonce from the system's random numbers.
pub fn nonce() -> String {
    let random = || RandomState::new().build_hasher().finish();
    format!("{:016x}{:016x}", random(), random())
}

/// Returns the notes of the folders for which `shows` returns true. If `folders` has several elements, each
/// note begins with the label of its folder.
pub fn notes(folders: &[Folder], shows: impl Fn(&Folder) -> bool) -> Vec<String> {
    let of = |(folder, label): (&Folder, String)| -> Vec<String> {
        let said = |note: &String| if folders.len() == 1 { note.clone() } else { format!("{label}: {note}") };
        folder.notes.iter().map(said).collect()
    };
    folders.iter().zip(labels(folders)).filter(|(folder, _)| shows(folder)).flat_map(of).collect()
}

/// Returns the notes of the folders whose records the page shows, and of the folders without records. If `folders` has
/// several elements, also returns a note on the points that more than one folder measured, and a note on the points
/// that were not measured together. `records` contains the merged records.
fn all_notes(folders: &[Folder], origins: &Origins<'_>, records: &[Record]) -> Vec<String> {
    let own = notes(folders, |folder| origins.shows(folder));
    let of_all = origins.left_out().into_iter().chain(apart_note(records));
    own.into_iter().chain(of_all.filter(|_| folders.len() > 1)).collect()
}

/// Returns the questions and expected answers of the folders' configs, without repetitions.
fn questions(folders: &[Folder]) -> Vec<(String, String)> {
    let mut questions = Vec::new();
    for folder in folders {
        let pair = folder.question();
        if !questions.contains(&pair) {
            questions.push(pair);
        }
    }
    questions
}

/// Returns a row for each control point of a folder and each machine that measured this control point.
fn hosts(folder: &Folder) -> Vec<HostRow> {
    let controls = controls(&folder.records, &folder.controls);
    controls.iter().flat_map(|control| control.hosts.iter().map(|at| host_row(&control.point, at))).collect()
}

fn host_row(point: &str, at: &AtHost) -> HostRow {
    HostRow {
        point: point.to_owned(),
        host: at.host.clone(),
        blocks: at.blocks,
        median: ms(at.median_ms),
        interval: at.interval_ms.map(interval_text).unwrap_or_default(),
        slower: at.slower.map_or(String::new(), |ratio| {
            let [middle, low, high] = ratio.map(|times| significant(times, 3));
            format!("{middle}× ({low} to {high})")
        }),
        differs: at.differs(),
    }
}

fn counts(records: &[Record], groups: &[Group<'_>]) -> Vec<(String, String)> {
    let count = |wanted: &dyn Fn(&Record) -> bool| records.iter().filter(|record| wanted(record)).count();
    let measured = count(&|record| record.outcome == Outcome::Measured);
    let infeasible = count(&|record| record.outcome == Outcome::Infeasible);
    let other_kind = count(&|record| record.outcome == Outcome::OtherKind);
    let failed = records.len() - measured - infeasible - other_kind;
    let samples: usize = records.iter().map(|record| record.samples_ms.len()).sum();
    let different = |of: fn(&Group<'_>) -> String| {
        let mut all: Vec<_> = groups.iter().filter(|group| is_shown(group, groups)).map(of).collect();
        all.sort();
        all.dedup();
        all.len()
    };
    let facts = [
        (different(|group| group.scene.to_owned()), "scene", "scenes"),
        (different(|group| group.device.to_owned()), "device", "devices"),
        (records.len(), "point", "points"),
        (samples, "sample", "samples"),
        (
            infeasible,
            "point does not suit the device or the scene",
            "points do not suit the device or the scene",
        ),
        (
            other_kind,
            "point is meant for another kind of device",
            "points are meant for another kind of device",
        ),
        (failed, "point failed", "points failed"),
    ];
    let named = facts.map(|(n, one, many)| (n.to_string(), if n == 1 { one } else { many }.to_owned()));
    let always = |index: usize| index < 4;
    let shown = named.into_iter().enumerate().filter(|(index, (n, _))| always(*index) || n != "0");
    shown.map(|(_, fact)| fact).collect()
}

fn views(groups: &[Group<'_>], looks: &Looks, folders: &[Folder], origins: &Origins<'_>) -> Vec<View> {
    let files = file_names(groups);
    let shown = groups.iter().zip(&files).filter(|(group, _)| is_shown(group, groups));
    let mut views: Vec<View> = shown
        .clone()
        .enumerate()
        .map(|(index, (group, file))| {
            let baselines = origins.baselines(group, groups);
            one_view(index, group, file, &baselines, looks, folders)
        })
        .collect();
    let triangles = |group: &Group<'_>| group.records.iter().filter_map(|record| record.triangles).max();
    let largest = shown.enumerate().max_by_key(|(_, (group, _))| triangles(group)).map(|(index, _)| index);
    if let Some(view) = largest.and_then(|index| views.get_mut(index)) {
        view.first = true;
    }
    views
}

/// Returns the plots and the table of one group. `file` identifies the group in the names of the plots, such as
/// `samples-{file}`. The baselines come last in the table. The view's field `first` is false.
fn one_view(
    index: usize,
    group: &Group<'_>,
    file: &str,
    baselines: &[&Record],
    looks: &Looks,
    folders: &[Folder],
) -> View {
    let file = |what: &str| format!("{what}-{file}");
    let lines = |kind, what: &str| view::lines(group, looks, kind, &file(what), true);
    let mut others = Vec::new();
    others.extend(view::strip(group, &file("samples")));
    let capability = compute_capability(folders, group.device);
    others.extend(occupancy::plot(group, looks, capability.as_deref(), &file("occupancy")));
    let ranking = group.ranking();
    let best = ranking.winners.first().copied();
    let failed = group.failures().into_iter().map(|(record, _)| record);
    let kernels = ranking.all().into_iter().chain(failed);
    let wins = |record: &Record| ranking.winners.iter().any(|winner| winner.key == record.key);
    let rows = kernels.map(|record| row(record, best, wins(record)));
    let host = baselines.iter().map(|record| row(record, best, false));
    View {
        id: format!("view-{index}"),
        first: false,
        title: group_title(group),
        notes: scene_notes(group),
        // Baselines have no local sizes, which are the columns of the heat map.
        heat: (group.device != HOST).then(|| view::heat(group, &file("heat"))),
        lines: lines(Kind::Log, "local-size-log")
            .zip(lines(Kind::Linear, "local-size-linear"))
            .map(|(a, b)| [a, b]),
        others,
        rows: rows.chain(host).collect(),
        // In a report on several folders, a device's name in a record may end with the name of a folder. A
        // name with a folder's name at its end would not select a device, so a report on several folders does
        // not show the command.
        microscope: best
            .filter(|_| folders.len() == 1)
            .and_then(|best| command(folders, best))
            .unwrap_or_default(),
    }
}

/// Returns the notes that raycl made when it read a group's scene, without repetitions.
fn scene_notes(group: &Group<'_>) -> Vec<String> {
    let mut notes: Vec<String> = Vec::new();
    for note in group.records.iter().flat_map(|record| &record.scene_notes) {
        if !notes.contains(note) {
            notes.push(note.clone());
        }
    }
    notes
}

/// Returns the compute capability of an NVIDIA device; `None` if no folder's environment contains it.
fn compute_capability(folders: &[Folder], device: &str) -> Option<String> {
    entries(folders, device).find_map(|entry| entry["compute_capability"].as_str().map(str::to_owned))
}

/// Returns the command (`raycl compile`) that writes a page with a point's instructions. In the record, the
/// device's name may be the common name, or end with a text in brackets. The command contains the name that
/// the driver reports for the device. Returns `None` if [`microscope::command`] returns `None`, or if it is unknown
/// which of several folders contains the point's kernels.
fn command(folders: &[Folder], record: &Record) -> Option<String> {
    let name = entries(folders, &record.device).find_map(name_of_driver);
    let mut kernels = kernels_on(folders, &record.device);
    kernels.sort_unstable();
    kernels.dedup();
    let cl_dir = match kernels[..] {
        [] | [BUILT_IN] => None,
        [folder] => Some(folder),
        _ => return None,
    };
    microscope::command(record, name.unwrap_or(&record.device), cl_dir)
}

/// Returns where the kernels of the runs on a device come from: paths of folders, or [`BUILT_IN`]. `shown` is the
/// device's name in the records.
fn kernels_on<'a>(folders: &'a [Folder], shown: &str) -> Vec<&'a str> {
    let own = folders.iter().filter(|folder| entries(std::slice::from_ref(*folder), shown).next().is_some());
    let sources = own.filter_map(|folder| folder.environment["sources"].as_array()).flatten();
    let kernels = sources.filter(|source| source["what"] == "kernels");
    kernels.filter_map(|source| source["path"].as_str()).collect()
}

/// Returns the descriptions of a device in the `environment.json` of the folders. `shown` is the device's
/// name in the records.
fn entries<'a>(folders: &'a [Folder], shown: &'a str) -> impl Iterator<Item = &'a Value> {
    let devices = folders.iter().filter_map(|folder| folder.environment["devices"].as_array()).flatten();
    devices.filter(move |entry| entry["device"].as_str().is_some_and(|name| is_shown_as(name, shown)))
}

fn row(record: &Record, best: Option<&Record>, wins: bool) -> Row {
    let time = median(record);
    let number = |value: Option<f64>, text: &dyn Fn(f64) -> String| {
        value.filter(|_| time.is_some()).map_or(String::new(), text)
    };
    Row {
        name: series_name(record),
        strategy: record.strategy.clone(),
        size: size_name(record),
        items: record.local_size.map_or(0, |[across, down]| across * down),
        median: number(time, &ms),
        two_modes: two_modes(record).is_some(),
        interval: interval(record).map(interval_text).or(not_enough(record)).unwrap_or_default(),
        n: record.samples_ms.len(),
        slower: best
            .and_then(|best| ratio(record, best))
            .map_or(String::new(), |ratio| format!("{}×", significant(ratio.middle, 3))),
        frame_rays: number(record.frame_rays_per_s(), &|rays| significant(rays / 1e6, 3)),
        primary_rays: number(record.primary_rays_per_s(), &|rays| significant(rays / 1e6, 3)),
        tests: number(record.tests_per_s, &|tests| significant(tests / 1e9, 3)),
        outcome: record.outcome.name(),
        made: super::words::made(record).unwrap_or_default(),
        peak: number(record.limit_fraction, &percent),
        why: match time {
            Some(_) => to_mind(record).unwrap_or_default(),
            None => first_line(record).to_owned(),
        },
        wins,
    }
}

impl Answer {
    /// Returns the image size as text, such as "800 x 500".
    pub fn size(&self) -> String {
        by(self.image_size)
    }
}

#[cfg(test)]
mod tests;
