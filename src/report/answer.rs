//! Collects the data of a report's first screen: the winners, how much faster the winners are than other
//! points, how certain this result is, and which points have no time.

use super::merged::Origins;
use super::words::{first_line, series_name, title};
use crate::entry::entry;
use crate::measure::Ranking;
use crate::numbers::{duration, duration_range, significant};
use crate::record::{
    Group, HOST, Record, few_names, interval, launches, may_be_faster, median, not_enough, ratio, word,
};
use crate::words::counted;
use std::collections::HashSet;

/// The result of one group of points, which is one scene at one image size on one device.
#[derive(Clone, Debug)]
pub struct Answer {
    /// The scene's name.
    pub scene: String,
    /// Image size in pixels: across, down.
    pub image_size: [u32; 2],
    /// The device's name.
    pub device: String,
    /// The winners (strategy and local size), the fastest first.
    pub winners: Vec<Winner>,
    /// The text that the page shows if the group has no winner.
    pub nobody: &'static str,
    /// The fastest winner's median as text, such as "1.2 ms"; "-" if the group has no winner.
    pub time: String,
    /// The 95% interval of the fastest winner's median as text; empty if the interval is unknown.
    pub interval: String,
    /// The speed-ups of the group's fastest point over the serial baselines and over the fastest point of the
    /// preset `naive`.
    pub speedups: Vec<Speedup>,
    /// A name such as "the best naive point" if a point of the preset `naive` is among the winners, otherwise `None`.
    /// If another point of the group is the fastest, the best naive point has this name in [`Speedup::over`].
    pub naive_wins: Option<String>,
    /// The certainty of the result in one word: "clear", "tie" or "unsure". Winners that tie are "unsure" if a point
    /// without a rank may be as fast as the winners.
    pub sureness: &'static str,
    /// Sentences on how certain the result is.
    pub sure: String,
    /// The points without a time, with one element per reason.
    pub refused: Vec<Refused>,
}

/// A point that is the fastest of its group, or ties with the fastest point.
#[derive(Clone, Debug, PartialEq)]
pub struct Winner {
    /// The strategy's name.
    pub name: String,
    /// The winner's local size, such as "16×16"; empty if the winner has no local size.
    pub size: String,
    /// The values of all axes of the strategy.
    pub strategy: String,
}

/// The factor by which a group's fastest winner is faster than another point.
#[derive(Clone, Debug, PartialEq)]
pub struct Speedup {
    /// The name of the baseline or point with which the winner is compared.
    pub over: String,
    /// How many times as fast the winner is; `None` if the other point has too few samples, or times of 0.
    pub ratio: Option<f64>,
    /// True if the other point is a baseline.
    pub is_over_baseline: bool,
    /// The factor as text, such as "4.4×"; "?" if the factor is unknown.
    pub factor: String,
    /// The 95% interval of the factor, such as "4.2 to 4.6". If the factor is unknown, the reason, such as
    /// "not enough samples (n = 3)".
    pub range: String,
}

/// Points that have no time for the same reason. The brief reason (`word`) is the same for all of these
/// points; their full reasons may differ.
#[derive(Clone, Debug, PartialEq)]
pub struct Refused {
    /// The reason in brief, such as "local" (too little `__local` memory) or "wrong-image".
    pub word: String,
    /// The number of points without a time whose reason in brief is `word`.
    pub count: usize,
    /// For each strategy, the first of these points, with the first line of its full reason.
    pub examples: Vec<String>,
}

/// Returns one answer per shown group of points ([`is_shown`]). For each point, `origins` tells
/// which baselines were measured on the same machine as the point.
pub fn answers(groups: &[Group<'_>], origins: &Origins<'_>) -> Vec<Answer> {
    let shown = groups.iter().filter(|group| is_shown(group, groups));
    shown.map(|group| answer(group, &origins.baselines(group, groups))).collect()
}

/// Returns true if the page has an answer, plots and a table for a group. Groups of baselines (ray casters on
/// the host) are shown only if there are no other groups.
pub fn is_shown(group: &Group<'_>, groups: &[Group<'_>]) -> bool {
    group.device != HOST || groups.iter().all(|other| other.device == HOST)
}

