// meaning: common-origin, with the camera's planes as linear functions of the pixel
// record_floats: 12
// prepared_for: pixels
// exact_signs: no
// operations: 6
// contradicts: epsilons=paper because the paper's epsilons are numbers of the moller-trumbore test
//
// This is the common-origin test with one change: the planes for primary rays are functions of the pixel. A ray through
// the point (x, y) of the image has the direction (x, y, 1), so rays in the same row or column of pixels share terms of
// the dot products. Most misses are found after at most 6 operations: 2 for each of the three planes.

#include "cast/planes_of_origin.cl"

// Returns the plane's dot product with the ray direction corner + x step_x + y step_y as a linear function of the pixel
// (x, y): the coefficient of x, the coefficient of y, and the constant.
static Uniform3 along_pixels(Uniform3 plane, float4 corner, float4 step_x, float4 step_y) {
    return uniform3(uniform_dot(plane, uniform3(step_x.x, step_x.y, step_x.z)),
                    uniform_dot(plane, uniform3(step_y.x, step_y.y, step_y.z)),
                    uniform_dot(plane, uniform3(corner.x, corner.y, corner.z)));
}

// The overlap of neighbouring triangles in the pixel-linear test, as a multiple of the overlap in the common-origin
// test. The value of a plane at a pixel is a sum of three rounded dot products, two of which are multiplied by a
// pixel's coordinate. A plane's value has 8 to 16 times the rounding error of one dot product with a direction.
#define LINEAR_OVERLAP 16.0f

// Returns a triangle's row with its planes as functions of the pixel, and LINEAR_OVERLAP added to the edges' planes.
static Row row_along_pixels(Row row, float4 corner, float4 step_x, float4 step_y) {
    // plane . (corner + x step_x + y step_y) = x (plane . step_x) + y (plane . step_y) + plane . corner.
    const Uniform3 per_t = along_pixels(uniform3(row.u, row.v, row.w), corner, step_x, step_y);
    row.a = along_pixels(row.a, corner, step_x, step_y);
    row.b = along_pixels(row.b, corner, step_x, step_y);
    row.c = along_pixels(row.c, corner, step_x, step_y);
    row.a.z += LINEAR_OVERLAP, row.b.z += LINEAR_OVERLAP, row.c.z += LINEAR_OVERLAP;
    row.u = per_t.x, row.v = per_t.y, row.w = per_t.z;
    return row;
}
