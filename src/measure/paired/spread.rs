//! The spread of a point's repeated values, and the standard error of their mean, which follows from the spread.

use super::error::Error;
use super::prior::Prior;
use crate::measure::mean_and_sigma;
use crate::measure::summary::quantile;

/// If a spread is averaged with the spread of other points or tables, it *borrows* this other spread.
/// `BORROWED` is the largest weight, in degrees of freedom, that the spread of other points or tables gets in
/// such an average. The spread of a point or of a pair of points borrows (is averaged with) the spread of all
/// points of the same table, that is, of the same group. The spread of a point then also borrows the spread in
/// the tables of other groups of the same run.
const BORROWED: usize = 6;
/// The spread of a pair of points is averaged with the spread of all points only in tables of at least
/// `FEWEST_LENDERS` rows (points). In a table of three rows, the spread of all rows would come from the two
/// rows of the pair and one more row. If the row that is not in the pair is noisy, the pair would seem to be
/// noisy too.
const FEWEST_LENDERS: usize = 4;
/// A variance that is more than `MOST_TIMES_USUAL` times the usual variance is not averaged with the usual
/// variance. If every variance were averaged with the usual variance, the result would be far too small for a
/// point whose times vary more than those of the others. In simulations of four launches (docs/methodology.md),
/// one point varied eight times as much as the others. If the point's variance was always averaged, 80 to 83%
/// of the 95% intervals of this point's ratios contained the true ratio. With the limit `MOST_TIMES_USUAL`, 94
/// to 95% of these intervals contained the true ratio. Even if all pairs of points vary equally, the variance
/// of one pair in nine exceeds the limit `MOST_TIMES_USUAL` by chance in four launches.
const MOST_TIMES_USUAL: f64 = 2.0;
/// The effect that a launch (a column of the table) has on all points (rows) is estimated from the steadiest rows only.
/// One of every `STEADY_PART` rows belongs to the steadiest rows. Rows that are not among the steadiest may be far from
/// steady. For example, in a run of the paper's Figure 8 on a CPU, 19 of 37 points took 1.4 times as long in one launch
/// as in the three other launches.
const STEADY_PART: usize = 3;
/// The effect of a column is estimated from at least `LEAST_STEADY` rows, or from all rows if the table has
/// fewer. If the effect were estimated from fewer rows, these rows might be alike only by chance.
const LEAST_STEADY: usize = 6;

/// The spread of the values in a table, pooled over all points. The table has a row per point and a column
/// per repeat. A repeat is a launch or, if there is only one launch, a part of this launch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pooled {
    /// The distribution of the variances of the rows' residuals, after subtracting the effects of rows and columns.
    apart: Prior,
    /// The distribution of the variances of the table's rows (one row per point). These variances include
    /// effects that all rows share.
    together: Prior,
    rows: usize,
    columns: usize,
    /// The spread in the other tables of the same run: the square root of the mean of `together.typical` over
    /// these tables, weighted by the tables' degrees of freedom. The degrees of freedom of this spread are
    /// the sum of the other tables' degrees of freedom, but at most [`BORROWED`].
    elsewhere: Error,
}

impl Pooled {
    /// Computes the pooled spread from two tables of the same shape. The tables' values are medians of the logarithms
    /// of times. In `relative`, the drift that all points of a launch share is subtracted from these logarithms; in
    /// `plain`, the drift is not subtracted.
    pub(super) fn of(relative: &[&[f64]], plain: &[&[f64]]) -> Self {
        let (rows, columns) = (relative.len(), relative.first().map_or(0, |row| row.len()));
        let together: Vec<f64> = plain.iter().map(|row| variance(row)).collect();
        let together = Prior::of(&together, columns.saturating_sub(1));
        let elsewhere = Error { error: 0.0, degrees: 0.0 };
        Self { apart: interaction(relative), together, rows, columns, elsewhere }
    }

    /// Returns the standard error of the mean of `differences`. `differences` has one difference per column (launch),
    /// between the mean of `rows[0]` rows (points) and the mean of `rows[1]` other rows.
    pub(super) fn of_difference(&self, differences: &[f64], rows: [usize; 2]) -> Error {
        let parts: f64 = rows.iter().map(|rows| 1.0 / *rows as f64).sum();
        self.moderated(parts, variance(differences))
    }

