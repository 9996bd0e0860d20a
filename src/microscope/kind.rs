//! The kinds of instructions: what an instruction does, and which memory it accesses.

use serde::{Serialize, Serializer};
use std::collections::BTreeMap;
use std::fmt::{self, Display};

/// A kind of memory, named as in OpenCL.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Memory {
    /// `__global`.
    Global,
    /// `__local`: the memory of a work-group.
    Local,
    /// The address space `__constant`, and constants that the compiler stored in the program.
    Constant,
    /// Private memory outside registers: arrays and spilled registers. On a CPU, an access to the stack is
    /// `Private` if the instruction states the address relative to the stack pointer or the frame pointer.
    Private,
    /// The memory that contains the kernel's arguments.
    Argument,
    /// The instruction's text does not show which memory is accessed, because this depends on an address that is
    /// known only when the instruction runs. On a CPU, all OpenCL address spaces are the same memory. All accesses on
    /// a CPU are therefore `Generic`, except `Private` accesses and accesses to constants of the program.
    Generic,
}

/// The kind of an instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// The instruction reads from the given memory.
    Load(Memory),
    /// The instruction writes to the given memory.
    Store(Memory),
    /// The instruction reads and writes the given memory in one atomic step.
    Atomic(Memory),
    /// The instruction computes, compares or converts numbers.
    Arithmetic,
    /// The instruction copies a value from register to register, possibly to other lanes, or sets a register.
    Move,
    /// The instruction branches: execution continues at another instruction.
    Branch,
    /// The instruction calls a function.
    Call,
    /// The instruction waits for other work-items, or keeps accesses to memory in order.
    Barrier,
}

impl Memory {
    /// Returns the memory's name, such as "global".
    pub fn name(self) -> &'static str {
        match self {
            Self::Global => "global",
            Self::Local => "local",
            Self::Constant => "constant",
            Self::Private => "private",
            Self::Argument => "argument",
            Self::Generic => "generic",
        }
    }
}

impl Kind {
    /// Returns the memory that the instruction accesses; `None` if it accesses no memory.
    pub fn memory(self) -> Option<Memory> {
        match self {
            Self::Load(memory) | Self::Store(memory) | Self::Atomic(memory) => Some(memory),
            _ => None,
        }
    }
}

impl Display for Kind {
    /// Formats the kind of an instruction, such as "load global" or "branch".
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let verb = match self {
            Self::Load(_) => "load",
            Self::Store(_) => "store",
            Self::Atomic(_) => "atomic",
            Self::Arithmetic => "arithmetic",
            Self::Move => "move",
            Self::Branch => "branch",
            Self::Call => "call",
            Self::Barrier => "barrier",
        };
        f.write_str(verb)?;
        self.memory().map_or(Ok(()), |memory| write!(f, " {}", memory.name()))
    }
}

impl Serialize for Kind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Numbers of instructions by kind. An instruction can count as several kinds: an instruction that adds a number
/// from memory counts as a load and as arithmetic.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Counts(BTreeMap<Kind, u32>);

impl Counts {
    /// Counts an instruction that does the given kinds of work.
    pub fn add(&mut self, kinds: &[Kind]) {
        for kind in kinds {
            *self.0.entry(*kind).or_default() += 1;
        }
    }

    /// Returns the number of instructions of a kind.
    pub fn of(&self, kind: Kind) -> u32 {
        self.0.get(&kind).copied().unwrap_or(0)
    }

    /// Returns all counted kinds of instructions with their numbers; kinds that access memory come first.
    pub fn iter(&self) -> impl Iterator<Item = (Kind, u32)> {
        self.0.iter().map(|(kind, count)| (*kind, *count))
    }

    /// Returns the memories that the counted instructions access, in a fixed order.
    pub fn memories(&self) -> Vec<Memory> {
        let mut memories: Vec<Memory> = self.0.keys().filter_map(|kind| kind.memory()).collect();
        memories.sort_unstable();
        memories.dedup();
        memories
    }
}

impl Display for Counts {
    /// Formats the numbers of instructions as "load global 12, arithmetic 4".
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts: Vec<String> = self.iter().map(|(kind, count)| format!("{kind} {count}")).collect();
        f.write_str(&parts.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_kept_by_kind_and_named_in_json() {
        let mut counts = Counts::default();
        counts.add(&[Kind::Load(Memory::Global), Kind::Arithmetic]);
        counts.add(&[Kind::Store(Memory::Global)]);
        counts.add(&[Kind::Barrier]);
        let json = serde_json::to_string(&counts).expect("JSON");
        assert_eq!(json, r#"{"load global":1,"store global":1,"arithmetic":1,"barrier":1}"#);
        assert_eq!(counts.of(Kind::Store(Memory::Global)), 1);
        assert_eq!(counts.of(Kind::Call), 0);
        assert_eq!(counts.memories(), [Memory::Global]);
        assert_eq!(counts.to_string(), "load global 1, store global 1, arithmetic 1, barrier 1");
    }

    #[test]
    fn memories_are_in_a_fixed_order_whichever_instruction_accesses_them() {
        let mut counts = Counts::default();
        counts.add(&[
            Kind::Store(Memory::Generic),
            Kind::Atomic(Memory::Global),
            Kind::Load(Memory::Private),
        ]);
        counts.add(&[Kind::Load(Memory::Generic), Kind::Load(Memory::Local)]);
        assert_eq!(counts.memories(), [Memory::Global, Memory::Local, Memory::Private, Memory::Generic]);
        let names = [Memory::Constant, Memory::Argument].map(|memory| Kind::Load(memory).to_string());
        assert_eq!(names, ["load constant", "load argument"]);
        assert_eq!(
            [Kind::Atomic(Memory::Local), Kind::Move].map(|kind| kind.to_string()),
            ["atomic local", "move"]
        );
    }
}
