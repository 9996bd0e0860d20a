//! What the claims are tested on, and the tests.

use super::Verdict;
use super::sure::{Fastest, Ratio};
use crate::record::{Group, Outcome, Record, by, duration, median, not_enough};

/// What was measured on one device, and how to find it.
pub(super) struct Found<'a> {
    pub(super) groups: &'a [Group<'a>],
    pub(super) device: &'a str,
}

/// What a test says: our values in words, and the verdict.
pub(super) type Finding = (String, Verdict);

pub(super) fn nothing() -> Finding {
    ("nothing measured that could tell".to_owned(), Verdict::Untested)
}

/// Two findings as one: it holds if both do.
pub(super) fn both((one, a): Finding, (other, b): Finding) -> Finding {
    let verdict = match (a, b) {
        (Verdict::Held, Verdict::Held) => Verdict::Held,
        (Verdict::DidNotHold, _) | (_, Verdict::DidNotHold) => Verdict::DidNotHold,
        (Verdict::Untested, Verdict::Untested) => Verdict::Untested,
        _ => Verdict::Unclear,
    };
    (format!("{one}; {other}"), verdict)
}

impl<'a> Found<'a> {
    fn group(&self, scene: &str) -> Option<&'a Group<'a>> {
        self.groups.iter().find(|group| group.scene == scene && group.device == self.device)
    }

    fn records(&self, scene: &str, preset: &str) -> Vec<&'a Record> {
        let records = self.group(scene).map(|group| group.records.as_slice()).unwrap_or_default();
        records.iter().copied().filter(|record| record.preset.as_deref() == Some(preset)).collect()
    }

    fn at(&self, scene: &str, (preset, size): (&str, [u32; 2])) -> Option<&'a Record> {
        let records = self.records(scene, preset);
        records.into_iter().find(|record| record.local_size == Some(size) && median(record).is_some())
    }

    fn best(&self, scene: &str, preset: &str) -> Option<&'a Record> {
        self.group(scene)?.best_where(|record| record.preset.as_deref() == Some(preset))
    }

    /// Whether the first is surely faster than the second.
    pub(super) fn faster(&self, scene: &str, fast: (&str, [u32; 2]), slow: (&str, [u32; 2])) -> Finding {
        match (self.at(scene, fast), self.at(scene, slow)) {
            (Some(fast), Some(slow)) => compare(fast, slow),
            _ => nothing(),
        }
    }

    pub(super) fn faster_best(&self, scene: &str, fast: &str, slow: &str) -> Finding {
        match (self.best(scene, fast), self.best(scene, slow)) {
            (Some(fast), Some(slow)) => compare(fast, slow),
            _ => nothing(),
        }
    }

    /// Whether one takes at least `factor` times as long as the other.
    pub(super) fn at_least(
        &self,
        scene: &str,
        slow: (&str, [u32; 2]),
        fast: (&str, [u32; 2]),
        factor: f64,
    ) -> Finding {
        let (Some(slow), Some(fast)) = (self.at(scene, slow), self.at(scene, fast)) else { return nothing() };
        let Some(ratio) = Ratio::of(slow, fast) else { return nothing() };
        let text = format!(
            "{} to {} on the {scene}: {}; the claim asks for {factor} times",
            time(slow),
            time(fast),
            ratio.text("")
        );
        (text, ratio.verdict(factor..=f64::INFINITY))
    }

    /// Whether none of these points fit.
    pub(super) fn infeasible(&self, scene: &str, preset: &str, size: Option<[u32; 2]>) -> Finding {
        let records = self.records(scene, preset);
        let mut asked =
            records.into_iter().filter(|record| size.is_none() || record.local_size == size).peekable();
        if asked.peek().is_none() {
            return nothing();
        }
        let asked: Vec<_> = asked.collect();
        match asked.iter().find(|record| record.outcome != Outcome::Infeasible) {
            None => (asked[0].reason.clone().unwrap_or_default(), Verdict::Held),
            Some(ran) => (format!("{}: {}", what(ran), outcome(ran)), Verdict::DidNotHold),
        }
    }
}

fn time(record: &Record) -> String {
    median(record).map_or("-".to_owned(), duration)
}

fn what(record: &Record) -> String {
    format!("{} at {}", record.name, record.local_size.map_or("-".into(), by))
}

