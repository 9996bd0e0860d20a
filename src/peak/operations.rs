//! Arithmetic a ray-triangle test cannot do without.

/// Floating-point operations of a test up to where most tests end, the first proof that the ray misses: additions,
/// multiplications and fused multiply-adds, each counted as one. Comparisons, sign changes, minima and the slack of
/// edges are not counted. Where edges are asked one by one (on GPUs), some tests end after one or two of the three planes
/// that are counted here. None for a strategy that names no intersector.
///
/// | intersector | operations | what they are |
/// |---|---|---|
/// | `moller-trumbore` | 15 | direction x e2 6, a 3, origin - v0 3, first weight 3; 6 more for the edges where no row holds them |
/// | `common-origin` | 9 | three planes |
/// | `edge-planes` | 9 | three planes |
/// | `pixel-linear` | 6 | three planes, linear in the pixel |
/// | `watertight` | 50 | corners 9, sheared x and y 30 (unfused, which it must be), edge functions 9, their sum 2 |
pub fn operations_per_test(strategy: &str) -> Option<u32> {
    let axis = strategy.split_whitespace().find_map(|part| part.strip_prefix("intersector="))?;
    match axis {
        "moller-trumbore" => Some(15),
        "common-origin" | "edge-planes" => Some(9),
        "pixel-linear" => Some(6),
        "watertight" => Some(50),
        _ => None,
    }
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