fn answer(group: &Group<'_>, baselines: &[&Record]) -> Answer {
    let ranking = group.ranking();
    let best = ranking.winners.first().copied();
    let (sureness, sure) = sure(group, &ranking);
    Answer {
        scene: group.scene.to_owned(),
        image_size: group.image_size,
        device: group.device.to_owned(),
        time: best.and_then(median).map_or("-".into(), duration),
        interval: best
            .and_then(|best| Some(duration_range(interval(best)?, median(best)?)))
            .unwrap_or_default(),
        speedups: best.map_or(Vec::new(), |best| speedups(best, group, baselines)),
        naive_wins: group
            .naive()
            .filter(|_| ranking.winners.iter().any(|winner| winner.is_naive()))
            .map(name_of_other),
        sureness,
        sure,
        refused: refused(group),
        nobody: if ranking.unranked.is_empty() { NOTHING } else { "no winner: no point can be ranked" },
        winners: ranking.winners.iter().map(|record| winner(record)).collect(),
    }
}

fn winner(record: &Record) -> Winner {
    let size = record.local_size.map_or(String::new(), |[across, down]| format!("{across}×{down}"));
    Winner { name: record.name.clone(), size, strategy: record.strategy.clone() }
}

fn speedups(best: &Record, group: &Group<'_>, baselines: &[&Record]) -> Vec<Speedup> {
    let serial = baselines.iter().copied().filter(|record| record.strategy.starts_with("serial"));
    let others = serial.chain(group.naive().filter(|naive| naive.key != best.key));
    others.filter_map(|other| speedup(best, other)).collect()
}

/// Returns the text of [`Speedup::over`] for a record: for a baseline its strategy, such as "serial-f32", and
/// for a kernel a text such as "the best naive point".
fn name_of_other(record: &Record) -> String {
    match record.is_baseline() {
        true => record.strategy.clone(),
        false => format!("the best {} point", series_name(record)),
    }
}

fn speedup(best: &Record, other: &Record) -> Option<Speedup> {
    let (over, is_over_baseline) = (name_of_other(other), other.is_baseline());
    let Some(ratio) = ratio(other, best) else {
        let range = not_enough(other)?;
        return Some(Speedup { over, ratio: None, is_over_baseline, factor: "?".into(), range });
    };
    let range = format!("{} to {}", significant(ratio.low, 3), significant(ratio.high, 3));
    let factor = format!("{}×", significant(ratio.middle, 3));
    Some(Speedup { over, ratio: Some(ratio.middle), is_over_baseline, factor, range })
}

/// The largest number of baselines with which the headline compares the winners.
const MOST_BASELINES: usize = 2;

/// The text that the page shows if no point of a group has a time.
const NOTHING: &str = "nothing measured";

/// The word for a result that is not certain (see [`Answer::sureness`]).
const UNSURE: &str = "unsure";

fn sure(group: &Group<'_>, ranking: &Ranking<&Record>) -> (&'static str, String) {
    let unranked = match ranking.unranked.is_empty() {
        true => String::new(),
        false => format!(" Points without a rank: {}.", few_names(&ranking.unranked, title)),
    };
    let Some(best) = ranking.winners.first() else {
        let nothing = if unranked.is_empty() { "Nothing could be measured." } else { "No winner." };
        return (UNSURE, format!("{nothing}{unranked}"));
    };
    let n = best.samples_ms.len();
    let beaten = |record: &&&Record| !ranking.winners.iter().any(|winner| winner.key == record.key);
    let next = ranking.ranked.iter().find(beaten);
    let gap = next.and_then(|next| Some((next, ratio(next, best)?)));
    let behind = gap.map_or(String::new(), |(next, ratio)| {
        let [middle, low, high] = [ratio.middle, ratio.low, ratio.high].map(|part| significant(part, 3));
        format!(
            " The next point, {}, takes {middle} times ({low} to {high}) as long as the fastest point.",
            title(next)
        )
    });
    let rests = format!("n = {n} samples in {}", counted(launches(best), "launch"));
    let look = look(ranking);
    let (sureness, said) = match ranking.winners.len() {
        1 if may_be_faster(ranking) => {
            (UNSURE, "A point without a rank may be as fast as the winner.".to_owned())
        }
        1 => {
            // Points without a time, and points without a rank (with too few samples, or with a time of 0),
            // may be faster than the winner. The result of the group is clear only if a point besides the
            // winner has a rank, or if the group has no other point.
            let (others, is_known) = match (group.records.len(), ranking.ranked.len()) {
                (1, _) => ("There is no other point", true),
                (_, 1) => ("No other point has a rank", false),
                _ => ("Every other point with a rank takes longer", true),
            };
            let sureness = if is_known && look.is_empty() { "clear" } else { UNSURE };
            (sureness, format!("{others}; {rests}.{look}"))
        }
        several => {
            let (sureness, doubt) = match may_be_faster(ranking) {
                true => (UNSURE, "A point without a rank may be as fast as the winners. "),
                false => ("tie", ""),
            };
            let tie = format!(
                "A tie of {several} points: the samples do not show that any of them takes more than 1% longer than the fastest; {rests}.{look}"
            );
            (sureness, format!("{doubt}{tie}"))
        }
    };
    (sureness, format!("{said}{behind}{unranked}"))
}

