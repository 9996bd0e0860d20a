//! A kernel's instructions, and their counts by source line.

use super::kind::{Counts, Kind};
use super::x86::PREFIXES;
use serde::Serialize;
use std::collections::BTreeMap;

/// An instruction of a kernel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Instruction {
    /// The instruction's text.
    pub text: String,
    /// The instruction's line in the source, from the compiler's line table; `None` if the table has no line
    /// for the instruction.
    pub line: Option<u32>,
    /// The part of the kernel to which the instruction belongs. In PTX and SASS, `part` is the last label
    /// before the instruction. For instructions before the first label of a function that the kernel calls,
    /// `part` is the function's name. For instructions before the kernel's own first label, `part` is empty.
    /// In the machine code of a CPU, `part` is the name of the function that contains the instruction.
    pub part: String,
    /// The kinds of work that the instruction does. The list is empty for instructions that do no work of any
    /// [`Kind`] (such as padding and prefetches), and for instructions of processors other than x86-64 and
    /// NVIDIA GPUs.
    pub kinds: Vec<Kind>,
}

impl Instruction {
    /// Returns the words that name the operation, without the operands: the prefixes of an x86 instruction (such as
    /// `lock`), and the opcode.
    fn operation(&self) -> Vec<&str> {
        let words: Vec<&str> = words(&self.text).collect();
        let prefixes = words.iter().take_while(|word| PREFIXES.contains(word)).count();
        words.into_iter().take(prefixes + 1).collect()
    }
}

/// Returns the first word of an instruction's text that is not a predicate.
pub(super) fn opcode(text: &str) -> &str {
    words(text).next().unwrap_or_default()
}

/// Returns the words of an instruction's text without its predicate (such as `@%p1`).
fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split_whitespace().filter(|word| !word.starts_with('@'))
}

/// The instructions of a kernel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Code {
    /// The kernel's name.
    pub kernel: String,
    /// The name of this version of the kernel, if the driver is PoCL, which compiles several versions; see
    /// [`version`](super::pocl::version).
    pub version: Option<String>,
    /// The kernel's instructions, in the order in which the compiler or disassembler wrote them. The functions that the
    /// kernel calls follow the kernel's own function.
    pub instructions: Vec<Instruction>,
}

/// Returns the function of a kernel, and then the functions that the kernel calls directly or indirectly,
/// each once. `calls` returns the functions that a function calls.
pub(super) fn with_called<F: Copy + PartialEq>(kernel: F, calls: impl Fn(F) -> Vec<F>) -> Vec<F> {
    let (mut reached, mut at) = (vec![kernel], 0);
    while let Some(function) = reached.get(at).copied() {
        for called in calls(function) {
            if !reached.contains(&called) {
                reached.push(called);
            }
        }
        at += 1;
    }
    reached
}

/// A count of instructions. A row counts the instructions that a compiler generated from one source line, those of one
/// part of a kernel (after a label, or of a function), or all instructions of a kernel.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Row {
    /// The line in the source; `None` if the row counts the instructions of a part or of a whole kernel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line: Option<u32>,
    /// The text of the line; `None` if the row has no line.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// The label or function that names the part of the kernel; `None` if the row counts the instructions of
    /// a line or of a whole kernel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub part: Option<String>,
    /// Number of instructions.
    pub instructions: u32,
    /// Number of instructions of each kind.
    pub counts: Counts,
}

impl Row {
    fn add(&mut self, instruction: &Instruction) {
        self.instructions += 1;
        self.counts.add(&instruction.kinds);
    }
}

impl Code {
    /// Returns the number of instructions for which the line table has a source line.
    pub fn located(&self) -> usize {
        self.instructions.iter().filter(|one| one.line.is_some()).count()
    }

    /// Returns a row that counts all instructions of the kernel.
    pub fn total(&self) -> Row {
        let mut row = Row::default();
        self.instructions.iter().for_each(|one| row.add(one));
        row
    }

