//! The run times, in milliseconds, that a student paper published, and the configs of `raycl reproduce`, which
//! repeats the paper's experiments. The authors of raycl read the times off the plots in the paper's Figures 6 to
//! 8. The program contains the configs, so `raycl reproduce` needs no further files.

use include_dir::{Dir, include_dir};

/// The name and the TOML text of each config that `raycl reproduce` measures. These configs repeat the paper's
/// experiments and pictures, and measure the next steps that the paper proposes.
pub const CONFIGS: [(&str, &str); 5] = [
    ("pictures", include_str!("../../configs/pictures.toml")),
    ("figure-6", include_str!("../../configs/figure-6.toml")),
    ("figure-7", include_str!("../../configs/figure-7.toml")),
    ("figure-8", include_str!("../../configs/figure-8.toml")),
    ("next-steps", include_str!("../../configs/next-steps.toml")),
];

/// The folder of raycl's scene files, which contains the scenes of [`CONFIGS`].
pub static SCENES: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/scenes");

/// Returns the names of all scenes in the folder [`SCENES`].
pub fn scenes() -> Vec<&'static str> {
    let files = SCENES.files().map(include_dir::File::path);
    let scenes = files.filter(|path| path.extension().is_some_and(|ending| ending == "toml"));
    scenes.filter_map(|path| path.file_stem()?.to_str()).collect()
}

/// One point of a curve in a plot of the paper.
#[derive(Clone, Debug, PartialEq)]
pub struct Published {
    /// The paper's figure: 6, 7 or 8.
    pub figure: u32,
    /// The series' name in the figure.
    pub series: String,
    /// The side of the square work-group (the paper's *block*), in work-items.
    pub block: u32,
    /// The published run time in milliseconds.
    pub ms: f64,
}

const CSV: &str = include_str!("assets/published_runtimes.csv");

/// Returns every point of the paper's Figures 6 to 8, in the order of published_runtimes.csv.
pub fn published() -> Vec<Published> {
    let parse = |line: &str| {
        let mut cells = line.split(',');
        let (figure, series, block, ms) = (cells.next()?, cells.next()?, cells.next()?, cells.next()?);
        Some(Published {
            figure: figure.parse().ok()?,
            series: series.to_owned(),
            block: block.parse().ok()?,
            ms: ms.parse().ok()?,
        })
    };
    CSV.lines().skip(1).filter_map(parse).collect()
}

/// The curves in the paper's Figures 6 to 8. Each element has the number of the paper's figure, the curve's name in
/// the figure, and the scene and the preset with which raycl repeats the curve.
pub const CURVES: [(u32, &str, &str, &str); 7] = [
    (6, "Teapot (1026)", "teapot", "naive"),
    (6, "Gourd (650)", "gourd", "naive"),
    (7, "Single Triangle", "triangle", "naive"),
    (7, "Pyramid (6)", "pyramid-upper", "naive"),
    (8, "Naive", "still-life", "naive"),
    (8, "Opt1", "still-life", "local-vectors"),
    (8, "Opt2", "still-life", "local-triangles"),
];

/// Returns the number of the paper's figure that has a curve for this scene and preset, and the curve's
/// points. A point consists of the side of the square work-group in work-items, and the time in milliseconds.
/// Returns `None` if the paper has no curve for this scene and preset.
pub fn curve(scene: &str, preset: &str) -> Option<(u32, Vec<(u32, f64)>)> {
    let (figure, series, ..) =
        CURVES.iter().find(|(_, _, of_scene, of_preset)| *of_scene == scene && *of_preset == preset)?;
    let points = published().into_iter().filter(|point| point.figure == *figure && point.series == *series);
    Some((*figure, points.map(|point| (point.block, point.ms)).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_curve_has_its_points() {
        assert_eq!(published().len(), 16 + 16 + 18);
        for (_, _, scene, preset) in CURVES {
            let (_, points) = curve(scene, preset).expect("it is published");
            assert!(points.len() == 6 || points.len() == 8, "{scene} {preset}");
        }
        let (_, teapot) = curve("teapot", "naive").expect("it is published");
        assert_eq!(teapot[0], (1, 163_000.0));
    }
}
