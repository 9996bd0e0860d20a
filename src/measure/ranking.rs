//! Ranks points of an experiment by one rule, which decides everywhere in raycl which points are the winners.

/// Points ordered by their times, fastest first.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranking<T> {
    /// The fastest point with a rank, and every other point that ties with it. Two winners that both tie with the
    /// fastest point need not tie with each other.
    pub winners: Vec<T>,
    /// Every point with a rank, including the winners: a point with enough samples, none of which has the time 0.
    pub ranked: Vec<T>,
    /// Every point without a rank: a point with too few samples, or with a time of 0. No verdict uses a point
    /// without a rank.
    pub unranked: Vec<T>,
}

impl<T: Copy> Ranking<T> {
    /// Ranks points by their levels, such as the logarithms of their times. The point with the lowest level
    /// is the best. A point whose level is unknown has no rank. `ties` takes a point and the best point, and
    /// returns true if the two points tie.
    pub(crate) fn by(
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

    /// Returns all points: the ranked points, then the unranked points.
    pub fn all(&self) -> Vec<T> {
        self.ranked.iter().chain(&self.unranked).copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn ranking(levels: &[Option<f64>]) -> Ranking<usize> {
        let ties = |one: usize, best: usize| levels[one] <= levels[best].map(|level| level + 0.1);
        Ranking::by(levels.iter().copied().enumerate(), ties)
    }

    #[test]
    fn winners_tie_with_the_best_and_not_with_each_other_in_a_chain() {
        assert_eq!(ranking(&[Some(2.0), Some(1.05), Some(1.0)]).winners, [2, 1]);
        assert_eq!(ranking(&[Some(1.0), Some(1.09), Some(1.18)]).winners, [0, 1]);
        assert!(ranking(&[]).winners.is_empty());
    }

    #[test]
    fn a_point_that_ties_wins_though_one_before_it_does_not() {
        // The interval of 'b' is narrow, and that of 'c' is wide, so 'c' ties with 'a', and 'b' does not.
        let points = [('a', Some(1.0)), ('b', Some(2.0)), ('c', Some(3.0))];
        assert_eq!(Ranking::by(points, |point, _| point != 'b').winners, ['a', 'c']);
    }

    #[test]
    fn a_point_without_a_level_neither_wins_nor_is_ranked() {
        let ranking = ranking(&[None, Some(3.0), Some(2.0), None]);
        assert_eq!((ranking.winners.as_slice(), ranking.ranked.as_slice()), (&[2][..], &[2, 1][..]));
        assert_eq!((ranking.unranked.as_slice(), ranking.all()), (&[0, 3][..], vec![2, 1, 0, 3]));
    }

    proptest! {
        #[test]
        fn the_best_wins_and_none_is_lost(levels in prop::collection::vec(prop::option::of(0.1..10.0_f64), 1..9)) {
            let ranking = ranking(&levels);
            prop_assert_eq!(ranking.winners.first(), ranking.ranked.first());
            prop_assert_eq!(ranking.all().len(), levels.len());
            prop_assert!(ranking.ranked.is_sorted_by(|a, b| levels[*a] <= levels[*b]));
        }
    }
}
