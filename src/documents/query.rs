//! Reads and answers queries. A query usually selects a record and one of the record's figures (numbers and
//! texts). Other queries ask for a value in a JSON file, for a time from the paper, or for a number of threads
//! that raycl computes. A query may also say how the answer is rounded, and in which unit it is written.
//!
//! A query has the form `SOURCE: WORDS [/ [SOURCE:] WORDS] [, MODIFIER]...`. For example,
//! `h200/reproduce/figure-8: naive 8x8 still-life / local-vectors 8x8 still-life, 2 digits` asks for a ratio of
//! two times.
//! CONTRIBUTING.md documents this syntax.

use super::occupancy::threads;
use super::of_record::{Figure, Form, MEDIAN, figure, is_figure};
use super::published::published;
use super::sources::{Source, Sources};
use crate::error;
use crate::numbers::significant;
use crate::record::{Record, not_enough, ranking, ratio, why_unranked};
use crate::report::exponent;
use crate::strategy::PRESETS;
use serde_json::Value;

/// The default number of significant digits of measured numbers without a unit, and of all numbers with a unit (`%` is
/// a unit too). Without a unit, shares and numbers in scientific notation have 2 significant digits by default. A count
/// without a unit is written with all its digits, and a query for such a count must not ask for a number of digits.
const DIGITS: i32 = 3;
/// The source name for the times that the paper published. The published times are part of the program, not
/// of a folder of records.
const PUBLISHED: &str = "published";
/// The source name in queries for the number of threads on a multiprocessor. raycl computes the number of
/// threads instead of reading it from a file.
const OCCUPANCY: &str = "occupancy";
/// The units in which a query can ask for a result: the name of each unit, and the factor by which the figure is
/// multiplied.
const UNITS: [(&str, f64); 8] =
    [("T", 1e-12), ("G", 1e-9), ("M", 1e-6), ("k", 1e-3), ("s", 1e-3), ("us", 1e3), ("%", 100.0), ("1", 1.0)];

/// A query for one figure, or for the quotient of two figures.
pub struct Query<'a> {
    operands: Vec<(&'a str, Vec<&'a str>)>,
    digits: Option<i32>,
    factor: Option<f64>,
}

impl<'a> Query<'a> {
    /// Reads a query from a text. The error names the mistake in the query.
    pub fn parse(text: &'a str) -> Result<Self, String> {
        let mut parts = text.split(", ");
        let mut operands: Vec<(&str, Vec<&str>)> = Vec::new();
        for operand in parts.next().unwrap_or_default().split(" / ") {
            let (source, words) = match operand.split_once(": ") {
                Some(parts) => parts,
                None => (operands.first().map_or("", |(source, _)| source), operand),
            };
            operands.push((source.trim(), words.split_whitespace().collect()));
        }
        if operands.len() > 2 || operands[0].0.is_empty() {
            return Err(format!(
                "'{text}' is not a query; expected \"SOURCE: WORDS\" or \"SOURCE: WORDS / WORDS\""
            ));
        }
        let mut query = Self { operands, digits: None, factor: None };
        for modifier in parts {
            query.modify(modifier.trim())?;
        }
        Ok(query)
    }

    fn modify(&mut self, modifier: &str) -> Result<(), String> {
        if let Some(digits) = modifier.strip_suffix(" digits").and_then(|count| count.parse().ok()) {
            self.digits = Some(digits);
            return Ok(());
        }
        let unit = UNITS.iter().find(|(name, _)| *name == modifier);
        let unknown = || {
            format!(
                "'{modifier}' is neither \"N digits\" nor one of the units {}",
                UNITS.map(|(name, _)| name).join(", ")
            )
        };
        self.factor = Some(unit.ok_or_else(unknown)?.1);
        Ok(())
    }

    /// Returns the query's answer as it is written into a document; [`Figure::Nothing`] if the records have
    /// no figure for the query. The error names a mistake in the query, or says why a source cannot be read.
    pub fn answer(&self, sources: &Sources) -> Result<Figure, String> {
        Ok(self.answer_and_number(sources)?.0)
    }