    /// Returns a copy in which the common spread of all rows (`apart`) has no weight in the error of a
    /// difference between rows. With this copy, the error of a difference between two rows follows from the
    /// values of these two rows only.
    pub(super) fn alone(self) -> Self {
        Self { apart: Prior { degrees: 0.0, ..self.apart }, ..self }
    }

    /// Returns the standard error of a row's mean. The effect of a launch (a column) is the same for all rows, so the
    /// other rows of the same table add no degrees of freedom. Only the other tables of the same run add degrees of
    /// freedom to this error.
    pub(super) fn of_level(&self, row: &[f64]) -> Error {
        let borrowed = self.borrowed(self.together, 1);
        let (own, _) = self.weighted(self.together.variance, borrowed, variance(row));
        let Error { error, degrees } = self.elsewhere;
        let (variance, degrees) = self.weighted(error.powi(2), degrees, own);
        self.error(variance, degrees)
    }

    /// Sets `elsewhere` to the spread in `others`, which are other tables of the same run, machine and devices. Changes
    /// nothing if no table in `others` has at least two columns.
    pub(super) fn borrow(&mut self, others: &[Self]) {
        let degrees = |other: &Self| other.columns.saturating_sub(1) as f64;
        let all: f64 = others.iter().map(degrees).sum();
        if all > 0.0 {
            let variance =
                others.iter().map(|other| degrees(other) * other.together.typical).sum::<f64>() / all;
            self.elsewhere = Error { error: variance.sqrt(), degrees: all.min(BORROWED as f64) };
        }
    }

    /// Returns the error that a difference between two rows would have if both rows had the typical variance of this
    /// table; `None` for a table with fewer than two rows.
    pub(super) fn usual(&self) -> Option<Error> {
        (self.rows > 1).then(|| self.moderated(2.0, 2.0 * self.apart.typical))
    }

    /// Returns the standard error of the mean of several differences. Each column gives one difference: between its
    /// values in two rows, or between its means over several rows. `own` is the variance of these differences, and has
    /// few degrees of freedom. `parts` is the expected variance of such a difference, divided by the variance of a
    /// single row.
    fn moderated(&self, parts: f64, own: f64) -> Error {
        let borrowed = if self.rows < FEWEST_LENDERS { 0.0 } else { self.borrowed(self.apart, 2) };
        let (variance, degrees) = self.weighted(parts * self.apart.variance, borrowed, own);
        self.error(variance, degrees)
    }

    /// Returns the number of degrees of freedom that the common spread of all rows (`prior`) adds to the
    /// error of one or two of these rows. The result is the least of three numbers: the degrees of freedom of
    /// `prior`, [`BORROWED`], and the degrees of freedom of the table's other rows. `own_rows` is the number
    /// of rows whose error is computed: 1 for the error of a row's mean, and 2 for the error of a difference
    /// between two rows. The other rows are all rows of the table except these `own_rows` rows.
    ///
    /// For a difference between a row and an anchor (work that is timed for comparison), `own_rows` is 2 too,
    /// although the anchor is no row of the table. [`Self::weighted`] averages two variances: the variance of
    /// this difference, and the common variance of all rows. The values of the row in this difference are
    /// part of both averaged variances. The two averaged variances are therefore not independent, and their
    /// mean has fewer degrees of freedom than both variances together.
    ///
    /// A simple model shows how many degrees of freedom the mean of the difference's variance and the rows'
    /// common variance has. In the model, all values of the table are normally distributed, the anchor varies
    /// as much as each row, and the effect of a column (a launch) is the mean of all rows. In the model, for
    /// a table of four rows and two columns, the mean of the two variances has 3.2 degrees of freedom, and
    /// raycl computes with 3. If `own_rows` were 1 for this difference, the mean of the two variances would
    /// have 3.4 degrees of freedom, and raycl would compute with 4.
    fn borrowed(&self, prior: Prior, own_rows: usize) -> f64 {
        let others = self.rows.saturating_sub(own_rows) * self.columns.saturating_sub(1);
        prior.degrees.min(BORROWED.min(others) as f64)
    }

