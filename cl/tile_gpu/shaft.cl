// The axes of a pass (its rays run mainly along one of them: entry.cl), and the box around the rays' slopes x and y.

// MULTIPLY_ADD computes a * b + c, with a single rounding if fma is as fast as a product and a sum. (In PTX, fma is as
// fast, even if FP_FAST_FMAF is not defined.)
#if defined(FP_FAST_FMAF) || LANE_OPERATIONS >= LANES_BY_PTX_SHUFFLES
#define MULTIPLY_ADD(a, b, c) fma(a, b, c)
#else
#define MULTIPLY_ADD(a, b, c) ((a) * (b) + (c))
#endif
// `widen` extends an interval of slopes by SLOPE_ROUNDING times the largest component of the directions (x, y, 1). This
// extension of the interval is several times the rounding error of the numbers that are compared with the interval.
#define SLOPE_ROUNDING 1e-6f

// The origin of the rays of a pass.
typedef struct {
    Uniform3 at;
    int number; // 0 for the eye; 1, 2, ... for the lights of a round of lights (see shadow.cl)
} Origin;

INLINED Origin origin_at(Uniform3 at, int number) {
    Origin origin;
    origin.at = at;
    origin.number = number;
    return origin;
}

// The volume that contains all rays of a pass: the axes of the pass, and the box around the slopes (x, y) of its rays.
typedef struct {
    int across, down, along; // the axes of the scene (0 to 2) that are the pass's x, y and z
    float sign;              // 1, or -1 if rays run towards smaller coordinates of the axis `along`
    uint x_rows, y_rows;     // offsets in a node of the low x and the low y of this lane's child
    uint near_row, far_row;  // offsets in a node of the z at which rays enter and leave this lane's child
    float x, y, z;           // the rays' origin along these axes; z is multiplied by `sign`
    float low_x, high_x, low_y, high_y;
    float longest; // the largest absolute value of a component of the directions (x, y, 1)
#if PLANES_OF_ORIGIN
    const __global float4 *planes; // the planes of all triangles for the rays' origin
    uint across_row, down_row, along_row; // the offsets in `planes` of the arrays for the pass's axes
#endif
} Shaft;

INLINED float component(float x, float y, float z, int axis) { return axis == 0 ? x : axis == 1 ? y : z; }

// Chooses the axes of a pass: z is the axis of the largest component of `leader`, the direction of one of its rays.
INLINED void aim(Group *group, const Tree *tree, Origin origin, Uniform3 leader, Shaft *shaft) {
    // The axes across, down and along are permuted cyclically. Non-cyclic permutations would swap front and back faces.
    const float x = fabs(leader.x), y = fabs(leader.y), z = fabs(leader.z);
    const int along = x > y ? (x > z ? 0 : 2) : (y > z ? 1 : 2);
    const int across = along == 2 ? 0 : along + 1, down = across == 2 ? 0 : across + 1;
    shaft->across = across;
    shaft->down = down;
    shaft->along = along;
    const int back = component(leader.x, leader.y, leader.z, along) < 0.0f;
    shaft->sign = back ? -1.0f : 1.0f;
    // In a node, each child is a column (common/tree.cl). The offsets of this lane's column, in the rows of the pass's
    // axes, are computed only once, so that finding an address takes only one addition.
    shaft->x_rows = (uint)(2 * NODE_WIDTH * across + group->lane);
    shaft->y_rows = (uint)(2 * NODE_WIDTH * down + group->lane);
    // Rays that run backwards (towards smaller coordinates) reach a box's high side first.
    shaft->near_row = (uint)(NODE_WIDTH * (2 * along + back) + group->lane);
    shaft->far_row = (uint)(NODE_WIDTH * (2 * along + 1 - back) + group->lane);
    shaft->x = component(origin.at.x, origin.at.y, origin.at.z, across);
    shaft->y = component(origin.at.x, origin.at.y, origin.at.z, down);
    shaft->z = shaft->sign * component(origin.at.x, origin.at.y, origin.at.z, along);
#if PLANES_OF_ORIGIN
    shaft->planes = planes_for(tree, origin.number);
    shaft->across_row = (uint)(tree->row * across);
    shaft->down_row = (uint)(tree->row * down);
    shaft->along_row = (uint)(tree->row * along);
#endif
}