    /// Returns one row per source line that has instructions, in the order of the lines. `source` contains the text of
    /// each line, beginning with line 1.
    pub fn by_line(&self, source: &[&str]) -> Vec<Row> {
        let mut rows: BTreeMap<u32, Row> = BTreeMap::new();
        for (line, one) in self.instructions.iter().filter_map(|one| Some((one.line?, one))) {
            rows.entry(line).or_default().add(one);
        }
        let text = |line: u32| source.get((line as usize).checked_sub(1)?).map(|text| text.trim().to_owned());
        rows.into_iter().map(|(line, row)| Row { line: Some(line), source: text(line), ..row }).collect()
    }

    /// Returns one row per part of the kernel, in the order of the instructions.
    pub fn by_part(&self) -> Vec<Row> {
        let parts = self.instructions.chunk_by(|one, next| one.part == next.part);
        let row = |part: &[Instruction]| {
            let mut row = Row { part: part.first().map(|first| first.part.clone()), ..Row::default() };
            part.iter().for_each(|one| row.add(one));
            row
        };
        parts.map(row).collect()
    }

    /// Returns true if two kernels consist of the same operations in the same order. Operands are not
    /// compared.
    pub fn is_same_as(&self, other: &Self) -> bool {
        let operations = self.instructions.iter().map(Instruction::operation);
        operations.eq(other.instructions.iter().map(Instruction::operation))
    }
}

#[cfg(test)]
mod tests {
    use super::super::kind::Memory;
    use super::*;

    fn instruction(text: &str, line: Option<u32>, part: &str, kind: Kind) -> Instruction {
        Instruction { text: text.into(), line, part: part.into(), kinds: vec![kind] }
    }

    #[test]
    fn instructions_are_counted_by_line_and_by_part() {
        let load = Kind::Load(Memory::Local);
        let code = Code {
            kernel: "k".into(),
            version: None,
            instructions: vec![
                instruction("a x", Some(2), "", load),
                instruction("b y", None, "", Kind::Move),
                instruction("@p c z", Some(1), "loop", Kind::Branch),
                instruction("a w", Some(2), "loop", load),
            ],
        };
        let rows = code.by_line(&["first", "  second"]);
        let actual: Vec<_> =
            rows.iter().map(|row| (row.line, row.source.as_deref(), row.instructions)).collect();
        assert_eq!(actual, [(Some(1), Some("first"), 1), (Some(2), Some("second"), 2)]);
        assert_eq!(rows[1].counts.of(load), 2);
        let parts = code.by_part();
        assert_eq!(parts.iter().map(|row| row.instructions).collect::<Vec<_>>(), [2, 2]);
        assert_eq!((code.located(), code.total().instructions), (3, 4));
        let mut other = code.clone();
        other.instructions[0].text = "a elsewhere".into();
        assert!(code.is_same_as(&other));
        other.instructions[0].text = "d x".into();
        assert!(!code.is_same_as(&other));
    }

    #[test]
    fn two_operations_are_the_same_if_their_opcodes_and_prefixes_are() {
        let code = |text: &str| Code {
            kernel: "k".into(),
            version: None,
            instructions: vec![instruction(text, None, "", Kind::Arithmetic)],
        };
        for (one, other, is_same) in [
            ("lock xadd %eax,(%rdx)", "lock xadd %ecx,(%rdi)", true),
            ("lock xadd %eax,(%rdx)", "lock cmpxchg %eax,(%rdx)", false),
            ("lock xadd %eax,(%rdx)", "xadd %eax,(%rdx)", false),
            ("rep stos %al,%es:(%rdi)", "rep movsb %ds:(%rsi),%es:(%rdi)", false),
            ("data16 cs nopw 0x0(%rax,%rax,1)", "data16 cs nopw 0x8(%rax,%rax,1)", true),
            ("@%p1 bra $L__BB0_2", "@%p2 bra $L__BB0_3", true),
            ("@P0 LDG.E R2, [R2]", "@P0 STG.E [R2], R2", false),
            ("ret", "ret", true),
        ] {
            assert_eq!(code(one).is_same_as(&code(other)), is_same, "{one}, {other}");
        }
    }
}
