//! Reads a kernel's registers, spills and memory from a build log that NVIDIA's compiler printed with
//! `-cl-nv-verbose`:
//!
//! ```text
//! ptxas info    : Compiling entry function 'cast_frame' for 'sm_90'
//! ptxas info    : Function properties for cast_frame
//!     64 bytes stack frame, 12 bytes spill stores, 16 bytes spill loads
//! ptxas info    : Used 40 registers, used 1 barriers, 6912 bytes smem, 480 bytes cmem[0]
//! ```
//!
//! The driver prints this log only when it compiles the program, not when it takes the program from its own
//! cache.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The resources of a kernel, from its build log. A number that the log does not have is `None`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Resources {
    /// Number of registers per work-item, from the compiler's build log.
    pub registers: Option<u32>,
    /// Bytes of stack per work-item, from the compiler's build log.
    pub stack_bytes: Option<u64>,
    /// Bytes that the kernel stores when it spills registers to memory, from the compiler's build log.
    pub spill_store_bytes: Option<u64>,
    /// Bytes of spilled registers that the kernel loads again, from the compiler's build log.
    pub spill_load_bytes: Option<u64>,
    /// Bytes of `__local` memory per work-group, from the compiler's build log.
    pub shared_bytes: Option<u64>,
}

/// Returns the resources of `kernel`; a resource that the log does not state is `None`.
pub fn resources(log: &str, kernel: &str) -> Resources {
    let mut resources = Resources::default();
    let (mut entry, mut function) = (None, None);
    for line in log.lines() {
        if let Some(name) = between(line, "Compiling entry function '", '\'') {
            (entry, function) = (Some(name), Some(name));
        } else if let Some(name) = after(line, "Function properties for ") {
            function = Some(name);
        } else if entry == Some(kernel) {
            // The log states the stack of each function that a kernel calls, but registers only for the
            // kernel itself.
            let own = function.is_none_or(|name| name.trim_matches('\'') == kernel);
            if own {
                resources.read_stack(line);
            }
            resources.read_use(line);
        }
    }
    resources
}

impl Resources {
    fn read_stack(&mut self, line: &str) {
        let read = |field: &mut Option<u64>, what| *field = number_before(line, what).or(*field);
        read(&mut self.stack_bytes, " bytes stack frame");
        read(&mut self.spill_store_bytes, " bytes spill stores");
        read(&mut self.spill_load_bytes, " bytes spill loads");
    }

    fn read_use(&mut self, line: &str) {
        let Some(registers) = number_before(line, " registers") else { return };
        self.registers = u32::try_from(registers).ok();
        self.shared_bytes = number_before(line, " bytes smem");
    }
}

fn after<'a>(line: &'a str, words: &str) -> Option<&'a str> {
    line.split_once(words).map(|(_, rest)| rest.trim())
}

fn between<'a>(line: &'a str, words: &str, end: char) -> Option<&'a str> {
    after(line, words)?.split(end).next()
}

/// Returns the number before the given words in a line of the log; `None` if the line lacks the words or the
/// number. "24+16 bytes smem", the form of older compilers, counts as the sum, 40.
fn number_before(line: &str, words: &str) -> Option<u64> {
    let (before, _) = line.split_once(words)?;
    let number = before.rsplit(|c: char| !c.is_ascii_digit() && c != '+').next()?;
    number.split('+').filter_map(|part| part.parse::<u64>().ok()).reduce(|sum, part| sum + part)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOG: &str = "
ptxas info    : 0 bytes gmem
ptxas info    : Compiling entry function 'shade_nearest' for 'sm_90'
ptxas info    : Function properties for shade_nearest
ptxas         .     0 bytes stack frame, 0 bytes spill stores, 0 bytes spill loads
ptxas info    : Used 63 registers, 448 bytes cmem[0], 24 bytes cmem[2]
ptxas info    : Compile time = 12.3 ms
ptxas info    : Compiling entry function 'cast_frame' for 'sm_90'
ptxas info    : Function properties for cast_frame
    64 bytes stack frame, 12 bytes spill stores, 16 bytes spill loads
ptxas info    : Function properties for helper
    999 bytes stack frame, 99 bytes spill stores, 99 bytes spill loads
ptxas info    : Used 168 registers, used 1 barriers, 6912 bytes smem, 480 bytes cmem[0]
";

    #[test]
    fn a_log_is_read_kernel_by_kernel() {
        let expected = Resources {
            registers: Some(168),
            stack_bytes: Some(64),
            spill_store_bytes: Some(12),
            spill_load_bytes: Some(16),
            shared_bytes: Some(6912),
        };
        assert_eq!(resources(LOG, "cast_frame"), expected);
        let shade = resources(LOG, "shade_nearest");
        assert_eq!((shade.registers, shade.stack_bytes, shade.shared_bytes), (Some(63), Some(0), None));
    }

    #[test]
    fn other_logs_tell_nothing() {
        for log in ["", "\n", "warning: unused variable 'registers'", "Device is not compute 9.0"] {
            assert_eq!(resources(log, "cast_frame"), Resources::default());
        }
        assert_eq!(resources(LOG, "cast_fram"), Resources::default());
        assert_eq!(number_before("Used 20 registers, 24+16 bytes smem", " bytes smem"), Some(40));
    }

    #[test]
    fn words_are_found_where_they_occur_first() {
        assert_eq!(after("a for b for c", "for"), Some("b for c"));
        assert_eq!(after("a", "for"), None);
        assert_eq!(between("entry 'a' for 'b'", "entry '", '\''), Some("a"));
    }
}
