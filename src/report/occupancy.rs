//! Compares predicted occupancy with measured times. The student paper that raycl reproduces chooses local
//! sizes by predicted occupancy. The comparison shows whether local sizes with a higher predicted occupancy
//! are faster. raycl does not measure the actual occupancy, since OpenCL has no counter of resident
//! work-groups.

use super::plot::Plot;
use super::plot::chart::{Across, Chart, Mark, Series};
use super::plot::scale::Kind;
use super::view::names;
use super::words::{Looks, group_title, tip};
use crate::device::occupancy::{
    Multiprocessor, PAPER_CAPABILITY, PAPER_REGISTERS, multiprocessor, occupancy,
};
use crate::record::{Group, Record, interval, median};
use crate::words::few;

/// Plots measured speed over predicted occupancy. Each point with enough samples has a mark, with two
/// exceptions: points without a local size (casters on the host), and points of rasterisers. The work-groups
/// of a rasteriser's main kernel do not have the point's local size. If `compute_capability` is `None`, the
/// prediction is for the compute capability that raycl assumes for the paper's GPU. Returns `None` if all
/// strategies have fewer than three marks, or if raycl has no data on the compute capability.
pub fn plot(group: &Group<'_>, looks: &Looks, compute_capability: Option<&str>, name: &str) -> Option<Plot> {
    let sm = multiprocessor(compute_capability.unwrap_or(PAPER_CAPABILITY)).ok()?;
    let mut series = Vec::new();
    let (mut ranks, mut tied) = (Vec::new(), Vec::new());
    let mut assumed = 0;
    for strategy in names(group) {
        let of_strategy: Vec<&Record> = group
            .records
            .iter()
            .copied()
            .filter(|record| record.name == strategy && interval(record).is_some())
            .collect();
        let best = of_strategy.iter().filter_map(|record| median(record)).fold(f64::INFINITY, f64::min);
        let shown: Vec<(&Record, Mark)> =
            of_strategy.into_iter().filter_map(|record| Some((record, mark(record, sm, best)?))).collect();
        assumed += shown.iter().filter(|(record, _)| known(record).0.is_none()).count();
        let (records, marks): (Vec<&Record>, Vec<Mark>) = shown.into_iter().unzip();
        match spearman(&marks) {
            Some(_) if all_tie(&records) => tied.push(strategy),
            rank => ranks.extend(rank),
        }
        if !marks.is_empty() {
            series.push(Series {
                name: strategy.to_owned(),
                look: looks.look(strategy),
                joined: false,
                marks,
            });
        }
    }
    if series.iter().all(|one| one.marks.len() < 3) {
        return None;
    }
    let all: usize = series.iter().map(|one| one.marks.len()).sum();
    let caption =
        format!("{} {} {NOT_MEASURED}", whose(compute_capability, assumed, all), ranking(&ranks, &tied));
    let chart = Chart {
        title: format!("Does predicted occupancy rank local sizes? {}", group_title(group)),
        x_label: format!(
            "predicted occupancy of a multiprocessor, % (compute capability {})",
            sm.compute_capability
        ),
        y_label: "measured speed, % of the strategy's best".into(),
        across: Across::Numbers(Kind::Linear),
        up: Kind::Linear,
        diagonal: false,
        series,
    };
    Some(Plot::of(name, caption, &chart))
}

const NOT_MEASURED: &str = "Occupancy itself is not measured, because OpenCL cannot report how many \
    work-groups are resident. For this reason, the predicted occupancy is compared with the measured speed.";