    /// Returns the same as [`Self::answer`], and the number before it was rounded. The number is `None` if the answer
    /// is no number, or if it has a remark: a number with a remark is not compared with others.
    pub fn answer_and_number(&self, sources: &Sources) -> Result<(Figure, Option<f64>), String> {
        let answered = match &self.operands[..] {
            [one, other, ..] => (quotient(&operand(sources, one)?, &operand(sources, other)?), String::new()),
            [one] => {
                let side = operand(sources, one)?;
                let remark = side.remark();
                (side.value, remark)
            }
            [] => (Figure::Nothing(String::new()), String::new()),
        };
        Ok(match answered {
            (Figure::Number(value, Form::Count), _) if self.digits.is_some() && self.factor.is_none() => {
                return Err(format!(
                    "{value} is a count, which is not rounded: leave out the digits, or add a unit"
                ));
            }
            (Figure::Number(value, form), remark) => {
                (Figure::Words(self.written(value, form) + &remark), remark.is_empty().then_some(value))
            }
            (other, _) => (other, None),
        })
    }

    fn written(&self, value: f64, form: Form) -> String {
        let digits = self.digits.unwrap_or(DIGITS);
        match (self.factor, form) {
            (Some(factor), _) => significant(value * factor, digits),
            (None, Form::Measure) => significant(value, digits),
            (None, Form::Count) => format!("{value:.0}"),
            (None, Form::Percent) => significant(100.0 * value, self.digits.unwrap_or(2)),
            (None, Form::Power) => format!("{value:.*e}", self.digits.unwrap_or(2).max(1) as usize - 1),
        }
    }
}

/// The value of one operand of a query. If the operand's value is the median of a frame's time, `median_of`
/// contains the record of this median; otherwise, `median_of` is `None`.
struct Side {
    value: Figure,
    median_of: Option<Record>,
}

impl Side {
    /// Returns the reason why the median has no 95% interval, such as " (n = 3)". Returns an empty text if
    /// the median has an interval, or if the value is not a median.
    fn remark(&self) -> String {
        let unranked = self.median_of.as_ref().filter(|record| not_enough(record).is_some());
        unranked.map_or(String::new(), |record| format!(" ({})", why_unranked(record)))
    }

    /// Returns the reason why the operand's value cannot be used in a ratio. A value cannot be used if it is missing,
    /// or if it is a median of too few samples or of samples some of which are 0. Returns `None` if the value can be
    /// used.
    fn obstacle(&self) -> Option<String> {
        match &self.value {
            Figure::Nothing(why) => Some(why.clone()),
            _ => self.median_of.as_ref().and_then(not_enough),
        }
    }
}

fn operand(sources: &Sources, (name, words): &(&str, Vec<&str>)) -> Result<Side, String> {
    match *name {
        PUBLISHED => return Ok(Side { value: published(words)?, median_of: None }),
        OCCUPANCY => return Ok(Side { value: threads(words)?, median_of: None }),
        _ => {}
    }
    match &*sources.get(name)? {
        Source::Json(value) => Ok(Side { value: at(value, words)?, median_of: None }),
        Source::Folder(folder) => of_folder(&folder.records, words, name),
    }
}

/// Returns the quotient of two figures. The quotient of two medians is computed by [`ratio`], as in reports. If the two
/// points were measured together, [`ratio`] uses pairs of samples that were measured close in time. Returns
/// [`Figure::Nothing`] with the reason if the quotient cannot be computed.
fn quotient(one: &Side, other: &Side) -> Figure {
    let both = one.median_of.as_ref().zip(other.median_of.as_ref());
    let quotient = match (both, &one.value, &other.value) {
        (Some((one, other)), ..) => ratio(one, other).map(|ratio| ratio.middle),
        (None, Figure::Number(one, _), Figure::Number(other, _)) => Some(one / other),
        (None, ..) => None,
    };
    match quotient {
        Some(quotient) => Figure::Number(quotient, Form::Measure),
        None => {
            let why = [one, other].into_iter().find_map(Side::obstacle);
            Figure::Nothing(why.unwrap_or_else(|| "not numbers".into()))
        }
    }
}

