//! Finds the four lines of the answer at the top of the page of `raycl reproduce`: the best memory strategy, the best
//! local size, why the strategy is the best, and how certain this answer is.

use super::with_most;
use crate::measure::Ranking;
use crate::memory::readable;
use crate::numbers::{by, duration};
use crate::record::{
    Group, HOST, Record, file_name, first_line, may_be_faster, median, not_enough, percent, ranking,
    smallest_difference_note,
};
use crate::report::claims::{Ratio, Run, completion};
use crate::report::plot::Plot;
use crate::report::plot::scale::Kind;
use crate::report::view;
use crate::report::words::{Looks, at_size};
use crate::strategy::PRESETS;

/// The presets that run the kernel of the student paper that raycl reproduces. The presets differ in the
/// memories that hold the kernel's working vectors and triangles.
const MEMORY: [&str; 7] = [
    "naive",
    "naive-scratch",
    "private",
    "local-vectors",
    "local-triangles",
    "compounded",
    "constant-triangles",
];
/// The bytes that a ray-triangle test reads of a ray: origin and direction, three floats each.
const RAY_BYTES: f64 = 24.0;
/// A point's median is clearly smaller than the median of another point if it is below this fraction of the other
/// median. [`medians_contradict`] ignores smaller differences.
const CLEARLY_SMALLER: f64 = 0.99;
/// The sentence that the page shows after the best local sizes if medians seem to contradict the ranking of
/// points.
const NOT_BY_MEDIANS: &str = "If points were measured together, the fastest is found by ratios of samples taken close together, not by medians, so a slower point can have a smaller median";

/// The four lines of the answer, and plots of the times from which the answer follows.
#[derive(Default)]
pub struct Answer {
    /// The best memory strategy of each scene, with the memories that hold the strategy's vectors and
    /// triangles.
    pub strategy: String,
    /// The best local size for each scene.
    pub size: String,
    /// Why the best strategy is faster than the preset `naive`, or why raycl can give no reason.
    pub why: String,
    /// How certain the answer is.
    pub sure: String,
    /// Plots of time over local size, one for each scene.
    pub plots: Vec<Plot>,
}

impl Answer {
    /// Returns the four lines, each with its heading.
    pub fn lines(&self) -> [(&'static str, &str); 4] {
        [
            ("Best memory strategy", &self.strategy),
            ("Best local size", &self.size),
            ("Why", &self.why),
            ("How sure", &self.sure),
        ]
    }
}

/// The records of one scene for the presets of [`MEMORY`].
struct Contest<'a> {
    group: &'a Group<'a>,
    ranking: Ranking<&'a Record>,
    /// The fastest record of the preset `naive`. The record has no rank only if no record of `naive` has a rank.
    naive: Option<&'a Record>,
}

impl<'a> Contest<'a> {
    fn of(group: &'a Group<'a>) -> Self {
        let takes_part =
            |record: &&Record| record.preset.as_deref().is_some_and(|name| MEMORY.contains(&name));
        let ranking = ranking(group.records.iter().copied().filter(takes_part));
        let naive = ranking.all().into_iter().find(|record| record.is_naive());
        Self { group, ranking, naive }
    }

    fn winner(&self) -> Option<&'a Record> {
        self.ranking.winners.first().copied()
    }

    /// Returns the fastest record, and the fastest record of the preset `naive` that has a rank.
    fn best_and_naive(&self) -> Option<(&'a Record, &'a Record)> {
        self.winner().zip(self.ranking.ranked.iter().copied().find(|record| record.is_naive()))
    }

    /// Returns true if a point of the preset `naive` is the fastest or ties with the fastest.
    fn naive_ties(&self) -> bool {
        self.ranking.winners.iter().any(|record| record.is_naive())
    }

    /// Returns the first record of the preset `naive` that has no time.
    fn failed_naive(&self) -> Option<&'a Record> {
        self.group.failures().into_iter().map(|(record, _)| record).find(|record| record.is_naive())
    }

    /// Ranks the points of the preset `naive`.
    fn naive_ranking(&self) -> Ranking<&'a Record> {
        ranking(self.group.records.iter().copied().filter(|record| record.is_naive()))
    }

    fn triangles(&self) -> u64 {
        self.group.records.iter().filter_map(|record| record.triangles).max().unwrap_or(0)
    }
}

