//! `raycl merge`: merges the shards of an experiment into one folder of results.

use super::measured::failures;
use crate::error::{Error, Result};
use crate::output::{Choice, OutFolder};
use crate::record::journals::{RECORDS, SUMMARY};
use crate::record::{Folder, Outcome, Record, refuse_closed, renew_intervals, summary_terminal};
use crate::report;
use crate::shard::{Merged, Missing, MissingKind, ShardPlan, Status, merge, no_shards, status};
use crate::words::{counted, counted_are};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Arguments of `raycl merge`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl merge /shared/figure-8
  raycl merge /shared/figure-8 --status
  raycl merge /shared/figure-8 --device h200

Merging needs no device. The exit code is 0 if no point is missing and none has failed. It is 1 if a point is missing or has failed, or if the merge itself fails. It is 2 for a mistake in the arguments or files. A point that does not fit on its device, or that is meant for another kind of device, has not failed. With --status, the exit code is 0 even if points are missing or have failed.")]
pub struct Args {
    /// The folder that `raycl run --shard` wrote: the value of its option --out
    #[arg(value_name = "OUT")]
    out: PathBuf,
    /// Merge only the results of the devices that match NAME. NAME is a kind (cpu, gpu, accelerator), all, or a part of
    /// a device's description. The description contains the device's name, both as the driver states it and as raycl's
    /// tables show it, the platform, the driver and other properties that affect times. If NAME is a number, it matches
    /// only if the description contains this whole number: 1 does not match H100. Results of the baselines (ray casters
    /// on the host) are always merged; if NAME is host, raycl merges only these results. If no NAME is host, and no
    /// NAME matches a device on which a shard has begun, raycl merges nothing. If some NAMEs match such a device, and a
    /// NAME other than host does not, raycl reports all points except the baselines as missing for the NAME that
    /// matches no device. Not with --status [default: all devices on which a shard has begun]
    #[arg(long, value_name = "NAME", conflicts_with = "status")]
    device: Vec<String>,
    /// Merge nothing; print the state of each process that was started to measure a shard. A process in the state
    /// `begun` has just started; if it stays in this state, it was probably killed when it started. A process in the
    /// state `going` is measuring, or waits for a device. A process in the state `hung` has made no progress within the
    /// limit of `raycl run --hang-limit`. A process in the state `lost` no longer increases its counter; probably, the
    /// process was killed or its machine failed. A process in the state `launcher lost` has ended because the program
    /// that started the process has ended. The other states are `done`, `interrupted` and `failed`
    #[arg(long)]
    status: bool,
    /// With --status, the time in seconds (2 to 3600) between two readings of the processes' counters. Each running
    /// process increases its counter once per second. If a counter stays the same, the state of its process is `lost`,
    /// unless the process has reported its end. A network file system may show old data for some time; choose SECONDS
    /// longer than this time
    #[arg(long, value_name = "SECONDS", default_value_t = 3.0, requires = "status", conflicts_with_all = ["device", "quiet"], value_parser = seconds)]
    between: f64,
    /// Print one JSON object per point instead of tables; with --status, one object per process
    #[arg(long)]
    json: bool,
    /// Print nothing but errors. Not with --json or --status
    #[arg(short, long, conflicts_with_all = ["json", "status"])]
    quiet: bool,
}

/// Parses the number of seconds between two readings of the processes' counters. Each running process increases its
/// counter once per second. On a busy machine, a process may increase its counter late, so the counter of a running
/// process may stay the same for almost 2 s. Therefore this function refuses a time of less than 2 s between two
/// readings of the counters, and also a time of more than 3600 s.
fn seconds(text: &str) -> std::result::Result<f64, String> {
    let wrong = || format!("'{text}' is not a number of seconds from 2 to 3600");
    text.parse().ok().filter(|seconds| (2.0..=3600.0).contains(seconds)).ok_or_else(wrong)
}

/// Merges the results that the shards have written so far, and writes the summary and the report of the merged folder.
/// Returns an error if points are missing or have failed. With `--status`, only prints the state of each attempt.
pub fn run(args: Args) -> Result<()> {
    if args.status {
        return tell(&args);
    }
    if args.out.is_dir() {
        refuse_closed(&args.out, "merge as a user who may write to this folder, or merge a copy of it")?;
    }
    let (merged, folder) = merged(&args.out, &args.device)?;
    let (question, expectation) = folder.question();
    folder.summarise(&question, &expectation)?;
    let mut out = OutFolder::open(&args.out, Choice::without_force("another OUT"))?;
    let written = report::write(std::slice::from_ref(&folder), &mut out)?;
    if args.json {
        folder.records.iter().try_for_each(super::print_json)?;
    } else if !args.quiet {
        print(&folder, &merged, &written.page)?;
    }
    complete(&merged.missing, &folder.records, &args.out)
}

