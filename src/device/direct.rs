//! Calls functions of OpenCL directly instead of through the wrappers of the crate `ocl`. These wrappers panic at a
//! status that they do not know, report success if a build fails without messages, and lose messages that are not
//! UTF-8.

use super::errors::{CallError, compiler_log};
use super::panics::noted;
use ocl::core::Kernel;
use ocl::enums::Status;
use ocl::ffi;
use ocl::{Device, Platform, Program};
use std::ffi::{CStr, c_void};
use std::mem::transmute;
use std::ptr;

/// The largest answer, in bytes, that raycl accepts to a query. A driver that announces an answer of more than
/// `LARGEST_BYTES` bytes is broken.
const LARGEST_BYTES: usize = 1 << 30;

/// The extension that has the function `clGetKernelSubGroupInfoKHR`.
const SUB_GROUPS: &str = "cl_khr_subgroups";

/// The function `clGetKernelSubGroupInfoKHR`: kernel, device, query, size of the input, input, size of the memory for
/// the answer, this memory, and the answer's size.
type SubGroupInfo = unsafe extern "system" fn(
    ffi::cl_kernel,
    ffi::cl_device_id,
    u32,
    usize,
    *const c_void,
    usize,
    *mut c_void,
    *mut usize,
) -> i32;

/// The text that raycl shows if the compiler rejects a program without a message.
const UNEXPLAINED: &str = "the compiler rejects the program without a message";

/// The OpenCL statuses that [`returned`] names in a message. [`returned`] shows every other status only as a number.
const NAMED: [Status; 24] = [
    Status::CL_DEVICE_NOT_FOUND,
    Status::CL_DEVICE_NOT_AVAILABLE,
    Status::CL_COMPILER_NOT_AVAILABLE,
    Status::CL_MEM_OBJECT_ALLOCATION_FAILURE,
    Status::CL_OUT_OF_RESOURCES,
    Status::CL_OUT_OF_HOST_MEMORY,
    Status::CL_BUILD_PROGRAM_FAILURE,
    Status::CL_COMPILE_PROGRAM_FAILURE,
    Status::CL_LINKER_NOT_AVAILABLE,
    Status::CL_LINK_PROGRAM_FAILURE,
    Status::CL_INVALID_VALUE,
    Status::CL_INVALID_DEVICE_TYPE,
    Status::CL_INVALID_PLATFORM,
    Status::CL_INVALID_DEVICE,
    Status::CL_INVALID_CONTEXT,
    Status::CL_INVALID_QUEUE_PROPERTIES,
    Status::CL_INVALID_COMMAND_QUEUE,
    Status::CL_INVALID_BINARY,
    Status::CL_INVALID_BUILD_OPTIONS,
    Status::CL_INVALID_PROGRAM,
    Status::CL_INVALID_PROGRAM_EXECUTABLE,
    Status::CL_INVALID_OPERATION,
    Status::CL_INVALID_COMPILER_OPTIONS,
    Status::CL_INVALID_LINKER_OPTIONS,
];

/// Returns a sentence about a call that failed: the function and its status.
pub fn returned(function: &str, status: i32) -> String {
    match named(status) {
        Some(name) => format!("{function} returned {name:?} ({status})"),
        None => format!("{function} returned the unknown status {status}"),
    }
}

/// Returns the status with this number if it is one of `NAMED`; otherwise `None`.
fn named(status: i32) -> Option<Status> {
    NAMED.into_iter().find(|known| *known as i32 == status)
}

/// Returns the devices of a platform, or an empty list if the platform has no devices.
///
/// # Errors
///
/// Fails if the driver cannot list its devices. The error names the status.
pub fn devices(platform: Platform) -> Result<Vec<Device>, String> {
    let (mut count, platform) = (0_u32, platform.as_core().as_ptr());
    let list = |entries, devices, count: *mut u32| {
        // SAFETY: `devices` has room for `entries` devices, or is null if `entries` is 0. `count` is null or points to
        // a number that outlives the call.
        unsafe { ffi::clGetDeviceIDs(platform, ffi::CL_DEVICE_TYPE_ALL, entries, devices, count) }
    };
    let status = list(0, ptr::null_mut(), &mut count);
    if status == Status::CL_DEVICE_NOT_FOUND as i32 || status == 0 && count == 0 {
        return Ok(Vec::new());
    }
    let mut devices = vec![ptr::null_mut(); count as usize];
    let status = if status == 0 { list(count, devices.as_mut_ptr(), ptr::null_mut()) } else { status };
    if status != 0 {
        return Err(returned("clGetDeviceIDs", status));
    }
    devices.retain(|device| !device.is_null());
    // SAFETY: the driver returned these device handles.
    let core = devices.into_iter().map(|device| unsafe { ocl::core::DeviceId::from_raw(device) });
    Ok(core.map(Device::from).collect())
}

