//! Merges the results of ten thousand measured points in 256 shards, and makes the report on these points.
//! `make test` merges only 600 points in 32 shards.

use super::succeeds;
use crate::binary::{WorkFolder, finish, repository};
use crate::common::is_long;
use raycl::experiment::{Block, Cost, cut};
use raycl::record::{PlannedPoint, Record, Sample, read_lines};
use raycl::shard::{About, Attempt, End, Header, Kind, KindPoint, ShardPlan};
use std::path::Path;
use std::process::Stdio;

/// Many points in many shards, as if they had been measured: the times of a few recorded points, stored under
/// other names in the folders of attempts.
struct Replay {
    points: usize,
    shards: u32,
    /// Number of measured points with the same scene and image size.
    group: usize,
}

impl Replay {
    /// Returns one of the recorded points, in turn, with another key, with other names, and with ten samples in two
    /// launches.
    fn record(&self, recorded: &[Record], point: usize) -> Record {
        let mut record = recorded[point % recorded.len()].clone();
        record.key = format!("{point:032x}");
        record.scene = format!("scene-{}", point / self.group);
        record.scene_hash = Some(record.scene.clone());
        record.name = format!("strategy-{}", (point % self.group) / 8);
        record.preset = None;
        record.local_size = Some([1 << (point % 8), 1]);
        let median = record.median_ms.expect("a time");
        record.samples_ms = (0..10).map(|index| median * (1.0 + 0.001 * f64::from(index * 7 % 10))).collect();
        record.sample_launches = (0..10).map(|index| index / 5).collect();
        record.samples_at_ms = (0..10).map(|index| f64::from(index % 5)).collect();
        record
    }

    /// Writes the plan, the kind of device and every shard's attempt.
    fn write(&self, out: &Path) {
        let file = repository("docs/results/2026-11-20-h200/figure-8/records.jsonl");
        let recorded: Vec<Record> = read_lines::<Record>(&file).expect("recorded times").lines;
        let recorded: Vec<Record> = recorded
            .into_iter()
            .filter(|record| record.median_ms.is_some() && record.device != "host")
            .collect();
        let indices: Vec<usize> = (0..self.points).collect();
        let records: Vec<Record> = indices.iter().map(|point| self.record(&recorded, *point)).collect();
        let cost = |point: &usize| Cost {
            point: *point,
            ms: records[*point].median_ms.expect("a time"),
            start_ms: 0.0,
            may_control: true,
        };
        let groups: Vec<Vec<Cost>> =
            indices.chunks(self.group).map(|group| group.iter().map(cost).collect()).collect();
        let plan = ShardPlan {
            header: Header { shards: self.shards, ..Header::default() },
            points: records.iter().map(|record| record.name.clone()).collect(),
            cases: indices.iter().map(|point| point / self.group).collect(),
            blocks: cut(&groups, self.shards),
            expected_ms: Vec::new(),
        };
        ShardPlan::open(out, &plan.header.clone(), || Ok(plan.clone())).expect("a plan");
        let kind = Kind {
            device: recorded[0].device.clone(),
            identity: "recorded".to_owned(),
            points: records
                .iter()
                .enumerate()
                .map(|(point, record)| KindPoint { point, planned: PlannedPoint::of(record) })
                .collect(),
            ..Kind::default()
        };
        kind.write(&Kind::file(out, &kind.device, &kind.identity)).expect("a kind");
        for shard in 1..=self.shards {
            let about =
                About { shard, of: self.shards, host: format!("n{}", shard % 16), ..About::default() };
            let attempt = Attempt::begin(out, &about).expect("an attempt");
            Self::write_attempt(&attempt, &about, &plan.of_shard(shard), &records);
        }
    }

    fn write_attempt(attempt: &Attempt, about: &About, blocks: &[Block], records: &[Record]) {
        let mut files = [String::new(), String::new(), String::new()];
        for (number, block) in blocks.iter().enumerate() {
            let borrowed = block.control.filter(|_| block.borrows_control());
            for point in block.points.iter().chain(&borrowed) {
                let mut record = records[*point].clone();
                record.sample_launches.iter_mut().for_each(|launch| *launch += 2 * number as u32);
                record.control = block.control.map(|control| records[control].key.clone());
                (record.block, record.host) = (Some(block.number), Some(about.host.clone()));
                record.is_control = borrowed == Some(*point);
                for (round, ms) in record.samples_ms.iter().enumerate() {
                    let (key, launch) = (record.key.clone(), record.sample_launches[round]);
                    let sample =
                        Sample { key, launch, round: round as u32 % 5, ms: *ms, ..Sample::default() };
                    files[1] += &(serde_json::to_string(&sample).expect("JSON") + "\n");
                }
                files[if record.is_control { 2 } else { 0 }] +=
                    &(serde_json::to_string(&record).expect("JSON") + "\n");
            }
        }
        for (name, text) in ["records.jsonl", "samples.jsonl", "controls.jsonl"].into_iter().zip(files) {
            std::fs::write(attempt.folder.join(name), text).expect("a file");
        }
        attempt.ended(&End::Done).expect("an end");
    }
}

/// Returns the most memory that a process has held so far, in MB; `None` if the process has ended, or if the
/// system does not report this number.
fn held_mb(process: u32) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.split_whitespace().next()?.parse::<u64>().ok()? / 1024)
}

#[test]
fn a_sweep_of_many_points_in_many_shards_is_merged_and_reported() {
    let replay = match is_long() {
        true => Replay { points: 10_000, shards: 256, group: 500 },
        false => Replay { points: 600, shards: 32, group: 200 },
    };
    let folder = WorkFolder::new();
    replay.write(&folder.path("out"));
    let start = std::time::Instant::now();
    let mut command = crate::binary::program();
    command
        .args(["merge", "out", "--quiet"])
        .current_dir(folder.path(""))
        .stdin(Stdio::null())
        .stderr(Stdio::piped());
    let child = command.spawn().expect("it starts");
    let process = child.id();
    let watch = std::thread::spawn(move || {
        let mut most_mb = 0;
        while let Some(held) = held_mb(process) {
            most_mb = most_mb.max(held);
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        most_mb
    });
    succeeds(finish(child));
    let most_mb = watch.join().expect("the most that it held");
    println!(
        "{} points in {} shards: merged and reported in {:.1} s, {most_mb} MB",
        replay.points,
        replay.shards,
        start.elapsed().as_secs_f64()
    );
    assert!(cfg!(not(target_os = "linux")) || (1..1000).contains(&most_mb), "it held {most_mb} MB");
    let records: Vec<Record> = read_lines(&folder.path("out/records.jsonl")).expect("records").lines;
    assert_eq!(records.len(), replay.points);
    let samples = read_lines::<Sample>(&folder.path("out/samples.jsonl")).expect("samples").lines;
    assert_eq!(samples.len(), 10 * replay.points);
    assert!(folder.path("out/report.html").exists());
}
