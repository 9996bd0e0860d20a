//! The spread of a point's repeated values, and the resulting error of their mean.

use super::error::Error;
use crate::measure::mean_and_sigma;
use std::f64::consts::LN_2;

/// The largest weight, in degrees of freedom, with which the spread of all points is added to a pair's own spread.
const BORROWED: usize = 6;
/// A row's variance counts as at most this multiple of the typical variance: four times the standard deviation. By
/// chance, one variance in nine million exceeds this limit if all points are alike (two degrees of freedom).
const MOST_TIMES: f64 = 16.0;
/// When the typical variance is computed, a row's variance counts as at least this fraction of the mean.
const LEAST_SHARE: f64 = 1e-4;
/// The Euler-Mascheroni constant.
const EULER: f64 = 0.577_215_664_901_532_9;

/// The spread of repeated values, pooled over all points. The table has a row per point and a column per
/// repeat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pooled {
    /// The usual variance of a row's residuals after subtracting each row's and each column's mean.
    apart: f64,
    /// The usual variance of a row; it includes effects that all rows share.
    together: f64,
    rows: usize,
    columns: usize,
    /// The square root of the mean variance `together` of other tables, with the degrees of freedom of this mean.
    elsewhere: Error,
}

impl Pooled {
    /// Pools two tables of the same shape: the medians without drift, and the plain medians.
    pub(super) fn of(relative: &[&[f64]], plain: &[&[f64]]) -> Self {
        let (rows, columns) = (relative.len(), relative.first().map_or(0, |row| row.len()));
        let together = usual(&plain.iter().map(|row| variance(row)).collect::<Vec<_>>(), columns);
        let elsewhere = Error { error: 0.0, degrees: 0.0 };
        Self { apart: interaction(relative), together, rows, columns, elsewhere }
    }

    /// Returns the error of the mean of `differences`. There is one difference per column, between the mean of
    /// `rows[0]` rows and the mean of `rows[1]` others.
    pub(super) fn of_difference(&self, differences: &[f64], rows: [usize; 2]) -> Error {
        let borrowed = BORROWED.min(self.rows.saturating_sub(2) * (self.columns - 1));
        let usual: f64 = rows.iter().map(|rows| self.apart / *rows as f64).sum();
        let variance = self.moderated(usual, borrowed, variance(differences));
        self.error(variance, borrowed + self.columns - 1)
    }

    /// Returns the error of a row's mean. Effects of a column are common to all rows, so other rows of the same table
    /// add no information about these effects. Other tables add information.
    pub(super) fn of_level(&self, row: &[f64]) -> Error {
        let borrowed = BORROWED.min(self.rows.saturating_sub(1) * (self.columns - 1));
        let own = self.moderated(self.together, borrowed, variance(row));
        let (columns, elsewhere) = (self.columns as f64 - 1.0, self.elsewhere);
        let degrees = columns + elsewhere.degrees;
        let variance = (columns * own + elsewhere.degrees * elsewhere.error.powi(2)) / degrees;
        Error { degrees, ..self.error(variance, 0) }
    }

    /// Returns whether both tables have the same number of repeats, and more than one.
    pub(super) fn has_repeats_as(&self, other: &Self) -> bool {
        self.columns > 1 && self.columns == other.columns
    }

    /// Adds the spread of repeated values in other tables of the same run and machine.
    pub(super) fn borrow(&mut self, others: &[Self]) {
        let degrees = |other: &Self| other.columns.saturating_sub(1) as f64;
        let all: f64 = others.iter().map(degrees).sum();
        if all > 0.0 {
            let variance = others.iter().map(|other| degrees(other) * other.together).sum::<f64>() / all;
            self.elsewhere = Error { error: variance.sqrt(), degrees: all.min(BORROWED as f64) };
        }
    }

    /// Returns the error of the difference between two rows of typical spread; `None` for a single row.
    pub(super) fn usual(&self) -> Option<Error> {
        let borrowed = BORROWED.min(self.rows.saturating_sub(2) * (self.columns.saturating_sub(1)));
        (self.rows > 1).then(|| self.error(2.0 * self.apart, borrowed + self.columns - 1))
    }

    /// Returns the weighted mean of a row's own variance, which has few degrees of freedom, and the
    /// typical variance.
    fn moderated(&self, usual: f64, borrowed: usize, own: f64) -> f64 {
        let (borrowed, columns) = (borrowed as f64, self.columns as f64 - 1.0);
        (borrowed * usual + columns * own) / (borrowed + columns)
    }

    fn error(&self, variance: f64, degrees: usize) -> Error {
        Error { error: (variance / self.columns as f64).sqrt(), degrees: degrees as f64 }
    }
}

fn variance(values: &[f64]) -> f64 {
    mean_and_sigma(values).1.powi(2)
}