// Sets the box around the slopes of a pass's rays. The box's sides are moved outwards to allow for rounding.
INLINED void widen(Shaft *shaft, float low_x, float high_x, float low_y, float high_y) {
    // Rounding errors are proportional to the largest component of a direction (x, y, 1), where x and y are slopes.
    const float longest = fmax(fmax(fmax(fabs(low_x), fabs(high_x)), fmax(fabs(low_y), fabs(high_y))), 1.0f);
    const float more = SLOPE_ROUNDING * longest;
    shaft->longest = longest;
    shaft->low_x = low_x - more;
    shaft->high_x = high_x + more;
    shaft->low_y = low_y - more;
    shaft->high_y = high_y + more;
}

// Returns a point's coordinates along the axes of a pass. If the rays run towards smaller coordinates, z is negated.
INLINED Uniform3 along_axes(const Shaft *shaft, float4 v) {
    return uniform3(component(v.x, v.y, v.z, shaft->across), component(v.x, v.y, v.z, shaft->down),
                    shaft->sign * component(v.x, v.y, v.z, shaft->along));
}

INLINED Vec3 point_along_axes(const Shaft *shaft, Vec3 point) {
    return splat(along_axes(shaft, (float4)(point.x, point.y, point.z, 0.0f)));
}

// Loads the corners of the triangle at an index in leaf order. The result is always 1. It is computed from the fourth
// components of all three corners, because some compilers load a `float4` whose fourth component is unused in two
// pieces, which takes twice as long.
INLINED int load_corners(const Shaft *shaft, const Tree *tree, int index, Uniform3 *a, Uniform3 *b, Uniform3 *c) {
    const __global float4 *row = (const __global float4 *)tree->leaves + 3 * (size_t)index;
    const float4 first = row[0], second = row[1], third = row[2];
    *a = along_axes(shaft, first);
    *b = along_axes(shaft, second);
    *c = along_axes(shaft, third);
    // The fourth components are the triangle's number, its material's number, and 0, none of which is negative.
    return (as_int(first.w) | as_int(second.w) | as_int(third.w)) >= 0;
}

// Returns the largest value of v . (x, y, 1) over the box around the slopes (x, y) of a shaft's rays.
INLINED float most_of(const Shaft *shaft, Uniform3 v) {
    // A linear function is largest at a corner of the box. For each axis, the larger of the values at the interval's
    // two ends is used.
    const float across = fmax(MULTIPLY_ADD(v.x, shaft->low_x, v.z), MULTIPLY_ADD(v.x, shaft->high_x, v.z));
    return fmax(MULTIPLY_ADD(v.y, shaft->low_y, across), MULTIPLY_ADD(v.y, shaft->high_y, across));
}

// Returns a corner relative to the rays' origin.
INLINED Uniform3 seen(const Shaft *shaft, Uniform3 corner) {
    return uniform_difference(corner, uniform3(shaft->x, shaft->y, shaft->z));
}

INLINED float4 quad(Uniform3 v, float word) { return (float4)(v.x, v.y, v.z, word); }

// A leaf's triangle against which a group's rays are tested. `prepare`, in the file of the test, computes a, b and c.
typedef struct {
    float4 a, b, c;
} Candidate;

INLINED void store_candidate(Candidate triangle, __local float4 *at) {
    at[0] = triangle.a;
    at[1] = triangle.b;
    at[2] = triangle.c;
}

INLINED Candidate load_candidate(const __local float4 *at) {
    Candidate triangle;
    triangle.a = at[0];
    triangle.b = at[1];
    triangle.c = at[2];
    return triangle;
}
