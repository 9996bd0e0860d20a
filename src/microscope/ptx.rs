//! Reads kernels from PTX text, with the source lines that `.loc` directives state:
//!
//! ```text
//! .file 1 "kernel.cl"
//! .entry cast_frame( ... ) {
//!     .loc 1 12 5
//!     ld.global.f32 %f1, [%rd1];
//! $L__BB0_1:
//!     .loc 1 3 9, function_name $L__info_string0, inlined_at 1 14 3
//! ```
//!
//! A `.loc` applies to all instructions up to the next `.loc`. For an instruction from an inlined function,
//! the first two numbers of the `.loc` are the file and the line within the inlined function.

use super::code::{Code, Instruction, opcode, with_called};
use super::kind::{Kind, Memory};
use crate::program::compiled::ptx::{after_results, body_of, instruction, without_comments};

/// Reads the kernels with the names in `kernels`. Each kernel's code consists of the instructions of the
/// kernel itself, then the instructions of all functions that the kernel calls directly or indirectly. `file`
/// is the name of the source file; line numbers of other files are ignored.
pub fn codes(ptx: &str, kernels: &[&str], file: &str) -> Vec<Code> {
    let text = without_comments(ptx);
    let number = text.lines().find_map(|line| numbered(line, file));
    let code = |kernel: &&str| {
        let functions = with_called(function(&text, kernel)?, |(_, body)| {
            body.split(';').filter_map(|statement| function(&text, called(statement)?)).collect()
        });
        let mut instructions = Vec::new();
        for (name, body) in functions {
            let part = if name == *kernel { String::new() } else { name.to_owned() };
            let mut reader = Reader { kernel, file: number, part, ..Reader::default() };
            body.lines().for_each(|line| reader.line(line));
            instructions.extend(reader.instructions);
        }
        Some(Code { kernel: (*kernel).to_owned(), version: None, instructions })
    };
    kernels.iter().filter_map(code).collect()
}

/// Returns the name and the body of a kernel or a function; `None` if the PTX text does not define the
/// function.
fn function<'a>(text: &'a str, name: &'a str) -> Option<(&'a str, &'a str)> {
    body_of(text, name).map(|body| (name, body))
}

/// Returns the name of the function that a statement calls: "helper" for "call.uni (retval0), helper, (param0)".
fn called(statement: &str) -> Option<&str> {
    let is_call = |word: &&str| *word == "call" || word.starts_with("call.");
    let (_, operands) = statement.split_once(statement.split_whitespace().find(is_call)?)?;
    let is_between = |c: char| c == ',' || c.is_whitespace();
    after_results(operands)?.trim_start_matches(is_between).split(is_between).next()
}

/// Returns true if a text before a colon is a label. Labels contain no dots. If the colon is part of a "::"
/// in an opcode, the text before the colon contains a dot, so it is no label.
fn is_label(text: &str) -> bool {
    !text.is_empty() && !text.contains(['.', ' ', '@', '{', '['])
}

/// Returns the number that PTX gives to the file `file`, such as 1 in the line `.file 1 "folder/name"`;
/// `None` for other files.
fn numbered(line: &str, file: &str) -> Option<u32> {
    let (number, path) = line.trim().strip_prefix(".file")?.trim_start().split_once(char::is_whitespace)?;
    let path = path.trim_start().strip_prefix('"')?.split('"').next()?;
    (path.rsplit('/').next() == Some(file)).then(|| number.parse().ok())?
}

#[derive(Default)]
struct Reader<'a> {
    /// The name of the kernel. The names of the kernel's arguments begin with this name.
    kernel: &'a str,
    /// The number that the PTX text gives to the source file; `None` if the PTX text does not name the source
    /// file.
    file: Option<u32>,
    line: Option<u32>,
    part: String,
    /// The part of the current statement that was already read.
    statement: String,
    instructions: Vec<Instruction>,
}

impl Reader<'_> {
    fn line(&mut self, line: &str) {
        let trimmed = line.trim();
        if let Some(location) = trimmed.strip_prefix(".loc") {
            let mut numbers = location.split([' ', '\t', ',']).filter_map(|word| word.parse::<u32>().ok());
            let (file, line) = (numbers.next(), numbers.next());
            // Line 0 means that the instruction belongs to no source line.
            self.line = line.filter(|line| file == self.file && *line > 0);
            return;
        }
        for c in trimmed.chars() {
            self.character(c);
        }
        self.statement.push(' ');
    }

    /// Adds a character to the statement. A brace at the start of a statement opens or closes a
    /// block and is skipped; a brace within a statement encloses the parts of a vector.
    fn character(&mut self, c: char) {
        match c {
            ';' => self.end(),
            '{' | '}' if self.statement.trim().is_empty() => {}
            ':' if is_label(self.statement.trim()) => {
                self.part = std::mem::take(&mut self.statement).trim().to_owned();
            }
            other => self.statement.push(other),
        }
    }

    fn end(&mut self) {
        let words = std::mem::take(&mut self.statement);
        let text = words.split_whitespace().collect::<Vec<_>>().join(" ");
        let opcode = opcode(&text);
        if opcode.is_empty() || opcode.starts_with('.') {
            return;
        }
        let (kinds, part) = (kinds(&text, self.kernel), self.part.clone());
        self.instructions.push(Instruction { text, line: self.line, part, kinds });
    }
}

