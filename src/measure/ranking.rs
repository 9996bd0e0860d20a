//! Who wins: the one rule by which every view names winners.

use super::Estimate;

/// Some points by their medians, fastest first.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranking<T> {
    /// The fastest point that has enough samples, and every other that ties with it: whose 95% interval overlaps its. More
    /// than one is a tie.
    pub winners: Vec<T>,
    /// Every point that has enough samples, winners among them.
    pub ranked: Vec<T>,
    /// Points that have not: no verdict rests on them.
    pub unranked: Vec<T>,
}

impl<T: Copy> Ranking<T> {
    /// Ranks points by their medians: what ties with the best is what overlaps its interval.
    pub fn of(points: impl IntoIterator<Item = (T, Estimate)>) -> Self {
        let mut points: Vec<_> = points.into_iter().collect();
        points.sort_by(|(_, a), (_, b)| a.median_ms().total_cmp(&b.median_ms()));
        let interval = |place: usize| points[place].1.interval_ms();
        let level = |place: usize| interval(place).map(|_| points[place].1.median_ms());
        let ties =
            |one, best| interval(one).zip(interval(best)).is_some_and(|(one, best)| overlap(one, best));
        let places = Ranking::by((0..points.len()).map(|place| (place, level(place))), ties);
        let back = |places: Vec<usize>| places.into_iter().map(|place| points[place].0).collect();
        Self { winners: back(places.winners), ranked: back(places.ranked), unranked: back(places.unranked) }
    }

    /// Ranks points by their levels, less being better; without one a point has no rank. `ties` says whether the first of two
    /// ties with the second, which is the best.
    pub(super) fn by(
        points: impl IntoIterator<Item = (T, Option<f64>)>,
        ties: impl Fn(T, T) -> bool,
    ) -> Self {
        let (mut known, mut unranked) = (Vec::new(), Vec::new());
        for (point, level) in points {
            match level {
                Some(level) => known.push((point, level)),
                None => unranked.push(point),
            }
        }
        known.sort_by(|(_, a), (_, b)| a.total_cmp(b));
        let ranked: Vec<T> = known.into_iter().map(|(point, _)| point).collect();
        let best = ranked.first().copied();
        let wins = |point: &T| best.is_some_and(|best| ties(*point, best));
        Self { winners: ranked.iter().copied().filter(wins).collect(), ranked, unranked }
    }

    /// All points: the ranked, then the others.
    pub fn all(&self) -> Vec<T> {
        self.ranked.iter().chain(&self.unranked).copied().collect()
    }
}

/// Whether two closed intervals share a value.
pub(super) fn overlap([a_low, a_high]: [f64; 2], [b_low, b_high]: [f64; 2]) -> bool {
    a_low <= b_high && b_low <= a_high
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn ranking(points: &[(f64, usize)]) -> Ranking<usize> {
        let estimate = |(ms, n): &(f64, usize)| Estimate::new(*ms, *n, Some([0.99 * ms, 1.01 * ms]));
        Ranking::of(points.iter().map(estimate).enumerate())
    }

    #[test]
    fn ties_win_together_and_the_best_comes_first() {
        assert_eq!(ranking(&[(2.0, 9), (1.005, 9), (1.0, 9)]).winners, [2, 1]);
        assert_eq!(ranking(&[(1.0, 9), (1.5, 9)]).winners, [0]);
        assert!(ranking(&[]).winners.is_empty());
    }

    #[test]
    fn winners_overlap_the_best_interval_and_not_each_other_in_a_chain() {
        assert_eq!(ranking(&[(1.0, 9), (1.015, 9), (1.03, 9)]).winners, [0, 1]);
    }

    #[test]
    fn a_point_of_few_samples_neither_wins_nor_is_ranked() {
        let ranking = ranking(&[(1.0, 4), (3.0, 5), (2.0, 5), (9.0, 1)]);
        assert_eq!((ranking.winners.as_slice(), ranking.ranked.as_slice()), (&[2][..], &[2, 1][..]));
        assert_eq!((ranking.unranked.as_slice(), ranking.all()), (&[0, 3][..], vec![2, 1, 0, 3]));
    }

    proptest! {
        #[test]
        fn the_best_that_has_enough_samples_wins(points in prop::collection::vec((0.1..10.0_f64, 1..9_usize), 1..9)) {
            let ranking = ranking(&points);
            prop_assert_eq!(ranking.winners.first(), ranking.ranked.first());
            prop_assert_eq!(ranking.all().len(), points.len());
            prop_assert!(ranking.ranked.iter().all(|place| points[*place].1 >= 5));
            prop_assert!(ranking.ranked.is_sorted_by(|a, b| points[*a].0 <= points[*b].0));
        }
    }
}