/// Returns the four lines of the page's answer for a device. The answer comes from a run with several memory
/// strategies (presets of [`MEMORY`], which differ in the memories that they use). If no run has several
/// memory strategies, each of the four lines says so. `taken` contains the names of the plots that the page
/// already has for other devices. The plots of the returned answer get names that are not in `taken`, and the
/// function adds these names to `taken`.
pub(super) fn answer(runs: &[Run<'_>], device: &str, suffix: &str, taken: &mut Vec<String>) -> Answer {
    let kinds = |run: &Run<'_>| {
        let contests = run.groups.iter().filter(|group| group.device == device).map(Contest::of);
        contests.map(|contest| names(&contest.ranking.all()).len()).max().unwrap_or(0)
    };
    let Some(run) = with_most(runs, 2, kinds) else { return unknown(runs, device) };
    let own = run.groups.iter().filter(|group| group.device == device && group.device != HOST);
    let mut contests: Vec<Contest<'_>> =
        own.map(Contest::of).filter(|contest| names(&contest.ranking.all()).len() > 1).collect();
    contests.sort_by_key(|contest| std::cmp::Reverse(contest.triangles()));
    let looks = Looks::of(&run.groups);
    let plot = |contest: &Contest<'_>| {
        let mut name = file_name(&format!("answer-{}{suffix}", contest.group.scene));
        while taken.contains(&name) {
            name.push('_');
        }
        taken.push(name.clone());
        view::lines(contest.group, &looks, Kind::Log, &name, false)
    };
    Answer {
        strategy: each(&contests, strategy),
        size: all_sizes(&contests),
        why: why(&contests),
        sure: each(&contests, sure),
        plots: contests.iter().filter_map(plot).collect(),
    }
}

fn unknown(runs: &[Run<'_>], device: &str) -> Answer {
    let remedy = |command: String| format!("; `{command}` measures them");
    let command = completion(runs, device).map_or(String::new(), remedy);
    let line = format!("not known, because no run has times of several memory strategies{command}");
    Answer { strategy: line.clone(), size: line.clone(), why: line.clone(), sure: line, plots: Vec::new() }
}

/// Joins the texts that `say` returns for each scene: "on teapot, ...; on still-life, ...".
fn each(contests: &[Contest<'_>], say: impl Fn(&Contest<'_>) -> String) -> String {
    let line = |contest: &Contest<'_>| {
        let Group { scene, image_size, .. } = contest.group;
        format!("on {}, {}", at_size(scene, *image_size), say(contest))
    };
    let lines = contests.iter().map(line);
    lines.collect::<Vec<_>>().join("; ")
}

const NO_WINNER: &str = "no winner (no point can be ranked)";

/// Returns the strategies' names in the order of the records, each name once.
fn names<'a>(records: &[&'a Record]) -> Vec<&'a str> {
    let mut names: Vec<&str> = Vec::new();
    for record in records {
        if !names.contains(&record.name.as_str()) {
            names.push(&record.name);
        }
    }
    names
}

/// Returns the best strategy with its memories and its time, such as "private (vectors private, triangles global):
/// 1.887 ms". If several strategies tie, returns all tied strategies, each with the local sizes at which it ties, and
/// the time of the fastest strategy. Returns [`NO_WINNER`] if no point can be ranked.
fn strategy(contest: &Contest<'_>) -> String {
    let Some(best) = contest.winner() else { return NO_WINNER.to_owned() };
    let time = median(best).map_or(String::new(), duration);
    let winners = names(&contest.ranking.winners);
    if let [only] = winners[..] {
        return format!("{only} ({}): {time}", homes(only));
    }
    let tied = |name: &&str| {
        let records = contest.ranking.winners.iter().copied().filter(|record| record.name == *name);
        format!("{name} ({}, {})", homes(name), at_sizes(&records.collect::<Vec<_>>()))
    };
    format!("{}, a tie: {time}", winners.iter().map(tied).collect::<Vec<_>>().join(" or "))
}

/// Returns the local sizes of the records: "at 8 x 8 and 16 x 16", or "at 9 local sizes".
fn at_sizes(records: &[&Record]) -> String {
    let mut sizes = view::sizes(records.iter().copied());
    sizes.dedup();
    match sizes.len() {
        0..=3 => format!("at {}", sizes.iter().map(|size| by(*size)).collect::<Vec<_>>().join(" and ")),
        many => format!("at {many} local sizes"),
    }
}

