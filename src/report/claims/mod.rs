//! Quotes the claims of the student paper that raycl reproduces, and tests each claim on the records of one
//! device.
//!
//! The claims are in `claims.toml`, each with its sentence in the paper, the figure to which it refers, and
//! the tests that must hold. Absolute times are not tested, since the paper does not name the device on which
//! they were measured. The tests find out, for example, which of two points is faster and by how much, which
//! block size is best, and whether a scene fits into `__local` memory. The same rule decides all claims: see
//! [`Verdict::of_all`].

mod claim_data;
mod kinds;
mod point;
mod sure;
mod table;
mod verdict;

pub use claim_data::{Run, completion};
pub use sure::Ratio;
pub use table::{Row, table};
pub use verdict::{Line, Verdict};

use claim_data::ClaimData;
use verdict::Data;

/// A claim of the paper and the results of its tests.
#[derive(Clone, Debug)]
pub struct Claim {
    /// The paper's claim.
    pub row: Row,
    /// The results of the comparisons that the claim's tests make.
    pub lines: Vec<Line>,
    /// The verdict on the claim.
    pub verdict: Verdict,
}

impl Claim {
    /// Returns what raycl would need to decide the claim, such as a missing record or another device, without
    /// repetitions. Returns an empty list if the claim is decided.
    pub fn decides(&self) -> Vec<&str> {
        let mut all: Vec<&str> = Vec::new();
        let open = matches!(self.verdict, Verdict::Unclear | Verdict::Cannot);
        for line in self.lines.iter().filter(|line| open && !line.decides.is_empty()) {
            if !all.contains(&line.decides.as_str()) {
                all.push(&line.decides);
            }
        }
        all
    }
}

