//! How much of a device's memory is in use, by this process and by others.

use crate::memory::readable;
use std::fmt;

/// The use of a device's memory at one moment, in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UsedMemory {
    /// All memory of the device.
    pub total_bytes: u64,
    /// The part of the device's memory that is in use, by any process.
    pub used_bytes: u64,
    /// The part of the device's memory that this process uses. `None` if NVIDIA's management library (NVML)
    /// does not list this process, as in some containers, or does not state how much memory this process uses.
    pub own_bytes: Option<u64>,
}

impl UsedMemory {
    /// Returns how many bytes of the device's memory other processes use, including other worker processes of
    /// the same run; `None` if this number is not known.
    fn others_bytes(&self) -> Option<u64> {
        Some(self.used_bytes.saturating_sub(self.own_bytes?))
    }

    /// Returns true if other processes may use more than a hundredth of the device's memory. If it is not
    /// known how much memory this process uses, the function assumes that other processes use all memory in
    /// use.
    pub fn may_be_others(&self) -> bool {
        self.others_bytes().unwrap_or(self.used_bytes) > self.total_bytes / 100
    }
}

impl fmt::Display for UsedMemory {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let total = readable(self.total_bytes);
        match self.others_bytes() {
            Some(bytes) => {
                write!(formatter, "other processes use {} of the device's {total} of memory", readable(bytes))
            }
            None => {
                let used = readable(self.used_bytes);
                write!(
                    formatter,
                    "{used} of the device's {total} of memory are in use, by this process or others"
                )
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_memory_of_other_processes_is_distinguished_where_this_process_is_listed() {
        let used = UsedMemory { total_bytes: 80_000_000_000, used_bytes: 79_500_000_000, own_bytes: None };
        assert_eq!(used.others_bytes(), None);
        assert_eq!(
            used.to_string(),
            "79.5 GB of the device's 80.0 GB of memory are in use, by this process or others"
        );
        assert!(used.may_be_others());
        let used = UsedMemory { own_bytes: Some(500_000_000), ..used };
        assert_eq!(used.others_bytes(), Some(79_000_000_000));
        assert_eq!(used.to_string(), "other processes use 79.0 GB of the device's 80.0 GB of memory");
        assert!(used.may_be_others());
        let own = UsedMemory { own_bytes: Some(79_000_000_000), ..used };
        assert!(!own.may_be_others(), "{own}");
        let others = UsedMemory { own_bytes: Some(77_500_000_000), ..used };
        assert!(others.may_be_others(), "{others}: more than a hundredth of the memory");
    }
}