/// Describes the multiprocessor for which the occupancy is predicted, and where the numbers of registers for
/// this prediction come from. `all` is the number of points, and `assumed` is the number of points for which
/// raycl assumes the number of registers, because the compiler did not report it.
fn whose(compute_capability: Option<&str>, assumed: usize, all: usize) -> String {
    match compute_capability {
        Some(cc) if assumed == 0 => format!(
            "The prediction is for this device's compute capability, {cc}, and uses the registers and `__local` bytes of each \
             compiled kernel."
        ),
        Some(cc) if assumed < all => format!(
            "The prediction is for this device's compute capability, {cc}, and uses the registers and `__local` bytes of the \
             compiled kernels. For {assumed} of the {all} points, the registers are unknown, and the prediction \
             assumes the paper's {PAPER_REGISTERS} registers per thread."
        ),
        Some(cc) => format!(
            "The prediction is for this device's compute capability, {cc}, and assumes the paper's {PAPER_REGISTERS} registers per thread, because the registers of the compiled kernels are unknown."
        ),
        None => format!(
            "OpenCL does not describe the multiprocessors of this device. The prediction is therefore for the GPU of \
             the paper's Figure 5 (compute capability {PAPER_CAPABILITY}), with the paper's {PAPER_REGISTERS} registers \
             per thread, which Figure 5 ignores."
        ),
    }
}

/// Returns true if all of a strategy's points tie, so that the samples do not show which point is faster. The order of
/// the points' medians is then due to chance.
fn all_tie(records: &[&Record]) -> bool {
    let ranking = crate::record::ranking(records.iter().copied());
    ranking.winners.len() == ranking.ranked.len()
}

/// Returns a text about the rank correlations between predicted occupancy and measured speed. `tied` contains the
/// strategies that have no rank correlation because their points tie.
fn ranking(ranks: &[f64], tied: &[&str]) -> String {
    if ranks.is_empty() {
        return "raycl cannot judge how well the prediction ranks local sizes: there are too few local sizes, or all \
            have the same prediction, or all tie."
            .to_owned();
    }
    let left_out = match tied {
        [] => String::new(),
        tied => format!(" The mean leaves out strategies whose local sizes all tie: {}.", few(tied)),
    };
    let mean = ranks.iter().sum::<f64>() / ranks.len() as f64;
    let verdict = match mean {
        m if m > 0.7 => "the prediction ranks local sizes well",
        m if m > 0.3 => "the prediction ranks local sizes moderately well",
        m if m > -0.3 => "the prediction says almost nothing about which local size is fast",
        _ => "local sizes with a lower predicted occupancy tend to be faster",
    };
    format!(
        "Rank correlation (Spearman) of predicted occupancy and measured speed, mean over strategies: {mean:.2}; \
         {verdict}.{left_out}"
    )
}

/// Returns a record's mark in the plot. `best` is the shortest median of the record's strategy, in milliseconds.
/// Returns `None` if the record has no local size or no time, or if the main kernel's work-groups do not have the
/// record's local size.
fn mark(record: &Record, sm: &Multiprocessor, best: f64) -> Option<Mark> {
    if record.rasterises() {
        return None;
    }
    let [across, down] = record.local_size?;
    let (registers, local_bytes) = known(record);
    let predicted = occupancy(sm, registers.unwrap_or(PAPER_REGISTERS), local_bytes, across * down);
    let percent = 100.0 * predicted.fraction;
    let tip = format!("{}\npredicted occupancy {percent:.0}% ({})", tip(record), predicted.limiter.words());
    Some(Mark { x: percent, y: 100.0 * best / median(record)?, interval: None, tip })
}

/// Returns the main kernel's number of registers, or `None` if the compiler did not report this number. Also
/// returns the bytes of `__local` memory that a work-group needs. If the number of registers is known, these
/// are the compiled kernel's bytes. Otherwise, these are the bytes that raycl predicted, or 0 if raycl
/// predicted no bytes.
fn known(record: &Record) -> (Option<u32>, u64) {
    let kernel = record.main_kernel().filter(|kernel| kernel.resources.registers.is_some());
    let registers = kernel.and_then(|kernel| kernel.resources.registers);
    let bytes = kernel.map(|kernel| kernel.group_local_bytes());
    (registers, bytes.or(record.local_bytes).unwrap_or(0))
}

