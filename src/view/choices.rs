//! The strategies and local sizes from which the user chooses with keys.

use crate::device::DeviceInfo;
use crate::strategy::{PRESETS, Strategy};

/// Several values, one of which is chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct Choices<T> {
    all: Vec<T>,
    taken: usize,
}

impl<T: Copy + PartialEq> Choices<T> {
    /// Makes a list that begins with `first`, which is the chosen value, and continues with the values in `others`.
    /// Each value occurs once.
    pub fn of(first: T, others: impl IntoIterator<Item = T>) -> Self {
        let mut all = vec![first];
        for other in others {
            if !all.contains(&other) {
                all.push(other);
            }
        }
        Self { all, taken: 0 }
    }

    /// Returns the chosen value.
    pub fn taken(&self) -> T {
        self.all[self.taken]
    }

    /// Returns the chosen value unless it is the list's first value.
    pub fn taken_after_first(&self) -> Option<T> {
        (self.taken > 0).then(|| self.taken())
    }

    /// Returns copies of this list, each with another chosen value, in the order in which `raycl view` tries these
    /// values. In the first copy, the chosen value is `steps` places further in the list, or further back if `steps` is
    /// negative. The list is a circle: its first value follows its last value. In each later copy, the chosen value is
    /// one more place away in the same direction. This list's own chosen value is skipped. There is one exception: if
    /// the list has several values, and moving by `steps` places leads back to this list's chosen value, the first copy
    /// equals this list.
    pub fn others(&self, steps: isize) -> impl Iterator<Item = Self> + '_ {
        let count = self.all.len() as isize;
        let leads_back = count > 1 && steps % count == 0;
        (0..count).filter_map(move |more| {
            let reached = self.taken as isize + steps + more * steps.signum();
            let taken = reached.rem_euclid(count) as usize;
            let counts = taken != self.taken || (more == 0 && leads_back);
            counts.then(|| Self { all: self.all.clone(), taken })
        })
    }
}

/// Returns a list that begins with `first`, the chosen strategy, and continues with the presets that are
/// meant for the device.
pub fn strategies(first: Strategy, device: &DeviceInfo) -> Choices<Strategy> {
    let meant = PRESETS.iter().filter(|preset| preset.meant_for.is_none_or(|kind| kind == device.kind));
    Choices::of(first, meant.map(|preset| preset.strategy))
}

/// Returns a list that begins with `first`, the chosen local size, and continues with other usual local
/// sizes.
pub fn local_sizes(first: [u32; 2]) -> Choices<[u32; 2]> {
    Choices::of(
        first,
        [[1, 1], [4, 4], [8, 4], [8, 8], [16, 8], [16, 16], [32, 1], [32, 8], [64, 1], [64, 4]],
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_go_round_and_meet_each_other_once() {
        let choices = Choices::of(3, [1, 2, 3]);
        assert_eq!(choices.taken(), 3);
        let met = |step| choices.others(step).map(|other| other.taken()).collect::<Vec<_>>();
        assert_eq!((met(1), met(-1)), (vec![1, 2], vec![2, 1]));
        assert_eq!((met(2), met(-5), met(3)), (vec![2, 1], vec![1, 2], vec![3, 1, 2]));
        let second = choices.others(1).next().expect("one");
        assert_eq!((choices.taken_after_first(), second.taken_after_first()), (None, Some(1)));
        assert_eq!(second.others(1).map(|other| other.taken()).collect::<Vec<_>>(), [2, 3]);
        assert_eq!(Choices::of(3, []).others(1).count(), 0);
    }

    #[test]
    fn presets_for_other_kinds_of_device_are_no_choice() {
        use crate::device::DeviceKind;
        let naive = crate::strategy::preset("naive").expect("a preset").strategy;
        let asleep = crate::experiment::asleep::device(1.0);
        let of = |kind| {
            let choices = strategies(naive, &DeviceInfo { kind, ..asleep.clone() });
            assert_eq!(choices.taken(), naive);
            choices.all
        };
        let meant = |kind: DeviceKind, all: &[Strategy]| {
            let named = |preset: &&crate::strategy::Preset| all.contains(&preset.strategy);
            PRESETS.iter().filter(named).all(|preset| preset.meant_for.is_none_or(|own| own == kind))
        };
        let [cpu, gpu] = [DeviceKind::Cpu, DeviceKind::Gpu].map(|kind| (kind, of(kind)));
        assert!(meant(cpu.0, &cpu.1) && meant(gpu.0, &gpu.1) && cpu.1 != gpu.1);
        let sizes = local_sizes([8, 8]);
        assert_eq!(sizes.others(1).next().map(|size| size.taken()), Some([1, 1]));
    }
}
