//! The reasons why a strategy cannot be cast on a device.

use super::LaunchError;
use crate::device::{DeviceInfo, folder_advice, is_pocl, note_failure};
use crate::error::Error;
use crate::memory::{UNLIMITED, blames_address_space};
use crate::program::BuildError;
use crate::sources::does_not_compile;
use crate::strategy::{Cause, Infeasible};

/// The obstacle that prevents a strategy from being cast.
#[derive(Debug)]
pub enum Refused {
    /// The user made a mistake: the strategy contradicts itself, or a kernel file has an error.
    Mistake(Error),
    /// The strategy exceeds a limit of the device (such as its memory), or does not support a part of the scene.
    Device(Infeasible),
    /// The strategy needs more memory than the host has.
    Host(Infeasible),
    /// The compiler rejects the strategy's program.
    Build(BuildError),
    /// A step failed, usually because a function of OpenCL returned an error.
    Launch {
        /// The step, such as "uploading the scene".
        step: &'static str,
        /// Why the step failed.
        error: LaunchError,
    },
}

/// The remedy if a picture or a point of an experiment exceeds a limit of the device or the host, such as its memory,
/// and a smaller work-group would not help.
const SMALLER: &str = "a smaller image or scene, or another --strategy, may fit; `raycl strategies` lists layouts and traversals";
/// The remedy if a work-group has a shape or a number of work-items that the device, the strategy or the compiled
/// kernel does not support.
const ANOTHER_SIZE: &str = "choose another --local-size";
/// The remedy if a work-group needs more memory than a limit allows, but a smaller work-group would need less
/// than the limit.
const SMALLER_GROUP: &str = "choose a smaller --local-size";
/// The remedy if the strategy does not support something that the scene has, or needs sub-groups that the driver does
/// not make.
const ANOTHER: &str =
    "choose another --strategy; `raycl strategies` lists the presets, and all axes with their values";

/// The remedy if one of the user's kernel files lacks a kernel, or changes its parameters.
const OWN_KERNEL: &str = "if a file replaces a built-in file, the file's kernels must keep their names and their parameters, as in `__kernel GROUP_SHAPE void cast_frame(CAST_FRAME_PARAMETERS)`; `raycl kernel STRATEGY` shows raycl's own kernels";
/// The remedy if the header of one of the user's kernel files states too little memory.
const OWN_HEADER: &str =
    "docs/own-kernels.md describes the keys of a file's header, such as `memory` and `bytes_per_ray`";
/// The remedy for a failed step if no other remedy fits the reason.
const OTHERWISE: &str = "a smaller picture, another --strategy or another --device may work";
/// The remedy if the compiler rejects a program that contains none of the user's files.
const ANOTHER_BUILD: &str =
    "`raycl kernel STRATEGY` shows the program; the build may succeed with another --strategy or --device";
/// The remedy for a step or a build that may have failed because memory or another resource is missing.
const FREE_MEMORY: &str = "a smaller picture or scene, another --strategy or a smaller --local-size may need less memory; other processes may also be using the device's memory, or the system may have stopped a kernel that ran for too long; `raycl devices` lists other devices";

impl Refused {
    /// Returns a function that converts an error of the step `step` to a [`Refused::Launch`].
    pub fn at(step: &'static str) -> impl Fn(LaunchError) -> Self {
        move |error| {
            note_failure(&format!("{step} failed: {error}"));
            Self::Launch { step, error }
        }
    }

    /// Returns why the strategy cannot be cast: a sentence, or the compiler's log if the build failed.
    pub fn reason(&self) -> String {
        match self {
            Self::Mistake(error) => error.to_string(),
            Self::Device(refused) | Self::Host(refused) => refused.reason.clone(),
            Self::Build(error) => error.log.clone(),
            Self::Launch { error, .. } => error.to_string(),
        }
    }

    /// Returns why the strategy cannot be cast: a sentence, or the compiler's log if the build failed. If memory may be
    /// missing, the sentence may also say how much of the device's memory is in use ([`LaunchError::on`]). If PoCL's
    /// folder for compiled kernels is on a full disk, or on a file system mounted with the option noexec, a line after
    /// the log says so.
    pub fn reason_on(&self, device: &DeviceInfo) -> String {
        match self {
            Self::Launch { error, .. } => error.on(device),
            Self::Build(error) => {
                let advice = is_pocl(&device.platform).then(folder_advice).flatten();
                std::iter::once(error.log.clone()).chain(advice).collect::<Vec<_>>().join("\n")
            }
            _ => self.reason(),
        }
    }

