// Rays that share an origin O: primary rays the eye, shadow rays a light. With A = V0 - O, N = e1 x e2 and
// det = A.N, the planes N, e2 x A and A x e1, divided by det, give a ray's 1/t and its weights over t as three
// dot products. prepare_origins makes them once a frame, for the eye and for each light.

#define PLANES_OF_ORIGIN 1
#define ROUNDED_PLANES 1

typedef struct {
    varying t_min;
} Probe;

Probe prepare_probe(varying t_min, Vec3 direction) {
    Probe probe;
    probe.t_min = t_min;
    return probe;
}

// Lanes whose ray hits the triangle at t_min < t < t_max, and where.
Mask intersect(const Probe *probe, Vec3 origin, Vec3 direction, Row row, varying t_max, Hit *hit) {
    const varying per_t = row.a.x * direction.x + row.a.y * direction.y + row.a.z * direction.z;
    const varying w1 = row.b.x * direction.x + row.b.y * direction.y + row.b.z * direction.z;
    const varying w2 = row.c.x * direction.x + row.c.y * direction.y + row.c.z * direction.z;
    const varying w0 = per_t - w1 - w2;
    const Mask inside = (min(min(w0, w1), w2) >= -row.slack) & (per_t * t_max > 1.0f);
    if (!ANY(inside)) return inside;

    hit->t = 1.0f / per_t;
    hit->w1 = w1 * hit->t;
    hit->w2 = w2 * hit->t;
    return inside & (hit->t > probe->t_min);
}

// One triangle's planes for one origin; zeros, which no ray hits, where it is edge-on or culled.
Row planes_of(Row corner, Uniform3 origin, float front) {
    const Uniform3 a = uniform_difference(corner.a, origin);
    const Uniform3 e1 = uniform_difference(corner.b, corner.a);
    const Uniform3 e2 = uniform_difference(corner.c, corner.a);
    const Uniform3 n = uniform_cross(e1, e2);
    const float det = uniform_dot(a, n);
    const float size1 = uniform_size(e1), size2 = uniform_size(e2), distance = uniform_size(a);
    int seen = fabs(det) > 1e-5f * distance * size1 * size2;
#if CULL_BACK
    seen &= det * front > 0.0f;
#endif
    const float k = seen ? 1.0f / det : 0.0f;
    Row row;
    row.a = uniform_scale(n, k);
    row.b = uniform_scale(uniform_cross(e2, a), k);
    row.c = uniform_scale(uniform_cross(a, e1), k);
    // As much as rounding may move a weight: triangles overlap by so little rather than leave gaps.
    const float rounding = front > 0.0f ? SHADOW_SLACK * ROUNDING : ROUNDING;
    row.slack = rounding * distance * max(size1, size2) * fabs(k);
    return row;
}
