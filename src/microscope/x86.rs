//! Determines the kinds of x86-64 instructions from the text that `objdump` prints. In this text, the
//! destination is the last operand of an instruction.

use super::kind::{Kind, Memory};

/// Prefixes of x86 instructions. objdump prints prefixes before the instruction's name.
pub(super) const PREFIXES: [&str; 12] =
    ["lock", "rep", "repz", "repnz", "bnd", "notrack", "data16", "cs", "ds", "addr32", "{evex}", "{vex}"];
/// Beginnings of the names of instructions that count as no [`Kind`], since they neither compute nor copy a value
/// for the kernel: padding, marks of branch targets, traps, `vzeroupper` and prefetches. The names in this
/// list and in the lists below lack the `v` with which the names of AVX instructions begin.
const FILLERS: [&str; 6] = ["nop", "endbr", "zero", "int3", "ud2", "prefetch"];
/// Beginnings of the names of instructions that copy values, possibly between lanes.
const MOVES: [&str; 30] = [
    "mov",
    "cmov",
    "kmov",
    "pmov",
    "maskmov",
    "pmaskmov",
    "stos",
    "shuf",
    "pshuf",
    "perm",
    "unpck",
    "punpck",
    "blend",
    "pblend",
    "align",
    "palign",
    "broadcast",
    "pbroadcast",
    "insert",
    "pinsr",
    "extract",
    "pextr",
    "gather",
    "pgather",
    "scatter",
    "pscatter",
    "compress",
    "pcompress",
    "expand",
    "pexpand",
];
/// Beginnings of the names of instructions that only read their last operand, if it is memory. Four instructions
/// whose names begin in this way also write to the memory: `cmpxchg`, `bts`, `btr` and `btc`.
const READERS: [&str; 11] =
    ["cmp", "test", "ucomis", "comis", "ptest", "bt", "div", "idiv", "mul", "imul", "fld"];
/// Beginnings of the names of instructions that write their last operand but do not read the operand. The
/// instructions in `MOVES` also write their last operand without reading it, but `WRITERS` does not repeat
/// them.
const WRITERS: [&str; 3] = ["set", "cvt", "stmxcsr"];

/// Returns the kinds of work that an instruction does. `frames` are the registers besides `%rsp` that contain
/// the address of the function's stack frame.
pub fn kinds(text: &str, frames: &[&str]) -> Vec<Kind> {
    let mut words = text.split_whitespace();
    let name = words.by_ref().find(|word| !PREFIXES.contains(word)).unwrap_or_default();
    let name = name.strip_prefix('v').unwrap_or(name);
    let rest = words.collect::<Vec<_>>().join(" ");
    let is = |beginnings: &[&str]| beginnings.iter().any(|start| name.starts_with(start));
    if name.is_empty() || is(&FILLERS) || text.starts_with("xchg   %ax,%ax") {
        return Vec::new();
    }
    if let Some(kinds) = kinds_by_name(name, &rest, frames) {
        return kinds;
    }
    let operands = operands(&rest);
    let memories: Vec<Option<Memory>> = operands.iter().map(|operand| memory(operand, frames)).collect();
    let moves = is(&MOVES);
    let only_reads = is(&READERS) && !is(&["cmpxchg", "bts", "btr", "btc"]);
    let mut kinds = Vec::new();
    for (index, memory) in memories.iter().enumerate() {
        let Some(memory) = *memory else { continue };
        let last = index + 1 == memories.len();
        if last && !only_reads && (text.starts_with("lock") || name.starts_with("xchg")) {
            kinds.push(Kind::Atomic(memory));
            continue;
        }
        let written = last && !only_reads;
        if !written || !(moves || is(&WRITERS)) {
            kinds.push(Kind::Load(memory));
        }
        if written {
            kinds.push(Kind::Store(memory));
        }
    }
    if !moves {
        kinds.push(Kind::Arithmetic);
    } else if kinds.is_empty() {
        kinds.push(Kind::Move);
    }
    kinds
}

