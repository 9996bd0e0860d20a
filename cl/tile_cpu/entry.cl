// A tile of rays with a common origin (the eye, or a light) traverses the tree together. One work-item owns the tile:
// VECTORS vectors of WIDTH rays in private memory. A word such as `live` has one bit for each vector of rays.
//
// All children of a node are tested together against the interval (the least and greatest values) of the tile's
// directions. Each child that this test does not exclude is tested against the interval of directions of each vector
// of rays (slices.cl). Single rays are tested against boxes only if the interval of their vector is too wide to
// exclude boxes (scattered.cl). A leaf's triangles are tested against the rays of the remaining vectors (intersect/).

#if SAMPLED // a pixel may have several rays, each through a different point of the pixel
#define SUBPIXELS
#endif
// SHADES_ONCE is 1 if the program may shade a pixel only once, at the mean position of the pixel's samples, when these
// samples hardly differ (shade_once.cl). SHADES_ONCE is 0 with smooth shadows: they light a hit as if it lay above its
// triangle's plane, so the bounds in shade_once.cl would be wrong.
#define SHADES_ONCE (SAMPLED && !SOFT && !TEXTURES && !CORNER_COLOURS && !EMISSIVE && !SMOOTH_SHADOWS)
#include "common/tile.cl"
#if WATERTIGHT // tile_cpu/intersect/watertight.cl uses this test for vectors of rays whose rays have no common axis
#include "cast/intersect/watertight.cl"
#endif
#include "common/tree.cl"
#include "common/intersect_plane.cl"
#include "common/shadow_end.cl"
#include "common/tile_masks.cl"
#include "common/reflectance.cl"
#include "common/store_radiance.cl"
#if HALF_LIGHT
#include "common/pixel_rows.cl"
#include "common/half_light.cl"
#endif

// A tile of 32 x 16 pixels consists of 32 vectors. Each vector is a block of 4 x 4 pixels, whose 16 rays are the lanes
// of a float16.
//
//     vector  0  1  2  3  4  5  6  7         vector 9:   lane  0  1  2  3
//             8  9 10 11 12 13 14 15                           4  5  6  7
//            16 17 18 19 20 21 22 23                           8  9 10 11
//            24 25 26 27 28 29 30 31                          12 13 14 15
//
//     live = 0x00000700: the traversal continues with the rays of vectors 8, 9 and 10
#define VECTORS (TILE_X * TILE_Y / WIDTH)
#if WIDTH != 16 || VECTORS > 32
#error "tiles consist of at most 32 vectors of 16 rays"
#endif
// A lane of a float16 belongs to one ray of a vector or, in some variables such as the fields of Slices, to a whole
// vector of rays. PARTS is the number of float16 that hold one value for each vector of rays.
#define PARTS ((VECTORS + 15) / 16)
#define LANES ((int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))
// Converts 16 bits of a word with one bit per vector of rays to a mask with 16 lanes: bits 0 to 15 if `part` is 0.
#define LANES_OF(word, part) (((int16)((int)((word) >> 16 * (part))) >> LANES & 1) != 0)

#ifndef PREFETCH
#error "PREFETCH: 1 where the compiler has __builtin_prefetch and non-temporal stores for global memory, else 0"
#endif
#if PREFETCH
#define FETCH(pointer) __builtin_prefetch((const void *)(size_t)(pointer), 0, 3)
#else
#define FETCH(pointer) (void)0
#endif

// The shears for the watertight test (tile_cpu/intersect/watertight.cl). A shear turns a ray's direction d into the
// direction of the axis k that is common to the rays of the vector.
typedef struct {
    // For the axis k, x is -d_(k+1) / d_k, with the opposite sign if rays run against the axis; y is -d_(k+2) / d_k.
    varying x[VECTORS], y[VECTORS];
    int axis[VECTORS];      // the common axis k, or NO_AXIS
    float forward[VECTORS]; // 1, or -1 if the rays run against the axis k
} Shears;

