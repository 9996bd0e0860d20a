//! Uses `objdump`, a part of the GNU binutils, to read kernels from a CPU's machine code.

use super::code::{Code, Instruction, with_called};
use super::tool::{Folder, Tool};
use super::x86;
use std::collections::BTreeMap;

/// The error message if `objdump` is not installed.
pub const REMEDY: &str = "objdump is missing; install the package binutils";

/// Reads the kernels with the names in `kernels` from an ELF file. `file` is the name of the source file;
/// line numbers of other files are ignored. The error says why the kernels cannot be read.
pub fn codes(elf: &[u8], kernels: &[&str], file: &str) -> Result<Vec<Code>, String> {
    let objdump = Tool::find("objdump").ok_or(REMEDY)?;
    let folder = Folder::with("kernel.so", elf)?;
    let arguments = ["--disassemble", "--no-show-raw-insn", "--dwarf=decodedline", "kernel.so"];
    Ok(Listing::of(&objdump.run(&folder, &arguments)?.stdout, file).codes(kernels))
}

/// The functions of an ELF file, and the file's line table.
struct Listing<'a> {
    is_x86: bool,
    /// For an address, the source line of the instructions from this address up to the next address in the
    /// map; `None` if these instructions belong to no source line.
    lines: BTreeMap<u64, Option<u32>>,
    /// The name of each function, and the text of its instructions.
    functions: Vec<(&'a str, &'a str)>,
}

impl<'a> Listing<'a> {
    fn of(listing: &'a str, file: &str) -> Self {
        Self {
            is_x86: listing.contains("elf64-x86-64"),
            lines: listing.lines().filter_map(|row| table_row(row, file)).collect(),
            functions: listing.split("\n\n").filter_map(function).collect(),
        }
    }

    /// Returns each kernel: the instructions of the kernel's own function, then the instructions of all
    /// functions that the kernel calls directly or indirectly.
    fn codes(&self, kernels: &[&str]) -> Vec<Code> {
        let code = |kernel: &&str| {
            // PoCL's function for a kernel runs a whole work-group. PoCL also writes two other functions, which
            // read the kernel's arguments and then run a copy of the first function's code. raycl leaves out
            // these two functions, because the copies have no source lines. PoCL 7.1 writes only one function, whose
            // name ends in `_workgroup`, and which contains the code with its source lines.
            let of_pocl = format!("_pocl_kernel_{kernel}");
            let names = [of_pocl.clone(), format!("{of_pocl}_workgroup"), (*kernel).to_owned()];
            let own = names.iter().find_map(|name| self.function(name))?;
            let functions = with_called(own, |(_, body)| {
                body.lines().filter_map(|line| self.function(called(line)?)).collect()
            });
            let instructions = functions.into_iter().flat_map(|function| self.instructions(function));
            Some(Code { kernel: (*kernel).to_owned(), version: None, instructions: instructions.collect() })
        };
        kernels.iter().filter_map(code).collect()
    }

    fn function(&self, name: &str) -> Option<(&'a str, &'a str)> {
        self.functions.iter().find(|(own, _)| *own == name).copied()
    }

    fn instructions(&self, (name, body): (&str, &str)) -> Vec<Instruction> {
        let frames = frames(body);
        let one = |(address, text): (u64, &str)| Instruction {
            text: text.to_owned(),
            line: self.lines.range(..=address).next_back().and_then(|(_, line)| *line),
            part: name.to_owned(),
            kinds: if self.is_x86 { x86::kinds(text, &frames) } else { Vec::new() },
        };
        body.lines().filter_map(instruction).map(one).collect()
    }
}

/// Returns the name of a function, and the text of its instructions. `text` begins with "0000000000001130 <name>:".
fn function(text: &str) -> Option<(&str, &str)> {
    let (head, body) = text.trim_start_matches('\n').split_once('\n')?;
    let name = head.split_once(" <")?.1.strip_suffix(">:")?;
    Some((name, body))
}

