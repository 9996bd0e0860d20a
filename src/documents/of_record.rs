//! The figures (numbers and texts) of a record, by the names that queries use.

use crate::numbers::{by, significant};
use crate::record::{Record, interval, median};

/// The form in which a figure is written into a document. If the query names a unit, the figure is always written like
/// a `Measure`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A number rounded to a few significant digits.
    Measure,
    /// A whole number, without a decimal point.
    Count,
    /// A percentage without its sign, such as 62 for the value 0.62.
    Percent,
    /// A number in scientific notation, such as 4.2e-7.
    Power,
}

/// The value of a figure (a number or a text of a record).
#[derive(Clone, Debug, PartialEq)]
pub enum Figure {
    /// A number.
    Number(f64, Form),
    /// A text.
    Words(String),
    /// The reason why there is no value, such as "infeasible". An empty text instead of a reason means that no record
    /// matches the query.
    Nothing(String),
}

type Number = fn(&Record) -> Option<f64>;

/// The name of the figure for the median of a frame's time. A query without a figure's name asks for the
/// median of a frame's time.
pub const MEDIAN: &str = "ms";

const NUMBERS: [(&str, Form, Number); 19] = [
    (MEDIAN, Form::Measure, median),
    ("primary-ms", Form::Measure, |record| record.primary_ms),
    ("shadow-ms", Form::Measure, |record| record.shadow_ms),
    ("shade-ms", Form::Measure, |record| record.shade_ms),
    ("tests-per-s", Form::Measure, |record| record.tests_per_s),
    ("shadow-rays-per-s", Form::Measure, |record| record.shadow_rays_per_s),
    ("of-peak", Form::Percent, |record| record.limit_fraction),
    ("difference", Form::Power, |record| record.max_difference),
    ("uncertain", Form::Count, |record| record.uncertain_pixels.map(|count| count as f64)),
    ("triangles", Form::Count, |record| record.triangles.map(|count| count as f64)),
    ("local-bytes", Form::Count, |record| record.local_bytes.map(|bytes| bytes as f64)),
    ("n", Form::Count, |record| Some(record.samples_ms.len() as f64)),
    ("registers", Form::Count, |record| record.main_kernel()?.resources.registers.map(f64::from)),
    ("spilled", Form::Count, |record| {
        record.main_kernel()?.resources.spill_store_bytes.map(|bytes| bytes as f64)
    }),
    ("groups", Form::Count, |record| {
        record.main_kernel_of_local_size()?.resident_groups.map(|count| count as f64)
    }),
    ("items", Form::Count, |record| {
        let [across, down] = record.local_size?;
        let groups = record.main_kernel_of_local_size()?.resident_groups?;
        Some(groups as f64 * f64::from(across) * f64::from(down))
    }),
    ("occupancy", Form::Percent, |record| record.main_kernel_of_local_size()?.occupancy),
    ("lanes", Form::Percent, |record| {
        let [across, down] = record.local_size?;
        let items = across * down;
        Some(f64::from(items) / f64::from(items.next_multiple_of(32)))
    }),
    ("pixels", Form::Count, |record| Some(record.pixels())),
];

type Text = fn(&Record) -> Option<String>;

const TEXTS: [(&str, Text); 4] = [
    ("local-size", |record| record.local_size.map(by)),
    ("bounded-by", |record| record.main_kernel_of_local_size()?.occupancy_limited_by.clone()),
    ("interval", |record| {
        interval(record).map(|[low, high]| format!("{} to {}", significant(low, 3), significant(high, 3)))
    }),
    ("outcome", |record| Some(record.outcome.name().to_owned())),
];

/// Returns true if a word names a figure. A word that begins with `ld.`, `st.` or `atom.`, such as `ld.global`, is
/// taken for the name of a PTX instruction. Such a word names a figure, too: the number of these instructions in the
/// main kernel.
pub fn is_figure(word: &str) -> bool {
    let is_instruction = ["ld.", "st.", "atom."].iter().any(|start| word.starts_with(start));
    is_instruction
        || NUMBERS.iter().any(|(name, ..)| *name == word)
        || TEXTS.iter().any(|(name, _)| *name == word)
}

/// Returns the figure with this name from a record, or [`Figure::Nothing`] if the record does not contain the figure. A
/// name that is neither in `NUMBERS` nor in `TEXTS` is taken for the name of a PTX instruction.
pub fn figure(record: &Record, name: &str) -> Figure {
    if let Some((_, text)) = TEXTS.iter().find(|(known, _)| *known == name) {
        return text(record).map_or_else(|| nothing(record), Figure::Words);
    }
    let number = match NUMBERS.iter().find(|(known, ..)| *known == name) {
        Some((_, form, of)) => of(record).map(|value| (value, *form)),
        None => instructions(record, name).map(|count| (f64::from(count), Form::Count)),
    };
    number.map_or_else(|| nothing(record), |(value, form)| Figure::Number(value, form))
}

/// Returns how many instructions with this name the record's main kernel has; `None` if they were not
/// counted.
fn instructions(record: &Record, name: &str) -> Option<u32> {
    let counts = record.main_kernel()?.instruction_counts.as_ref()?;
    Some(counts.instructions.get(name).copied().unwrap_or(0))
}

