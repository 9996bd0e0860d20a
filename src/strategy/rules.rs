//! Which combinations of values make sense.

use super::{AXES, Epsilons, Layout, Math, Passes, Shading, Strategy, Triangles};
use crate::error::{Error, Result};
use crate::manifest::Rule;

impl Strategy {
    /// Refuses combinations that make no sense on any device, with the reason.
    pub fn check(&self) -> Result<()> {
        match self.contradiction() {
            Some(reason) => Err(Error::input(format!("this strategy makes no sense: {reason}"))
                .with_help("change one of these axes; `raycl strategies` lists the values of each")),
            None => Ok(()),
        }
    }

    /// Why this combination makes no sense on any device, if so: its family does not take a value, or two values
    /// contradict each other.
    pub fn contradiction(&self) -> Option<String> {
        let family = self.family();
        let broken = family.broken_rule(&self.built_in_axes());
        let refused = broken.map(|(rule, value)| refusal(family.label, rule, value));
        refused.or_else(|| self.conflict().map(str::to_owned)).or_else(|| self.added_conflict())
    }

    /// Why two of its values contradict each other in any family, if so.
    fn conflict(&self) -> Option<&'static str> {
        let eager = self.shading == Shading::Eager;
        let planes = self.intersector.prepares_planes();
        let tiled = self.triangles == Triangles::Tiled;
        let rules = [
            (eager && tiled, "shading = eager with triangles = tiled would put a barrier in divergent flow"),
            (
                eager && self.passes == Passes::Separate,
                "shading = eager shades inside the traversal, so passes must be fused",
            ),
            (
                self.math == Math::Fast && self.intersector.needs_exact_signs(),
                "intersector = watertight needs exact signs, which math = fast does not keep",
            ),
            (
                self.epsilons == Epsilons::Paper && !self.intersector.has_paper_epsilons(),
                "epsilons = paper are numbers of the moller-trumbore test",
            ),
            (
                planes && self.layout != Layout::Soup,
                "intersector = common-origin and pixel-linear read a table of their own, a row a triangle: layout = soup",
            ),
            (
                planes && !(self.triangles == Triangles::Global || tiled),
                "intersector = common-origin and pixel-linear read a table that differs between the eye and each light: triangles = global or tiled",
            ),
            (
                eager && self.intersector.counts_in_pixels(),
                "intersector = pixel-linear looks for the nearest hit along depths, not distances, and shades there: shading = deferred",
            ),
        ];
        rules.into_iter().find(|(broken, _)| *broken).map(|(_, reason)| reason)
    }
}

/// What is said where a family does not take a value: the axis, the family, why, and what is taken instead.
fn refusal(label: &str, rule: &Rule, value: &str) -> String {
    let Rule { axis, takes, because } = rule;
    let all = AXES.iter().find(|info| info.name == *axis).map_or(&[][..], |info| info.values);
    let taken: Vec<_> = all.iter().map(|(value, _)| *value).filter(|value| takes.take(value)).collect();
    format!("{axis} = {value}, but {label} {because}: {axis} = {}", taken.join(" or "))
}

#[cfg(test)]
mod tests {
    use super::super::*;
    use crate::manifest::FAMILIES;
    use std::collections::HashSet;

    /// Strategies of each family, one of which takes whatever the family takes.
    fn bases() -> impl Iterator<Item = Strategy> {
        let all = PRESETS.iter().map(|preset| preset.strategy);
        let deferred = |strategy: Strategy| Strategy {
            shading: Shading::Deferred,
            epsilons: Epsilons::Relative,
            math: Math::Strict,
            ..strategy
        };
        let passes =
            |strategy: Strategy| Passes::ALL.iter().map(move |&passes| Strategy { passes, ..strategy });
        all.flat_map(move |strategy| [strategy, deferred(strategy)]).flat_map(passes)
    }

