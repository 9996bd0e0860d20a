//! Plots Figure 5 of the student paper that raycl reproduces: the predicted number of threads on a
//! multiprocessor for each block size.

use crate::device::occupancy::{
    Multiprocessor, PAPER_CAPABILITY, PAPER_REGISTERS, multiprocessor, occupancy,
};
use crate::record::Record;
use crate::report::claims::Run;
use crate::report::plot::Plot;
use crate::report::plot::chart::{Across, Chart, Mark, Series};
use crate::report::plot::look::Look;
use crate::report::plot::scale::Kind;

/// The values in the paper's Figure 5: the side of a square block (work-group), and the threads per
/// multiprocessor.
const PUBLISHED: [(u32, u64); 5] = [(2, 32), (4, 128), (8, 512), (16, 1536), (32, 1024)];
/// The sides of the square blocks that the plot shows.
const BLOCKS: [u32; 9] = [2, 4, 6, 8, 10, 12, 14, 16, 32];

/// Returns a plot like the paper's Figure 5 with three curves: the published values, the prediction for the
/// paper's number of registers, and the prediction for the kernel of the preset `naive` on the device `device`.
/// The curve for the kernel of `naive` is left out if the records contain no such prediction, for example
/// because this kernel's number of registers is unknown.
pub(super) fn predicted(runs: &[Run<'_>], device: &str, suffix: &str) -> Plot {
    let published = PUBLISHED.iter().map(|(block, threads)| mark(*block, *threads, "published"));
    let mut series = vec![one("Figure 5, published".to_owned(), 0, true, published.collect())];
    if let Ok(sm) = multiprocessor(PAPER_CAPABILITY) {
        let name = format!("at {PAPER_REGISTERS} registers");
        series.push(one(name, 1, false, BLOCKS.iter().map(|block| by_registers(sm, *block)).collect()));
    }
    let own = of_device(runs, device);
    if !own.is_empty() {
        series.push(one("naive on this device".to_owned(), 2, false, own));
    }
    let chart = Chart {
        title: format!("Figure 5: {device}"),
        x_label: "block size".into(),
        y_label: "threads resident on a multiprocessor".into(),
        across: Across::Names(BLOCKS.iter().map(|block| format!("{block}x{block}")).collect()),
        up: Kind::Linear,
        diagonal: false,
        series,
    };
    let caption = "The dashed line shows the paper's predictions, which consider only the limits on blocks and threads. With the paper's 63 registers per thread, a multiprocessor of compute capability 2.0 holds at most 512 threads and cannot launch a block of 32x32. For a device that reports its kernels' registers, the prediction for the naive kernel is shown too.";
    Plot::of(format!("figure-5{suffix}"), caption, &chart)
}

fn one(name: String, number: usize, dashed: bool, marks: Vec<Mark>) -> Series {
    Series { name, look: Look { number, dashed }, joined: true, marks }
}

fn mark(block: u32, threads: u64, why: &str) -> Mark {
    let index = BLOCKS.iter().position(|known| *known == block).unwrap_or(0);
    let tip = format!("{block} x {block}: {threads} threads\n{why}");
    Mark { x: index as f64, y: threads as f64, interval: None, tip }
}

fn by_registers(sm: &Multiprocessor, block: u32) -> Mark {
    let occupancy = occupancy(sm, PAPER_REGISTERS, 0, block * block);
    mark(block, occupancy.threads, &occupancy.limiter.words())
}

/// Returns marks for the kernel of the preset `naive` on a device: the number of threads that raycl predicted
/// to be resident on a multiprocessor. Block sizes without a prediction in the records have no mark.
fn of_device(runs: &[Run<'_>], device: &str) -> Vec<Mark> {
    let groups = runs.iter().flat_map(|run| &run.groups).filter(|group| group.device == device);
    let records: Vec<&Record> = groups.flat_map(|group| group.records.iter().copied()).collect();
    let own = |block: &u32| {
        let naive = |record: &&&Record| record.is_naive() && record.local_size == Some([*block; 2]);
        let kernel = records
            .iter()
            .filter(naive)
            .find_map(|record| record.main_kernel()?.resident_groups.zip(record.main_kernel()))?;
        let (groups, kernel) = kernel;
        let registers = kernel.resources.registers.map_or("?".to_owned(), |count| count.to_string());
        let limit = kernel.occupancy_limited_by.as_deref().unwrap_or("an unknown resource");
        // If no work-group fits, the record's text begins with "cannot launch", so "limited by" is left out.
        let limited_by = if groups == 0 { "" } else { "limited by " };
        Some(mark(
            *block,
            groups * u64::from(block * block),
            &format!("{registers} registers, {limited_by}{limit}"),
        ))
    };
    BLOCKS.iter().filter_map(own).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::CompiledKernel;
    use crate::record::fixtures::measured;
    use crate::record::{Folder, groups};

    #[test]
    fn only_a_device_that_reports_registers_has_a_prediction_of_its_own() {
        let silent = measured("gpu", "naive", 8, 1.0);
        let (name, resident_groups) = ("cast_frame".to_owned(), Some(8));
        let kernel = CompiledKernel { name, resident_groups, ..CompiledKernel::default() };
        let telling = Record { kernels: vec![kernel], ..silent.clone() };
        let predicts = |record: Record| {
            let (folder, records) = (Folder::default(), [record]);
            let plot = predicted(&Run::of(&folder, groups(&records)), "gpu", "");
            plot.svg.contains("naive on this device")
        };
        assert_eq!([telling, silent].map(predicts), [true, false]);
    }

    #[test]
    fn a_mark_has_the_threads_of_all_groups_of_a_naive_kernel() {
        let on = |name: &str, side: u32, held: u64, limit: &str| {
            let mut kernel = CompiledKernel {
                name: "cast_frame".to_owned(),
                resident_groups: Some(held),
                occupancy_limited_by: Some(limit.to_owned()),
                ..CompiledKernel::default()
            };
            kernel.resources.registers = Some(67);
            Record { kernels: vec![kernel], ..measured("gpu", name, side, 1.0) }
        };
        let (folder, fits, none) = (Folder::default(), "registers", "cannot launch: registers");
        let records = [on("private", 4, 3, fits), on("naive", 8, 3, fits), on("naive", 32, 0, none)];
        let marks = of_device(&Run::of(&folder, groups(&records)), "gpu");
        let marks: Vec<_> = marks.iter().map(|mark| (mark.x, mark.y, mark.tip.as_str())).collect();
        let last = (BLOCKS.len() - 1) as f64;
        let launched = (3.0, 192.0, "8 x 8: 192 threads\n67 registers, limited by registers");
        let none = (last, 0.0, "32 x 32: 0 threads\n67 registers, cannot launch: registers");
        assert_eq!(marks, [launched, none]);
    }

    #[test]
    fn the_published_threads_are_those_that_the_table_of_claims_quotes() {
        let all = PUBLISHED.map(|(side, threads)| format!("{threads} ({side}x{side})")).join(", ");
        let quoted = format!("threads per multiprocessor: {all}\"");
        assert!(include_str!("../claims/claims.toml").contains(&quoted), "{quoted}");
        let marks = PUBLISHED.map(|(side, threads)| mark(side, threads, ""));
        assert_eq!(marks.map(|mark| BLOCKS[mark.x as usize]), PUBLISHED.map(|(side, _)| side));
    }
}