fn nothing(record: &Record) -> Figure {
    let why = if median(record).is_some() { "not reported" } else { record.outcome.name() };
    Figure::Nothing(why.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::CompiledKernel;
    use crate::program::compiled::InstructionCounts;
    use crate::record::Outcome;
    use crate::record::fixtures::{infeasible, measured};

    #[test]
    fn each_word_names_its_figure() {
        let mut kernel = CompiledKernel {
            name: "cast_frame".into(),
            resident_groups: Some(3),
            occupancy: Some(0.5),
            occupancy_limited_by: Some("registers".into()),
            ..CompiledKernel::default()
        };
        kernel.resources.registers = Some(40);
        kernel.resources.spill_store_bytes = Some(41);
        kernel.resources.spill_load_bytes = Some(42);
        let record = Record {
            local_size: Some([10, 2]),
            primary_ms: Some(1.0),
            shadow_ms: Some(2.0),
            shade_ms: Some(3.0),
            rays_per_s: Some(4.0),
            tests_per_s: Some(5.0),
            shadow_rays_per_s: Some(6.0),
            limit_fraction: Some(0.7),
            max_difference: Some(8e-5),
            uncertain_pixels: Some(9),
            unexplained_pixels: Some(10),
            triangles: Some(11),
            lights: Some(12),
            local_bytes: Some(13),
            private_bytes: Some(14),
            kernels: vec![kernel],
            ..measured("gpu", "naive", 8, 20.0)
        };
        use Form::{Count, Measure, Percent, Power};
        for (name, value, form) in [
            ("ms", 20.0, Measure),
            ("primary-ms", 1.0, Measure),
            ("shadow-ms", 2.0, Measure),
            ("shade-ms", 3.0, Measure),
            ("tests-per-s", 5.0, Measure),
            ("shadow-rays-per-s", 6.0, Measure),
            ("of-peak", 0.7, Percent),
            ("difference", 8e-5, Power),
            ("uncertain", 9.0, Count),
            ("triangles", 11.0, Count),
            ("local-bytes", 13.0, Count),
            ("n", 10.0, Count),
            ("registers", 40.0, Count),
            ("spilled", 41.0, Count),
            ("groups", 3.0, Count),
            ("items", 60.0, Count),
            ("occupancy", 0.5, Percent),
            // A work-group of 20 work-items uses 20 of a warp's 32 lanes, which is a share of 0.625.
            ("lanes", 0.625, Percent),
            ("pixels", 400_000.0, Count),
        ] {
            assert_eq!(figure(&record, name), Figure::Number(value, form), "{name}");
            assert!(is_figure(name), "{name}");
        }
        for (name, words) in [("local-size", "10 x 2"), ("bounded-by", "registers"), ("outcome", "measured")]
        {
            assert_eq!(figure(&record, name), Figure::Words(words.into()), "{name}");
        }
        assert!(is_figure("ld.global") && !is_figure("naive"));
    }

    /// The main kernel of a rasteriser does not use the point's local size for its work-groups.
    #[test]
    fn a_rasteriser_has_no_figures_of_work_groups_of_the_local_size() {
        let mut kernel = CompiledKernel {
            name: "raster_depth".into(),
            resident_groups: Some(3),
            occupancy: Some(0.5),
            occupancy_limited_by: Some("registers".into()),
            ..CompiledKernel::default()
        };
        kernel.resources.registers = Some(40);
        let strategy = "traversal=raster".to_owned();
        let record = Record { strategy, kernels: vec![kernel], ..measured("gpu", "raster", 8, 20.0) };
        for name in ["groups", "items", "occupancy", "bounded-by"] {
            assert_eq!(figure(&record, name), Figure::Nothing("not reported".into()), "{name}");
        }
        assert_eq!(figure(&record, "registers"), Figure::Number(40.0, Form::Count));
    }

    #[test]
    fn without_a_figure_there_is_a_reason() {
        let nothing = |why: &str| Figure::Nothing(why.into());
        let record = measured("gpu", "naive", 8, 20.0);
        assert_eq!(
            [figure(&record, "registers"), figure(&record, "interval")],
            [(); 2].map(|()| nothing("not reported"))
        );
        let refused = infeasible("gpu", "naive", 8, "too large");
        assert_eq!(figure(&refused, "ms"), nothing("infeasible"));
        assert_eq!(
            figure(&Record { outcome: Outcome::TimedOut, ..refused }, "bounded-by"),
            nothing("timed-out")
        );
    }

    #[test]
    fn an_instruction_that_a_kernel_does_not_have_is_0_if_its_instructions_were_counted() {
        let with = |instruction_counts| {
            let name = "cast_frame".to_owned();
            let kernel = CompiledKernel { name, instruction_counts, ..CompiledKernel::default() };
            Record { kernels: vec![kernel], ..measured("gpu", "naive", 8, 20.0) }
        };
        let mut counts = InstructionCounts::default();
        counts.instructions.insert("ld.global".to_owned(), 3);
        let [counted, uncounted] = [Some(counts), None].map(with);
        let figures = ["ld.global", "st.shared"].map(|name| figure(&counted, name));
        assert_eq!(figures, [3.0, 0.0].map(|count| Figure::Number(count, Form::Count)));
        assert_eq!(figure(&uncounted, "st.shared"), Figure::Nothing("not reported".into()));
    }
}