    /// Every value that a rule of a family leaves out is refused there, whatever the rest; every other value is taken
    /// by some strategy of the family.
    #[test]
    fn a_family_refuses_what_it_does_not_take_and_takes_the_rest() {
        let mut refused = 0;
        for family in FAMILIES {
            for info in AXES {
                // What chooses the family is no value of it.
                let chooses =
                    info.name == "traversal" || (info.name == "width" && family.name.starts_with("tile"));
                for (value, _) in info.values.iter().filter(|_| !chooses) {
                    let of_family = bases().filter(|base| std::ptr::eq(base.family(), family));
                    let reasons: Vec<_> = of_family
                        .map(|mut strategy| {
                            strategy.set(info.name, value).unwrap_or_else(|error| panic!("{error}"));
                            strategy.contradiction()
                        })
                        .collect();
                    assert!(!reasons.is_empty(), "no preset of {}", family.name);
                    let rule = family.rules.iter().find(|rule| rule.axis == info.name);
                    if rule.is_none_or(|rule| rule.takes.take(value)) {
                        assert!(
                            reasons.contains(&None),
                            "{} {} {value}: {reasons:?}",
                            family.name,
                            info.name
                        );
                        continue;
                    }
                    refused += 1;
                    for reason in reasons {
                        let reason = reason.unwrap_or_default();
                        assert!(reason.contains(family.label), "{} {value}: {reason}", info.name);
                    }
                }
            }
        }
        assert!(refused > 60, "{refused}");
    }

    #[test]
    fn every_rule_names_an_axis_and_leaves_something() {
        for family in FAMILIES {
            let axes: HashSet<_> = family.rules.iter().map(|rule| rule.axis).collect();
            assert_eq!(axes.len(), family.rules.len(), "{}: an axis has one rule", family.name);
            for rule in family.rules {
                let info = AXES.iter().find(|info| info.name == rule.axis);
                let info = info.unwrap_or_else(|| panic!("{} is no axis", rule.axis));
                let taken = info.values.iter().filter(|(value, _)| rule.takes.take(value)).count();
                assert!((1..info.values.len()).contains(&taken), "{} {}", family.name, rule.axis);
            }
        }
    }

    #[test]
    fn a_refusal_names_axis_family_and_what_is_taken() {
        let mut tile = preset("tile").map(|preset| preset.strategy).unwrap_or_else(|error| panic!("{error}"));
        tile.intersector = Intersector::MollerTrumbore;
        assert_eq!(
            tile.contradiction().unwrap_or_default(),
            "intersector = moller-trumbore, but traversal = tile with vectors of rays (width = 16) prepares a leaf's \
             triangles for all rays of a tile: intersector = watertight or edge-planes"
        );
    }

    #[test]
    fn trees_keep_the_defaults_of_triangles_and_layout_and_say_why() {
        for name in ["bvh", "bvh-packet", "tile"] {
            let base = preset(name).map(|preset| preset.strategy).unwrap_or_else(|error| panic!("{error}"));
            let of = |axis: &str, value: &str| {
                let mut strategy = base;
                strategy.set(axis, value).unwrap_or_else(|error| panic!("{error}"));
                strategy.contradiction()
            };
            let others = |all: &'static [(&str, &str)], own: &'static str| {
                all.iter().map(|(value, _)| *value).filter(move |value| *value != own)
            };
            for value in others(Triangles::INFO.values, "global") {
                let reason = of("triangles", value).unwrap_or_default();
                assert!(reason.contains("order of its tree"), "{name} triangles={value}: {reason}");
            }
            for value in others(Layout::INFO.values, "soup") {
                let reason = of("layout", value).unwrap_or_default();
                assert!(reason.contains("order of its tree"), "{name} layout={value}: {reason}");
            }
            assert!(of("intersector", "common-origin").is_some(), "{name}");
        }
    }

    #[test]
    fn tiles_keep_the_defaults_of_vectors_shading_and_width() {
        for (axis, value) in [("vectors", "local"), ("shading", "eager"), ("width", "8")] {
            let mut tile =
                preset("tile").map(|preset| preset.strategy).unwrap_or_else(|error| panic!("{error}"));
            tile.set(axis, value).unwrap_or_else(|error| panic!("{error}"));
            assert!(tile.contradiction().is_some(), "{axis}={value}");
        }
    }
}
