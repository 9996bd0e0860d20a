//! Checks which combinations of values of the axes are allowed.

use super::values::{replacing, values_of};
use super::{AXES, AxisInfo, Copied, Math, Passes, Records, Strategy};
use crate::error::{Error, Result};
use crate::manifest::Rule;

impl Strategy {
    /// Returns an error with the reason if this combination of values is not allowed on any device.
    pub fn check(&self) -> Result<()> {
        let Some(reason) = self.contradiction() else { return Ok(()) };
        let error = Error::input(format!("this combination of values is not allowed: {reason}"));
        let sets = self.sole_remedies().into_iter().map(|(axis, value)| format!("`{axis}={value}`"));
        let change = match sets.collect::<Vec<_>>().join(" or ") {
            none if none.is_empty() => "change one of these axes".to_owned(),
            some => format!("{some} allows it"),
        };
        Err(error.with_help(format!("{change}; `raycl strategies` lists the values of each axis")))
    }

    /// If two values contradict each other, finds the axes on which exactly one value would make the
    /// combination allowed. Returns each of these axes with its value. If the strategy's kernel family does
    /// not support one of the values, returns an empty list, since the message already names the supported
    /// values.
    pub fn sole_remedies(&self) -> Vec<(&'static str, &'static str)> {
        let is_refused = self.family().rules.iter().any(|rule| self.refusal(rule).is_some());
        if is_refused || self.contradiction().is_none() {
            return Vec::new();
        }
        let sole = |info: &AxisInfo| {
            let is_allowed = |(value, _): &(&str, &str)| {
                let mut with = *self;
                with.set(info.name, value).is_ok() && with.contradiction().is_none()
            };
            let mut allowed = info.values().into_iter().filter(is_allowed);
            let (value, _) = allowed.next()?;
            allowed.next().is_none().then_some((info.name, value))
        };
        AXES.iter().filter_map(sole).collect()
    }

    /// Returns why this combination is not allowed on any device: the strategy's family does not support a
    /// value, or two values contradict each other. `None` if the combination is allowed.
    pub fn contradiction(&self) -> Option<String> {
        let refused = self.family().rules.iter().find_map(|rule| self.refusal(rule));
        refused.or_else(|| self.conflict()).or_else(|| self.conflict_in_headers())
    }

    /// Returns true if a rule of a family allows `value` on the rule's axis, together with this strategy's
    /// other values.
    fn is_taken(&self, rule: &Rule, value: &str) -> bool {
        let mut with = *self;
        let has_file = |folder: &str| {
            values_of(rule.axis).any(|header| header.name == value && header.folders.contains(&folder))
        };
        with.set(rule.axis, value).is_ok() && rule.takes.take(value, has_file, |fact| with.holds(fact))
    }

    /// Returns the message if a family does not support a value: the axis, the family, the reason, and the
    /// supported values.
    fn refusal(&self, rule: &Rule) -> Option<String> {
        let Rule { axis, because, .. } = rule;
        let (_, value) = self.axes().into_iter().find(|(name, _)| name == axis)?;
        if self.is_taken(rule, value) {
            return None;
        }
        let all = AXES.iter().filter(|info| info.name == *axis).flat_map(|info| info.values());
        let taken: Vec<_> = all.map(|(value, _)| value).filter(|value| self.is_taken(rule, value)).collect();
        let label = self.family().label;
        Some(format!("{axis} = {value}, but {label} {because}; expected {axis} = {}", taken.join(" or ")))
    }

