//! Functions for commands that measure several things, such as devices or points, and some of whose measurements may
//! fail. The functions decide what such a command stores after a failed measurement, and what it tells the user.

use crate::error::{Error, Result};
use crate::output::Target;
use crate::printer;
use crate::record::Record;
use crate::sources::{OWN_KERNELS, SUSPECTS};
use crate::words::counted_of;
use serde::Serialize;

/// Returns the values before the first error in `results`, and this error. If `results` contains no error,
/// returns all values and `Ok`.
pub fn until_error<T>(mut results: impl Iterator<Item = Result<T>>) -> (Vec<T>, Result<()>) {
    let mut values = Vec::new();
    let end = results.try_for_each(|result| result.map(|value| values.push(value)));
    (values, end)
}

/// Writes `measured` to `target`. If the measurement ended with an error (`end`) and the file exists already, keeps the
/// existing file and prints a note. The earlier measurement in the existing file may be complete.
pub fn store(measured: &impl Serialize, end: &Result<()>, target: &Target) -> Result<()> {
    if end.is_ok() || target.is_standard_output() || !target.path().exists() {
        return target.write_json(measured);
    }
    let file = target.path().display();
    printer::tell(format!(
        "note: '{file}' keeps its earlier measurement, since the new measurement ended with an error"
    ));
    Ok(())
}

/// The remedy for failed points of a run.
pub const MEASURE_AGAIN: &str = "the same command with --resume --retry-failed measures these points again";

/// Returns how many points failed, such as "2 of 4 points failed"; `None` if no point failed. Points that do not fit on
/// their device, and points whose preset is meant for another kind of device, are not failures.
pub fn failures(records: &[Record]) -> Option<String> {
    let failed = records.iter().filter(|record| !record.outcome.is_fine()).count();
    (failed > 0).then(|| format!("{} failed", counted_of(failed, records.len(), "point")))
}

/// Returns an error with the remedy `remedy` if points failed ([`failures`]). If a point's reason names kernel files of
/// the user as the possible cause of a crash, the error has one more remedy: what to look for in these files.
pub fn refuse_failed(records: &[Record], remedy: impl Into<String>) -> Result<()> {
    let Some(message) = failures(records) else { return Ok(()) };
    let suspects = |record: &Record| record.reason.as_ref().is_some_and(|reason| reason.contains(SUSPECTS));
    let remedy = match records.iter().any(suspects) {
        true => format!("{}; about the crash: {OWN_KERNELS}", remedy.into()),
        false => remedy.into(),
    };
    Err(Error::run(message).with_help(remedy))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Outcome;

    #[test]
    fn what_was_measured_before_an_error_is_kept() {
        let (values, end) = until_error([Ok(1), Ok(2), Err(Error::run("it broke")), Ok(3)].into_iter());
        assert_eq!(values, [1, 2]);
        assert_eq!(end.unwrap_err().to_string(), "it broke");
        let (values, end) = until_error([Ok(1), Ok(2)].into_iter());
        assert!(values == [1, 2] && end.is_ok());
    }

    #[test]
    fn after_a_crash_with_kernel_files_of_the_user_the_error_says_what_to_look_for() {
        let remedy = |reason: &str| {
            let crashed =
                Record { outcome: Outcome::Crashed, reason: Some(reason.to_owned()), ..Record::default() };
            let error = refuse_failed(&[Record::default(), crashed], "read the summary").unwrap_err();
            error.remedy().to_owned()
        };
        assert_eq!(remedy("the worker process was killed by SIGSEGV"), "read the summary");
        let own = remedy(&format!("the worker process was killed by SIGSEGV; {SUSPECTS}: mine.cl"));
        assert_eq!(own, format!("read the summary; about the crash: {OWN_KERNELS}"));
    }

    #[test]
    fn an_error_leaves_an_earlier_file_and_otherwise_what_was_measured_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let target = Target::of_results(folder.path().join("a.json"));
        let stored_after = |value: u64, end: Result<()>| -> Option<u64> {
            store(&serde_json::json!([{ "value": value }]), &end, &target).unwrap();
            let text = std::fs::read_to_string(target.path()).unwrap();
            serde_json::from_str::<serde_json::Value>(&text).unwrap()[0]["value"].as_u64()
        };
        let broken = || Err(Error::run("it broke"));
        assert_eq!(stored_after(1, broken()), Some(1));
        assert_eq!(stored_after(2, broken()), Some(1));
        assert_eq!(stored_after(3, Ok(())), Some(3));
    }
}
