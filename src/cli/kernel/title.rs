//! Writes the comments that `raycl kernel` prints before and after a program, and that describe the program.

use super::Args;
use crate::device::{Builtins, Device};
use crate::program::preprocess::Preprocessed;
use crate::strategy::{Strategy, Workload};
use crate::words::{counted, counted_are};

/// A program's strategy, device and sizes, which the comment at the program's beginning states.
pub(super) struct Title<'a> {
    pub args: &'a Args,
    pub strategy: Strategy,
    pub workload: Workload,
    pub builtins: Builtins,
    /// The device for whose compiler the program is printed; `None` if the program is not for a particular
    /// device.
    pub device: Option<Device>,
    pub options: &'a str,
}

impl Title<'_> {
    /// Returns the comment at the beginning of the printed program.
    pub fn head(&self, program: &Preprocessed, kernels: &[&str]) -> String {
        let [across, down] = self.workload.local_size;
        let (defines, options) = parted(self.options);
        let lines = [
            format!("raycl kernel {}", self.args.strategy),
            self.strategy.to_string(),
            format!("local size: {across} x {down} work-items; {}", self.sizes()),
            self.compiler(program),
            format!("options: {options}"),
            format!("defines: {defines}"),
            format!("kernels that a frame with one sample per pixel may need: {}", kernels.join(", ")),
        ];
        lines.iter().map(|line| comment(line)).collect()
    }

    fn sizes(&self) -> String {
        let w = &self.workload;
        let whose = match &self.args.scene {
            Some(path) => path.display().to_string(),
            None => "a small scene".to_owned(),
        };
        let stack = match self.strategy.needs_tree() {
            true => format!(", stacks of {} entries", w.stack_size),
            false => String::new(),
        };
        let Workload { triangles, positions, normals, materials, .. } = w;
        format!(
            "{whose}: {}, {}, {}, {}{stack}",
            counted(*triangles, "triangle"),
            counted(*positions, "position"),
            counted(*normals, "normal"),
            counted(*materials, "material"),
        )
    }

    fn compiler(&self, program: &Preprocessed) -> String {
        let lanes = match self.strategy.shares_tiles() {
            true => {
                format!("; work-items that share a tile exchange values by {}", self.builtins.lanes.about())
            }
            false => String::new(),
        };
        match &self.device {
            Some(device) => format!("for {}{lanes}", device.info.describe()),
            None if program.asked.is_empty() => format!("for any device{lanes}"),
            None => {
                let names: Vec<&str> = program.undefined().into_iter().collect();
                format!(
                    "for any device{lanes}; the device's compiler is assumed not to define: {}",
                    names.join(", ")
                )
            }
        }
    }
}

/// Returns the comment at the end of the printed program. The comment names the files that add only macros to the
/// program, and states the number of lines that were left out (`left_out`). Returns an empty text if all files add
/// other code, too, and no lines were left out.
pub(super) fn foot(program: &Preprocessed, left_out: usize) -> String {
    let has_code = |file: &&String| program.lines.iter().any(|line| line.is_code && *line.file == ***file);
    let without: Vec<&str> =
        program.files.iter().filter(|file| !has_code(file)).map(String::as_str).collect();
    let mut foot = String::new();
    if !without.is_empty() {
        foot += &comment(&format!("files that add only macros (expanded above): {}", without.join(", ")));
    }
    if left_out > 0 {
        let lines = counted_are(left_out, "line that these kernels do not need");
        let them = if left_out == 1 { "it" } else { "them" };
        foot += &comment(&format!("{lines} left out; --all prints {them}"));
    }
    if foot.is_empty() { foot } else { format!("\n{foot}") }
}

/// Splits compiler options into macro definitions, without their `-D`, and all other options.
fn parted(options: &str) -> (String, String) {
    let (mut defines, mut others) = (Vec::new(), Vec::new());
    let mut words = options.split_whitespace();
    while let Some(word) = words.next() {
        match word {
            "-D" => defines.extend(words.next()),
            other => others.push(other),
        }
    }
    (defines.join(" "), others.join(" "))
}

/// The length of the longest line of a comment, in characters.
const WIDEST: usize = 110;

/// Returns `text` as a comment whose lines have at most [`WIDEST`] characters, unless a single word is too long.
fn comment(text: &str) -> String {
    let mut lines = String::new();
    let mut line = "//".to_owned();
    for word in text.split_whitespace() {
        if line.chars().count() + 1 + word.chars().count() > WIDEST {
            lines += &line;
            lines.push('\n');
            line = "//  ".to_owned();
        }
        line.push(' ');
        line += word;
    }
    format!("{lines}{line}\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser as _;

    #[derive(clap::Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    #[test]
    fn the_parts_of_a_scene_are_counted_and_one_normal_is_a_normal() {
        let args = Command::parse_from(["kernel", "naive"]).args;
        let strategy = crate::strategy::preset("naive").expect("a preset").strategy;
        let workload = Workload { triangles: 12, positions: 8, normals: 1, materials: 1, ..Workload::CUBE };
        let title = Title {
            args: &args,
            strategy,
            workload,
            builtins: Builtins::default(),
            device: None,
            options: "",
        };
        assert_eq!(title.sizes(), "a small scene: 12 triangles, 8 positions, 1 normal, 1 material");
    }

    #[test]
    fn lines_that_are_left_out_are_counted_and_one_is_a_line() {
        let program = Preprocessed { lines: Vec::new(), asked: Vec::new(), files: Vec::new() };
        let comment = |left_out| foot(&program, left_out).trim().to_owned();
        assert_eq!(comment(0), "");
        assert_eq!(comment(1), "// 1 line that these kernels do not need is left out; --all prints it");
        assert_eq!(comment(2), "// 2 lines that these kernels do not need are left out; --all prints them");
    }
}
