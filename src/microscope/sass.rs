//! Reads kernels from SASS, the machine code of NVIDIA's GPUs. `ptxas` translates PTX to SASS, and
//! `nvdisasm` prints the SASS:
//!
//! ```text
//! .text.cast_frame:
//!         //## File "/tmp/kernel.cl", line 12
//!         /*0010*/              @!P0 LDG.E R2, desc[UR4][R2.64] ;
//! .L_x_1:
//!         ...
//! $cast_frame$helper:
//! ```
//!
//! A label with two dollar signs begins a function that the kernel calls.
//!
//! The SASS that raycl shows comes from the installed `ptxas`. The driver has its own assembler, which may generate
//! different SASS for the program that raycl times.

use super::code::{Code, Instruction, opcode};
use super::kind::{Kind, Memory};
use super::tool::{Folder, Tool};

/// The SASS of some kernels, and the output of ptxas.
pub struct Assembled {
    /// The kernels' instructions.
    pub codes: Vec<Code>,
    /// The messages of ptxas, which state how many registers each kernel uses.
    pub log: String,
}

/// Assembles PTX and reads the kernels with the names in `kernels` from the result. `file` is the name of the
/// source file; line numbers of other files are ignored. The error says why the SASS cannot be read.
pub fn codes(ptx: &str, kernels: &[&str], file: &str) -> Result<Assembled, String> {
    let both = Tool::find("ptxas").zip(Tool::find("nvdisasm"));
    let (ptxas, nvdisasm) = both.ok_or("ptxas and nvdisasm, of the CUDA toolkit, are not both on PATH")?;
    let target = target(ptx).ok_or("the PTX names no target")?;
    let folder = Folder::with("kernel.ptx", ptx.trim_end_matches('\0').as_bytes())?;
    let (gpu, out) = (format!("--gpu-name={target}"), "--output-file=kernel.cubin");
    let assembled = ptxas.run(&folder, &["--verbose", "--generate-line-info", &gpu, out, "kernel.ptx"])?;
    let listing = nvdisasm.run(&folder, &["--print-code", "--print-line-info", "kernel.cubin"])?;
    Ok(Assembled { codes: listed(&listing.stdout, kernels, file), log: assembled.stderr })
}

/// Returns the model of GPU for which PTX was generated: "sm_90" from ".target sm_90, texmode_independent".
fn target(ptx: &str) -> Option<&str> {
    let line = ptx.lines().find_map(|line| line.trim().strip_prefix(".target"))?;
    line.trim().split([',', ' ']).next().filter(|name| name.starts_with("sm_"))
}

fn listed(listing: &str, kernels: &[&str], file: &str) -> Vec<Code> {
    let code = |kernel: &&str| {
        let head = format!(".text.{kernel}:");
        let mut lines = listing.lines().skip_while(|line| line.trim() != head);
        lines.next()?;
        let body = lines.take_while(|line| !line.trim_start().starts_with(".section"));
        Some(Code { kernel: (*kernel).to_owned(), version: None, instructions: instructions(body, file) })
    };
    kernels.iter().filter_map(code).collect()
}

fn instructions<'a>(body: impl Iterator<Item = &'a str>, file: &str) -> Vec<Instruction> {
    let (mut line, mut part, mut instructions) = (None, String::new(), Vec::new());
    for text in body.map(str::trim) {
        if let Some(location) = text.strip_prefix("//## File ") {
            line = line_of(location, file);
        } else if let Some(label) = text.strip_suffix(':').filter(is_label) {
            label.clone_into(&mut part);
        } else if let Some(text) = instruction(text) {
            instructions.push(Instruction {
                text: text.to_owned(),
                line,
                part: part.clone(),
                kinds: kinds(text),
            });
        }
    }
    instructions
}

/// Returns true if a text before a colon is a label: ".L_x_1", or "$cast_frame$helper" for a function.
fn is_label(text: &&str) -> bool {
    text.starts_with(".L") || text.starts_with('$')
}

/// Returns the source line that a location names; `None` for files other than `file`. The line is 12 for
/// `"/tmp/kernel.cl", line 12 inlined at "/tmp/kernel.cl", line 30`.
fn line_of(location: &str, file: &str) -> Option<u32> {
    let (path, rest) = location.strip_prefix('"')?.split_once('"')?;
    let number = rest.strip_prefix(", line ")?.split(' ').next()?.parse().ok()?;
    // Line 0 means that the instruction belongs to no source line.
    (path.rsplit('/').next() == Some(file)).then_some(number).filter(|number| *number > 0)
}