/// Returns the value at the JSON pointer (RFC 6901) that the words in `words` form when they are joined. A null in the
/// JSON means that the value was not measured. Returns an error if the JSON has no number, text or null at the pointer.
fn at(value: &Value, words: &[&str]) -> Result<Figure, String> {
    let pointer = words.concat();
    match value.pointer(&pointer) {
        Some(Value::Number(number)) if number.is_f64() => {
            Ok(Figure::Number(number.as_f64().unwrap_or_default(), Form::Measure))
        }
        Some(Value::Number(number)) => Ok(Figure::Number(number.as_f64().unwrap_or_default(), Form::Count)),
        Some(Value::String(text)) => Ok(Figure::Words(text.clone())),
        Some(Value::Null) => Ok(Figure::Nothing("not measured".into())),
        _ => Err(format!("the file has no value at '{pointer}'")),
    }
}

fn of_folder(records: &[Record], words: &[&str], name: &str) -> Result<Side, String> {
    let mut picked: Vec<&Record> = records.iter().collect();
    let (mut wanted, mut best, mut growth) = (MEDIAN, false, None);
    for word in words {
        match *word {
            "best" => best = true,
            "growth-with-triangles" => growth = Some("triangles"),
            "growth-with-pixels" => growth = Some("pixels"),
            figure if is_figure(figure) => wanted = figure,
            word if records.iter().any(|record| is(record, word)) => picked.retain(|record| is(record, word)),
            word if PRESETS.iter().any(|preset| preset.name == word) => picked.clear(),
            word => return Err(format!("no record in {name} matches '{word}'{}", meant(records, word))),
        }
    }
    if let Some(across) = growth {
        return Ok(Side { value: grown(&picked, across), median_of: None });
    }
    if best {
        picked = ranking(picked.iter().copied()).all().into_iter().take(1).collect();
    }
    match picked[..] {
        [] => Ok(Side { value: Figure::Nothing(String::new()), median_of: None }),
        [one] => Ok(Side { value: figure(one, wanted), median_of: (wanted == MEDIAN).then(|| one.clone()) }),
        _ => Err(format!(
            "{} records of {name} match '{}'; expected exactly one: add words, such as a local size",
            picked.len(),
            words.join(" ")
        )),
    }
}

/// Fits a power law to the median times of some records, and returns the exponent. The median time is fitted as a
/// function of the number that `across` names, such as the number of triangles. Returns [`Figure::Nothing`] if there
/// are too few points for a fit.
fn grown(records: &[&Record], across: &str) -> Figure {
    let number = |record: &Record, name: &str| match figure(record, name) {
        Figure::Number(value, _) => Some(value),
        _ => None,
    };
    let points: Vec<[f64; 2]> = records
        .iter()
        .filter_map(|record| Some([number(record, across)?, number(record, MEDIAN)?]))
        .collect();
    exponent(&points).map_or(Figure::Nothing("too few points".into()), |[exponent, _]| {
        Figure::Number(exponent, Form::Measure)
    })
}

/// Returns true if a word of a query names a value of the record: the point's name, the scene, a baseline's
/// strategy, the local size ("8x8"), the image size ("@800x500"), the number of triangles ("triangles=1026"),
/// or a value of an axis ("width=8").
fn is(record: &Record, word: &str) -> bool {
    let size = |[across, down]: [u32; 2]| format!("{across}x{down}");
    let axis = || match word.split_once('=') {
        Some(("triangles", count)) => record.triangles.is_some_and(|own| own.to_string() == count),
        Some((axis, value)) => record.axis(axis) == Some(value),
        None => false,
    };
    [&record.name, &record.scene, &record.strategy].iter().any(|own| *own == word)
        || record.local_size.is_some_and(|own| size(own) == word)
        || word.strip_prefix('@').is_some_and(|word| size(record.image_size) == word)
        || axis()
}

