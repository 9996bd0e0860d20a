// Tests rays that share an origin: the eye for primary rays, a light for shadow rays. P and Q are the ends of an edge,
// relative to this origin. The plane through the origin and the edge has the normal (P - Q) x (P + Q) = 2 P x Q. A ray
// lies on the edge's inner side if the dot product of its direction and the plane's normal is positive. Two triangles
// have the same plane for their shared edge, with all signs reversed. 1 / t is the dot product of the direction with
// N / (N . A), where A is a corner relative to the origin, and N the triangle's normal. Once per frame, the kernel
// prepare_origins computes a row for each triangle and each origin: the normals of the three planes, and N / (N . A).

#ifndef LINEAR_IN_PIXEL
#error "LINEAR_IN_PIXEL: 0 or 1: whether the camera's planes are functions of the pixel"
#endif

// ASK_EDGE_BY_EDGE is 1 if the test checks after each edge whether all rays are outside this edge. On a GPU, a vector
// of rays consists of separate scalars, and most tests of a triangle end at such a check. On a GPU, checks after each
// edge thus make casting 43% faster (28% if planes are linear in the pixel). On a CPU, a vector of rays is one
// register. A check then costs more than an edge's dot product, so checks after each edge make casting 10% slower.
#if defined(HAS_REDUCE_OR)
#define ASK_EDGE_BY_EDGE 0
#else
#define ASK_EDGE_BY_EDGE 1
#endif

typedef struct {
    varying t_min;
    float overlap; // exhaustive.cl stores overlap_of(origin) here, since prepare_probe does not know the rays' origin
} Probe;

static Probe prepare_probe(varying t_min, Vec3 direction) {
    Probe probe;
    probe.t_min = t_min;
    probe.overlap = 1.0f;
    return probe;
}

// Returns the first summand of an edge function (a chain of multiply-adds), for rays from an origin (0 is the eye, i is
// light i - 1). Usually, overlap_of returns the overlap of neighbouring triangles, which allows for the rounding error
// of edge functions. Planes are scaled so that this overlap of triangles is 1. Adding the overlap costs nothing: a
// chain of multiply-adds needs a first summand anyway.
//
// With LINEAR_IN_PIXEL, rays from the eye are in pixel coordinates: the ray through the point (x, y) of the image, in
// pixels, has the direction (x, y, 1). In pixel coordinates, a direction's third component is 1, so row_along_pixels
// has already added the triangles' overlap to the third component of each plane. For such rays, overlap_of returns -0:
// adding -0 changes nothing.
static float overlap_of(int origin) { return LINEAR_IN_PIXEL && !origin ? -0.0f : 1.0f; }

// Returns a plane's dot product with a direction, plus `begin`. In pixel coordinates (see overlap_of), all rays share
// the dot product's term with z, and rays through the same row of pixels share the term with y. The function adds the
// terms with z and y first, so that compilers can compute each of them once.
static varying along_plane(float begin, float x, float y, float z, Vec3 direction) {
    return begin + direction.z * z + direction.y * y + direction.x * x;
}

// Returns an edge function plus the overlap: negative if the direction is outside the edge by more than the overlap.
static varying inside_edge(const Probe *probe, Uniform3 plane, Vec3 direction) {
    return along_plane(probe->overlap, plane.x, plane.y, plane.z, direction);
}

// Stores in `hit` the lanes whose ray hits the triangle at t_min < t < t_max, with t and the weights. Returns 0 only if
// no lane hits; hit->lanes is then not set. After a return of 1, hit->lanes may still be empty.
int intersect(const Probe *probe, Vec3 origin, Vec3 direction, Row row, varying t_max, Hit *hit) {
    // The test needs one dot product of three terms for each of the three edges. The test does not need the rays'
    // origin, since the planes contain it.
    const varying w0 = inside_edge(probe, row.a, direction);
    if (ASK_EDGE_BY_EDGE && ALL_NEGATIVE(AS_INT(w0))) return 0;
    const varying w1 = inside_edge(probe, row.b, direction);
    if (ASK_EDGE_BY_EDGE && ALL_NEGATIVE(AS_INT(w1))) return 0;
    const varying w2 = inside_edge(probe, row.c, direction);
    // `outside` is negative if any of the three edge functions is negative, since the bitwise or joins their sign bits.
    const varying_int outside = AS_INT(w0) | AS_INT(w1) | AS_INT(w2);
    if (ALL_NEGATIVE(outside)) return 0;

    // At least one ray is inside. 1 / t is linear in the direction; weights are edge functions divided by their sum.
    const varying per_t = along_plane(0.0f, row.u, row.v, row.w, direction);
    const varying per_sum = 1.0f / (w0 + w1 + w2);
    hit->t = 1.0f / per_t;
    hit->w1 = w1 * per_sum;
    hit->w2 = w2 * per_sum;
    // per_t * t_max > 1 means 0 < t < t_max, without the rounding of a division.
    hit->lanes = (outside >= 0) & (per_t * t_max > 1.0f) & (hit->t > probe->t_min);
    return 1;
}

#include "common/planes_of_origin.cl"
