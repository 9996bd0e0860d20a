// The rasteriser of the textbook (Hughes et al., "Computer Graphics"), with one work-item per triangle. Unlike the
// textbook's version, this rasteriser clips at the near plane. It interpolates 1 / depth, which is a linear function of
// a pixel's column and row. Edge functions are computed from homogeneous coordinates without a division by a vertex's
// depth, so triangles may extend behind the eye (Olano and Greer, "Triangle Scan Conversion using 2D Homogeneous
// Coordinates", 1997).
//
// The kernel raster_depth finds each pixel's smallest depth by an atomic minimum over the bits of depths (positive
// floats are ordered like integers). The kernel raster_nearest finds the triangle with this depth. If several triangles
// have this depth, raster_nearest finds the first of them in the mesh's order. Finally, the kernel shade_nearest shades
// each pixel's nearest triangle.

#include "cast/parts.cl"
#include "cast/shade_nearest.cl"

// As in the watertight test, an edge function is the difference of two products, each rounded separately. Each factor
// of a product depends only on one corner and the pixel. The edge function's sign is therefore exactly opposite in the
// neighbouring triangle, and triangles at a vertex leave no gap. A pixel on an edge belongs to both triangles.
#pragma OPENCL FP_CONTRACT OFF

// Returns a dot product that is not contracted. (The compiler may contract functions that are defined before the
// pragma, such as uniform_dot, and possibly in a different way at each call.)
static float exact_dot(Uniform3 a, Uniform3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

// A linear function of a pixel's column x and row y: c + x * dx + y * dy.
typedef struct {
    float c, dx, dy;
} Linear;

// Returns the dot product of the vector `plane` with a pixel's direction, as a function of the pixel's column and row.
static Linear along_pixels(Uniform3 plane, float4 corner, float4 step_x, float4 step_y) {
    Linear f;
    f.c = exact_dot(plane, uniform3(corner.x, corner.y, corner.z));
    f.dx = exact_dot(plane, uniform3(step_x.x, step_x.y, step_x.z));
    f.dy = exact_dot(plane, uniform3(step_y.x, step_y.y, step_y.z));
    return f;
}

static float linear_at(Linear f, float x, float y) { return f.c + x * f.dx + y * f.dy; }

// A triangle's corner as seen from the eye. `across` and `down` are the corner's column and row in the image, in
// pixels, multiplied by the corner's depth. The end of a pixel's direction (a vector from the eye) has depth 1.
typedef struct {
    float across, down, depth;
} Projected;

// Projects the point `p`, which is relative to the eye.
static Projected project(Uniform3 p, float4 corner, float4 step_x, float4 step_y) {
    const Uniform3 from = uniform3(corner.x, corner.y, corner.z);
    const Uniform3 sx = uniform3(step_x.x, step_x.y, step_x.z), sy = uniform3(step_y.x, step_y.y, step_y.z);
    // step_x and step_y are perpendicular, so a dot product with one of them, divided by its squared length, is a
    // coordinate in pixels.
    const float per_sx = 1.0f / exact_dot(sx, sx), per_sy = 1.0f / exact_dot(sy, sy);
    const Uniform3 n = uniform_cross(sx, sy);
    Projected q;
    q.depth = exact_dot(p, n) / exact_dot(from, n);
    q.across = (exact_dot(p, sx) - q.depth * exact_dot(from, sx)) * per_sx;
    q.down = (exact_dot(p, sy) - q.depth * exact_dot(from, sy)) * per_sy;
    return q;
}

// A triangle as seen from the eye, and the pixels that it may cover.
typedef struct {
    Projected at[3];
    Linear per_depth;   // 1 / depth, as a function of the pixel's column and row
    int drawn;          // 0 if the triangle is edge-on or culled
    int2 low, high;     // pixels to test: low <= pixel < high
} Coverage;

// Returns 1 if a triangle covers the point (x, y) of the image, else 0.
static int covers(const Coverage *coverage, float x, float y) {
    const Projected *p = coverage->at;
    // The corners' positions relative to the pixel, multiplied by the corners' depths. No position is divided by a
    // depth, so corners behind the eye do no harm.
    const float ax = p[0].across - x * p[0].depth, ay = p[0].down - y * p[0].depth;
    const float bx = p[1].across - x * p[1].depth, by = p[1].down - y * p[1].depth;
    const float cx = p[2].across - x * p[2].depth, cy = p[2].down - y * p[2].depth;
    // An edge function is twice the signed area of the triangle between the pixel and the edge, multiplied by the
    // depths of the edge's two corners.
    const float u = cx * by - cy * bx;
    const float v = ax * cy - ay * cx;
    const float w = bx * ay - by * ax;
    const float least = min(min(u, v), w), most = max(max(u, v), w);
    return (least >= 0.0f || most <= 0.0f) && u + v + w != 0.0f;
}

// Extends the bounds of the tested pixels so that they include the point `p`, which is on or beyond the near plane.
static void include_point(Coverage *coverage, Uniform3 p, float depth, CAMERA_PARAMETERS, int2 image_size) {
    const Uniform3 sx = uniform3(step_x.x, step_x.y, step_x.z), sy = uniform3(step_y.x, step_y.y, step_y.z);
    const Uniform3 q = uniform3(p.x / depth - corner.x, p.y / depth - corner.y, p.z / depth - corner.z);
    const float x = clamp(uniform_dot(q, sx) / uniform_dot(sx, sx), -1.0f, image_size.x + 1.0f);
    const float y = clamp(uniform_dot(q, sy) / uniform_dot(sy, sy), -1.0f, image_size.y + 1.0f);
    // The bounds include one more pixel on each side, since the coordinates x and y are rounded. The edge functions
    // decide exactly which pixels the triangle covers.
    coverage->low = min(coverage->low, (int2)((int)floor(x) - 1, (int)floor(y) - 1));
    coverage->high = max(coverage->high, (int2)((int)ceil(x) + 1, (int)ceil(y) + 1));
}

// Finds the pixels that the part of a triangle beyond the near plane may cover.
void bound_pixels(Coverage *coverage, const Uniform3 *corners3, CAMERA_PARAMETERS, int2 image_size) {
    const Uniform3 sx = uniform3(step_x.x, step_x.y, step_x.z), sy = uniform3(step_y.x, step_y.y, step_y.z);
    const Uniform3 n = uniform_cross(sx, sy);
    const float per_length = 1.0f / sqrt(uniform_dot(n, n));
    const Uniform3 forward = uniform3(n.x * per_length, n.y * per_length, n.z * per_length);
    const float z_near = eye.w;
    coverage->low = image_size;
    coverage->high = (int2)(0, 0);
    for (int i = 0; i < 3; i++) {
        const Uniform3 p = corners3[i], q = corners3[i == 2 ? 0 : i + 1];
        const float zp = uniform_dot(p, forward), zq = uniform_dot(q, forward);
        if (zp > z_near) include_point(coverage, p, zp, eye, corner, step_x, step_y, image_size);
        // The edge from p to q is cut off where it crosses the near plane. If the near plane passes through the eye,
        // the edge may be visible at any pixel.
        if ((zp > z_near) == (zq > z_near)) continue;
        if (z_near == 0.0f) {
            coverage->low = (int2)(0, 0);
            coverage->high = image_size;
            continue;
        }
        const float f = (z_near - zp) / (zq - zp);
        const Uniform3 cut = uniform3(p.x + f * (q.x - p.x), p.y + f * (q.y - p.y), p.z + f * (q.z - p.z));
        include_point(coverage, cut, z_near, eye, corner, step_x, step_y, image_size);
    }
    coverage->low = max(coverage->low, (int2)(0, 0));
    coverage->high = min(coverage->high, image_size);
}

// Computes which pixels a triangle may cover, and the triangle's 1 / depth as a linear function of the pixel.
Coverage cover(Corners at, CAMERA_PARAMETERS, int2 image_size) {
    const Uniform3 from = uniform3(eye.x, eye.y, eye.z);
    const Uniform3 p[3] = {uniform_difference(at.a, from), uniform_difference(at.b, from),
                           uniform_difference(at.c, from)};
    const Uniform3 n = uniform_cross(uniform_difference(at.b, at.a), uniform_difference(at.c, at.a));
    // The sign of `det`, a determinant, shows on which side of the triangle the eye is.
    const float det = uniform_dot(p[0], n);
    Coverage coverage;
#if CULL_BACK
    coverage.drawn = det < 0.0f;
#else
    coverage.drawn = det != 0.0f;
#endif
    for (int i = 0; i < 3; i++) coverage.at[i] = project(p[i], corner, step_x, step_y);
    // 1 / depth = direction . n / (p[0] . n). The direction is linear in the pixel's column and row, so 1 / depth is
    // linear too.
    const float per_det = 1.0f / det;
    coverage.per_depth =
        along_pixels(uniform3(n.x * per_det, n.y * per_det, n.z * per_det), corner, step_x, step_y);
    bound_pixels(&coverage, p, eye, corner, step_x, step_y, image_size);
    return coverage;
}

// Returns the bits of the triangle's depth at a pixel, or NO_HIT if the triangle does not cover the pixel beyond the
// near plane.
static int depth_bits(const Coverage *coverage, int x, int y, float z_near) {
    const float px = x + 0.5f, py = y + 0.5f;
    if (!covers(coverage, px, py)) return NO_HIT;
    const float per_depth = linear_at(coverage->per_depth, px, py);
    const float depth = 1.0f / per_depth;
    return per_depth > 0.0f && depth > z_near && depth < FAR ? as_int(depth) : NO_HIT;
}

// The first lines of the kernels raster_depth and raster_nearest. They compute the coverage of the work-item's
// triangle. Work-groups have a fixed size, so the last group may have more work-items than there are triangles left.
#define COVERAGE_OF_TRIANGLE                 \
    const int triangle = get_global_id(0);   \
    if (triangle >= triangle_count) return;  \
    Geometry geometry;                       \
    BIND_GEOMETRY(geometry)                  \
    const Coverage coverage = cover(corners(&geometry, triangle), eye, corner, step_x, step_y, image_size);

// A loop over the pixels that a triangle may cover. Before the kernel raster_depth starts, the host fills the buffers
// `depth` and `nearest_triangle` with NO_HIT, the largest int.
#define FOR_COVERED_PIXELS(coverage)                                              \
    for (int y = coverage.low.y; coverage.drawn && y < coverage.high.y; y++) \
        for (int x = coverage.low.x; x < coverage.high.x; x++)

// Finds the smallest depth at each pixel.
__kernel void raster_depth(RASTER_DEPTH_PARAMETERS) {
    COVERAGE_OF_TRIANGLE
    FOR_COVERED_PIXELS(coverage) {
        const int bits = depth_bits(&coverage, x, y, eye.w);
        // Triangles compete for the pixel. The smallest depth remains, whatever the order of the triangles.
        if (bits != NO_HIT) atomic_min(depth + (size_t)y * image_size.x + x, bits);
    }
}

// Finds the nearest triangle at each pixel, after raster_depth.
__kernel void raster_nearest(RASTER_NEAREST_PARAMETERS) {
    COVERAGE_OF_TRIANGLE
    FOR_COVERED_PIXELS(coverage) {
        const size_t pixel = (size_t)y * image_size.x + x;
        const int bits = depth_bits(&coverage, x, y, eye.w);
        // The same arithmetic gives the same bits as in raster_depth, so equal bits show that the smallest depth is
        // this triangle's. Of several triangles with this depth, the first is stored.
        if (bits != NO_HIT && bits == depth[pixel]) atomic_min(nearest_triangle + pixel, triangle);
    }
}