/// Returns a sentence if a point with a rank was measured in only one launch; otherwise an empty text. The intervals
/// of such a point, and of every ratio to its time, do not include differences between launches.
fn look(ranking: &Ranking<&Record>) -> &'static str {
    let has_one_launch = |record: &&Record| launches(record) < 2;
    if ranking.winners.first().is_some_and(has_one_launch) {
        " There was only one launch, so the result is not conclusive."
    } else if ranking.ranked.iter().any(has_one_launch) {
        " Some of the other points were measured in only one launch, so the result is not conclusive."
    } else {
        ""
    }
}

fn refused(group: &Group<'_>) -> Vec<Refused> {
    let mut refused: Vec<Refused> = Vec::new();
    let mut shown: HashSet<(String, &str)> = HashSet::new();
    for (record, _) in group.failures() {
        let word = word(record);
        let new = || Refused { word: word.clone(), count: 0, examples: Vec::new() };
        let known = entry(&mut refused, |known| known.word == word, new);
        known.count += 1;
        if shown.insert((word, &record.name)) {
            known.examples.push(format!("for example {}: {}", title(record), first_line(record)));
        }
    }
    refused
}

/// Returns a summary of all groups in one sentence: which strategies win in how many groups, how many of these results
/// are not certain, and the winners' speed-ups.
pub fn headline(answers: &[Answer]) -> String {
    let has_time = |answer: &Answer| !answer.winners.is_empty() || answer.nobody != NOTHING;
    if answers.iter().any(has_time) && answers.iter().all(|answer| answer.device == HOST) {
        return "Only baselines were measured".to_owned();
    }
    format!("{}{}{}", who_wins(answers), doubt(answers), gains(answers))
}

/// Returns the part of the summary that says how many of the results are not certain; an empty text if no result is
/// "unsure". A group without a winner has no result.
fn doubt(answers: &[Answer]) -> String {
    let results: Vec<&Answer> = answers.iter().filter(|answer| !answer.winners.is_empty()).collect();
    let unsure = results.iter().filter(|answer| answer.sureness == UNSURE).count();
    match (unsure, results.len()) {
        (0, _) => String::new(),
        (_, 1) => ", which is not certain".to_owned(),
        (unsure, all) if unsure == all => " (no result is certain)".to_owned(),
        (1, all) => format!(" (1 of {all} results is not certain)"),
        (unsure, all) => format!(" ({unsure} of {all} results are not certain)"),
    }
}