/// Returns the text of an instruction: "@!P0 LDG.E R2, [R2]" from the line "/*0010*/  @!P0 LDG.E R2, [R2] ;". Returns
/// `None` if the line has no instruction.
fn instruction(line: &str) -> Option<&str> {
    let (address, text) = line.strip_prefix("/*")?.split_once("*/")?;
    let is_address = !address.is_empty() && address.bytes().all(|byte| byte.is_ascii_hexdigit());
    let text = text.split("/*").next()?.trim().trim_end_matches(';').trim_end();
    (is_address && !text.is_empty()).then_some(text)
}

/// Returns true if an instruction is a multiply-add whose two factors are 0 ("IMAD.MOV.U32 R2, RZ, RZ, R1"). `ptxas`
/// uses such an instruction in place of `MOV`, since it copies the summand. A multiply-add with `.X` also adds a
/// carry, so it is not a copy.
fn multiplies_zeros(text: &str) -> bool {
    let opcode = opcode(text);
    let multiplies = opcode.starts_with("IMAD") || opcode.starts_with("HFMA2");
    let mut factors = text.split(',').skip(1).take(2).map(str::trim);
    multiplies && !opcode.contains(".X") && factors.all(|factor| factor.trim_start_matches('-') == "RZ")
}

fn kinds(text: &str) -> Vec<Kind> {
    if multiplies_zeros(text) {
        return vec![Kind::Move];
    }
    vec![match opcode(text).split('.').next().unwrap_or_default() {
        // `LDGSTS` copies from global to shared memory.
        "LDGSTS" => return vec![Kind::Load(Memory::Global), Kind::Store(Memory::Local)],
        "LDG" => Kind::Load(Memory::Global),
        "STG" => Kind::Store(Memory::Global),
        "LDS" | "LDSM" => Kind::Load(Memory::Local),
        "STS" => Kind::Store(Memory::Local),
        "LDL" => Kind::Load(Memory::Private),
        "STL" => Kind::Store(Memory::Private),
        // `LDC`, `ULDC` and `LDCU` also load the kernel's arguments, which are in constant memory.
        "LDC" | "ULDC" | "LDCU" => Kind::Load(Memory::Constant),
        "LD" => Kind::Load(Memory::Generic),
        "ST" => Kind::Store(Memory::Generic),
        "ATOMG" | "RED" | "REDG" => Kind::Atomic(Memory::Global),
        "ATOMS" => Kind::Atomic(Memory::Local),
        "ATOM" => Kind::Atomic(Memory::Generic),
        "BRA" | "BRX" | "JMP" | "EXIT" | "RET" | "BSSY" | "BSYNC" | "BREAK" => Kind::Branch,
        "CALL" => Kind::Call,
        "BAR" | "MEMBAR" | "FENCE" | "WARPSYNC" | "DEPBAR" => Kind::Barrier,
        "MOV" | "UMOV" | "S2R" | "S2UR" | "CS2R" | "R2UR" | "SHFL" => Kind::Move,
        "NOP" => return Vec::new(),
        _ => Kind::Arithmetic,
    }]
}

#[cfg(test)]
mod tests {
    use super::*;