/// Returns the memories that hold a preset's working vectors and triangles: "vectors private, triangles
/// global". Returns an empty text for an unknown preset.
fn homes(name: &str) -> String {
    let Some(preset) = PRESETS.iter().find(|preset| preset.name == name) else { return String::new() };
    let axis = |wanted: &str| {
        preset.strategy.axes().iter().find(|(axis, _)| *axis == wanted).map_or("", |(_, value)| *value)
    };
    // The name `heap` does not say in which memory the heap is, so the text adds "global".
    let vectors = if axis("vectors") == "heap" { "global heap" } else { axis("vectors") };
    format!("vectors {vectors}, triangles {}", axis("triangles"))
}

/// Returns the best local sizes of all scenes. If medians on the page seem to contradict the best local
/// sizes, a sentence says why.
fn all_sizes(contests: &[Contest<'_>]) -> String {
    let sizes = each(contests, size);
    let seems_wrong = |contest: &Contest<'_>| {
        medians_contradict(&contest.ranking) || medians_contradict(&contest.naive_ranking())
    };
    if contests.iter().any(seems_wrong) { format!("{sizes}. {NOT_BY_MEDIANS}") } else { sizes }
}

/// Returns true if medians seem to contradict a ranking. This is so in two cases: a point has a clearly
/// smaller median than the fastest point; or a point that does not tie with the fastest point has a clearly
/// smaller median than a point that ties with it.
fn medians_contradict(ranking: &Ranking<&Record>) -> bool {
    let Some(best) = ranking.winners.first() else { return false };
    let is_below = |record: &Record, other: &Record| {
        median(record).zip(median(other)).is_some_and(|(ms, other_ms)| ms < CLEARLY_SMALLER * other_ms)
    };
    let wins = |record: &Record| ranking.winners.iter().any(|winner| winner.key == record.key);
    let is_below_a_winner = |record: &Record| ranking.winners.iter().any(|winner| is_below(record, winner));
    ranking.ranked.iter().any(|record| is_below(record, best) || (!wins(record) && is_below_a_winner(record)))
}

/// Returns the local size of the fastest point, such as "8 x 8", and the best local size of the kernel of the preset
/// `naive`, if known. If several sizes tie, returns the tied sizes, or their number with the first and the last size.
/// Returns [`NO_WINNER`] if no point can be ranked.
fn size(contest: &Contest<'_>) -> String {
    let best = sizes(&contest.ranking.winners);
    let naive = sizes(&contest.naive_ranking().winners);
    match (best.is_empty(), naive.is_empty()) {
        (true, _) => NO_WINNER.to_owned(),
        (false, true) => best,
        (false, false) => format!("{best} (naive alone: {naive})"),
    }
}

fn sizes(records: &[&Record]) -> String {
    let mut sizes = view::sizes(records.iter().copied());
    sizes.dedup();
    match &sizes[..] {
        [] => String::new(),
        [first, .., last] if sizes.len() > 3 => {
            format!("{} sizes tie, {} to {}", sizes.len(), by(*first), by(*last))
        }
        few => few.iter().map(|size| by(*size)).collect::<Vec<_>>().join(" or "),
    }
}