/// Returns the kinds of work that an instruction of `kernel`, or of a function that `kernel` calls, does.
/// Returns no kind for prefetches and pragmas.
fn kinds(text: &str, kernel: &str) -> Vec<Kind> {
    let opcode = opcode(text);
    if let Some(name) = instruction(opcode) {
        let mut words = name.split('.');
        let (verb, memory) = (words.next().unwrap_or_default(), memory(words.next().unwrap_or_default()));
        // The kernel's arguments are called `KERNEL_param_0` and so on. Parameters that are not arguments of
        // the kernel have other names, and pass values to functions and back, usually in registers.
        if memory == Memory::Argument && !text.contains(&format!("[{kernel}_param_")) {
            return vec![Kind::Move];
        }
        return vec![match verb {
            "ld" | "ldu" => Kind::Load(memory),
            "st" => Kind::Store(memory),
            _ => Kind::Atomic(memory),
        }];
    }
    match opcode.split('.').next().unwrap_or_default() {
        "bra" | "brx" | "ret" | "exit" => vec![Kind::Branch],
        "call" => vec![Kind::Call],
        "bar" | "barrier" | "membar" | "fence" => vec![Kind::Barrier],
        "mov" | "cvta" | "shfl" => vec![Kind::Move],
        "prefetch" | "prefetchu" | "pragma" => Vec::new(),
        _ => vec![Kind::Arithmetic],
    }
}

