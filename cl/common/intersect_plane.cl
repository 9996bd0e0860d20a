// Returns each lane's hit on the triangle with the corner v0 and the edges e1 and e2 from v0: the distance t along the
// ray, and the weights. Directions have length 1. The rays are known to hit, so the function tests no edges, and does
// not set `hit.lanes`. Every strategy with shading = deferred computes t and the weights of its hits again with this
// function, so that shading does not depend on the test or rasteriser that found a hit. In very thin triangles,
// rounding can give arbitrary weights. The weights are therefore clamped to the triangle, so that the hit stays on the
// triangle, and its normal stays between the corners' normals.
static Hit intersect_plane(Vec3 v0, Vec3 e1, Vec3 e2, Vec3 origin, Vec3 direction) {
    // w1 and w2 solve origin + t direction = v0 + w1 e1 + w2 e2 by Cramer's rule; t follows from the clamped weights.
    const Vec3 s = subtract(origin, v0);
    const Vec3 q = cross3(direction, e2);
    const Vec3 r = cross3(s, e1);
    const varying per_a = 1.0f / dot3(e1, q);
    const varying zero = (varying)(0.0f), one = (varying)(1.0f);
    Hit hit;
    hit.w1 = min(max(dot3(s, q) * per_a, zero), one);
    hit.w2 = min(max(dot3(direction, r) * per_a, zero), one - hit.w1);
    hit.t = dot3(subtract(along(scale(e1, hit.w1), hit.w2, e2), s), direction);
    return hit;
}
