//! `raycl occupancy`: predicts occupancy as in Figure 5 of the student paper that raycl reproduces, for any compute
//! capability that raycl knows.

mod paper;
mod results;

use serde_json::{Value, json};

use super::choice::{number, parse_size};
use crate::device::occupancy::{Limiter, Multiprocessor, Occupancy, capabilities, multiprocessor, occupancy};
use crate::error::{Error, Result};

/// Describes a valid number of registers, in the message about an invalid number.
const REGISTERS: &str = "a whole number of registers, such as 32";
/// Describes a valid number of bytes, in the message about an invalid number.
const BYTES: &str = "a whole number of bytes, such as 4096";

/// Arguments of `raycl occupancy`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl occupancy --paper
  raycl occupancy --compute-capability 9.0 --registers 40
  raycl occupancy --results results/figure-8
  raycl occupancy --compute-capability 2.0 --registers 63 --local-bytes-per-item 108")]
pub struct Args {
    #[arg(long, value_name = "MAJOR.MINOR", conflicts_with = "paper", help = help_of_capability())]
    compute_capability: Option<String>,
    /// Number of registers that each work-item uses
    #[arg(long, value_name = "N", default_value_t = 32, conflicts_with = "paper", value_parser = number::<u32>(REGISTERS))]
    registers: u32,
    /// Bytes of __local memory that each work-group uses
    #[arg(long, value_name = "N", default_value_t = 0, conflicts_with = "paper", value_parser = number::<u32>(BYTES))]
    local_bytes: u32,
    /// Bytes of __local memory that each work-item uses, in addition to those of --local-bytes. In optimisation 1 of
    /// the student paper whose experiments raycl repeats, each work-item uses 108 bytes
    #[arg(long, value_name = "N", default_value_t = 0, conflicts_with = "paper", value_parser = number::<u32>(BYTES))]
    local_bytes_per_item: u32,
    /// Local sizes (work-items per work-group, across and down), such as 8x8,64x1; 8 stands for 8x8
    #[arg(long, value_name = "WxH", value_delimiter = ',', num_args = 1.., default_values = LOCAL_SIZES, value_parser = parse_size)]
    local_sizes: Vec<[u32; 2]>,
    /// Print the predicted occupancy and the measured time of the points of a run. raycl prints a point only if its
    /// record contains the occupancy of the point's kernel and the number of registers; with --compute-capability, the
    /// number of registers is enough. Rasterisers are left out, since their main kernels have work-groups of a fixed
    /// size. DIR is a folder of results, or the file records.jsonl in it. With --results, only --compute-capability,
    /// --json and --color can be given
    #[arg(long, value_name = "DIR", conflicts_with_all = ["paper", "registers", "local_bytes", "local_bytes_per_item", "local_sizes"])]
    results: Option<std::path::PathBuf>,
    /// For each local size, print three numbers of threads per multiprocessor. The first number is computed as in
    /// Figure 5 of the student paper whose experiments raycl repeats, from the limits of work-groups and threads alone.
    /// The second number is what the paper's 63 registers per work-item allow. For the third number, each work-item
    /// also needs the 108 B of __local memory of the paper's optimisation 1. With --paper, only --local-sizes, --json
    /// and --color can be given
    #[arg(long)]
    paper: bool,
    /// Print one JSON object instead of a table; with --results, one object per point
    #[arg(long)]
    json: bool,
}

/// Returns the help of `--compute-capability`, which lists the supported compute capabilities.
fn help_of_capability() -> String {
    format!(
        "The device's compute capability, one of {} [default: 8.6; with --results, that of each device]",
        capabilities()
    )
}

/// The default local sizes: those of the paper's Figure 5, and four more.
const LOCAL_SIZES: [&str; 9] = ["2x2", "4x4", "6x6", "8x8", "10x10", "12x12", "14x14", "16x16", "32x32"];