    /// Returns the error that ends a command, if the command cannot go on without this strategy. `device` is the device
    /// that should have cast the strategy.
    pub fn into_error(self, device: &DeviceInfo) -> Error {
        let reason = self.reason_on(device);
        self.with_reason(&reason, &device.label)
    }

    /// Returns the error that ends a command that uses no device.
    pub fn into_host_error(self) -> Error {
        let reason = self.reason();
        self.with_reason(&reason, "this machine")
    }

    fn with_reason(self, reason: &str, device: &str) -> Error {
        let cannot = |what: &str, remedy: &str| {
            Error::input(format!("{what} cannot cast this frame: {reason}")).with_help(remedy)
        };
        match self {
            Self::Mistake(error) => error,
            Self::Device(refused) => match refused.cause {
                Cause::Lacking => {
                    Error::input(format!("this strategy cannot cast the scene: {reason}")).with_help(ANOTHER)
                }
                Cause::WorkGroup => cannot(device, ANOTHER_SIZE),
                Cause::LargeGroup => cannot(device, SMALLER_GROUP),
                Cause::Size | Cause::GlobalMemory => cannot(device, SMALLER),
            },
            Self::Host(_) if blames_address_space(reason) => cannot("this process", UNLIMITED),
            Self::Host(_) => cannot("this machine", SMALLER),
            Self::Build(error) if error.has_own_file => does_not_compile(reason),
            Self::Build(error) => Error::run(format!("the build of the kernels failed: {reason}"))
                .with_help(if error.may_pass { FREE_MEMORY } else { ANOTHER_BUILD }),
            Self::Launch { error: LaunchError::OwnKernel(_), .. } => {
                Error::input(reason).with_help(OWN_KERNEL)
            }
            Self::Launch { error: LaunchError::OwnHeader(_), .. } => {
                Error::input(reason).with_help(OWN_HEADER)
            }
            Self::Launch { step, error: LaunchError::WorkGroup { .. } } => {
                Error::input(format!("{step} failed: {reason}")).with_help(ANOTHER_SIZE)
            }
            Self::Launch { step, error: LaunchError::HeapExhausted { has_own_file: true, .. } } => {
                Error::input(format!("{step} failed: {reason}")).with_help(OWN_HEADER)
            }
            Self::Launch { step, error } => {
                let remedy = match error {
                    LaunchError::Resources(_) => FREE_MEMORY,
                    LaunchError::SubGroups { .. } => ANOTHER,
                    _ => OTHERWISE,
                };
                Error::run(format!("{step} failed: {reason}")).with_help(remedy)
            }
        }
    }
}