/// Returns a device's answer to a query, as bytes. The error names the status of the failed query.
pub fn device_answer(device: Device, query: u32) -> Result<Vec<u8>, String> {
    let device = device.as_core().as_raw();
    // SAFETY: `answer` passes memory of `size` bytes.
    let ask = |size, value, needed| unsafe { ffi::clGetDeviceInfo(device, query, size, value, needed) };
    answer("clGetDeviceInfo", ask)
}

/// Returns a platform's answer to a query for a text. The error names the status of the failed query.
pub fn platform_text(platform: Platform, query: u32) -> Result<String, String> {
    let platform = platform.as_core().as_ptr();
    // SAFETY: `answer` passes memory of `size` bytes.
    let ask = |size, value, needed| unsafe { ffi::clGetPlatformInfo(platform, query, size, value, needed) };
    answer("clGetPlatformInfo", ask).map(|bytes| one_line(&bytes))
}

/// Returns the number of work-items in the largest sub-group of a kernel that is started with this local size. Returns
/// `None` if the driver does not report the number.
pub fn sub_group_size(device: Device, kernel: &Kernel, local_size: [usize; 2]) -> Option<usize> {
    sub_group_size_by(sub_group_info(device)?, device.as_core().as_raw(), kernel.as_ptr(), local_size)
}

/// Like [`sub_group_size`]. `info` is the driver's function that answers the query.
fn sub_group_size_by(
    info: SubGroupInfo,
    device: ffi::cl_device_id,
    kernel: ffi::cl_kernel,
    local_size: [usize; 2],
) -> Option<usize> {
    let query = ffi::CL_KERNEL_MAX_SUB_GROUP_SIZE_FOR_NDRANGE;
    let (input, bytes) = (local_size.as_ptr().cast(), size_of_val(&local_size));
    // SAFETY: the input has `bytes` bytes, and `answer` passes memory of `size` bytes.
    let ask = |size, value, needed| unsafe { info(kernel, device, query, bytes, input, size, value, needed) };
    Some(usize::from_ne_bytes(answer("clGetKernelSubGroupInfoKHR", ask).ok()?.try_into().ok()?))
}

/// Returns the function that answers queries about sub-groups. Returns `None` if the device does not list the
/// function's extension. (PoCL 3.1 lacks the extension. Loaders nevertheless return a function for PoCL 3.1, and this
/// function crashes.)
fn sub_group_info(device: Device) -> Option<SubGroupInfo> {
    let extensions = one_line(&device_answer(device, ffi::CL_DEVICE_EXTENSIONS).ok()?);
    if !extensions.split(' ').any(|extension| extension == SUB_GROUPS) {
        return None;
    }
    let platform = device_answer(device, ffi::CL_DEVICE_PLATFORM).ok()?;
    let platform = usize::from_ne_bytes(platform.try_into().ok()?) as ffi::cl_platform_id;
    let name = c"clGetKernelSubGroupInfoKHR".as_ptr();
    // SAFETY: the driver returned the platform's handle, and the name ends with a zero byte.
    let address = unsafe { ffi::clGetExtensionFunctionAddressForPlatform(platform, name) };
    // SAFETY: the address is null or that of a function with this signature. An `Option` of a function is null if it
    // is `None`.
    unsafe { transmute::<*mut c_void, Option<SubGroupInfo>>(address) }
}

/// Returns a text of a driver, such as a name, as one line: line breaks and tabs become blanks. Zero bytes and blanks
/// at both ends are removed.
pub fn one_line(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let text = text.trim_matches(|c: char| c == '\0' || c.is_whitespace());
    text.chars().map(|c| if c.is_whitespace() { ' ' } else { c }).collect()
}

