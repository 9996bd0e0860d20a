//! The microscope: what a compiler made of each line of a kernel.
//!
//! The program is compiled once more, from the text that `raycl kernel` prints, with a line table. Each line of that
//! text stands for one place in the program: `#if` conditions are already evaluated, macros are expanded, and a file
//! that is included twice appears twice. The instructions are then read from the binary: PTX text, or the machine
//! code of a CPU by `objdump`, and for PTX also the SASS of an installed `ptxas`. Instructions without a line table
//! are counted by parts of the kernel.

mod code;
mod elf;
mod kind;
mod objdump;
mod ptx;
mod sass;
mod tool;
mod x86;

pub use code::{Code, Instruction, Row};
pub use kind::{Counts, Kind};

use crate::device::Hush;
use crate::launch::Prepared;
use crate::program::compiled::{is_ptx, resources};
use crate::program::preprocess::read;
use crate::program::{CompiledKernel, ProgramSpec};
use serde::Serialize;

/// The name of the source in line tables.
const FILE: &str = "kernel.cl";

/// Options that make compilers add a line table. The first is for NVIDIA's compiler, which with `-g` would also
/// compile without optimisation; the second is for all others.
const LINE_TABLE: [&str; 2] = ["-nv-line-info", "-g"];

/// The instructions of a program's kernels, by source line.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Microscope {
    /// The text that was compiled; its first line is line 1.
    #[serde(skip)]
    pub source: String,
    /// What a reader must know, for example that a disassembler is missing.
    pub notes: Vec<String>,
    /// The listings: one for each kernel and each assembler that wrote it.
    pub listings: Vec<Listing>,
}

/// A kernel as one assembler wrote it.
#[derive(Clone, Debug, Serialize)]
pub struct Listing {
    /// The kernel's name.
    pub kernel: String,
    /// The kind of its instructions, and the compiler that made them.
    pub made_by: &'static str,
    /// Whether the driver made these instructions. If it did, the spills and the occupancy of its kernel are those of
    /// this listing.
    #[serde(skip)]
    pub is_drivers: bool,
    /// The meaning of a row of `rows`.
    pub rows_are: RowsAre,
    /// Registers per work-item, if the assembler printed them.
    pub registers: Option<u32>,
    /// Whether the program without a line table, which is timed, has the same instructions, apart from registers and
    /// addresses; `None` if it cannot be read.
    pub same_as_timed: Option<bool>,
    /// Number of instructions.
    pub instructions: u32,
    /// Number of instructions with a source line.
    pub with_line: usize,
    /// The kinds of all instructions.
    pub counts: Counts,
    /// The instructions of each line, or of each part.
    pub rows: Vec<Row>,
    /// All instructions.
    #[serde(skip)]
    pub code: Code,
}

/// The meaning of a listing's rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum RowsAre {
    /// Lines of the source, by the compiler's line table.
    Lines,
    /// Parts of the kernel, from one label to the next, since there is no line table.
    Parts,
}

const PTX: &str = "PTX of the driver's compiler";
const MACHINE: &str = "the CPU's instructions, by objdump";
const SASS: &str = "SASS of the installed ptxas, not the driver's";
const NOTHING: &str =
    "There are no instructions: the driver's binary holds neither PTX nor an ELF file with the kernels.";

impl Microscope {
    /// Compiles a program with a line table, and reads the instructions of `kernels`. `timed_binary` is the binary of
    /// the program without one.
    pub fn of(prepared: &Prepared, timed_binary: &[u8], kernels: &[CompiledKernel]) -> Self {
        let names: Vec<&str> = kernels.iter().map(|kernel| kernel.name.as_str()).collect();
        let text = match prepared.preprocessed() {
            Ok(text) => read(&text.lines, Some(&names)).text,
            // A user's own kernels may use what only the driver's compiler understands.
            Err(error) => {
                return Self {
                    notes: vec![format!("There are no instructions: {error}")],
                    ..Self::default()
                };
            }
        };
        let source = text.trim_start().to_owned();
        let mut microscope = Self { source, ..Self::default() };
        let with_lines = microscope.with_lines(prepared, is_ptx(timed_binary));
        let binary = with_lines.as_deref().unwrap_or(timed_binary);
        let codes = microscope.noting(read_codes(binary, &names)).unwrap_or_default();
        let timed = with_lines.is_some().then(|| read_codes(timed_binary, &names)).and_then(Result::ok);
        let made_by = if is_ptx(binary) { PTX } else { MACHINE };
        for kernel in kernels {
            let Some(code) = codes.iter().find(|code| code.kernel == kernel.name) else { continue };
            let same_as_timed = timed.as_ref().map(|timed| is_among(timed, code));
            microscope.add(code.clone(), made_by, kernel.resources.registers, same_as_timed);
        }
        if is_ptx(binary) {
            microscope.add_sass(&String::from_utf8_lossy(binary), &names);
        }
        microscope
    }

