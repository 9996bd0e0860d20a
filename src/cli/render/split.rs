//! `raycl render --devices`: renders one frame on several devices.

use super::casting::medians;
use super::judge::{check, verified};
use super::report::Verification;
use super::{Args, empty, last_notes, load, target};
use crate::cli::turn::hold;
use crate::clock::ms_since;
use crate::device::{Device, common_names, discover, select};
use crate::error::Result;
use crate::image::{check_alpha, check_target, save};
use crate::launch::{Casting, LeftOut, Share, Split, Whole};
use crate::program::Sources;
use crate::scene::{Loaded, Sampling, Scene};
use crate::strategy::{Task, preset_of, short_name};
use crate::words::counted;
use serde::Serialize;
use std::sync::Arc;
use std::time::Instant;

/// The report of `raycl render --devices`. With `--json`, raycl prints an object with these fields.
#[derive(Serialize)]
struct Report {
    scene: String,
    triangles: usize,
    /// The value of every axis of the strategy, if all devices use the same strategy; null otherwise.
    strategy: Option<String>,
    /// Local size, if all devices use the same local size; null otherwise.
    local_size: Option<[u32; 2]>,
    image_size: [u32; 2],
    /// Samples per pixel.
    samples: u32,
    /// The longest device time among the devices, which is the time of the whole frame: all devices cast their parts of
    /// the frame at the same time.
    frame_ms: f64,
    /// The longest upload time among the devices.
    upload_ms: f64,
    /// The longest time that a device takes to send its rows back.
    read_ms: f64,
    /// The number of primary and shadow rays of all samples, divided by the longest device time in seconds.
    frame_rays_per_s: f64,
    devices: Vec<Row>,
    /// Devices that were not used, because they could not be prepared, because they failed, because they would have
    /// slowed the frame down, or because the frame has too few rows.
    left_out: Vec<LeftOut>,
    /// Number of timed frames; the times of the frame and of its passes are medians over these frames.
    frames: u32,
    /// Time of the whole command.
    total_ms: f64,
    verified: Option<Verification>,
    output: String,
    /// Remarks for the user, for example about parts of the scene's file that were ignored or replaced by defaults, or
    /// about a raycl built from uncommitted sources.
    notes: Vec<String>,
}

/// The part of the frame that one device cast.
#[derive(Serialize)]
struct Row {
    device: String,
    /// The preset that equals the device's strategy; null if there is none.
    preset: Option<&'static str>,
    /// The value of every axis of the strategy.
    strategy: String,
    /// The nearest preset, and the values of the axes on which the strategy differs from it, for the table.
    #[serde(skip)]
    short_name: String,
    /// Work-items per work-group, across and down.
    local_size: [u32; 2],
    /// The device's pixel rows: the first row, and the row after the last.
    rows: [u32; 2],
    frame_ms: f64,
    primary_ms: Option<f64>,
    shadow_ms: Option<f64>,
    shade_ms: Option<f64>,
    build_ms: f64,
    upload_ms: f64,
    read_ms: f64,
}

impl From<Share> for Row {
    fn from(share: Share) -> Self {
        let times = medians(&share.frames);
        Self {
            device: share.device,
            preset: preset_of(&share.strategy),
            strategy: share.strategy.to_string(),
            short_name: short_name(&share.strategy),
            local_size: share.local_size,
            rows: share.rows,
            frame_ms: times.frame_ms,
            primary_ms: times.primary_ms,
            shadow_ms: times.shadow_ms,
            shade_ms: times.shade_ms,
            build_ms: share.build_ms,
            upload_ms: share.upload_ms,
            read_ms: share.read_ms,
        }
    }
}

/// Renders one picture on the devices that match `pattern`; each device casts a part of the picture. Some of the
/// devices may be left out ([`LeftOut`]).
pub(super) fn run(args: &Args, pattern: &str) -> Result<()> {
    let start = Instant::now();
    let target = target(args);
    check_target(&target, args.subject.size())?;
    // The strategy may have values that are files of `--cl-dir`. The files of `--cl-dir` must be known before
    // `load` checks the strategy.
    let sources = Sources::of(args.subject.cl_dir.clone())?;
    let Loaded { scene, notes, .. } = load(args)?;
    if scene.transparent {
        check_alpha(&target)?;
    }
    let scene = Arc::new(scene);
    let devices = select(&discover(&sources)?, &[pattern.to_owned()], &sources)?;
    let image_size = args.subject.size();
    let sampling = super::sampling(args, false);
    let castings = castings(args, &devices, args.subject.task(&scene, sampling.most))?;
    let Whole { image, hits, shares, left_out } = cast(args, &scene, &sources, sampling, &castings)?;
    save(&image, scene.display, &target)?;
    let (verified, wrong) = verified(&image, &target, args.verify, |some| {
        check(&scene, (&image, hits), (&castings[0].strategy, (sampling, None)), None, &target, some)
    });
    let rows: Vec<Row> = shares.into_iter().map(Row::from).collect();
    let longest = |of: fn(&Row) -> f64| rows.iter().map(of).fold(0.0, f64::max);
    let rays = rays(&scene, image_size, hits, sampling.most);
    let frame_ms = longest(|row| row.frame_ms);
    let all_notes = notes.into_iter().chain(empty(&scene, hits, wrong.is_some()));
    let all_notes = all_notes.chain(last_notes(args, &scene, sampling, verified.as_ref()));
    let report = Report {
        scene: scene.name.clone(),
        triangles: scene.mesh.triangles.len(),
        strategy: same(&rows, |row| row.strategy.clone()),
        local_size: same(&rows, |row| row.local_size),
        image_size,
        samples: sampling.most,
        frame_ms,
        upload_ms: longest(|row| row.upload_ms),
        read_ms: longest(|row| row.read_ms),
        frame_rays_per_s: rays / frame_ms * 1e3,
        devices: rows,
        left_out,
        frames: args.repeat,
        total_ms: ms_since(start),
        notes: all_notes.collect(),
        verified,
        output: target.path().display().to_string(),
    };
    tell(args, &report, target.is_standard_output())?;
    wrong.map_or(Ok(()), Err)
}

