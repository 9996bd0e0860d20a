//! `raycl compare-images`: compares two pictures.

use crate::error::{Error, Result};
use crate::image::{
    Radiance, SCALE_HEIGHT, Values, alpha_difference, check_png, difference_image, read_picture,
    relative_difference, save_rgb8,
};
use crate::output::{Choice, Target};
use crate::reader::is_standard_input;
use crate::scene::Inputs;
use serde::Serialize;
use std::path::PathBuf;

/// Arguments of `raycl compare-images`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl compare-images teapot.png reference.png
  raycl compare-images teapot.exr reference.exr --output difference.png
  raycl compare-images teapot.png reference.png --fail-below 40
  raycl render teapot.toml -o - --quiet | raycl compare-images - reference.png")]
pub struct Args {
    /// The picture to check: .png or .jpg (displayed values), .exr or .hdr (linear radiance); - stands for standard
    /// input
    found: PathBuf,
    /// The expected picture, with which FOUND (the picture to check) is compared. Both pictures should have the
    /// same kind of values: displayed values (.png, .jpg) or radiance (.exr, .hdr). One of the two pictures may
    /// be - (standard input)
    expected: PathBuf,
    /// Save a false-colour picture of the differences
    #[arg(short, long, value_name = "FILE.png")]
    output: Option<PathBuf>,
    /// Replace the file of --output even if it was not written by raycl, or was changed after raycl wrote it
    #[arg(long, requires = "output")]
    force: bool,
    /// Exit with code 1 if the peak signal-to-noise ratio is below DB decibels
    #[arg(long, value_name = "DB", value_parser = decibels)]
    fail_below: Option<f64>,
    /// Print one JSON object instead of text
    #[arg(long)]
    json: bool,
    /// Print nothing but errors. Not with --json
    #[arg(short, long, conflicts_with = "json")]
    quiet: bool,
}

fn decibels(text: &str) -> std::result::Result<f64, String> {
    let number: Option<f64> = text.trim_end_matches("dB").trim().parse().ok();
    number
        .filter(|db| db.is_finite())
        .ok_or_else(|| format!("'{text}' is not a number of decibels, such as 40"))
}

/// The result of comparing two pictures. With `--json`, raycl prints this result as a JSON object.
#[derive(Debug, Serialize)]
struct Report {
    /// The peak signal-to-noise ratio in decibels. Null if the pictures are equal (`equal` is true), or if a value of a
    /// picture is not finite (`equal` is false).
    psnr_db: Option<f64>,
    equal: bool,
    different_pixels: usize,
    pixels: usize,
    /// The largest absolute difference between the two pictures in one channel of one pixel; alpha is a
    /// channel too. In pictures with displayed values (.png, .jpg), white counts as 1. Null if the largest
    /// difference is not finite.
    largest_error: f64,
    /// The column and the row of the pixel with the largest error; null if the pictures are equal.
    largest_error_at: Option<[u32; 2]>,
    /// The largest relative difference of a channel of a pixel. A difference of a colour channel is divided
    /// by the brightest colour channel of the expected pixel, but at least by 1/255. A difference of alpha
    /// counts as it is, without a division. Null if the result is not finite.
    largest_relative_difference: f64,
    output: Option<String>,
    /// Remarks for the user. The only possible remark is that one picture has displayed values and the other one
    /// radiance.
    notes: Vec<String>,
}

/// Compares two pictures. Pictures of different sizes, and files that are not pictures, are user errors. With
/// `--output`, saves a picture of the differences. With `--fail-below`, also returns an error if the pictures differ
/// too much.
pub fn run(args: Args) -> Result<()> {
    if [&args.found, &args.expected].into_iter().all(|path| is_standard_input(path)) {
        return Err(Error::input(
            "standard input can only be read once, so only one of the pictures can be `-`",
        )
        .with_help("name a file as the other picture"));
    }
    let choice = Choice::new(args.force, "--output FILE.png");
    let target = args.output.as_ref().map(|path| Target::new(path, choice));
    if let Some(target) = &target {
        refuse_compared(&args, target)?;
        check_png(target)?;
    }
    let ((mut found, of_found), (mut expected, of_expected)) =
        (read_picture(&args.found)?, read_picture(&args.expected)?);
    if (found.width, found.height) != (expected.width, expected.height) {
        return Err(Error::input(format!(
            "{} is {} x {} pixels and {} is {} x {}: only pictures of the same size can be compared",
            args.found.display(),
            found.width,
            found.height,
            args.expected.display(),
            expected.width,
            expected.height
        ))
        .with_help(help_on_sizes([&found, &expected])));
    }
    share_alpha(&mut found, &mut expected);
    if let Some(target) = &target {
        save_rgb8(&difference_image(&found, &expected), target)?;
    }
    let notes = other_values(&args, of_found, of_expected).into_iter().collect();
    let report = Report { notes, ..compare(&found, &expected, args.output.as_ref()) };
    match (args.json, args.quiet) {
        (true, _) => super::print_json(&report)?,
        (false, true) => {}
        (false, false) => super::print(text(&report, [of_found, of_expected]))?,
    }
    match (args.fail_below, report.psnr_db) {
        (Some(limit), Some(psnr)) if psnr < limit || psnr.is_nan() => Err(Error::run(format!(
            "the peak signal-to-noise ratio is {} dB; --fail-below requires at least {limit} dB",
            below(psnr, limit)
        ))
        .with_help("`--output FILE.png` saves a picture that shows where the pictures differ")),
        _ => Ok(()),
    }
}