/// Returns the usual variance of a row's residuals in a two-way table after subtracting row and column means;
/// 0 for a single row or column.
fn interaction(table: &[&[f64]]) -> f64 {
    let (rows, columns) = (table.len(), table.first().map_or(0, |row| row.len()));
    if rows < 2 || columns < 2 {
        return 0.0;
    }
    let column = |place: usize| table.iter().map(|row| row[place]).sum::<f64>() / rows as f64;
    let columns_means: Vec<f64> = (0..columns).map(column).collect();
    let all = columns_means.iter().sum::<f64>() / columns as f64;
    // The means of the columns use up columns - 1 degrees of freedom, which all rows share.
    let left = (columns - 1) as f64 * (rows - 1) as f64 / rows as f64;
    let of_row = |row: &&[f64]| {
        let mean = row.iter().sum::<f64>() / columns as f64;
        let residuals = row.iter().zip(&columns_means).map(|(value, column)| value - mean - column + all);
        residuals.map(|residual| residual.powi(2)).sum::<f64>() / left
    };
    usual(&table.iter().map(of_row).collect::<Vec<_>>(), columns)
}

/// Returns the mean of the rows' variances, where a variance counts as at most [`MOST_TIMES`] times the typical
/// variance. One row that varies far more than the others, such as a caster on the host whose threads wait for each
/// other, thus does not widen the intervals of all rows. With fewer than three rows, no row can stand out.
fn usual(variances: &[f64], columns: usize) -> f64 {
    let mean_of = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / variances.len().max(1) as f64;
    let mean = mean_of(&mut variances.iter().copied());
    if variances.len() < 3 || columns < 2 || mean == 0.0 {
        return mean;
    }
    // A clock with coarse steps can show a row without any variance.
    let logs = mean_of(&mut variances.iter().map(|variance| variance.max(LEAST_SHARE * mean).ln()));
    let typical = (logs - log_bias(columns - 1)).exp();
    mean_of(&mut variances.iter().map(|variance| variance.min(MOST_TIMES * typical)))
}

/// Returns how far the logarithm of a variance with `degrees` degrees of freedom is off on average: digamma(d / 2)
/// - ln(d / 2), by the recurrence of digamma.
fn log_bias(degrees: usize) -> f64 {
    let half = 0.5 * degrees as f64;
    let (mut at, mut digamma) =
        if degrees.is_multiple_of(2) { (1.0, -EULER) } else { (0.5, -EULER - 2.0 * LN_2) };
    while at < half {
        digamma += 1.0 / at;
        at += 1.0;
    }
    digamma - half.ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_rows_and_columns_share_is_no_interaction() {
        assert!(interaction(&[&[1.0, 2.0, 4.0], &[11.0, 12.0, 14.0]]) < 1e-20);
        // By hand: residuals of +-0.5 in all four cells, one degree of freedom.
        assert_eq!(interaction(&[&[1.0, 0.0], &[0.0, 1.0]]), 1.0);
        assert_eq!(interaction(&[&[1.0, 9.0]]), 0.0);
    }

    #[test]
    fn the_usual_variance_is_right_on_average_and_hardly_moved_by_one_row() {
        // digamma(1) = -0.5772, digamma(1/2) = -1.9635, digamma(3/2) = 0.0365, digamma(2) = 0.4228.
        for (degrees, digamma) in [(1, -1.9635), (2, -0.5772), (3, 0.0365), (4, 0.4228)] {
            let expected = digamma - (0.5 * f64::from(degrees)).ln();
            assert!((log_bias(degrees as usize) - expected).abs() < 1e-4, "{degrees}");
        }
        // Variances with two degrees of freedom are distributed exponentially: these are their quantiles.
        let mut variances: Vec<f64> =
            (0..1000).map(|k| -(1.0 - (f64::from(k) + 0.5) / 1000.0).ln()).collect();
        assert!((usual(&variances, 3) - 1.0).abs() < 0.01, "{}", usual(&variances, 3));
        variances.retain(|variance| *variance > 0.9 && *variance < 1.1);
        let (rows, before) = (variances.len() as f64, usual(&variances, 3));
        variances[0] = 1e4;
        assert!(usual(&variances, 3) < before * (1.0 + 35.0 / rows), "{} {before}", usual(&variances, 3));
        assert_eq!((usual(&[1.0, 3.0], 3), usual(&[0.0; 4], 3)), (2.0, 0.0));
    }

    #[test]
    fn of_two_rows_the_pooled_spread_is_the_differences_own() {
        let (one, two) = ([1.0, 1.3, 0.9], [2.0, 2.1, 2.4]);
        let pooled = Pooled::of(&[&one, &two], &[&one, &two]);
        let differences: Vec<f64> = one.iter().zip(&two).map(|(a, b)| a - b).collect();
        assert!((2.0 * pooled.apart - variance(&differences)).abs() < 1e-12);
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
        // If launches differ more in other tables, the error of this table grows too.
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
        // The mean of four points has half the error of a single point.
        assert!((error(&[0.0; 3], [1, 1]) / error(&[0.0; 3], [4, 4]) - 2.0).abs() < 1e-12);
    }
}
