//! The first screen: who won, by how much, how sure that is, and what could not run.

use super::words::{first_line, ratio_interval, series_name, title};
use crate::record::{Group, HOST, Record, duration, interval, median, ms, significant, word};

/// What was found in one group: a scene at a size on a device.
#[derive(Clone, Debug)]
pub struct Answer {
    /// The scene.
    pub scene: String,
    /// Pixels across and down.
    pub image_size: [u32; 2],
    /// The device.
    pub device: String,
    /// The winning set, fastest first: strategy and local size.
    pub winners: Vec<Winner>,
    /// The best median as text, and its interval.
    pub time: String,
    /// The interval of the best median as text.
    pub interval: String,
    /// How much faster than what.
    pub speedups: Vec<Speedup>,
    /// "clear", "tie" or "unsure".
    pub sureness: &'static str,
    /// How sure it is, in a sentence.
    pub sure: String,
    /// What could not run: how many points, and the reason.
    pub refused: Vec<Refused>,
    /// The best record's picture, relative to its folder.
    pub image: Option<String>,
}

/// A member of the winning set.
#[derive(Clone, Debug, PartialEq)]
pub struct Winner {
    /// The strategy's name.
    pub name: String,
    /// Its local size.
    pub size: String,
    /// Its axes.
    pub strategy: String,
}

/// How much faster the best is.
#[derive(Clone, Debug, PartialEq)]
pub struct Speedup {
    /// Than what.
    pub over: String,
    /// How many times.
    pub ratio: f64,
    /// "4.4×".
    pub factor: String,
    /// "4.2 to 4.6".
    pub range: String,
}

/// Points without a time that share a reason.
#[derive(Clone, Debug, PartialEq)]
pub struct Refused {
    /// A word: "local memory", "wrong-image".
    pub word: String,
    /// How many points.
    pub count: usize,
    /// One of them with its whole reason.
    pub example: String,
}

/// The answers, a group of kernels at a time.
pub fn answers(groups: &[Group<'_>]) -> Vec<Answer> {
    groups.iter().filter(|group| group.device != HOST).map(|group| answer(group, groups)).collect()
}

fn answer(group: &Group<'_>, groups: &[Group<'_>]) -> Answer {
    let winners = group.winners();
    let best = winners.first().copied();
    let (sureness, sure) = sure(group, &winners);
    Answer {
        scene: group.scene.to_owned(),
        image_size: group.image_size,
        device: group.device.to_owned(),
        time: best.and_then(median).map_or("-".into(), duration),
        interval: best
            .and_then(interval)
            .map_or(String::new(), |[low, high]| format!("{} to {} ms", ms(low), ms(high))),
        speedups: best.map_or(Vec::new(), |best| speedups(best, group, groups)),
        sureness,
        sure,
        refused: refused(group),
        image: best.and_then(|record| record.image.clone()),
        winners: winners.iter().map(|record| winner(record)).collect(),
    }
}

fn winner(record: &Record) -> Winner {
    let size = record.local_size.map_or(String::new(), |[across, down]| format!("{across}×{down}"));
    Winner { name: record.name.clone(), size, strategy: record.strategy.clone() }
}

/// The baselines of a group: the host's records of its scene and size.
pub fn baselines<'a>(group: &Group<'_>, groups: &'a [Group<'a>]) -> Vec<&'a Record> {
    let of_host = |other: &&Group<'_>| {
        other.device == HOST && other.scene == group.scene && other.image_size == group.image_size
    };
    groups.iter().find(of_host).map(Group::ranked).unwrap_or_default()
}

fn speedups(best: &Record, group: &Group<'_>, groups: &[Group<'_>]) -> Vec<Speedup> {
    let serial = baselines(group, groups).into_iter().filter(|record| record.strategy.starts_with("serial"));
    let naive = group.best_where(|record| record.preset.as_deref() == Some("naive"));
    let over = serial.chain(naive.filter(|naive| naive.key != best.key));
    over.filter_map(|other| {
        let factor = median(other)? / median(best)?;
        let [low, high] = ratio_interval(other, best)?;
        Some(Speedup {
            over: if other.is_baseline() {
                other.strategy.clone()
            } else {
                format!("the best {}", series_name(other))
            },
            ratio: factor,
            factor: format!("{}×", significant(factor, 3)),
            range: format!("{} to {}", significant(low, 3), significant(high, 3)),
        })
    })
    .collect()
}

/// Fewer samples than these say little.
const FEW: usize = 10;

