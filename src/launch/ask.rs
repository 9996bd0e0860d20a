//! Runs a kernel to find out which macros and built-in functions a device's compiler defines. OpenCL's own
//! functions list the names of extensions, but no other macros and no built-in functions.

use super::Queue;
use crate::error::{Error, Result};
use crate::program::preprocess::{Preprocessed, Value, preprocess};
use crate::program::{BuiltProgram, ProgramCache, ProgramSpec};
use ocl::{Buffer, Kernel, MemFlags};
use std::collections::BTreeMap;

/// Number of words in an answer. The first word has the value's bits; the second word is 1 if the value is unsigned,
/// otherwise 0.
const ANSWER_WORDS: usize = 2;

/// Preprocesses a program as the device's compiler would. If a condition (of `#if`, `#ifdef` and so on) uses a
/// name that neither the source nor the options define, a kernel is run to find out whether the compiler
/// defines the name, and with which value.
pub fn preprocess_for(queue: &Queue, spec: &ProgramSpec) -> Result<Preprocessed> {
    let mut given = BTreeMap::new();
    loop {
        // The value of a macro may enable a branch of the source in which a condition uses further macros. The
        // source is therefore preprocessed again after each round of questions.
        let text = preprocess(&spec.source, &spec.options, &given)?;
        if text.asked.is_empty() {
            return Ok(text);
        }
        let answers = ask(queue, &spec.options, &text.asked).map_err(|message| {
            Error::run(format!("cannot query the macros that the device's compiler defines: {message}"))
                .with_help("without --device, raycl treats these macros as undefined")
        })?;
        given.extend(text.asked.into_iter().zip(answers));
    }
}

/// Returns the compiler's answer to each question ([`Preprocessed::asked`]).
fn ask(queue: &Queue, options: &str, asked: &[String]) -> std::result::Result<Vec<Value>, String> {
    let questions: String = asked.iter().enumerate().map(|(at, asked)| question(at, asked)).collect();
    let source = format!("__kernel void ask(__global ulong *answer) {{\n{questions}}}\n");
    let spec = ProgramSpec { source, options: options.to_owned(), files: Vec::new() };
    let program = BuiltProgram::build(&queue.context, queue.device, &spec, &ProgramCache::default())
        .map_err(|error| error.to_string())?;
    let run = || -> ocl::Result<Vec<u64>> {
        let commands = queue.commands.clone();
        let answer = Buffer::<u64>::builder()
            .queue(commands.clone())
            .flags(MemFlags::READ_WRITE)
            .len(ANSWER_WORDS * asked.len())
            .fill_val(0)
            .build()?;
        let mut kernel = Kernel::builder();
        let kernel = kernel.program(&program.program).name("ask").queue(commands);
        let kernel = kernel.global_work_size(1).arg(&answer).build()?;
        // SAFETY: the kernel's only argument is the buffer that its source declares, and the buffer has room
        // for one answer per element of `asked`.
        unsafe { kernel.enq()? };
        let mut words = vec![0; answer.len()];
        answer.read(&mut words).enq()?;
        Ok(words)
    };
    let words = run().map_err(|error| error.to_string())?;
    let value = |answer: &[u64]| Value { bits: answer[0], is_unsigned: answer[1] == 1 };
    Ok(words.chunks_exact(ANSWER_WORDS).map(value).collect())
}

/// Returns the source lines of a kernel that write the answer to the question `asked` as answer number `at`, from 0.
/// The answer to `defined(NAME)` and to `__has_builtin(NAME)` is 1 for yes and 0 for no. An empty macro has the value
/// 0, and so has a name that is not defined.
fn question(at: usize, asked: &str) -> String {
    let [bits, is_unsigned] = [0, 1].map(|word| format!("answer[{}]", ANSWER_WORDS * at + word));
    let yes = condition(asked, &format!("{bits} = 1"));
    if asked.starts_with("__has_builtin(") {
        return format!("#ifdef __has_builtin\n{yes}#endif\n");
    }
    if asked.starts_with("defined(") {
        return yes;
    }
    // The compiler's preprocessor computes the value, bit by bit. In a statement of the kernel, a macro such
    // as (1 << 31) would have another value, and the name of a macro with parameters would be an error.
    let bit =
        |bit: u32| condition(&format!("({asked} + 0) >> {bit} & 1"), &format!("{bits} |= 1UL << {bit}"));
    let bits: String = (0..u64::BITS).map(bit).collect();
    bits + &condition(&format!("({asked} + 0) * 0 - 1 > 0"), &format!("{is_unsigned} = 1"))
}

fn condition(condition: &str, statement: &str) -> String {
    format!("#if {condition}\n{statement};\n#endif\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::discover;
    use crate::program::Sources;

    #[test]
    fn a_question_compiles_for_an_empty_macro_and_where_no_built_in_function_can_be_asked_for() {
        // If the macro `A` is empty, `(A + 0)` becomes `(+ 0)`, which is 0. Without the sum, the condition would
        // have no value in its brackets.
        let lines: Vec<String> = question(2, "A").lines().map(str::to_owned).collect();
        assert_eq!(lines[..3], ["#if (A + 0) >> 0 & 1", "answer[4] |= 1UL << 0;", "#endif"]);
        assert_eq!(lines[3 * 63..3 * 64], ["#if (A + 0) >> 63 & 1", "answer[4] |= 1UL << 63;", "#endif"]);
        assert_eq!(lines[3 * 64..], ["#if (A + 0) * 0 - 1 > 0", "answer[5] = 1;", "#endif"]);
        assert_eq!(question(0, "defined(A)"), "#if defined(A)\nanswer[0] = 1;\n#endif\n");
        let of_function = "#if __has_builtin(f)\nanswer[2] = 1;\n#endif";
        assert_eq!(question(1, "__has_builtin(f)"), format!("#ifdef __has_builtin\n{of_function}\n#endif\n"));
    }

    #[test]
    fn a_compilers_macro_need_not_be_a_number_and_an_unsigned_one_is_not_negative() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let source = "#ifdef __VERSION__\ntext\n#endif\n#if ULONG_MAX > 0\nlarge\n#endif\n\
                      #if INT_MIN < 0 && NOBODY == 0\nsmall\n#endif\n#ifdef NOBODY\nno\n#endif\n";
        let spec = ProgramSpec { source: source.to_owned(), options: String::new(), files: Vec::new() };
        let text = preprocess_for(&Queue::open(&device).unwrap(), &spec).unwrap().text();
        assert_eq!(text, "text\nlarge\nsmall\n");
    }
}