    /// Returns why two of the strategy's values contradict each other, whatever the strategy's kernel family is;
    /// `None` if no two values contradict each other.
    fn conflict(&self) -> Option<String> {
        let eager = self.shading.is_eager();
        let planes = self.intersector.prepares_planes();
        let records = self.records == Records::Once;
        let tables = self.triangles.take_tables();
        let rules = [
            (
                eager && self.triangles.copied() == Copied::Rows,
                "shading = {shading} with triangles = {triangles} would put a barrier where only some work-items reach it",
            ),
            (
                eager && self.passes == Passes::Separate,
                "shading = {shading} shades inside the traversal, so passes must be fused",
            ),
            (
                self.math == Math::Fast && self.intersector.needs_exact_signs(),
                "intersector = {intersector} needs exact signs, which math = fast does not preserve",
            ),
            (
                planes && self.layout.index_bits().is_some(),
                "intersector = {intersector} reads data that is computed in advance from the corners of triangles; \
                 raycl supports this only with layout = soup",
            ),
            (
                planes && !tables,
                "intersector = {intersector} reads data of the triangles that is computed in every frame, for the eye and for each light, and stored in global memory; ray-triangle tests can read this data only with triangles = global, or with triangles = tiled (from a copy in __local memory)",
            ),
            (
                planes && records,
                "intersector = {intersector} needs new data of every triangle in every frame, for the eye and for each light; records = once computes data only once, so records must be each-test",
            ),
            (
                records && !tables,
                "records = once stores data of every triangle in global memory; ray-triangle tests can read this data only with triangles = global, or with triangles = tiled (from a copy in __local memory)",
            ),
            (
                eager && self.intersector.counts_in_pixels(),
                "intersector = {intersector} computes the depth of a hit, but shading = {shading} needs the hit's distance, so shading must be deferred",
            ),
        ];
        let (_, reason) = rules.into_iter().find(|(broken, _)| *broken)?;
        let own = |text: String, (axis, value): (&str, &str)| text.replace(&format!("{{{axis}}}"), value);
        Some(self.axes().into_iter().fold(reason.to_owned(), own))
    }

    /// Returns why one of the strategy's values contradicts another one, according to the header of a kernel
    /// file; `None` if no header states a contradiction.
    fn conflict_in_headers(&self) -> Option<String> {
        let axes = self.axes();
        let headers =
            axes.iter().flat_map(|(axis, value)| values_of(axis).filter(move |header| header.name == *value));
        let mut pairs =
            headers.flat_map(|header| header.contradicts.iter().map(move |other| (header, other)));
        let (header, other) = pairs.find(|(_, other)| axes.contains(&(other.axis, &other.value)))?;
        let because = other.because.as_deref().unwrap_or("as the header of its file says");
        let whose = replacing(header).map_or(String::new(), |file| {
            format!(" (so says {file} in the folder of --cl-dir, which replaces the built-in file)")
        });
        let (axis, name) = (header.axis, &header.name);
        Some(format!("{axis} = {name} contradicts {} = {}: {because}{whose}", other.axis, other.value))
    }
}

#[cfg(test)]
mod tests {
    use super::super::*;
    use crate::manifest::FAMILIES;
    use crate::sources::Sources;
    use std::collections::HashSet;

    /// Returns strategies of every family. Each value that a family supports can be set in at least one of the family's
    /// strategies.
    fn bases() -> impl Iterator<Item = Strategy> {
        let all = PRESETS.iter().map(|preset| preset.strategy);
        let deferred = |strategy: Strategy| Strategy {
            shading: Shading::DEFERRED,
            epsilons: Epsilons::Relative,
            math: Math::Strict,
            ..strategy
        };
        let passes =
            |strategy: Strategy| Passes::all().into_iter().map(move |passes| Strategy { passes, ..strategy });
        all.flat_map(move |strategy| [strategy, deferred(strategy)]).flat_map(passes)
    }

