//! Runs kernels that a test builds from a few kernel files. The test compares the kernels' results with the results of
//! functions of the host.

use super::Queue;
use super::buffers::allocate;
use crate::device::discover;
use crate::program::Sources;
use ocl::builders::KernelBuilder;
use ocl::enums::{KernelWorkGroupInfo, KernelWorkGroupInfoResult};
use ocl::{Buffer, Kernel, OclPrm, Program};

/// A program that was built for the first device that raycl finds.
pub struct Alone {
    /// The queue of the device that runs the program.
    pub queue: Queue,
    program: Program,
}

impl Alone {
    /// Builds a program for the first device. The program's source consists of the text `before`, the kernel files
    /// that `files` names, and the text `after`. Usually, `before` defines macros that the kernel files need, and
    /// `after` has kernels that call functions of the kernel files. `options` are the compiler's options.
    pub fn of([before, after]: [&str; 2], files: &[&str], options: &str) -> Self {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let queue = Queue::open(&device).unwrap();
        let read = |name: &&str| Sources::Embedded.read_joined(name).unwrap().0;
        let source = [before, &files.iter().map(read).collect::<String>(), after].join("\n");
        let program =
            Program::builder().src(source).cmplr_opt(options).devices(queue.device).build(&queue.context);
        Self { program: program.unwrap(), queue }
    }

    /// Returns a builder for the kernel `name` of this program. The kernel will run with `items` work-items.
    pub fn kernel<'b>(&'b self, name: &str, items: usize) -> KernelBuilder<'b> {
        let mut builder = Kernel::builder();
        builder.program(&self.program).name(name).queue(self.queue.commands.clone()).global_work_size(items);
        builder
    }

    /// Runs the kernel that `kernel` makes, and returns the `len` results that the kernel writes. The
    /// function `kernel` gets the buffer into which the kernel writes its results.
    pub fn results<T: OclPrm>(
        &self,
        len: usize,
        kernel: impl FnOnce(&Buffer<T>) -> ocl::Result<Kernel>,
    ) -> Vec<T> {
        let results: Buffer<T> = allocate(&self.queue, len).unwrap();
        let kernel = kernel(&results).unwrap();
        // SAFETY: a test sets the arguments that its own kernel source declares, and its kernel writes `len` results.
        unsafe { kernel.enq().unwrap() };
        let mut all = vec![T::default(); len];
        results.read(&mut all).enq().unwrap();
        all
    }
}

/// Returns the bytes of `__local` memory per work-group that the driver reports for a kernel.
pub fn reported_local_bytes(kernel: &Kernel, device: ocl::Device) -> u64 {
    match kernel.wg_info(device, KernelWorkGroupInfo::LocalMemSize) {
        Ok(KernelWorkGroupInfoResult::LocalMemSize(bytes)) => bytes,
        other => panic!("{other:?}"),
    }
}

/// Returns true if the driver of the first device reports how much `__local` memory a kernel uses. Some versions of
/// PoCL, such as 6.0, report 0 bytes for every kernel.
pub fn reports_local_memory() -> bool {
    let source = "__kernel void reverse(__global int *all) {
                      __local int copy[8];
                      copy[get_local_id(0)] = all[get_local_id(0)];
                      barrier(CLK_LOCAL_MEM_FENCE);
                      all[get_local_id(0)] = copy[7 - get_local_id(0)];
                  }";
    let device = Alone::of([source, ""], &[], "");
    let all: Buffer<i32> = allocate(&device.queue, 8).unwrap();
    let kernel = device.kernel("reverse", 8).arg(&all).build().unwrap();
    reported_local_bytes(&kernel, device.queue.device) >= 32
}