    /// Returns the binary of the same program with a line table; `None`, and a note, if it cannot be compiled.
    fn with_lines(&mut self, prepared: &Prepared, is_ptx: bool) -> Option<Vec<u8>> {
        let option = LINE_TABLE[usize::from(!is_ptx)];
        // All defines are already expanded in the text, so their options are left out.
        let options = prepared.spec.options.split_whitespace().filter(|word| word.starts_with("-cl"));
        let options: Vec<&str> = options.chain([option]).collect();
        let source = format!("#line 1 \"{FILE}\"\n{}", self.source);
        // PoCL's cache treats texts that differ only in comments and line numbers as the same program.
        let hash = &blake3::hash(source.as_bytes()).to_hex()[..8];
        let options = format!("{} -D LINES_OF=0x{hash}", options.join(" "));
        let spec = ProgramSpec { source, options, files: Vec::new() };
        let hush = Hush::begin();
        let built = prepared.build_text(&spec).map(|program| program.binary());
        drop(hush);
        let refused = |log: &str| {
            let message = log.lines().find(|line| !line.trim().is_empty());
            let message = message.unwrap_or("the compiler printed no message");
            format!("The program could not be compiled with {option}, so there is no line table: {message}")
        };
        self.noting(built.map_err(|error| refused(&error.log)))
    }

    fn add_sass(&mut self, ptx: &str, names: &[&str]) {
        let assembled = sass::codes(ptx, names, FILE).map_err(|why| format!("There is no SASS: {why}."));
        let Some(assembled) = self.noting(assembled) else { return };
        for code in assembled.codes {
            let registers = resources(&assembled.log, &code.kernel).registers;
            self.add(code, SASS, registers, None);
        }
    }

    fn add(
        &mut self,
        code: Code,
        made_by: &'static str,
        registers: Option<u32>,
        same_as_timed: Option<bool>,
    ) {
        let (total, with_line) = (code.total(), code.located());
        let lines: Vec<&str> = self.source.lines().collect();
        let (rows_are, rows) = match with_line {
            0 => (RowsAre::Parts, code.by_part()),
            _ => (RowsAre::Lines, code.by_line(&lines)),
        };
        self.listings.push(Listing {
            kernel: code.kernel.clone(),
            made_by,
            is_drivers: made_by != SASS,
            rows_are,
            registers,
            same_as_timed,
            instructions: total.instructions,
            with_line,
            counts: total.counts,
            rows,
            code,
        });
    }

    /// Returns the value, or keeps the reason why there is none as a note.
    fn noting<T>(&mut self, result: Result<T, String>) -> Option<T> {
        result.map_err(|note| self.notes.push(note)).ok()
    }
}

/// Reads the kernels of a binary; a driver may have compiled a kernel more than once. The error says why they cannot be
/// read.
fn read_codes(binary: &[u8], names: &[&str]) -> Result<Vec<Code>, String> {
    let codes = if is_ptx(binary) {
        ptx::codes(&String::from_utf8_lossy(binary), names, FILE)
    } else {
        let files = elf::files(binary).into_iter().map(|file| objdump::codes(file, names, FILE));
        let codes = files.collect::<Result<Vec<_>, _>>();
        codes.map_err(|why| format!("There are no instructions: {why}."))?.concat()
    };
    if codes.is_empty() { Err(NOTHING.to_owned()) } else { Ok(codes) }
}

/// Returns whether `codes` contains the same kernel with the same instructions, ignoring registers and addresses.
fn is_among(codes: &[Code], code: &Code) -> bool {
    codes.iter().any(|other| other.kernel == code.kernel && other.is_same_as(code))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn code(kernel: &str, text: &str) -> Code {
        let one = Instruction { text: text.into(), line: None, part: String::new(), kinds: Vec::new() };
        Code { kernel: kernel.into(), instructions: vec![one] }
    }

    #[test]
    fn a_kernel_with_other_instructions_is_not_the_one_that_is_timed() {
        let own = code("k", "add x");
        assert!(is_among(&[code("k", "mul x"), code("k", "add y")], &own));
        assert!(!is_among(&[code("k", "mul x")], &own));
        assert!(!is_among(&[code("other", "add x")], &own));
    }
}