fn sure(group: &Group<'_>, winners: &[&Record]) -> (&'static str, String) {
    let Some(best) = winners.first() else {
        return ("unsure", "Nothing could be measured.".to_owned());
    };
    let n = best.samples_ms.len();
    let few = if n < FEW { format!(" Only {n} samples: look, do not conclude.") } else { String::new() };
    let next =
        group.ranked().into_iter().find(|record| !winners.iter().any(|winner| winner.key == record.key));
    let gap = next.and_then(|next| Some((next, median(next)? / median(best)?)));
    let behind = gap.map_or(String::new(), |(next, factor)| {
        format!(" The next, {}, takes {} times as long.", title(next), significant(factor, 3))
    });
    match winners.len() {
        1 if n < FEW => ("unsure", format!("Its interval touches no other, but n = {n}.{behind}")),
        1 => ("clear", format!("Its 95% interval touches no other; n = {n}.{behind}")),
        several => (
            "tie",
            format!("A tie of {several}: their 95% intervals overlap the fastest one's.{few}{behind}"),
        ),
    }
}

fn refused(group: &Group<'_>) -> Vec<Refused> {
    let mut refused: Vec<Refused> = Vec::new();
    for (record, _) in group.failures() {
        let word = word(record);
        match refused.iter_mut().find(|known| known.word == word) {
            Some(known) => known.count += 1,
            None => {
                let example = format!("{}: {}", title(record), first_line(record));
                refused.push(Refused { word, count: 1, example });
            }
        }
    }
    refused
}

/// The whole in a sentence: which strategy wins where, and by how much.
pub fn headline(answers: &[Answer]) -> String {
    format!("{}{}", who_wins(answers), gains(answers))
}

/// ": 2.6 to 108 times as fast as serial-f32, 7.2 to 78 times as fast as the best naive".
fn gains(answers: &[Answer]) -> String {
    let mut over: Vec<(&str, f64, f64)> = Vec::new();
    for speedup in answers.iter().flat_map(|answer| &answer.speedups) {
        match over.iter_mut().find(|(name, ..)| *name == speedup.over) {
            Some((_, low, high)) => (*low, *high) = (low.min(speedup.ratio), high.max(speedup.ratio)),
            None => over.push((&speedup.over, speedup.ratio, speedup.ratio)),
        }
    }
    let text = |(name, low, high): &(&str, f64, f64)| {
        let (low, high) = (significant(*low, 2), significant(*high, 2));
        let range = if low == high { low } else { format!("{low} to {high}") };
        format!("{range} times as fast as {name}")
    };
    let all: Vec<_> = over.iter().take(3).map(text).collect();
    if all.is_empty() { String::new() } else { format!(", {}", all.join(", ")) }
}

/// Which strategy is in how many winning sets.
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
        return "Nothing could be measured.".to_owned();
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
        (most, all) if most == all => format!("{whom} {verb} in the winning set everywhere: {most} of {all}"),
        (most, all) => format!("{whom} {verb} in the winning set in {most} of {all} comparisons"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::fixtures::{infeasible, measured};
    use crate::record::groups;

    #[test]
    fn a_tie_is_a_tie_and_speedups_carry_their_range() {
        let records = [
            measured("host", "serial-f32", 0, [400.0, 420.0]),
            measured("gpu", "naive", 8, [40.0, 42.0]),
            measured("gpu", "wide", 4, [10.0, 12.0]),
            measured("gpu", "deferred", 8, [11.0, 13.0]),
            infeasible("gpu", "local-vectors", 32, "__local memory: 110592 B > 49152 B"),
        ];
        let groups = groups(&records);
        let answers = answers(&groups);
        let [one] = answers.as_slice() else { panic!("{answers:?}") };
        assert_eq!(one.sureness, "tie");
        assert_eq!(one.winners.iter().map(|w| w.name.as_str()).collect::<Vec<_>>(), ["wide", "deferred"]);
        assert_eq!(one.speedups[0].factor, "37.3×");
        assert_eq!(one.speedups[0].range, "33.3 to 42.0");
        assert_eq!((one.refused[0].word.as_str(), one.refused[0].count), ("local", 1));
        assert!(headline(&answers).contains("tie"), "{}", headline(&answers));
    }

    #[test]
    fn nothing_measured_is_said() {
        let records = [infeasible("gpu", "naive", 32, "work-group: too large")];
        let answers = answers(&groups(&records));
        assert_eq!(headline(&answers), "Nothing could be measured.");
        assert_eq!(answers[0].sureness, "unsure");
    }
}
