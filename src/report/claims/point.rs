//! Defines the points to which the claims of the student paper that raycl reproduces refer, such as "naive
//! 8x8 on teapot".

use crate::error::meant;
use crate::numbers::by;
use crate::record::{HOST, Record};
use crate::report::paper;
use crate::strategy::preset_names;
use serde::Deserialize;

/// The names of the baselines that claims may refer to.
const BASELINES: [&str; 3] = ["serial-f32", "serial-f64", "parallel-f32"];

/// Selects records by their local size. A record matches a point of a claim if the record has the point's
/// strategy and scene, comes from the tested device (for a baseline: from the host), and has a selected local size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// Selects only the record with the given local size.
    At([u32; 2]),
    /// Selects the records of all local sizes; a ratio uses only the fastest of them.
    Best,
    /// Selects all records with square local sizes.
    Square,
    /// Selects the record of a baseline (a ray caster on the host), which has no local size.
    Host,
}

/// A strategy at a local size on a scene, as written in the table of claims.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct Point {
    /// The name of a preset or a baseline.
    pub strategy: String,
    /// The local size, or a rule that selects local sizes.
    pub size: Size,
    /// The scene's name.
    pub scene: String,
}

impl TryFrom<String> for Point {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let words: Vec<&str> = text.split(' ').collect();
        let [strategy, size, "on", scene] = words[..] else {
            return Err(format!("'{text}' is not a point; expected \"STRATEGY SIZE on SCENE\""));
        };
        let size = size_of(size)?;
        match size {
            Size::Host => known("baseline", strategy, &BASELINES)?,
            _ => known("preset", strategy, &preset_names())?,
        }
        known("scene", scene, &paper::scenes())?;
        Ok(Self { strategy: strategy.to_owned(), size, scene: scene.to_owned() })
    }
}

/// Parses the word of a point that selects local sizes: "8x8", "best", "square" or "host".
fn size_of(word: &str) -> Result<Size, String> {
    match word {
        "best" => Ok(Size::Best),
        "square" => Ok(Size::Square),
        "host" => Ok(Size::Host),
        _ => local_size(word).map(Size::At),
    }
}

/// Parses a local size, such as "8x8": work-items across and down.
pub(super) fn local_size(word: &str) -> Result<[u32; 2], String> {
    let size = word.split_once('x').and_then(|(x, y)| Some([x.parse().ok()?, y.parse().ok()?]));
    size.filter(|size| !size.contains(&0)).ok_or_else(|| {
        format!("'{word}' is not a size; expected a size such as 8x8 (in a point, 'best', 'square' and 'host' are allowed, too)")
    })
}

/// Fails if `names` does not contain `name`; the error suggests the most similar name, if any is similar enough.
pub(super) fn known(what: &str, name: &str, names: &[&str]) -> Result<(), String> {
    if names.contains(&name) {
        return Ok(());
    }
    let meant = meant(name, names.iter().copied()).map_or(String::new(), |meant| format!("; {meant}"));
    Err(format!("'{name}' is not a known {what}{meant}"))
}

impl std::fmt::Display for Point {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.size {
            Size::At(size) => write!(f, "{} at {} on {}", self.strategy, by(size), self.scene),
            Size::Best => write!(f, "{} at its best on {}", self.strategy, self.scene),
            Size::Square => write!(f, "{} at any square size on {}", self.strategy, self.scene),
            Size::Host => write!(f, "{} on {}", self.strategy, self.scene),
        }
    }
}

impl Point {
    /// Returns true if a record matches the point. The record's device must be `device`, or the host if the
    /// point is a baseline. For [`Size::Best`], records of every local size match.
    pub(super) fn is(&self, record: &Record, device: &str) -> bool {
        let own = match self.size {
            Size::Host => record.device == HOST && record.strategy == self.strategy,
            _ => record.device == device && record.preset.as_deref() == Some(&self.strategy),
        };
        let sized = match self.size {
            Size::At(size) => record.local_size == Some(size),
            Size::Square => record.local_size.is_some_and(|[across, down]| across == down),
            Size::Best | Size::Host => true,
        };
        own && sized && record.scene == self.scene
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(text: &str) -> Result<Point, String> {
        Point::try_from(text.to_owned())
    }

    #[test]
    fn a_point_is_a_strategy_a_size_and_a_scene() {
        let parsed = point("naive 32x2 on teapot").expect("it is one");
        assert_eq!(
            (parsed.size, parsed.to_string().as_str()),
            (Size::At([32, 2]), "naive at 32 x 2 on teapot")
        );
        assert_eq!(point("serial-f32 host on gourd").map(|point| point.size), Ok(Size::Host));
    }

    #[test]
    fn the_error_of_a_misspelt_point_suggests_the_nearest_name() {
        for (text, expected) in [
            ("naiv 8x8 on teapot", "'naiv' is not a known preset; did you mean 'naive'?"),
            ("naive 8x8 on teapott", "'teapott' is not a known scene; did you mean 'teapot'?"),
            ("serial host on teapot", "'serial' is not a known baseline; did you mean 'serial-f32'?"),
            ("naive 8 on teapot", "'8' is not a size"),
            ("naive 8x0 on teapot", "'8x0' is not a size"),
            ("naive 8x8 teapot", "is not a point; expected"),
        ] {
            let error = point(text).expect_err(text);
            assert!(error.contains(expected), "{text}: {error}");
        }
    }

    #[test]
    fn a_record_of_the_preset_matches_under_any_name() {
        let point = point("naive 8x8 on teapot").expect("it is one");
        let record = |name: &str, preset: Option<&str>| Record {
            name: name.into(),
            preset: preset.map(str::to_owned),
            device: "gpu".into(),
            scene: "teapot".into(),
            local_size: Some([8, 8]),
            ..Record::default()
        };
        assert!(point.is(&record("mine", Some("naive")), "gpu"));
        let elsewhere = Record { scene: "gourd".into(), ..record("naive", Some("naive")) };
        assert!(!point.is(&elsewhere, "gpu") && !point.is(&record("naive", Some("naive")), "cpu"));
        let square = self::point("naive square on teapot").expect("it is one");
        let oblong = Record { local_size: Some([32, 2]), ..record("naive", Some("naive")) };
        assert!(square.is(&record("naive", Some("naive")), "gpu") && !square.is(&oblong, "gpu"));
        // The strategy of this record has the preset's name, but the record has no preset, because the config
        // changed one of the preset's axes.
        assert!(!point.is(&record("naive", None), "gpu"));
    }
}
