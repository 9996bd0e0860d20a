//! `raycl run --spread`: distributes blocks of points over the devices of one machine.

use super::earlier::earlier;
use crate::error::{Error, Result};
use crate::experiment::{Block, Run, contain_each_once, cut};
use crate::record::{ordinary, write_whole};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The name of a file in the folder of results: it stores the blocks of a run (a block has the points that
/// one device measures together).
const FILE: &str = "blocks.json";

/// The blocks into which the points of a run were cut.
#[derive(Serialize, Deserialize)]
pub struct Spread {
    /// Number of devices.
    devices: usize,
    /// The label of each point in the plan (the points for one device), such as "triangle 16x10 naive 8x8".
    points: Vec<String>,
    blocks: Vec<Block>,
}

impl Spread {
    /// Cuts the plan of a run into blocks of points for the run's devices. A run that is resumed with the
    /// same points and the same number of devices uses the blocks of its first session, even if the expected
    /// times of points have changed. If each session cut the points into new blocks, a group of points could
    /// get another control point (the point that all its blocks measure).
    pub fn of(run: &Run<'_>, out: &Path) -> Result<Self> {
        let devices = run.devices.len();
        let plan = run.plan_of_one_device();
        let points: Vec<String> = plan.points.iter().map(|point| point.label(run.experiment)).collect();
        let known = read(&out.join(FILE));
        if let Some(known) = known.filter(|known| known.devices == devices && known.points == points) {
            return Ok(known);
        }
        let blocks = cut(&run.costs(&earlier(out))?, devices as u32);
        Ok(Self { devices, points, blocks })
    }

    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Writes the blocks into the folder of results, for the run's later sessions.
    pub fn write(&self, out: &Path) -> Result<()> {
        let text = serde_json::to_vec(self).map_err(|error| Error::fault(error.to_string()))?;
        write_whole(&out.join(FILE), &text)
    }
}

/// Returns the blocks of an earlier session. Returns `None` if the file does not exist, cannot be read, is not an
/// ordinary file, or does not contain blocks as JSON. Also returns `None` if the blocks do not contain each point
/// exactly once.
fn read(path: &Path) -> Option<Spread> {
    ordinary(path).ok()?;
    let spread: Spread = serde_json::from_slice(&std::fs::read(path).ok()?).ok()?;
    contain_each_once(&spread.blocks, spread.points.len()).then_some(spread)
}

#[cfg(test)]
mod tests {
    use super::super::fixtures;
    use super::*;
    use crate::device::DeviceInfo;
    use crate::device_lock::Locks;
    use crate::program::Sources;

    #[test]
    fn blocks_that_leave_a_point_out_are_not_gone_on_with() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(FILE);
        let block_count = |text: &str| {
            std::fs::write(&path, text).unwrap();
            read(&path).map(|spread| spread.blocks.len())
        };
        let text = r#"{"devices":2,"points":["a","b"],"blocks":[{"number":1,"shard":1,"points":[1,0],"control":null}]}"#;
        assert_eq!(block_count(text), Some(1));
        assert_eq!(
            (block_count(&text.replace("[1,0]", "[1]")), block_count(&text.replace("[1,0]", "[1,1]"))),
            (None, None)
        );
        assert_eq!((block_count("{"), read(folder.path()).is_none()), (None, true));
    }

    #[test]
    fn blocks_of_the_first_session_are_kept_for_the_same_points_on_as_many_devices() {
        let folder = tempfile::tempdir().unwrap();
        let (device, locks) = (crate::experiment::asleep::device(1.0), Locks::of_machine(false));
        let (sources, args) = ([Sources::Embedded], fixtures::args(&["a.toml", "--spread"]));
        let blocks_of = |lines: &str, devices: &[&DeviceInfo]| {
            let experiment = fixtures::experiment(lines);
            let run = super::super::run_of(&args, &experiment, devices, &sources, &locks).unwrap();
            let spread = Spread::of(&run, folder.path()).unwrap();
            spread.write(folder.path()).unwrap();
            spread.blocks
        };
        let lines = "local_sizes = [1, 2, 4, 8]";
        let first = blocks_of(lines, &[&device, &device]);
        let mut shards: Vec<u32> = first.iter().map(|block| block.shard).collect();
        shards.sort_unstable();
        shards.dedup();
        assert_eq!(shards, [1, 2], "each device has a part");
        // The points are cut into new blocks only if the number of devices or the points have changed.
        let path = folder.path().join(FILE);
        let text = std::fs::read_to_string(&path).unwrap();
        let marked = text.replacen("\"number\":1,", "\"number\":77,", 1);
        std::fs::write(&path, &marked).unwrap();
        assert!(blocks_of(lines, &[&device, &device]).iter().any(|block| block.number == 77));
        assert!(blocks_of(lines, &[&device, &device, &device]).iter().all(|block| block.number != 77));
        std::fs::write(&path, &marked).unwrap();
        assert!(blocks_of("local_sizes = [1]", &[&device, &device]).iter().all(|block| block.number != 77));
    }
}
