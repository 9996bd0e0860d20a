// Rays that share an origin O: primary rays the eye, shadow rays a light. With A = V0 - O, N = e1 x e2 and
// det = A.N, the planes N, e2 x A and A x e1, divided by det, give a ray's 1/t and its weights over t as three
// dot products. prepare_origins makes them once a frame, for the eye and for each light.

#define PLANES_OF_ORIGIN 1

// Triangles are this much larger than they are, relative to themselves, so that rounding opens no gap along an edge
// that rays follow exactly. It is in the planes already, and costs a test nothing.
#define EDGE_SLACK 1e-6f

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
    const varying w0 = per_t * (1.0f + 3.0f * EDGE_SLACK) - (w1 + w2);
    const Mask inside = (min(min(w0, w1), w2) >= 0.0f) & (per_t * t_max > 1.0f);
    if (!ANY(inside)) return inside;

    hit->t = 1.0f / per_t;
    hit->w1 = w1 * hit->t;
    hit->w2 = w2 * hit->t;
    return inside & (hit->t > probe->t_min);
}

// One triangle's planes for one origin; zeros, which no ray hits, where it is edge-on or culled.
void store_planes(Row corner, Uniform3 origin, float front, __global float *row) {
    const Uniform3 a = uniform_difference(corner.a, origin);
    const Uniform3 e1 = uniform_difference(corner.b, corner.a);
    const Uniform3 e2 = uniform_difference(corner.c, corner.a);
    const Uniform3 n = uniform_cross(e1, e2);
    const float det = uniform_dot(a, n);
#if CULL_BACK
    const int seen = det * front > 0.0f;
#else
    const int seen = det != 0.0f;
#endif
    const float per_det = 1.0f / det;
    const float k = seen && isfinite(per_det) ? per_det : 0.0f;
    const Uniform3 w1 = uniform_cross(e2, a);
    const Uniform3 w2 = uniform_cross(a, e1);
    row[0] = n.x * k;
    row[1] = n.y * k;
    row[2] = n.z * k;
    row[3] = (w1.x + EDGE_SLACK * n.x) * k;
    row[4] = (w1.y + EDGE_SLACK * n.y) * k;
    row[5] = (w1.z + EDGE_SLACK * n.z) * k;
    row[6] = (w2.x + EDGE_SLACK * n.x) * k;
    row[7] = (w2.y + EDGE_SLACK * n.y) * k;
    row[8] = (w2.z + EDGE_SLACK * n.z) * k;
}
