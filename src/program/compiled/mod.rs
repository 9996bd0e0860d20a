//! Properties of a compiled kernel: registers, spills, bytes of memory, and the address spaces that its
//! instructions access.
//!
//! The sizes of work-groups and of memory come from the driver. Registers, spills, the stack and a second
//! number of bytes of `__local` memory come from the build log, if the log states them. Memory instructions
//! come from the program's binary, if the binary is PTX text. An unknown property is `None`.

mod log;
pub(crate) mod ptx;

pub use log::{Resources, resources};
pub use ptx::{InstructionCounts, instruction_counts, is_ptx};

use crate::device::occupancy::{multiprocessor, occupancy};
use ocl::Kernel;
use ocl::enums::{KernelWorkGroupInfo as Query, KernelWorkGroupInfoResult as Answer};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Properties of one compiled kernel. An unknown property is null.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct CompiledKernel {
    /// The kernel's name in the source.
    pub name: String,
    /// The largest number of work-items per work-group with which the kernel can run.
    pub work_group_size: Option<u64>,
    /// The driver prefers local sizes that are multiples of this number: the size of a warp or of a vector.
    pub preferred_multiple: Option<u64>,
    /// Bytes of `__local` memory per work-group, as reported by the driver.
    pub local_bytes: Option<u64>,
    /// Bytes of private memory per work-item outside registers, as reported by the driver.
    pub private_bytes: Option<u64>,
    /// Registers and spills from the build log.
    #[serde(flatten)]
    pub resources: Resources,
    /// The kernel's memory instructions, counted in the program's binary; null if the binary is not PTX.
    #[serde(rename = "census")]
    pub instruction_counts: Option<InstructionCounts>,
    /// Predicted number of work-groups that a multiprocessor holds at once.
    pub resident_groups: Option<u64>,
    /// The predicted occupancy, from 0 to 1: the number of warps that a multiprocessor holds at once, divided
    /// by the largest number that it can hold.
    pub occupancy: Option<f64>,
    /// The limit that prevents a multiprocessor from holding more work-groups.
    pub occupancy_limited_by: Option<String>,
}

impl CompiledKernel {
    /// Collects the properties of a kernel from the driver, from the build log `log`, and from `ptx`. `ptx`
    /// is the program's binary if this binary is PTX, and is empty otherwise.
    pub fn of(kernel: &Kernel, device: ocl::Device, log: &str, ptx: &str) -> Self {
        let name = kernel.name().unwrap_or_default();
        let ask = |query| number(kernel.wg_info(device, query).ok()?);
        Self {
            work_group_size: ask(Query::WorkGroupSize),
            preferred_multiple: ask(Query::PreferredWorkGroupSizeMultiple),
            local_bytes: ask(Query::LocalMemSize),
            private_bytes: ask(Query::PrivateMemSize),
            resources: resources(log, &name),
            instruction_counts: instruction_counts(ptx, &name),
            name,
            ..Self::default()
        }
    }

    /// Adds to this kernel's properties the predicted number of work-groups that a multiprocessor can hold at once, the
    /// occupancy, and the limit that determines this occupancy. `items` is the number of work-items of a work-group.
    /// The compute capability determines the limits of the device's multiprocessors. Adds no properties if the number
    /// of registers is unknown, or if raycl does not know the compute capability.
    #[must_use]
    pub fn predicted(mut self, compute_capability: Option<&str>, items: u32) -> Self {
        let sm = compute_capability.and_then(|name| multiprocessor(name).ok());
        if let (Some(sm), Some(registers)) = (sm, self.resources.registers) {
            let predicted = occupancy(sm, registers, self.group_local_bytes(), items);
            self.resident_groups = Some(predicted.groups);
            self.occupancy = Some(predicted.fraction);
            self.occupancy_limited_by = Some(predicted.limiter.to_string());
        }
        self
    }

    /// Returns the bytes of `__local` memory per work-group: the build log's number, else the driver's, else
    /// 0.
    pub fn group_local_bytes(&self) -> u64 {
        self.known_local_bytes().unwrap_or(0)
    }

    /// Returns the bytes of `__local` memory per work-group: the build log's number, else the driver's; `None` if
    /// neither is known.
    pub fn known_local_bytes(&self) -> Option<u64> {
        self.resources.shared_bytes.or(self.local_bytes)
    }
}

fn number(answer: Answer) -> Option<u64> {
    match answer {
        Answer::WorkGroupSize(n) | Answer::PreferredWorkGroupSizeMultiple(n) => Some(n as u64),
        Answer::LocalMemSize(n) | Answer::PrivateMemSize(n) => Some(n),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kernel(registers: Option<u32>) -> CompiledKernel {
        let resources = Resources { registers, ..Resources::default() };
        CompiledKernel {
            name: "cast_frame".into(),
            local_bytes: Some(6912),
            resources,
            ..CompiledKernel::default()
        }
    }

    #[test]
    fn occupancy_follows_from_registers_and_local_bytes() {
        let made = kernel(Some(168)).predicted(Some("9.0"), 64);
        assert_eq!((made.resident_groups, made.occupancy), (Some(6), Some(12.0 / 64.0)));
        assert_eq!(made.occupancy_limited_by.as_deref(), Some("registers"));
        assert_eq!(kernel(None).predicted(Some("9.0"), 64).occupancy, None);
        assert_eq!(kernel(Some(40)).predicted(Some("99.0"), 64).occupancy, None);
        assert_eq!(kernel(Some(40)).predicted(None, 64).occupancy, None);
    }

    #[test]
    fn a_line_of_json_holds_all_and_an_older_one_less() {
        let made = kernel(Some(40)).predicted(Some("9.0"), 256);
        let line = serde_json::to_string(&made).unwrap();
        assert!(line.contains("\"registers\":40"), "{line}");
        assert_eq!(serde_json::from_str::<CompiledKernel>(&line).unwrap(), made);
        assert_eq!(serde_json::from_str::<CompiledKernel>(r#"{"name":"a"}"#).unwrap().name, "a");
    }

    #[test]
    fn local_bytes_that_the_compiler_printed_go_before_the_drivers() {
        let mut made = kernel(Some(40));
        assert_eq!(made.group_local_bytes(), 6912);
        made.resources.shared_bytes = Some(1024);
        assert_eq!(made.group_local_bytes(), 1024);
        let unknown = CompiledKernel::default();
        assert_eq!((unknown.known_local_bytes(), unknown.group_local_bytes()), (None, 0));
    }
}
