//! The paper's claims, each tested on what was measured on one device.
//!
//! Only what does not depend on how fast a device is can be tested: which of two is faster, which block size is best,
//! what fits. A comparison holds or does not only where the 95% intervals leave no doubt. The published values are the paper's own device's, which it does not name.

mod found;
mod sure;

use crate::record::Group;
use found::{
    Finding, Found, best_block, both, compounded, fastest_of_figure_8, nothing, occupancy_ranks,
    private_vectors, serial, shape_matters, small_scenes, split_forms,
};

/// Whether a claim held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// What was measured agrees.
    Held,
    /// What was measured disagrees.
    DidNotHold,
    /// The intervals overlap, or there are not enough samples.
    Unclear,
    /// Nothing was measured that could tell.
    Untested,
}

impl Verdict {
    /// Its class in the page.
    pub fn class(self) -> &'static str {
        match self {
            Self::Held => "held",
            Self::DidNotHold => "failed",
            Self::Unclear => "unclear",
            Self::Untested => "open",
        }
    }

    /// Every verdict, and its name in a count.
    pub const ALL: [(Self, &'static str); 4] = [
        (Self::Held, "held"),
        (Self::DidNotHold, "did not hold"),
        (Self::Unclear, "unclear"),
        (Self::Untested, "not measured"),
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Held => "held on this device",
            Self::DidNotHold => "did not hold on this device",
            Self::Unclear => "unclear on this device",
            Self::Untested => "not measured here",
        }
    }
}

/// A claim beside the measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct Claim {
    /// What the paper says.
    pub claim: &'static str,
    /// Its published values.
    pub published: &'static str,
    /// What we measured.
    pub ours: String,
    /// Whether it held.
    pub verdict: Verdict,
    /// Where the paper contradicts itself or arithmetic.
    pub contradiction: &'static str,
}

/// A claim, its published values, its contradiction, and the test.
type Test<'t> = (&'static str, &'static str, &'static str, &'t dyn Fn(&Found<'_>) -> Finding);

/// Every claim, tested on `device`, on the first of some runs that can tell: times of two runs are not compared, for
/// their rounds were not interleaved.
#[allow(clippy::too_many_lines, reason = "a list: one entry for each claim of the paper")]
pub fn claims(runs: &[Vec<Group<'_>>], device: &str) -> Vec<Claim> {
    let tests: [Test<'_>; 16] = [
        (
            "On the large scenes the naive kernel has one best block size.",
            "8 x 8 on teapot (10.4 s) and gourd (8.5 s)",
            "The text says 4 x 4; its own plots have their least value at 8 x 8.",
            &|f| both(best_block(f, "teapot", 8), best_block(f, "gourd", 8)),
        ),
        (
            "On the small scenes 4 x 4 is best.",
            "921 ms (triangle) and 1016 ms (pyramid), both at 4 x 4",
            "The text gives 4 x 4 for all scenes; it is so in the plots of the small ones only.",
            &|f| both(best_block(f, "triangle", 4), best_block(f, "pyramid-upper", 4)),
        ),
        (
            "From 1 x 1 to 4 x 4 the time falls many times over, since one work-item leaves the other lanes of its warp idle.",
            "10.8-fold on the teapot: 163 s to 15.1 s",
            "The text says that the time rises from 1 x 1 to 4 x 4; its plot has it fall.",
            &|f| f.at_least("teapot", ("naive", [1, 1]), ("naive", [4, 4]), 5.0),
        ),
        (
            "On small scenes the triangles hardly matter: one triangle and six take about as long.",
            "921 and 1016 ms: a tenth apart",
            "",
            &small_scenes,
        ),
        (
            "Optimisation 1, working vectors in local memory, is faster than naive at 8 x 8.",
            "1133 against 1738 ms: 1.53 times as fast",
            "",
            &|f| f.faster("still-life", ("local-vectors", [8, 8]), ("naive", [8, 8])),
        ),
        (
            "Optimisation 1 at 8 x 8 is the fastest of all.",
            "1133 ms, the least value in Figure 8",
            "",
            &fastest_of_figure_8,
        ),
        (
            "Optimisation 2, triangles in local memory, loses on small work-groups, because each of them copies the whole scene.",
            "at 4 x 4: 6424 against 2230 ms, 2.9 times as slow",
            "From 10 x 10 on its own plot has optimisation 2 level with naive or ahead of it (1701 against 2117 ms at 12 x 12).",
            &|f| f.faster("still-life", ("naive", [4, 4]), ("local-triangles", [4, 4])),
        ),
        (
            "Optimisation 2 cannot hold the large scenes.",
            "472 triangles of 104 B in 48 KiB; teapot 1026, gourd 650",
            "Indexed 16-bit storage (gourd 15.7 KB, teapot 31 KB) fits 48 KB: the paper's own next step removes this failure.",
            &|f| f.infeasible("teapot", "local-triangles", None),
        ),
        (
            "The two optimisations could not be compounded.",
            "the launch failed",
            "By arithmetic 206 triangles still fit beside the vectors of 16 x 16 work-items in 48 KiB.",
            &compounded,
        ),
        (
            "Working vectors in statically allocated (private) arrays fail to launch.",
            "failed to launch",
            "",
            &private_vectors,
        ),
        (
            "32 x 32 work-items cannot run optimisation 1, and so were left out.",
            "left out; 108 B x 1024 = 110,592 B",
            "Figure 5 nevertheless predicts 1024 threads at 32 x 32; with its 63 registers (64,512 of 32,768) not even the naive kernel launches there.",
            &|f| f.infeasible("still-life", "local-vectors", Some([32, 32])),
        ),
        (
            "Spatial locality of threads does not matter, and divergence little: only the number of work-items counts.",
            "no values",
            "",
            &shape_matters,
        ),
        (
            "Predicted occupancy says which block size is best (Figure 5).",
            "1536 threads at 16 x 16",
            "With 63 registers compute capability 2.0 holds 512 threads at 16 x 16, not 1536; the prediction leaves registers out.",
            &occupancy_ranks,
        ),
        (
            "A serial baseline would be far slower.",
            "promised, never reported",
            "The paper gives no serial time, so its speed-ups have no base.",
            &serial,
        ),
        ("Next step: a rasteriser is faster than casting.", "not done", "", &|f| {
            f.faster_best("teapot", "raster", "naive")
        }),
        (
            "Next step: one of the OBJ's two sets in local memory lets the large scenes run from it.",
            "not done",
            "",
            &split_forms,
        ),
    ];
    let claim = |(claim, published, contradiction, test): Test<'_>| {
        let findings = runs.iter().map(|groups| test(&Found { groups, device }));
        let told = findings.into_iter().find(|(_, verdict)| *verdict != Verdict::Untested);
        let (ours, verdict) = told.unwrap_or_else(nothing);
        Claim { claim, published, ours, verdict, contradiction }
    };
    tests.into_iter().map(claim).collect()
}