/// Formats `psnr`, a ratio below `limit`, with two digits after the point. If this rounding gives `limit` or more, uses
/// as many more digits as are needed for a number below `limit`.
fn below(psnr: f64, limit: f64) -> String {
    let is_below = |text: &String| text.parse::<f64>().is_ok_and(|shown| shown < limit);
    let mut rounded = (2..17_usize).map(|digits| format!("{psnr:.digits$}"));
    rounded.find(is_below).unwrap_or_else(|| psnr.to_string())
}

/// Returns the advice of the error about pictures of different sizes. If the pictures are equally wide, and one is
/// taller by the height of a colour scale, the advice says that the taller picture may have a colour scale at its
/// bottom.
fn help_on_sizes([found, expected]: [&Radiance; 2]) -> String {
    let rows = found.height.abs_diff(expected.height);
    let scale = (found.width == expected.width && rows == SCALE_HEIGHT).then(|| {
        format!(
            "; the last {rows} rows of the taller picture may be a colour scale, as in pictures that show differences \
             or counts of tests or nodes: leave these rows out"
        )
    });
    format!("render both pictures with the same --width and --height{}", scale.unwrap_or_default())
}

/// Returns an error if `--output` names one of the compared pictures. The picture of the differences never
/// replaces one of the two compared pictures, even with `--force`.
fn refuse_compared(args: &Args, target: &Target) -> Result<()> {
    let compared = Inputs::new();
    [&args.found, &args.expected].into_iter().for_each(|path| compared.add(path));
    target.check_unread("one of the compared pictures", |path| compared.contains(path))
}

/// Returns a note if one picture has displayed values and the other one radiance. A picture of displayed
/// values and a picture of radiance differ even if they show the same render.
fn other_values(args: &Args, found: Values, expected: Values) -> Option<String> {
    let values_of = |path: &PathBuf, values| {
        let what = match values {
            Values::Displayed => "displayed values",
            Values::Radiance => "linear radiance",
        };
        format!("{} has {what}", path.display())
    };
    (found != expected).then(|| {
        format!(
            "{} and {}, so the two files differ even if they show the same picture: compare a .png or .jpg with a .png or \
             .jpg, and an .exr or .hdr with an .exr or .hdr",
            values_of(&args.found, found),
            values_of(&args.expected, expected)
        )
    })
}

/// If only one of the two pictures has an alpha channel, adds an alpha channel with the value 1 (opaque) to
/// the other.
fn share_alpha(a: &mut Radiance, b: &mut Radiance) {
    if a.coverage.len() != b.coverage.len() {
        for picture in [a, b] {
            picture.coverage.resize(picture.pixels.len(), 1.0);
        }
    }
}

/// Compares two pictures of the same size. Either both pictures have alpha, or neither has.
fn compare(found: &Radiance, expected: &Radiance, output: Option<&PathBuf>) -> Report {
    let mut largest = (0.0, None);
    let (mut squares, mut different, mut relative, mut peak) = (0.0, 0, 0.0f64, 0.0f64);
    let channels = if found.coverage.is_empty() { 3.0 } else { 4.0 };
    for (index, (a, b)) in found.pixels.iter().zip(&expected.pixels).enumerate() {
        let alpha = alpha_difference(found.coverage.get(index), expected.coverage.get(index));
        let [red, green, blue] =
            [0, 1, 2].map(|channel| (f64::from(a[channel]) - f64::from(b[channel])).abs());
        let errors = [red, green, blue, alpha];
        let worst = errors
            .into_iter()
            .fold(0.0, |worst, error| if error.is_nan() { f64::INFINITY } else { error.max(worst) });
        squares += errors.iter().map(|error| error * error).sum::<f64>();
        peak = b.iter().fold(peak, |peak, channel| peak.max(f64::from(*channel)));
        relative = relative.max(relative_difference(*a, *b, 1.0 / 255.0)).max(alpha);
        if worst > 0.0 {
            different += 1;
        }
        if worst > largest.0 {
            largest = (worst, Some([index as u32 % found.width, index as u32 / found.width]));
        }
    }
    // The peak of the signal-to-noise ratio is white (1) for displayed values. For radiance, the peak is the brightest
    // channel of the expected picture, but at least 1.
    let peak = peak.max(1.0);
    let mean = squares / (channels * found.pixels.len().max(1) as f64);
    let equal = different == 0;
    Report {
        psnr_db: (!equal).then(|| 10.0 * (peak * peak / mean).log10()),
        equal,
        different_pixels: different,
        pixels: found.pixels.len(),
        largest_error: largest.0,
        largest_error_at: largest.1,
        largest_relative_difference: relative,
        output: output.map(|path| path.display().to_string()),
        notes: Vec::new(),
    }
}

