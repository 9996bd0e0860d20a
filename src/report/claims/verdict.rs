//! Defines the verdict on a claim of the student paper that raycl reproduces, and the comparisons that lead
//! to the verdict.

/// The verdict on a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The measurement agrees with the claim.
    Held,
    /// The measurement contradicts the claim.
    NotHeld,
    /// The measurement does not decide the claim. For example, a bound of the claimed range lies within the
    /// 95% interval of a ratio, or between the quartiles of a latency. A claim is also undecided if there are
    /// too few samples, if a measurement was not completed, or if only some of its comparisons could be made.
    Unclear,
    /// The claim cannot be tested with the records of this device.
    Cannot,
}

impl Verdict {
    /// Every verdict with its name in words, its CSS class in the page and its sign.
    pub const ALL: [(Self, &'static str, &'static str, &'static str); 4] = [
        (Self::Held, "held", "held", "✓"),
        (Self::NotHeld, "did not hold", "failed", "✗"),
        (Self::Unclear, "unclear", "unclear", "?"),
        (Self::Cannot, "cannot be tested here", "open", "–"),
    ];

    fn row(self) -> &'static (Self, &'static str, &'static str, &'static str) {
        Self::ALL.iter().find(|(verdict, ..)| *verdict == self).unwrap_or(&Self::ALL[3])
    }

    /// Returns the verdict in words, such as "did not hold".
    pub fn name(self) -> &'static str {
        self.row().1
    }

    /// Returns the verdict's CSS class in the page.
    pub fn class(self) -> &'static str {
        self.row().2
    }

    /// Returns the verdict's sign in the page, such as ✓.
    pub fn sign(self) -> &'static str {
        self.row().3
    }

    /// Returns the verdict of a claim from the verdicts of its comparisons (`parts`). The claim holds if all
    /// comparisons hold. The claim does not hold if at least one comparison does not hold. The claim cannot be tested
    /// if no comparison can be tested. With any other mix of its comparisons' verdicts, the claim is unclear.
    pub(super) fn of_all(parts: impl Iterator<Item = Self> + Clone) -> Self {
        let all = |wanted: Self| parts.clone().all(|part| part == wanted);
        match () {
            () if parts.clone().any(|part| part == Self::NotHeld) => Self::NotHeld,
            () if all(Self::Cannot) => Self::Cannot,
            () if all(Self::Held) => Self::Held,
            () => Self::Unclear,
        }
    }
}

/// Whether a run has all data that a comparison needs. If every run lacks data, the page prefers a result
/// line with `Incomplete` to a result line with `NoRecord`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Data {
    /// The run has all data that the comparison needs.
    Complete,
    /// No record of the compared points is missing, but the comparison lacks other data, such as a time, or
    /// cannot be made at all.
    Incomplete,
    /// The run has no record of a compared point or latency.
    NoRecord,
}

/// The result of one comparison that a test makes.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// The measured values in words.
    pub text: String,
    /// The comparison's verdict.
    pub verdict: Verdict,
    /// The data that raycl would need to decide the comparison, such as a missing record or another device;
    /// empty if the comparison is decided.
    pub decides: String,
    /// Whether the run has all data that the comparison needs.
    pub(super) data: Data,
}

impl Line {
    pub(super) fn decided(text: String, held: bool) -> Self {
        let verdict = if held { Verdict::Held } else { Verdict::NotHeld };
        Self { text, verdict, decides: String::new(), data: Data::Complete }
    }

    pub(super) fn unclear(text: String, decides: String) -> Self {
        Self { text, verdict: Verdict::Unclear, decides, data: Data::Complete }
    }

    pub(super) fn cannot(text: String, decides: String) -> Self {
        Self { text, verdict: Verdict::Cannot, decides, data: Data::Incomplete }
    }
}

#[cfg(test)]
mod tests {
    use super::Verdict;

    /// The CSS classes that this test expects are the classes in templates/page.css.
    #[test]
    fn each_verdict_has_its_own_words_class_and_sign() {
        let all = [Verdict::Held, Verdict::NotHeld, Verdict::Unclear, Verdict::Cannot];
        let shown = all.map(|verdict| [verdict.name(), verdict.class(), verdict.sign()]);
        let expected = [
            ["held", "held", "✓"],
            ["did not hold", "failed", "✗"],
            ["unclear", "unclear", "?"],
            ["cannot be tested here", "open", "–"],
        ];
        assert_eq!(shown, expected);
    }
}
