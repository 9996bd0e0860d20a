//! Reads the table of claims in TOML: the sentences of the student paper that raycl reproduces, and the tests
//! that must hold for each sentence.

use super::point::{Point, known, local_size};
use crate::device::occupancy::multiprocessor;
use crate::error::{Error, Result};
use crate::strategy::{PRESETS, Strategy, preset_names};
use crate::toml_error::toml_error;
use serde::Deserialize;

const TABLE: &str = include_str!("claims.toml");

/// A claim of the paper.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// The claim in the paper's words.
    pub sentence: String,
    /// The section of the paper that contains the sentence, and the figure to which the sentence refers.
    pub place: String,
    /// The values that the paper published on the claim, or a note that the paper published no values.
    pub published: String,
    /// The meaning of the claim's sentence in the paper, as the authors of raycl interpret it.
    pub reading: String,
    /// A contradiction within the paper, or between the paper and arithmetic.
    #[serde(default)]
    pub contradiction: String,
    /// The names of the configs that measure the claim's points.
    pub configs: Vec<String>,
    /// The tests of the claim. The claim holds only if all of its tests hold.
    pub test: Vec<Test>,
}

/// A kind of test with its numbers, as documented in `claims.toml`.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[allow(missing_docs, reason = "the first lines of claims.toml document each kind")]
pub enum Test {
    Ratio { of: Vec<Point>, to: Point, at_least: Option<f64>, at_most: Option<f64> },
    Rises { over: Vec<Point>, at_least: f64 },
    Fastest(FastestTest),
    Runs { points: Vec<Point>, runs: bool },
    Passes { point: Point, of: Pass, to: Pass, at_least: f64 },
    Fits { strategy: Preset, local_size: LocalSize, triangles: usize, local_bytes: u64, fits: bool },
    Occupancy { compute_capability: Capability, registers: u32, local_size: LocalSize, threads: u64 },
    Latency { memory: Memory, cycles: f64, within: f64 },
    Judgement { reason: String, decides: String },
}

/// A test of which point is the fastest, and by how much.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FastestTest {
    /// The point that is claimed to be the fastest.
    pub is: Point,
    /// The points whose times are compared with the time of the point in the field `is`.
    pub of: Vec<Point>,
    /// The smallest accepted ratio of another point's time to the time of the point in the field `is`.
    pub by: f64,
    /// Points that match the field `of`, but are nevertheless left out of the comparison.
    #[serde(default)]
    pub except: Vec<Point>,
}

/// A pass of a frame whose passes are timed separately.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pass {
    /// The primary pass, which casts rays from the eye.
    Primary,
    /// The shadow pass, which casts rays to the lights.
    Shadow,
}

/// A kind of memory whose latency `raycl peak` measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Memory {
    /// Private memory, in registers.
    Private,
    /// `__local` memory.
    Local,
    /// Global memory, for data that are in no cache.
    Global,
}

/// A preset's name.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct Preset(pub String);

impl TryFrom<String> for Preset {
    type Error = String;

    fn try_from(name: String) -> std::result::Result<Self, String> {
        known("preset", &name, &preset_names())?;
        Ok(Self(name))
    }
}

impl Preset {
    /// Returns the preset's strategy, or `None` if no preset has this name. A preset that comes from the
    /// table of claims always has a strategy, because raycl refuses unknown names when it reads the table.
    pub fn strategy(&self) -> Option<Strategy> {
        PRESETS.iter().find(|preset| preset.name == self.0).map(|preset| preset.strategy)
    }
}

/// A local size (the numbers of work-items across and down), which the table of claims states like "8x8".
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct LocalSize(pub [u32; 2]);

impl TryFrom<String> for LocalSize {
    type Error = String;

    fn try_from(text: String) -> std::result::Result<Self, String> {
        local_size(&text).map(Self)
    }
}

/// A compute capability, such as "9.0", whose limits raycl knows.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct Capability(pub String);

impl TryFrom<String> for Capability {
    type Error = String;