/// Returns the report as text. `values` says for each picture whether it has displayed values or radiance. If
/// both pictures have displayed values, the text also gives the largest error on a scale on which white is
/// 255.
fn text(report: &Report, values: [Values; 2]) -> String {
    let mut lines = Vec::new();
    match (report.psnr_db, report.largest_error_at) {
        (Some(psnr), Some([x, y])) => {
            lines.push(format!("PSNR              {psnr:8.2} dB"));
            let error = report.largest_error;
            let (error, of_white) = match values {
                [Values::Displayed, Values::Displayed] => {
                    (format!("{error:8.5}"), format!("of white ({:.1} of 255), ", 255.0 * error))
                }
                _ => (format!("{error:8.2e}"), String::new()),
            };
            lines.push(format!("largest error     {error}    {of_white}at column {x}, row {y}"));
            lines.push(format!(
                "relative error    {:8.2e}    largest of all pixels: error divided by the expected pixel's brightest channel (at least by 1/255)",
                report.largest_relative_difference
            ));
            let percent = 100.0 * report.different_pixels as f64 / report.pixels.max(1) as f64;
            lines.push(format!(
                "different pixels  {:8}    of {} ({percent:.2}%)",
                report.different_pixels, report.pixels
            ));
        }
        _ => lines.push(format!("equal in all {} pixels", report.pixels)),
    }
    lines.extend(report.output.iter().map(|path| format!("differences       {path}")));
    lines.extend(report.notes.iter().map(|note| format!("note              {note}")));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_pixel_off_by_a_step_is_found_where_it_is() {
        let expected = Radiance::new(10, 10);
        let mut found = expected.clone();
        assert!(compare(&found, &expected, None).equal);
        found.pixels[37] = [0.0, 1.0 / 255.0, 0.0];
        let report = compare(&found, &expected, None);
        assert_eq!((report.largest_error_at, report.different_pixels), (Some([7, 3]), 1));
        // One of 300 channel values is wrong by 1/255, so the signal-to-noise ratio is 20 log10(255) + 10 log10(300)
        // decibels.
        assert!((report.psnr_db.unwrap_or_default() - 72.90).abs() < 0.01, "{report:?}");
    }

    #[test]
    fn a_ratio_below_the_limit_is_not_rounded_up_to_the_limit() {
        for (psnr, limit, expected) in [
            (43.377, 43.38, "43.377"),
            (43.379_96, 43.38, "43.37996"),
            (31.004, 40.0, "31.00"),
            (39.999, 40.0, "39.999"),
            (40.0_f64.next_down(), 40.0, "39.99999999999999"),
            (f64::NEG_INFINITY, 40.0, "-inf"),
            (f64::NAN, 40.0, "NaN"),
        ] {
            assert_eq!(below(psnr, limit), expected);
        }
    }

    #[test]
    fn a_picture_that_is_higher_by_a_colour_scale_may_have_one() {
        let help = |found: [u32; 2], expected: [u32; 2]| {
            let [found, expected] = [found, expected].map(|[width, height]| Radiance::new(width, height));
            help_on_sizes([&found, &expected])
        };
        let plain = "render both pictures with the same --width and --height";
        for higher in [help([40, 43], [40, 25]), help([40, 25], [40, 43])] {
            let scale = "; the last 18 rows of the taller picture may be a colour scale";
            assert!(higher.strip_prefix(plain).is_some_and(|rest| rest.starts_with(scale)), "{higher}");
        }
        assert_eq!([help([41, 43], [40, 25]), help([40, 44], [40, 25])], [plain, plain]);
    }

    #[test]
    fn alpha_is_a_fourth_channel_and_a_picture_without_it_is_opaque() {
        let opaque = Radiance::new(10, 10);
        let mut found = Radiance { coverage: vec![1.0; 100], ..opaque.clone() };
        found.coverage[37] = 0.75;
        let compared = |mut a: Radiance, mut b: Radiance| {
            share_alpha(&mut a, &mut b);
            compare(&a, &b, None)
        };
        for report in [compared(found.clone(), opaque.clone()), compared(opaque.clone(), found.clone())] {
            assert_eq!((report.equal, report.different_pixels), (false, 1));
            assert_eq!((report.largest_error, report.largest_error_at), (0.25, Some([7, 3])));
            assert_eq!(report.largest_relative_difference, 0.25);
            // In this test, one of the picture's 400 channel values is wrong by 1/4.
            let psnr = 10.0 * 6400_f64.log10();
            assert!((report.psnr_db.unwrap_or_default() - psnr).abs() < 1e-9, "{report:?}");
        }
        assert!(compared(found.clone(), found).equal && compared(opaque.clone(), opaque).equal);
    }

    #[test]
    fn json_without_a_ratio_says_whether_the_pictures_are_equal() {
        let expected = Radiance::new(10, 10);
        let mut found = expected.clone();
        let json = |found: &Radiance| serde_json::to_value(compare(found, &expected, None)).expect("JSON");
        let equal = json(&found);
        assert!(equal["psnr_db"].is_null() && equal["equal"] == true, "{equal}");
        for wrong in [f32::NAN, f32::INFINITY] {
            found.pixels[37] = [0.0, wrong, 0.0];
            let differs = json(&found);
            assert!(differs["psnr_db"].is_null() && differs["equal"] == false, "{differs}");
            assert!(differs["largest_error"].is_null(), "{differs}");
        }
    }

    #[test]
    fn the_largest_difference_is_relative_to_the_expected_picture() {
        let flat = |value: f32| Radiance { pixels: vec![[value; 3]], ..Radiance::new(1, 1) };
        let largest =
            |found, expected| compare(&flat(found), &flat(expected), None).largest_relative_difference;
        assert_eq!((largest(0.5, 1.0), largest(1.0, 0.5)), (0.5, 1.0));
    }

    #[test]
    fn the_peak_is_white_or_the_brightest_channel_of_the_expected_picture() {
        let flat = |value: f32| Radiance { pixels: vec![[0.0, value, 0.0]; 4], ..Radiance::new(2, 2) };
        let psnr = |found, expected| compare(&flat(found), &flat(expected), None).psnr_db;
        // In each pixel, one of the three channels is wrong by 0.1, so the mean squared error is 0.01 / 3.
        let of_peak = |peak: f64| 10.0 * (peak * peak * 300.0).log10();
        for (found, expected, peak) in [(0.6, 0.5, 1.0), (4.1, 4.0, 4.0), (4.0, 4.1, 4.1)] {
            let found = psnr(found, expected).unwrap_or_default();
            assert!((found - of_peak(peak)).abs() < 1e-3, "{found}, not {}", of_peak(peak));
        }
    }

    #[test]
    fn the_text_has_every_difference_with_its_position_and_its_unit() {
        let mut report = Report {
            psnr_db: Some(43.686),
            equal: false,
            different_pixels: 3,
            pixels: 400,
            largest_error: 0.2,
            largest_error_at: Some([12, 7]),
            largest_relative_difference: 0.5,
            output: Some("d.png".into()),
            notes: vec!["a remark".into()],
        };
        let lines_of = |report: &Report, values| -> Vec<String> {
            let printed = text(report, values);
            printed.lines().map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
        };
        assert_eq!(
            lines_of(&report, [Values::Displayed; 2]),
            [
                "PSNR 43.69 dB",
                "largest error 0.20000 of white (51.0 of 255), at column 12, row 7",
                "relative error 5.00e-1 largest of all pixels: error divided by the expected pixel's brightest channel (at least by 1/255)",
                "different pixels 3 of 400 (0.75%)",
                "differences d.png",
                "note a remark",
            ]
        );
        for (largest_error, expected) in [(6e38, "6.00e38"), (1e-30, "1.00e-30"), (0.25, "2.50e-1")] {
            report.largest_error = largest_error;
            for other in [Values::Radiance, Values::Displayed] {
                let line = &lines_of(&report, [Values::Radiance, other])[1];
                assert_eq!(line, &format!("largest error {expected} at column 12, row 7"));
            }
        }
        assert_eq!(["40", "40dB", "40 dB"].map(decibels), [Ok(40.0), Ok(40.0), Ok(40.0)]);
        assert!(decibels("loud").is_err() && decibels("inf").is_err());
    }
}