/// Returns the number of work-items in a work-group of this size.
fn items([across, down]: [u32; 2]) -> u32 {
    across * down
}

/// Returns a local size in the form in which it is printed: `16x16`.
fn named([across, down]: [u32; 2]) -> String {
    format!("{across}x{down}")
}

/// The inputs that are the same for the predictions in all rows of a table.
struct Question {
    sm: &'static Multiprocessor,
    registers: u32,
    local_bytes: u32,
    local_bytes_per_item: u32,
}

impl Question {
    fn answer(&self, size: [u32; 2]) -> Occupancy {
        occupancy(self.sm, self.registers, self.group_local_bytes(size), items(size))
    }

    fn group_local_bytes(&self, size: [u32; 2]) -> u64 {
        u64::from(self.local_bytes) + u64::from(self.local_bytes_per_item) * u64::from(items(size))
    }
}

/// Prints predicted occupancy: with `--paper`, for the paper's GPU; with `--results`, for the points of a run;
/// otherwise, for the registers and the memory that the user states. An unknown compute capability is a user error, and
/// so is `--registers 0`.
pub fn run(args: Args) -> Result<()> {
    if args.paper {
        return paper::run(&args.local_sizes, args.json);
    }
    if let Some(path) = &args.results {
        return results::run(path, args.compute_capability.as_deref(), args.json);
    }
    let sm = multiprocessor(args.compute_capability.as_deref().unwrap_or("8.6"))?;
    if args.registers == 0 {
        return Err(Error::input("--registers 0: a work-item needs at least 1 register")
            .with_help("give the number of registers that the compiler prints, as in --registers 32"));
    }
    let question = question_of(&args, sm);
    if args.json {
        return super::print_json(&question_json(&question, &args.local_sizes));
    }
    super::print(question_text(&question, &args.local_sizes))
}

/// Returns the inputs of the predictions: the kernel's resources that the arguments state, and the
/// multiprocessor.
fn question_of(args: &Args, sm: &'static Multiprocessor) -> Question {
    let Args { registers, local_bytes, local_bytes_per_item, .. } = *args;
    Question { sm, registers, local_bytes, local_bytes_per_item }
}

fn question_text(question: &Question, sizes: &[[u32; 2]]) -> String {
    let header =
        ["local size", "items", "__local B", "groups", "warps", "threads", "occupancy", "limited by"];
    let mut table = super::table(&header, 1);
    if let Some(column) = table.column_mut(header.len() - 1) {
        column.set_cell_alignment(comfy_table::CellAlignment::Left);
    }
    for &size in sizes {
        let got = question.answer(size);
        table.add_row([
            named(size),
            items(size).to_string(),
            question.group_local_bytes(size).to_string(),
            got.groups.to_string(),
            got.warps.to_string(),
            got.threads.to_string(),
            format!("{:.0}%", 100.0 * got.fraction),
            got.limiter.to_string(),
        ]);
    }
    let Multiprocessor { compute_capability, warps, groups, registers, local_bytes, .. } = question.sm;
    format!(
        "Compute capability {compute_capability}, {} registers per work-item. A multiprocessor holds at most {groups} \
         work-groups, {warps} warps,\n{registers} registers and {} KiB of __local memory at once.\n{table}",
        question.registers,
        local_bytes / 1024
    )
}

fn question_json(question: &Question, sizes: &[[u32; 2]]) -> Value {
    json!({
        "compute_capability": question.sm.compute_capability,
        "registers_per_item": question.registers,
        "rows": sizes.iter().map(|&size| row_json(question, size)).collect::<Vec<_>>(),
    })
}

