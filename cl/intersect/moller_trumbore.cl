// Moeller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", JGT 2(1), 1997.
// Weights stay multiplied by |a| until a ray is known to hit, so that a miss costs no division.

#define PLANES_OF_ORIGIN 0
#define ROUNDED_PLANES 1 // rays of a common origin may share planes, as rounding is allowed for

typedef struct {
    varying t_min;
} Probe;

Probe prepare_probe(varying t_min, Vec3 direction) {
    Probe probe;
    probe.t_min = t_min;
    return probe;
}

#if PAPER_EPSILONS
#define EDGE_ON(size, e1, e2) ((size) <= 1e-7f)
#define SLACK(edge, size, s) (1e-10f * (size))
#else
// A triangle nearly edge-on has a rounded to nothing known: it is not hit. Otherwise weights are allowed their rounding
// error, which grows with the distance that s spans and the edge it is crossed with, so that a ray along an edge
// falls through between no two triangles. (From anywhere at all, only the watertight test promises that.)
#define EDGE_ON(size, e1, e2) ((size) <= 1e-5f * uniform_size(e1) * uniform_size(e2))
#define SLACK(edge, size, s) ((ROUNDING * uniform_size(edge)) * (fabs((s).x) + fabs((s).y) + fabs((s).z)))
#endif

// Lanes whose ray hits the triangle at t_min < t < t_max, and where.
Mask intersect(const Probe *probe, Vec3 origin, Vec3 direction, Row row, varying t_max, Hit *hit) {
    const Uniform3 edge1 = uniform_difference(row.b, row.a), edge2 = uniform_difference(row.c, row.a);
    const Vec3 v0 = splat(row.a), e1 = splat(edge1), e2 = splat(edge2);
    const Vec3 q = cross3(direction, e2);
    const varying a = dot3(e1, q);
    const varying_int sign = sign_bit(a);
    const varying size = flip_sign(a, sign);
    const Vec3 s = subtract(origin, v0);
    const varying w1 = flip_sign(dot3(s, q), sign);
    const varying slack1 = SLACK(edge2, size, s);
#if CULL_BACK
    Mask inside = (a > 0.0f) & !EDGE_ON(size, edge1, edge2);
#else
    Mask inside = !EDGE_ON(size, edge1, edge2);
#endif
    inside &= (w1 >= -slack1) & (w1 <= size + slack1);
    if (!ANY(inside)) return inside;

    const Vec3 r = cross3(s, e1);
    const varying w2 = flip_sign(dot3(direction, r), sign);
    const varying slack2 = SLACK(edge1, size, s);
    inside &= (w2 >= -slack2) & (w1 + w2 <= size + slack1 + slack2);
    if (!ANY(inside)) return inside;

    const varying per_size = 1.0f / size;
    hit->t = flip_sign(dot3(e2, r), sign) * per_size;
    hit->w1 = w1 * per_size;
    hit->w2 = w2 * per_size;
    return inside & (hit->t > probe->t_min) & (hit->t < t_max);
}
