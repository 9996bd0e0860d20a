//! The arithmetic operations of a ray-triangle test.

use crate::strategy::{Axis, Intersector};

/// Returns the number of floating-point operations of a ray-triangle test. Most rays miss the triangle, so the number
/// includes only the operations up to the point at which most misses are found. Additions, multiplications and fused
/// multiply-adds count as one each. Comparisons, sign changes, minima and the tolerances of edges do not
/// count as operations. On GPUs, a common-origin test takes the edges one by one, and may end after one or two
/// edges, but its count includes all three. The count is `operations` in the header of the test's file. The function
/// returns `None` if the strategy names no test, or if the header has no `operations`.
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