/// Merges the attempts in the folder `out`, and reads the merged folder. A point's 95% interval depends on
/// the samples of all launches, but a process that measured a shard had only the samples of its own launches.
/// Therefore this function computes the points' intervals again, from the merged samples.
fn merged(out: &Path, devices: &[String]) -> Result<(Merged, Folder)> {
    let merged = merge(out, devices)?;
    let folder = Folder::read(out)?;
    renew_intervals(&out.join(RECORDS), &folder.records)?;
    Ok((merged, folder))
}

fn print(folder: &Folder, merged: &Merged, page: &Path) -> Result<()> {
    super::print_coloured(&summary_terminal(&folder.records, super::colour::on_output()))?;
    folder.notes.iter().try_for_each(|note| super::print(format!("note: {note}")))?;
    super::print(format!("Merged:   {}", counts(merged)))?;
    super::print(format!("Report:   {}", page.display()))
}

/// Returns a text with the numbers of attempts, points and samples. If groups of points were divided among shards, the
/// text also has the number of additional samples of control points. (Several shards measured the same control points,
/// so that the other points of these shards can be compared.)
fn counts(merged: &Merged) -> String {
    let [used, of_controls, others] = merged.samples;
    let of_controls = match of_controls {
        0 => String::new(),
        count => format!(", {}", counted(count, "more sample of control points")),
    };
    format!(
        "{}, {}, {}{of_controls}; {} not used",
        counted(merged.attempts, "attempt"),
        counted(merged.records, "point"),
        counted(used, "sample"),
        counted(others, "sample")
    )
}

/// Returns an error if no shard has begun, or if points of the experiment are missing or have failed. The error's help
/// names the commands that measure the missing and the failed points.
fn complete(missing: &Missing, records: &[Record], out: &Path) -> Result<()> {
    if missing.nothing_began {
        return Err(Error::run("no shard has begun to measure")
            .with_help("start the shards: raycl run CONFIG --shard 1/N --out OUT"));
    }
    let (mut said, mut help) = (Vec::new(), Vec::new());
    if !missing.is_empty() {
        said.push(format!("{} missing", counted_are(missing.count(), "point")));
        help.push("these commands measure the missing points".to_owned());
        help.extend(missing.kinds.iter().map(command_text));
        help.extend(missing.took_part.iter().map(|names| format!("devices with results: {names}")));
    }
    if let Some(failed) = failures(records) {
        said.push(failed);
        let summary = out.join(SUMMARY);
        help.push(format!("{} gives the reason for each point that failed", summary.display()));
    }
    if !missing.failed.is_empty() {
        help.push("these commands measure the failed points again".to_owned());
        help.extend(missing.failed.iter().map(command_text));
    }
    if records.iter().any(|record| record.outcome == Outcome::WrongImage) {
        let remedy = "a point keeps its wrong image even if another attempt measures the point again; to discard the image, move the folder of the attempt that cast the image out of parts/";
        help.push(remedy.to_owned());
    }
    match said.is_empty() {
        true => Ok(()),
        false => Err(Error::run(said.join("; ")).with_help(help.join("\n"))),
    }
}

/// Returns a text about the missing or failed points of a kind of device: how many there are, the first three
/// of them, and the command that measures them.
fn command_text(kind: &MissingKind) -> String {
    let first = kind.points.iter().take(3).cloned().collect::<Vec<_>>().join(", ");
    let shards = kind.shards.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
    let more = if kind.points.len() > 3 { ", ..." } else { "" };
    format!(
        "{}: {} of {} points ({first}{more}), in shard{} {shards}:\n  {}",
        kind.device,
        kind.points.len(),
        kind.of,
        if kind.shards.len() == 1 { "" } else { "s" },
        kind.command
    )
}

