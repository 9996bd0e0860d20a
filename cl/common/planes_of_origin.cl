// Computes the planes through the edges of triangles and the common origin of rays (the eye, or a light).

// Returns the normal of the plane through the origin and an edge: edge x (p + q) = 2 p x q. The edge's ends p and q are
// relative to the origin; `edge` is p - q. Swapping p and q changes only the signs of the normal's components.
static Uniform3 edge_plane(Uniform3 edge, Uniform3 p, Uniform3 q) {
    return uniform_cross(edge, uniform3(p.x + q.x, p.y + q.y, p.z + q.z));
}

// Returns the absolute value of the factor by which a triangle's planes are multiplied: 1 / the overlap of neighbouring
// triangles (see SHARED_EDGE_SLACK), where the overlap is rounded down to a power of two. `shortest` is the size of the
// shortest edge, and `longer` the size of the longer of the edges e1 and e2. `slack` is the overlap at an edge (in the
// unit of the edge functions), divided by the edge's size. Multiplying by a power of two does not round. Two triangles'
// planes for their shared edge therefore differ only by the sign and by a power of two.
static float per_overlap(float slack, float shortest, float longer) {
    const float overlap = max(slack * min(longer, OVERLAP_EDGES * shortest), FLT_MIN);
    return 1.0f / as_float(as_int(overlap) & 0x7f800000); // the mask keeps only the exponent, bits 30 to 23
}

// Returns the row (the planes) of a triangle that no ray hits. A ray with a component along x lies on the outer side of
// the first or the second edge. A ray whose direction's x is 0 or nearly 0 misses because its 1 / t is 0.
static Row row_of_nothing() {
    Row row;
    row.a = uniform3(1e30f, 0.0f, 0.0f);
    row.b = uniform3(-1e30f, 0.0f, 0.0f);
    row.c = uniform3(0.0f, 0.0f, 0.0f);
    row.u = row.v = row.w = 0.0f;
    return row;
}

// Returns the row (the planes) of a triangle for rays from an origin. A triangle that is edge-on or culled gets a row
// that is never hit. The dot product of the normal and a corner (relative to the origin) has the sign of `front` for
// front faces. Edges are computed from the stored corners, because corners relative to a distant origin have lost their
// last digits. Each plane is divided by the overlap of neighbouring triangles. A test can therefore add the overlap by
// adding 1 to an edge function.
Row planes_of(Corners corners, Uniform3 origin, float front) {
    const Uniform3 a = uniform_difference(corners.a, origin);
    const Uniform3 b = uniform_difference(corners.b, origin);
    const Uniform3 c = uniform_difference(corners.c, origin);
    const Uniform3 e1 = uniform_difference(corners.b, corners.a), e2 = uniform_difference(corners.c, corners.a);
    const Uniform3 n = uniform_cross(e1, e2);
    // `height` is six times the signed volume of the tetrahedron that the origin and the triangle form. If `height` is
    // near zero, the origin lies nearly in the triangle's plane. A ray that hits the triangle at the distance t has the
    // determinant height / t. All rays miss if this determinant is no larger than its rounding error even at the
    // distance `nearest` (in the 1-norm, no point of the triangle is nearer), or if |height| is at most
    // LEAST_VISIBLE. The bound of the rounding error contains `nearest` instead of `distance`, because the first corner
    // may be much farther away than other points of the triangle.
    const float height = uniform_dot(a, n);
    const float size1 = uniform_size(e1), size2 = uniform_size(e2), longer = max(size1, size2);
    const float distance = uniform_size(a), nearest = max(distance - longer, 0.0f);
    int hit = fabs(height) > max(EDGE_ON_ROUNDING * nearest * size1 * size2, LEAST_VISIBLE(distance, longer));
#if CULL_BACK
    hit &= height * front > 0.0f;
#endif
    if (!hit) return row_of_nothing();

    const float slack = SHARED_EDGE_SLACK * distance;
    const Uniform3 e3 = uniform_difference(corners.b, corners.c);
    // All three planes are oriented so that edge functions are positive inside, on whichever side the origin is. They
    // are multiplied by one factor, `by`, so that edge functions divided by their sum are a hit's barycentric weights.
    const float shortest = min(min(size1, size2), uniform_size(e3));
    const float by = copysign(per_overlap(slack, shortest, longer), height);
    // 1 / t = d . n / height (n is the normal) is linear in the direction d, like the edge functions.
    const Uniform3 per_t = uniform_scale(n, 1.0f / height);
    Row row;
    row.a = uniform_scale(edge_plane(e3, b, c), by);
    row.b = uniform_scale(edge_plane(e2, c, a), by);
    row.c = uniform_scale(edge_plane(uniform_difference(corners.a, corners.b), a, b), by);
    row.u = per_t.x, row.v = per_t.y, row.w = per_t.z;
    return row;
}
