//! The paper's claims, each tested on what was measured on one device.
//!
//! Only what does not depend on how fast a device is can be tested: which of two is faster, which block size is best,
//! what fits. The published values are the paper's own device's, which it does not name.

use crate::record::{Group, Outcome, Record, by, duration, interval, median, significant};

/// Whether a claim held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// What was measured agrees.
    Held,
    /// What was measured disagrees.
    DidNotHold,
    /// Too close to tell, or nothing was measured that could tell.
    Open,
}

impl Verdict {
    /// Its class in the page.
    pub fn class(self) -> &'static str {
        match self {
            Self::Held => "held",
            Self::DidNotHold => "failed",
            Self::Open => "open",
        }
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Held => "held on this device",
            Self::DidNotHold => "did not hold on this device",
            Self::Open => "could not be told",
        }
    }
}

/// A claim beside the measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct Claim {
    /// What the paper says.
    pub claim: &'static str,
    /// Its published values.
    pub published: &'static str,
    /// What we measured.
    pub ours: String,
    /// Whether it held.
    pub verdict: Verdict,
    /// Where the paper contradicts itself or arithmetic.
    pub contradiction: &'static str,
}

/// What was measured on one device, and how to find it.
struct Found<'a> {
    groups: &'a [Group<'a>],
    device: &'a str,
}

/// What a test says: our values in words, and the verdict.
type Finding = (String, Verdict);

/// A claim, its published values, its contradiction, and the test.
type Test<'t> = (&'static str, &'static str, &'static str, &'t dyn Fn(&Found<'_>) -> Finding);

/// Every claim, tested on `device`. The groups are that device's and the host's.
pub fn claims(groups: &[Group<'_>], device: &str) -> Vec<Claim> {
    let found = Found { groups, device };
    let tests: [Test<'_>; 16] = [
        (
            "On the large scenes the naive kernel has one best block size.",
            "8 x 8 on teapot (10.4 s) and gourd (8.5 s)",
            "The text says 4 x 4; its own plots have their least value at 8 x 8.",
            &|f| both(best_block(f, "teapot", 8), best_block(f, "gourd", 8)),
        ),
        (
            "On the small scenes 4 x 4 is best.",
            "921 ms (triangle) and 1016 ms (pyramid), both at 4 x 4",
            "The text gives 4 x 4 for all scenes; it is so in the plots of the small ones only.",
            &|f| both(best_block(f, "triangle", 4), best_block(f, "pyramid-upper", 4)),
        ),
        (
            "From 1 x 1 to 4 x 4 the time falls many times over, since one work-item leaves the other lanes of its warp idle.",
            "10.8-fold on the teapot: 163 s to 15.1 s",
            "The text says that the time rises from 1 x 1 to 4 x 4; its plot has it fall.",
            &|f| f.at_least("teapot", ("naive", [1, 1]), ("naive", [4, 4]), 5.0),
        ),
        (
            "On small scenes the triangles hardly matter: one triangle and six take about as long.",
            "921 and 1016 ms: a tenth apart",
            "",
            &small_scenes,
        ),
        (
            "Optimisation 1, working vectors in local memory, is faster than naive at 8 x 8.",
            "1133 against 1738 ms: 1.53 times as fast",
            "",
            &|f| f.faster("still-life", ("local-vectors", [8, 8]), ("naive", [8, 8])),
        ),
        (
            "Optimisation 1 at 8 x 8 is the fastest of all.",
            "1133 ms, the least value in Figure 8",
            "",
            &fastest_of_figure_8,
        ),
        (
            "Optimisation 2, triangles in local memory, loses on small work-groups, because each of them copies the whole scene.",
            "at 4 x 4: 6424 against 2230 ms, 2.9 times as slow",
            "From 10 x 10 on its own plot has optimisation 2 level with naive or ahead of it (1701 against 2117 ms at 12 x 12).",
            &|f| f.faster("still-life", ("naive", [4, 4]), ("local-triangles", [4, 4])),
        ),
        (
            "Optimisation 2 cannot hold the large scenes.",
            "472 triangles of 104 B in 48 KiB; teapot 1026, gourd 650",
            "Indexed 16-bit storage (gourd 15.7 KB, teapot 31 KB) fits 48 KB: the paper's own next step removes this failure.",
            &|f| f.infeasible("teapot", "local-triangles", None),
        ),
        (
            "The two optimisations could not be compounded.",
            "the launch failed",
            "By arithmetic 206 triangles still fit beside the vectors of 16 x 16 work-items in 48 KiB.",
            &compounded,
        ),
        (
            "Working vectors in statically allocated (private) arrays fail to launch.",
            "failed to launch",
            "",
            &private_vectors,
        ),
        (
            "32 x 32 work-items cannot run optimisation 1, and so were left out.",
            "left out; 108 B x 1024 = 110,592 B",
            "Figure 5 nevertheless predicts 1024 threads at 32 x 32; with its 63 registers (64,512 of 32,768) not even the naive kernel launches there.",
            &|f| f.infeasible("still-life", "local-vectors", Some([32, 32])),
        ),
        (
            "Spatial locality of threads does not matter, and divergence little: only the number of work-items counts.",
            "no values",
            "",
            &shape_matters,
        ),
        (
            "Predicted occupancy says which block size is best (Figure 5).",
            "1536 threads at 16 x 16",
            "With 63 registers compute capability 2.0 holds 512 threads at 16 x 16, not 1536; the prediction leaves registers out.",
            &occupancy_ranks,
        ),
        (
            "A serial baseline would be far slower.",
            "promised, never reported",
            "The paper gives no serial time, so its speed-ups have no base.",
            &serial,
        ),
        ("Next step: a rasteriser is faster than casting.", "not done", "", &|f| {
            f.faster_best("teapot", "raster", "naive")
        }),
        (
            "Next step: one of the OBJ's two sets in local memory lets the large scenes run from it.",
            "not done",
            "",
            &split_forms,
        ),
    ];
    let claim = |(claim, published, contradiction, test): Test<'_>| {
        let (ours, verdict) = test(&found);
        Claim { claim, published, ours, verdict, contradiction }
    };
    tests.into_iter().map(claim).collect()
}