/// Returns the second part of the summary, such as "; the winners are 2.61 to 108 times as fast as
/// serial-f32, 1.04 to 7.82 times as fast as the best naive point". If a speed-up is unknown in some groups
/// that have a winner, the text also says in how many of the groups with a winner the speed-up is known, such as
/// "(in 1 of 2 comparisons)". Of the baselines, the text names only the first `MOST_BASELINES`. Returns an
/// empty text if no speed-up is known.
fn gains(answers: &[Answer]) -> String {
    let mut over: Vec<(&Speedup, Vec<f64>)> = Vec::new();
    for speedup in answers.iter().flat_map(counted_speedups) {
        let Some(ratio) = speedup.ratio else { continue };
        entry(&mut over, |(known, _)| known.over == speedup.over, || (speedup, Vec::new())).1.push(ratio);
    }
    let won = answers.iter().filter(|answer| !answer.winners.is_empty()).count();
    let text = |(Speedup { over: name, .. }, ratios): &(&Speedup, Vec<f64>)| {
        let low = significant(ratios.iter().copied().fold(f64::INFINITY, f64::min), 3);
        let high = significant(ratios.iter().copied().fold(0.0, f64::max), 3);
        let range = if low == high { low } else { format!("{low} to {high}") };
        let itself = answers.iter().filter(|answer| answer.naive_wins.as_ref() == Some(name)).count();
        let known = match (ratios.len(), itself) {
            (known, _) if known >= won => String::new(),
            (known, 0) => format!(" (in {known} of {won} comparisons)"),
            (known, itself) => {
                format!(" (in {known} of {won} comparisons; in {itself}, a naive point is among the winners)")
            }
        };
        format!("{range} times as fast as {name}{known}")
    };
    let (baselines, kernels): (Vec<_>, Vec<_>) = over.iter().partition(|(one, _)| one.is_over_baseline);
    let all: Vec<_> = baselines.into_iter().take(MOST_BASELINES).chain(kernels).map(text).collect();
    let mut winners = answers.iter().flat_map(|answer| &answer.winners).map(|winner| winner.name.as_str());
    let first = winners.next();
    let they = if winners.all(|name| Some(name) == first) { "it is" } else { "the winners are" };
    if all.is_empty() { String::new() } else { format!("; {they} {}", all.join(", ")) }
}

/// Returns the speed-ups of an answer that the summary counts. If a point of the preset `naive` is among the winners,
/// the speed-up over the best naive point is left out: the summary names all winners, so it would say that a winner is
/// faster than itself.
fn counted_speedups(answer: &Answer) -> impl Iterator<Item = &Speedup> {
    answer.speedups.iter().filter(|speedup| answer.naive_wins.as_ref() != Some(&speedup.over))
}