/// Returns the name of the function to which a call or a jump leads: "any_hit" for "call 1000 <any_hit>". A call
/// or a jump is recognised by the name in its operand, since the opcode of a call depends on the processor
/// ("call", "bl"). Names of data are not mistaken for functions, since objdump writes them only in comments.
/// Returns `None` for a stub of the linker ("memset@plt"), since a stub only jumps to a function of another file.
/// Also returns `None` for AArch64's "adrp", which computes the address of a page of memory. By chance, a function
/// may begin at this address, and objdump then writes the function's name in the operand.
fn called(line: &str) -> Option<&str> {
    let (_, text) = instruction(line)?;
    let (name, _) = text.split_once('<')?.1.split_once('>')?;
    let goes = !text.starts_with("adrp") && !name.contains("@plt");
    goes.then_some(name)
}

/// Returns the registers besides `%rsp` in which a function stores the address of its stack frame.
fn frames(body: &str) -> Vec<&'static str> {
    let set = |register: &&str| {
        let end = format!("%rsp,{register}");
        body.lines().take(20).any(|line| line.trim_end().ends_with(&end))
    };
    ["%rbp", "%rbx"].into_iter().filter(set).collect()
}

/// Returns the address and the text of an instruction from a line such as " 1137:\tmov (%rax),%rax". Leaves
/// out the comment that objdump appends for some addresses.
fn instruction(line: &str) -> Option<(u64, &str)> {
    let (address, text) = line.split_once(":\t")?;
    let text = text.split(" # ").next().unwrap_or(text);
    Some((u64::from_str_radix(address.trim(), 16).ok()?, text.trim_end()))
}

/// Returns the address and the line number from a row of the line table, such as "kernel.cl 157 0x100b x". The line
/// number is `None` in three cases. First, the row names another file than `file`. Second, the number in the row is 0:
/// the instruction at this address has no source line. Third, the row has "-" instead of a number: a sequence of
/// instructions ends at this address.
fn table_row(row: &str, file: &str) -> Option<(u64, Option<u32>)> {
    let mut words = row.split_whitespace();
    let (name, number, address) = (words.next()?, words.next()?, words.next()?);
    let address = u64::from_str_radix(address.strip_prefix("0x")?, 16).ok()?;
    let number: u32 = if number == "-" { 0 } else { number.parse().ok()? };
    Some((address, Some(number).filter(|number| name == file && *number > 0)))
}

#[cfg(test)]
mod tests {
    use super::super::code::opcode;
    use super::super::kind::{Kind, Memory};
    use super::*;

    const LISTING: &str = "
kernel.so:     file format elf64-x86-64

Contents of the .debug_line section:

kernel.cl:
File name                            Line number    Starting address    View    Stmt
kernel.cl                                     12              0x1130               x
kernel.cl                                      3              0x1137               x
other.h                                        3              0x113a               x
kernel.cl                                      4              0x113c
kernel.cl                                      0              0x1150
kernel.cl                                     20              0x1000               x
kernel.cl                                      -              0x1010


Disassembly of section .text:

0000000000001000 <helper>:
    1000:\tvmovss (%rdi),%xmm0
    1004:\tjmp    1000 <helper>
    1010:\tnop

0000000000001130 <_pocl_kernel_mine>:
    1130:\tpush   %rbp
    1131:\tmov    %rsp,%rbp
    1137:\tvmovss (%rax),%xmm0
    1138:\tvmovss %xmm0,-0x8(%rbp)
    113a:\tvaddss %xmm0,%xmm0,%xmm1
    113c:\tvmovss %xmm1,(%rdx)        # 200c <x+0xd9c>
    1150:\tcall   1000 <helper>
    1262:\tret

0000000000001300 <_pocl_kernel_mine_workgroup>:
    1300:\tret
";

    fn rows_of(listing: &str) -> Vec<(String, Option<u32>, Option<Kind>, String)> {
        let codes = Listing::of(listing, "kernel.cl").codes(&["mine", "missing"]);
        assert_eq!(codes.len(), 1);
        let one = |one: &Instruction| {
            (opcode(&one.text).into(), one.line, one.kinds.first().copied(), one.part.clone())
        };
        codes[0].instructions.iter().map(one).collect()
    }

