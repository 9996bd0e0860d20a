//! The reason why a point cannot be cast, found before anything is compiled.

/// Why a point (a strategy with a local size, an image size, a scene and a device) cannot be cast. The reason is either
/// a limit that the point exceeds, with the arithmetic, or a feature that the strategy does not support.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Infeasible {
    /// The reason as a text, for example "__local memory: vectors 108 B x 24 x 24 = 62208 B > 49152 B".
    pub reason: String,
    /// What must change so that the device can cast this point (combination of strategy, scene and sizes).
    pub cause: Cause,
}

/// What must change so that a device can cast a point (a combination of strategy, scene and sizes).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// A size must change, since the point exceeds a limit of a device or of the host.
    Size,
    /// A size must change, since the point exceeds a device's global memory. The point may fit when other
    /// points hold no global memory.
    GlobalMemory,
    /// The local size must change, since the device or the strategy does not support a work-group of this
    /// shape.
    WorkGroup,
    /// The local size must change: a work-group of this size needs more memory than a limit allows, but a
    /// smaller work-group fits.
    LargeGroup,
    /// The strategy must change: it does not support something that the scene contains, whatever the device
    /// and the sizes.
    Lacking,
}

impl Infeasible {
    /// The words with which a reason begins if the host has too little memory.
    pub const ON_HOST: &'static str = "the host's memory";
    /// The words with which a reason begins if a buffer is larger than the device's largest buffer.
    pub const LARGEST_BUFFER: &'static str = "largest buffer";
    /// The words with which a reason begins if a device has too little global memory.
    pub const GLOBAL_MEMORY: &'static str = "global memory";
    /// The words with which a reason begins if the stacks of a CPU's threads are too small.
    pub const CPU_STACK: &'static str = "a CPU thread's stack";
    /// The words by which a reason mentions memory that raycl uses for other points, frames or trees.
    pub const BESIDE_OTHERS: &'static str = "that raycl already uses";
    /// The words by which a reason in an older record mentions memory that raycl used for other points.
    const BESIDE_OTHERS_EARLIER: &'static str = "that other points hold";
    /// The last words of a reason, if the limit comes from the experiment's config and not from the device
    /// itself.
    pub const EMULATED: &'static str = "the limit in [emulate]";

    /// Returns true if a reason holds only for a moment, because other programs use the host's memory, or
    /// other points of the run hold memory. The point may fit at another moment.
    pub fn is_of_the_moment(reason: &str) -> bool {
        let beside = [Self::BESIDE_OTHERS, Self::BESIDE_OTHERS_EARLIER];
        reason.starts_with(Self::ON_HOST) || beside.iter().any(|words| reason.contains(words))
    }

    /// Returns true if the point exceeds the device's global memory, its largest buffer or its threads' stacks.
    /// Returns false if the reason is temporary, so that the point may fit at another moment of the session. In
    /// another session, the limits of the same device's global memory, buffers and stacks may be larger, for
    /// example if an environment variable of its driver or `ulimit -s` changes. If any other limit of the
    /// device changes, the key of the point's record changes too, since everything that determines the limit is
    /// part of the key.
    pub fn is_of_the_session(reason: &str) -> bool {
        let limits = [Self::LARGEST_BUFFER, Self::GLOBAL_MEMORY, Self::CPU_STACK];
        !Self::is_of_the_moment(reason) && limits.iter().any(|words| reason.starts_with(words))
    }

    /// Makes the refusal of a point that exceeds a limit of a device or of the host.
    pub fn beyond(reason: String) -> Self {
        Self { reason, cause: Cause::Size }
    }

    /// Returns this refusal. If `is_emulated` is true, the reason also says that the limit comes from
    /// `[emulate]`, the section of a config that imitates a smaller device.
    #[must_use]
    pub fn emulated_if(self, is_emulated: bool) -> Self {
        match is_emulated {
            true => Self { reason: format!("{}, {}", self.reason, Self::EMULATED), ..self },
            false => self,
        }
    }

    /// Returns this refusal. If `a_smaller_one_fits` is true (a smaller work-group fits), the returned
    /// refusal has the local size as its cause.
    #[must_use]
    pub fn of_large_group_if(self, a_smaller_one_fits: bool) -> Self {
        if a_smaller_one_fits { Self { cause: Cause::LargeGroup, ..self } } else { self }
    }

    /// Makes the refusal of a point whose work-group has a shape that the device or the strategy does not
    /// support.
    pub fn work_group(reason: String) -> Self {
        Self { reason, cause: Cause::WorkGroup }
    }

    /// Makes the refusal of a point whose scene contains something that its strategy does not support.
    pub fn lacking(reason: String) -> Self {
        Self { reason, cause: Cause::Lacking }
    }
}
