//! The plan of an experiment: all its points, in groups that are compared with each other.

use std::collections::HashSet;

use crate::config::{Baseline, Experiment, SceneChoice};

/// All points of an experiment.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// The points of the experiment. Points that are compared with each other are adjacent. Within a group of
    /// compared points, points of the same scene are adjacent. Within a scene, points of the same device are
    /// adjacent.
    pub points: Vec<Point>,
    /// True if scenes are compared with each other.
    pub compare_scenes: bool,
}

/// A point of an experiment: one combination that is measured. Scenes and strategies are given by their
/// indices in the experiment's lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Point {
    /// The index of the scene in the experiment's list.
    pub scene: usize,
    /// The device that casts, as an index into the run's devices; `None` is the host.
    pub device: Option<usize>,
    /// What casts the rays: a kernel on the device, or a baseline on the host.
    pub work: Work,
    /// The image's numbers of pixels across and down.
    pub image_size: [u32; 2],
}

/// The caster of a point: a strategy or a baseline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Work {
    /// A kernel on an OpenCL device.
    Kernel {
        /// The index of the strategy in the experiment's list.
        strategy: usize,
        /// Local size: work-items of a work-group, across and down.
        local_size: [u32; 2],
    },
    /// A baseline: a caster on the host, which uses no OpenCL.
    Host(Baseline),
}

impl Plan {
    /// Makes the plan with all combinations of the experiment's lists, on `device_count` devices. A strategy
    /// that has two names in the experiment forms only one point at each local size.
    pub fn new(experiment: &Experiment, device_count: usize) -> Self {
        let host = experiment.baselines.iter().map(|&baseline| Work::Host(baseline)).collect::<Vec<_>>();
        let kernels = kernels(experiment);
        let mut points = Vec::new();
        for (scene, image_size) in cases(experiment) {
            let mut add = |device, works: &[Work]| {
                points.extend(works.iter().map(|&work| Point { scene, device, work, image_size }));
            };
            add(None, &host);
            for device in 0..device_count {
                add(Some(device), &kernels);
            }
        }
        Self { points, compare_scenes: experiment.compare_scenes }
    }

    /// Returns the groups of points that are compared with each other and measured in interleaved rounds. A group
    /// has one image size and, unless scenes are compared, one scene. A group includes casters on the host and all
    /// devices.
    pub fn groups(&self) -> impl Iterator<Item = &[Point]> {
        self.points.chunk_by(|one, other| self.compares(one, other))
    }

    /// Returns the groups of points for a run that is distributed over devices. Each device has its own
    /// groups, and so does the host. A group contains the indices of its points. If scenes are compared,
    /// the plan may have points of another device between the points of a group.
    pub fn groups_by_device(&self) -> Vec<Vec<usize>> {
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for (index, point) in self.points.iter().enumerate() {
            let has_it = |group: &&mut Vec<usize>| {
                let first = group.first().map(|first| &self.points[*first]);
                first.is_some_and(|first| self.compares(first, point) && first.device == point.device)
            };
            // The search begins with the last group, since most points belong to the same group as the
            // previous point.
            match groups.iter_mut().rev().find(has_it) {
                Some(group) => group.push(index),
                None => groups.push(vec![index]),
            }
        }
        groups
    }

    fn compares(&self, one: &Point, other: &Point) -> bool {
        one.image_size == other.image_size && (self.compare_scenes || one.scene == other.scene)
    }
}

/// Returns every scene at every image size. Combinations that are compared with each other are adjacent.
fn cases(experiment: &Experiment) -> Vec<(usize, [u32; 2])> {
    let scenes = 0..experiment.scenes.len();
    let mut cases: Vec<_> =
        scenes.flat_map(|scene| experiment.image_sizes.iter().map(move |size| (scene, *size))).collect();
    if experiment.compare_scenes {
        cases.sort_by_key(|(_, size)| experiment.image_sizes.iter().position(|known| known == size));
    }
    cases
}

/// Returns every strategy at each of its local sizes. If a strategy has several names with the same local size,
/// the first of these names is used for this local size.
fn kernels(experiment: &Experiment) -> Vec<Work> {
    let mut seen = HashSet::new();
    let mut works = Vec::new();
    for (strategy, named) in experiment.strategies.iter().enumerate() {
        for &local_size in &named.local_sizes {
            if seen.insert((named.strategy, local_size)) {
                works.push(Work::Kernel { strategy, local_size });
            }
        }
    }
    works
}

impl Point {
    /// Returns true if this point and `other` have the same scene and image size.
    pub fn has_scene_and_size_of(&self, other: &Self) -> bool {
        (self.scene, self.image_size) == (other.scene, other.image_size)
    }

