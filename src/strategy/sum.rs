//! Sums of bytes. A sum stores its terms, so that messages can show the arithmetic.

use super::infeasible::Infeasible;

/// A sum of bytes with its terms. If the sum is too large for a `u128`, `bytes` is the largest `u128`.
#[derive(Clone, Debug, Default)]
pub(super) struct Sum {
    pub bytes: u128,
    /// The terms of the sum of bytes: for each term, its number of bytes, and its arithmetic as text.
    terms: Vec<(u128, String)>,
}

impl Sum {
    pub fn add(&mut self, what: &str, factors: &[(u64, &str)]) {
        let bytes =
            factors.iter().fold(1_u128, |bytes, (factor, _)| bytes.saturating_mul(u128::from(*factor)));
        let factors: Vec<_> = factors.iter().map(|(factor, unit)| format!("{factor}{unit}")).collect();
        self.bytes = self.bytes.saturating_add(bytes);
        self.terms.push((bytes, format!("{what} {}", factors.join(" x "))));
    }

    /// Adds all terms of another sum to this sum.
    pub fn join(&mut self, other: Self) {
        self.bytes = self.bytes.saturating_add(other.bytes);
        self.terms.extend(other.terms);
    }

    /// Returns the sum as a `u64`, the type of the sums in records. If the sum is too large for this type, returns the
    /// largest `u64`.
    pub fn recorded(&self) -> u64 {
        self.bytes.try_into().unwrap_or(u64::MAX)
    }

    /// Returns true if the sum of all bytes is at most `limit_bytes`.
    pub fn fits(&self, limit_bytes: u64) -> bool {
        self.bytes <= u128::from(limit_bytes)
    }

    /// Returns an error, with the sum's arithmetic, if the sum exceeds the limit.
    pub fn within(&self, memory: &str, limit_bytes: u64) -> Result<(), Infeasible> {
        if self.fits(limit_bytes) {
            return Ok(());
        }
        let terms: Vec<_> = self.terms.iter().map(|(_, term)| term.as_str()).collect();
        let (sum, bytes) = (terms.join(" + "), self.bytes);
        Err(Infeasible::beyond(format!("{memory}: {sum} = {bytes} B > {limit_bytes} B")))
    }

    /// Returns an error, with the largest term's arithmetic, if this term exceeds the limit. The sum must have
    /// one term per buffer, since the limit is the size of the device's largest buffer.
    pub fn each_within(&self, limit_bytes: u64) -> Result<(), Infeasible> {
        match self.terms.iter().max_by_key(|(bytes, _)| bytes) {
            Some((bytes, term)) if *bytes > u128::from(limit_bytes) => {
                let memory = Infeasible::LARGEST_BUFFER;
                Err(Infeasible::beyond(format!("{memory}: {term} = {bytes} B > {limit_bytes} B")))
            }
            _ => Ok(()),
        }
    }
}
