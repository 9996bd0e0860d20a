// The end of a shadow ray that is cast from a light to a hit, not from the hit to the light.

// A bound of the rounding error of the hit's distance from the light, relative to this distance: twice the error of
// four roundings (of at most 6e-8 each), rounded up, like AT_DISTANCE in src/reference/cast.rs.
#define ROUNDING_AT_DISTANCE 5e-7f
// gap_before_hit uses 1 / cosine of the angle between ray and normal, or MOST_PER_COSINE if that is less. If the cosine
// of this angle is below 1/50, a surface receives so little light that it does not matter if rounding shadows a pixel
// by mistake. Because of MOST_PER_COSINE, gap_before_hit allows for a rounding error of at most 2.5e-5 of the light's
// distance.
#define MOST_PER_COSINE 50.0f

// Returns the gap between the hit and the end of a shadow ray that is cast from a light. The gap is relative to the
// distance between light and hit. Usually, the gap is the shadow bias, so that the hit's own triangle does not shadow
// the hit. (`bias_per_distance` is the bias relative to the light's distance.) If the light is distant, the point where
// the ray meets the hit's own triangle may have a rounding error above the bias: then the gap is a bound of this error.
// Up to MOST_PER_COSINE, the bound is proportional to `per_cosine`, which is 1 / cosine of the angle between the ray
// and the normal.
static varying gap_before_hit(varying bias_per_distance, varying per_cosine) {
    return max(bias_per_distance, ROUNDING_AT_DISTANCE * min(per_cosine, (varying)(MOST_PER_COSINE)));
}
