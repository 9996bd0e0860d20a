//! Plots how times grow with the number of triangles in a scene and with the number of pixels in an image.
//! raycl fits a power law to the times, and the plots show the exponent of the law.

use super::overview::{best_of_each, devices, numbered};
use super::plot::Plot;
use super::plot::chart::{Across, Chart, Mark, Series};
use super::plot::look::Look;
use super::plot::scale::Kind;
use super::words::Looks;
use crate::numbers::by;
use crate::record::Group;

/// Returns up to two plots for each device: times over the number of triangles, and times over the number of
/// pixels. A plot is left out if all its times belong to the same number of triangles, or of pixels.
pub fn growth(groups: &[Group<'_>], looks: &Looks) -> Vec<Plot> {
    let of_device = |(index, device): (usize, &str)| {
        let own: Vec<_> = groups.iter().filter(|group| group.device == device).collect();
        let triangles = with_triangles(&own, looks, device, index);
        triangles.into_iter().chain(with_pixels(&own, looks, device, index)).collect::<Vec<_>>()
    };
    devices(groups).into_iter().enumerate().flat_map(of_device).collect()
}

/// Plots times over the number of triangles, at the image size and the number of samples per pixel with the
/// most scenes. Returns `None` if all these scenes have the same number of triangles.
fn with_triangles(own: &[&Group<'_>], looks: &Looks, device: &str, index: usize) -> Option<Plot> {
    let case = |group: &&Group<'_>| (group.image_size, group.samples());
    let most = most_common(own.iter().map(case))?;
    let same: Vec<_> = own.iter().copied().filter(|group| case(group) == most).collect();
    let (size, samples) = most;
    let samples = if samples > 1 { format!(" with {samples} samples per pixel") } else { String::new() };
    let labels = Labels {
        title: format!("Time against the number of triangles, at {}{samples}: {device}", by(size)),
        x: "triangles in the scene",
        file: numbered("triangles", index),
        besides: " The scenes differ in more than the number of triangles, and these other differences also affect the times.",
    };
    plot(&same, looks, labels, |group| {
        group.records.iter().find_map(|record| record.triangles).unwrap_or(0) as f64
    })
}

/// Plots times over the number of pixels, for the scene with the most image sizes. Returns `None` if all
/// measured image sizes of this scene have the same number of pixels.
fn with_pixels(own: &[&Group<'_>], looks: &Looks, device: &str, index: usize) -> Option<Plot> {
    let scene = most_common(own.iter().map(|group| group.scene))?;
    let same: Vec<_> = own.iter().copied().filter(|group| group.scene == scene).collect();
    let labels = Labels {
        title: format!("Time against the number of pixels, {scene}: {device}"),
        x: "pixels in the image",
        file: numbered("pixels", index),
        besides: "",
    };
    plot(&same, looks, labels, |group| group.image_size.iter().map(|side| f64::from(*side)).product())
}

fn most_common<T: PartialEq + Copy>(values: impl Iterator<Item = T> + Clone) -> Option<T> {
    let count = |value: &T| values.clone().filter(|other| other == value).count();
    values.clone().max_by_key(count)
}

struct Labels {
    title: String,
    x: &'static str,
    /// The plot's name, from which the names of the plot's files are made.
    file: String,
    /// A further sentence of the plot's caption, or an empty text.
    besides: &'static str,
}

fn plot(groups: &[&Group<'_>], looks: &Looks, labels: Labels, x: impl Fn(&Group<'_>) -> f64) -> Option<Plot> {
    let columns: Vec<_> = groups.iter().map(|group| (group.scene, group.image_size)).collect();
    let mut series = best_of_each(groups, &columns, looks);
    for one in &mut series {
        for mark in &mut one.marks {
            // `best_of_each` sets a mark's x to the index of the mark's group in `columns`. In this plot, x
            // is the group's number of triangles or pixels, so this number replaces the index.
            mark.x = groups.get(mark.x as usize).map_or(0.0, |group| x(group));
        }
        one.marks.sort_by(|a, b| a.x.total_cmp(&b.x));
    }
    if distinct(series.iter().flat_map(|one| &one.marks)) < 2 {
        return None;
    }
    let mut fits = Vec::new();
    let mut drawn = Vec::new();
    for mut one in series {
        let fit = Fit::of(&one.marks);
        let line = fit.map(|fit| fit.line(&one));
        fits.extend(fit.map(|fit| (one.name.clone(), fit)));
        one.joined = line.is_none();
        if let Some(fit) = fit {
            one.name = format!("{}: ^{:.2}", one.name, fit.exponent);
        }
        drawn.push(one);
        drawn.extend(line);
    }
    let chart = Chart {
        title: labels.title,
        x_label: labels.x.to_owned(),
        y_label: "median device time of a frame, ms".into(),
        across: Across::Numbers(Kind::Log),
        up: Kind::Log,
        diagonal: false,
        series: drawn,
    };
    let caption = format!("{}{}", caption(&fits), labels.besides);
    Some(Plot::of(labels.file, caption, &chart))
}

fn caption(fits: &[(String, Fit)]) -> String {
    let exponents: Vec<_> = fits.iter().map(|(name, fit)| format!("{name} {}", fit.text())).collect();
    let fitted = match exponents.as_slice() {
        [] => " There are no fitted lines: a fit needs times with enough samples at three or more different values on the x \
            axis."
            .to_owned(),
        some => format!(
            " The dashed lines are power laws, fitted by least squares to the logarithms of both axes. The legend shows each exponent after the sign ^. Exponents with their standard errors: {}.",
            some.join(", ")
        ),
    };
    format!(
        "Each strategy is shown at the local size at which it is fastest. Both axes are logarithmic, so a power law is a straight line.{fitted}"
    )
}

/// Returns the number of different values of x above 0. Marks with x = 0 cannot be drawn on a logarithmic
/// axis.
fn distinct<'a>(marks: impl Iterator<Item = &'a Mark>) -> usize {
    let mut values: Vec<f64> = marks.map(|mark| mark.x).filter(|x| *x > 0.0).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    values.len()
}

/// Fits a power law to points (x, y). Returns the exponent of the power law and the standard error of this
/// exponent. Ignores points whose x or y is not above 0. Returns `None` if the points that are not ignored
/// have fewer than three different values of x.
pub fn exponent(points: &[[f64; 2]]) -> Option<[f64; 2]> {
    let mark = |[x, y]: &[f64; 2]| Mark { x: *x, y: *y, interval: Some([*y; 2]), tip: String::new() };
    let fit = Fit::of(&points.iter().map(mark).collect::<Vec<_>>())?;
    Some([fit.exponent, fit.standard_error])
}

/// A power law y = exp(offset) x^exponent that was fitted to the marks of a plot: the law minimises the sum
/// of squared differences of log y.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Fit {
    exponent: f64,
    offset: f64,
    /// The standard error of the exponent.
    standard_error: f64,
    /// The number of the plot's marks to which the power law was fitted.
    n: usize,
}

impl Fit {
    /// Fits a power law to marks. Ignores marks without an interval, because they have too few samples, and
    /// marks whose x or y is not above 0. Returns `None` if the marks that are not ignored have fewer than
    /// three different values of x.
    fn of(marks: &[Mark]) -> Option<Self> {
        let sure = || marks.iter().filter(|mark| mark.interval.is_some() && mark.x > 0.0 && mark.y > 0.0);
        let points: Vec<[f64; 2]> = sure().map(|mark| [mark.x.ln(), mark.y.ln()]).collect();
        if distinct(sure()) < 3 || points.len() < 3 {
            return None;
        }
        let n = points.len() as f64;
        let mean = |axis: usize| points.iter().map(|point| point[axis]).sum::<f64>() / n;
        let [x, y] = [mean(0), mean(1)];
        let spread: f64 = points.iter().map(|point| (point[0] - x).powi(2)).sum();
        let exponent = points.iter().map(|point| (point[0] - x) * (point[1] - y)).sum::<f64>() / spread;
        let offset = y - exponent * x;
        let residual: f64 =
            points.iter().map(|point| (point[1] - offset - exponent * point[0]).powi(2)).sum();
        let standard_error = (residual / (n - 2.0) / spread).sqrt();
        Some(Self { exponent, offset, standard_error, n: points.len() })
    }

    /// Formats the exponent with its standard error and the number of marks: "0.98 ± 0.02 (n = 5)".
    fn text(&self) -> String {
        format!("{:.2} ± {:.2} (n = {})", self.exponent, self.standard_error, self.n)
    }

    /// Returns the fitted line from the first to the last mark of a series.
    fn line(&self, of: &Series) -> Series {
        let ends = [of.marks.first(), of.marks.last()];
        let at = |x: f64| Mark {
            x,
            y: (self.offset + self.exponent * x.ln()).exp(),
            interval: None,
            tip: String::new(),
        };
        Series {
            name: String::new(),
            look: Look { dashed: true, ..of.look },
            joined: true,
            marks: ends.into_iter().flatten().map(|mark| at(mark.x)).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Record;
    use crate::record::fixtures::{judged, measured};
    use crate::record::groups;

    fn marks(points: &[[f64; 2]]) -> Vec<Mark> {
        let mark = |[x, y]: &[f64; 2]| Mark { x: *x, y: *y, interval: Some([*y; 2]), tip: String::new() };
        points.iter().map(mark).collect()
    }

    #[test]
    fn a_power_law_is_found_with_its_error() {
        let exact: Vec<_> = [10.0, 100.0, 1e4].map(|x: f64| [x, 3.0 * x.powf(0.75)]).to_vec();
        let fit = Fit::of(&marks(&exact)).expect("three values of x");
        assert!((fit.exponent - 0.75).abs() < 1e-12 && fit.standard_error < 1e-6, "{fit:?}");
        // The expected values were calculated independently of this code: a line fitted to log10 y = 0, 1, 3
        // over log10 x = 0, 1, 2 has the slope 1.5 and the residuals 1/6, -1/3, 1/6.
        let bent = Fit::of(&marks(&[[1.0, 1.0], [10.0, 10.0], [100.0, 1000.0]])).expect("three values of x");
        assert!((bent.exponent - 1.5).abs() < 1e-12, "{bent:?}");
        assert!((bent.standard_error - (1.0 / 6.0 / 2.0f64).sqrt()).abs() < 1e-12, "{bent:?}");
        assert_eq!(Fit::of(&marks(&[[1.0, 1.0], [2.0, 2.0]])), None);
        assert_eq!(Fit::of(&marks(&[[1.0, 1.0], [2.0, 2.0], [2.0, 3.0]])), None, "two values of x");
        let mut few = marks(&exact);
        few[2].interval = None;
        assert_eq!(Fit::of(&few), None, "only two values on the x axis have enough samples");
    }

    /// Returns a record of a scene with the given number of triangles.
    fn record(triangles: u64, size: [u32; 2], name: &str, ms: f64) -> Record {
        Record {
            key: format!("{triangles} {size:?} {name}"),
            scene: format!("terrain-{triangles}"),
            triangles: Some(triangles),
            image_size: size,
            ..measured("gpu", name, 8, ms)
        }
    }

    #[test]
    fn records_that_span_triangles_and_pixels_have_both_plots() {
        let mut records = Vec::new();
        for triangles in [1_000, 10_000, 100_000, 1_000_000] {
            records.push(record(triangles, [800, 500], "naive", triangles as f64 * 0.01));
            records.push(record(triangles, [800, 500], "wide", (triangles as f64).sqrt()));
        }
        for side in [400, 1600] {
            records.push(record(1000, [side, side / 8 * 5], "naive", f64::from(side * side) / 64_000.0));
        }
        let records = judged(records);
        let groups = groups(&records);
        let plots = growth(&groups, &Looks::of(&groups));
        let [triangles, pixels] = plots.as_slice() else { panic!("{} plots", plots.len()) };
        assert_eq!((triangles.name.as_str(), pixels.name.as_str()), ("triangles", "pixels"));
        for part in ["naive 1.00 ± 0.00 (n = 4)", "wide 0.50 ± 0.00 (n = 4)"] {
            assert!(triangles.caption.contains(part), "{}", triangles.caption);
        }
        assert!(pixels.caption.contains("naive 1.00 ± 0.00 (n = 3)"), "{}", pixels.caption);
        assert!(triangles.svg.contains("naive: ^1.00"), "the legend has the exponent");
        assert!(!triangles.svg.contains("class=\"line\""), "only fitted lines join marks");
        assert!(plots.iter().all(|plot| !plot.svg.contains(">0<")), "a logarithmic axis has no 0");
        assert!(
            growth(&groups[..1], &Looks::of(&groups)).is_empty(),
            "a single scene and size show no growth"
        );
    }

    #[test]
    fn a_fitted_line_goes_from_the_first_mark_to_the_last_by_the_power_law() {
        let exact: Vec<_> = [10.0, 100.0, 1e4].map(|x: f64| [x, 3.0 * x.powf(0.75)]).to_vec();
        let series =
            Series { name: "naive".into(), look: Look::default(), joined: false, marks: marks(&exact) };
        let line = Fit::of(&series.marks).expect("three values of x").line(&series);
        assert!(line.joined && line.look.dashed && line.name.is_empty());
        let ends: Vec<_> = line.marks.iter().map(|mark| [mark.x, mark.y]).collect();
        assert_eq!(ends.len(), 2);
        for (end, [x, y]) in ends.iter().zip([exact[0], exact[2]]) {
            assert!(end[0] == x && (end[1] / y - 1.0).abs() < 1e-9, "{ends:?}");
        }
        assert_eq!(distinct(marks(&[[0.0, 1.0], [1.0, 1.0], [1.0, 2.0]]).iter()), 1, "0 has no logarithm");
    }

    #[test]
    fn each_device_has_plots_of_its_own_at_the_size_and_of_the_scene_with_the_most_points() {
        let on = |device: &str, record: Record| Record {
            key: format!("{device} {}", record.key),
            device: device.into(),
            ..record
        };
        let mut records = Vec::new();
        for device in ["a", "b"] {
            // The scene of 7 triangles has an image size that no other scene has, so neither the plot over
            // triangles nor the plot over pixels contains this scene.
            records.push(on(device, record(7, [80, 50], "naive", 1e6)));
            for triangles in [1_000, 10_000, 100_000] {
                records.push(on(device, record(triangles, [800, 500], "naive", triangles as f64)));
            }
            records.push(on(device, record(1_000, [1600, 1000], "naive", 4_000.0)));
        }
        let records = judged(records);
        let groups = groups(&records);
        let plots = growth(&groups, &Looks::of(&groups));
        let names: Vec<&str> = plots.iter().map(|plot| plot.name.as_str()).collect();
        assert_eq!(names, ["triangles", "pixels", "triangles-2", "pixels-2"]);
        let assert_contains = |plot: &Plot, parts: &[&str]| {
            parts.iter().for_each(|part| assert!(plot.svg.contains(part), "{part} is not in {}", plot.svg));
        };
        assert_contains(
            &plots[2],
            &["Time against the number of triangles, at 800 x 500: b", "triangles in the scene"],
        );
        assert_contains(
            &plots[3],
            &["Time against the number of pixels, terrain-1000: b", "pixels in the image"],
        );
        assert!(plots[2].caption.contains("naive 1.00 ± 0.00 (n = 3)"), "{}", plots[2].caption);
        assert!(plots[2].caption.ends_with("these other differences also affect the times."));
        assert!(plots[3].caption.contains("There are no fitted lines"), "{}", plots[3].caption);
        assert!(plots[3].svg.contains("class=\"line\""), "without a fit, marks are joined");
    }

    #[test]
    fn scenes_of_one_plot_have_equally_many_samples_per_pixel() {
        let sampled = |record: Record| Record {
            key: format!("{} sampled", record.key),
            scene: format!("{}+samples=4", record.scene),
            samples_per_pixel: Some(4),
            ..record
        };
        let of = |triangles: u64| record(triangles, [800, 500], "naive", triangles as f64);
        let mut records = vec![of(1_000), of(10_000)];
        records.extend([1_000, 10_000, 100_000].map(|triangles| sampled(of(triangles))));
        let records = judged(records);
        let groups = groups(&records);
        let plots = growth(&groups, &Looks::of(&groups));
        let [plot] = plots.as_slice() else { panic!("{} plots", plots.len()) };
        assert!(plot.svg.contains("at 800 x 500 with 4 samples per pixel: gpu"), "{}", plot.svg);
        assert!(plot.caption.contains("naive 1.00 ± 0.00 (n = 3)"), "{}", plot.caption);
    }

    /// A fitted line ends at the first and the last mark, so the marks must be in the order of x.
    #[test]
    fn the_order_in_which_scenes_were_measured_changes_no_plot() {
        let records = [1_000, 10_000, 100_000].map(|count| record(count, [800, 500], "naive", count as f64));
        let records = judged(records);
        let groups = groups(&records);
        let looks = Looks::of(&groups);
        let svg = |groups: &[Group<'_>]| growth(groups, &looks).remove(0).svg;
        let turned = [&groups[1..], &groups[..1]].concat();
        assert!(svg(&turned) == svg(&groups), "{}", svg(&turned));
    }
}