fn row_json(question: &Question, size: [u32; 2]) -> Value {
    let got = question.answer(size);
    let (limiter, reason) = match &got.limiter {
        Limiter::CannotLaunch(reason) => ("cannot launch".to_owned(), Some(reason)),
        other => (other.to_string(), None),
    };
    json!({
        "local_size": size,
        "local_bytes": question.group_local_bytes(size),
        "groups": got.groups,
        "warps": got.warps,
        "threads": got.threads,
        "occupancy": got.fraction,
        "limited_by": limiter,
        "reason": reason,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Some compute capabilities between the first and the last supported one are not supported, so the help must list
    /// each supported one instead of a range.
    #[test]
    fn the_help_lists_the_supported_capabilities() {
        let command = <Args as clap::Args>::augment_args(clap::Command::new("occupancy"));
        let help = command.term_width(0).render_long_help().to_string();
        assert!(
            help.contains("one of 2.0, 2.1, 3.0, 3.5, 3.7, 5.0,")
                && help.contains(" 8.9, 9.0 [default: 8.6;"),
            "{help}"
        );
    }

    #[test]
    fn local_bytes_of_a_group_and_of_an_item_are_not_mixed_up() {
        let command = <Args as clap::Args>::augment_args(clap::Command::new("occupancy"));
        let words = ["occupancy", "--registers=20", "--local-bytes=1000", "--local-bytes-per-item=4"];
        let matches = command.get_matches_from(words);
        let args = <Args as clap::FromArgMatches>::from_arg_matches(&matches).unwrap();
        let question = question_of(&args, multiprocessor("2.0").unwrap());
        assert_eq!((question.registers, question.group_local_bytes([16, 16])), (20, 2024));
    }

    #[test]
    fn json_has_the_registers_of_a_work_item_and_the_numbers_of_each_local_size() {
        let sm = multiprocessor("2.0").unwrap();
        let question = Question { sm, registers: 20, local_bytes: 1000, local_bytes_per_item: 4 };
        let json = question_json(&question, &[[16, 16]]);
        assert_eq!(json["compute_capability"], "2.0");
        assert_eq!(json["registers_per_item"], 20);
        let (row, expected) = (&json["rows"][0], question.answer([16, 16]));
        assert_eq!((&row["local_size"], &row["local_bytes"]), (&json!([16, 16]), &json!(2024)));
        assert_eq!(row["groups"], json!(expected.groups));
        assert_eq!(row["warps"], json!(expected.warps));
        assert_eq!(row["threads"], json!(expected.threads));
        assert_eq!(row["occupancy"], json!(expected.fraction));
        assert!(row["reason"].is_null(), "{row}");
    }

    #[test]
    fn the_table_has_each_number_in_its_column_below_the_limits_of_the_multiprocessor() {
        let sm = multiprocessor("2.0").unwrap();
        let question = Question { sm, registers: 20, local_bytes: 0, local_bytes_per_item: 0 };
        let text = question_text(&question, &[[16, 16]]);
        assert!(text.contains("at most 8 work-groups, 48 warps,\n32768 registers and 48 KiB"), "{text}");
        let row = text.lines().find(|line| line.contains("16x16")).unwrap_or_default();
        let cells: Vec<&str> = row.split(['│', '┆']).map(str::trim).filter(|cell| !cell.is_empty()).collect();
        assert_eq!(cells, ["16x16", "256", "0", "6", "48", "1536", "100%", "warps"]);
    }

    #[test]
    fn local_bytes_an_item_add_to_those_a_group() {
        let sm = multiprocessor("2.0").unwrap();
        let question = Question { sm, registers: 20, local_bytes: 1000, local_bytes_per_item: 108 };
        assert_eq!(question.group_local_bytes([16, 16]), 28648);
        let sizes = LOCAL_SIZES.map(|size| parse_size(size).unwrap());
        let json = question_json(&question, &sizes);
        assert_eq!(json["rows"][7]["limited_by"], "local memory");
        assert_eq!(json["rows"][8]["limited_by"], "cannot launch");
        let text = question_text(&question, &sizes);
        assert!(text.contains("111592 B > 49152 B") && text.contains("48 KiB of __local memory"), "{text}");
    }
}
