//! Arithmetic a ray-triangle test cannot do without.

use crate::strategy::{Axis, Intersector};

/// Floating-point operations of a test up to where most tests end, the first proof that the ray misses: additions,
/// multiplications and fused multiply-adds, each counted as one. Comparisons, sign changes, minima and the slack of
/// edges are not counted. Where edges are asked one by one (on GPUs), some tests end after one or two of the three planes
/// that are counted here. Each intersector's
/// file has its count, `operations`; none for a strategy that names no intersector, or one whose file does not count them.
pub fn operations_per_test(strategy: &str) -> Option<u32> {
    let name = strategy.split_whitespace().find_map(|part| part.strip_prefix("intersector="))?;
    Intersector::parse(name).ok()?.operations()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategy::PRESETS;

    #[test]
    fn every_presets_test_has_a_count() {
        for preset in PRESETS {
            let text = preset.strategy.to_string();
            assert!(operations_per_test(&text).is_some_and(|count| count > 0), "{text}");
        }
        assert_eq!(operations_per_test("serial-f32"), None);
    }
}