/// Returns the kinds of work of an instruction that can be classified without telling source and destination
/// apart, such as a branch; `None` for any other instruction. `operand` is one text, which contains all
/// operands of the instruction.
fn kinds_by_name(name: &str, operand: &str, frames: &[&str]) -> Option<Vec<Kind>> {
    Some(match name {
        // `push` and `pop` copy between the stack and their operand, which may be memory. `leave` has no operand, and
        // loads `%rbp` from the stack.
        "push" | "pushq" => {
            let read = memory(operand, frames).map(Kind::Load);
            read.into_iter().chain([Kind::Store(Memory::Private)]).collect()
        }
        "pop" | "popq" | "leave" => {
            let written = memory(operand, frames).map(Kind::Store);
            [Kind::Load(Memory::Private)].into_iter().chain(written).collect()
        }
        "call" | "callq" => vec![Kind::Call],
        "ret" | "retq" | "hlt" => vec![Kind::Branch],
        "mfence" | "lfence" | "sfence" => vec![Kind::Barrier],
        _ if name.starts_with('j') => vec![Kind::Branch],
        // The operand of `lea` looks like an access to memory, but `lea` only computes the address.
        _ if name.starts_with("lea") => vec![Kind::Arithmetic],
        _ => return None,
    })
}

/// Splits an instruction's operands at the commas that are not in brackets.
fn operands(text: &str) -> Vec<&str> {
    let (mut operands, mut depth, mut start) = (Vec::new(), 0_u32, 0);
    for (at, c) in text.char_indices() {
        match c {
            '(' => depth += 1,
            ')' => depth = depth.saturating_sub(1),
            ',' if depth == 0 => {
                operands.push(&text[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    operands.push(&text[start..]);
    operands
}

/// Returns which memory an operand such as `-0x8(%rsp,%rax,4)` addresses; `None` for registers and numbers.
fn memory(operand: &str, frames: &[&str]) -> Option<Memory> {
    let (_, inside) = operand.split_once('(')?;
    let base = inside.split([',', ')']).next().unwrap_or_default();
    Some(match base {
        "%rsp" => Memory::Private,
        _ if frames.contains(&base) => Memory::Private,
        "%rip" => Memory::Constant,
        _ => Memory::Generic,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn operands_say_which_memory_is_read_and_which_is_written() {
        use Kind::{Arithmetic, Atomic, Branch, Call, Load, Move, Store};
        use Memory::{Constant, Generic, Private};
        for (text, expected) in [
            ("mov    (%rdi),%rax", &[Load(Generic)][..]),
            ("vmovss %xmm4,(%r8,%rcx,4)", &[Store(Generic)]),
            ("vmovaps %xmm8,%xmm4", &[Move]),
            ("movl   $0x0,0x1c(%rsp)", &[Store(Private)]),
            ("vmulps 0x20(%rsp),%ymm1,%ymm2", &[Load(Private), Arithmetic]),
            ("vinsertps $0x20,0xe4a(%rip),%xmm0,%xmm6", &[Load(Constant)]),
            ("add    %eax,0x8(%rdx)", &[Load(Generic), Store(Generic), Arithmetic]),
            ("lock xadd %eax,(%rdx)", &[Atomic(Generic), Arithmetic]),
            ("lock cmpxchg %edx,(%rax)", &[Atomic(Generic), Arithmetic]),
            ("lock bts %eax,(%rdx)", &[Atomic(Generic), Arithmetic]),
            ("btrl   $0x3,(%rdx)", &[Load(Generic), Store(Generic), Arithmetic]),
            ("btc    %eax,(%rdx)", &[Load(Generic), Store(Generic), Arithmetic]),
            ("bt     %eax,(%rdx)", &[Load(Generic), Arithmetic]),
            ("mfence", &[Kind::Barrier]),
            ("cmpl   $0x1,(%rax)", &[Load(Generic), Arithmetic]),
            ("lea    (%rsi,%rdx,1),%rdi", &[Arithmetic]),
            ("vfmadd231ss -0x8(%rbp),%xmm1,%xmm2", &[Load(Private), Arithmetic]),
            ("vgatherdps %ymm1,(%rax,%ymm2,4),%ymm3", &[Load(Generic)]),
            ("vpscatterdd %zmm0,(%rax,%zmm1,4){%k1}", &[Store(Generic)]),
            ("vscatterdps %zmm0,(%rax,%zmm1,4){%k1}", &[Store(Generic)]),
            ("vcompressps %zmm0,(%rax){%k1}", &[Store(Generic)]),
            ("vpcompressd %zmm0,%zmm1{%k1}{z}", &[Move]),
            ("vexpandps (%rax),%zmm0{%k1}{z}", &[Load(Generic)]),
            ("vpexpandd %zmm0,%zmm1{%k1}{z}", &[Move]),
            ("kmovw  %eax,%k1", &[Move]),
            ("kmovw  (%rax),%k1", &[Load(Generic)]),
            ("push   %rbp", &[Store(Private)]),
            ("push   0x298(%rbx)", &[Load(Generic), Store(Private)]),
            ("pop    %rbp", &[Load(Private)]),
            ("pop    (%rax)", &[Load(Private), Store(Generic)]),
            ("leave", &[Load(Private)]),
            ("rep stos %rax,%es:(%rdi)", &[Store(Generic)]),
            ("{evex} vmovups (%rax),%xmm1", &[Load(Generic)]),
            ("{vex} vpdpbusd %xmm1,%xmm2,%xmm3", &[Arithmetic]),
            ("jmp    1195 <_pocl_kernel_x_workgroup+0x65>", &[Branch]),
            ("call   1040 <sinf@plt>", &[Call]),
            ("data16 cs nopw 0x0(%rax,%rax,1)", &[]),
            ("vxorps %xmm5,%xmm5,%xmm5", &[Arithmetic]),
            ("ret", &[Branch]),
        ] {
            assert_eq!(kinds(text, &["%rbp"]), expected, "{text}");
        }
        assert_eq!(
            kinds("mov    -0x8(%rbp),%eax", &[]),
            [Load(Generic)],
            "if no frame register is given, %rbp is like any other register"
        );
    }

    #[test]
    fn shuffles_and_blends_are_moves_whatever_they_are_called() {
        use Kind::{Load, Move};
        for (text, expected) in [
            ("vpermilps $0x0,%xmm1,%xmm2", &[Move][..]),
            ("vshufps $0x0,%xmm1,%xmm1,%xmm2", &[Move]),
            ("vshuff64x2 $0x0,%zmm1,%zmm1,%zmm2", &[Move]),
            ("shufps $0x0,%xmm1,%xmm2", &[Move]),
            ("vpshufd $0x0,(%rax),%xmm2", &[Load(Memory::Generic)]),
            ("pshufb %xmm1,%xmm2", &[Move]),
            ("vunpcklps %xmm1,%xmm2,%xmm3", &[Move]),
            ("unpcklps %xmm1,%xmm2", &[Move]),
            ("vpunpckldq %xmm1,%xmm2,%xmm3", &[Move]),
            ("punpckldq %xmm1,%xmm2", &[Move]),
            ("vblendvps %xmm1,%xmm2,%xmm3,%xmm4", &[Move]),
            ("blendps $0x1,%xmm1,%xmm2", &[Move]),
            ("vpblendd $0x1,%xmm1,%xmm2,%xmm3", &[Move]),
            ("pblendw $0x1,%xmm1,%xmm2", &[Move]),
            ("valignd $0x1,%zmm1,%zmm2,%zmm3", &[Move]),
            ("vpalignr $0x1,%xmm1,%xmm2,%xmm3", &[Move]),
            ("palignr $0x1,%xmm1,%xmm2", &[Move]),
        ] {
            assert_eq!(kinds(text, &["%rbp"]), expected, "{text}");
        }
    }

    #[test]
    fn commas_within_brackets_separate_no_operands() {
        assert_eq!(operands("%eax"), ["%eax"]);
        assert_eq!(operands("-0x8(%rsp,%rax,4),%ymm1,(%rdx)"), ["-0x8(%rsp,%rax,4)", "%ymm1", "(%rdx)"]);
        assert_eq!(operands("$0x20,%xmm0,0x4(,%rax,2)"), ["$0x20", "%xmm0", "0x4(,%rax,2)"]);
    }
}
