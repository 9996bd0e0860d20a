// The types of a ray-triangle test's result and of a traversal's nearest hit, and bounds of rounding errors.

#ifndef NO_HIT
#error "NO_HIT: the number that is stored in place of a triangle's number if a ray hits nothing"
#endif
#define FAR MAXFLOAT // FAR is not infinity, since fast math may assume that no value is infinite

// A bound of the rounding error of a few operations in single precision, relative to the largest term.
#define ROUNDING 1.2e-7f
// EDGE_ON_ROUNDING is a bound of the rounding error of a determinant of three vectors (a direction and two edges),
// divided by the product of the vectors' sizes. There are nine roundings: one for each of the two edges (a
// subtraction), three for a component of a cross product, three for a dot product, and one for the direction. Each
// rounding adds at most half a unit in the last place (ROUNDING is one unit). The sum, 4.5 units, is rounded up to 5. A
// triangle with a determinant within this bound counts as seen edge-on, and is not hit. With a larger EDGE_ON_ROUNDING,
// rays would miss long, thin triangles that are seen at a grazing angle, like a road from a driver's seat.
#define EDGE_ON_ROUNDING (5.0f * ROUNDING)
// Some ray-triangle tests use the same plane for both triangles at a shared edge. In these tests, the triangles are
// made to overlap a little, so that no ray slips through at a vertex. SHARED_EDGE_SLACK is the usual overlap, divided
// by a triangle's distance from the rays' origin and by the size of its edges. A larger overlap of triangles would
// darken pixels at an edge that shadow rays graze. Measured with SHARED_EDGE_SLACK: none of 60,516 rays aimed at edges
// and vertices slips through, and all of 16 million pixels of a terrain are correct. With half of SHARED_EDGE_SLACK, up
// to four of the 60,516 rays slip through in exhaustive casting. With twice SHARED_EDGE_SLACK, at most one of the 16
// million pixels is wrongly dark.
#define SHARED_EDGE_SLACK (0.125f * ROUNDING)
// The overlap at an edge is proportional to the longer of two edges of the triangle, or to OVERLAP_EDGES times the
// edge's own size (in common/planes_of_origin.cl: the shortest edge's size) if this product is less. Without this
// limit, the overlap at the short edge of a needle (a triangle with two long edges) could lengthen the needle by
// several pixels.
#define OVERLAP_EDGES 8.0f
// A triangle seen almost edge-on can look narrower than its overlap with its neighbours. Such a triangle is not hit:
// the neighbours overlap the whole triangle, and the triangle's own overlap could lengthen it several times. `distance`
// is the size (1-norm) of a corner relative to the rays' origin. `longer` is the size of the longer of the two edges
// at the corner. In the 1-norm, all points of the triangle are at least `distance - longer` away from the origin. A
// triangle is hit only if |determinant of the corner and its two edges| is greater than LEAST_VISIBLE (in tile_gpu/:
// than LEAST_VISIBLE / 2).
#define LEAST_VISIBLE(distance, longer) \
    (SHARED_EDGE_SLACK * (distance) * max((distance) - (longer), 0.0f) * (longer))

typedef struct {
    Mask lanes;     // lanes whose ray hits
    varying t;      // distance along the unit direction; depth if rays are in pixel coordinates
    varying w1, w2; // barycentric weights of the second and third corner
} Hit;

// The nearest hit that a traversal has found so far.
typedef struct {
    varying t;            // the distance of the nearest hit, as in Hit
    varying_int triangle; // the triangle's number in the mesh, or NO_HIT
} Nearest;