    fn try_from(name: String) -> std::result::Result<Self, String> {
        multiprocessor(&name).map_err(|error| error.to_string())?;
        Ok(Self(name))
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    claim: Vec<Row>,
}

/// Returns the table of claims that the program contains.
pub fn table() -> Result<Vec<Row>> {
    read("claims.toml", TABLE)
}

/// Reads a table of claims from TOML. `name` is the table's name in errors. The error states the line of the
/// mistake or the number of the claim and, for a misspelt name, the most similar valid name.
pub(super) fn read(name: &str, text: &str) -> Result<Vec<Row>> {
    let file: File = toml::from_str(text).map_err(|error| {
        toml_error(name, text, &error, "the first lines of claims.toml explain every key and kind")
    })?;
    let mut rows = (1_usize..).zip(&file.claim);
    match rows.find_map(|(number, row)| Some((number, row.mistake()?))) {
        Some((number, mistake)) => Err(Error::input(format!("{name}: in claim {number}, {mistake}"))
            .with_help("the first lines of claims.toml explain every key and kind")),
        None => Ok(file.claim),
    }
}

impl Row {
    /// Returns the first mistake in the row that the crate serde does not detect: an empty text, no test, or
    /// an unknown config. Returns `None` if the row has none of these mistakes.
    fn mistake(&self) -> Option<String> {
        let empty = [
            ("sentence", &self.sentence),
            ("place", &self.place),
            ("published", &self.published),
            ("reading", &self.reading),
        ];
        let configs = crate::report::paper::CONFIGS.map(|(name, _)| name);
        let empty = empty.into_iter().find(|(_, text)| text.trim().is_empty());
        empty
            .map(|(key, _)| format!("`{key}` is empty"))
            .or_else(|| self.test.is_empty().then(|| "there is no test".to_owned()))
            .or_else(|| self.configs.iter().find_map(|config| known("config", config, &configs).err()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Experiment;
    use crate::report::claims::point::Size;

    #[test]
    fn every_claim_is_a_sentence_and_every_kind_of_test_is_used() {
        let rows = table().expect("it reads");
        assert!(rows.len() >= 30, "{} rows", rows.len());
        for row in &rows {
            assert!(row.sentence.ends_with('.') && row.sentence.split(' ').count() > 9, "{}", row.sentence);
        }
        let kinds: std::collections::HashSet<_> =
            rows.iter().flat_map(|row| &row.test).map(std::mem::discriminant).collect();
        assert_eq!(kinds.len(), 9, "a kind of test that no claim uses");
    }

    /// Returns every point to which a test of a claim refers.
    fn points(test: &Test) -> Vec<&Point> {
        match test {
            Test::Ratio { of, to, .. } => of.iter().chain([to]).collect(),
            Test::Rises { over, .. } => over.iter().collect(),
            Test::Fastest(test) => test.of.iter().chain([&test.is]).chain(&test.except).collect(),
            Test::Runs { points, .. } => points.iter().collect(),
            Test::Passes { point, .. } => vec![point],
            _ => Vec::new(),
        }
    }

    /// Returns true if a config measures a point.
    fn measures(config: &Experiment, point: &Point) -> bool {
        let sized = |sizes: &[[u32; 2]]| match point.size {
            Size::At(size) => sizes.contains(&size),
            _ => sizes.len() > 2,
        };
        let strategy = match point.size {
            Size::Host => config.baselines.iter().any(|baseline| baseline.strategy() == point.strategy),
            _ => config
                .strategies
                .iter()
                .any(|one| one.preset.as_deref() == Some(&point.strategy) && sized(&one.local_sizes)),
        };
        strategy && config.scenes.iter().any(|scene| scene.label() == point.scene)
    }

    #[test]
    fn every_point_is_measured_by_one_of_the_claims_configs() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
        let config = |name: &String| crate::config::load(&folder.join(format!("{name}.toml")), &[]);
        for row in table().expect("it reads") {
            let configs: Vec<_> = row.configs.iter().map(|name| config(name).expect("it loads")).collect();
            for point in row.test.iter().flat_map(points) {
                assert!(configs.iter().any(|config| measures(config, point)), "{point}: {}", row.sentence);
            }
        }
    }

    /// Returns the TOML text of a table with one claim, whose test is `test`.
    fn one(test: &str) -> String {
        let rest = "place = \"p\"\npublished = \"v\"\nreading = \"r\"\nconfigs = [\"figure-8\"]\n";
        format!("[[claim]]\nsentence = \"It is so.\"\n{rest}test = [{{ {test} }}]\n")
    }

    #[test]
    fn the_error_of_a_misspelt_row_suggests_the_nearest_name() {
        let ratio = "of = [\"naive 8x8 on teapot\"], to = \"naive 4x4 on teapot\"";
        read("t", &one(&format!("kind = \"ratio\", {ratio}"))).expect("it is right");
        let occupancy = "kind = \"occupancy\", registers = 63, local_size = \"2x2\", threads = 32";
        let with_capability = |name: &str| one(&format!("{occupancy}, compute_capability = \"{name}\""));
        read("t", &with_capability("2.0")).expect("it is right");
        for (text, expected) in [
            (one(&format!("kind = \"raito\", {ratio}")), "did you mean `ratio`?"),
            (one(&format!("kind = \"ratio\", {ratio}, at_lest = 1")), "did you mean `at_least`?"),
            (one("kind = \"rises\", at_least = 1, over = [\"naiv 8x8 on teapot\"]"), "did you mean 'naive'?"),
            (
                one("kind = \"rises\", at_least = 1, over = [\"naive 8x8 on taepot\"]"),
                "did you mean 'teapot'?",
            ),
            (
                one("kind = \"rises\", at_least = 1, over = []").replace("figure-8", "figur-8"),
                "did you mean 'figure-8'?",
            ),
            (
                one("kind = \"rises\", at_least = 1, over = []").replace("It is so.", " "),
                "`sentence` is empty",
            ),
            (
                one("kind = \"rises\", at_least = 1, over = []").replace("reading", "raeding"),
                "did you mean `reading`?",
            ),
            (with_capability("2.5"), "'2.5' is not a supported compute capability"),
        ] {
            let error = read("t", &text).expect_err("a mistake");
            assert!(error.to_string().contains(expected), "{expected}: {error}");
        }
    }
}
