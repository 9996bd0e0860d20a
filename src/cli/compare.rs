//! `raycl compare`: compares two folders of results, point by point.

use crate::error::{Error, Result};
use crate::measure::Verdict;
use crate::output::{Choice, OutFolder};
use crate::record::Folder;
use crate::record::journals::SUMMARY;
use crate::report::{self, Comparison};
use crate::words::counted;
use std::path::{Path, PathBuf};

/// The default of `--threshold`: a change counts as "same" if its 95% interval contains neither a speed-up nor a
/// slowdown of more than this percentage.
pub(super) const THRESHOLD_PERCENT: f64 = 2.0;

/// Arguments of `raycl compare`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl compare results/old-driver results/new-driver
  raycl compare results/main results/branch --fail-on-regression 5
  raycl compare results/pocl results/h200 --out results/pocl-h200")]
pub struct Args {
    /// The folder to compare with: older results, or results of another branch or device
    before: PathBuf,
    /// The folder whose results are compared with those of BEFORE
    after: PathBuf,
    /// Report a point as "same" if the 95% interval of its change contains neither a speed-up nor a slowdown of more
    /// than PERCENT
    #[arg(long, value_name = "PERCENT", default_value_t = THRESHOLD_PERCENT, value_parser = percent)]
    threshold: f64,
    /// Compare the measured times themselves, not their ratios to another time. Without this option, raycl
    /// first divides each time by another time of the same run, such as the time of the anchor (a kernel that
    /// never changes), to allow for changes of the machine's speed. If the devices differ, and no
    /// baseline (a ray caster without OpenCL) was measured on the same processor in both folders, raycl always
    /// compares the measured times
    #[arg(long)]
    times: bool,
    /// Exit with code 1 if it is statistically significant that AFTER is slower than BEFORE by more than PERCENT. raycl
    /// tests each point, the mean of each strategy's points, and the mean of all points except baselines (ray casters
    /// that do not use OpenCL). Also exit with code 1 if a point was measured in BEFORE but could not be measured in
    /// AFTER. A point is not tested if AFTER has no record of it; a note names up to four such points. Points whose
    /// change is unknown (such as those with the verdict "not comparable") are not tested either. Even if both folders
    /// contain times of the same program, about one comparison in 50 exits with code 1 by chance (with two launches, up
    /// to one in 25)
    #[arg(long, value_name = "PERCENT", value_parser = percent)]
    fail_on_regression: Option<f64>,
    /// Write compare.html, compare.md and plots to this folder
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace files in the folder of --out even if they were not written by raycl, or were changed after raycl wrote
    /// them
    #[arg(long, requires = "out")]
    force: bool,
    /// Print Markdown instead of a table. Not with --json
    #[arg(long, conflicts_with = "json")]
    markdown: bool,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
    /// Print nothing but errors. Not with --json or --markdown
    #[arg(short, long, conflicts_with_all = ["json", "markdown"])]
    quiet: bool,
}

/// Parses a percentage of at least 0, such as `5` or `5%`.
pub(super) fn percent(text: &str) -> std::result::Result<f64, String> {
    let number: Option<f64> = text.strip_suffix('%').unwrap_or(text).parse().ok();
    let fine = number.filter(|percent| percent.is_finite() && *percent >= 0.0);
    fine.ok_or_else(|| format!("'{text}' is not a percentage; expected a number of at least 0, such as 5"))
}

/// Compares two folders of results, and prints the comparison; with `--out`, also writes it into a folder. A folder
/// without results is a user error. It is also a user error if the two folders cannot be compared, because no point was
/// measured in both folders, and no point has different outcomes in the two folders. With `--fail-on-regression`, also
/// returns an error if there is a regression.
pub fn run(args: Args) -> Result<()> {
    let choice = Choice::new(args.force, "--out DIR");
    let mut out = args.out.as_ref().map(|path| OutFolder::open(path, choice)).transpose()?;
    out.iter().try_for_each(|out| out.check(report::COMPARISON))?;
    let (before, after) = (Folder::read(&args.before)?, Folder::read(&args.after)?);
    let mut comparison = Comparison::of(&before, &after, args.threshold / 100.0, args.times);
    if args.fail_on_regression.is_some() {
        comparison.notes.extend(comparison.left_out_of_means());
        comparison.notes.extend(comparison.lost_points());
    }
    if !comparison.has_points_in_common() {
        let error = Error::input("the two folders have no measured point in common");
        return Err(error.with_help(
            "raycl compares two points if their records have the same key (a hash that identifies what was measured). \
             Without equal keys, two points are compared if they have the same scene, image size, device, strategy \
             name and local size. Scenes are the same if their contents are equal; if each folder has only one \
             device, the two devices count as the same",
        ));
    }
    if let Some(out) = &mut out {
        report::write_comparison(&comparison, out)?;
    }
    if args.json {
        super::print_json(&serde_json::json!({
            "before": comparison.labels[0], "after": comparison.labels[1], "summary": comparison.summary(),
            "points": comparison.lines(), "not_compared": comparison.others, "notes": comparison.notes,
        }))?;
    } else if args.markdown {
        super::print(comparison.markdown().trim_end())?;
    } else if !args.quiet {
        print_table(&comparison)?;
    }
    refuse_regressions(&comparison, args.fail_on_regression, "", remedy(&comparison, &after.path))
}