fn meant(records: &[Record], word: &str) -> String {
    let names = records.iter().flat_map(|record| [record.name.as_str(), record.scene.as_str()]);
    error::meant(word, names).map_or(String::new(), |meant| format!("; {meant}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;
    use std::path::Path;

    /// Answers a query from the records that are stored for tests.
    fn answer(query: &str) -> Result<Figure, String> {
        let folders = BTreeMap::from([("old".to_owned(), "tests/data/old-results".to_owned())]);
        let sources = Sources::new(Path::new(env!("CARGO_MANIFEST_DIR")), folders);
        Query::parse(query)?.answer(&sources)
    }

    #[test]
    fn digits_of_a_count_are_refused() {
        let query = "old: naive 1x1 triangles";
        let error = answer(&format!("{query}, 2 digits")).unwrap_err();
        assert!(
            error.ends_with(" is a count, which is not rounded: leave out the digits, or add a unit"),
            "{error}"
        );
        assert!(answer(query).is_ok() && answer(&format!("{query}, k, 2 digits")).is_ok());
    }

    fn words(query: &str) -> String {
        match answer(query) {
            Ok(Figure::Words(text)) => text,
            other => panic!("{query}: {other:?}"),
        }
    }

    #[test]
    fn published_and_computed_figures() {
        assert_eq!(words("published: teapot naive 8x8"), "10400");
        assert_eq!(answer("published: teapot naive 14x14"), Ok(Figure::Nothing("no point".into())));
        assert_eq!(words("occupancy: groups=8 threads=1536 10x10"), "800");
        assert_eq!(words("occupancy: capability=2.0 registers=63 16x16"), "512 (registers)");
        // Seven work-groups of 14 x 14 = 196 work-items (1372 threads) fit into 1536 threads.
        assert_eq!(words("occupancy: groups=8 threads=1536 14x14"), "1372");
        assert_eq!(words("published: teapot naive 1x1 / teapot naive 4x4"), "10.8");
        assert_eq!(words("published: teapot naive 1x1 / teapot naive 4x4, 2 digits"), "11");
        assert_eq!(words("published: teapot naive 1x1, s, 2 digits"), "163");
    }

    #[test]
    fn the_quotient_of_other_figures_than_times_is_their_own() {
        assert_eq!(words("old: naive 1x1 registers"), "64");
        assert_eq!(words("old: local-vectors 1x1 registers"), "49");
        assert_eq!(words("old: naive 1x1 registers / local-vectors 1x1 registers"), "1.31");
    }

    #[test]
    fn what_is_wrong_with_a_query_is_said() {
        let wrong = |query: &str, part: &str| {
            let error = answer(query).expect_err(query);
            assert!(error.contains(part), "{error}");
        };
        wrong("8x8", "is not a query");
        wrong("new: naive 8x8", "'new' is not a source; expected one of old");
        wrong("published: teapot naive 8x8, 3 digit", "neither");
        wrong("old: naive 1x1 still-lfe", "did you mean 'still-life'?");
        wrong("old: naive still-life", "expected exactly one");
        wrong("occupancy: capability=2.0 8x8", "registers= is missing");
    }

    #[test]
    fn a_median_of_too_few_samples_has_their_number() {
        let side = |samples: usize| {
            let record = crate::record::fixtures::few("gpu", "naive", 8, 2.0, samples);
            let record = crate::record::fixtures::judged([record]).remove(0);
            Side { value: Figure::Nothing(String::new()), median_of: Some(record) }
        };
        assert_eq!(side(3).remark(), " (n = 3)");
        assert_eq!(side(5).remark(), "");
        assert_eq!(Side { median_of: None, ..side(3) }.remark(), "");
    }

    #[test]
    fn a_quotient_that_is_not_known_has_the_reason_of_its_operand() {
        use crate::record::fixtures::{few, infeasible, judged, measured};
        let records = judged([
            measured("gpu", "wide", 1, 2.0),
            infeasible("gpu", "local-triangles", 8, "too large"),
            few("gpu", "naive", 8, 0.0, 30),
            few("gpu", "naive", 4, 3.0, 3),
        ]);
        let side = |words: &[&str]| of_folder(&records, words, "x").expect("one record");
        let [timed, refused, zero, few] =
            [&["wide"][..], &["local-triangles"], &["naive", "8x8"], &["naive", "4x4"]].map(side);
        for (operand, why) in [
            (&refused, "infeasible"),
            (&zero, "times below the timer's resolution"),
            (&few, "not enough samples (n = 3)"),
        ] {
            let unknown = Figure::Nothing(why.into());
            assert_eq!([quotient(&timed, operand), quotient(operand, &timed)], [unknown.clone(), unknown]);
        }
        assert_eq!([refused.remark(), zero.remark()], ["", " (times below the timer's resolution)"]);
    }

    #[test]
    fn each_form_of_a_number_has_its_digits() {
        let written = |modifiers: &str, value: f64, form| {
            let text = format!("old: x{modifiers}");
            Query::parse(&text).map(|query| query.written(value, form)).expect("a query")
        };
        for (modifiers, value, form, expected) in [
            ("", 12.3456, Form::Measure, "12.3"),
            (", 5 digits", 12.3456, Form::Measure, "12.346"),
            ("", 12.5678, Form::Count, "13"),
            ("", 0.123, Form::Percent, "12"),
            (", 3 digits", 0.1234, Form::Percent, "12.3"),
            ("", 1.234e-5, Form::Power, "1.2e-5"),
            (", 3 digits", 1.234e-5, Form::Power, "1.23e-5"),
            (", G", 2.5e9, Form::Count, "2.50"),
            (", us, 2 digits", 0.25, Form::Measure, "250"),
            (", %", 0.5, Form::Measure, "50.0"),
        ] {
            assert_eq!(written(modifiers, value, form), expected, "{modifiers} {form:?}");
        }
    }

    #[test]
    fn words_select_a_record_by_its_names_sizes_and_axes() {
        use crate::record::fixtures::{judged, measured};
        let of = |key: &str, ms, triangles, image_size, strategy: &str| Record {
            key: key.into(),
            triangles: Some(triangles),
            image_size,
            strategy: strategy.into(),
            ..measured("gpu", "naive", 8, ms)
        };
        let records = judged([
            of("a", 4.0, 10, [800, 500], "traversal=exhaustive width=8"),
            of("b", 2.0, 100, [800, 500], "traversal=exhaustive width=16"),
            of("c", 3.0, 100, [500, 800], "traversal=bvh width=8"),
        ]);
        let figure_of = |words: &[&str]| of_folder(&records, words, "x").map(|side| side.value);
        let ms = |ms| Ok(Figure::Number(ms, Form::Measure));
        assert_eq!(figure_of(&["best"]), ms(2.0));
        assert_eq!(figure_of(&["best", "width=8"]), ms(3.0));
        assert_eq!(figure_of(&["triangles=10"]), ms(4.0));
        assert_eq!(figure_of(&["@500x800"]), ms(3.0));
        assert_eq!(figure_of(&["traversal=exhaustive", "width=16"]), ms(2.0));
        assert_eq!(
            figure_of(&["wide"]),
            Ok(Figure::Nothing(String::new())),
            "a preset that was not measured"
        );
        assert!(figure_of(&["8x8"]).is_err_and(|error| error.starts_with("3 records of x match '8x8'")));
        assert!(
            figure_of(&["width=4"]).is_err_and(|error| error.starts_with("no record in x matches 'width=4'"))
        );
    }
}