/// Builds a program for a device. If the compiler rejects the program, the error contains the compiler's
/// messages.
pub fn build(program: ocl::core::Program, device: Device, options: &CStr) -> Result<Program, CallError> {
    let devices = [device.as_core().as_raw()];
    // SAFETY: the list has one device, `options` ends with a zero byte, and no callback is passed.
    let status = unsafe {
        ffi::clBuildProgram(program.as_ptr(), 1, devices.as_ptr(), options.as_ptr(), None, ptr::null_mut())
    };
    // Some drivers return success although the compiler has rejected the program. If the driver returns
    // success for a rejected program, the build status that it stores with the program
    // (`CL_PROGRAM_BUILD_STATUS`) shows the rejection.
    let is_rejected = status == Status::CL_BUILD_PROGRAM_FAILURE as i32
        || status == 0 && build_status(&program, device) == Some(ffi::CL_BUILD_ERROR);
    if is_rejected {
        return Err(CallError::new(rejection(&build_log(&program, device))));
    }
    match status {
        0 => Ok(Program::from(program)),
        // The program is freed before the caller gets the error. If freeing the program panics, the message
        // of the panic must contain this error, so `noted` stores the error at once.
        _ => Err(CallError {
            status: named(status),
            ..CallError::new(noted(returned("clBuildProgram", status)))
        }),
    }
}

/// Returns the compiler's messages, or a fixed sentence if the compiler printed no messages.
fn rejection(log: &[u8]) -> String {
    let log = compiler_log(&String::from_utf8_lossy(log));
    if log.is_empty() { UNEXPLAINED.to_owned() } else { log }
}

/// Returns the status of a build, such as CL_BUILD_ERROR; `None` if the driver does not report the status.
fn build_status(program: &ocl::core::Program, device: Device) -> Option<i32> {
    let bytes = build_answer(program, device, ffi::CL_PROGRAM_BUILD_STATUS)?;
    Some(i32::from_ne_bytes(bytes.try_into().ok()?))
}

/// Returns the compiler's messages without zero bytes, or no bytes if the driver does not return the
/// messages.
fn build_log(program: &ocl::core::Program, device: Device) -> Vec<u8> {
    let mut log = build_answer(program, device, ffi::CL_PROGRAM_BUILD_LOG).unwrap_or_default();
    log.retain(|&byte| byte != 0);
    log
}

fn build_answer(program: &ocl::core::Program, device: Device, query: u32) -> Option<Vec<u8>> {
    let (program, device) = (program.as_ptr(), device.as_core().as_raw());
    answer("clGetProgramBuildInfo", |size, value, needed| {
        // SAFETY: `answer` passes memory of `size` bytes.
        unsafe { ffi::clGetProgramBuildInfo(program, device, query, size, value, needed) }
    })
    .ok()
}