/// Contradictions that no measurement is needed for.
pub const OTHER_CONTRADICTIONS: [&str; 4] = [
    "The text lists five scenes; Figure 6's legend has four.",
    "Figures 6 to 8 have no point at 14 x 14, though the text names the size.",
    "There are no repeats, no error bars and no device name, so none of its differences can be called significant.",
    "Figure 3's caption puts the lower light at (2, 0, 0); the picture is lit from (3, 0.95, -1.5).",
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Record;
    use crate::record::fixtures::{few, infeasible, measured};
    use crate::record::groups;

    fn verdict(records: &[Record], claim: &str) -> Verdict {
        let claims = claims(&[groups(records)], "gpu");
        claims.iter().find(|one| one.claim.contains(claim)).map_or(Verdict::Untested, |one| one.verdict)
    }

    #[test]
    fn the_paper_can_hold_fail_and_stay_open() {
        let records = [
            measured("gpu", "naive", 1, [99.0, 101.0]),
            measured("gpu", "naive", 4, [9.0, 11.0]),
            measured("gpu", "naive", 8, [5.0, 6.0]),
            infeasible("gpu", "local-triangles", 8, "__local memory: scene 104 B x 1026"),
        ];
        assert_eq!(verdict(&records, "1 x 1 to 4 x 4"), Verdict::Held);
        assert_eq!(verdict(&records, "cannot hold the large"), Verdict::Held);
        assert_eq!(verdict(&records, "rasteriser"), Verdict::Untested);
        let slower = [measured("gpu", "naive", 1, [1.0, 1.1]), measured("gpu", "naive", 4, [9.0, 11.0])];
        assert_eq!(verdict(&slower, "1 x 1 to 4 x 4"), Verdict::DidNotHold);
    }

    #[test]
    fn times_of_two_runs_are_not_compared() {
        let of = |name: &str, ends| Record { scene: "still-life".into(), ..measured("gpu", name, 8, ends) };
        let [fast, slow] = [[of("local-vectors", [1.0, 1.1])], [of("naive", [2.0, 2.1])]];
        let told = |runs: &[Vec<Group<'_>>]| {
            let claims = claims(runs, "gpu");
            claims.iter().find(|one| one.claim.contains("is faster than naive")).map(|one| one.verdict)
        };
        assert_eq!(told(&[groups(&fast), groups(&slow)]), Some(Verdict::Untested));
        let both = [fast, slow].concat();
        assert_eq!(told(&[groups(&[]), groups(&both)]), Some(Verdict::Held));
    }

    #[test]
    fn few_samples_are_no_verdict() {
        let slow = few("gpu", "naive", 1, 100.0, 4);
        let records =
            [slow.clone(), measured("gpu", "naive", 4, [9.0, 11.0]), measured("gpu", "naive", 8, [5.0, 6.0])];
        for claim in ["1 x 1 to 4 x 4", "one best block size"] {
            assert_eq!(verdict(&records, claim), Verdict::Unclear, "{claim}");
        }
        let claims = claims(&[groups(&records)], "gpu");
        assert!(claims[0].ours.contains("not enough samples: 1 x 1 (n = 4)"), "{}", claims[0].ours);
        let baseline = Record { strategy: "serial-f32".into(), ..few("host", "serial", 0, 1798.0, 1) };
        let with = [baseline, records[2].clone()];
        assert_eq!(verdict(&with, "serial baseline"), Verdict::Unclear);
    }

    #[test]
    fn a_tie_is_no_verdict() {
        let tie = [
            measured("gpu", "naive", 4, [9.0, 11.0]),
            measured("gpu", "naive", 8, [9.5, 11.5]),
            measured("gpu", "naive", 16, [19.5, 21.5]),
        ];
        let (text, verdict) = best_block(&Found { groups: &groups(&tie), device: "gpu" }, "teapot", 8);
        assert_eq!(verdict, Verdict::Unclear);
        assert!(text.contains("tie"), "{text}");
    }
}
