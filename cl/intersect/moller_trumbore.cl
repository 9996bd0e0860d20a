// Moeller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", JGT 2(1), 1997.
// Weights stay multiplied by |a| until a ray is known to hit, so that a miss costs no division.

#define PLANES_OF_ORIGIN 0

typedef struct {
    varying t_min;
} Probe;

Probe prepare_probe(varying t_min, Vec3 direction) {
    Probe probe;
    probe.t_min = t_min;
    return probe;
}

#if PAPER_EPSILONS
#define PARALLEL(size) ((size) <= 1e-7f)
#define OUTSIDE_BY(size) (-1e-10f * (size))
#else
// Triangles count as this much larger than they are, relative to themselves: rounding opens no gap along an edge
// that rays follow exactly. (Rays aimed at edges from anywhere need the watertight test all the same.)
#define PARALLEL(size) ((size) == 0.0f)
#define OUTSIDE_BY(size) (-1e-6f * (size))
#endif

// Lanes whose ray hits the triangle at t_min < t < t_max, and where.
Mask intersect(const Probe *probe, Vec3 origin, Vec3 direction, Row row, varying t_max, Hit *hit) {
    const Vec3 v0 = splat(row.a);
    const Vec3 e1 = splat(uniform_difference(row.b, row.a));
    const Vec3 e2 = splat(uniform_difference(row.c, row.a));
    const Vec3 q = cross3(direction, e2);
    const varying a = dot3(e1, q);
    const varying_int sign = sign_bit(a);
    const varying size = flip_sign(a, sign);
    const Vec3 s = subtract(origin, v0);
    const varying w1 = flip_sign(dot3(s, q), sign);
#if CULL_BACK
    Mask inside = (a > 0.0f) & !PARALLEL(size);
#else
    Mask inside = !PARALLEL(size);
#endif
    inside &= (w1 >= OUTSIDE_BY(size)) & (w1 <= size - OUTSIDE_BY(size));
    if (!ANY(inside)) return inside;

    const Vec3 r = cross3(s, e1);
    const varying w2 = flip_sign(dot3(direction, r), sign);
    inside &= (w2 >= OUTSIDE_BY(size)) & (size - w1 - w2 >= OUTSIDE_BY(size));
    if (!ANY(inside)) return inside;

    const varying per_size = 1.0f / size;
    hit->t = flip_sign(dot3(e2, r), sign) * per_size;
    hit->w1 = w1 * per_size;
    hit->w2 = w2 * per_size;
    return inside & (hit->t > probe->t_min) & (hit->t < t_max);
}
