//! How far repeats of a point lie apart, and how sure that makes their mean.

use crate::measure::mean_and_sigma;
use crate::measure::student::t975;

/// The most degrees of freedom by which the spread of all points counts beside a pair's own.
const BORROWED: usize = 6;

/// What all points together tell of the spread of repeats: a row a point, a column a repeat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pooled {
    /// The variance of what is left of a table when each row's and each column's mean is taken away.
    apart: f64,
    /// The mean of the rows' own variances, what all rows share included.
    together: f64,
    rows: usize,
    columns: usize,
}

impl Pooled {
    /// Of two tables of the same shape: of what is left without drift, and of plain medians.
    pub(super) fn of(relative: &[&[f64]], plain: &[&[f64]]) -> Self {
        let (rows, columns) = (relative.len(), relative.first().map_or(0, |row| row.len()));
        let together = plain.iter().map(|row| variance(row)).sum::<f64>() / rows.max(1) as f64;
        Self { apart: interaction(relative), together, rows, columns }
    }

    /// Half of the 95% interval of the mean of `differences` between two rows, a value a column.
    pub(super) fn of_difference(&self, differences: &[f64]) -> f64 {
        let borrowed = BORROWED.min(self.rows.saturating_sub(2) * (self.columns - 1));
        let variance = self.moderated(2.0 * self.apart, borrowed, variance(differences));
        self.half(variance, borrowed + self.columns - 1)
    }

    /// Half of the 95% interval of a row's level. What the columns share, all rows have in common: no row can borrow from
    /// another how well that is known.
    pub(super) fn of_level(&self, row: &[f64]) -> f64 {
        let borrowed = BORROWED.min(self.rows.saturating_sub(1) * (self.columns - 1));
        let variance = self.moderated(self.together, borrowed, variance(row));
        self.half(variance, self.columns - 1)
    }

    /// Half of the 95% interval of a difference between two rows of usual spread; none where there is but one row.
    pub(super) fn usual(&self) -> Option<f64> {
        let borrowed = BORROWED.min(self.rows.saturating_sub(2) * (self.columns.saturating_sub(1)));
        (self.rows > 1).then(|| self.half(2.0 * self.apart, borrowed + self.columns - 1))
    }

    /// A variance between the row's own, which has few degrees of freedom, and the usual one, weighted by theirs.
    fn moderated(&self, usual: f64, borrowed: usize, own: f64) -> f64 {
        let (borrowed, columns) = (borrowed as f64, self.columns as f64 - 1.0);
        (borrowed * usual + columns * own) / (borrowed + columns)
    }

    fn half(&self, variance: f64, degrees: usize) -> f64 {
        t975(degrees) * (variance / self.columns as f64).sqrt()
    }
}

fn variance(values: &[f64]) -> f64 {
    mean_and_sigma(values).1.powi(2)
}

/// The variance of what rows and columns leave unexplained in a two-way table; 0 of one row or one column.
fn interaction(table: &[&[f64]]) -> f64 {
    let (rows, columns) = (table.len(), table.first().map_or(0, |row| row.len()));
    if rows < 2 || columns < 2 {
        return 0.0;
    }
    let column = |place: usize| table.iter().map(|row| row[place]).sum::<f64>() / rows as f64;
    let columns_means: Vec<f64> = (0..columns).map(column).collect();
    let all = columns_means.iter().sum::<f64>() / columns as f64;
    let squares = table.iter().map(|row| {
        let mean = row.iter().sum::<f64>() / columns as f64;
        row.iter()
            .zip(&columns_means)
            .map(|(value, column)| (value - mean - column + all).powi(2))
            .sum::<f64>()
    });
    squares.sum::<f64>() / ((rows - 1) * (columns - 1)) as f64
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
    fn of_two_rows_the_pooled_spread_is_the_differences_own() {
        let (one, two) = ([1.0, 1.3, 0.9], [2.0, 2.1, 2.4]);
        let pooled = Pooled::of(&[&one, &two], &[&one, &two]);
        let differences: Vec<f64> = one.iter().zip(&two).map(|(a, b)| a - b).collect();
        assert!((2.0 * pooled.apart - variance(&differences)).abs() < 1e-12);
        let expected = 4.303 * (variance(&differences) / 3.0).sqrt();
        assert!((pooled.of_difference(&differences) - expected).abs() < 1e-12, "two degrees of freedom");
    }

    #[test]
    fn a_pair_that_agrees_by_chance_borrows_the_others_spread() {
        let table = [[0.0, 0.1, -0.1], [1.0, 0.9, 1.1], [2.0, 2.1, 1.9], [3.0, 3.1, 2.9], [4.0, 4.0, 4.0]];
        let rows: Vec<&[f64]> = table.iter().map(|row| row.as_slice()).collect();
        let pooled = Pooled::of(&rows, &rows);
        assert!(pooled.of_difference(&[0.0; 3]) > 0.05, "{}", pooled.of_difference(&[0.0; 3]));
        assert!(pooled.of_difference(&[-0.5, 0.5, 0.0]) > pooled.of_difference(&[0.0; 3]));
    }
}