/// Explains why the best kernel is faster than the kernel of the preset `naive`, for the first scene in which naive
/// does not tie with the fastest kernel. `contests` lists the scene with the most triangles first. If naive ties in all
/// scenes, if naive has no time or no rank, or if no point can be ranked, returns a text that says so.
fn why(contests: &[Contest<'_>]) -> String {
    let known: Vec<&Contest<'_>> =
        contests.iter().filter(|contest| contest.best_and_naive().is_some()).collect();
    if known.is_empty() {
        return why_unknown(contests);
    }
    let explained = known.iter().find(|contest| !contest.naive_ties());
    match explained.and_then(|contest| contest.best_and_naive()) {
        Some((best, naive)) => reason(best, naive),
        None => no_reason(&known, contests.len()),
    }
}

/// Returns a text that says why no kernel can be compared with the kernel of the preset `naive`.
fn why_unknown(contests: &[Contest<'_>]) -> String {
    let won: Vec<&Contest<'_>> = contests.iter().filter(|contest| contest.winner().is_some()).collect();
    if won.is_empty() {
        return NO_WINNER.to_owned();
    }
    let why = match won.iter().find_map(|contest| not_enough(contest.naive?)) {
        Some(why) => format!("cannot be compared: {why}"),
        None => match won.iter().find_map(|contest| contest.failed_naive()) {
            Some(failed) => format!("has no time: {}", first_line(failed)),
            None => "was not measured".to_owned(),
        },
    };
    format!("not known, because naive {why}")
}

/// Explains why the best kernel is faster than the kernel of the preset `naive`: states the memory traffic of
/// the naive kernel, the memory from which the best kernel reads rays, and the properties of both compiled
/// kernels.
fn reason(best: &Record, naive: &Record) -> String {
    let triangles = best.triangles.unwrap_or(0);
    let scene = at_size(&best.scene, best.image_size);
    let moved = readable((best.pixels() * triangles as f64 * RAY_BYTES) as u64);
    format!(
        "naive reads the ray from global memory at each test: for primary rays alone, {moved} per frame on {scene} (calculated, not measured); {} reads the ray from {}; {}",
        best.name,
        memory_of_vectors(best),
        against(&best.name, &facts(best), &facts(naive))
    )
}

/// Returns a text that says that there is no gain to explain, or that no reason can be given, because in each scene of
/// `contests`, the preset `naive` is the fastest or ties with the fastest. If naive ties, the text also states the
/// smallest difference that the samples can show. `all` is the number of scenes in the answer.
fn no_reason(contests: &[&Contest<'_>], all: usize) -> String {
    let is_alone = |contest: &&Contest<'_>| names(&contest.ranking.winners).len() == 1;
    let (alone, ties): (Vec<&Contest<'_>>, Vec<&Contest<'_>>) = contests.iter().copied().partition(is_alone);
    let said = |contests: &[&Contest<'_>], what: &str| {
        (!contests.is_empty()).then(|| format!("{}, naive {what}", places(contests, all)))
    };
    let scenes = [said(&alone, "is the fastest"), said(&ties, "ties for fastest")];
    let scenes = scenes.into_iter().flatten().collect::<Vec<_>>().join("; ");
    if ties.is_empty() {
        return format!("there is no gain to explain: {scenes}");
    }
    let tied = ties.iter().flat_map(|contest| contest.group.records.iter().copied());
    // The page puts a full stop after each line of the answer, so the text has no full stop at its end.
    let limit = smallest_difference_note(tied).map(|note| format!(". {}", note.trim_end_matches('.')));
    format!("no reason can be given: {scenes}{}", limit.unwrap_or_default())
}

/// Names the scenes of `contests`: "on teapot and still-life" or, if the answer has no other scenes, "in both scenes".
/// `all` is the number of scenes in the answer.
fn places(contests: &[&Contest<'_>], all: usize) -> String {
    match contests.len() {
        2 if all == 2 => "in both scenes".to_owned(),
        several if several == all && all > 2 => format!("in all {all} scenes"),
        _ => {
            let scene = |contest: &&Contest<'_>| at_size(contest.group.scene, contest.group.image_size);
            format!("on {}", contests.iter().map(scene).collect::<Vec<_>>().join(" and "))
        }
    }
}

fn memory_of_vectors(record: &Record) -> &'static str {
    let counts = record.main_kernel().and_then(|kernel| kernel.instruction_counts.as_ref());
    match (record.axis("vectors"), counts.map(|counts| counts.reach("local"))) {
        (Some("private"), Some(0)) => "registers",
        (Some("private"), _) => "registers or the stack",
        (Some("local"), _) => "__local memory",
        _ => "global memory as well",
    }
}

/// Returns the known properties of a record's main kernel (the kernel that casts primary rays), as pairs of name and
/// value.
fn facts(record: &Record) -> Vec<(&'static str, String)> {
    let kernel = record.main_kernel();
    let registers = kernel.and_then(|kernel| kernel.resources.registers).map(|count| count.to_string());
    let occupancy = record.main_kernel_of_local_size().and_then(|kernel| kernel.occupancy).map(percent);
    let counts = kernel.and_then(|kernel| kernel.instruction_counts.as_ref());
    let global = counts.map(|counts| counts.reach("global").to_string());
    let facts = [
        ("registers", registers),
        ("occupancy", occupancy),
        ("instructions on global memory", global),
        ("of the device's peak rate of multiply-adds", record.limit_fraction.map(percent)),
    ];
    facts.into_iter().filter_map(|(name, value)| Some((name, value?))).collect()
}

/// Compares the best kernel with the kernel of the preset `naive`: "private: 62 registers (naive: 67), ...".
/// `name` is the name of the best kernel's strategy. The text contains only properties that are known for both
/// kernels. If there are none, the text says that the compiler does not report registers.
fn against(name: &str, best: &[(&str, String)], naive: &[(&str, String)]) -> String {
    let pair = |(fact, value): &(&str, String)| {
        let (_, other) = naive.iter().find(|(known, _)| known == fact)?;
        Some(format!("{value} {fact} (naive: {other})"))
    };
    let pairs: Vec<String> = best.iter().filter_map(pair).collect();
    match pairs.is_empty() {
        true => "the compiler does not report registers".to_owned(),
        false => format!("{name}: {}", pairs.join(", ")),
    }
}

/// Returns a text with the ratio of the best time of the preset `naive` to the best time of all memory strategies.
/// The ratio is left out if `naive` is the fastest or has no time. The text also states the number of points that
/// tie. If some points have no rank, the text states the number of points without a rank, and whether these points
/// may be as fast. Returns [`NO_WINNER`] if no point can be ranked.
fn sure(contest: &Contest<'_>) -> String {
    let Some(best) = contest.winner() else { return NO_WINNER.to_owned() };
    let ratio = contest.naive.filter(|naive| naive.key != best.key).and_then(|naive| Ratio::of(naive, best));
    let ratio = ratio.map_or(String::new(), |ratio| {
        ratio.between("naive at its best local size", "the fastest point") + ", and "
    });
    let (with_rank, doubt) = match may_be_faster(&contest.ranking) {
        true => (" with a rank", ", but a point without a rank may be as fast"),
        false => ("", ""),
    };
    let tie = match contest.ranking.winners.len() {
        1 => format!("no other point{with_rank} ties for fastest{doubt}"),
        several => {
            let (all, slow) = (contest.ranking.ranked.len(), slow_naive(contest));
            format!("{several} of {all} points tie for fastest{slow}{doubt}")
        }
    };
    let unranked = match contest.ranking.unranked.len() {
        0 => String::new(),
        several => format!("; points without a rank: {several}"),
    };
    format!("{ratio}{tie}{unranked}")
}

/// Returns a text that names the points of the preset `naive` that tie for fastest, if `naive` at its best local size
/// does not tie; otherwise an empty text. Such a point is no faster than `naive` at its best local size. The point
/// ties only because the interval of its ratio to the fastest point is wider than the interval for the best local
/// size.
fn slow_naive(contest: &Contest<'_>) -> String {
    let winners = &contest.ranking.winners;
    let best = contest.naive.filter(|naive| winners.iter().all(|winner| winner.key != naive.key));
    let tied: Vec<&Record> = winners.iter().copied().filter(|winner| winner.is_naive()).collect();
    match (best, tied.is_empty()) {
        (Some(_), false) => format!(
            " (among them naive {}, but only because the ratio to the fastest point is less certain there)",
            at_sizes(&tied)
        ),
        _ => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::BELOW_RESOLUTION;
    use crate::program::CompiledKernel;
    use crate::program::compiled::InstructionCounts;
    use crate::record::fixtures::{few, in_memory, infeasible, judged, measured, sampled};
    use crate::record::{Folder, Outcome, groups};

    fn of(records: &[Record]) -> Answer {
        let folder = Folder::default();
        answer(&Run::of(&folder, groups(&judged(records))), "gpu", "", &mut Vec::new())
    }

    #[test]
    fn a_reason_is_given_only_for_a_scene_in_which_naive_does_not_tie() {
        // In one of the two launches, the preset `naive` is faster than the preset `private`; in the other
        // launch, `naive` is slower.
        let mut tie = [measured("gpu", "naive", 8, 2.0), measured("gpu", "private", 8, 1.995)];
        tie[0].samples_ms = [[1.9; 5], [2.1; 5]].concat();
        let answer = of(&tie);
        assert!(answer.sure.ends_with("2 of 2 points tie for fastest"), "{}", answer.sure);
        let none = "no reason can be given: on teapot, naive ties for fastest. Differences below ";
        assert!(
            answer.why.starts_with(none) && answer.why.ends_with(" not detected in these results"),
            "{}",
            answer.why
        );
        let on_gourd = |name: &str, ms| Record {
            key: format!("gourd {name}"),
            scene: "gourd".into(),
            ..measured("gpu", name, 8, ms)
        };
        let answer = of(&[&tie[..], &[on_gourd("naive", 9.0), on_gourd("private", 3.0)]].concat());
        assert!(answer.why.contains("per frame on gourd (calculated"), "{}", answer.why);
    }

    /// At 8 x 8, `naive` is faster than `private` in one launch, and much slower in the other launch.
    #[test]
    fn a_tie_of_naive_at_another_than_its_best_size_is_explained() {
        let varies = Record { samples_ms: [[1.8; 5], [2.9; 5]].concat(), ..measured("gpu", "naive", 8, 1.8) };
        let answer = of(&[measured("gpu", "private", 8, 2.0), measured("gpu", "naive", 4, 2.2), varies]);
        let tie = "as long as the fastest point, and 2 of 3 points tie for fastest (among them naive at 8 x 8, but \
                   only because the ratio to the fastest point is less certain there)";
        assert!(
            answer.sure.contains("naive at its best local size takes 1.10 times (1.0"),
            "{}",
            answer.sure
        );
        assert!(answer.sure.ends_with(tie), "{}", answer.sure);
    }

    #[test]
    fn where_naive_ties_or_wins_in_all_scenes_the_reason_says_so_for_all() {
        let on = |scene: &str, name: &str, ms: f64, spread: f64| Record {
            key: format!("{scene} {name}"),
            scene: scene.into(),
            samples_ms: [[ms - spread; 5], [ms + spread; 5]].concat(),
            ..measured("gpu", name, 8, ms)
        };
        let tie = |scene: &str| [on(scene, "naive", 2.0, 0.1), on(scene, "private", 1.995, 0.0)];
        let win = |scene: &str| [on(scene, "naive", 2.0, 0.0), on(scene, "private", 4.0, 0.0)];
        let differences = ". Differences below ";
        for (scenes, said, detects) in [
            (vec![tie("teapot"), tie("room")], "in both scenes, naive ties for fastest", true),
            (vec![tie("teapot"), tie("room"), tie("gourd")], "in all 3 scenes, naive ties for fastest", true),
            (
                vec![tie("teapot"), win("room")],
                "on room, naive is the fastest; on teapot, naive ties for fastest",
                true,
            ),
            (
                vec![tie("room"), tie("teapot"), win("gourd")],
                "on gourd, naive is the fastest; on room and teapot, naive ties for fastest",
                true,
            ),
            (vec![win("teapot"), win("room")], "in both scenes, naive is the fastest", false),
        ] {
            let why = of(&scenes.concat()).why;
            let start = if detects { "no reason can be given" } else { "there is no gain to explain" };
            let end = if detects { differences } else { "" };
            assert!(why.starts_with(&format!("{start}: {said}{end}")), "{why}");
            assert!(!why.ends_with('.') && why.contains(differences) == detects, "{why}");
        }
    }

    #[test]
    fn each_strategy_of_a_tie_is_named_with_its_memories() {
        let mut tie = [measured("gpu", "naive", 8, 2.0), measured("gpu", "local-triangles", 8, 1.995)];
        tie[0].samples_ms = [[1.9; 5], [2.1; 5]].concat();
        let said = of(&tie).strategy;
        for part in [
            "naive (vectors global heap, triangles global, at 8 x 8)",
            " or ",
            "local-triangles (vectors global heap, triangles local, at 8 x 8)",
            "), a tie: ",
        ] {
            assert!(said.contains(part), "{part:?} is not in {said}");
        }
    }

    /// In most launches of this test, the preset `naive` takes less time than the preset `private`, so the
    /// median of `naive` is smaller. In the last launch, `naive` takes so much longer that `private` is the
    /// best.
    #[test]
    fn medians_that_seem_to_contradict_the_best_size_are_explained() {
        let in_launches = |name: &str, ms: [f64; 3]| {
            sampled(name, (0..15).map(move |index| (index / 5, ms[index as usize / 5])))
        };
        let records = [in_launches("private", [1.2; 3]), in_launches("naive", [1.0, 1.0, 4.0])];
        let answer = of(&records);
        assert!(answer.strategy.starts_with("on teapot, private ("), "{}", answer.strategy);
        assert!(answer.size.ends_with(&format!(". {NOT_BY_MEDIANS}")), "{}", answer.size);
    }

    #[test]
    fn the_scene_with_the_most_triangles_comes_first_and_has_the_reason() {
        let on = |scene: &str, triangles: u64, name: &str, ms| Record {
            key: format!("{scene} {name}"),
            scene: scene.into(),
            triangles: Some(triangles),
            ..measured("gpu", name, 8, ms)
        };
        let scenes = [("room", 40), ("gourd", 5000), ("teapot", 1026)];
        let records = scenes.map(|(scene, triangles)| {
            [on(scene, triangles, "naive", 9.0), on(scene, triangles, "private", 3.0)]
        });
        let answer = of(&records.concat());
        assert!(answer.why.contains("per frame on gourd (calculated"), "{}", answer.why);
        let places = ["on gourd, ", "; on teapot, ", "; on room, "].map(|words| answer.strategy.find(words));
        assert!(places.is_sorted() && places[0] == Some(0), "{}", answer.strategy);
    }

    #[test]
    fn a_page_without_an_answer_names_the_command_that_fills_it() {
        let folder = Folder { path: "out/figure-6".into(), ..Folder::default() };
        let records = judged([measured("gpu", "naive", 4, 9.1)]);
        let answer = answer(&Run::of(&folder, groups(&records)), "gpu", "", &mut Vec::new());
        let words =
            "has times of several memory strategies; `raycl reproduce --out out --resume` measures them";
        assert!(answer.sure.ends_with(words), "{}", answer.sure);
        let crashed = Record { outcome: Outcome::Crashed, ..infeasible("gpu", "private", 4, "why") };
        let again = of(&[measured("gpu", "naive", 4, 9.1), crashed]);
        assert!(again.sure.ends_with(" --resume --retry-failed` measures them"), "{}", again.sure);
    }

    #[test]
    fn the_best_memory_its_size_and_how_sure() {
        let records = [
            measured("gpu", "naive", 4, 9.1),
            measured("gpu", "naive", 8, 10.0),
            Record { triangles: Some(1026), ..measured("gpu", "private", 8, 2.05) },
            measured("gpu", "deferred", 8, 1.05),
        ];
        let answer = of(&records);
        assert!(
            answer.strategy.starts_with("on teapot, private (vectors private, triangles global): 2.05"),
            "{}",
            answer.strategy
        );
        assert_eq!(answer.size, "on teapot, 8 x 8 (naive alone: 4 x 4)");
        assert!(
            answer.why.contains("from global memory at each test: for primary rays alone, 9.8 GB per frame")
                && answer.why.contains("does not report registers"),
            "{}",
            answer.why
        );
        assert!(
            answer.sure.contains(
                "naive at its best local size takes 4.44 times (4.39 to 4.49, n = 10) as long as the fastest point, and no other"
            ),
            "{}",
            answer.sure
        );
        assert_eq!(answer.plots.len(), 1);
    }

    /// A kernel without instructions on `.local` memory has all private arrays in registers.
    #[test]
    fn the_reason_names_the_memory_from_which_the_best_kernel_reads_rays() {
        let why = |vectors: &str, on_local: Option<u32>| {
            let instruction_counts = on_local.map(|count| InstructionCounts {
                instructions: [("ld.local".to_owned(), count), ("ld.global".to_owned(), 7)].into(),
                ..InstructionCounts::default()
            });
            let name = "cast_frame".to_owned();
            let kernel = CompiledKernel { name, instruction_counts, ..CompiledKernel::default() };
            let best = Record { kernels: vec![kernel], ..measured("gpu", "private", 8, 2.0) };
            of(&[in_memory(best, vectors), in_memory(measured("gpu", "naive", 8, 9.0), "heap")]).why
        };
        for (vectors, on_local, memory) in [
            ("private", Some(0), "registers"),
            ("private", Some(3), "registers or the stack"),
            ("private", None, "registers or the stack"),
            ("local", None, "__local memory"),
            ("global", None, "global memory as well"),
        ] {
            let why = why(vectors, on_local);
            assert!(why.contains(&format!("; private reads the ray from {memory}; ")), "{why}");
        }
    }

    #[test]
    fn a_naive_kernel_with_few_samples_has_no_ratio() {
        let answer = of(&[few("gpu", "naive", 4, 9.0, 3), measured("gpu", "private", 8, 2.0)]);
        let words = "naive at its best local size against the fastest point: not enough samples (n = 3), and no other";
        assert!(answer.sure.contains(words), "{}", answer.sure);
    }

    /// A frame of `naive` takes less than a step of the timer, so that some of its times are 0.
    #[test]
    fn a_naive_kernel_that_is_faster_than_the_timer_is_not_said_to_be_slower() {
        let answer = of(&[few("gpu", "naive", 8, 0.0, 30), measured("gpu", "private", 8, 0.5)]);
        assert_eq!(answer.why, format!("not known, because naive cannot be compared: {BELOW_RESOLUTION}"));
        let words = "no other point with a rank ties for fastest, but a point without a rank may be as fast; points \
                     without a rank: 1";
        assert!(answer.sure.ends_with(words), "{}", answer.sure);
    }

    #[test]
    fn few_samples_name_no_best() {
        let answer = of(&[few("gpu", "naive", 4, 9.0, 3), few("gpu", "private", 8, 2.0, 3)]);
        assert_eq!([answer.strategy, answer.size].map(|line| line.contains("no winner")), [true; 2]);
        assert!(of(&[measured("gpu", "naive", 4, 9.1)]).why.contains("not known"));
    }

    #[test]
    fn without_a_time_of_naive_the_winner_stays_and_only_the_reason_is_unknown() {
        let answer = of(&[measured("gpu", "private", 8, 2.0), measured("gpu", "local-vectors", 4, 3.0)]);
        assert!(answer.strategy.starts_with("on teapot, private ("), "{}", answer.strategy);
        assert_eq!(answer.size, "on teapot, 8 x 8");
        assert_eq!(answer.why, "not known, because naive was not measured");
        let failed = of(&[
            measured("gpu", "private", 8, 2.0),
            measured("gpu", "local-vectors", 4, 3.0),
            infeasible("gpu", "naive", 8, "too large\nat 8 x 8"),
        ]);
        assert_eq!(failed.why, "not known, because naive has no time: too large");
        let none = of(&[few("gpu", "private", 8, 2.0, 3), few("gpu", "local-vectors", 4, 3.0, 3)]);
        assert_eq!(none.why, NO_WINNER);
    }

    #[test]
    fn an_answer_is_of_its_device_only() {
        let on = |device: &str, scene: &str, name: &str, ms| Record {
            key: format!("{device} {scene} {name}"),
            scene: scene.into(),
            ..measured(device, name, 8, ms)
        };
        let answer = of(&[
            on("gpu", "teapot", "naive", 10.0),
            on("gpu", "teapot", "private", 2.0),
            on("cpu", "room", "naive", 10.0),
            on("cpu", "room", "private", 2.0),
        ]);
        assert!(
            answer.strategy.contains("on teapot") && !answer.strategy.contains("room"),
            "{}",
            answer.strategy
        );
    }

    #[test]
    fn only_facts_that_are_known_of_both_kernels_are_compared() {
        let kernel = |registers, occupancy| {
            let name = "cast_frame".to_owned();
            let mut kernel = CompiledKernel { name, occupancy, ..CompiledKernel::default() };
            kernel.resources.registers = registers;
            kernel
        };
        let with = |kernel| Record { kernels: vec![kernel], ..measured("gpu", "naive", 8, 3.0) };
        let [best, naive] =
            [kernel(Some(62), Some(0.5)), kernel(Some(67), None)].map(|kernel| facts(&with(kernel)));
        assert_eq!(against("private", &best, &naive), "private: 62 registers (naive: 67)");
        assert_eq!(against("private", &best, &[]), "the compiler does not report registers");
    }
}