/// Returns the advice of the error about regressions in the folder `after`. If points failed in this folder, but were
/// measured in the first folder, the advice names the file that contains the reasons of the failures. If there are no
/// such points, the advice is to repeat both runs.
fn remedy(comparison: &Comparison, after: &Path) -> String {
    match comparison.broken.is_empty() {
        true => "repeat both runs, one after the other, to find out whether the programs differ or the machine was \
                 busy during one of the runs"
            .to_owned(),
        false => format!("{} gives the reason for each point that fails", after.join(SUMMARY).display()),
    }
}

/// Returns an error that lists the regressions, if there are any: slowdowns of more than `limit_percent`, and points
/// that were measured in the first folder and failed in the second folder. Returns no error if `limit_percent` is
/// `None`. In the error's message, the text `between` stands between the number and the list of the regressions.
pub(super) fn refuse_regressions(
    comparison: &Comparison,
    limit_percent: Option<f64>,
    between: &str,
    remedy: String,
) -> Result<()> {
    let worse = limit_percent.map_or(Vec::new(), |percent| comparison.regressions(percent));
    if worse.is_empty() {
        return Ok(());
    }
    let count = counted(worse.len(), "regression");
    Err(Error::run(format!("{count}{between}: {}", worse.join("; "))).with_help(remedy))
}

/// Prints every point whose verdict is not "same", then the points that could not be compared, then the notes, then the
/// number of points per verdict.
pub(super) fn print_table(comparison: &Comparison) -> Result<()> {
    let [a, b] = &comparison.labels;
    let mut table =
        super::table(&["point", &format!("{a}, ms"), &format!("{b}, ms"), "change", "verdict"], 1);
    let changed = changed(comparison);
    let several = comparison.has_several_devices();
    for pair in &changed {
        table.add_row(cells(pair, several));
    }
    if !changed.is_empty() {
        super::print(table)?;
    }
    for line in &comparison.others {
        super::print(line)?;
    }
    for note in &comparison.notes {
        super::print(format!("note: {note}"))?;
    }
    super::print(comparison.summary())
}

/// Returns a point's row of the table: its name, its times in both folders, the change, and the verdict. If
/// `several_devices` is true, the name ends with the device's name.
fn cells(pair: &report::Pair, several_devices: bool) -> [String; 5] {
    let time = |median: Option<f64>| median.map_or("-".to_owned(), crate::numbers::ms);
    [
        pair.point(several_devices),
        time(pair.before.median_ms),
        time(pair.after.median_ms),
        pair.change(),
        pair.verdict.name().to_owned(),
    ]
}

/// Returns the points whose verdict is not "same". The point with the largest slowdown comes first; points for which
/// the ratio of the two times is unknown come last.
fn changed(comparison: &Comparison) -> Vec<&report::Pair> {
    let mut changed: Vec<_> = comparison.pairs.iter().filter(|pair| pair.verdict != Verdict::Same).collect();
    let change = |pair: &report::Pair| pair.change_percent().unwrap_or(f64::NEG_INFINITY);
    changed.sort_by(|a, b| change(b).total_cmp(&change(a)));
    changed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Record;
    use crate::record::fixtures::{few, judged, measured};

    #[test]
    fn a_change_within_two_per_cent_is_the_same_by_default() {
        use clap::Parser as _;
        #[derive(clap::Parser)]
        struct Command {
            #[command(flatten)]
            args: Args,
        }
        assert_eq!(Command::parse_from(["compare", "a", "b"]).args.threshold, 2.0);
    }

    #[test]
    fn the_largest_slowdown_comes_first_and_a_point_without_a_ratio_last() {
        let timed = |(name, ms): (&str, f64)| {
            let samples_ms = (0..10).map(|n| ms * (1.0 + 0.005 * f64::from(n % 3))).collect();
            Record { samples_ms, ..measured("a", name, 8, ms) }
        };
        let folder = |kernels: [(&str, f64); 3]| {
            let mut records = kernels.map(timed).to_vec();
            records.push(few("a", "private", 8, 1.0, 3));
            Folder { records: judged(records), ..Folder::default() }
        };
        let before = folder([("naive", 1.0), ("wide", 1.0), ("bvh", 1.0)]);
        let after = folder([("naive", 0.5), ("wide", 3.0), ("bvh", 2.0)]);
        let comparison = Comparison::of(&before, &after, 0.02, true);
        let names: Vec<&str> = changed(&comparison).iter().map(|pair| pair.before.name.as_str()).collect();
        assert_eq!(names, ["wide", "bvh", "naive", "private"]);
    }

    #[test]
    fn a_row_has_the_time_in_the_first_folder_before_the_time_in_the_second() {
        let folder =
            |ms: f64| Folder { records: judged([measured("a", "naive", 8, ms)]), ..Folder::default() };
        let comparison = Comparison::of(&folder(10.0), &folder(12.0), 0.02, true);
        let cells = cells(&comparison.pairs[0], false);
        assert_eq!(cells[1..3], ["10.00", "12.00"]);
    }

    #[test]
    fn a_percentage_is_a_number_that_is_not_negative_with_or_without_its_sign() {
        assert_eq!(["5", "0.5%", "0"].map(percent), [Ok(5.0), Ok(0.5), Ok(0.0)]);
        for wrong in ["-1", "nan", "inf", "", "five", "5%%", "%"] {
            let said = format!("'{wrong}' is not a percentage; expected a number of at least 0");
            assert!(percent(wrong).is_err_and(|error| error.starts_with(&said)), "{wrong}");
        }
    }
}