fn outcome(record: &Record) -> String {
    if record.outcome == Outcome::Measured { time(record) } else { record.outcome.name().to_owned() }
}

/// Surely faster: the intervals are apart.
fn compare(fast: &Record, slow: &Record) -> Finding {
    let Some(ratio) = Ratio::of(slow, fast) else { return nothing() };
    let times = format!("{} {}, {} {}", what(fast), time(fast), what(slow), time(slow));
    (format!("{times}: {}", ratio.text(" as fast")), ratio.verdict_slower())
}

/// ", 12.3 ms": the best one's time.
fn best_time(fastest: &Fastest<'_>) -> String {
    fastest.level.first().map_or(String::new(), |best| format!(", {}", time(best)))
}

fn size(record: &Record) -> String {
    record.local_size.map_or(String::new(), by)
}

/// Whether a scene's best naive block is this one: among the square ones, and up to ties.
pub(super) fn best_block(found: &Found<'_>, scene: &str, block: u32) -> Finding {
    let square =
        |record: &&Record| record.local_size.is_some_and(|[x, y]| x == y) && median(record).is_some();
    let records: Vec<_> = found.records(scene, "naive").into_iter().filter(square).collect();
    let Some(fastest) = Fastest::of(&records).filter(|_| records.len() > 2) else { return nothing() };
    let verdict = fastest.verdict(|record| record.local_size == Some([block; 2]));
    (format!("{scene}: {}{}", fastest.text(size), best_time(&fastest)), verdict)
}

pub(super) fn small_scenes(found: &Found<'_>) -> Finding {
    let (Some(one), Some(six)) = (found.best("triangle", "naive"), found.best("pyramid-upper", "naive"))
    else {
        return nothing();
    };
    let Some(ratio) = Ratio::of(six, one) else { return nothing() };
    let text = format!(
        "triangle {}, pyramid {}: {}; the claim allows 0.8 to 1.25 times",
        time(one),
        time(six),
        ratio.text("")
    );
    (text, ratio.verdict(0.8..=1.25))
}

pub(super) fn fastest_of_figure_8(found: &Found<'_>) -> Finding {
    let presets = ["naive", "local-vectors", "local-triangles"];
    let records: Vec<_> = presets.iter().flat_map(|preset| found.records("still-life", preset)).collect();
    let tried = presets.iter().filter(|preset| found.best("still-life", preset).is_some()).count();
    let Some(fastest) = Fastest::of(&records).filter(|_| tried > 1) else { return nothing() };
    let claimed = |record: &Record| {
        record.preset.as_deref() == Some("local-vectors") && record.local_size == Some([8, 8])
    };
    let text = format!("of the paper's three kernels {}{}", fastest.text(what), best_time(&fastest));
    (text, fastest.verdict(claimed))
}

/// What became of the points that `wanted` picks: the first that was measured, else the first that was refused.
fn ran(found: &Found<'_>, wanted: &dyn Fn(&Record) -> bool) -> Option<Finding> {
    let records =
        found.groups.iter().filter(|group| group.device == found.device).flat_map(|group| &group.records);
    let asked: Vec<_> = records.copied().filter(|record| wanted(record)).collect();
    let measured = asked.iter().find(|record| median(record).is_some());
    match (measured, asked.first()) {
        (Some(one), _) => {
            Some((format!("{} on {} runs: {}", what(one), one.scene, time(one)), Verdict::DidNotHold))
        }
        (None, Some(one)) => {
            Some((format!("{}: {}", what(one), crate::report::words::first_line(one)), Verdict::Held))
        }
        (None, None) => None,
    }
}

pub(super) fn compounded(found: &Found<'_>) -> Finding {
    ran(found, &|record| record.preset.as_deref() == Some("compounded")).unwrap_or_else(nothing)
}

pub(super) fn private_vectors(found: &Found<'_>) -> Finding {
    let private = |record: &Record| record.axis("vectors") == Some("private");
    let whole = ran(found, &|record| record.preset.as_deref() == Some("private"));
    whole.or_else(|| ran(found, &private)).unwrap_or_else(nothing)
}

