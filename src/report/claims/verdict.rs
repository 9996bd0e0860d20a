//! Whether a claim held, and each comparison that says so.

/// Whether a claim held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The measurement agrees.
    Held,
    /// The measurement disagrees.
    NotHeld,
    /// The intervals leave it open, or there are not enough samples, or a part has no record.
    Unclear,
    /// Nothing here can tell.
    Cannot,
}

impl Verdict {
    /// Every verdict, its name in a count, its class in the page and its sign.
    pub const ALL: [(Self, &'static str, &'static str, &'static str); 4] = [
        (Self::Held, "held", "held", "✓"),
        (Self::NotHeld, "did not hold", "failed", "✗"),
        (Self::Unclear, "unclear", "unclear", "?"),
        (Self::Cannot, "cannot be tested here", "open", "–"),
    ];

    fn row(self) -> &'static (Self, &'static str, &'static str, &'static str) {
        Self::ALL.iter().find(|(verdict, ..)| *verdict == self).unwrap_or(&Self::ALL[3])
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        self.row().1
    }

    /// Its class in the page.
    pub fn class(self) -> &'static str {
        self.row().2
    }

    /// Its sign in the page.
    pub fn sign(self) -> &'static str {
        self.row().3
    }

    /// The one rule: a claim holds where all that it takes holds, and does not where one part surely does not; where nothing
    /// here can tell of any part, it cannot be tested; everything else is unclear.
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

/// One comparison of a test.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// The measurement in words.
    pub text: String,
    /// Its verdict.
    pub verdict: Verdict,
    /// The measurement that would decide it; empty if it is decided.
    pub decides: String,
}

impl Line {
    pub(super) fn decided(text: String, held: bool) -> Self {
        let verdict = if held { Verdict::Held } else { Verdict::NotHeld };
        Self { text, verdict, decides: String::new() }
    }

    pub(super) fn unclear(text: String, decides: String) -> Self {
        Self { text, verdict: Verdict::Unclear, decides }
    }

    pub(super) fn cannot(text: String, decides: String) -> Self {
        Self { text, verdict: Verdict::Cannot, decides }
    }
}