/// Tests the claims of `rows` on `device`. Each comparison uses the first run that has all data of the
/// comparison. Times of different runs are not compared, since they were not measured in the same rounds.
pub fn claims(rows: Vec<Row>, runs: &[Run<'_>], device: &str) -> Vec<Claim> {
    let claim = |row: Row| {
        let lines: Vec<Line> = row.test.iter().flat_map(|test| tested(test, &row, runs, device)).collect();
        let verdict = Verdict::of_all(lines.iter().map(|line| line.verdict));
        Claim { row, lines, verdict }
    };
    rows.into_iter().map(claim).collect()
}

/// Returns the result lines of a test, one per comparison. If no run has all data of a comparison, the line
/// comes from the run that lacks the least data (see [`Data`]). Among runs that lack equally much data, a run
/// of one of the claim's configs is preferred, since other configs need not measure all points of the claim.
fn tested(test: &table::Test, row: &Row, runs: &[Run<'_>], device: &str) -> Vec<Line> {
    let of = |run: &Run<'_>| -> Vec<((Data, bool), Line)> {
        let is_other = !row.configs.contains(&run.folder.label);
        let lines = kinds::lines(test, &ClaimData { run, device }).into_iter();
        lines.map(|line| ((line.data, is_other && line.data != Data::Complete), line)).collect()
    };
    let most_complete = runs.iter().map(of).reduce(|known, more| {
        let pairs = known.into_iter().zip(more);
        pairs.map(|(known, more)| if more.0 < known.0 { more } else { known }).collect()
    });
    most_complete.unwrap_or_default().into_iter().map(|(_, line)| line).collect()
}

/// Contradictions and omissions in the paper that can be shown without a measurement.
pub const OTHER_CONTRADICTIONS: [&str; 4] = [
    "The paper's text lists five scenes, but the legend of Figure 6 has four.",
    "Figures 6 to 8 have no point at 14 x 14, although the text names this block size.",
    "The paper reports no repeated measurements and no error bars, so differences of about an eighth cannot \
     be distinguished from noise. The paper does not name its device either.",
    "Figure 3's caption puts the lower light at (2, 0, 0), but the picture is lit from (3, 0.95, -1.5).",
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::peak::{FILE, Figure, Peak};
    use crate::record::fixtures::{few, infeasible, judged, measured};
    use crate::record::{Folder, Outcome, Record, groups};

    /// Returns a claim with the test `test`. Each element of `records` contains the records of one run.
    fn claim(test: &str, records: &[&[Record]]) -> Claim {
        claim_in(&Folder::default(), test, records)
    }

    /// Returns a claim like [`claim`]; all runs are in `folder`.
    fn claim_in(folder: &Folder, test: &str, records: &[&[Record]]) -> Claim {
        let runs: Vec<(&Folder, &[Record])> = records.iter().map(|records| (folder, *records)).collect();
        claim_of(test, &runs)
    }

    /// Returns a claim like [`claim`]; each run has its own folder.
    fn claim_of(test: &str, folders: &[(&Folder, &[Record])]) -> Claim {
        let rest = "place = 'p'\npublished = 'v'\nreading = 'r'\nconfigs = ['figure-6']";
        let text = format!("[[claim]]\nsentence = 'S.'\n{rest}\ntest = [{{ {test} }}]\n");
        let rows = table::read("t", &text).expect("it reads");
        let folders: Vec<(&Folder, Vec<Record>)> =
            folders.iter().map(|(folder, records)| (*folder, judged(*records))).collect();
        let runs: Vec<Run<'_>> =
            folders.iter().flat_map(|(folder, records)| Run::of(folder, groups(records))).collect();
        claims(rows, &runs, "gpu").remove(0)
    }

    fn verdict(test: &str, records: &[Record]) -> Verdict {
        claim(test, &[records]).verdict
    }

    const FALLS: &str =
        "kind = 'ratio', of = ['naive 1x1 on teapot'], to = 'naive 4x4 on teapot', at_least = 5";

    #[test]
    fn a_claim_can_hold_or_not_or_stay_open() {
        let of = |ms| [measured("gpu", "naive", 1, ms), measured("gpu", "naive", 4, 10.0)];
        assert_eq!(verdict(FALLS, &of(100.0)), Verdict::Held);
        assert_eq!(verdict(FALLS, &of(1.05)), Verdict::NotHeld);
        let mut near = of(50.0);
        // In one of the two launches, the ratio of the points' times is below the claim's bound of 5; in the
        // other launch, it is above 5.
        near[0].samples_ms = [[45.0; 5], [55.0; 5]].concat();
        assert_eq!(verdict(FALLS, &near), Verdict::Unclear);
        let at_most = FALLS.replace("at_least", "at_most");
        assert_eq!(
            [of(20.0), of(100.0)].map(|records| verdict(&at_most, &records)),
            [Verdict::Held, Verdict::NotHeld]
        );
        let on_cpu = of(100.0).map(|record| Record { device: "cpu".into(), ..record });
        assert_eq!(verdict(FALLS, &on_cpu), Verdict::Cannot, "records of another device");
        let refused =
            claim(FALLS, &[&[infeasible("gpu", "naive", 1, "too large"), measured("gpu", "naive", 4, 1.0)]]);
        assert_eq!(refused.decides(), ["a device on which naive at 1 x 1 on teapot runs"]);
        let open = claim(FALLS, &[&of(9.05)[1..]]);
        assert_eq!(open.verdict, Verdict::Cannot);
        assert_eq!(open.lines[0].text, "no record of naive at 1 x 1 on teapot");
        assert_eq!(open.decides(), ["the missing record: `raycl reproduce --out . --resume`"]);
        for outcome in [Outcome::TimedOut, Outcome::Crashed, Outcome::WrongImage] {
            let record = Record { outcome, ..infeasible("gpu", "naive", 1, "why") };
            let result = claim(FALLS, &[&[record, measured("gpu", "naive", 4, 1.0)]]);
            assert_eq!(result.verdict, Verdict::Unclear, "{outcome:?}");
            assert_eq!(result.lines[0].text, "naive at 1 x 1 on teapot has no time: why");
            let command =
                "a complete measurement of this point: `raycl reproduce --out . --resume --retry-failed`";
            assert_eq!(result.decides(), [command]);
        }
    }

    #[test]
    fn a_complete_run_decides_for_another_run_in_which_a_point_crashed() {
        let both = [measured("gpu", "naive", 1, 100.0), measured("gpu", "naive", 4, 10.0)];
        let crashed = Record { outcome: Outcome::Crashed, ..infeasible("gpu", "naive", 1, "why") };
        assert_eq!(claim(FALLS, &[&[crashed, both[1].clone()], &both]).verdict, Verdict::Held);
    }

    #[test]
    fn a_command_names_the_folder_of_the_page() {
        let folder = Folder { path: "my results/figure-6".into(), ..Folder::default() };
        let result = claim_in(&folder, FALLS, &[&[measured("gpu", "naive", 4, 10.0)]]);
        let command = "the missing record: `raycl reproduce --out 'my results' --resume`";
        assert_eq!(result.decides(), [command]);
    }

    #[test]
    fn a_command_repeats_the_devices_and_the_changed_values_of_the_run() {
        let words =
            ["raycl", "reproduce", "--device", "gpu", "--device=my cpu", "--set", "image_sizes=[[8,5]]"];
        let overrides = ["image_sizes = [[8,5]]", "question = \"a = b?\""];
        let environment = serde_json::json!({"command_line": words, "overrides": overrides});
        let folder = Folder { environment, path: "out/figure-6".into(), ..Folder::default() };
        let result = claim_in(&folder, FALLS, &[&[measured("gpu", "naive", 4, 10.0)]]);
        let options =
            "--device gpu --device 'my cpu' --set 'image_sizes=[[8,5]]' --set 'question=\"a = b?\"'";
        assert_eq!(
            result.decides(),
            [format!("the missing record: `raycl reproduce --out out {options} --resume`")]
        );
    }

    #[test]
    fn of_several_runs_that_cannot_test_a_claim_the_one_that_lacks_least_is_reported() {
        let [own, other] =
            ["figure-6", "figure-8"].map(|label| Folder { label: label.into(), ..Folder::default() });
        let [one, eight] = [1, 8].map(|side| [measured("gpu", "naive", side, 10.0)]);
        let text = |test: &str, runs: &[(&Folder, &[Record])]| claim_of(test, runs).lines[0].text.clone();
        let missing = "no record of naive at 4 x 4 on teapot";
        assert_eq!(text(FALLS, &[(&other, &one[..]), (&other, &eight[..])]), missing, "the first of two");
        for runs in [[(&own, &one[..]), (&other, &eight[..])], [(&other, &eight[..]), (&own, &one[..])]] {
            assert_eq!(text(FALLS, &runs), missing, "the run of the claim's config");
        }
        let passes =
            "kind = 'passes', point = 'deferred 8x8 on teapot', of = 'shadow', to = 'primary', at_least = 2";
        let deferred = [measured("gpu", "deferred", 8, 10.0)];
        let line = text(passes, &[(&other, &deferred[..]), (&own, &one[..])]);
        assert!(line.starts_with("no sample of deferred at 8 x 8 on teapot"), "{line}");
    }

    #[test]
    fn times_rise_from_each_point_to_the_next() {
        let points = [1, 4, 8].map(|side| format!("'naive {side}x{side} on teapot'")).join(", ");
        let rises = format!("kind = 'rises', at_least = 1.5, over = [{points}]");
        let verdict_of = |times: [f64; 3]| {
            let all = [1, 4, 8].into_iter().zip(times);
            let records: Vec<Record> = all.map(|(side, ms)| measured("gpu", "naive", side, ms)).collect();
            verdict(&rises, &records)
        };
        assert_eq!(verdict_of([10.0, 20.0, 40.0]), Verdict::Held);
        assert_eq!([verdict_of([40.0, 20.0, 10.0]), verdict_of([10.0, 20.0, 24.0])], [Verdict::NotHeld; 2]);
    }

    #[test]
    fn times_of_two_runs_are_not_compared() {
        let [slow, fast] = [measured("gpu", "naive", 1, 100.0), measured("gpu", "naive", 4, 10.0)];
        let verdict_of = |runs: &[&[Record]]| claim(FALLS, runs).verdict;
        assert_eq!(verdict_of(&[std::slice::from_ref(&slow), std::slice::from_ref(&fast)]), Verdict::Cannot);
        assert_eq!(verdict_of(&[&[], &[slow.clone(), fast.clone()]]), Verdict::Held);
        assert_eq!(verdict_of(&[std::slice::from_ref(&slow), &[slow.clone(), fast.clone()]]), Verdict::Held);
        let other_size = Record { image_size: [80, 50], ..fast };
        assert_eq!(verdict_of(&[&[slow, other_size]]), Verdict::Cannot, "of two image sizes");
    }

    #[test]
    fn few_samples_are_no_verdict() {
        let records = [
            few("gpu", "naive", 1, 100.0, 4),
            measured("gpu", "naive", 4, 10.0),
            measured("gpu", "naive", 8, 5.5),
        ];
        let fastest =
            "kind = 'fastest', is = 'naive 8x8 on teapot', of = ['naive square on teapot'], by = 1.05";
        assert_eq!(verdict(fastest, &records), Verdict::Unclear);
        let result = claim(FALLS, &[&records]);
        assert_eq!(result.verdict, Verdict::Unclear);
        assert!(result.lines[0].text.contains("not enough samples (n = 4)"), "{result:?}");
        let baseline = Record { strategy: "serial-f32".into(), ..few("host", "serial", 0, 1798.0, 1) };
        let serial =
            "kind = 'ratio', of = ['serial-f32 host on teapot'], to = 'naive best on teapot', at_least = 2";
        assert_eq!(verdict(serial, &[baseline, records[2].clone()]), Verdict::Unclear);
    }

    /// Returns a test (as TOML) of the claim that `naive` is faster at the local size `size` than at all
    /// other square local sizes. `more` contains further keys of the test.
    fn fastest(size: &str, more: &str) -> String {
        format!("kind = 'fastest', is = 'naive {size} on teapot', of = ['naive square on teapot'], {more}")
    }

    fn sizes(times: &[(u32, f64)]) -> Vec<Record> {
        times.iter().map(|(side, ms)| measured("gpu", "naive", *side, *ms)).collect()
    }

    #[test]
    fn the_fastest_point_is_ahead_of_each_other_by_the_stated_factor() {
        let records = sizes(&[(4, 10.0), (8, 11.0), (16, 20.5)]);
        let result_of = |size: &str, more: &str| claim(&fastest(size, more), &[&records]);
        assert_eq!(result_of("4x4", "by = 1.05").verdict, Verdict::Held);
        assert_eq!(result_of("4x4", "by = 1.2").verdict, Verdict::NotHeld);
        assert_eq!(result_of("8x8", "by = 1.05").verdict, Verdict::NotHeld);
        assert_eq!(result_of("4x4", "by = 1.2, except = ['naive 8x8 on teapot']").verdict, Verdict::Held);
        let text = &result_of("4x4", "by = 1.05").lines[0].text;
        assert!(
            text.starts_with(
                "naive at 8 x 8 on teapot (11.00 ms), the decisive one of 2 others, takes 1.10 times"
            ) && text.contains("as long as naive at 4 x 4 on teapot (10.00 ms)")
                && text.ends_with("required: at least 1.05"),
            "{text}"
        );
    }

    #[test]
    fn a_point_in_a_narrow_tie_is_not_the_fastest() {
        let tie = sizes(&[(4, 10.0), (8, 10.05), (16, 20.5)]);
        for size in ["4x4", "8x8", "16x16"] {
            assert_eq!(verdict(&fastest(size, "by = 1.05"), &tie), Verdict::NotHeld, "{size}");
        }
    }

    #[test]
    fn a_point_in_a_wide_tie_may_be_the_fastest() {
        let mut wide = sizes(&[(4, 10.0), (8, 10.5), (16, 20.5)]);
        wide[1].samples_ms = [[9.5; 5], [11.5; 5]].concat();
        let result = claim(&fastest("4x4", "by = 1.05"), &[&wide]);
        assert_eq!(result.verdict, Verdict::Unclear, "{result:?}");
        assert!(result.lines[0].text.starts_with("naive at 8 x 8"), "the ratio that is unclear: {result:?}");
        assert!(result.decides()[0].contains("contains the bound 1.05"), "{result:?}");
        wide.push(few("gpu", "naive", 1, 9.0, 4));
        let result = claim(&fastest("4x4", "by = 1.05"), &[&wide]);
        assert!(
            result.lines[0].text.starts_with("naive at 8 x 8"),
            "a ratio and not a missing one: {result:?}"
        );
        wide.push(measured("gpu", "naive", 2, 10.05));
        let result = claim(&fastest("4x4", "by = 1.05"), &[&wide]);
        assert_eq!(result.verdict, Verdict::NotHeld, "one sure ratio is enough: {result:?}");
        assert!(result.lines[0].text.starts_with("naive at 2 x 2"), "the ratio that decides: {result:?}");
    }

    #[test]
    fn a_point_without_others_is_not_the_fastest_of_any() {
        let result = claim(&fastest("4x4", "by = 1.05"), &[&sizes(&[(4, 10.0)])]);
        assert_eq!(result.verdict, Verdict::Cannot);
        let missing = "no record of a point to compare with naive at 4 x 4 on teapot";
        assert_eq!(result.lines[0].text, missing);
        let except = fastest("4x4", "by = 1.05, except = ['naive 8x8 on teapot', 'naive 2x2 on teapot']");
        let result = claim(&except, &[&sizes(&[(4, 10.0), (8, 11.0)])]);
        assert_eq!(result.lines[0].text, format!("{missing} (left out: naive at 8 x 8 on teapot)"));
    }

    #[test]
    fn a_point_is_not_known_to_be_the_fastest_if_another_was_not_completed() {
        let crashed = Record { outcome: Outcome::Crashed, ..infeasible("gpu", "naive", 6, "why") };
        let wrong = Record { outcome: Outcome::WrongImage, ..infeasible("gpu", "naive", 2, "why") };
        let with = |more: &[Record]| [&sizes(&[(4, 10.0), (16, 20.0)])[..], more].concat();
        let result_of = |size: &str, more: &[Record]| claim(&fastest(size, "by = 1.05"), &[&with(more)]);
        let open = result_of("4x4", std::slice::from_ref(&crashed));
        assert_eq!(open.verdict, Verdict::Unclear);
        let text = &open.lines[0].text;
        assert!(
            text.starts_with("naive at 16 x 16 on teapot (20.00 ms), the only other one, takes"),
            "{text}"
        );
        assert!(text.ends_with("; without a time: naive at 6 x 6 (crashed)"), "{text}");
        assert!(open.decides()[0].ends_with("--resume --retry-failed`"), "{open:?}");
        let several = result_of("4x4", &[crashed.clone(), wrong]);
        assert!(several.lines[0].text.ends_with(" and 1 more"), "{several:?}");
        let only = claim(
            &fastest("4x4", "by = 1.05"),
            &[&[&sizes(&[(4, 10.0)])[..], std::slice::from_ref(&crashed)].concat()],
        );
        let no_time = "naive at 4 x 4 on teapot cannot be compared, because no other point has a time; without a time: naive at 6 x 6 (crashed)";
        assert_eq!((only.verdict, only.lines[0].text.as_str()), (Verdict::Unclear, no_time));
        assert!(only.decides()[0].ends_with("--resume --retry-failed`"), "{only:?}");
        assert_eq!(result_of("16x16", &[crashed]).verdict, Verdict::NotHeld, "one faster point is enough");
        assert_eq!(result_of("4x4", &[infeasible("gpu", "naive", 6, "why")]).verdict, Verdict::Held);
    }

    #[test]
    fn what_runs_and_what_fits_needs_no_samples() {
        let records = [
            infeasible("gpu", "local-triangles", 8, "__local memory: 106704 B"),
            few("gpu", "naive", 8, 3.0, 1),
        ];
        let runs = |name: &str, runs: bool| {
            format!("kind = 'runs', points = ['{name} square on teapot'], runs = {runs}")
        };
        assert_eq!(verdict(&runs("local-triangles", false), &records), Verdict::Held);
        assert_eq!(verdict(&runs("local-triangles", true), &records), Verdict::NotHeld);
        assert_eq!(verdict(&runs("naive", true), &records), Verdict::Held);
        assert_eq!(verdict(&runs("private", false), &records), Verdict::Cannot);
        let fits = |(triangles, local_bytes): (u32, u32)| {
            format!(
                "kind = 'fits', strategy = 'local-triangles', local_size = '8x8', triangles = {triangles}, local_bytes = {local_bytes}, fits = true"
            )
        };
        // A triangle takes 104 bytes of `__local` memory. Triangles that fill the `__local` memory completely
        // still fit.
        assert_eq!(
            [(472, 49152), (473, 49152), (472, 472 * 104)].map(|case| verdict(&fits(case), &records)),
            [Verdict::Held, Verdict::NotHeld, Verdict::Held]
        );
        let fits_not = fits((473, 49152)).replace("fits = true", "fits = false");
        assert_eq!(verdict(&fits_not, &records), Verdict::Held);
    }

    #[test]
    fn a_point_runs_if_it_runs_at_one_of_its_sizes_and_that_one_is_named() {
        let records = [
            infeasible("gpu", "naive", 4, "scratch: 9 GiB"),
            few("gpu", "naive", 8, 3.0, 1),
            few("gpu", "naive", 16, 2.0, 1),
            infeasible("gpu", "naive", 32, "scratch: 9 GiB"),
        ];
        let result_of = |runs: bool, records: &[Record]| {
            let test = format!("kind = 'runs', points = ['naive square on teapot'], runs = {runs}");
            claim(&test, &[records])
        };
        let held = result_of(true, &records);
        assert_eq!(
            (held.verdict, held.lines[0].text.contains("at 8 x 8")),
            (Verdict::Held, true),
            "{held:?}"
        );
        assert_eq!(result_of(false, &records).verdict, Verdict::NotHeld);
        // If the point runs at no local size, the result line names the smallest local size.
        let neither = result_of(false, &[records[3].clone(), records[0].clone()]);
        assert_eq!(neither.verdict, Verdict::Held);
        assert!(neither.lines[0].text.contains("at 4 x 4"), "{neither:?}");
    }

    #[test]
    fn a_latency_is_certain_only_if_its_quartiles_agree() {
        let verdict_of = |[q1, median, q3]: [f64; 3]| {
            let folder = tempfile::tempdir().unwrap();
            let private_ns = Figure { q1, median, q3, repeats: 9 };
            // At a clock frequency of 1000 MHz, a cycle takes a nanosecond.
            let peak = Peak {
                device: "gpu".into(),
                max_clock_mhz: Some(1000),
                private_ns,
                ..crate::peak::fixtures::rates()
            };
            Peak::write(&[peak], &folder.path().join(FILE)).unwrap();
            let run = Folder { path: folder.path().into(), ..Folder::default() };
            let test = "kind = 'latency', memory = 'private', cycles = 20, within = 2";
            claim_in(&run, test, &[&[measured("gpu", "naive", 8, 10.0)]]).verdict
        };
        assert_eq!(verdict_of([15.0, 20.0, 30.0]), Verdict::Held);
        assert_eq!([verdict_of([5.0, 20.0, 30.0]), verdict_of([15.0, 20.0, 50.0])], [Verdict::Unclear; 2]);
        assert_eq!([verdict_of([2.0, 5.0, 9.0]), verdict_of([41.0, 50.0, 60.0])], [Verdict::NotHeld; 2]);
    }

    #[test]
    fn one_part_that_fails_is_enough_and_all_have_to_hold() {
        let of = |parts: &[Verdict]| Verdict::of_all(parts.iter().copied());
        use Verdict::{Cannot, Held, NotHeld, Unclear};
        assert_eq!(of(&[Held, Unclear, NotHeld, Cannot]), NotHeld);
        assert_eq!(of(&[Held, Held]), Held);
        assert_eq!([of(&[Held, Cannot]), of(&[Held, Unclear]), of(&[Cannot, Unclear])], [Unclear; 3]);
        assert_eq!(of(&[Cannot, Cannot]), Cannot);
    }

    #[test]
    fn threads_by_arithmetic_are_compared_with_the_published_number() {
        let verdict_of = |threads: u32| {
            let test = format!(
                "kind = 'occupancy', compute_capability = '2.0', registers = 63, local_size = '16x16', threads = {threads}"
            );
            verdict(&test, &[measured("gpu", "naive", 8, 10.0)])
        };
        // A thread's 63 registers are rounded up to 64, so 512 threads (two groups of 256) use all 32768 registers.
        assert_eq!([512, 1536, 256].map(verdict_of), [Verdict::Held, Verdict::NotHeld, Verdict::NotHeld]);
    }

    /// Returns the verdict on the built-in claim whose sentence starts with `start`.
    fn built_in(start: &str, records: &[Record]) -> Verdict {
        let mut rows = table().expect("it reads");
        rows.retain(|row| row.sentence.starts_with(start));
        let (folder, records) = (Folder::default(), judged(records));
        let results = claims(rows, &Run::of(&folder, groups(&records)), "gpu");
        assert_eq!(results.len(), 1, "{start}");
        results[0].verdict
    }

    #[test]
    fn a_sentence_of_several_parts_holds_only_if_each_of_them_does() {
        use Verdict::{Held, NotHeld, Unclear};
        let of = |scene: &str, name: &str, side: u32, ms: f64| Record {
            scene: scene.into(),
            key: format!("{scene} {name} {side}"),
            ..measured("gpu", name, side, ms)
        };
        let scaled = |of_16: f64, growth: f64| {
            let of_scene = |(index, scene): (i32, &str)| {
                let times = [(4, 1.0), (8, 1.1), (16, of_16)];
                times.map(|(side, ms)| of(scene, "naive", side, ms * growth.powi(index)))
            };
            let scenes = ["triangle", "pyramid-upper", "still-life", "gourd", "teapot"];
            let records: Vec<Record> = (0..).zip(scenes).flat_map(of_scene).collect();
            built_in("The naive implementation's run time scaled with both", &records)
        };
        assert_eq!([scaled(1.5, 2.0), scaled(0.6, 2.0), scaled(1.5, 1.0)], [Held, NotHeld, NotHeld]);
        let still_life = |start: &str, points: &[(&str, u32, f64)]| {
            let record = |(name, side, ms): &(&str, u32, f64)| of("still-life", name, *side, *ms);
            built_in(start, &points.iter().map(record).collect::<Vec<_>>())
        };
        let best = |of_4: f64| {
            let naive = [("naive", 4, of_4), ("naive", 8, 2.2), ("naive", 16, 3.0)];
            let points = [&naive[..], &[("local-vectors", 8, 1.0), ("local-triangles", 8, 2.5)]].concat();
            still_life("Of the three implementations, the best run time", &points)
        };
        assert_eq!([best(2.0), best(3.0)], [Held, NotHeld]);
        let slowed = |of_triangles: f64| {
            let both = |side: u32| [("local-vectors", side, 1.0), ("compounded", side, 1.2)];
            let points = [&both(8)[..], &both(16), &[("local-triangles", 8, of_triangles)]].concat();
            still_life("Furthermore, having to read in data", &points)
        };
        assert_eq!([slowed(2.0), slowed(0.9)], [Held, NotHeld]);
        // No measurement can decide the claim that a rasteriser starts fewer threads.
        let on_teapot = [of("teapot", "naive", 8, 3.0), of("teapot", "raster", 8, 1.0)];
        assert_eq!(built_in("This largely reduces the number", &on_teapot), Unclear);
    }

    #[test]
    fn of_several_records_of_a_point_the_fastest_counts() {
        let records = [
            measured("gpu", "naive", 1, 100.0),
            measured("gpu", "naive", 8, 50.0),
            measured("gpu", "naive", 4, 10.0),
        ];
        let best = "kind = 'ratio', of = ['naive 1x1 on teapot'], to = 'naive best on teapot', at_least = 5";
        let result = claim(best, &[&records]);
        assert_eq!(result.verdict, Verdict::Held);
        assert!(
            result.lines[0]
                .text
                .contains("as long as naive at 4 x 4 on teapot (its best-ranked size, 10.00 ms)"),
            "{result:?}"
        );
    }

    #[test]
    fn passes_of_the_same_frames_are_compared_by_the_samples_of_the_records_launches() {
        let point =
            "kind = 'passes', point = 'deferred 8x8 on teapot', of = 'shadow', to = 'primary', at_least = 2";
        let record = measured("gpu", "deferred", 8, 10.0);
        let verdict_of = |shadow_ms: f64, launch: u32| {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join(crate::record::journals::SAMPLES);
            let mut journal = crate::record::JsonLines::append_to(&path).unwrap();
            for n in 0..10_u32 {
                let sample = crate::record::Sample {
                    key: record.key.clone(),
                    launch: launch + n / 5,
                    ms: 10.0,
                    primary_ms: Some(2.0),
                    shadow_ms: Some(shadow_ms * (1.0 + 0.001 * f64::from(n % 3))),
                    ..Default::default()
                };
                journal.append(&sample).unwrap();
                // The file also contains samples of another point, whose shadow pass takes as long as its
                // primary pass. The samples of the point with the key `other` must not count.
                let other = crate::record::Sample { key: "other".into(), shadow_ms: Some(2.0), ..sample };
                (0..3).for_each(|_| journal.append(&other).unwrap());
            }
            let run = Folder { path: folder.path().into(), ..Folder::default() };
            claim_in(&run, point, &[std::slice::from_ref(&record)]).verdict
        };
        assert_eq!([verdict_of(6.0, 0), verdict_of(3.0, 0)], [Verdict::Held, Verdict::NotHeld]);
        assert_eq!(verdict_of(6.0, 7), Verdict::Cannot, "another launch");
        assert_eq!(verdict_of(0.0, 0), Verdict::Unclear, "below the timer's resolution");
    }

    /// In this test, each launch has samples in samples.jsonl that the point's record leaves out. The shadow
    /// passes of the left-out samples took much longer than the shadow passes of the record's own samples.
    #[test]
    fn samples_that_the_record_leaves_out_decide_nothing() {
        let point =
            "kind = 'passes', point = 'deferred 8x8 on teapot', of = 'shadow', to = 'primary', at_least = 2";
        let record = measured("gpu", "deferred", 8, 10.0);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(crate::record::journals::SAMPLES);
        let mut journal = crate::record::JsonLines::append_to(&path).unwrap();
        for n in 0..10_u32 {
            let own = crate::record::Sample {
                key: record.key.clone(),
                launch: n / 5,
                at_ms: Some(f64::from(n)),
                ms: 10.0,
                primary_ms: Some(2.0),
                shadow_ms: Some(3.0),
                ..Default::default()
            };
            journal.append(&own).unwrap();
            // A left-out sample may have the same time or the same moment of measurement as a sample of the
            // record, but not both.
            for (at_ms, ms) in [(Some(100.0), 10.0), (own.at_ms, 11.0)] {
                let left_out = crate::record::Sample { at_ms, ms, shadow_ms: Some(60.0), ..own.clone() };
                (0..3).for_each(|_| journal.append(&left_out).unwrap());
            }
        }
        let run = Folder { path: folder.path().into(), ..Folder::default() };
        let result = claim_in(&run, point, &[std::slice::from_ref(&record)]);
        assert_eq!(result.verdict, Verdict::NotHeld);
        assert!(
            result.lines[0].text.contains("1.50 times") && result.lines[0].text.contains("n = 10"),
            "{result:?}"
        );
    }

    /// Returns the claim that a memory's latency differs from `cycles` by a factor of at most 1.1, tested on
    /// a run in `folder`.
    fn of_latency(folder: &Folder, memory: &str, cycles: u32) -> Claim {
        let test = format!("kind = 'latency', memory = '{memory}', cycles = {cycles}, within = 1.1");
        claim_in(folder, &test, &[&[measured("gpu", "naive", 8, 10.0)]])
    }

    #[test]
    fn each_memory_has_its_own_latency() {
        let folder = tempfile::tempdir().unwrap();
        let of = |ns: f64| Figure { q1: ns, median: ns, q3: ns, repeats: 9 };
        let peak = |device: &str, by: f64, max_clock_mhz| Peak {
            device: device.into(),
            max_clock_mhz,
            private_ns: of(by * 20.0),
            private_array_ns: of(by * 30.0),
            local_ns: of(by * 40.0),
            global_ns: of(by * 400.0),
            ..crate::peak::fixtures::rates()
        };
        let write = |max_clock_mhz| {
            let both = [peak("other", 7.0, Some(1000)), peak("gpu", 0.5, max_clock_mhz)];
            Peak::write(&both, &folder.path().join(FILE)).unwrap();
        };
        // At 2000 MHz, a cycle takes half a nanosecond.
        write(Some(2000));
        let run = |kind: &str| Folder {
            path: folder.path().into(),
            environment: serde_json::json!({ "devices": [{ "device": "gpu", "kind": kind }] }),
            ..Folder::default()
        };
        for (memory, cycles) in [("private", 20), ("local", 40), ("global", 400)] {
            let held = of_latency(&run("gpu"), memory, cycles);
            assert_eq!(held.verdict, Verdict::Held, "{held:?}");
            let text = format!("{memory} memory: {cycles}");
            assert!(
                held.lines[0].text.starts_with(&text) && held.lines[0].text.contains(" at 2000 MHz"),
                "{held:?}"
            );
            assert_eq!(of_latency(&run("gpu"), memory, 2 * cycles).verdict, Verdict::NotHeld, "{memory}");
        }
        assert_eq!(of_latency(&run("accelerator"), "local", 40).verdict, Verdict::Held);
        let on_cpu = ["private", "local", "global"].map(|memory| of_latency(&run("cpu"), memory, 20));
        assert_eq!(
            on_cpu.each_ref().map(|claim| claim.verdict),
            [Verdict::Held, Verdict::Cannot, Verdict::Cannot]
        );
        assert_eq!(on_cpu[1].decides(), ["a GPU"]);
        write(None);
        assert_eq!(of_latency(&run("gpu"), "local", 40).decides(), ["the clock frequency in MHz"]);
        std::fs::write(folder.path().join(FILE), "no rates").unwrap();
        let damaged = of_latency(&run("gpu"), "local", 40);
        assert!(damaged.lines[0].text.contains("peak.json does not contain peak rates: "), "{damaged:?}");
        assert!(
            damaged.decides()[0].contains("delete the run's file peak.json, then `raycl reproduce"),
            "{damaged:?}"
        );
        std::fs::remove_file(folder.path().join(FILE)).unwrap();
        let unknown = of_latency(&run("gpu"), "local", 40);
        assert_eq!(
            (unknown.verdict, unknown.lines[0].text.as_str()),
            (Verdict::Cannot, "no record of the latency of local memory")
        );
        assert!(unknown.decides()[0].contains("raycl reproduce --out"), "{unknown:?}");
    }

    #[test]
    fn an_attempt_that_did_not_end_decides_nothing_and_a_driver_that_refuses_does() {
        let verdict_of = |outcome| {
            let record = Record { outcome, ..infeasible("gpu", "naive", 8, "why") };
            let test = "kind = 'runs', points = ['naive 8x8 on teapot'], runs = false";
            claim(test, &[&[record]]).verdict
        };
        for outcome in [Outcome::BuildFailed, Outcome::LaunchFailed, Outcome::Infeasible] {
            assert_eq!(verdict_of(outcome), Verdict::Held, "{outcome:?}");
        }
        for outcome in [Outcome::TimedOut, Outcome::Crashed, Outcome::WrongImage, Outcome::OtherKind] {
            assert_eq!(verdict_of(outcome), Verdict::Unclear, "{outcome:?}");
        }
    }

    #[test]
    fn a_point_for_which_memory_was_lacking_for_a_moment_decides_nothing() {
        let verdict_of = |reason: &str| {
            let test = "kind = 'runs', points = ['naive 8x8 on teapot'], runs = false";
            claim(test, &[&[infeasible("gpu", "naive", 8, reason)]]).verdict
        };
        assert_eq!(verdict_of("the host's memory (casting): 2 B > 1 B"), Verdict::Unclear);
        assert_eq!(verdict_of("global memory: 2 B > 1 B"), Verdict::Held);
    }

    #[test]
    fn what_would_decide_a_claim_is_stated_once_and_only_if_it_is_open() {
        let points = "of = ['naive 1x1 on teapot', 'naive 2x2 on teapot'], to = 'naive 4x4 on teapot'";
        let ratio = format!("kind = 'ratio', {points}, at_least = 5");
        let all = [(1, 100.0), (2, 100.0), (4, 10.0)].map(|(side, ms)| measured("gpu", "naive", side, ms));
        let open = claim(&ratio, &[&all[2..]]);
        assert_eq!((open.lines.len(), open.decides().len()), (2, 1), "{open:?}");
        assert!(claim(&ratio, &[&all]).decides().is_empty());
        let failed = claim(&ratio, &[&[measured("gpu", "naive", 1, 20.0), all[2].clone()]]);
        assert_eq!(failed.verdict, Verdict::NotHeld);
        assert!(failed.decides().is_empty(), "one part is missing, but the verdict is certain: {failed:?}");
    }
}