/// Casts the frame. If several frames are timed, this process locks the devices, so that no other process
/// measures on them meanwhile.
fn cast(
    args: &Args,
    scene: &Arc<Scene>,
    sources: &Sources,
    sampling: Sampling,
    castings: &[Casting],
) -> Result<Whole> {
    let split = Split {
        scene: Arc::clone(scene),
        image_size: args.subject.size(),
        sampling,
        sources,
        repeat: args.repeat,
        verifies: args.verify.is_some(),
        every_device: args.every_device,
    };
    let infos: Vec<_> = castings.iter().map(|casting| &casting.device.info).collect();
    let _held = (args.repeat > 1).then(|| hold(&infos, args.no_wait)).transpose()?;
    split.cast(castings)
}

/// Prints the report: with `--json` as JSON, otherwise as text, unless `--quiet` is given. The report goes to standard
/// error if the picture goes to standard output.
fn tell(args: &Args, report: &Report, streams: bool) -> Result<()> {
    super::super::print_report(report, || text(report), streams, (args.json, args.quiet))
}

/// Returns each device's strategy and local size: the strategy and local size with which the device would
/// cast the whole frame alone.
fn castings(args: &Args, devices: &[Device], task: Task) -> Result<Vec<Casting>> {
    let casting = |device: &Device| -> Result<Casting> {
        let (strategy, local_size) = args.subject.strategy(&device.info, task)?;
        Ok(Casting { device: device.clone(), strategy, local_size })
    };
    devices.iter().map(casting).collect()
}

/// Returns the value of `of` for the report's rows (one per device), if the value is the same in all rows.
fn same<T: PartialEq>(rows: &[Row], of: impl Fn(&Row) -> T) -> Option<T> {
    let mut all = rows.iter().map(of);
    let first = all.next()?;
    all.all(|other| other == first).then_some(first)
}

fn text(report: &Report) -> String {
    let header = ["device", "rows", "strategy", "build ms", "upload ms", "frame ms", "read ms"];
    let mut table = super::super::table(&header, 1);
    let ms = |value: f64| format!("{value:.2}");
    let all =
        report.devices.iter().map(|row| &row.device).chain(report.left_out.iter().map(|one| &one.device));
    let names = common_names(all.map(String::as_str));
    for row in &report.devices {
        let rows = format!("{} to {}", row.rows[0], row.rows[1].saturating_sub(1));
        let times = [row.build_ms, row.upload_ms, row.frame_ms, row.read_ms].map(ms);
        table.add_row(
            [names[row.device.as_str()].clone(), rows, row.short_name.clone()].into_iter().chain(times),
        );
    }
    let [width, height] = report.image_size;
    let mut lines = vec![format!("scene     {}: {}", report.scene, counted(report.triangles, "triangle"))];
    lines.extend(report.strategy.iter().map(|strategy| format!("strategy  {strategy}")));
    let samples =
        if report.samples > 1 { format!(", {} samples each", report.samples) } else { String::new() };
    lines.push(format!("size      {width} x {height} pixels{samples}\n{table}"));
    lines.push(format!(
        "longest   on any device: frame {:.2} ms (median of {}), upload {:.2} ms, read {:.2} ms",
        report.frame_ms, report.frames, report.upload_ms, report.read_ms
    ));
    lines.extend(
        report
            .left_out
            .iter()
            .map(|LeftOut { device, reason }| format!("left out  {}: {reason}", names[device.as_str()])),
    );
    lines.extend(report.verified.iter().map(Verification::text));
    lines.extend(report.notes.iter().map(|note| format!("note      {note}")));
    lines.push(format!("picture   {}", report.output));
    lines.join("\n")
}

