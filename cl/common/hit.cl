// The result of a test, and the nearest hit that a traversal keeps.

#ifndef NO_HIT
#error "NO_HIT: the triangle of a ray that hits nothing"
#endif
#define FAR MAXFLOAT // not infinity: fast math may assume there is none

// A few roundings of single precision, relative to the largest term.
#define ROUNDING 1.2e-7f
// The most by which triangles overlap where neighbours share an edge's plane. Only rays at vertices need any; a larger overlap
// darkens pixels beside an edge that shadow rays graze. (Measured: none of 60,516 rays leaks, with half of it up to four in
// exhaustive casting; terrain is right in 16 million pixels, with up to twice as much one is dark.)
#define SHARED_EDGE_SLACK (0.125f * ROUNDING)

typedef struct {
    Mask lanes;     // those whose ray hits
    varying t;      // distance along the unit direction; depth where rays are counted in pixels
    varying w1, w2; // barycentric weights of the second and third corner
} Hit;

typedef struct {
    varying t;
    varying_int triangle;
} Nearest;