/// Returns the kind of memory that corresponds to a state space (an address space) of PTX.
fn memory(space: &str) -> Memory {
    match space {
        "global" => Memory::Global,
        "shared" => Memory::Local,
        "const" => Memory::Constant,
        "local" => Memory::Private,
        "param" => Memory::Argument,
        _ => Memory::Generic,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A PTX text in which line 3 of the source loads, and line 4 computes and stores. Line 7 belongs to
    /// another source file.
    const WITH_LINES: &str = r#"
.version 8.8
.target sm_90, texmode_independent
.address_size 64
.entry other() { .loc 1 9 1
 ret; }
.entry mine(
	.param .u64 .ptr .global .align 4 mine_param_0
)
{
	.reg .b32 %r<4>;
	.local .align 4 .b8 __local_depot0[16];
	.loc 1 2 1
	ld.param.u64 	%rd1, [mine_param_0];
	.loc	1 3 9, function_name $L__info_string0, inlined_at 1 14 3
	ld.volatile.global.v2.f32 	{%f1, %f2}, [%rd1+4];
$L__BB0_1: // a loop
	.loc 1 4 5
	fma.rn.f32 	%f3, %f1, %f2, %f2;
	st.shared.f32 	[%r1],
		%f3;
	.loc 2 7 1
	bar.sync 	0;
	.loc 1 0 1
	@!%p1 bra 	$L__BB0_1;
	{
	.loc 1 5 1
	call.uni (retval0), helper, (param0);
	}
	ret;
}
.file	1 "/tmp/x/kernel.cl"
.file	2 "/usr/include/opencl-c.h"
"#;

    fn rows_of(ptx: &str) -> Vec<(String, Option<u32>, String, Vec<Kind>)> {
        let codes = codes(ptx, &["mine"], "kernel.cl");
        assert_eq!(codes.len(), 1);
        let one = |one: Instruction| (one.text, one.line, one.part, one.kinds);
        codes.into_iter().flat_map(|code| code.instructions).map(one).collect()
    }

    #[test]
    fn each_instruction_has_its_line_its_part_and_its_kind() {
        let row = |text: &str, line: Option<u32>, part: &str, kind| {
            (text.to_owned(), line, part.to_owned(), vec![kind])
        };
        let looped = "$L__BB0_1";
        let expected = [
            row("ld.param.u64 %rd1, [mine_param_0]", Some(2), "", Kind::Load(Memory::Argument)),
            row("ld.volatile.global.v2.f32 {%f1, %f2}, [%rd1+4]", Some(3), "", Kind::Load(Memory::Global)),
            row("fma.rn.f32 %f3, %f1, %f2, %f2", Some(4), looped, Kind::Arithmetic),
            row("st.shared.f32 [%r1], %f3", Some(4), looped, Kind::Store(Memory::Local)),
            row("bar.sync 0", None, looped, Kind::Barrier),
            row("@!%p1 bra $L__BB0_1", None, looped, Kind::Branch),
            row("call.uni (retval0), helper, (param0)", Some(5), looped, Kind::Call),
            row("ret", Some(5), looped, Kind::Branch),
        ];
        assert_eq!(rows_of(WITH_LINES), expected);
    }

    /// In this PTX text, the function `helper` calls itself and a function that returns nothing.
    #[test]
    fn the_functions_that_a_kernel_calls_follow_it_once() {
        let functions = "
.func (.param .b32 func_retval0) helper(.param .b32 helper_param_0)
;
.func inner()
{
	.loc 1 9 1
	ret;
}
.func unused() { trap; }
.func (.param .b32 func_retval0) helper(
	.param .b32 helper_param_0
)
{
	.loc 1 8 1
	ld.param.f32 %f1, [helper_param_0];
	@%p1 call.uni inner;
	call.uni (retval0),
	helper,
	(
	param0
	);
	st.param.f32 [func_retval0], %f1;
}
.entry other()";
        let with_call = WITH_LINES
            .replace("call.uni", "st.param.b32 [param0], %r1;\n\tcall.uni")
            .replace("(param0);", "(param0);\n\tld.param.b32 %r2, [retval0];");
        let rows = rows_of(&with_call.replace(".entry other()", functions));
        let row = |text: &str, line: u32, part: &str, kind| {
            (text.to_owned(), Some(line), part.to_owned(), vec![kind])
        };
        let looped = "$L__BB0_1";
        let expected = [
            row("st.param.b32 [param0], %r1", 5, looped, Kind::Move),
            row("call.uni (retval0), helper, (param0)", 5, looped, Kind::Call),
            row("ld.param.b32 %r2, [retval0]", 5, looped, Kind::Move),
            row("ret", 5, looped, Kind::Branch),
            row("ld.param.f32 %f1, [helper_param_0]", 8, "helper", Kind::Move),
            row("@%p1 call.uni inner", 8, "helper", Kind::Call),
            row("call.uni (retval0), helper, ( param0 )", 8, "helper", Kind::Call),
            row("st.param.f32 [func_retval0], %f1", 8, "helper", Kind::Move),
            row("ret", 9, "inner", Kind::Branch),
        ];
        assert_eq!(rows[6..], expected);
    }

    #[test]
    fn without_a_line_table_no_instruction_has_a_line() {
        let lines = WITH_LINES.lines().filter(|line| !line.contains(".loc") && !line.contains(".file"));
        let without = lines.collect::<Vec<_>>().join("\n");
        let rows = rows_of(&without.replace("other() {", "other() { ret; }"));
        assert_eq!(rows.len(), 8);
        assert!(rows.iter().all(|(_, line, ..)| line.is_none()));
        assert_eq!(rows.iter().filter(|(_, _, part, _)| part.is_empty()).count(), 2);
    }

    #[test]
    fn lines_of_another_file_alone_are_no_lines() {
        let other = WITH_LINES.replace("kernel.cl", "other.cl");
        assert!(rows_of(&other).iter().all(|(_, line, ..)| line.is_none()));
        assert!(codes(WITH_LINES, &["min"], "kernel.cl").is_empty());
    }

    #[test]
    fn labels_have_a_dollar_sign_or_none() {
        for label in ["$L__BB0_1", "BB0_1"] {
            let ptx = format!(
                ".visible .entry k(\n)\n{{\n{label}: ld.global.f32 %f1, [%rd1];\n\tbra.uni {label};\n}}\n"
            );
            let codes = codes(&ptx, &["k"], "kernel.cl");
            let actual = codes[0].instructions.iter().map(|one| (one.part.as_str(), one.kinds[0]));
            let expected = [(label, Kind::Load(Memory::Global)), (label, Kind::Branch)];
            assert_eq!(actual.collect::<Vec<_>>(), expected);
        }
    }

    #[test]
    fn an_instruction_before_a_colon_is_no_label() {
        for label in ["$L__BB0_1", "BB0_1", "loop"] {
            assert!(is_label(label), "{label}");
        }
        for other in ["", "cp.async.bulk.shared", "@%p1 bra", "@p", "{", "[%rd1"] {
            assert!(!is_label(other), "{other}");
        }
    }

    #[test]
    fn each_kind_of_instruction_is_known_by_its_first_word() {
        use Kind::{Arithmetic, Atomic, Barrier, Branch, Call, Load, Move, Store};
        use Memory::{Argument, Constant, Generic, Global, Local, Private};
        for (text, kind) in [
            ("ld.global.f32", Load(Global)),
            ("ld.shared.f32", Load(Local)),
            ("ld.const.f32", Load(Constant)),
            ("ld.local.f32", Load(Private)),
            ("ld.param.u64 %rd1, [k_param_0]", Load(Argument)),
            ("ld.param.v2.u32 {%r1, %r2}, [k_param_1+8]", Load(Argument)),
            ("ld.param.u64 %rd1, [helper_param_0]", Move),
            ("ld.f32", Load(Generic)),
            ("st.global.v4.f32", Store(Global)),
            ("st.local.f32", Store(Private)),
            ("atom.global.add.u32", Atomic(Global)),
            ("atom.shared.add.u32", Atomic(Local)),
            ("bra.uni", Branch),
            ("ret", Branch),
            ("call.uni", Call),
            ("bar.sync", Barrier),
            ("membar.gl", Barrier),
            ("mov.b32", Move),
            ("shfl.sync.bfly.b32", Move),
            ("fma.rn.f32", Arithmetic),
        ] {
            assert_eq!(kinds(text, "k"), [kind], "{text}");
        }
        assert!(kinds("prefetch.global.L2", "k").is_empty());
    }
}