// The rays of a tile. 1 / t is stored instead of t: on a triangle's plane, it is linear in the ray's direction, so that
// edge_planes.cl needs no division. LEAST_INV_T (slices.cl), a number close to 0, stands for an infinite t.
typedef struct {
    Uniform3 origin;
    float too_near; // hits with this 1 / t, or with a larger one, are too near: they are ignored
    float longest;  // an upper bound of the absolute values of the directions' components
    varying x[VECTORS], y[VECTORS], z[VECTORS]; // directions: depth 1 for rays from the eye, length <= 1 from a light
    varying inv_t[VECTORS];  // 1 / t of the nearest hit so far, or of the ray's end; FAR if the ray is finished
    varying_int leaf_index[VECTORS]; // the nearest triangle so far, as an index in leaf order
    // The middles and half widths of the intervals of directions of the vectors of rays, one lane per vector
    // (slices.cl).
    varying middle[3][PARTS], half_width[3][PARTS];
    uint scattered;             // vectors of shadow rays whose hits lie far apart (scattered.cl), one bit each
    varying per[3][VECTORS];    // the reciprocals of the directions of scattered vectors
#if WATERTIGHT
    Shears shears;
#endif
#if CUTOUTS
    const Tree *tree;   // the tree that the rays traverse
    Vec3 hit[VECTORS];  // the hits to which shadow rays run
#endif
} Bundle;

#include "tile_cpu/gather_rows.cl"
#include "tile_cpu/layout/{layout}.cl"

// A tree, and its triangles' normals for shading.
typedef struct {
    Tree tree;
    Normals normals;
} SurfaceTree;

// If a picture has several samples per pixel, a frame adds one sample to each pixel, or up to 4, or up to 16. If a
// frame adds more than one sample, a pixel is divided into sub-pixels, 2 or 4 across and down, each with room for one
// ray. A tile keeps its number of rays, so a tile of 512 rays covers 32 x 16, 16 x 8 or 8 x 4 pixels. Rays of the same
// pixel lie closer to each other than rays of neighbouring pixels, so that a tile visits fewer nodes and triangles per
// ray.
//
//     a vector's rays  bits 0: 4 x 4 pixels   bits 1: 2 x 2 pixels   bits 2: one pixel
//     (each number is  0 0 0 0                0 1 0 1                 0  1  2  3
//     that of a sample 0 0 0 0                2 3 2 3                 4  5  6  7
//     in the frame)    0 0 0 0                0 1 0 1                 8  9 10 11
//                      0 0 0 0                2 3 2 3                12 13 14 15
#if SAMPLED
typedef struct {
    uint earlier; // samples that are in the image already
    uint cast;    // vectors whose pixels get another sample, one bit each
    int bits;     // a pixel has 2^bits sub-pixels across and down
    int count;    // samples of each pixel that the frame casts; the other sub-pixels stay empty
    Mask filled;  // the lanes whose sub-pixel has a sample
    varying x, y; // the position of each lane's sample in its pixel
} FrameSamples;
// The additional parameter of functions in programs with several samples per pixel, including the comma after it.
#define CAST_PARAMETERS const FrameSamples *samples,
#define CAST_ARGUMENTS samples,
#define SUBPIXEL_BITS (samples->bits)
// Whether all rays of a vector are samples of one pixel.
#define IS_PIXEL_A_VECTOR(samples) ((samples)->bits == 2)
#define EACH_CAST(vector) for (int vector = 0; vector < VECTORS; vector++) if (samples->cast >> vector & 1u)
#else
#define CAST_PARAMETERS
#define CAST_ARGUMENTS
#define SUBPIXEL_BITS 0
#define EACH_CAST(vector) for (int vector = 0; vector < VECTORS; vector++)
#endif

static float least_lane(float16 v) {
    // The upper half of the lanes is compared with the lower half, repeatedly: 16 lanes become 8, then 4, 2 and 1.
    const float8 a = min(v.lo, v.hi);
    const float4 b = min(a.lo, a.hi);
    const float2 c = min(b.lo, b.hi);
    return min(c.x, c.y);
}

static float most_lane(float16 v) {
    const float8 a = max(v.lo, v.hi);
    const float4 b = max(a.lo, a.hi);
    const float2 c = max(b.lo, b.hi);
    return max(c.x, c.y);
}

#include "common/bits.cl"
#include "tile_cpu/slices.cl"
#include "tile_cpu/scattered.cl"
#include "tile_cpu/triangles_of_leaf.cl"
#include "tile_cpu/leaf.cl"
#include "tile_cpu/walk.cl"
#include "tile_cpu/camera.cl"
#include "tile_cpu/surface.cl"
#include "tile_cpu/store_tile.cl"
#include "tile_cpu/light_rays.cl"
#include "tile_cpu/shade.cl"
#include "tile_cpu/frame.cl"
