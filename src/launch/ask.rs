//! Runs a kernel to find out which macros and built-in functions a device's compiler defines. OpenCL itself
//! reports only extensions.

use super::Queue;
use crate::error::{Error, Result};
use crate::program::preprocess::{Preprocessed, preprocess};
use crate::program::{BuiltProgram, ProgramCache, ProgramSpec};
use ocl::{Buffer, Kernel, MemFlags};
use std::collections::{BTreeMap, BTreeSet};

/// The kernel's answer for a name (of a macro or a built-in function) that the compiler does not define.
const ABSENT: i64 = i64::MIN;

/// Preprocesses a program as the device's compiler would. If the condition of an `#if` uses a name that
/// neither the source nor the options define, a kernel is run to find out whether the compiler defines the
/// name, and with which value.
pub fn preprocess_for(queue: &Queue, spec: &ProgramSpec) -> Result<Preprocessed> {
    let (mut given, mut absent) = (BTreeMap::new(), BTreeSet::new());
    loop {
        // The value of a macro may enable a branch of the source in which a condition uses further macros.
        let text = preprocess(&spec.source, &spec.options, &given)?;
        let asked: Vec<&String> = text.asked.iter().filter(|name| !absent.contains(*name)).collect();
        if asked.is_empty() {
            return Ok(text);
        }
        let answers = ask(queue, &spec.options, &asked).map_err(|message| {
            Error::run(format!("cannot query the macros that the device's compiler defines: {message}"))
                .with_help("without --device, raycl treats these macros as undefined")
        })?;
        for (name, answer) in asked.into_iter().zip(answers) {
            match answer {
                ABSENT => drop(absent.insert(name.clone())),
                value => drop(given.insert(name.clone(), value)),
            }
        }
    }
}

/// Returns one number for each name: the value of a macro, 1 for a built-in function that exists, or
/// [`ABSENT`] if the compiler does not define the name.
fn ask(queue: &Queue, options: &str, names: &[&String]) -> std::result::Result<Vec<i64>, String> {
    let questions: String = names.iter().enumerate().map(|(at, name)| question(at, name)).collect();
    let source = format!("__kernel void ask(__global long *answer) {{\n{questions}}}\n");
    let spec = ProgramSpec { source, options: options.to_owned(), files: Vec::new() };
    let program = BuiltProgram::build(&queue.context, queue.device, &spec, &ProgramCache::default())
        .map_err(|error| error.to_string())?;
    let run = || -> ocl::Result<Vec<i64>> {
        let commands = queue.commands.clone();
        let answer = Buffer::<i64>::builder()
            .queue(commands.clone())
            .flags(MemFlags::READ_WRITE)
            .len(names.len())
            .fill_val(ABSENT)
            .build()?;
        let mut kernel = Kernel::builder();
        let kernel = kernel.program(&program.program).name("ask").queue(commands);
        let kernel = kernel.global_work_size(1).arg(&answer).build()?;
        // SAFETY: the kernel's only argument is the buffer that its source declares, and the buffer has room
        // for one number per element of `names`.
        unsafe { kernel.enq()? };
        let mut values = vec![ABSENT; names.len()];
        answer.read(&mut values).enq()?;
        Ok(values)
    };
    run().map_err(|error| error.to_string())
}

/// Returns the source lines of a kernel that write the answer for the name `name` (a macro or a built-in
/// function) to `answer[at]`. An empty macro has the value 0.
fn question(at: usize, name: &str) -> String {
    if name.starts_with("__has_builtin(") {
        return format!("#ifdef __has_builtin\n#if {name}\nanswer[{at}] = 1;\n#endif\n#endif\n");
    }
    let value = if name == "__has_builtin" { "1".to_owned() } else { format!("({name} + 0)") };
    format!("#ifdef {name}\nanswer[{at}] = {value};\n#endif\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_question_compiles_for_an_empty_macro_and_where_no_built_in_function_can_be_asked_for() {
        // If the macro `A` is empty, `(A + 0)` becomes `(+ 0)`, which is 0. Without the sum, the source would
        // have no value between `=` and `;`.
        assert_eq!(question(2, "A"), "#ifdef A\nanswer[2] = (A + 0);\n#endif\n");
        assert_eq!(question(0, "__has_builtin"), "#ifdef __has_builtin\nanswer[0] = 1;\n#endif\n");
        let of_function = "#if __has_builtin(f)\nanswer[1] = 1;\n#endif";
        assert_eq!(question(1, "__has_builtin(f)"), format!("#ifdef __has_builtin\n{of_function}\n#endif\n"));
    }
}
