//! `raycl rule`, for contributors. `render` chooses a strategy by a rule. `raycl rule` compares the
//! strategies that this rule chooses with the strategies that were measured to be fastest, and computes the
//! rule's constants from measured times.

use super::choice::{one_device, whole};
use super::measured::{store, until_error};
use super::turn::hold;
use crate::device::Device;
use crate::device::common_name;
use crate::error::{Error, Result};
use crate::output::{Choice, Target};
use crate::printer;
use crate::program::Sources;
use crate::reader;
use crate::rule::{Case, LastScene, Measured, Sweep, cases, source};
use crate::scene::Scene;
use crate::strategy::Class;
use crate::words::counted;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The default number of rounds. In every round, each candidate strategy that may be the fastest is timed once, unless
/// the device refuses the candidate. The shortest time of a candidate counts.
const ROUNDS: u32 = 5;

/// Arguments of `raycl rule`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl rule docs/rule.toml --device cpu -o sweep.json    time the candidates on the cases for CPUs
  raycl rule --show docs/results/rule/*.json              the rule's choices for stored sweeps
  raycl rule --fit docs/results/rule/*.json > src/strategy/constants.rs")]
pub struct Args {
    /// A TOML file of cases, such as docs/rule.toml: each case names a scene and a picture size to measure
    #[arg(required_unless_present_any = ["fit", "show"])]
    cases: Option<PathBuf>,
    /// The device: part of its name, platform or vendor; its label in `raycl devices`; or its kind (cpu, gpu,
    /// accelerator)
    #[arg(long, conflicts_with_all = ["fit", "show"])]
    device: Option<String>,
    /// Measure only cases whose name contains WORD
    #[arg(long, value_name = "WORD", conflicts_with_all = ["fit", "show"])]
    only: Option<String>,
    /// Number of rounds, 1 to 100. In each round, raycl times every candidate strategy once. raycl leaves out
    /// candidates that the device refuses and, if the scene has many triangles, exhaustive casting. The shortest of a
    /// candidate's times counts
    #[arg(long, default_value_t = ROUNDS, conflicts_with_all = ["fit", "show"], value_parser = whole::<u32>(1..=100))]
    rounds: u32,
    /// If another process is measuring on the device, end at once instead of waiting for it
    #[arg(long, conflicts_with_all = ["fit", "show"])]
    no_wait: bool,
    /// A note about the machine, stored with the times
    #[arg(long, value_name = "WORDS", default_value = "", conflicts_with_all = ["fit", "show"])]
    conditions: String,
    /// Write the measurements (the sweep) to this file; - writes them to standard output, without the table
    #[arg(short, long, value_name = "FILE", conflicts_with_all = ["fit", "show"])]
    output: Option<PathBuf>,
    /// From stored measurements (sweeps), compute the constants of the rule by which `render` chooses a strategy, and
    /// print the constants as source code
    #[arg(long, value_name = "SWEEP", num_args = 1.., conflicts_with_all = ["cases", "show"])]
    fit: Vec<PathBuf>,
    /// For each case of stored measurements (sweeps), print the strategy that `render` chooses and the
    /// fastest strategy
    #[arg(long, value_name = "SWEEP", num_args = 1.., conflicts_with = "cases")]
    show: Vec<PathBuf>,
}

impl Args {
    /// Returns true if the command starts a device's driver.
    pub(super) fn measures(&self) -> bool {
        self.cases.is_some()
    }
}

/// Measures the cases, shows the rule's choices for stored measurements (sweeps), or fits the rule to stored sweeps.
pub fn run(args: Args) -> Result<()> {
    if !args.fit.is_empty() {
        let text = source(&read_all(&args.fit)?);
        return super::print(text.trim_end());
    }
    for sweep in read_all(&args.show)? {
        super::print(text(&sweep)?)?;
    }
    let Some(path) = &args.cases else { return Ok(()) };
    let target = args.output.as_ref().map(|path| Target::new(path, Choice::without_force("-o FILE")));
    target.iter().try_for_each(Target::check)?;
    let (sweep, end) = measure(&args, path)?;
    if sweep.cases.is_empty() {
        return end;
    }
    // The sweep (the measured times) is stored before the table is printed: if the table cannot be printed,
    // the measurements are not lost.
    target.iter().try_for_each(|target| store(&sweep, &end, target))?;
    if !target.is_some_and(|target| target.is_standard_output()) {
        super::print(text(&sweep)?)?;
    }
    end
}

fn read_all(paths: &[PathBuf]) -> Result<Vec<Sweep>> {
    let read = |path: &PathBuf| {
        let wrong = |why: &dyn std::fmt::Display| {
            Error::input(format!("cannot read the sweep (measured times) '{}': {why}", path.display()))
                .with_help("`raycl rule CASES -o FILE` measures a sweep and writes it to a file")
        };
        let text = reader::text(path, reader::Kind::Results).map_err(|error| wrong(&error))?;
        serde_json::from_str(&text).map_err(|error| wrong(&error))
    };
    paths.iter().map(read).collect()
}

/// Measures the cases that are for the device's kind and have the word of `--only` in their names, until one
/// case fails. Returns the sweep of the cases that were measured, and the error of the case that failed.
fn measure(args: &Args, path: &Path) -> Result<(Sweep, Result<()>)> {
    let device = one_device(args.device.as_deref(), &Sources::Embedded)?;
    let kind = if device.info.limits.is_cpu { "cpu" } else { "gpu" };
    let word = args.only.as_deref().unwrap_or("");
    let all = cases(path)?;
    let wanted: Vec<Case> = all.iter().filter(|case| is_wanted(case, kind, word)).cloned().collect();
    if wanted.is_empty() {
        let of = args.only.as_ref().map(|word| format!(" and has '{word}' in its name")).unwrap_or_default();
        let message = format!("none of the {} cases of '{}' is for a {kind}{of}", all.len(), path.display());
        return Err(Error::input(message).with_help(
            "a case's `devices` lists cpu, gpu or both of them; --only takes a part of a case's name",
        ));
    }
    let _held = hold(&[&device.info], args.no_wait)?;
    // All cases are checked before the first one is measured, so that a mistake loses no measurements.
    let mut last = LastScene::default();
    wanted.iter().try_for_each(|case| checked(case, path, &mut last).map(drop))?;
    let date = jiff::Timestamp::now().strftime("%Y-%m-%d").to_string();
    let measured = wanted.iter().map(|case| measured(case, path, &mut last, &device, args.rounds));
    let (cases, end) = until_error(measured);
    let sweep = Sweep {
        device: device.info.label.clone(),
        class: Class::of(&device.info.limits),
        compute_units: device.info.limits.compute_units,
        date,
        conditions: args.conditions.clone(),
        rounds: args.rounds,
        cases,
    };
    Ok((sweep, end))
}

/// Returns true if the case is for devices of this kind and its name contains `word`.
fn is_wanted(case: &Case, kind: &str, word: &str) -> bool {
    case.devices.iter().any(|name| name == kind) && case.name.contains(word)
}

/// Loads a case's scene. Returns an error if the kinds that the case states are not those that follow from the case's
/// scene and image size. Only three kinds are checked: few triangles, an eye inside the scene, many triangles per
/// pixel. The kind `watertight` is not checked, because it does not follow from the scene and the image size.
fn checked(case: &Case, path: &Path, last: &mut LastScene) -> Result<Arc<Scene>> {
    let scene = last.of(case, path)?;
    let task = case.task(&scene);
    if case.is_of_its_kinds(&task) {
        return Ok(scene);
    }
    let place = if task.inside { "is inside the scene" } else { "is outside the scene" };
    let message = format!(
        "the `kinds` of the case '{}' do not match its scene and size: the scene has {} triangles, the eye {place}, and the picture has {} pixels",
        case.name, task.triangles, task.pixels
    );
    Err(Error::input(message).with_help("in the case's `kinds`, list those of `few`, `inside` and `dense` that are true of the scene and size; docs/rule.toml explains the kinds"))
}

fn measured(
    case: &Case,
    path: &Path,
    last: &mut LastScene,
    device: &Device,
    rounds: u32,
) -> Result<Measured> {
    let scene = checked(case, path, last)?;
    printer::tell(printer::plain(&format!("measuring {}", case.name)));
    Measured::of(case, scene, device, rounds)
}

/// Returns a table with the rule's choice and the fastest candidate for each case, followed by a line that says how
/// good the choices are. Leaves out cases in which no candidate has a time.
fn text(sweep: &Sweep) -> Result<String> {
    let header = ["case", "triangles", "pixels", "chosen", "ms", "best", "ms", "ratio"];
    let mut table = super::table(&header, 1);
    let mut ratios = Vec::new();
    for case in &sweep.cases {
        let choice = sweep.class.choice(&case.task, sweep.compute_units);
        let Some(verdict) = case.verdict(choice) else { continue };
        ratios.push(verdict.ratio());
        let ms = |ms: f64| format!("{ms:.3}");
        table.add_row([
            case.name.clone(),
            case.task.triangles.to_string(),
            case.task.pixels.to_string(),
            verdict.choice.name().to_owned(),
            verdict.choice_ms.map_or("refused".to_owned(), ms),
            verdict.best.0.clone(),
            ms(verdict.best.1),
            verdict.choice_ms.map_or(String::new(), |_| format!("{:.3}", verdict.ratio())),
        ]);
    }
    let within = |most: f64| ratios.iter().filter(|ratio| **ratio <= most).count();
    let refused = ratios.iter().filter(|ratio| ratio.is_infinite()).count();
    let refused =
        if refused > 0 { format!("; {} refused", counted(refused, "choice")) } else { String::new() };
    let worst = ratios.iter().copied().filter(|ratio| ratio.is_finite()).reduce(f64::max);
    let worst = worst.map_or(String::new(), |worst| {
        format!("; the worst choice takes {worst:.3} times as long as the best strategy")
    });
    Ok(format!(
        "device    {}, {}: shortest times of {} rounds\n{table}\nchoices   {} of {} take at most 5% longer than the best strategy, {} at most 10%{worst}{refused}",
        common_name(&sweep.device),
        sweep.date,
        sweep.rounds,
        within(1.05),
        ratios.len(),
        within(1.10)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategy::{Candidate, Task};

    fn sweep(class: Class, cases: Vec<Measured>) -> Sweep {
        Sweep {
            device: "a device".to_owned(),
            class,
            compute_units: 2,
            date: "2026-01-02".to_owned(),
            conditions: String::new(),
            rounds: 7,
            cases,
        }
    }

    #[test]
    fn a_sweep_has_five_rounds_by_default() {
        use clap::Parser as _;
        #[derive(clap::Parser)]
        struct Command {
            #[command(flatten)]
            args: Args,
        }
        assert_eq!(Command::parse_from(["rule", "docs/rule.toml"]).args.rounds, 5);
    }

    #[test]
    fn only_cases_of_the_kind_of_device_with_the_word_in_their_name_are_wanted() {
        let case = Case {
            name: "bunny, 4k".to_owned(),
            scene: "bunny.toml".to_owned(),
            set: std::collections::BTreeMap::new(),
            size: [8, 5],
            kinds: Vec::new(),
            devices: vec!["cpu".to_owned()],
        };
        let asked = [("cpu", ""), ("cpu", "bunny"), ("cpu", "dragon"), ("gpu", "bunny")];
        assert_eq!(asked.map(|(kind, word)| is_wanted(&case, kind, word)), [true, true, false, false]);
    }

    #[test]
    fn the_choices_within_5_and_10_per_cent_of_the_best_are_counted_and_the_worst_is_reported() {
        let class = Class::TilesInVectors;
        // With a million triangles, the rule never chooses exhaustive casting. In this test's made-up times, however,
        // exhaustive casting is the fastest.
        let task = Task::covering(1_000_000, 400_000);
        let choice = class.choice(&task, 2).name();
        let case = |name: &str, chosen_ms: Option<f64>| {
            let chosen = chosen_ms.map(|ms| (choice.to_owned(), ms));
            let least_ms = [("exhaustive".to_owned(), 4.0)].into_iter().chain(chosen).collect();
            Measured { name: name.to_owned(), task, least_ms }
        };
        let of = |ms: f64| Some(4.0 * ms);
        let cases = [("one", of(1.05)), ("two", of(1.1)), ("three", of(1.25)), ("four", of(1.0))];
        let printed = text(&sweep(class, cases.map(|(name, ms)| case(name, ms)).to_vec())).unwrap();
        let printed = printed.replace(['│', '┆'], " ");
        assert!(
            printed.starts_with("device    a device, 2026-01-02: shortest times of 7 rounds\n"),
            "{printed}"
        );
        let last = "choices   2 of 4 take at most 5% longer than the best strategy, 3 at most 10%; the worst choice takes 1.250 times as long as the best strategy";
        assert!(printed.ends_with(last), "{printed}");
        let row = printed.lines().find(|line| line.contains(" three ")).unwrap();
        let words: Vec<&str> = row.split_whitespace().collect();
        assert_eq!(words, ["three", "1000000", "400000", choice, "5.000", "exhaustive", "4.000", "1.250"]);
        let refused = text(&sweep(class, vec![case("refused", None)])).unwrap();
        assert!(refused.contains(" refused ") && !refused.contains("inf"), "{refused}");
        assert!(refused.contains("0 of 1 take at most 5% longer") && !refused.contains("worst"), "{refused}");
        assert!(refused.ends_with("0 at most 10%; 1 choice refused"), "{refused}");
        let both = text(&sweep(class, vec![case("refused", None), case("three", of(1.25))])).unwrap();
        let last = "the worst choice takes 1.250 times as long as the best strategy; 1 choice refused";
        assert!(both.ends_with(last), "{both}");
    }

    #[test]
    fn choices_that_no_constant_decides_are_judged_too() {
        let soft = Task { soft: true, ..Task::covering(10_000, 400_000) };
        for (class, task, choice) in [
            (Class::SingleRays, Task::covering(2, 400_000), Candidate::Exhaustive),
            (Class::SingleRays, Task::covering(10_000, 400_000), Candidate::Single),
            (Class::SharedTiles, soft, Candidate::Single),
        ] {
            let least_ms = std::collections::BTreeMap::from([(choice.name().to_owned(), 4.0)]);
            let case = Measured { name: "one".to_owned(), task, least_ms };
            let printed = text(&sweep(class, vec![case])).unwrap();
            let count = "choices   1 of 1 take at most 5% longer";
            assert!(printed.contains(choice.name()) && printed.contains(count), "{printed}");
        }
    }
}
