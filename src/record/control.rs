//! Compares points of a group that was divided into several blocks, which may have been measured on different
//! machines. All blocks of a group measure the same control point. raycl therefore compares points of
//! different blocks by the ratios of their times to the control point's time in their own block.

use super::relative_times::RelativeTimes;
use super::types::Record;
use crate::measure::{Interval, Standing};
use std::collections::HashMap;

/// The key of a block's control point, and the times of this point as measured in the block.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Control {
    key: String,
    /// The control point's times, relative to the times of the block's records.
    standing: Standing,
    /// True if this `Control` belongs to the record of the control point itself.
    is_itself: bool,
}

/// Assigns to each record of a block (points that one machine measured together) the times of the block's
/// control point, which were measured in the same rounds. Every block of a group measures the same control
/// point. If the control point has no time in a block, the block's records get no times of a control point.
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
    /// Returns the record's level: the logarithm of the record's time, as the mean over all launches. Records are
    /// ranked by their levels. The levels of two records can be compared only if the records have the same
    /// [`Self::family`]. If the record's block has a control point, the control point's level in the same block is
    /// subtracted from the record's level. The speed of the machine that measured the block then cancels.
    pub(super) fn level(&self) -> f64 {
        let of_control = self.control.as_ref().map_or(0.0, |control| control.standing.level());
        self.standing.level() - of_control
    }

    /// Returns a text that is equal for two records if and only if the levels of the records
    /// ([`Self::level`]) can be compared. If the record's block has a control point (a point that every block
    /// of a group measures), the text is the key of this point's record. If the record's block has no control
    /// point, the text identifies the rounds in which the record was measured.
    pub(super) fn family(&self) -> String {
        self.control.as_ref().map_or_else(|| self.together.to_string(), |control| control.key.clone())
    }

    /// Returns the ratio of this record's time to the time of `other`. To compute this ratio, the time of each record
    /// is divided by the time of the control point (a point that the blocks of both records measured) in the record's
    /// own block. Returns `None` if the block of one of the records has no control point, or if the blocks of the
    /// records have different control points.
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

    /// Returns the control point (a point that every block measures) and `naive` as measured on one machine,
    /// and then the control point and `wide` as measured on another machine. The other machine takes twice as
    /// long, so `wide` would take 4 ms on the first machine.
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

    /// In the third block, the control point (a point that every block measures) failed. Without the control
    /// point, points of the third block are compared with points of the first two blocks by their medians.
    #[test]
    fn a_block_without_the_control_point_leaves_the_order_of_the_other_blocks() {
        let lone = Record { control: None, ..block("tile", 6.5, 2) };
        let records = judged([&of_two_machines()[..], &[lone]].concat());
        let ranked = ranking([&records[1], &records[3], &records[4]]).ranked;
        let names: Vec<_> = ranked.iter().map(|record| record.name.as_str()).collect();
        assert_eq!(names, ["wide", "tile", "naive"]);
    }

    /// The control point's ratio to itself is exactly 1 and has no error. A point of one block can be
    /// compared with the control point of another block. The only error of the result is the error of the
    /// point's ratio to the control point in the point's own block.
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