    #[test]
    fn a_kernel_is_read_with_its_lines_and_what_it_calls() {
        let row = |opcode: &str, line, kind, part: &str| (opcode.to_owned(), line, kind, part.to_owned());
        let (own, helper) = ("_pocl_kernel_mine", "helper");
        let expected = [
            row("push", Some(12), Some(Kind::Store(Memory::Private)), own),
            row("mov", Some(12), Some(Kind::Move), own),
            row("vmovss", Some(3), Some(Kind::Load(Memory::Generic)), own),
            row("vmovss", Some(3), Some(Kind::Store(Memory::Private)), own),
            row("vaddss", None, Some(Kind::Arithmetic), own),
            row("vmovss", Some(4), Some(Kind::Store(Memory::Generic)), own),
            row("call", None, Some(Kind::Call), own),
            row("ret", None, Some(Kind::Branch), own),
            row("vmovss", Some(20), Some(Kind::Load(Memory::Generic)), helper),
            row("jmp", Some(20), Some(Kind::Branch), helper),
            row("nop", None, None, helper),
        ];
        assert_eq!(rows_of(LISTING), expected);
        // Some versions of objdump write spaces at the ends of lines.
        assert_eq!(rows_of(&LISTING.replace("%rsp,%rbp", "%rsp,%rbp  ")), expected);
    }

    #[test]
    fn a_kernel_of_which_only_the_work_groups_function_is_left_is_read_from_it() {
        let only = LISTING.replace("<_pocl_kernel_mine>", "<other>");
        let rows: Vec<_> = rows_of(&only).into_iter().map(|(opcode, _, _, part)| (opcode, part)).collect();
        assert_eq!(rows, [("ret".to_owned(), "_pocl_kernel_mine_workgroup".to_owned())]);
    }

    #[test]
    fn instructions_of_other_processors_are_listed_and_not_counted() {
        let other = rows_of(&LISTING.replace("elf64-x86-64", "elf64-littleaarch64"));
        assert!(other.iter().all(|(_, _, kind, _)| kind.is_none()));
        assert_eq!(other.len(), 11);
    }

    #[test]
    fn a_stub_of_the_linker_is_no_part_of_a_kernel() {
        let stub = "0000000000001020 <memset@plt>:\n    1020:\tjmp    1010 <memset@plt-0x10>\n\n\
                    0000000000001010 <memset@plt-0x10>:\n    1010:\tnop\n\n";
        let with_stub = LISTING
            .replace("0000000000001130 <", &format!("{stub}0000000000001130 <"))
            .replace("1262:\tret", "1262:\tcall   1020 <memset@plt>\n    1267:\tret");
        let parts: Vec<_> = rows_of(&with_stub).into_iter().map(|(_, _, _, part)| part).collect();
        assert_eq!(parts, [vec!["_pocl_kernel_mine"; 9], vec!["helper"; 3]].concat());
    }

    #[test]
    fn a_function_that_a_kernel_jumps_to_is_part_of_it() {
        let jumps = LISTING.replace("call   1000 <helper>", "jmp    1000 <helper>");
        let parts: Vec<_> = rows_of(&jumps).into_iter().map(|(_, _, _, part)| part).collect();
        assert_eq!(parts, [vec!["_pocl_kernel_mine"; 8], vec!["helper"; 3]].concat());
    }

    #[test]
    fn a_call_is_known_by_its_operand_on_processors_that_name_calls_otherwise() {
        for (line, name) in [
            ("    1150:\tbl\t1000 <helper>", Some("helper")),
            ("    1150:\tb\t1000 <helper>", Some("helper")),
            ("    1150:\tb.ne\t1000 <helper>  // b.any", Some("helper")),
            ("    1150:\tjal\tra,1000 <helper>", Some("helper")),
            ("    1150:\tbl\t1020 <memset@plt>", None),
            ("    1150:\tadrp\tx0, 1000 <helper>", None),
            ("    1150:\tlea    0xe(%rip),%rdi        # 1000 <helper>", None),
            ("    1150:\tadd\tx0, x0, #0x8", None),
        ] {
            assert_eq!(called(line), name, "{line}");
        }
    }
}
