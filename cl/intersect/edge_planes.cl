// Rays that share an origin: primary rays the eye, shadow rays a light. Corners P and Q seen from there span the plane
// (P - Q) x (P + Q) = 2 P x Q, and a ray lies inside the edge PQ where its direction's dot product with that plane is
// positive; the triangle next door has the same plane with all signs turned. 1 / t is the dot product with N / N.A, where
// N = (B - A) x (C - A). prepare_origins makes a row a triangle once a frame, for the eye and for each light.

#define PLANES_OF_ORIGIN 1
#define ROUNDED_PLANES 1

#ifndef LINEAR_IN_PIXEL
#define LINEAR_IN_PIXEL 0
#endif

// Whether to ask after each edge if all rays are outside. Where vectors are made of scalars that saves what is left of most
// tests (43% faster on a GPU, 28% with planes that are linear in the pixel); where they are registers, a question costs more
// than an edge (10% slower on a CPU).
#if defined(HAS_REDUCE_OR)
#define ASK_EDGE_BY_EDGE 0
#else
#define ASK_EDGE_BY_EDGE 1
#endif

typedef struct {
    varying t_min;
    float overlap; // where the multiply-adds of edges begin
} Probe;

Probe prepare_probe(varying t_min, Vec3 direction) {
    Probe probe;
    probe.t_min = t_min;
    probe.overlap = 1.0f;
    return probe;
}

// Planes are scaled so that triangles overlap by 1, which costs nothing: it is where the multiply-adds begin. A ray counted
// in pixels has a z of 1, so that its planes hold the overlap themselves; what is added then is nothing (-0 + z is z).
float overlap_of(int origin) { return LINEAR_IN_PIXEL && !origin ? -0.0f : 1.0f; }

// What pixels share comes first: depth, then down.
varying along_plane(float begin, float x, float y, float z, Vec3 direction) {
    return begin + direction.z * z + direction.y * y + direction.x * x;
}

// How far inside an edge a direction is.
varying inside_edge(const Probe *probe, Uniform3 plane, Vec3 direction) {
    return along_plane(probe->overlap, plane.x, plane.y, plane.z, direction);
}

// Finds the lanes whose ray hits the triangle at t_min < t < t_max, and where. Returns 0 if there are none; otherwise
// there may be some.
int intersect(const Probe *probe, Vec3 origin, Vec3 direction, Row row, varying t_max, Hit *hit) {
    const varying w0 = inside_edge(probe, row.a, direction);
    if (ASK_EDGE_BY_EDGE && ALL_NEGATIVE(AS_INT(w0))) return 0;
    const varying w1 = inside_edge(probe, row.b, direction);
    if (ASK_EDGE_BY_EDGE && ALL_NEGATIVE(AS_INT(w1))) return 0;
    const varying w2 = inside_edge(probe, row.c, direction);
    // What is not negative has no sign bit: one test for three.
    const varying_int outside = AS_INT(w0) | AS_INT(w1) | AS_INT(w2);
    if (ALL_NEGATIVE(outside)) return 0;

    const varying per_t = along_plane(0.0f, row.u, row.v, row.w, direction);
    const varying per_sum = 1.0f / (w0 + w1 + w2);
    hit->t = 1.0f / per_t;
    hit->w1 = w1 * per_sum;
    hit->w2 = w2 * per_sum;
    hit->lanes = (outside >= 0) & (per_t * t_max > 1.0f) & (hit->t > probe->t_min);
    return 1;
}

// The plane of an edge, which is p - q, whose ends are seen at p and q. Swapping them changes nothing but all signs.
Uniform3 edge_plane(Uniform3 edge, Uniform3 p, Uniform3 q) {
    return uniform_cross(edge, uniform3(p.x + q.x, p.y + q.y, p.z + q.z));
}

// The largest power of two that is not more: by that, planes are scaled without rounding, and stay the same for neighbours.
float power_of_two_below(float positive) { return as_float(as_int(positive) & 0x7f800000); }

// A row that no ray hits: it is outside one of the first two edges.
Row row_of_nothing() {
    Row row;
    row.a = uniform3(1e30f, 0.0f, 0.0f);
    row.b = uniform3(-1e30f, 0.0f, 0.0f);
    row.c = uniform3(0.0f, 0.0f, 0.0f);
    row.u = row.v = row.w = 0.0f;
    return row;
}

// The row of a triangle for rays from an origin; it is not hit where it is edge-on or culled. `front` is the sign of N.A of a
// front face. Edges are taken from the corners as they are: seen from far away, they have lost what tells them apart.
Row planes_of(Corners corners, Uniform3 origin, float front) {
    const Uniform3 a = uniform_difference(corners.a, origin);
    const Uniform3 b = uniform_difference(corners.b, origin);
    const Uniform3 c = uniform_difference(corners.c, origin);
    const Uniform3 e1 = uniform_difference(corners.b, corners.a), e2 = uniform_difference(corners.c, corners.a);
    const Uniform3 n = uniform_cross(e1, e2);
    const float height = uniform_dot(a, n);
    const float size1 = uniform_size(e1), size2 = uniform_size(e2), distance = uniform_size(a);
    int hit = fabs(height) > 1e-5f * distance * size1 * size2;
#if CULL_BACK
    hit &= height * front > 0.0f;
#endif
    if (!hit) return row_of_nothing();

    const float per_unit = 1.0f / power_of_two_below(SHARED_EDGE_SLACK * distance * max(size1, size2));
    const float turn = height > 0.0f ? per_unit : -per_unit;
    const Uniform3 per_t = uniform_scale(n, 1.0f / height);
    Row row;
    row.a = uniform_scale(edge_plane(uniform_difference(corners.b, corners.c), b, c), turn);
    row.b = uniform_scale(edge_plane(e2, c, a), turn);
    row.c = uniform_scale(edge_plane(uniform_difference(corners.a, corners.b), a, b), turn);
    row.u = per_t.x, row.v = per_t.y, row.w = per_t.z;
    return row;
}

#if LINEAR_IN_PIXEL
// A plane as a function of the pixel: its dot product with corner + x step_x + y step_y.
Uniform3 along_pixels(Uniform3 plane, float4 corner, float4 step_x, float4 step_y) {
    return uniform3(uniform_dot(plane, uniform3(step_x.x, step_x.y, step_x.z)),
                    uniform_dot(plane, uniform3(step_y.x, step_y.y, step_y.z)),
                    uniform_dot(plane, uniform3(corner.x, corner.y, corner.z)));
}

Row row_along_pixels(Row row, float4 corner, float4 step_x, float4 step_y) {
    const Uniform3 per_t = along_pixels(uniform3(row.u, row.v, row.w), corner, step_x, step_y);
    row.a = along_pixels(row.a, corner, step_x, step_y);
    row.b = along_pixels(row.b, corner, step_x, step_y);
    row.c = along_pixels(row.c, corner, step_x, step_y);
    row.a.z += 1.0f, row.b.z += 1.0f, row.c.z += 1.0f; // the overlap
    row.u = per_t.x, row.v = per_t.y, row.w = per_t.z;
    return row;
}
#endif