/// Returns the first part of the summary: the strategies that win the largest number of groups, and this
/// number.
fn who_wins(answers: &[Answer]) -> String {
    let won = |name: &str| answers.iter().filter(|one| one.winners.iter().any(|w| w.name == name)).count();
    let mut names: Vec<(&str, usize)> = Vec::new();
    for name in answers.iter().flat_map(|one| &one.winners).map(|winner| winner.name.as_str()) {
        if !names.iter().any(|(known, _)| *known == name) {
            names.push((name, won(name)));
        }
    }
    let measured = answers.iter().filter(|one| !one.winners.is_empty()).count();
    let Some(most) = names.iter().map(|(_, count)| *count).max() else {
        let unranked = answers.iter().any(|one| one.nobody != NOTHING);
        let why = if unranked { "No winner: no point can be ranked" } else { "Nothing could be measured" };
        return why.to_owned();
    };
    let best: Vec<_> = names.iter().filter(|(_, count)| *count == most).map(|(name, _)| *name).collect();
    let whom = match best.as_slice() {
        [one] => (*one).to_owned(),
        [first @ .., last] if best.len() <= 4 => format!("{} and {last}", first.join(", ")),
        several => format!("{} strategies", several.len()),
    };
    let verb = if best.len() == 1 { "is" } else { "are each" };
    match (most, measured) {
        (_, 1) if best.len() > 1 => format!("{whom} are the fastest: a tie"),
        (_, 1) => format!("{whom} {verb} the fastest"),
        (2, 2) if best.len() > 1 => format!("In both comparisons, {whom} tie for fastest"),
        (2, 2) => format!("In both comparisons, {whom} {verb} fastest or tied for fastest"),
        (most, all) if most == all && best.len() > 1 => {
            format!("In all {all} comparisons, {whom} tie for fastest")
        }
        (most, all) if most == all => {
            format!("In all {all} comparisons, {whom} {verb} fastest or tied for fastest")
        }
        (most, all) if best.len() > 1 => format!(
            "{whom} {verb} fastest, or tied for fastest, in {most} of {all} comparisons (not necessarily the same ones)"
        ),
        (most, all) => format!("In {most} of {all} comparisons, {whom} {verb} fastest or tied for fastest"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::fixtures::{few, infeasible, judged, measured};
    use crate::record::groups;

    /// Returns the answers for records of a single folder.
    fn answers(groups: &[Group<'_>]) -> Vec<Answer> {
        super::answers(groups, &Origins::of(&[]))
    }

    #[test]
    fn a_tie_is_a_tie_and_speedups_carry_their_range() {
        let records = judged([
            measured("host", "serial-f32", 0, 410.0),
            measured("gpu", "naive", 8, 41.0),
            measured("gpu", "wide", 4, 11.0),
            measured("gpu", "deferred", 8, 11.1),
            infeasible("gpu", "local-vectors", 32, "__local memory: 110592 B > 49152 B"),
            infeasible("gpu", "local-triangles", 4, "__local memory: 106704 B > 49152 B"),
            infeasible("gpu", "local-triangles", 8, "__local memory: 106705 B > 49152 B"),
        ]);
        let groups = groups(&records);
        let answers = answers(&groups);
        let [one] = answers.as_slice() else { panic!("{answers:?}") };
        assert_eq!(one.sureness, "tie");
        assert_eq!(one.winners.iter().map(|w| w.name.as_str()).collect::<Vec<_>>(), ["wide", "deferred"]);
        assert_eq!(one.speedups[0].factor, "37.3×");
        assert_eq!(one.speedups[0].range, "35.2 to 39.5");
        let over: Vec<_> = one.speedups.iter().map(|speedup| speedup.over.as_str()).collect();
        assert_eq!(over, ["serial-f32", "the best naive point"]);
        let [refused] = one.refused.as_slice() else { panic!("{:?}", one.refused) };
        assert_eq!((refused.word.as_str(), refused.count), ("local", 3));
        let examples = [
            "for example local-vectors at 32 x 32: __local memory: 110592 B > 49152 B",
            "for example local-triangles at 4 x 4: __local memory: 106704 B > 49152 B",
        ];
        assert_eq!(refused.examples, examples, "an example of each strategy");
        assert!(headline(&answers).contains("tie"), "{}", headline(&answers));
    }

    #[test]
    fn few_samples_are_no_speed_up_no_winner_and_leave_the_best_unsure() {
        let slow = few("gpu", "naive", 8, 20.0, 3);
        let records =
            [few("host", "serial-f32", 0, 1798.0, 1), slow.clone(), measured("gpu", "wide", 4, 11.0)];
        let of = |records: &[Record]| answers(&groups(&judged(records))).remove(0);
        let one = of(&records);
        assert_eq!(one.sureness, "unsure");
        assert!(one.sure.ends_with("Points without a rank: naive at 8 x 8 (n = 3)."), "{}", one.sure);
        let actual: Vec<_> =
            one.speedups.iter().map(|speedup| (speedup.factor.as_str(), speedup.range.as_str())).collect();
        assert_eq!(actual, [("?", "not enough samples (n = 1)"), ("?", "not enough samples (n = 3)")]);
        assert_eq!(headline(&[one]), "wide is the fastest, which is not certain");
        let faster = Record { median_ms: Some(9.0), ..slow.clone() };
        assert_eq!(of(&[faster, records[2].clone()]).sureness, "unsure");
        let none = of(&[slow]);
        assert_eq!((none.nobody, none.time.as_str()), ("no winner: no point can be ranked", "-"));
        assert_eq!(headline(&[none]), "No winner: no point can be ranked");
    }

    #[test]
    fn a_winner_is_clear_only_if_it_was_compared_or_if_there_is_no_other_point() {
        let (naive, wide) = (measured("gpu", "naive", 8, 41.0), measured("gpu", "wide", 4, 11.0));
        let refused = infeasible("gpu", "naive", 8, "work-group: too large");
        let few = few("gpu", "naive", 8, 20.0, 3);
        let sureness_of = |records: &[&Record]| {
            let records: Vec<Record> = records.iter().map(|record| (*record).clone()).collect();
            let one = answers(&groups(&judged(records))).remove(0);
            (one.sureness, one.sure)
        };
        let rests = "n = 10 samples in 2 launches.";
        for (others, sureness, words) in [
            (vec![], "clear", "There is no other point"),
            (vec![&refused], "unsure", "No other point has a rank"),
            (vec![&few], "unsure", "No other point has a rank"),
            (vec![&naive], "clear", "Every other point with a rank takes longer"),
        ] {
            let (actual, sure) = sureness_of(&[&[&wide][..], &others].concat());
            assert_eq!(actual, sureness, "{words}");
            assert!(sure.starts_with(&format!("{words}; {rests}")), "{sure}");
        }
        let in_one_launch = |record: &Record| Record { sample_launches: vec![0; 10], ..record.clone() };
        let (actual, sure) = sureness_of(&[&in_one_launch(&wide)]);
        assert!(actual == "unsure" && sure.contains("There was only one launch"), "{actual}: {sure}");
        // The interval of the ratio of the two points does not include differences between launches.
        let (actual, sure) = sureness_of(&[&wide, &in_one_launch(&naive)]);
        let look = "n = 10 samples in 2 launches. Some of the other points were measured in only one launch";
        assert!(actual == "unsure" && sure.contains(look), "{actual}: {sure}");
    }

    #[test]
    fn the_headline_says_how_many_results_are_not_certain() {
        let of = |scene: &str, in_one_launch: bool| {
            let both = [("naive", 20.0), ("wide", 10.0)].map(|(name, ms)| measured("gpu", name, 8, ms));
            both.map(|record| Record {
                scene: scene.into(),
                sample_launches: if in_one_launch { vec![0; 10] } else { record.sample_launches },
                ..record
            })
        };
        let headline_of = |results: &[[Record; 2]]| headline(&answers(&groups(&judged(results.concat()))));
        let [sure, unsure] = [false, true].map(|in_one_launch| of("room", in_one_launch));
        let gain = "; it is 2.00 times as fast as the best naive point";
        for (results, expected) in [
            (vec![sure.clone()], "wide is the fastest"),
            (vec![unsure.clone()], "wide is the fastest, which is not certain"),
            (
                vec![unsure.clone(), of("table", false)],
                "In both comparisons, wide is fastest or tied for fastest (1 of 2 results is not certain)",
            ),
            (
                vec![unsure, of("table", true)],
                "In both comparisons, wide is fastest or tied for fastest (no result is certain)",
            ),
        ] {
            assert_eq!(headline_of(&results), format!("{expected}{gain}"));
        }
    }

    #[test]
    fn times_of_zero_are_not_called_few() {
        let zero = few("gpu", "naive", 8, 0.0, 30);
        for records in [vec![zero.clone()], vec![zero, measured("gpu", "wide", 4, 11.0)]] {
            let one = answers(&groups(&judged(records))).remove(0);
            let text = format!("{}. {}", headline(std::slice::from_ref(&one)), one.sure);
            assert!(text.contains("naive at 8 x 8 (times below the timer's resolution)"), "{text}");
            assert!(!text.contains("samples to rank") && !text.contains("too few"), "{text}");
        }
    }

    #[test]
    fn the_next_point_is_said_to_take_longer_and_not_shorter() {
        let records = judged([measured("gpu", "naive", 8, 40.0), measured("gpu", "wide", 4, 10.0)]);
        let answers = answers(&groups(&records));
        let sure = &answers[0].sure;
        assert!(
            sure.contains(" The next point, naive at 8 x 8, takes 4.00 times (3.96 to 4.04) as long as the fastest point."),
            "{sure}"
        );
    }

    #[test]
    fn where_nobody_wins_is_no_comparison() {
        let records = judged([
            measured("gpu", "wide", 1, 10.0),
            Record { scene: "room".into(), ..measured("gpu", "wide", 1, 10.0) },
            infeasible("small", "wide", 1, "work-group: too large"),
            few("slow", "wide", 1, 10.0, 3),
        ]);
        let answers = answers(&groups(&records));
        assert_eq!(answers.len(), 4);
        assert_eq!(headline(&answers), "In both comparisons, wide is fastest or tied for fastest");
    }

    #[test]
    fn the_headline_has_the_range_of_speed_ups() {
        for serial_ms in [[400.0, 120.0], [120.0, 400.0]] {
            let of = |(scene, ms): (&str, f64)| {
                let both = [measured("host", "serial-f32", 0, ms), measured("gpu", "wide", 1, 10.0)];
                both.map(|record| Record { scene: scene.into(), ..record })
            };
            let records: Vec<_> = ["room", "table"].into_iter().zip(serial_ms).flat_map(of).collect();
            let text = headline(&answers(&groups(&judged(records))));
            assert!(text.ends_with("; it is 12.0 to 40.0 times as fast as serial-f32"), "{text}");
        }
    }

    /// A report of several folders may have a baseline of each folder.
    #[test]
    fn the_headline_has_the_best_naive_point_after_many_baselines() {
        let baselines = [("serial-f32", 400.0), ("serial-f64", 500.0), ("serial-f32 (old)", 600.0)];
        let kernels = [measured("gpu", "naive", 8, 15.0), measured("gpu", "wide", 1, 10.0)];
        let hosts = baselines.map(|(name, ms)| measured("host", name, 0, ms));
        let text = headline(&answers(&groups(&judged([&hosts[..], &kernels].concat()))));
        let gains = "; it is 40.0 times as fast as serial-f32, 50.0 times as fast as serial-f64, 1.50 times as fast \
                     as the best naive point";
        assert!(text.ends_with(gains), "{text}");
    }

    /// If the headline rounded the speed-up to two digits, it would say "1.0 times as fast", and contradict
    /// the line "1.03×, 1.02 to 1.05" below the headline.
    #[test]
    fn the_headline_does_not_round_a_small_speed_up_away() {
        let records = judged([measured("gpu", "naive", 8, 10.34), measured("gpu", "wide", 4, 10.0)]);
        let answers = answers(&groups(&records));
        let text = headline(&answers);
        assert!(text.ends_with("; it is 1.03 times as fast as the best naive point"), "{text}");
        assert!(answers[0].speedups[0].factor.starts_with("1.03"), "{:?}", answers[0].speedups);
    }

    #[test]
    fn the_headline_says_in_how_many_comparisons_a_speed_up_is_known() {
        let of = |scene: &str, naive_ms: f64, serial: bool| {
            let host = serial.then(|| measured("host", "serial-f32", 0, 400.0));
            let both = [measured("gpu", "naive", 8, naive_ms), measured("gpu", "wide", 1, 10.0)];
            both.into_iter()
                .chain(host)
                .map(|record| Record { scene: scene.into(), ..record })
                .collect::<Vec<_>>()
        };
        let headline_of = |records: &[Vec<Record>]| headline(&answers(&groups(&judged(records.concat()))));
        let [slow, fast, bare] = [of("room", 15.0, true), of("table", 5.0, true), of("chair", 15.0, false)];
        let both = headline_of(&[slow.clone(), fast.clone()]);
        let itself = "1.50 times as fast as the best naive point (in 1 of 2 comparisons; in 1, a naive point is among \
                      the winners)";
        assert!(both.contains("; the winners are 40.0 to 80.0 times as fast as serial-f32, "), "{both}");
        assert!(both.ends_with(itself), "{both}");
        let two = headline_of(&[slow, bare]);
        assert!(
            two.contains("40.0 times as fast as serial-f32 (in 1 of 2 comparisons), 1.50 times"),
            "{two}"
        );
        assert!(two.ends_with("as the best naive point"), "{two}");
    }

    /// In this test, a naive point ties with `private`: it is faster in one of the two launches, and slower in the
    /// other one. In the last case, this point ties, and the best naive point does not.
    #[test]
    fn the_headline_calls_no_winner_faster_than_a_naive_winner() {
        let in_launches = |side: u32, ms: [f64; 2]| Record {
            samples_ms: ms.map(|ms| [ms; 5]).concat(),
            ..measured("gpu", "naive", side, ms[0])
        };
        let private = measured("gpu", "private", 8, 2.0);
        let (ties, worse) = (in_launches(8, [1.8, 2.6]), in_launches(8, [1.8, 2.9]));
        // The points in the room have launches of their own, so the ties do not widen their intervals.
        let [in_room, slow] = [("private", 2.0), ("naive", 3.0)].map(|(name, ms)| Record {
            scene: "room".into(),
            sample_launches: [[2; 5], [3; 5]].concat(),
            ..measured("gpu", name, 8, ms)
        });
        let headline_of = |records: &[&Record]| {
            let records: Vec<Record> = records.iter().map(|record| (*record).clone()).collect();
            let answers = answers(&groups(&judged(records)));
            assert_eq!((answers[0].sureness, answers[0].winners.len()), ("tie", 2), "{:?}", answers[0].sure);
            assert!(answers[0].speedups.iter().any(|speedup| !speedup.is_over_baseline));
            headline(&answers)
        };
        let tie = "private and naive are the fastest: a tie";
        assert_eq!(headline_of(&[&private, &ties]), tie);
        let serial = measured("host", "serial-f32", 0, 40.0);
        let with_baseline = format!("{tie}; the winners are 20.0 times as fast as serial-f32");
        assert_eq!(headline_of(&[&private, &ties, &serial]), with_baseline);
        let both = headline_of(&[&private, &ties, &in_room, &slow]);
        let counted = "; the winners are 1.50 times as fast as the best naive point (in 1 of 2 comparisons; in 1, a \
                       naive point is among the winners)";
        assert!(both.ends_with(counted), "{both}");
        assert_eq!(headline_of(&[&private, &measured("gpu", "naive", 4, 2.2), &worse]), tie);
    }

    #[test]
    fn nothing_measured_is_said() {
        let records = [infeasible("gpu", "naive", 32, "work-group: too large")];
        let answers = answers(&groups(&records));
        assert_eq!(headline(&answers), "Nothing could be measured");
        assert_eq!(answers[0].sureness, "unsure");
    }

    #[test]
    fn baselines_are_the_hosts_at_the_same_scene_and_image_size() {
        let host = |ms: f64| measured("host", "serial-f32", 0, ms);
        let records = judged([
            Record { image_size: [1600, 1000], ..host(840.0) },
            Record { scene: "room".into(), ..host(210.0) },
            host(420.0),
            measured("gpu", "wide", 1, 10.0),
        ]);
        let groups = groups(&records);
        let gpu = groups.iter().find(|group| group.device == "gpu").expect("a group");
        let times: Vec<_> = gpu.baselines(&groups).into_iter().map(|record| record.median_ms).collect();
        assert_eq!(times, [Some(420.0)]);
    }

    #[test]
    fn a_winner_has_its_local_size_across_and_down() {
        let record = Record { local_size: Some([32, 4]), ..measured("gpu", "wide", 1, 10.0) };
        let winner = winner(&record);
        assert_eq!((winner.name.as_str(), winner.size.as_str()), ("wide", "32×4"));
    }

    #[test]
    fn a_winner_is_not_clear_beside_a_point_of_few_samples_that_may_be_faster() {
        let ranked = [measured("gpu", "naive", 8, 41.0), measured("gpu", "wide", 4, 11.0)];
        let of = |ms: f64| {
            let records = [&ranked[..], &[few("gpu", "bvh", 8, ms, 3)]].concat();
            let one = answers(&groups(&judged(records))).remove(0);
            (one.sureness, one.sure.starts_with("A point without a rank may be as fast as the winner."))
        };
        assert_eq!([of(9.0), of(20.0)], [("unsure", true), ("clear", false)]);
    }

    /// In this test, a frame of `naive` takes less than a step of the timer, so its measured times are 0.
    #[test]
    fn winners_are_not_certain_beside_a_point_that_is_faster_than_the_timer() {
        let zero = few("gpu", "naive", 8, 0.0, 30);
        let of = |winners: &[Record]| {
            let one = answers(&groups(&judged([winners, std::slice::from_ref(&zero)].concat()))).remove(0);
            (one.winners.len(), one.sureness, headline(&[one]))
        };
        let [wide, tile] = ["wide", "tile"].map(|name| measured("gpu", name, 8, 0.5));
        let (winners, sureness, said) = of(std::slice::from_ref(&wide));
        assert_eq!(
            (winners, sureness, said.as_str()),
            (1, "unsure", "wide is the fastest, which is not certain")
        );
        let (winners, sureness, said) = of(&[wide, tile]);
        assert_eq!((winners, sureness), (2, "unsure"));
        assert!(said.ends_with(" are the fastest: a tie, which is not certain"), "{said}");
    }
}
