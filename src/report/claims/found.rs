//! What the claims are tested on, and the tests.

use super::Verdict;
use crate::record::{Group, Outcome, Record, by, duration, interval, median, significant};

/// What was measured on one device, and how to find it.
pub(super) struct Found<'a> {
    pub(super) groups: &'a [Group<'a>],
    pub(super) device: &'a str,
}

/// What a test says: our values in words, and the verdict.
pub(super) type Finding = (String, Verdict);

fn nothing() -> Finding {
    ("nothing measured that could tell".to_owned(), Verdict::Open)
}

/// Two findings as one: it holds if both do.
pub(super) fn both((one, a): Finding, (other, b): Finding) -> Finding {
    let verdict = match (a, b) {
        (Verdict::Held, Verdict::Held) => Verdict::Held,
        (Verdict::DidNotHold, _) | (_, Verdict::DidNotHold) => Verdict::DidNotHold,
        _ => Verdict::Open,
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
        let ratio = median(slow).unwrap_or_default() / median(fast).unwrap_or(1.0);
        let verdict = if ratio >= factor { Verdict::Held } else { Verdict::DidNotHold };
        (format!("{} to {}: {}-fold on the {scene}", time(slow), time(fast), significant(ratio, 3)), verdict)
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

/// With fewer samples than these an interval says little, and a difference of less than a tenth nothing.
const FEW: usize = 5;

/// Surely faster: the intervals are apart.
fn compare(fast: &Record, slow: &Record) -> Finding {
    let (Some([_, fast_high]), Some([slow_low, _])) = (interval(fast), interval(slow)) else {
        return nothing();
    };
    let (Some([fast_low, _]), Some([_, slow_high])) = (interval(fast), interval(slow)) else {
        return nothing();
    };
    let verdict = match () {
        () if fast_high < slow_low => Verdict::Held,
        () if slow_high < fast_low => Verdict::DidNotHold,
        () => Verdict::Open,
    };
    let ratio = median(slow).unwrap_or_default() / median(fast).unwrap_or(1.0);
    let n = fast.samples_ms.len().min(slow.samples_ms.len());
    let few = n < FEW && (0.9..1.1).contains(&ratio);
    let verdict = if few { Verdict::Open } else { verdict };
    let tie = match verdict {
        _ if few => format!(", too close for n = {n}"),
        Verdict::Open => ", a tie: their intervals overlap".to_owned(),
        _ if n < FEW => format!(" (n = {n})"),
        _ => String::new(),
    };
    let text = format!(
        "{} {}, {} {}: {} times as fast{tie}",
        what(fast),
        time(fast),
        what(slow),
        time(slow),
        significant(ratio, 3)
    );
    (text, verdict)
}

/// Whether a scene's best naive block is this one: among the square ones, and up to ties.
pub(super) fn best_block(found: &Found<'_>, scene: &str, block: u32) -> Finding {
    let square =
        |record: &&Record| record.local_size.is_some_and(|[x, y]| x == y) && median(record).is_some();
    let mut records: Vec<_> = found.records(scene, "naive").into_iter().filter(square).collect();
    records.sort_by(|a, b| median(a).unwrap_or(f64::MAX).total_cmp(&median(b).unwrap_or(f64::MAX)));
    let Some((best, [_, high])) = records.first().and_then(|best| Some((best, interval(best)?))) else {
        return nothing();
    };
    if records.len() < 3 {
        return nothing();
    }
    let tied: Vec<_> =
        records.iter().filter(|record| interval(record).is_some_and(|[low, _]| low <= high)).collect();
    let named = tied.iter().any(|record| record.local_size == Some([block; 2]));
    let mut names: Vec<_> =
        tied.iter().take(4).map(|record| record.local_size.map_or(String::new(), by)).collect();
    if tied.len() > 4 {
        names.push(format!("and {} more", tied.len() - 4));
    }
    let verdict = match (named, tied.len()) {
        (true, 1) => Verdict::Held,
        (true, _) => Verdict::Open,
        (false, _) => Verdict::DidNotHold,
    };
    let tie = if tied.len() > 1 { " (a tie)" } else { "" };
    (format!("{scene}: {}{tie}, {}", names.join(", "), time(best)), verdict)
}

pub(super) fn small_scenes(found: &Found<'_>) -> Finding {
    let (Some(one), Some(six)) = (found.best("triangle", "naive"), found.best("pyramid-upper", "naive"))
    else {
        return nothing();
    };
    let ratio = median(six).unwrap_or_default() / median(one).unwrap_or(1.0);
    let verdict = if (0.8..=1.25).contains(&ratio) { Verdict::Held } else { Verdict::DidNotHold };
    (format!("triangle {}, pyramid {}: {} times", time(one), time(six), significant(ratio, 3)), verdict)
}

pub(super) fn fastest_of_figure_8(found: &Found<'_>) -> Finding {
    let presets = ["naive", "local-vectors", "local-triangles"];
    let bests: Vec<_> = presets.iter().filter_map(|preset| found.best("still-life", preset)).collect();
    let Some(fastest) = bests
        .iter()
        .min_by(|a, b| median(a).unwrap_or(f64::MAX).total_cmp(&median(b).unwrap_or(f64::MAX)))
        .filter(|_| bests.len() > 1)
    else {
        return nothing();
    };
    let claimed = fastest.preset.as_deref() == Some("local-vectors") && fastest.local_size == Some([8, 8]);
    let tied = found.at("still-life", ("local-vectors", [8, 8])).is_some_and(|claimed| {
        interval(claimed).zip(interval(fastest)).is_some_and(|([low, _], [_, high])| low <= high)
    });
    let verdict = match (claimed, tied) {
        (true, _) => Verdict::Held,
        (false, true) => Verdict::Open,
        (false, false) => Verdict::DidNotHold,
    };
    (format!("the least is {}, {}", what(fastest), time(fastest)), verdict)
}

/// Whether some record that says `part` in its strategy ran.
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
    let private = |record: &Record| record.strategy.contains("vectors=private");
    let whole = ran(found, &|record| record.preset.as_deref() == Some("private"));
    whole.or_else(|| ran(found, &private)).unwrap_or_else(nothing)
}

/// 64 work-items as 64 x 1, 32 x 2 and 8 x 8.
pub(super) fn shape_matters(found: &Found<'_>) -> Finding {
    let shapes = [[8, 8], [32, 2], [64, 1]];
    for scene in ["teapot", "gourd", "still-life"] {
        let records: Vec<_> = shapes.iter().filter_map(|shape| found.at(scene, ("naive", *shape))).collect();
        if records.len() < 2 {
            continue;
        }
        let times = records.iter().filter_map(|record| median(record));
        let (low, high) =
            times.fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), t| (low.min(t), high.max(t)));
        let verdict = if high / low < 1.05 { Verdict::Held } else { Verdict::DidNotHold };
        let each: Vec<_> = records
            .iter()
            .map(|record| format!("{} {}", record.local_size.map_or(String::new(), by), time(record)))
            .collect();
        let text = format!(
            "{scene}: {}; the slowest takes {} times the fastest",
            each.join(", "),
            significant(high / low, 3)
        );
        return (text, verdict);
    }
    nothing()
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
    let fastest =
        records.iter().min_by(|a, b| median(a).unwrap_or(f64::MAX).total_cmp(&median(b).unwrap_or(f64::MAX)));
    let Some(fastest) = fastest.filter(|_| records.len() > 3) else { return nothing() };
    let own = predicted(items(fastest));
    let verdict = if own == most { Verdict::Held } else { Verdict::DidNotHold };
    (
        format!(
            "fastest on the teapot: {}, for which it predicts {own} threads; the most it predicts is {most}",
            what(fastest)
        ),
        verdict,
    )
}

pub(super) fn serial(found: &Found<'_>) -> Finding {
    let host =
        found.groups.iter().find(|group| group.device == crate::record::HOST && group.scene == "teapot");
    let serial = host.and_then(|host| host.best_where(|record| record.strategy == "serial-f32"));
    match (serial, found.best("teapot", "naive")) {
        (Some(serial), Some(naive)) => {
            let ratio = median(serial).unwrap_or_default() / median(naive).unwrap_or(1.0);
            let verdict = if ratio > 2.0 { Verdict::Held } else { Verdict::DidNotHold };
            let text = format!(
                "teapot, one core: {}; naive at its best {}: {} times as fast",
                time(serial),
                time(naive),
                significant(ratio, 3)
            );
            (text, verdict)
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
            (format!("only one fits the teapot: {fits}"), Verdict::Open)
        }
    }
}