/// Contradictions that no measurement is needed for.
pub const OTHER_CONTRADICTIONS: [&str; 4] = [
    "The text lists five scenes; Figure 6's legend has four.",
    "Figures 6 to 8 have no point at 14 x 14, though the text names the size.",
    "There are no repeats, no error bars and no device name, so none of its differences can be called significant.",
    "Figure 3's caption puts the lower light at (2, 0, 0); the picture is lit from (3, 0.95, -1.5).",
];

fn nothing() -> Finding {
    ("nothing measured that could tell".to_owned(), Verdict::Open)
}

/// Two findings as one: it holds if both do.
fn both((one, a): Finding, (other, b): Finding) -> Finding {
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
    fn faster(&self, scene: &str, fast: (&str, [u32; 2]), slow: (&str, [u32; 2])) -> Finding {
        match (self.at(scene, fast), self.at(scene, slow)) {
            (Some(fast), Some(slow)) => compare(fast, slow),
            _ => nothing(),
        }
    }

    fn faster_best(&self, scene: &str, fast: &str, slow: &str) -> Finding {
        match (self.best(scene, fast), self.best(scene, slow)) {
            (Some(fast), Some(slow)) => compare(fast, slow),
            _ => nothing(),
        }
    }

    /// Whether one takes at least `factor` times as long as the other.
    fn at_least(&self, scene: &str, slow: (&str, [u32; 2]), fast: (&str, [u32; 2]), factor: f64) -> Finding {
        let (Some(slow), Some(fast)) = (self.at(scene, slow), self.at(scene, fast)) else { return nothing() };
        let ratio = median(slow).unwrap_or_default() / median(fast).unwrap_or(1.0);
        let verdict = if ratio >= factor { Verdict::Held } else { Verdict::DidNotHold };
        (format!("{} to {}: {}-fold on the {scene}", time(slow), time(fast), significant(ratio, 3)), verdict)
    }

    /// Whether none of these points fit.
    fn infeasible(&self, scene: &str, preset: &str, size: Option<[u32; 2]>) -> Finding {
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
fn best_block(found: &Found<'_>, scene: &str, block: u32) -> Finding {
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

fn small_scenes(found: &Found<'_>) -> Finding {
    let (Some(one), Some(six)) = (found.best("triangle", "naive"), found.best("pyramid-upper", "naive"))
    else {
        return nothing();
    };
    let ratio = median(six).unwrap_or_default() / median(one).unwrap_or(1.0);
    let verdict = if (0.8..=1.25).contains(&ratio) { Verdict::Held } else { Verdict::DidNotHold };
    (format!("triangle {}, pyramid {}: {} times", time(one), time(six), significant(ratio, 3)), verdict)
}

fn fastest_of_figure_8(found: &Found<'_>) -> Finding {
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
            Some((format!("{}: {}", what(one), super::words::first_line(one)), Verdict::Held))
        }
        (None, None) => None,
    }
}

fn compounded(found: &Found<'_>) -> Finding {
    ran(found, &|record| record.preset.as_deref() == Some("compounded")).unwrap_or_else(nothing)
}

fn private_vectors(found: &Found<'_>) -> Finding {
    let private = |record: &Record| record.strategy.contains("vectors=private");
    let whole = ran(found, &|record| record.preset.as_deref() == Some("private"));
    whole.or_else(|| ran(found, &private)).unwrap_or_else(nothing)
}

/// 64 work-items as 64 x 1, 32 x 2 and 8 x 8.
fn shape_matters(found: &Found<'_>) -> Finding {
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
fn occupancy_ranks(found: &Found<'_>) -> Finding {
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

fn serial(found: &Found<'_>) -> Finding {
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

fn split_forms(found: &Found<'_>) -> Finding {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::fixtures::{infeasible, measured};
    use crate::record::groups;

    fn verdict(records: &[Record], claim: &str) -> Verdict {
        let claims = claims(&groups(records), "gpu");
        claims.iter().find(|one| one.claim.contains(claim)).map_or(Verdict::Open, |one| one.verdict)
    }

    #[test]
    fn the_paper_can_hold_fail_and_stay_open() {
        let records = [
            measured("gpu", "naive", 1, [99.0, 101.0]),
            measured("gpu", "naive", 4, [9.0, 11.0]),
            measured("gpu", "naive", 8, [5.0, 6.0]),
            infeasible("gpu", "local-triangles", 8, "__local memory: scene 104 B x 1026"),
        ];
        assert_eq!(verdict(&records, "1 x 1 to 4 x 4"), Verdict::Held);
        assert_eq!(verdict(&records, "cannot hold the large"), Verdict::Held);
        assert_eq!(verdict(&records, "rasteriser"), Verdict::Open);
        let slower = [measured("gpu", "naive", 1, [1.0, 1.1]), measured("gpu", "naive", 4, [9.0, 11.0])];
        assert_eq!(verdict(&slower, "1 x 1 to 4 x 4"), Verdict::DidNotHold);
    }

    #[test]
    fn a_tie_is_no_verdict() {
        let tie = [
            measured("gpu", "naive", 4, [9.0, 11.0]),
            measured("gpu", "naive", 8, [9.5, 11.5]),
            measured("gpu", "naive", 16, [19.5, 21.5]),
        ];
        let (text, verdict) = best_block(&Found { groups: &groups(&tie), device: "gpu" }, "teapot", 8);
        assert_eq!(verdict, Verdict::Open);
        assert!(text.contains("tie"), "{text}");
    }
}