/// Returns the answer to a query. The error names the status of a query that failed, or the size of an answer of more
/// than `LARGEST_BYTES` bytes. `ask` calls OpenCL's `function`. The parameters of `ask` are the size in bytes of the
/// memory for the answer, a pointer to this memory (or null), and a pointer to which OpenCL writes the answer's size
/// (or null).
fn answer(function: &str, ask: impl Fn(usize, *mut c_void, *mut usize) -> i32) -> Result<Vec<u8>, String> {
    let checked = |status| if status == 0 { Ok(()) } else { Err(returned(function, status)) };
    let mut size = 0;
    checked(ask(0, ptr::null_mut(), &mut size))?;
    if size > LARGEST_BYTES {
        return Err(format!("{function} announces an answer of {size} bytes, so the driver is broken"));
    }
    let mut bytes = vec![0_u8; size];
    if size > 0 {
        checked(ask(size, bytes.as_mut_ptr().cast(), ptr::null_mut()))?;
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_status_without_a_name_is_a_number() {
        assert_eq!(returned("clFinish", -5), "clFinish returned CL_OUT_OF_RESOURCES (-5)");
        assert_eq!(returned("clFinish", -1108), "clFinish returned the unknown status -1108");
        assert_eq!(returned("clX", -3), "clX returned CL_COMPILER_NOT_AVAILABLE (-3)");
    }

    #[test]
    fn no_status_is_named_twice() {
        let statuses: std::collections::BTreeSet<i32> = NAMED.iter().map(|known| *known as i32).collect();
        assert_eq!(statuses.len(), NAMED.len(), "{statuses:?}");
    }

    #[test]
    fn every_status_that_says_why_a_device_or_a_program_cannot_be_used_has_a_name() {
        let numbers = [1..=6, 11..=11, 15..=17, 30..=36, 42..=45, 59..=59, 66..=67];
        for number in numbers.into_iter().flatten() {
            let message = returned("clBuildProgram", -number);
            assert!(message.starts_with("clBuildProgram returned CL_"), "{message}");
        }
    }

    #[test]
    fn names_of_drivers_are_one_line() {
        assert_eq!(one_line(b" a\nb\t c\0"), "a b  c");
        assert_eq!(one_line(b"\xe9 x"), "\u{fffd} x");
        assert_eq!(one_line(b"\0 \n"), "");
    }

    /// Answers a query with `bytes`, as a driver does. The other parameters are those that [`answer`] passes.
    fn answered<const N: usize>(bytes: [u8; N], size: usize, value: *mut c_void, needed: *mut usize) -> i32 {
        if !needed.is_null() {
            // SAFETY: `answer` passes a valid pointer for the size.
            unsafe { *needed = N };
        }
        if size >= N {
            // SAFETY: `answer` passes memory of `size` bytes.
            unsafe { value.cast::<[u8; N]>().write_unaligned(bytes) };
        }
        0
    }

    /// A driver's function that knows one kernel (1) on one device (2), at one local size (32x4): its sub-groups have
    /// 16 work-items. 0x2033 is the query's number in OpenCL's headers.
    unsafe extern "system" fn of_one_kernel(
        kernel: ffi::cl_kernel,
        device: ffi::cl_device_id,
        query: u32,
        bytes: usize,
        input: *const c_void,
        size: usize,
        value: *mut c_void,
        needed: *mut usize,
    ) -> i32 {
        if (kernel.addr(), device.addr(), query, bytes) != (1, 2, 0x2033, size_of::<[usize; 2]>()) {
            return Status::CL_INVALID_VALUE as i32;
        }
        // SAFETY: the input has `bytes` bytes.
        let local_size = unsafe { input.cast::<[usize; 2]>().read_unaligned() };
        if local_size != [32, 4] {
            return Status::CL_INVALID_VALUE as i32;
        }
        answered(16_usize.to_ne_bytes(), size, value, needed)
    }

    #[test]
    fn the_size_of_sub_groups_is_asked_for_the_kernel_the_device_and_the_local_size() {
        let [kernel, device] = [1, 2].map(ptr::without_provenance_mut::<c_void>);
        let size = |local_size| sub_group_size_by(of_one_kernel, device, kernel, local_size);
        assert_eq!([size([32, 4]), size([4, 32])], [Some(16), None]);
    }

    #[test]
    fn an_answer_is_read_in_two_calls_and_a_status_or_an_impossible_size_is_an_error() {
        let text = |size, value, needed| answered(*b"abc", size, value, needed);
        let answer_of = |ask: &dyn Fn(usize, *mut c_void, *mut usize) -> i32| answer("clX", ask);
        assert_eq!(answer_of(&text), Ok(b"abc".to_vec()));
        assert_eq!(answer_of(&|_, _, _| -1108), Err("clX returned the unknown status -1108".to_owned()));
        let endless = |_: usize, _: *mut c_void, needed: *mut usize| {
            // SAFETY: `answer` passes a valid pointer for the size in its first call, and makes no second
            // call.
            unsafe { *needed = 1 << 46 };
            0
        };
        let message = "clX announces an answer of 70368744177664 bytes, so the driver is broken";
        assert_eq!(answer_of(&endless), Err(message.to_owned()));
        let only_its_size = |_: usize, _: *mut c_void, needed: *mut usize| {
            if needed.is_null() {
                return -5;
            }
            // SAFETY: `answer` passes a valid pointer for the size in its first call.
            unsafe { *needed = 3 };
            0
        };
        let message = "clX returned CL_OUT_OF_RESOURCES (-5)";
        assert_eq!(answer_of(&only_its_size), Err(message.to_owned()));
    }

    #[test]
    fn a_rejection_without_messages_or_with_messages_that_are_no_utf_8_says_what_is_known() {
        assert!(rejection(b" \n").ends_with("rejects the program without a message"));
        assert_eq!(rejection(b"a.cl:1: \xe9\n"), "a.cl:1: \u{fffd}");
    }
}