/// Returns the number of primary and shadow rays of a frame with `samples` samples per pixel. `hits` is the number of
/// pixels in which at least one primary ray hits a triangle. The function assumes that in each of these pixels, all
/// primary rays hit a triangle.
fn rays(scene: &Scene, image_size: [u32; 2], hits: usize, samples: u32) -> f64 {
    let [width, height] = image_size.map(f64::from);
    let shadow_rays = hits * scene.shadow_rays_per_hit();
    (width * height + shadow_rays as f64) * f64::from(samples)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::cli::render::report::Verified;
    use crate::launch::FrameTimes;
    use crate::reference::fixtures;
    use crate::strategy::preset;
    use clap::Parser;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    fn share(device: &str, rows: [u32; 2]) -> Share {
        let times = FrameTimes {
            primary_ms: Some(1.0),
            shadow_ms: Some(2.0),
            shade_ms: Some(3.0),
            ..FrameTimes::whole(6.0, 7.0)
        };
        Share {
            device: device.to_owned(),
            strategy: preset("deferred").unwrap().strategy,
            local_size: [8, 4],
            rows,
            build_ms: 10.0,
            upload_ms: 11.0,
            frames: vec![times],
            read_ms: 12.0,
        }
    }

    #[test]
    fn the_users_kernels_are_read_before_the_scene() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("a.png").display().to_string();
        let words = ["render", "no/scene.toml", "--devices", "all", "--cl-dir", "no/kernels", "-o", &out];
        let error = run(&Command::parse_from(words).args, "all").unwrap_err().to_string();
        assert!(error.contains("no/kernels"), "{error}");
    }

    #[test]
    fn each_sample_has_its_primary_and_shadow_rays() {
        let mut scene = fixtures::single_triangle();
        assert_eq!(rays(&scene, [4, 3], 10, 2), 44.0);
        // With three lights in the scene, each hit has three shadow rays.
        scene.lights = vec![scene.lights[0]; 3];
        assert_eq!(rays(&scene, [4, 3], 10, 2), 84.0);
    }

    #[test]
    fn a_row_has_the_times_of_its_share() {
        let row = Row::from(share("one", [3, 9]));
        assert_eq!((row.device.as_str(), row.preset, row.rows), ("one", Some("deferred"), [3, 9]));
        assert_eq!((row.local_size, row.frame_ms), ([8, 4], 6.0));
        assert_eq!([row.primary_ms, row.shadow_ms, row.shade_ms], [1.0, 2.0, 3.0].map(Some));
        assert_eq!([row.build_ms, row.upload_ms, row.read_ms], [10.0, 11.0, 12.0]);
    }

    #[test]
    fn a_value_is_printed_once_only_if_all_devices_have_it() {
        let of = |sizes: &[[u32; 2]]| {
            let row = |&local_size: &[u32; 2]| Row::from(Share { local_size, ..share("one", [0, 1]) });
            same(&sizes.iter().map(row).collect::<Vec<_>>(), |row| row.local_size)
        };
        assert_eq!([of(&[[8, 8]; 3]), of(&[[8, 8], [4, 4], [8, 8]]), of(&[])], [Some([8, 8]), None, None]);
    }

    #[test]
    fn the_text_names_each_device_with_its_rows_and_times() {
        let report = Report {
            scene: "little".to_owned(),
            triangles: 5,
            strategy: None,
            local_size: None,
            image_size: [16, 9],
            samples: 4,
            frame_ms: 1.0,
            upload_ms: 2.0,
            read_ms: 3.0,
            frame_rays_per_s: 4.0,
            devices: vec![Row::from(share("one", [0, 3])), Row::from(share("two", [3, 9]))],
            left_out: vec![LeftOut { device: "slow".to_owned(), reason: "it is slow".to_owned() }],
            frames: 7,
            total_ms: 5.0,
            verified: Some(Verification::Right(Verified {
                max_difference: Some(0.0),
                pixels: 9,
                of_pixels: 9,
                ..Verified::default()
            })),
            output: "a.png".to_owned(),
            notes: vec!["a remark".to_owned()],
        };
        let text = text(&report).replace(['│', '┆'], " ");
        let words: Vec<Vec<&str>> = text.lines().map(|line| line.split_whitespace().collect()).collect();
        for line in [
            "scene little: 5 triangles",
            "size 16 x 9 pixels, 4 samples each",
            "device rows strategy build ms upload ms frame ms read ms",
            "one 0 to 2 deferred 10.00 11.00 6.00 12.00",
            "two 3 to 8 deferred 10.00 11.00 6.00 12.00",
            "longest on any device: frame 1.00 ms (median of 7), upload 2.00 ms, read 3.00 ms",
            "left out slow: it is slow",
            "verified against the reference picture: largest relative difference 0.0e0, 0 pixels uncertain",
            "note a remark",
            "picture a.png",
        ] {
            let expected: Vec<&str> = line.split_whitespace().collect();
            assert!(words.contains(&expected), "{line}: {text}");
        }
        assert!(!text.contains("\nstrategy"), "{text}");
    }
}