    const LISTING: &str = r#"
	.section	.text.other,"ax",@progbits
.text.other:
        /*0000*/                   EXIT ;
	.section	.text.mine,"ax",@progbits
	.align	128
.text.mine:
	//## File "/tmp/x/kernel.cl", line 3
        /*0000*/                   LDC R1, c[0x0][0x28] ;
	//## File "/tmp/x/kernel.cl", line 9 inlined at "/tmp/x/kernel.cl", line 3
        /*0010*/               @P0 LDG.E R2, desc[UR4][R2.64] ;
.L_x_0:
	//## File "/usr/lib/other.h", line 3
        /*0020*/                   FFMA R3, R2, R2, R3 ;
        /*0030*/                   STS [R4], R3 ;
        /*0040*/              @!P0 BRA `(.L_x_0) ;
        /*0050*/                   NOP;
	//## File "/tmp/x/kernel.cl", line 0
        /*0060*/                   EXIT ;
	.section	.debug_line,"",@progbits
        /*0070*/                   LDL R1, [R1] ;
"#;

    #[test]
    fn a_listing_is_read_kernel_by_kernel_with_lines() {
        let codes = listed(LISTING, &["mine", "missing"], "kernel.cl");
        assert_eq!(codes.len(), 1);
        let actual: Vec<_> = codes[0]
            .instructions
            .iter()
            .map(|one| (opcode(&one.text), one.line, one.part.as_str(), one.kinds.first().copied()))
            .collect();
        let expected = [
            ("LDC", Some(3), "", Some(Kind::Load(Memory::Constant))),
            ("LDG.E", Some(9), "", Some(Kind::Load(Memory::Global))),
            ("FFMA", None, ".L_x_0", Some(Kind::Arithmetic)),
            ("STS", None, ".L_x_0", Some(Kind::Store(Memory::Local))),
            ("BRA", None, ".L_x_0", Some(Kind::Branch)),
            ("NOP", None, ".L_x_0", None),
            ("EXIT", None, ".L_x_0", Some(Kind::Branch)),
        ];
        assert_eq!(actual, expected);
    }

    #[test]
    fn a_function_that_a_kernel_calls_is_a_part_of_it() {
        let helper = "$mine$helper:\n        /*0070*/                   RET.REL.NODEC R20 `(mine) ;\n";
        let section = "\t.section\t.debug_line";
        let codes = listed(&LISTING.replace(section, &format!("{helper}{section}")), &["mine"], "kernel.cl");
        let parts: Vec<_> = codes[0].instructions.iter().map(|one| one.part.as_str()).collect();
        assert_eq!(parts, [vec![""; 2], vec![".L_x_0"; 5], vec!["$mine$helper"]].concat());
    }

    #[test]
    fn the_target_is_the_gpu_that_the_driver_compiled_for() {
        assert_eq!(target(".version 8.8\n.target sm_90, texmode_independent"), Some("sm_90"));
        assert_eq!(target(".target   compute_90"), None);
    }

    #[test]
    fn each_kind_of_instruction_is_known_by_its_first_word() {
        use Kind::{Arithmetic, Atomic, Barrier, Branch, Call, Load, Move, Store};
        use Memory::{Constant, Generic, Global, Local, Private};
        for (text, kind) in [
            ("LDG.E.64 R2, [R2]", Load(Global)),
            ("STG.E [R2], R3", Store(Global)),
            ("LDS R2, [R2]", Load(Local)),
            ("STS [R2], R3", Store(Local)),
            ("LDL R2, [R1]", Load(Private)),
            ("STL [R1], R2", Store(Private)),
            ("ULDC UR4, c[0x0][0x20]", Load(Constant)),
            ("LD.E R2, [R2]", Load(Generic)),
            ("ST.E [R2], R3", Store(Generic)),
            ("ATOMG.E.ADD PT, R2, [R2], R3", Atomic(Global)),
            ("RED.E.ADD [R2], R3", Atomic(Global)),
            ("ATOMS.ADD R2, [R2], R3", Atomic(Local)),
            ("ATOM.E.ADD PT, R2, [R2], R3", Atomic(Generic)),
            ("@!P0 BRA `(.L_x_0)", Branch),
            ("CALL.REL.NOINC `(f)", Call),
            ("BAR.SYNC.DEFER_BLOCKING 0x0", Barrier),
            ("MOV R1, R2", Move),
            ("@P0 IMAD.MOV.U32 R2, RZ, RZ, R1", Move),
            ("IMAD.U32 R2, RZ, RZ, UR4", Move),
            ("HFMA2.MMA R3, -RZ, RZ, 0, 0", Move),
            ("IMAD.X R2, RZ, RZ, R3, P0", Arithmetic),
            ("IMAD R2, R3, RZ, R4", Arithmetic),
            ("FFMA R1, R2, R3, R4", Arithmetic),
        ] {
            assert_eq!(kinds(text), [kind], "{text}");
        }
        let copies = kinds("LDGSTS.E.128 [R5], [R2.64]");
        assert_eq!(copies, [Load(Global), Store(Local)]);
        assert!(kinds("NOP").is_empty());
    }
}