/// 64 work-items as 64 x 1, 32 x 2 and 8 x 8, on every scene that has them.
pub(super) fn shape_matters(found: &Found<'_>) -> Finding {
    let scenes = ["teapot", "gourd", "still-life"].into_iter().filter_map(|scene| shapes_on(found, scene));
    let (text, verdict) = scenes.reduce(both).unwrap_or_else(nothing);
    (format!("{text}; the claim allows 1.05 times"), verdict)
}

fn shapes_on(found: &Found<'_>, scene: &str) -> Option<Finding> {
    let shapes = [[8, 8], [32, 2], [64, 1]];
    let records: Vec<_> = shapes.iter().filter_map(|shape| found.at(scene, ("naive", *shape))).collect();
    let by_time =
        |a: &&&Record, b: &&&Record| median(a).unwrap_or(f64::MAX).total_cmp(&median(b).unwrap_or(f64::MAX));
    let (slowest, fastest) = records.iter().max_by(by_time).zip(records.iter().min_by(by_time))?;
    let ratio = Ratio::of(slowest, fastest).filter(|_| records.len() > 1)?;
    let each = records
        .iter()
        .map(|record| format!("{} {}", record.local_size.map_or(String::new(), by), time(record)));
    let each = each.collect::<Vec<_>>().join(", ");
    // The one between them might be slower or faster than both.
    if let Some(few) = records.iter().find_map(|record| not_enough(record)) {
        return Some((format!("{scene}: {each}: {few}"), Verdict::Unclear));
    }
    Some((format!("{scene}: {each}; the slowest takes {}", ratio.text("")), ratio.verdict(0.0..=1.05)))
}

/// Whether the block for which Figure 5's caps predict most threads is the fastest.
pub(super) fn occupancy_ranks(found: &Found<'_>) -> Finding {
    // Whole groups under 8 groups and 1536 threads: the only caps that Figure 5 uses.
    let predicted = |items: u32| 8.min(1536 / items.max(1)) * items;
    let square = |record: &&Record| {
        record.local_size.is_some_and(|[x, y]| x == y && x > 1) && median(record).is_some()
    };
    let records: Vec<_> = found.records("teapot", "naive").into_iter().filter(square).collect();
    let items = |record: &Record| record.local_size.map_or(0, |[x, y]| x * y);
    let most = records.iter().map(|record| predicted(items(record))).max().unwrap_or(0);
    let Some(fastest) = Fastest::of(&records).filter(|_| records.len() > 3) else { return nothing() };
    if fastest.level.is_empty() {
        return (format!("on the teapot {}", fastest.text(size)), Verdict::Unclear);
    }
    let own = fastest
        .level
        .iter()
        .map(|record| predicted(items(record)).to_string())
        .collect::<Vec<_>>()
        .join(", ");
    let text = format!(
        "fastest on the teapot: {}, for which it predicts {own} threads; the most it predicts is {most}",
        fastest.text(size)
    );
    (text, fastest.verdict(|record| predicted(items(record)) == most))
}

pub(super) fn serial(found: &Found<'_>) -> Finding {
    let host =
        found.groups.iter().find(|group| group.device == crate::record::HOST && group.scene == "teapot");
    let serial = host.and_then(|host| host.best_where(|record| record.strategy == "serial-f32"));
    match (serial, found.best("teapot", "naive")) {
        (Some(serial), Some(naive)) => {
            let Some(ratio) = Ratio::of(serial, naive) else { return nothing() };
            let text = format!(
                "teapot, one core: {}; naive at its best {}: {}; the claim asks for twice",
                time(serial),
                time(naive),
                ratio.text(" as fast")
            );
            (text, ratio.verdict(2.0..=f64::INFINITY))
        }
        _ => nothing(),
    }
}

pub(super) fn split_forms(found: &Found<'_>) -> Finding {
    let bests = ["split-vertices", "split-normals"].map(|preset| found.best("teapot", preset));
    match bests {
        [Some(vertices), Some(normals)] => (
            format!(
                "both fit the teapot: {} {}, {} {}",
                what(vertices),
                time(vertices),
                what(normals),
                time(normals)
            ),
            Verdict::Held,
        ),
        [None, None] => found.infeasible("teapot", "split-vertices", None),
        [one, other] => {
            let fits = one.or(other).map_or(String::new(), what);
            (format!("only one fits the teapot: {fits}"), Verdict::Unclear)
        }
    }
}
