//! The paper beside the measurement: its figures redrawn, its claims tested, its contradictions said.

use super::claims::{Claim, Verdict, claims};
use super::merged::merged;
use super::page::{SCRIPT, STYLE, nonce, notes};
use super::paper::{self, CURVES};
use super::plot::Plot;
use super::plot::chart::{Across, Chart, Mark, Series};
use super::plot::look::Look;
use super::plot::scale::Kind;
use super::words::{times, tip};
use crate::error::{Error, Result};
use crate::record::{Folder, Group, HOST, by, duration, groups, interval, median, not_enough};
use askama::Template;

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
    /// Names of the folders that have reports of their own, which lie beside the page.
    reports: Vec<String>,
}

/// What came of the reproduction on one device.
pub struct Device {
    name: String,
    id: String,
    sizes: String,
    tally: Vec<(&'static str, usize)>,
    figures: Vec<Figure>,
    claims: Vec<Claim>,
}

/// One of the paper's figures, twice: in milliseconds and as shapes.
pub struct Figure {
    number: u32,
    title: &'static str,
    times: Plot,
    shapes: Plot,
    rows: Vec<[String; 5]>,
}

const TITLES: [(u32, &str); 3] = [
    (6, "Figure 6: the naive kernel's time against block size, large scenes"),
    (7, "Figure 7: the same, small scenes"),
    (
        8,
        "Figure 8: naive, optimisation 1 (vectors in local memory), optimisation 2 (triangles in local memory)",
    ),
];

impl Reproduction {
    /// The page of these folders: the more of the paper's configs they hold, the more claims can be tested.
    pub fn of(folders: &[Folder]) -> Self {
        let records: Vec<_> = folders.iter().map(|folder| merged(std::slice::from_ref(folder))).collect();
        let runs: Vec<Vec<Group<'_>>> = records.iter().map(|records| groups(records)).collect();
        let mut names: Vec<&str> = Vec::new();
        for group in runs.iter().flatten().filter(|group| group.device != HOST) {
            if !names.contains(&group.device) {
                names.push(group.device);
            }
        }
        let mut commands: Vec<String> = Vec::new();
        for command in folders.iter().map(|folder| super::environment::view(folder).command) {
            if !command.is_empty() && !commands.contains(&command) {
                commands.push(command);
            }
        }
        let reports = folders.iter().filter(|folder| folder.path.join("report.html").is_file());
        Self {
            style: STYLE,
            script: SCRIPT,
            nonce: nonce(&records.concat()),
            version: env!("CARGO_PKG_VERSION"),
            devices: names.iter().enumerate().map(|(place, name)| device(place, name, &runs)).collect(),
            notes: notes(folders),
            commands,
            reports: reports.map(|folder| folder.label.clone()).collect(),
        }
    }

    /// The page as HTML.
    pub fn html(&self) -> Result<String> {
        self.render()
            .map_err(|error| Error::run(format!("the reproduction page could not be written: {error}")))
    }

    /// Every plot on it.
    pub fn plots(&self) -> Vec<&Plot> {
        let figures = self.devices.iter().flat_map(|device| &device.figures);
        figures.flat_map(|figure| [&figure.times, &figure.shapes]).collect()
    }
}

fn device(place: usize, name: &str, all: &[Vec<Group<'_>>]) -> Device {
    let is_own = |group: &&Group<'_>| group.device == name || group.device == HOST;
    let own: Vec<Vec<Group<'_>>> =
        all.iter().map(|run| run.iter().filter(is_own).cloned().collect()).collect();
    let claims = claims(&own, name);
    let mut sizes: Vec<String> =
        own.iter().flatten().filter(|group| group.device == name).map(|group| by(group.image_size)).collect();
    sizes.sort();
    sizes.dedup();
    let tally = Verdict::ALL
        .map(|(verdict, word)| (word, claims.iter().filter(|claim| claim.verdict == verdict).count()));
    let suffix = if place == 0 { String::new() } else { format!("-{}", place + 1) };
    Device {
        name: name.to_owned(),
        id: format!("device-{place}"),
        sizes: sizes.join(", "),
        tally: tally.to_vec(),
        figures: TITLES
            .into_iter()
            .filter_map(|(number, title)| figure(number, title, &own, name, &suffix))
            .collect(),
        claims,
    }
}

/// One of the paper's curves beside ours.
struct Curve<'a> {
    name: &'static str,
    number: usize,
    published: Vec<(u32, f64)>,
    ours: Vec<&'a crate::record::Record>,
}

fn curves<'a>(figure: u32, groups: &[Group<'a>], device: &str) -> Vec<Curve<'a>> {
    let of_figure = CURVES.iter().filter(|(of, ..)| *of == figure);
    of_figure
        .enumerate()
        .filter_map(|(number, (_, name, scene, preset))| {
            let (_, published) = paper::curve(scene, preset)?;
            let group = groups.iter().find(|group| group.scene == *scene && group.device == device);
            let records = group.map(|group| group.records.as_slice()).unwrap_or_default();
            let of_preset = records.iter().copied().filter(|record| record.preset.as_deref() == Some(preset));
            let square = of_preset.filter(|record| record.local_size.is_some_and(|[x, y]| x == y));
            let ours = square.filter(|record| median(record).is_some()).collect();
            Some(Curve { name, number, published, ours })
        })
        .collect()
}