    /// Returns the mean of two variances, weighted by their degrees of freedom, and the sum of these degrees of
    /// freedom. `own` is the variance of one row or of the differences between rows. `usual` is the common
    /// variance of all rows or of other tables, and its degrees of freedom are `borrowed`. If `own` is more
    /// than [`MOST_TIMES_USUAL`] times `usual`, the result is `own` alone.
    fn weighted(&self, usual: f64, borrowed: f64, own: f64) -> (f64, f64) {
        let columns = self.columns as f64 - 1.0;
        let borrowed = if own > MOST_TIMES_USUAL * usual { 0.0 } else { borrowed };
        ((borrowed * usual + columns * own) / (borrowed + columns), borrowed + columns)
    }

    fn error(&self, variance: f64, degrees: f64) -> Error {
        Error { error: (variance / self.columns as f64).sqrt(), degrees }
    }
}

fn variance(values: &[f64]) -> f64 {
    mean_and_sigma(values).1.powi(2)
}

/// Subtracts the effects of rows and columns from a two-way table, and returns the distribution of the variances of
/// what remains in each row (its residuals). For a table with fewer than two rows or columns, these variances are 0.
/// For each row, the effect of a column is the median of the column over all steady rows (rows that change alike)
/// except the row itself. Rows that vary more than others therefore do not disturb the residuals of steady rows, even
/// if more than half of the rows vary so much. In a table with two or three rows, each row is compared with a single
/// other row ([`to_the_nearest`]).
fn interaction(table: &[&[f64]]) -> Prior {
    let (rows, columns) = (table.len(), table.first().map_or(0, |row| row.len()));
    if rows < 2 || columns < 2 {
        return Prior::of(&[], 0);
    }
    if rows < FEWEST_LENDERS {
        return Prior::of(&to_the_nearest(table), columns - 1);
    }
    let centred: Vec<Vec<f64>> = table.iter().map(|row| around_mean(row)).collect();
    let steady = steady(&centred);
    let sorted = |column: usize| {
        let mut values: Vec<f64> = steady.iter().map(|row| centred[*row][column]).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let sorted: Vec<Vec<f64>> = (0..columns).map(sorted).collect();
    let of_row = |row: usize| {
        let own = steady.contains(&row);
        let effect = |column: &[f64], value: f64| {
            if own { median_of_others(column, value) } else { quantile(column, 0.5) }
        };
        let residuals: Vec<f64> =
            centred[row].iter().zip(&sorted).map(|(value, column)| value - effect(column, *value)).collect();
        // The effect of a column is an estimate, whose error makes the variance of the residuals larger. The
        // division below corrects the variance of the residuals for the error of this estimate. The
        // correction would be exact if the effect of a column were the mean of the steady rows, but the
        // effect is their median. The variance of a median's error is about a half larger than that of a
        // mean's error (less for few rows), so the division corrects slightly too little.
        variance(&residuals) / (1.0 + 1.0 / (steady.len() - usize::from(own)) as f64)
    };
    Prior::of(&(0..rows).map(of_row).collect::<Vec<_>>(), columns - 1)
}

/// Returns one variance per row of a table with at least two rows. For each row, the function computes the
/// variance of its differences from each other row, and returns half of the least of these variances. In a
/// table with three rows, the median of the two other rows would be their mean. If residuals were computed
/// from this median, one noisy row would make the residuals of both other rows noisy.
fn to_the_nearest(table: &[&[f64]]) -> Vec<f64> {
    let apart = |one: &[f64], other: &[f64]| {
        variance(&one.iter().zip(other).map(|(one, other)| one - other).collect::<Vec<f64>>())
    };
    let of_row = |row: usize| {
        let others = (0..table.len()).filter(|other| *other != row);
        0.5 * others.map(|other| apart(table[row], table[other])).fold(f64::INFINITY, f64::min)
    };
    (0..table.len()).map(of_row).collect()
}

/// Returns the indices of the rows whose changes from column to column are most alike. The result has a third of
/// all rows, but at least [`LEAST_STEADY`] rows if the table has so many. Each row forms a set with its
/// nearest rows (by the sum of squared differences). The function returns the set with the least distance
/// between the row that formed the set and the set's farthest row.
fn steady(centred: &[Vec<f64>]) -> Vec<usize> {
    let rows = centred.len();
    let count = rows.div_ceil(STEADY_PART).max(LEAST_STEADY).min(rows);
    let nearest = |row: &Vec<f64>| {
        let apart = |other: &Vec<f64>| row.iter().zip(other).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        let mut others: Vec<(f64, usize)> = centred.iter().map(apart).zip(0..).collect();
        others.sort_by(|a, b| a.0.total_cmp(&b.0));
        others.truncate(count);
        others
    };
    let farthest = |rows: &Vec<(f64, usize)>| rows.last().map_or(0.0, |(apart, _)| *apart);
    let all = centred.iter().map(nearest);
    let rows = all.min_by(|a, b| farthest(a).total_cmp(&farthest(b)));
    rows.unwrap_or_default().into_iter().map(|(_, row)| row).collect()
}

/// Returns the median of the values in `sorted` except the value `own`. `sorted` must have at least two
/// values.
fn median_of_others(sorted: &[f64], own: f64) -> f64 {
    let index = sorted.partition_point(|value| value.total_cmp(&own).is_lt());
    let other = |number: usize| sorted[number + usize::from(number >= index)];
    let last = sorted.len() - 2;
    0.5 * (other(last / 2) + other(last.div_ceil(2)))
}

fn around_mean(row: &[f64]) -> Vec<f64> {
    let mean = row.iter().sum::<f64>() / row.len() as f64;
    row.iter().map(|value| value - mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_rows_and_columns_share_is_no_interaction() {
        assert!(interaction(&[&[1.0, 2.0, 4.0], &[11.0, 12.0, 14.0]]).variance < 1e-20);
        let four: [&[f64]; 4] = [&[1.0, 2.0, 4.0], &[11.0, 12.0, 14.0], &[5.0, 6.0, 8.0], &[0.0, 1.0, 3.0]];
        assert!(interaction(&four).variance < 1e-20);
        // The expected variance was calculated without this code. After the means of rows and columns are
        // subtracted, the residuals are +-0.5 in all four cells of the table. The sum of the squared
        // residuals is 1, with one degree of freedom.
        assert!((interaction(&[&[1.0, 0.0], &[0.0, 1.0]]).variance - 1.0).abs() < 1e-12);
        assert_eq!(interaction(&[&[1.0, 9.0]]).variance, 0.0);
    }

    /// The expected variance was calculated without this code. In each row, 1 and -1 remain after the effects
    /// of the columns are subtracted. The variance of these residuals, 2, is divided by 1 + 1/3, since each
    /// effect is estimated from three other rows. The mean logarithm of a variance with one degree of freedom
    /// is 1.27 below the logarithm of the true variance.
    #[test]
    fn residuals_from_the_median_of_other_rows_are_corrected_for_its_error() {
        let prior = interaction(&[&[1.0, 0.0], &[0.0, 1.0], &[1.0, 0.0], &[0.0, 1.0]]);
        assert!((prior.variance / (1.5 * 1.270_363_f64.exp()) - 1.0).abs() < 1e-5, "{prior:?}");
    }

    /// The values of the first row vary more than ten times as much as the values of the two other rows. The
    /// times of the second and the third row are 10% apart.
    #[test]
    fn a_noisy_row_of_three_does_not_hide_a_difference_between_the_others() {
        let noisy = [0.3, -0.2, 0.5, 0.1];
        let (one, other) = ([0.001, -0.002, 0.0, 0.002], [0.099, 0.1, 0.102, 0.101]);
        let pooled = Pooled::of(&[&noisy, &one, &other], &[&noisy, &one, &other]);
        let differences = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<f64>>();
        let steady = pooled.of_difference(&differences(&other, &one), [1, 1]);
        assert!(steady.degrees == 3.0 && steady.reach(0.025) < 0.01, "{steady:?}");
        let unsteady = pooled.of_difference(&differences(&noisy, &one), [1, 1]);
        assert!(unsteady.degrees == 3.0 && unsteady.error > 0.1, "{unsteady:?}");
        let usual = pooled.usual().map(|error| error.reach(0.025));
        assert!(usual.is_some_and(|reach| reach < 0.05), "{usual:?}");
    }

    /// The values of seven rows vary by about 0.01 from column to column, and the values of one row by about
    /// 0.1.
    #[test]
    fn a_row_that_is_unsteadier_than_the_others_borrows_nothing() {
        let cell = |row: usize, column: usize| [0.0, 0.01, 0.02, 0.01][(row + column) % 4];
        let mut rows: Vec<Vec<f64>> =
            (0..8).map(|row| (0..4).map(|column| cell(row, column)).collect()).collect();
        rows[0] = vec![0.1, -0.1, 0.05, -0.12];
        let rows: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
        let mut pooled = Pooled::of(&rows, &rows);
        let differences =
            |a: usize, b: usize| -> Vec<f64> { rows[a].iter().zip(rows[b]).map(|(a, b)| a - b).collect() };
        let unsteady = pooled.of_difference(&differences(0, 1), [1, 1]);
        let own = (variance(&differences(0, 1)) / 4.0).sqrt();
        assert!(unsteady.degrees == 3.0 && (unsteady.error - own).abs() < 1e-12, "{unsteady:?} {own}");
        let steady = pooled.of_difference(&differences(1, 1), [1, 1]);
        assert!(steady.degrees > 3.5, "{steady:?}");
        // The error of the mean of the first row, which varies most, follows from this row alone, even if
        // other tables vary little.
        let own = Error { error: (variance(rows[0]) / 4.0).sqrt(), degrees: 3.0 };
        let of_level = |pooled: &Pooled| pooled.of_level(rows[0]);
        let is_own = |level: Error| (level.error - own.error).abs() < 1e-12 && level.degrees == own.degrees;
        assert!(is_own(of_level(&pooled)), "{:?}", of_level(&pooled));
        pooled.borrow(&[Pooled::of(&rows[1..], &rows[1..])]);
        assert!(is_own(of_level(&pooled)), "{:?}", of_level(&pooled));
        assert!(pooled.of_level(rows[1]).degrees > 3.0);
    }

    /// Two of five rows vary a hundred times as much as the other rows.
    #[test]
    fn steady_rows_are_not_judged_by_unsteady_ones() {
        let steady = [[0.00, 0.01, -0.01, 0.0], [1.01, 1.0, 1.0, 0.99], [2.0, 1.99, 2.0, 2.01]];
        let unsteady = [[3.0, 4.0, 2.0, 3.0], [5.0, 4.0, 4.0, 3.0]];
        let rows: Vec<&[f64]> = steady.iter().chain(&unsteady).map(|row| row.as_slice()).collect();
        let pooled = Pooled::of(&rows, &rows);
        let of = |one: usize, other: usize| {
            let differences: Vec<f64> = rows[one].iter().zip(rows[other]).map(|(a, b)| a - b).collect();
            pooled.of_difference(&differences, [1, 1]).error
        };
        assert!(of(0, 1) < 0.05 && of(1, 2) < 0.05, "{} {}", of(0, 1), of(1, 2));
        assert!(of(0, 3) > 0.2, "{}", of(0, 3));
        assert!(pooled.of_level(rows[0]).error < 0.1 * pooled.of_level(rows[3]).error);
    }

    /// A row is a point, and a column is a launch. Twenty of 37 points take 1.5 to 1.7 times as long in the second
    /// launch as in the others. Similar times were measured in a run of the paper's Figure 8 on a CPU.
    #[test]
    fn steady_rows_are_known_though_they_are_fewer_than_half() {
        let cell = |row: usize, column: usize| {
            let noise = 0.01 * ((row * 7 + column * 13) % 5) as f64;
            noise + if row < 20 && column == 1 { 0.4 + 0.05 * (row % 4) as f64 } else { 0.0 }
        };
        let rows: Vec<Vec<f64>> =
            (0..37).map(|row| (0..4).map(|column| cell(row, column)).collect()).collect();
        let steady_rows = steady(&rows.iter().map(|row| around_mean(row)).collect::<Vec<_>>());
        assert!(steady_rows.len() == 13 && steady_rows.iter().all(|row| *row >= 20), "{steady_rows:?}");
        let rows: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
        let pooled = Pooled::of(&rows, &rows);
        let differences: Vec<f64> = rows[20].iter().zip(rows[21]).map(|(a, b)| a - b).collect();
        let error = pooled.of_difference(&differences, [1, 1]);
        assert!(error.error < 0.05, "{error:?}");
    }

    #[test]
    fn few_rows_are_all_taken_for_steady() {
        let rows: Vec<Vec<f64>> = (0..8).map(|row| vec![f64::from(row), 0.0]).collect();
        for (count, expected) in [(2, 2), (5, 5), (7, 6), (8, 6)] {
            let steady_rows = steady(&rows[..count]);
            assert_eq!(steady_rows.len(), expected, "{count}");
            assert_eq!(
                steady_rows.iter().collect::<std::collections::HashSet<_>>().len(),
                expected,
                "{steady_rows:?}"
            );
        }
    }

    #[test]
    fn a_value_is_no_part_of_the_median_of_the_others() {
        let sorted = [1.0, 2.0, 4.0, 4.0, 8.0];
        assert_eq!(sorted.map(|own| median_of_others(&sorted, own)), [4.0, 4.0, 3.0, 3.0, 3.0]);
        let sorted = [1.0, 2.0, 4.0, 8.0];
        assert_eq!(sorted.map(|own| median_of_others(&sorted, own)), [4.0, 4.0, 2.0, 2.0]);
        assert_eq!(median_of_others(&[1.0, 2.0], 1.0), 2.0);
    }

    #[test]
    fn of_two_rows_the_pooled_spread_is_the_differences_own() {
        let (one, two) = ([1.0, 1.3, 0.9], [2.0, 2.1, 2.4]);
        let pooled = Pooled::of(&[&one, &two], &[&one, &two]);
        let differences: Vec<f64> = one.iter().zip(&two).map(|(a, b)| a - b).collect();
        assert!((2.0 * pooled.apart.variance - variance(&differences)).abs() < 1e-12);
        let expected = Error { error: (variance(&differences) / 3.0).sqrt(), degrees: 2.0 };
        assert_eq!(pooled.of_difference(&differences, [1, 1]), expected);
    }

    #[test]
    fn tables_of_one_machine_are_more_cases_of_its_launches() {
        let rows: [&[f64]; 2] = [&[0.0, 0.1, -0.1], &[1.0, 1.1, 0.9]];
        let alone = Pooled::of(&rows, &rows);
        let mut borrowing = alone;
        borrowing.borrow(&[alone, alone]);
        let (one, more) = (alone.of_level(rows[0]), borrowing.of_level(rows[0]));
        assert_eq!((one.degrees, more.degrees), (2.0, 6.0));
        let mut of_many = alone;
        of_many.borrow(&[alone; 9]);
        assert_eq!(of_many.of_level(rows[0]).degrees, 8.0, "many tables add at most six degrees of freedom");
        assert!((one.error - more.error).abs() < 1e-12 && more.reach(0.025) < 0.6 * one.reach(0.025));
        // If the launches in other tables differ more, the error of a row's mean in the table `borrowing`
        // grows too.
        let wide = [[0.0, 0.3, -0.3], [1.0, 1.3, 0.7]];
        let wide: Vec<&[f64]> = wide.iter().map(|row| row.as_slice()).collect();
        borrowing.borrow(&[Pooled::of(&wide, &wide)]);
        assert!(borrowing.of_level(rows[0]).error > 2.0 * one.error);
        borrowing = alone;
        borrowing.borrow(&[]);
        assert_eq!(borrowing.of_level(rows[0]), one);
    }

    #[test]
    fn a_pair_that_agrees_by_chance_borrows_the_others_spread() {
        let table = [[0.0, 0.1, -0.1], [1.0, 0.9, 1.1], [2.0, 2.1, 1.9], [3.0, 3.1, 2.9], [4.0, 4.0, 4.0]];
        let rows: Vec<&[f64]> = table.iter().map(|row| row.as_slice()).collect();
        let pooled = Pooled::of(&rows, &rows);
        let error = |differences: &[f64], rows| pooled.of_difference(differences, rows).error;
        assert!(error(&[0.0; 3], [1, 1]) > 0.02, "{}", error(&[0.0; 3], [1, 1]));
        assert!(error(&[-0.5, 0.5, 0.0], [1, 1]) > error(&[0.0; 3], [1, 1]));
        // The difference between two means of four points has half the error of a difference between two points.
        assert!((error(&[0.0; 3], [1, 1]) / error(&[0.0; 3], [4, 4]) - 2.0).abs() < 1e-12);
    }
}