impl From<Error> for Refused {
    fn from(error: Error) -> Self {
        Self::Mistake(error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::{DeviceKind, tests::example};

    fn device() -> DeviceInfo {
        example("a platform", "the device", DeviceKind::Gpu, 4)
    }

    #[test]
    fn a_launch_without_memory_advises_to_need_less_or_to_free_some() {
        for (error, remedy) in [
            (LaunchError::Resources("no".into()), FREE_MEMORY),
            (LaunchError::OpenCl("no".into()), OTHERWISE),
        ] {
            let error = Refused::at("the launch")(error).into_error(&device());
            assert_eq!((error.to_string().as_str(), error.remedy()), ("the launch failed: no", remedy));
            assert_eq!(error.exit_code(), 1);
        }
    }

    #[test]
    fn if_a_kernel_supports_fewer_work_items_another_local_size_is_advised() {
        let error = LaunchError::WorkGroup { kernel: "cast_frame".to_owned(), most: 512, items: 1024 };
        let error = Refused::at("preparing the frame")(error).into_error(&device());
        assert_eq!((error.exit_code(), error.remedy()), (2, ANOTHER_SIZE));
        let message = "preparing the frame failed: the local size has 1024 work-items; the compiled kernel \
                       cast_frame supports at most 512";
        assert_eq!(error.to_string(), message);
    }

    #[test]
    fn if_sub_groups_have_another_size_another_strategy_is_advised() {
        let error = LaunchError::SubGroups { kernel: "tile_cast".to_owned(), size: 16 };
        let error = Refused::at("preparing the frame")(error).into_error(&device());
        assert_eq!((error.exit_code(), error.remedy()), (1, ANOTHER));
        let message = "preparing the frame failed: the driver makes sub-groups of 16 work-items for the kernel \
                       tile_cast, which needs sub-groups of 32";
        assert_eq!(error.to_string(), message);
    }

    #[test]
    fn a_kernel_that_a_file_of_the_user_lacks_is_the_users_mistake() {
        let error = LaunchError::OwnKernel("mine/a.cl defines no kernel `cast_frame`".to_owned());
        let error = Refused::at("preparing the frame")(error).into_error(&device());
        assert_eq!((error.exit_code(), error.remedy()), (2, OWN_KERNEL));
        assert_eq!(error.to_string(), "mine/a.cl defines no kernel `cast_frame`");
    }

    #[test]
    fn a_heap_that_is_too_small_is_the_users_mistake_if_a_kernel_file_is_the_users() {
        for (has_own_file, expected) in [(true, (2, OWN_HEADER)), (false, (1, OTHERWISE))] {
            let error = LaunchError::HeapExhausted { used: 2, size: 1, has_own_file };
            let error = Refused::at("reading the image")(error).into_error(&device());
            assert_eq!((error.exit_code(), error.remedy()), expected);
            let message = error.to_string();
            assert!(message.starts_with("reading the image failed: the heap of the working"), "{message}");
        }
    }

    #[test]
    fn a_smaller_picture_is_advised_only_for_what_a_device_cannot_hold() {
        let texts = |infeasible| {
            let error = Refused::Device(infeasible).into_error(&device());
            assert_eq!(error.exit_code(), 2);
            (error.to_string(), error.remedy().to_owned())
        };
        let (message, remedy) =
            texts(Infeasible::lacking("traversal = raster does not support a sky".to_owned()));
        assert_eq!(message, "this strategy cannot cast the scene: traversal = raster does not support a sky");
        assert_eq!(remedy, ANOTHER);
        let (message, remedy) = texts(Infeasible::beyond("global memory: 2 B > 1 B".to_owned()));
        assert_eq!(message, "the device cannot cast this frame: global memory: 2 B > 1 B");
        assert_eq!(remedy, SMALLER);
        let (_, remedy) =
            texts(Infeasible::work_group("work-group: 9 x 9 = 81 work-items > the device's 64".to_owned()));
        assert_eq!(remedy, ANOTHER_SIZE);
        let stack = Infeasible::beyond("a CPU thread's stack: tiles 2 B > 1 B".to_owned());
        let (message, remedy) = texts(stack.of_large_group_if(true));
        assert_eq!(message, "the device cannot cast this frame: a CPU thread's stack: tiles 2 B > 1 B");
        assert_eq!(remedy, SMALLER_GROUP);
    }

    #[test]
    fn the_hosts_memory_is_not_blamed_on_the_device() {
        let refused = Refused::Host(Infeasible::beyond("memory: 2 B > 1 B".to_owned()));
        let message = refused.into_error(&device()).to_string();
        assert_eq!(message, "this machine cannot cast this frame: memory: 2 B > 1 B");
    }

    #[test]
    fn a_limit_of_the_address_space_is_named_with_its_remedy() {
        let reason = "the host's memory (casting): 2 B > 1 B according to /proc/self/limits";
        let error = Refused::Host(Infeasible::beyond(reason.to_owned())).into_error(&device());
        assert_eq!((error.exit_code(), error.remedy()), (2, UNLIMITED));
        assert_eq!(error.to_string(), format!("this process cannot cast this frame: {reason}"));
    }

    #[test]
    fn a_build_without_memory_advises_to_need_less_or_to_free_some() {
        for (may_pass, remedy) in [(true, FREE_MEMORY), (false, ANOTHER_BUILD)] {
            let log = "clBuildProgram returned -6".to_owned();
            let error =
                Refused::Build(BuildError { log, has_own_file: false, may_pass }).into_error(&device());
            assert_eq!((error.exit_code(), error.remedy()), (1, remedy));
            assert_eq!(error.to_string(), "the build of the kernels failed: clBuildProgram returned -6");
        }
    }

    #[test]
    fn an_error_in_a_program_with_a_file_of_the_user_is_the_users_mistake() {
        for (has_own_file, code) in [(true, 2), (false, 1)] {
            let log = "mine/a.cl:7:1: error: no".to_owned();
            let error = BuildError { log, has_own_file, may_pass: false };
            let error = Refused::Build(error).into_error(&device());
            assert_eq!(error.exit_code(), code);
            assert!(error.to_string().contains("mine/a.cl:7:1"), "{error}");
        }
    }
}