    /// Checks that every value which a rule excludes is refused in all strategies of the family, and that every other
    /// value is accepted in at least one of these strategies.
    #[test]
    fn a_family_refuses_what_it_does_not_take_and_takes_the_rest() {
        let mut refused = 0;
        for family in FAMILIES {
            for info in AXES {
                // The values of these axes decide which family is used, so a strategy with another value may
                // belong to another family.
                let chooses =
                    info.name == "traversal" || (info.name == "width" && family.name.starts_with("tile"));
                for (value, _) in info.values().into_iter().filter(|_| !chooses) {
                    let of_family = bases().filter(|base| std::ptr::eq(base.family(), family));
                    // Some ray-triangle tests require epsilons = paper.
                    let guards = |base| [base, Strategy { epsilons: Epsilons::Paper, ..base }];
                    let reasons: Vec<_> = of_family
                        .flat_map(guards)
                        .map(|mut strategy| {
                            strategy.set(info.name, value).unwrap_or_else(|error| panic!("{error}"));
                            strategy.contradiction()
                        })
                        .collect();
                    assert!(!reasons.is_empty(), "no preset of {}", family.name);
                    let rule = family.rules.iter().find(|rule| rule.axis == info.name);
                    let base = bases().find(|base| std::ptr::eq(base.family(), family));
                    let takes = |rule| base.is_some_and(|base| base.is_taken(rule, value));
                    if rule.is_none_or(takes) {
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
                let base = bases().find(|base| std::ptr::eq(base.family(), family));
                let base = base.unwrap_or_else(|| panic!("no preset of {}", family.name));
                let taken = info.values().iter().filter(|(value, _)| base.is_taken(rule, value)).count();
                assert!((1..info.values().len()).contains(&taken), "{} {}", family.name, rule.axis);
            }
        }
    }

    #[test]
    fn a_refusal_names_axis_family_and_what_is_taken() {
        let mut tile = preset("tile").map(|preset| preset.strategy).unwrap_or_else(|error| panic!("{error}"));
        tile.intersector = Intersector::MOLLER_TRUMBORE;
        assert_eq!(
            tile.contradiction().unwrap_or_default(),
            "intersector = moller-trumbore, but traversal = tile with vectors of rays (width = 16) prepares a leaf's \
             triangles itself, once for all rays of a tile; expected intersector = edge-planes or watertight"
        );
    }

    #[test]
    fn a_rasteriser_takes_only_arithmetic_that_gives_the_same_bits_twice() {
        let mut raster =
            preset("raster").map(|preset| preset.strategy).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(raster.contradiction(), None);
        raster.math = Math::Fast;
        assert_eq!(
            raster.contradiction().unwrap_or_default(),
            "math = fast, but traversal = raster needs exactly equal depths in two kernels, and exactly opposite edges \
             in two triangles, which math = fast does not preserve; expected math = strict"
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
            let others = |all: AxisInfo, own: &'static str| {
                all.values().into_iter().map(|(value, _)| value).filter(move |value| *value != own)
            };
            for value in others(Triangles::INFO, "global") {
                let reason = of("triangles", value).unwrap_or_default();
                assert!(reason.contains("order of its tree"), "{name} triangles={value}: {reason}");
            }
            // The kernels that cast tiles in vectors of rays can read indexed normals.
            let has_file = |value: &str| name == "tile" && value == "indexed32";
            assert_eq!(of("layout", "indexed32").is_none(), has_file("indexed32"), "{name}");
            for value in others(Layout::INFO, "soup").filter(|value| !has_file(value)) {
                let reason = of("layout", value).unwrap_or_default();
                assert!(reason.contains("order of its tree"), "{name} layout={value}: {reason}");
            }
            assert!(of("intersector", "common-origin").is_some(), "{name}");
        }
    }

    #[test]
    fn a_width_with_which_no_tile_can_be_cast_is_blamed_before_other_values() {
        let mut count = 0;
        let tiles = |strategy: &Strategy| strategy.traversal.casts_tiles();
        for strategy in PRESETS.iter().map(|preset| preset.strategy).filter(tiles) {
            for width in [Width::W2, Width::W4, Width::W8] {
                let reason = Strategy { width, ..strategy }.contradiction().unwrap_or_default();
                assert!(reason.starts_with("width = "), "{reason}");
                assert!(reason.ends_with("; expected width = 1 or 16"), "{reason}");
                count += 1;
            }
        }
        assert!(count >= 6, "{count}");
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

    #[test]
    fn values_that_contradict_each_other_are_refused_with_the_reason() {
        let reason = |base: &str, values: &[(&str, &str)]| {
            let mut strategy =
                preset(base).map(|preset| preset.strategy).unwrap_or_else(|error| panic!("{error}"));
            for (axis, value) in values {
                strategy.set(axis, value).unwrap_or_else(|error| panic!("{error}"));
            }
            strategy.contradiction().unwrap_or_default()
        };
        let exact = [("intersector", "watertight"), ("math", "fast")];
        assert!(reason("deferred", &exact).contains("needs exact signs"), "{}", reason("deferred", &exact));
        assert_eq!(reason("deferred", &exact[..1]), "");
        let eager = [("shading", "eager"), ("passes", "separate")];
        assert!(reason("private", &eager).contains("passes must be fused"), "{}", reason("private", &eager));
    }

    /// Returns the strategy of a preset with some values replaced by `values`.
    fn with(base: &str, values: &[(&str, &str)]) -> Strategy {
        let mut strategy =
            preset(base).map(|preset| preset.strategy).unwrap_or_else(|error| panic!("{error}"));
        for (axis, value) in values {
            strategy.set(axis, value).unwrap_or_else(|error| panic!("{error}"));
        }
        strategy
    }

    #[test]
    fn the_help_names_a_value_if_it_is_the_only_one_of_its_axis_that_allows_the_combination() {
        let help = |base: &str, values: &[(&str, &str)]| {
            with(base, values).check().expect_err("a contradiction").remedy().to_owned()
        };
        let lists = "`raycl strategies` lists the values of each axis";
        let intersector = help("naive", &[("intersector", "watertight")]);
        assert_eq!(intersector, format!("`epsilons=relative` allows it; {lists}"));
        let math = help("deferred", &[("intersector", "watertight"), ("math", "fast")]);
        assert!(math.starts_with("`math=strict` allows it; "), "{math}");
        let passes = help("private", &[("passes", "separate")]);
        assert_eq!(passes, format!("`shading=deferred` or `passes=fused` allows it; {lists}"));
        // Tiles support two ray-triangle tests. The error's message already names both of these ray-triangle
        // tests, so the help does not name them.
        let tile = help("tile", &[("intersector", "moller-trumbore")]);
        assert_eq!(tile, format!("change one of these axes; {lists}"));
        // Kernels that walk a tree read triangles only from global memory. The message already names the
        // value `global`, so the help does not.
        let tree = help("bvh", &[("triangles", "local")]);
        assert_eq!(tree, format!("change one of these axes; {lists}"));
    }

    #[test]
    fn a_contradiction_of_a_file_that_replaces_a_built_in_one_names_the_file() {
        let file = "cast/intersect/moller_trumbore.cl";
        let folder = tempfile::tempdir().expect("a folder");
        let reason_with = |header: &str| {
            let text = Sources::Embedded.read(file).unwrap_or_else(|error| panic!("{error}"));
            std::fs::create_dir_all(folder.path().join("cast/intersect")).expect("a folder");
            std::fs::write(folder.path().join(file), format!("{header}{text}")).expect("a file");
            let values = Sources::Folder(folder.path().to_owned()).values();
            let values = values.unwrap_or_else(|error| panic!("{error}"));
            values.during(|| with("naive", &[]).contradiction())
        };
        assert_eq!(reason_with(""), None);
        let reason = reason_with("// contradicts: epsilons=paper because it is mine\n");
        let expected = "intersector = moller-trumbore contradicts epsilons = paper: it is mine (so says \
                        cast/intersect/moller_trumbore.cl in the folder of --cl-dir, which replaces the built-in file)";
        assert_eq!(reason.as_deref(), Some(expected));
        let watertight = with("naive", &[("intersector", "watertight")]).contradiction().unwrap_or_default();
        assert!(watertight.ends_with("numbers of the moller-trumbore test"), "{watertight}");
    }

    #[test]
    fn tables_are_for_triangles_that_are_read_where_the_host_put_them() {
        for value in ["constant", "local", "split-vertices", "split-normals"] {
            let mut once =
                preset("deferred").map(|preset| preset.strategy).unwrap_or_else(|error| panic!("{error}"));
            once.records = Records::Once;
            assert_eq!(once.contradiction(), None);
            once.set("triangles", value).unwrap_or_else(|error| panic!("{error}"));
            let reason = once.contradiction().unwrap_or_default();
            let expected = "records = once stores data of every triangle in global memory";
            assert!(reason.contains(expected), "{value}: {reason}");
        }
    }

    #[test]
    fn a_table_of_planes_takes_no_indexed_layout() {
        let prepared = |strategy: &Strategy| strategy.intersector.prepares_planes();
        let mut count = 0;
        for strategy in PRESETS.iter().map(|preset| preset.strategy).filter(prepared) {
            for layout in Layout::all().into_iter().filter(|layout| layout.index_bits().is_some()) {
                let reason = Strategy { layout, ..strategy }.contradiction().expect("a contradiction");
                assert!(reason.contains("soup"), "{reason}");
                count += 1;
            }
        }
        assert!(count >= 2, "{count}");
    }

    #[test]
    fn the_rasteriser_reads_triangles_from_global_or_constant_memory() {
        let reason = |triangles: &str| with("raster", &[("triangles", triangles)]).contradiction();
        assert_eq!(["global", "constant"].map(reason), [None, None]);
        for triangles in ["local", "tiled"] {
            let reason = reason(triangles).unwrap_or_default();
            assert!(reason.contains("reads each triangle once"), "{triangles}: {reason}");
        }
    }
}
