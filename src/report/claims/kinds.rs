//! Evaluates the tests of the claims of the student paper that raycl reproduces, with the records of one
//! device.

use super::claim_data::{ClaimData, is_incomplete, side};
use super::point::Point;
use super::sure::Ratio;
use super::table::{FastestTest, LocalSize, Memory, Pass, Preset, Test};
use super::verdict::{Data, Line, Verdict};
use crate::device::LaneOperations;
use crate::device::occupancy::{multiprocessor, occupancy};
use crate::numbers::{by, significant};
use crate::peak::{Figure, Peak};
use crate::record::{Record, Sample};
use crate::report::words::{at_size, title};
use crate::strategy::{Requirements, Workload};

/// Returns the result of a test, with one line per comparison.
pub(super) fn lines(test: &Test, data: &ClaimData<'_>) -> Vec<Line> {
    match test {
        Test::Ratio { of, to, at_least, at_most } => {
            let held = at_least.unwrap_or(0.0)..=at_most.unwrap_or(f64::INFINITY);
            of.iter().map(|of| data.ratio(of, to, held.clone())).collect()
        }
        Test::Rises { over, at_least } => {
            let pairs = over.windows(2);
            pairs.map(|pair| data.ratio(&pair[1], &pair[0], *at_least..=f64::INFINITY)).collect()
        }
        Test::Fastest(test) => vec![fastest(data, test)],
        Test::Runs { points, runs } => points.iter().map(|point| data.runs(point, *runs)).collect(),
        Test::Passes { point, of, to, at_least } => vec![passes(data, point, (*of, *to), *at_least)],
        Test::Fits { strategy, local_size, triangles, local_bytes, fits } => {
            vec![fits_in(strategy, *local_size, *triangles, *local_bytes, *fits)]
        }
        Test::Occupancy { compute_capability, registers, local_size, threads } => {
            vec![holds(&compute_capability.0, *registers, *local_size, *threads)]
        }
        Test::Latency { memory, cycles, within } => vec![latency(data, *memory, *cycles, *within)],
        Test::Judgement { reason, decides } => vec![Line::cannot(reason.clone(), decides.clone())],
    }
}

/// Tests the claim that `test.is` is the fastest point: every other point of `test.of` takes at least `test.by` times
/// as long. Points in `test.except` are left out. If a point of `test.of` or the point `test.is` has no measured
/// record, the result line says so. Each ratio of another point's time to the time of the point `test.is` gets a
/// verdict, and these verdicts decide the whole test. The result line shows one ratio: the smallest of those that have
/// the same verdict as the whole test. If all ratios are large enough, but the measurement of some point was not
/// completed, the test is unclear, since that point may be the fastest.
fn fastest(data: &ClaimData<'_>, test: &FastestTest) -> Line {
    let best = match data.measured(&test.is) {
        Ok(best) => best,
        Err(line) => return line,
    };
    // Every point must have a measured record; a point that names several local sizes (`best`, `square`) needs
    // only one such record.
    if let Some(missing) = test.of.iter().find_map(|point| data.measured(point).err()) {
        return missing;
    }
    let left_out =
        |record: &Record| test.except.iter().chain([&test.is]).any(|point| point.is(record, data.device));
    let others = test.of.iter().flat_map(|point| data.records(point)).filter(|record| !left_out(record));
    let others: Vec<&Record> = others.collect();
    let ratios: Vec<(&Record, Ratio)> =
        others.iter().filter_map(|other| Some((*other, Ratio::of(other, best)?))).collect();
    let verdict = |(_, ratio): &&(&Record, Ratio)| ratio.verdict(&(test.by..=f64::INFINITY));
    let whole = Verdict::of_all(ratios.iter().map(|one| verdict(&one)));
    let deciding = ratios.iter().filter(|one| verdict(one) == whole);
    let (untimed, decides) =
        (without_time(&others), "a complete measurement of the points that have no time");
    let Some((other, ratio)) = deciding.min_by(|a, b| a.1.middle().total_cmp(&b.1.middle())) else {
        let compared = format!("point to compare with {}{}", test.is, exceptions(data, test));
        let Some(untimed) = untimed else { return data.missing(&format!("a {compared}")) };
        let text = format!(
            "{} cannot be compared, because no other point{} has a time; without a time: {untimed}",
            test.is,
            exceptions(data, test)
        );
        return Line { data: Data::Incomplete, ..Line::unclear(text, data.complete(decides)) };
    };
    let part = match ratios.len() {
        1 => "the only other one".to_owned(),
        several => format!("the decisive one of {several} others"),
    };
    let name = format!("{}, {part},", side(&test.is, other));
    let line = ratio.line(ratio.between(&name, &side(&test.is, best)), test.by..=f64::INFINITY);
    match untimed {
        Some(untimed) if line.verdict == Verdict::Held => {
            Line::unclear(format!("{}; without a time: {untimed}", line.text), data.complete(decides))
        }
        _ => line,
    }
}

/// Names the points that a test leaves out although they have records: " (left out: naive at 8 x 8 on teapot)".
/// Returns an empty text if the test leaves out no points with records.
fn exceptions(data: &ClaimData<'_>, test: &FastestTest) -> String {
    let recorded = test.except.iter().filter(|point| !data.records(point).is_empty());
    let names: Vec<String> = recorded.map(ToString::to_string).collect();
    if names.is_empty() { String::new() } else { format!(" (left out: {})", names.join(", ")) }
}

