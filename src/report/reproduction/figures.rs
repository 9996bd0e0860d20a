//! Describes figures of the student paper that raycl reproduces, each with raycl's version of the figure and the known
//! differences between the two versions.

use super::curves::curves_of;
use super::predicted::predicted;
use crate::error::Result;
use crate::report::claims::{Run, completion};
use crate::report::gallery::{Picture, Pictures};
use crate::report::plot::Plot;
use crate::toml_error::toml_error;
use serde::Deserialize;

const TABLE: &str = include_str!("figures.toml");

/// The description of a figure of the paper.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Described {
    /// The figure's number in the paper.
    pub number: u32,
    /// The figure's title.
    pub title: String,
    /// The scenes whose pictures raycl shows for the figure.
    pub pictures: Vec<String>,
    /// The known differences between the paper's figure and raycl's version.
    pub differs: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    figure: Vec<Described>,
}

/// A figure of the paper, with raycl's version, for the page of `raycl reproduce`.
pub struct Figure {
    /// The figure's number, title and known differences.
    pub about: Described,
    /// raycl's pictures of the figure's scenes.
    pub pictures: Vec<Picture>,
    /// raycl's plots of the values that the paper's figure shows.
    pub plots: Vec<Plot>,
    /// Table rows: curve, block size, published time, raycl's time, and the published time divided by raycl's time.
    pub rows: Vec<[String; 5]>,
    /// The command that measures the figure's data, if raycl has neither pictures nor plots of the figure;
    /// otherwise empty.
    pub missing: String,
}

/// Returns the descriptions of the figures in figures.toml.
pub fn described() -> Result<Vec<Described>> {
    let file: File = toml::from_str(TABLE).map_err(|error| {
        toml_error(
            "figures.toml",
            TABLE,
            &error,
            "the other figures in figures.toml show the keys of a figure",
        )
    })?;
    Ok(file.figure)
}

/// Returns raycl's version of a figure for a device. If there are neither pictures nor plots, the result contains the
/// command that measures the missing points. The names of the plots end with `suffix`, so that the plots of different
/// devices have different names.
pub fn figure(
    about: Described,
    runs: &[Run<'_>],
    device: &str,
    suffix: &str,
    pictures: &mut Pictures,
) -> Figure {
    let shown: Vec<Picture> =
        about.pictures.iter().filter_map(|scene| picture(scene, runs, device, pictures)).collect();
    let (plots, rows) = match about.number {
        5 => (vec![predicted(runs, device, suffix)], Vec::new()),
        number => curves_of(number, runs, device, suffix).unwrap_or_default(),
    };
    let is_missing = shown.is_empty() && plots.is_empty();
    let missing = completion(runs, device).filter(|_| is_missing).unwrap_or_default();
    Figure { about, pictures: shown, plots, rows, missing }
}

/// Returns the widest picture of a scene that a device cast; `None` if the folders contain no such picture.
/// Of pictures of the same size, prefers a picture by the preset `naive`.
fn picture(scene: &str, runs: &[Run<'_>], device: &str, pictures: &mut Pictures) -> Option<Picture> {
    let groups = runs.iter().flat_map(|run| run.groups.iter().map(move |group| (run.path(), group)));
    let own = groups.filter(|(_, group)| group.scene == scene && group.device == device);
    let records = own.flat_map(|(folder, group)| group.records.iter().map(move |record| (folder, *record)));
    let there = records.filter(|(folder, record)| pictures.has(folder, record.image.as_deref()));
    let (folder, record) = there.max_by_key(|(_, record)| (record.image_size, record.is_naive()))?;
    let caption = format!("cast by {} on {device}", crate::report::words::title(record));
    Some(pictures.picture(folder, record.image.as_deref()?, scene.to_owned(), caption))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::fixtures::measured;
    use crate::record::{Folder, Record, groups};

    #[test]
    fn every_figure_but_the_drawing_of_the_camera_says_what_differs() {
        let figures = described().expect("it reads");
        let numbers: Vec<_> = figures.iter().map(|figure| figure.number).collect();
        assert_eq!(numbers, [1, 3, 4, 5, 6, 7, 8, 9]);
        let scenes = crate::report::paper::scenes();
        for figure in &figures {
            assert!(!figure.differs.trim().is_empty() && !figure.title.is_empty(), "{figure:?}");
            assert!(figure.pictures.iter().all(|scene| scenes.contains(&scene.as_str())), "{figure:?}");
        }
    }

    #[test]
    fn the_widest_picture_is_shown_and_of_equally_wide_ones_that_of_naive() {
        let root = tempfile::tempdir().expect("a folder");
        let record = |name: &str, image_size: [u32; 2]| {
            let image = format!("{name}-{}.png", image_size[0]);
            std::fs::write(root.path().join(&image), "a picture").expect("a file");
            Record { image: Some(image), image_size, ..measured("gpu", name, 8, 1.0) }
        };
        let shown = |records: [Record; 2]| {
            let (path, records) = (root.path().to_owned(), records.into());
            let folder = Folder { path, records, ..Folder::default() };
            let runs = Run::of(&folder, groups(&folder.records));
            let picture = picture("teapot", &runs, "gpu", &mut Pictures::default());
            picture.expect("a picture").path
        };
        assert_eq!(shown([record("naive", [8, 5]), record("bvh", [16, 10])]), "bvh-16.png");
        assert_eq!(shown([record("naive", [16, 10]), record("bvh", [16, 10])]), "naive-16.png");
    }

    #[test]
    fn a_command_is_named_only_for_a_figure_without_pictures_and_without_plots() {
        let records = vec![measured("gpu", "naive", 8, 1.0)];
        let folder = Folder { path: "out/figure-6".into(), records, ..Folder::default() };
        let runs = Run::of(&folder, groups(&folder.records));
        let shown = |number: u32| {
            let figures = described().expect("it reads");
            let about = figures.into_iter().find(|figure| figure.number == number).expect("a figure");
            let figure = figure(about, &runs, "gpu", "", &mut Pictures::default());
            (figure.plots.len(), figure.missing)
        };
        assert_eq!(shown(1), (0, "raycl reproduce --out out --resume".to_owned()));
        assert_eq!([shown(5), shown(6)], [(1, String::new()), (2, String::new())]);
    }
}
