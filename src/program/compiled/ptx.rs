//! Counts memory instructions in PTX text, kernel by kernel: how many instructions load, store or change
//! memory of each address space. Each instruction in the text counts once, even in the body of a loop.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The numbers of memory instructions and of calls in the body of a kernel, and the size of its private arrays.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct InstructionCounts {
    /// Number of instructions by operation and address space: "ld.global", "st.shared", "ld.global.nc"
    /// (through the read-only cache), "atom.global"; "ld.generic" if the space is known only at run time.
    /// `ld.param` reads the kernel's arguments; `.local` is private memory outside registers.
    pub instructions: BTreeMap<String, u32>,
    /// Bytes per work-item of private arrays that are not in registers (the `.local` depot).
    pub private_array_bytes: u64,
    /// Number of function calls in the kernel; the instructions of the called functions are not counted.
    pub calls: u32,
}

impl InstructionCounts {
    /// Returns the number of instructions that access an address space ("global", "shared", "local", "const", "param",
    /// "generic").
    pub fn reach(&self, space: &str) -> u32 {
        let reaches = |name: &&String| name.split('.').nth(1) == Some(space);
        self.instructions.keys().filter(reaches).map(|name| self.instructions[name]).sum()
    }
}

impl std::fmt::Display for InstructionCounts {
    /// Formats the counts as "ld.global 12, st.global 4, private array 64 B, calls 1", without counts that are 0.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut parts: Vec<String> =
            self.instructions.iter().map(|(name, n)| format!("{name} {n}")).collect();
        parts.extend(
            (self.private_array_bytes > 0).then(|| format!("private array {} B", self.private_array_bytes)),
        );
        parts.extend((self.calls > 0).then(|| format!("calls {}", self.calls)));
        f.write_str(&parts.join(", "))
    }
}

/// Returns true if a program's binary is PTX text.
pub fn is_ptx(binary: &[u8]) -> bool {
    let head = String::from_utf8_lossy(&binary[..binary.len().min(4096)]);
    head.contains(".version") && head.contains(".target") && head.contains(".address_size")
}

/// Counts the memory instructions, the calls and the bytes of private arrays of the kernel or function
/// `name`. Returns `None` if the text has no such kernel or function, or has only its declaration.
pub fn instruction_counts(ptx: &str, name: &str) -> Option<InstructionCounts> {
    let text = without_comments(ptx);
    let body = body_of(&text, name)?;
    let mut counts = InstructionCounts::default();
    for statement in body.split([';', '{', '}']) {
        counts.count(statement);
    }
    Some(counts)
}

impl InstructionCounts {
    fn count(&mut self, statement: &str) {
        let mut words = statement.split_whitespace().skip_while(|word| is_label_or_predicate(word));
        let Some(opcode) = words.next() else { return };
        if opcode == ".local" {
            self.private_array_bytes += array_bytes(statement).unwrap_or(0);
        } else if opcode == "call" || opcode.starts_with("call.") {
            self.calls += 1;
        } else if let Some(name) = instruction(opcode) {
            *self.instructions.entry(name).or_default() += 1;
        }
    }
}

/// Returns true if a word is a label, such as "$L__BB0_2:", or a predicate, such as "@%p1" or "@!%p1".
fn is_label_or_predicate(word: &str) -> bool {
    word.ends_with(':') || word.starts_with('@')
}

/// Returns the name under which a memory instruction is counted: "ld.shared" for "ld.volatile.shared.v2.f32".
/// Returns `None` for instructions other than loads, stores and atomic operations.
pub(crate) fn instruction(opcode: &str) -> Option<String> {
    const SPACES: [&str; 5] = ["global", "shared", "local", "const", "param"];
    let mut parts = opcode.split('.');
    let verb = parts.next().filter(|verb| ["ld", "ldu", "st", "atom", "red"].contains(verb))?;
    let parts: Vec<&str> = parts.map(|part| part.split("::").next().unwrap_or(part)).collect();
    let space = SPACES.iter().find(|space| parts.contains(space)).unwrap_or(&"generic");
    let cached = if parts.contains(&"nc") { ".nc" } else { "" };
    Some(format!("{verb}.{space}{cached}"))
}

/// Returns the number of bytes of the array in a declaration such as ".local .align 8 .b8 __local_depot0[64]".
fn array_bytes(declaration: &str) -> Option<u64> {
    let count: u64 = declaration.split_once('[')?.1.split(']').next()?.trim().parse().ok()?;
    let bits = |word: &str| word.strip_prefix(['.'])?.strip_prefix(['b', 'f', 'u', 's'])?.parse::<u64>().ok();
    let bits = declaration.split_whitespace().find_map(bits).unwrap_or(8);
    Some(count * bits / 8)
}

