//! Compares points of a group that was divided into several blocks, which may have been measured on different
//! machines. All blocks of a group measure the same control point. raycl therefore compares points of
//! different blocks by the ratios of their times to the control point's time in their own block.

use super::relative_times::RelativeTimes;
use super::types::Record;
use crate::measure::{Interval, Standing};
use std::collections::HashMap;

/// The key of a block's control point, and its times as measured in this block.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Control {
    key: String,
    /// The control point's times, relative to the times of the block's records.
    standing: Standing,
    /// True if this `Control` belongs to the record of the control point itself.
    is_itself: bool,
}

/// Assigns to each record of a block the block's control point, which was measured in the same
/// rounds.
pub(super) fn find_controls(records: &mut [Record]) {
    let mut blocks: HashMap<blake3::Hash, Standing> = HashMap::new();
    for record in records.iter().filter(|record| record.control.as_ref() == Some(&record.key)) {
        let Some(times) = &record.relative_times else { continue };
        blocks.insert(times.together, times.standing.clone());
    }
    for record in records {
        let (Some(times), Some(key)) = (&mut record.relative_times, &record.control) else { continue };
        let Some(standing) = blocks.get(&times.together) else { continue };
        let is_itself = record.key == *key;
        times.control = Some(Control { key: key.clone(), standing: standing.clone(), is_itself });
    }
}

impl RelativeTimes {
    /// Returns the record's level, which is the logarithm of a time, by which the record is ranked. Only
    /// levels of records with the same [`Self::family`] can be compared. If the record's block has a control
    /// point, the level is reduced by the control point's level in the same block, so that the speed of the
    /// machine that measured the block cancels.
    pub(super) fn level(&self) -> f64 {
        let of_control = self.control.as_ref().map_or(0.0, |control| control.standing.level());
        self.standing.level() - of_control
    }

    /// Returns a text that is equal for two records if and only if their levels can be compared. The text is
    /// the key of the control point of the record's block. If the block has no control point, the text
    /// identifies the rounds in which the record was measured.
    pub(super) fn family(&self) -> String {
        self.control.as_ref().map_or_else(|| self.together.to_string(), |control| control.key.clone())
    }

    /// Returns the ratio of this record's time to the time of `other`. The ratio is computed from the ratios
    /// of both times to the time of the control point that the blocks of both records share. Returns `None`
    /// if one of the blocks has no control point, or if the two control points differ.
    pub(super) fn ratio_by_control(&self, other: &Self) -> Option<Interval> {
        let (own, others) = (self.control.as_ref()?, other.control.as_ref()?);
        let to_control = |times: &Self, control: &Control| match control.is_itself {
            true => Interval::ONE,
            false => times.standing.ratio(&control.standing),
        };
        (own.key == others.key).then(|| to_control(self, own).over(to_control(other, others)))
    }
}

#[cfg(test)]
mod tests {
    use super::super::ranking::ranking;
    use super::super::ratios::ratio;
    use super::super::summary::tests::{judged, sampled};
    use super::*;

    /// Returns a record with ten samples near `ms`, five in each of the two launches of block `number`.
    fn block(name: &str, ms: f64, number: u32) -> Record {
        let mut record =
            sampled(name, (0..10).map(|index| (index / 5, ms * (1.0 + 0.02 * f64::from(index / 5)))));
        record.sample_launches.iter_mut().for_each(|launch| *launch += 7 * number);
        Record { control: Some(record.key.clone()), ..record }
    }

    /// Returns the control point and `naive` as measured on a first machine, and then the control point and
    /// `wide` as measured on a second machine. The second machine takes twice as long as the first machine,
    /// so `wide` would take 4 ms on the first machine.
    fn of_two_machines() -> Vec<Record> {
        let control = |ms, number| block("control", ms, number);
        let with = |record: Record| Record { control: Some(control(1.0, 0).key), ..record };
        judged([
            control(10.0, 0),
            with(block("naive", 5.0, 0)),
            Record { is_control: true, ..control(20.0, 1) },
            with(block("wide", 8.0, 1)),
        ])
    }

    #[test]
    fn blocks_are_compared_by_the_control_point_that_both_measured() {
        let records = of_two_machines();
        let ratio = ratio(&records[1], &records[3]).expect("enough samples");
        assert!((ratio.middle - 1.25).abs() < 1e-9 && ratio.low > 1.2 && ratio.high < 1.3, "{ratio:?}");
        let ranking = ranking([&records[1], &records[3]]);
        assert_eq!(ranking.winners[0].name, "wide");
    }

    /// The control point failed in the third block. Points of the third block are therefore compared with
    /// points of the first two blocks by their medians.
    #[test]
    fn a_block_without_the_control_point_leaves_the_order_of_the_other_blocks() {
        let lone = Record { control: None, ..block("tile", 6.5, 2) };
        let records = judged([&of_two_machines()[..], &[lone]].concat());
        let ranked = ranking([&records[1], &records[3], &records[4]]).ranked;
        let names: Vec<_> = ranked.iter().map(|record| record.name.as_str()).collect();
        assert_eq!(names, ["wide", "tile", "naive"]);
    }

    /// The control point's ratio to itself is exactly 1 and has no error. If a point is compared with the
    /// control point as measured in another block, the only error of the result is therefore the error of the
    /// point's ratio to the control point within the point's own block.
    #[test]
    fn the_control_point_is_exactly_as_fast_as_itself() {
        let records = of_two_machines();
        let within = ratio(&records[3], &records[2]).expect("enough samples");
        let across = ratio(&records[3], &records[0]).expect("enough samples");
        let values = |ratio: Interval| [ratio.middle, ratio.low, ratio.high, ratio.error];
        let apart = values(across).into_iter().zip(values(within)).map(|(one, other)| (one - other).abs());
        assert!(apart.fold(0.0, f64::max) < 1e-9 && within.error > 0.0, "{across:?} {within:?}");
        let itself = ratio(&records[2], &records[0]).expect("enough samples");
        assert_eq!(itself, Interval::ONE);
    }

    #[test]
    fn blocks_of_other_control_points_are_compared_by_their_times() {
        let with = |record: Record, key: &str| Record { control: Some(key.into()), ..record };
        let of =
            |key: &str, ms, number| with(Record { key: key.into(), ..block("control", ms, number) }, key);
        let records = judged([
            of("one", 10.0, 0),
            with(block("naive", 5.0, 0), "one"),
            of("other", 20.0, 1),
            with(block("wide", 8.0, 1), "other"),
        ]);
        let ratio = ratio(&records[1], &records[3]).expect("enough samples");
        assert!((ratio.middle - 5.0 / 8.0).abs() < 1e-9, "{ratio:?}");
    }
}