/// Prints the state of each attempt, that is, of each process that was started to measure a shard.
fn tell(args: &Args) -> Result<()> {
    let Some(plan) = ShardPlan::read(&args.out)? else {
        return Err(no_shards(&args.out));
    };
    let all = status(&args.out, Duration::from_secs_f64(args.between))?;
    if args.json {
        return all.iter().try_for_each(|one| super::print_json(&json(one)));
    }
    let mut table = super::table(&["attempt", "state", "steps"], 2);
    for one in &all {
        table.add_row([one.name.clone(), one.state.to_string(), one.beat.steps.to_string()]);
    }
    super::print(table)?;
    let (attempts, shards) = (counted(all.len(), "attempt"), counted(plan.header.shards as usize, "shard"));
    super::print(format!("{attempts} at {shards}"))
}

/// Returns an attempt's state as an object for JSON.
fn json(one: &Status) -> serde_json::Value {
    serde_json::json!({
        "attempt": one.name, "state": one.state.to_string(), "steps": one.beat.steps, "beats": one.beat.beats,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shard::{Beat, State};

    #[test]
    fn an_attempt_in_json_has_its_name_its_state_and_its_counters() {
        let beat = Beat { steps: 5, beats: 7, ..Beat::default() };
        let one = Status { name: "1-of-2".into(), state: State::Hung(9), beat };
        let expected = serde_json::json!({
            "attempt": "1-of-2",
            "state": "hung: for 9 s, no build, check or frame has begun, and no launch or point has ended",
            "steps": 5,
            "beats": 7,
        });
        assert_eq!(json(&one), expected);
    }

    /// In this test, the process that measured the point stored an interval that does not follow from the
    /// merged samples.
    #[test]
    fn merged_records_have_the_intervals_that_follow_from_all_samples() {
        use crate::record::{JsonLines, PlannedPoint, interval, read_lines};
        use crate::shard::{About, Attempt, Header, Kind, KindPoint};
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        let header = Header { shards: 1, ..Header::default() };
        let plan = ShardPlan { header: header.clone(), ..ShardPlan::default() };
        ShardPlan::open(out, &header, || Ok(plan)).unwrap();
        let planned = PlannedPoint { key: "k".into(), device: "gpu".into(), ..PlannedPoint::default() };
        let points = vec![KindPoint { point: 0, planned }];
        let kind = Kind { device: "gpu".into(), identity: "x".into(), points, ..Kind::default() };
        kind.write(&Kind::file(out, "gpu", "x")).unwrap();
        let about = About { shard: 1, of: 1, host: "n1".into(), ..About::default() };
        let attempt = Attempt::begin(out, &about).unwrap();
        let stored = Some([0.5, 2.0]);
        let record = Record {
            key: "k".into(),
            device: "gpu".into(),
            outcome: Outcome::Measured,
            samples_ms: vec![1.0, 1.0],
            sample_launches: vec![0, 0],
            interval_ms: stored,
            ..Record::default()
        };
        JsonLines::append_to(&attempt.folder.join(RECORDS)).unwrap().append(&record).unwrap();
        let (merged, folder) = merged(out, &[]).unwrap();
        let expected = interval(&folder.records[0]);
        assert!(merged.records == 1 && expected != stored, "{expected:?}");
        let records = read_lines::<Record>(&out.join(RECORDS)).unwrap().lines;
        assert_eq!(records.iter().map(|record| record.interval_ms).collect::<Vec<_>>(), [expected]);
    }

    #[test]
    fn samples_of_controls_are_counted_apart_from_those_that_are_not_used() {
        let of = |samples| counts(&Merged { attempts: 3, records: 12, samples, ..Merged::default() });
        let expected =
            "3 attempts, 12 points, 120 samples, 10 more samples of control points; 0 samples not used";
        assert_eq!(of([120, 10, 0]), expected);
        assert_eq!(of([120, 0, 1]), "3 attempts, 12 points, 120 samples; 1 sample not used");
    }

    fn refused(missing: &Missing, records: &[Record]) -> (String, String) {
        let error = complete(missing, records, Path::new("out")).expect_err("it is not complete");
        assert_eq!(error.exit_code(), 1);
        (error.to_string(), error.remedy().to_owned())
    }

    #[test]
    fn missing_points_are_counted_for_each_device_with_their_shards_and_the_command_that_measures_them() {
        let kind = |device: &str, points: &[&str], shards: &[u32]| MissingKind {
            device: device.into(),
            points: points.iter().map(|point| (*point).to_owned()).collect(),
            of: 9,
            shards: shards.to_vec(),
            command: format!("raycl run on {device}"),
        };
        let missing = Missing {
            kinds: vec![kind("gpu", &["a", "b"], &[2, 3]), kind("cpu", &["c"], &[4])],
            took_part: Some("gpu, cpu".into()),
            ..Missing::default()
        };
        let (said, remedy) = refused(&missing, &[]);
        assert_eq!(said, "3 points are missing");
        let lines: Vec<&str> = remedy.lines().collect();
        assert_eq!(
            lines,
            [
                "these commands measure the missing points",
                "gpu: 2 of 9 points (a, b), in shards 2, 3:",
                "  raycl run on gpu",
                "cpu: 1 of 9 points (c), in shard 4:",
                "  raycl run on cpu",
                "devices with results: gpu, cpu",
            ]
        );
        let one = Missing { kinds: vec![kind("cpu", &["c"], &[4])], ..Missing::default() };
        assert_eq!(refused(&one, &[]).0, "1 point is missing");
    }

    #[test]
    fn a_merge_before_any_shard_says_how_to_start_one_and_a_failed_point_is_an_error() {
        let none = Missing { nothing_began: true, ..Missing::default() };
        assert_eq!(refused(&none, &[]).0, "no shard has begun to measure");
        let with = |outcome| Record { outcome, ..Record::default() };
        let fine = [Outcome::Measured, Outcome::Infeasible, Outcome::OtherKind].map(with);
        assert!(complete(&Missing::default(), &fine, Path::new("out")).is_ok());
        let records = [&fine[..], &[with(Outcome::WrongImage)]].concat();
        let (said, remedy) = refused(&Missing::default(), &records);
        assert_eq!(said, "1 of 4 points failed");
        assert!(remedy.contains("out/summary.md"), "{remedy}");
    }

    #[test]
    fn failed_points_are_reported_beside_missing_ones_with_the_command_that_measures_them_again() {
        let kind = |point: &str, shard: u32, command: &str| MissingKind {
            device: "gpu".into(),
            points: vec![point.to_owned()],
            of: 9,
            shards: vec![shard],
            command: command.to_owned(),
        };
        let failed = vec![kind("b", 3, "raycl again")];
        let missing = Missing { kinds: vec![kind("a", 2, "raycl run")], failed, ..Missing::default() };
        let records =
            [Outcome::Measured, Outcome::Crashed].map(|outcome| Record { outcome, ..Record::default() });
        let (said, remedy) = refused(&missing, &records);
        assert_eq!(said, "1 point is missing; 1 of 2 points failed");
        let of_failed = [
            "out/summary.md gives the reason for each point that failed",
            "these commands measure the failed points again",
            "gpu: 1 of 9 points (b), in shard 3:",
            "  raycl again",
        ];
        let lines: Vec<&str> = remedy.lines().collect();
        let of_missing = [
            "these commands measure the missing points",
            "gpu: 1 of 9 points (a), in shard 2:",
            "  raycl run",
        ];
        assert_eq!(lines, [&of_missing[..], &of_failed[..]].concat());
        let (said, remedy) = refused(&Missing { kinds: Vec::new(), ..missing }, &records);
        assert_eq!(said, "1 of 2 points failed");
        assert_eq!(remedy.lines().collect::<Vec<_>>(), of_failed);
    }

    #[test]
    fn seconds_between_readings_are_2_to_3600() {
        assert_eq!(["2", "2.5", "3600"].map(|text| seconds(text).ok()), [2.0, 2.5, 3600.0].map(Some));
        for wrong in ["-1", "0", "0.5", "1", "1.9", "3601", "NaN", "soon"] {
            assert!(seconds(wrong).is_err_and(|said| said.contains(wrong)), "{wrong}");
        }
    }

    #[test]
    fn three_missing_points_are_the_whole_list_and_the_first_three_of_four_are_not() {
        let remedy_of = |points: &[&str]| {
            let mut missing = Missing::default();
            missing.kinds.resize_with(1, Default::default);
            missing.kinds[0].points = points.iter().map(|point| (*point).to_owned()).collect();
            let error = complete(&missing, &[], Path::new("out")).expect_err("points are missing");
            error.remedy().to_owned()
        };
        let three = remedy_of(&["a", "b", "c"]);
        assert!(three.contains("(a, b, c), "), "{three}");
        let four = remedy_of(&["a", "b", "c", "d"]);
        assert!(four.contains("(a, b, c, ...), "), "{four}");
    }
}