/// Returns Spearman's rank correlation of the marks' x and y values; `None` for fewer than four marks, or if x or y is
/// constant.
fn spearman(marks: &[Mark]) -> Option<f64> {
    if marks.len() < 4 {
        return None;
    }
    let (xs, ys) = (ranks(marks.iter().map(|mark| mark.x)), ranks(marks.iter().map(|mark| mark.y)));
    let mean = (marks.len() as f64 - 1.0) / 2.0;
    let product: f64 = xs.iter().zip(&ys).map(|(x, y)| (x - mean) * (y - mean)).sum();
    let square = |ranks: &[f64]| ranks.iter().map(|rank| (rank - mean).powi(2)).sum::<f64>();
    let size = (square(&xs) * square(&ys)).sqrt();
    (size > 0.0).then(|| product / size)
}

/// Returns each value's rank: the number of smaller values. Equal values share the mean of their ranks.
fn ranks(values: impl Iterator<Item = f64> + Clone) -> Vec<f64> {
    let rank = |value: f64| {
        let below = values.clone().filter(|other| *other < value).count() as f64;
        let equal = values.clone().filter(|other| *other == value).count() as f64;
        below + (equal - 1.0) / 2.0
    };
    values.clone().map(rank).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_correlate_fully_when_the_order_is_the_same() {
        let mark = |x: f64, y: f64| Mark { x, y, interval: None, tip: String::new() };
        let same = [mark(1.0, 1.0), mark(2.0, 10.0), mark(3.0, 11.0), mark(9.0, 12.0)];
        assert_eq!(spearman(&same), Some(1.0));
        let reversed = same.clone().map(|m| mark(m.x, -m.y));
        assert_eq!(spearman(&reversed), Some(-1.0));
        assert_eq!(spearman(&same.map(|m| mark(1.0, m.y))), None);
    }

    #[test]
    fn equal_values_share_the_mean_of_their_ranks() {
        assert_eq!(ranks([5.0, 1.0, 5.0, 9.0, 5.0].into_iter()), [2.0, 0.0, 2.0, 4.0, 2.0]);
        let mark = |x: f64, y: f64| Mark { x, y, interval: None, tip: String::new() };
        assert_eq!(spearman(&[mark(1.0, 1.0), mark(2.0, 2.0), mark(3.0, 3.0)]), None, "too few");
        // The expected correlation was calculated independently of this code. The ranks of x are 0, 1.5, 1.5,
        // 3, and the ranks of y are 0, 1, 2, 3. For each mark, the deviations of the ranks of x and y from
        // the mean rank are multiplied; the products add up to 4.5. The squares of the deviations add up to
        // 4.5 for x, and to 5 for y.
        let actual = spearman(&[mark(1.0, 1.0), mark(2.0, 2.0), mark(2.0, 3.0), mark(3.0, 4.0)]);
        assert!(actual.is_some_and(|actual| (actual - 4.5 / 22.5_f64.sqrt()).abs() < 1e-12), "{actual:?}");
    }

    #[test]
    fn how_well_a_prediction_ranks_is_said_by_the_mean_correlation() {
        for (ranks, expected) in [
            (&[0.8, 0.9][..], "0.85; the prediction ranks local sizes well."),
            (&[0.7], "0.70; the prediction ranks local sizes moderately well."),
            (&[0.3], "0.30; the prediction says almost nothing"),
            (&[-0.2], "-0.20; the prediction says almost nothing"),
            (&[-0.3], "-0.30; local sizes with a lower predicted occupancy"),
            (&[], "too few local sizes"),
        ] {
            assert!(ranking(ranks, &[]).contains(expected), "{ranks:?}: {}", ranking(ranks, &[]));
        }
        assert!(ranking(&[0.8], &[]).contains("(Spearman) of predicted occupancy and measured speed"));
    }

    /// In this test, a work-group has 16 x 16 work-items with 63 registers each, so 512 of at most 1536
    /// threads are resident.
    #[test]
    fn a_mark_has_the_predicted_occupancy_and_the_speed_relative_to_the_best() {
        use crate::record::fixtures::measured;
        let sm = multiprocessor(PAPER_CAPABILITY).expect("it is known");
        let mut record = measured("gpu", "naive", 16, 8.0);
        let name = record.main_kernel().map_or("cast_frame".to_owned(), |kernel| kernel.name.clone());
        let at = |record: &Record| mark(record, sm, 2.0).map(|mark| (mark.x.round(), mark.y));
        assert_eq!(at(&record), Some((33.0, 25.0)), "the paper's registers are assumed");
        let mut kernel = crate::program::CompiledKernel { name, ..Default::default() };
        kernel.resources.registers = Some(20);
        record.kernels = vec![kernel];
        assert_eq!(at(&record), Some((100.0, 25.0)));
        let raster = Record { strategy: "traversal=raster".into(), ..record.clone() };
        assert_eq!(at(&raster), None, "the local size is not that of the main kernel");
        assert_eq!(at(&Record { local_size: None, ..record }), None);
    }

    #[test]
    fn a_point_with_too_few_samples_has_no_mark_and_is_not_the_best() {
        use crate::record::fixtures::{few, judged, measured};
        use crate::record::groups;
        let plotted = |more: &[Record]| {
            let own = [4, 8, 16].map(|side| measured("gpu", "naive", side, f64::from(side)));
            let records = judged([&own[..], more].concat());
            let groups = groups(&records);
            plot(&groups[0], &Looks::of(&groups), None, "occupancy").map(|plot| (plot.svg, plot.caption))
        };
        // `fastest` was measured on another machine, so its samples do not change the intervals of the other
        // points.
        let fastest = Record { host: Some("another".into()), ..few("gpu", "naive", 2, 1.0, 3) };
        assert!(plotted(&[]).is_some());
        assert_eq!(plotted(&[fastest]), plotted(&[]));
    }

    /// Smaller local sizes have a lower predicted occupancy. The times of `naive` differ so little that all its local
    /// sizes tie.
    #[test]
    fn a_strategy_whose_local_sizes_tie_has_no_rank_correlation() {
        use crate::record::fixtures::{judged, measured};
        use crate::record::groups;
        let caption = |strategies: &[(&str, [f64; 4])]| {
            let of = |(name, times): &(&str, [f64; 4])| {
                [(2, times[0]), (4, times[1]), (8, times[2]), (16, times[3])]
                    .map(|(side, ms)| measured("gpu", name, side, ms))
            };
            let records = judged(strategies.iter().flat_map(of).collect::<Vec<_>>());
            let groups = groups(&records);
            plot(&groups[0], &Looks::of(&groups), None, "occupancy").expect("a plot").caption
        };
        let (tie, apart) = (("naive", [1.003, 1.002, 1.001, 1.0]), ("private", [4.0, 3.0, 2.0, 1.0]));
        let tied = caption(&[tie]);
        assert!(tied.contains("or all tie.") && !tied.contains("Rank correlation"), "{tied}");
        let both = caption(&[tie, apart]);
        assert!(
            both.contains("ranks local sizes well. The mean leaves out") && both.contains("tie: naive."),
            "{both}"
        );
        let clear = caption(&[apart]);
        assert!(clear.contains("Rank correlation (Spearman)") && !clear.contains("leaves out"), "{clear}");
    }

    #[test]
    fn the_caption_says_whose_occupancy_is_predicted_and_from_which_registers() {
        let own = whose(Some("9.0"), 0, 12);
        assert!(own.contains("compute capability, 9.0, and uses the registers"), "{own}");
        let some = whose(Some("9.0"), 3, 12);
        assert!(some.contains("For 3 of the 12 points, the registers are unknown"), "{some}");
        let assumed = whose(Some("9.0"), 12, 12);
        assert!(
            assumed.contains("compute capability, 9.0, and assumes the paper's 63 registers"),
            "{assumed}"
        );
        let of_paper = whose(None, 12, 12);
        assert!(of_paper.contains("Figure 5 (compute capability 2.0), with"), "{of_paper}");
    }
}