/// Returns the text between the braces of the kernel `.entry name(...)` or of the function `.func (...)
/// name(...)`. Returns `None` if the text has no such kernel or function, or if the closing brace is missing.
/// Also returns `None` if the text has only a declaration of the kernel or function: a declaration has no
/// braces.
pub(crate) fn body_of<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    let heads = [".entry", ".func"].into_iter().flat_map(|word| text.match_indices(word));
    let body = heads.into_iter().find_map(|(at, word)| after_head(&text[at + word.len()..], name))?;
    let mut depth = 1_u32;
    for (at, c) in body.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth == 1 => return Some(&body[..at]),
            '}' => depth -= 1,
            _ => {}
        }
    }
    None
}

/// Returns the text after the first brace of "(.param .b32 result) name(.param .u64 p) {", the head of a function or a
/// kernel; `None` for another name and for a declaration.
fn after_head<'a>(head: &'a str, name: &str) -> Option<&'a str> {
    let tail = after_results(head)?.trim_start().strip_prefix(name)?.trim_start();
    let (before, body) = tail.split_once('{')?;
    (tail.starts_with(['(', '{', '.']) && !before.contains(';')).then_some(body)
}

/// Returns the part of `text` after the brackets at the start of `text`. The brackets contain the results of a
/// function. Returns the whole text if the text does not begin with a bracket, and `None` if the bracket is not closed.
pub(crate) fn after_results(text: &str) -> Option<&str> {
    match text.trim_start().strip_prefix('(') {
        Some(results) => results.split_once(')').map(|(_, after)| after),
        None => Some(text),
    }
}

pub(crate) fn without_comments(ptx: &str) -> String {
    let mut text = String::with_capacity(ptx.len());
    let mut rest = ptx;
    while let Some(at) = rest.find("/*") {
        text.push_str(&rest[..at]);
        rest = rest[at..].split_once("*/").map_or("", |(_, after)| after);
    }
    text.push_str(rest);
    let lines = text.lines().map(|line| line.split("//").next().unwrap_or_default());
    lines.collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    const PTX: &str = r"// a comment with ld.global.f32 in it
.version 8.8
.target sm_90, texmode_independent
.address_size 64
.func helper() { ld.local.f32 %f1, [%rd1]; ret; }
.entry cast_frame_2(.param .u64 p) { st.global.f32 [%rd1], %f1; }
.visible .entry cast_frame(
	.param .u64 .ptr .global .align 4 cast_frame_param_0
)
.reqntid 8, 8, 1
{
	.local .align 16 .b8 	__local_depot0[48];
	.reg .b64 %rd<4>;
	.shared .align 4 .b8 cast_frame_$_store[6912];
	ld.param.u64 	%rd1, [cast_frame_param_0];
$L__BB0_1:
	@!%p1 ld.volatile.global.v2.f32 	{%f1, %f2}, [%rd1+4];
	ld.global.nc.L1::evict_last.v4.f32 {%f1,%f2,%f3,%f4}, [%rd1]; st.shared::cta.f32 [%r1], %f1;
	/* ld.const.f32 %f9, [%rd9]; */
	atom.global.add.u32 %r1, [%rd1], 1;
	st.f32 [%rd2], %f1;
	{ .reg .b32 temp; call.uni (retval0), helper, (); }
	ld.const.f32 %f2, [%rd3]; // ld.local.f32
	bra $L__BB0_1;
}
";

    #[test]
    fn instructions_are_counted_by_space_in_one_kernel() {
        let kernel = instruction_counts(PTX, "cast_frame").expect("a kernel");
        let counts: Vec<_> = kernel.instructions.iter().map(|(name, n)| (name.as_str(), *n)).collect();
        let expected = [
            ("atom.global", 1),
            ("ld.const", 1),
            ("ld.global", 1),
            ("ld.global.nc", 1),
            ("ld.param", 1),
            ("st.generic", 1),
            ("st.shared", 1),
        ];
        assert_eq!(counts, expected);
        assert_eq!((kernel.private_array_bytes, kernel.calls), (48, 1));
        assert_eq!([kernel.reach("global"), kernel.reach("local")], [3, 0]);
    }

    #[test]
    fn what_is_not_ptx_has_no_counts() {
        assert!(is_ptx(PTX.as_bytes()));
        for binary in [&b""[..], b"\x7fELF", b"poclbin\0", &[0xff; 64]] {
            assert!(!is_ptx(binary));
        }
        assert_eq!(instruction_counts(PTX, "cast_fram"), None);
        assert_eq!(instruction_counts("", "cast_frame"), None);
        assert_eq!(instruction_counts(".entry cast_frame( {", "cast_frame"), None, "it is torn");
    }

    #[test]
    fn a_body_is_the_text_between_its_braces() {
        let text = ".entry other() { no } .entry name(.param .u64 p) .reqntid 8 { a { b } c } { d }";
        assert_eq!(body_of(text, "name"), Some(" a { b } c "));
        assert_eq!(body_of(".entry name{}", "name"), Some(""));
        let text = ".func name(.param .b32 p); .func (.param .b32 r) name2() { no } .func (.param .b32 r) name() { a }";
        assert_eq!(body_of(text, "name"), Some(" a "));
        assert_eq!(body_of(".func name(.param .b32 p); .entry other() { no }", "name"), None);
    }
}
