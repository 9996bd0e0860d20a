// meaning: Moeller and Trumbore 1997, as the paper does
// record_floats: 12
// prepared_for: any-ray
// exact_signs: no
// operations: 15
//
// Moeller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", JGT 2(1), 1997. The weights are divided by
// the determinant a only if a ray is inside all edges, so most misses cost no division. Most misses are found after
// 15 operations: 6 for direction x e2, 3 for the determinant a, 3 for origin - v0, and 3 for the first weight. If a
// triangle's row is not computed in advance, its edges e1 and e2 take 6 operations more, which are not counted.

#ifndef PAPER_EPSILONS
#error "PAPER_EPSILONS: 0 or 1: whether epsilons = paper"
#endif

// This test prepares nothing per ray: the test's probe (what a test prepares for a ray) contains only t_min.
typedef struct {
    varying t_min;
} Probe;

static Probe prepare_probe(varying t_min, Vec3 direction) {
    Probe probe;
    probe.t_min = t_min;
    return probe;
}

// A row (the data that the test reads of a triangle) holds a corner, two edges, and three numbers:
#define SLACK1(row) (row).u  // the rounding error allowed for w1, per unit of distance
#define SLACK2(row) (row).v  // the rounding error allowed for w2, per unit of distance
#define EDGE_ON(row) (row).w // if |a| is at most this, the triangle is seen edge-on, and is not hit

#if PAPER_EPSILONS
#define DISTANCE(size, s) (size)
#else
#define DISTANCE(size, s) (fabs((s).x) + fabs((s).y) + fabs((s).z))
#endif

// Returns a triangle's row. A barycentric weight may be below 0 or above 1 by its *slack*, a bound of its rounding
// error. Rays then hardly ever slip through between two triangles (no ray does with the watertight test). If a triangle
// is seen nearly edge-on, it is not hit, since perhaps no digit of the determinant `a` is correct. With PAPER_EPSILONS,
// the slacks of weights and the limit of `a` are the paper's constants. Without PAPER_EPSILONS, a weight's slack is
// proportional to the distance between the ray's origin and the corner, and to the size (1-norm) of the edge in the
// weight's cross product. The limit that |a| must exceed is then proportional to the product of both edges' sizes.
static Row row_of(Corners corners) {
    Row row;
    row.a = corners.a;
    row.b = uniform_difference(corners.b, corners.a);
    row.c = uniform_difference(corners.c, corners.a);
#if PAPER_EPSILONS
    SLACK1(row) = SLACK2(row) = 1e-10f;
    EDGE_ON(row) = 1e-7f;
#else
    const float size1 = uniform_size(row.b), size2 = uniform_size(row.c);
    SLACK1(row) = ROUNDING * size2;
    SLACK2(row) = ROUNDING * size1;
    EDGE_ON(row) = EDGE_ON_ROUNDING * size1 * size2;
#endif
    return row;
}

// Stores in `hit` the lanes whose ray hits the triangle at t_min < t < t_max, with t and the weights. Returns 0 only if
// no lane hits; hit->lanes is then not set. After a return of 1, hit->lanes may still be empty.
int intersect(const Probe *probe, Vec3 origin, Vec3 direction, Row row, varying t_max, Hit *hit) {
    // Moeller and Trumbore's formulas: q = d x e2, a = e1 . q, s = origin - v0, r = s x e1; w1 = s . q / a,
    // w2 = d . r / a, t = e2 . r / a.
    const Vec3 e1 = splat(row.b), e2 = splat(row.c);
    const Vec3 q = cross3(direction, e2);
    const varying a = dot3(e1, q);
    // Instead of dividing by `a`, this function multiplies the numerators by the sign of `a`, and compares the products
    // with |a|. The comparison is the same for front and back faces.
    const varying_int sign = sign_bit(a);
    const varying size = fabs(a);
    // The variable w1 is the weight times |a|. A weight from 0 to 1, with slack, means -slack1 <= w1 <= |a| + slack1.
    const Vec3 s = subtract(origin, splat(row.a));
    const varying distance = DISTANCE(size, s);
    const varying w1 = flip_sign(dot3(s, q), sign);
    const varying slack1 = SLACK1(row) * distance;
    const varying reach1 = size + slack1;
    const Mask inside1 = (w1 >= -slack1) & (w1 <= reach1);
    if (!ANY(inside1)) return 0;

    // Few rays pass the test of the weight w1. The weight w2, and the condition that the sum of both weights is at most
    // 1, are tested like w1.
    const Vec3 r = cross3(s, e1);
    const varying w2 = flip_sign(dot3(direction, r), sign);
    const varying slack2 = SLACK2(row) * distance;
    const Mask inside = inside1 & (w2 >= -slack2) & (w1 + w2 <= reach1 + slack2);
    if (!ANY(inside)) return 0;

    const varying per_size = 1.0f / size;
    hit->t = flip_sign(dot3(e2, r), sign) * per_size;
    hit->w1 = w1 * per_size;
    hit->w2 = w2 * per_size;
    // A ray within the edges still misses if t is not between t_min and t_max, if the triangle is seen edge-on, or if
    // |a| is at most slack1 or slack2. A slack of |a| or more would at least double the triangle's length. A triangle
    // with so small an |a| looks so narrow that its neighbours' slacks cover it.
    const varying least = max(max(slack1, slack2), EDGE_ON(row));
    hit->lanes = inside & (size > least) & (hit->t > probe->t_min) & (hit->t < t_max);
#if CULL_BACK
    hit->lanes &= a > 0.0f; // a = -direction . (e1 x e2) is positive if the ray runs against the front's normal
#endif
    return 1;
}