/// Returns the name of the first record whose measurement was not completed, and the number of further
/// records whose measurement was not completed: "naive at 6 x 6 (crashed) and 5 more". Returns `None` if all
/// measurements were completed.
fn without_time(records: &[&Record]) -> Option<String> {
    let mut untimed = records.iter().filter(|record| is_incomplete(record));
    let first = untimed.next()?;
    let more = match untimed.count() {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    Some(format!("{} ({}){more}", title(first), first.outcome.name()))
}

fn passes(data: &ClaimData<'_>, point: &Point, (of, to): (Pass, Pass), at_least: f64) -> Line {
    let record = match data.measured(point) {
        Ok(record) => record,
        Err(line) => return line,
    };
    let samples = data.samples(record);
    let times: Vec<(u32, [f64; 2])> = samples
        .iter()
        .filter(|one| has(record, one))
        .filter_map(|one| Some((one.launch, [ms(one, of)?, ms(one, to)?])))
        .collect();
    let Some(ratio) = Ratio::of_passes(record, &times) else {
        let text = format!("no sample of {point} with separate times of its passes");
        return Line::cannot(text, "the file samples.jsonl next to the records".to_owned());
    };
    let [of, to] = [of, to].map(|pass| format!("the {pass:?} pass").to_lowercase());
    let text = format!("{}: {}", at_size(&point.to_string(), record.image_size), ratio.between(&of, &to));
    ratio.line(text, at_least..=f64::INFINITY)
}

/// Returns true if a sample is one of a record's samples. `samples.jsonl` also contains samples that the record leaves
/// out, such as samples of an incomplete launch and samples that another program probably delayed. A record of an
/// earlier version of raycl may not state the launches of its samples, or when the samples were measured. Properties
/// that the record or the sample does not state are not compared.
fn has(record: &Record, sample: &Sample) -> bool {
    let is_same = |(index, ms): (usize, &f64)| {
        let (launch, at_ms) = (record.sample_launches.get(index), record.samples_at_ms.get(index));
        *ms == sample.ms
            && launch.is_none_or(|launch| *launch == sample.launch)
            && at_ms.zip(sample.at_ms).is_none_or(|(own, other)| *own == other)
    };
    record.samples_ms.iter().enumerate().any(is_same)
}

/// Returns the time of a sample's primary or shadow pass in milliseconds; `None` if this pass was not timed
/// separately.
fn ms(sample: &Sample, pass: Pass) -> Option<f64> {
    match pass {
        Pass::Primary => sample.primary_ms,
        Pass::Shadow => sample.shadow_ms,
    }
}

fn fits_in(preset: &Preset, size: LocalSize, triangles: usize, local_bytes: u64, wanted: bool) -> Line {
    let Some(strategy) = preset.strategy() else { return Line::cannot(preset.0.clone(), String::new()) };
    let workload = Workload {
        triangles,
        positions: triangles,
        normals: triangles,
        materials: 1,
        lights: 1,
        image_size: crate::report::view::PAPER_SIZE,
        local_size: size.0,
        ..Workload::default()
    };
    let needed = Requirements::of(&strategy, &workload, LaneOperations::default()).local_bytes;
    let (sign, fits) = if needed <= local_bytes { ("<=", true) } else { (">", false) };
    let text = format!(
        "by arithmetic, {} at {} with {triangles} triangles needs {needed} B of __local memory {sign} {local_bytes} B",
        preset.0,
        by(size.0)
    );
    Line::decided(text, fits == wanted)
}

fn holds(capability: &str, registers: u32, size: LocalSize, threads: u64) -> Line {
    let Ok(sm) = multiprocessor(capability) else {
        return Line::cannot(capability.to_owned(), String::new());
    };
    let occupancy = occupancy(sm, registers, 0, size.0[0] * size.0[1]);
    let text = format!(
        "by arithmetic, {} threads are resident with blocks of {} and {registers} registers per thread ({}); published {threads}",
        occupancy.threads,
        by(size.0),
        occupancy.limiter.words()
    );
    Line::decided(text, occupancy.threads == threads)
}

fn latency(data: &ClaimData<'_>, memory: Memory, cycles: f64, within: f64) -> Line {
    let name = format!("{memory:?} memory").to_lowercase();
    if data.is_cpu() && memory != Memory::Private {
        let text = format!(
            "a CPU has no separate {name}: all address spaces of OpenCL are in main memory and its caches"
        );
        return Line::cannot(text, "a GPU".to_owned());
    }
    let peak = match data.peak(&format!("the latency of {name}")) {
        Ok(peak) => peak,
        Err(line) => return line,
    };
    let figure = match memory {
        Memory::Private => peak.private_ns,
        Memory::Local => peak.local_ns,
        Memory::Global => peak.global_ns,
    };
    let Some([low, middle, high]) = in_cycles(&peak, &figure) else {
        return Line::cannot(
            "the driver does not report the clock frequency".to_owned(),
            "the clock frequency in MHz".to_owned(),
        );
    };
    let text = format!(
        "{name}: {} cycles at {} MHz, {} ns (n = {}); published {cycles}",
        significant(middle, 3),
        peak.max_clock_mhz.unwrap_or(0),
        significant(figure.median, 3),
        figure.repeats
    );
    let (least, most) = (cycles / within, cycles * within);
    match (low >= least && high <= most, high < least || low > most) {
        (true, _) => Line::decided(text, true),
        (_, true) => Line::decided(text, false),
        _ => Line::unclear(
            text,
            format!(
                "a latency whose quartiles are closer together: delete the run's file peak.json, then `{}`",
                data.run.completion("")
            ),
        ),
    }
}

/// Returns the first quartile, the median and the third quartile of a latency in cycles; `None` if
/// the clock frequency is unknown.
fn in_cycles(peak: &Peak, figure: &Figure) -> Option<[f64; 3]> {
    let per_ns = peak.cycles(&Figure { median: 1.0, ..*figure })?;
    Some([figure.q1, figure.median, figure.q3].map(|ns| ns * per_ns))
}
