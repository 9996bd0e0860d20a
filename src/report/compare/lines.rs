//! Converts the compared pairs of records to objects for JSON.

use super::Comparison;
use super::pair::{Against, Pair, percent};
use crate::record::median;
use serde::Serialize;

/// A compared pair of records in the form that `raycl compare --json` prints.
#[derive(Debug, Serialize)]
pub struct PairLine<'a> {
    /// The point's name, as in the tables.
    pub point: String,
    pub scene: &'a str,
    pub image_size: [u32; 2],
    pub device: [&'a str; 2],
    pub name: &'a str,
    pub local_size: Option<[u32; 2]>,
    pub median_ms: [Option<f64>; 2],
    pub change_percent: Option<f64>,
    pub interval_percent: Option<[f64; 2]>,
    pub against: Option<Against>,
    pub verdict: &'static str,
}

impl Comparison {
    /// Returns the compared pairs of records as objects for JSON.
    pub fn lines(&self) -> Vec<PairLine<'_>> {
        self.pairs.iter().map(|pair| line(pair, self.several_devices)).collect()
    }
}

fn line(pair: &Pair, several_devices: bool) -> PairLine<'_> {
    PairLine {
        point: pair.point(several_devices),
        scene: &pair.before.scene,
        image_size: pair.before.image_size,
        device: [&pair.before.device, &pair.after.device],
        name: &pair.before.name,
        local_size: pair.before.local_size,
        median_ms: [median(&pair.before), median(&pair.after)],
        change_percent: pair.change_percent(),
        interval_percent: pair.change.map(|(change, _)| [change.low, change.high].map(percent)),
        against: pair.change.map(|(_, against)| against),
        verdict: pair.verdict.name(),
    }
}