fn figure(
    number: u32,
    title: &'static str,
    runs: &[Vec<Group<'_>>],
    device: &str,
    suffix: &str,
) -> Option<Figure> {
    let points = |curves: &Vec<Curve<'_>>| curves.iter().map(|curve| curve.ours.len()).sum::<usize>();
    // The run that has most of it: a curve is not put together of several.
    let curves = runs.iter().map(|groups| curves(number, groups, device)).max_by_key(points)?;
    if curves.iter().all(|curve| curve.ours.is_empty()) {
        return None;
    }
    let times = drawn(&curves, number, device, false);
    let shapes = drawn(&curves, number, device, true);
    Some(Figure {
        number,
        title,
        times: Plot {
            name: format!("figure-{number}{suffix}"),
            caption: "Ours, solid, on this device; the paper's, dashed, on its own unnamed one. Log scale.".into(),
            svg: times.svg(),
        },
        shapes: Plot {
            name: format!("figure-{number}-shapes{suffix}"),
            caption: "Each curve divided by its own least value: the shapes compare even though the devices do not. Points of fewer than five samples are left out.".into(),
            svg: shapes.svg(),
        },
        rows: curves.iter().flat_map(rows).collect(),
    })
}

/// The curves over block sizes: in milliseconds, or each over its least value.
fn drawn(curves: &[Curve<'_>], number: u32, device: &str, as_shapes: bool) -> Chart {
    let mut blocks: Vec<u32> = curves
        .iter()
        .flat_map(|curve| {
            let ours = curve.ours.iter().filter_map(|record| record.local_size.map(|size| size[0]));
            curve.published.iter().map(|(block, _)| *block).chain(ours)
        })
        .collect();
    blocks.sort_unstable();
    blocks.dedup();
    let place = |block: u32| blocks.iter().position(|known| *known == block).map(|place| place as f64);
    let series = curves.iter().flat_map(|curve| both(curve, &place, as_shapes)).collect();
    Chart {
        title: if as_shapes {
            format!("Figure {number} as shapes: {device}")
        } else {
            format!("Figure {number}: {device}")
        },
        x_label: "block size".into(),
        y_label: if as_shapes {
            "time, as a multiple of the curve's least".into()
        } else {
            "time, ms".into()
        },
        across: Across::Names(blocks.iter().map(|block| format!("{block}x{block}")).collect()),
        up: Kind::Log,
        diagonal: false,
        series,
    }
}

fn both(curve: &Curve<'_>, place: &dyn Fn(u32) -> Option<f64>, as_shapes: bool) -> Vec<Series> {
    let least = |values: &mut dyn Iterator<Item = f64>| {
        if as_shapes { values.fold(f64::INFINITY, f64::min) } else { 1.0 }
    };
    let theirs = least(&mut curve.published.iter().map(|(_, ms)| *ms));
    // A shape is made of ratios, which few samples have no part in.
    let ours = || curve.ours.iter().copied().filter(|record| !as_shapes || interval(record).is_some());
    let own = least(&mut ours().filter_map(median));
    let published = curve.published.iter().filter_map(|(block, ms)| {
        let tip = format!("{} at {block} x {block}\npublished {}", curve.name, duration(*ms));
        Some(Mark { x: place(*block)?, y: ms / theirs, interval: None, tip })
    });
    let ours = ours().filter_map(|record| {
        let interval = interval(record).map(|ends| ends.map(|end| end / own));
        Some(Mark { x: place(record.local_size?[0])?, y: median(record)? / own, interval, tip: tip(record) })
    });
    let series = |name: String, dashed, marks| Series {
        name,
        look: Look { number: curve.number, dashed },
        joined: true,
        marks,
    };
    let all = [
        series(format!("{}, ours", curve.name), false, ours.collect::<Vec<_>>()),
        series(format!("{}, paper", curve.name), true, published.collect()),
    ];
    all.into_iter().filter(|one| !one.marks.is_empty()).collect()
}

/// Curve, block, published, ours, ours over published.
fn rows(curve: &Curve<'_>) -> Vec<[String; 5]> {
    let ours = |block: u32| curve.ours.iter().find(|record| record.local_size == Some([block; 2]));
    let row = |(block, ms): &(u32, f64)| {
        let time = ours(*block).and_then(|record| median(record));
        let few = ours(*block).and_then(|record| not_enough(record));
        [
            curve.name.to_owned(),
            format!("{block} x {block}"),
            crate::record::ms(*ms),
            time.map_or("-".into(), crate::record::ms),
            few.or(time.map(|time| times(*ms, time))).unwrap_or("-".into()),
        ]
    };
    curve.published.iter().map(row).collect()
}