    /// Formats this point of the experiment for progress and logs: "teapot 800x500 naive 16x16".
    pub fn label(&self, experiment: &Experiment) -> String {
        let scene = experiment.scenes.get(self.scene).map_or(String::new(), SceneChoice::label);
        let [width, height] = self.image_size;
        let work = match self.work {
            Work::Host(baseline) => format!("host {}", baseline.strategy()),
            Work::Kernel { strategy, local_size: [across, down] } => {
                let name = experiment.strategies.get(strategy).map_or("?", |named| &named.name);
                format!("{name} {across}x{down}")
            }
        };
        format!("{scene} {width}x{height} {work}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Emulate, NamedStrategy, Timing};
    use crate::strategy::PRESETS;
    use proptest::prelude::*;

    fn experiment(
        scenes: usize,
        images: u32,
        strategies: usize,
        locals: u32,
        baselines: usize,
    ) -> Experiment {
        let strategy = |preset: &crate::strategy::Preset| NamedStrategy {
            name: preset.name.into(),
            preset: Some(preset.name.into()),
            strategy: preset.strategy,
            local_sizes: (1..=locals).map(|side| [side, 2 * side]).collect(),
            meant_for: preset.meant_for,
        };
        Experiment {
            name: "test".into(),
            path: "test.toml".into(),
            question: "?".into(),
            expectation: "!".into(),
            scenes: (0..scenes).map(|scene| SceneChoice::file(format!("scenes/s{scene}.toml"))).collect(),
            left_out: Vec::new(),
            compare_scenes: false,
            devices: Vec::new(),
            image_sizes: (1..=images).map(|side| [side * 8, 5]).collect(),
            strategies: PRESETS[..strategies].iter().map(strategy).collect(),
            baselines: Baseline::ALL[..baselines].to_vec(),
            emulate: Emulate::default(),
            timing: Timing::default(),
            source: String::new(),
            overrides: Vec::new(),
        }
    }

    proptest! {
        #[test]
        fn a_plan_is_the_product_in_distinct_points(
            scenes in 1usize..4, images in 1u32..3, strategies in 0usize..6, locals in 1u32..5,
            baselines in 0usize..4, devices in 0usize..3,
        ) {
            let plan = Plan::new(&experiment(scenes, images, strategies, locals, baselines), devices);
            let cases = scenes * images as usize;
            let expected = cases * (baselines + devices * strategies * locals as usize);
            prop_assert_eq!(plan.points.len(), expected);
            let distinct: HashSet<_> = plan.points.iter().collect();
            prop_assert_eq!(distinct.len(), expected);
            let hosts = if baselines > 0 { cases } else { 0 };
            let kernels = if strategies > 0 { cases * devices } else { 0 };
            prop_assert_eq!(plan.groups_by_device().len(), hosts + kernels);
            prop_assert_eq!(plan.groups().count(), if hosts + kernels > 0 { cases } else { 0 });
        }
    }

    #[test]
    fn scenes_that_are_compared_are_one_group_of_each_size() {
        let experiment = Experiment { compare_scenes: true, ..experiment(3, 2, 2, 1, 1) };
        let plan = Plan::new(&experiment, 1);
        let groups: Vec<_> = plan.groups().collect();
        assert_eq!(groups.iter().map(|group| group.len()).collect::<Vec<_>>(), [9, 9]);
        assert!(groups.iter().all(|group| group.iter().all(|point| point.image_size == group[0].image_size)));
        // The first point of each scene is measured on the host, and the two other points on the device.
        let by_device = plan.groups_by_device();
        assert_eq!(by_device[..2], [vec![0, 3, 6], vec![1, 2, 4, 5, 7, 8]]);
        assert_eq!(by_device.iter().map(Vec::len).collect::<Vec<_>>(), [3, 6, 3, 6]);
        // The groups follow the order of the image sizes in the config, not the order of the numbers of
        // pixels.
        let largest_first = Experiment { image_sizes: vec![[16, 5], [8, 5]], ..experiment };
        let plan = Plan::new(&largest_first, 1);
        let sizes: Vec<_> = plan.groups().map(|group| group[0].image_size).collect();
        assert_eq!(sizes, largest_first.image_sizes);
    }

    #[test]
    fn the_same_strategy_under_two_names_runs_once() {
        let mut experiment = experiment(1, 1, 1, 3, 0);
        let mut twin = experiment.strategies[0].clone();
        twin.name = "twin".into();
        twin.local_sizes.push([64, 1]);
        experiment.strategies.push(twin);
        assert_eq!(Plan::new(&experiment, 1).points.len(), 4);
    }

    /// Four strategies are equal: naive, twin, more and last. Of the first three, only more has the local size of
    /// last, so last is measured under the name more.
    #[test]
    fn a_note_says_under_which_name_an_equal_strategy_is_measured() {
        let mut experiment = experiment(1, 1, 2, 3, 0);
        let like_first = |name: &str, local_sizes: &[[u32; 2]]| NamedStrategy {
            name: name.into(),
            local_sizes: local_sizes.to_vec(),
            ..experiment.strategies[0].clone()
        };
        let copies = [
            like_first("twin", &[[1, 2], [3, 6]]),
            like_first("more", &[[1, 2], [2, 4], [64, 1]]),
            like_first("last", &[[64, 1]]),
        ];
        assert_eq!(experiment.notes_on_equal_strategies(), Vec::<String>::new());
        experiment.strategies.extend(copies);
        let expected = [
            "Strategy twin equals naive on all axes; raycl measures only naive.",
            "Strategy more equals naive on all axes; at 1x2, 2x4, raycl measures only naive.",
            "Strategy last equals more on all axes; raycl measures only more.",
        ];
        assert_eq!(experiment.notes_on_equal_strategies(), expected);
    }

    #[test]
    fn labels_say_scene_size_and_work() {
        let experiment = experiment(1, 1, 1, 1, 1);
        let labels: Vec<_> =
            Plan::new(&experiment, 1).points.iter().map(|point| point.label(&experiment)).collect();
        assert_eq!(labels, ["s0 8x5 host serial-f32", "s0 8x5 naive 1x2"]);
    }

    #[test]
    fn points_of_one_scene_and_size_are_beside_each_other() {
        let point = |scene, width, device| Point {
            scene,
            device: Some(device),
            work: Work::Kernel { strategy: device, local_size: [8, 8] },
            image_size: [width, 5],
        };
        assert!(point(0, 8, 0).has_scene_and_size_of(&point(0, 8, 1)));
        assert!(!point(0, 8, 0).has_scene_and_size_of(&point(1, 8, 0)));
        assert!(!point(0, 8, 0).has_scene_and_size_of(&point(0, 16, 0)));
    }
}
