// A tree of boxes (layout: src/accel/wide.rs), and the tree's triangles in leaf order (src/accel/triangles.rs).

#if !defined(NODE_WIDTH) || !defined(NODE_STRIDE) || !defined(STACK_SIZE)
#error "NODE_WIDTH: children of a node, 2 to 32; NODE_STRIDE: words of a node; STACK_SIZE: entries of the stack that the deepest path down the tree can need"
#endif
#if !defined(ROW_FLOATS) || ROW_FLOATS != 12
#error "ROW_FLOATS: floats of a leaf's triangle, of which leaf_corners reads 12"
#endif
#if !defined(LEAF_COUNT_SHIFT) || !defined(LEAF_MOST)
#error "LEAF_COUNT_SHIFT: the lowest bit of the triangle count in a leaf's word; LEAF_MOST: the largest count"
#endif

// A node is a table of words. Each child is a column, so that one load reads one side (for example the low x) of the
// boxes of many children:
//
//         child     0      1      2     ...  NODE_WIDTH - 1
//     row 0         low x  low x  low x
//     row 1         high x ...
//     rows 2, 3     low y, high y
//     rows 4, 5     low z, high z
//     row 6         word   word   word                          CHILD_ROW
//
// The bits of a child's word. `first` is the index of the leaf's first triangle in leaf order:
//
//     bit 31 | bits 30 to LEAF_COUNT_SHIFT | lower bits
//     0      | number of the node
//     1      | count of triangles          | first              for a leaf
#define CHILD_ROW (6 * NODE_WIDTH)
#define IS_LEAF(word) ((int)(word) < 0)
#define LEAF_FIRST(word) ((word) & ((1 << LEAF_COUNT_SHIFT) - 1))
#define LEAF_COUNT(word) (((word) >> LEAF_COUNT_SHIFT) & LEAF_MOST)
// The t at which a ray leaves a box is multiplied by OUTWARDS, which adds more than the rounding error of t (Ize,
// "Robust BVH Ray Traversal", JCGT 2(2), 2013).
#define OUTWARDS 1.0000005f
#define LEAF_ROW ROW_FLOATS // words per triangle: v0, the triangle's number, v1, its material, v2, 0

typedef struct {
    const __global float *nodes;
    const __global float *leaves;
#if PLANES_OF_ORIGIN
    // The triangles' planes: three arrays of float4 for the eye, then three arrays for each light. Each array has one
    // float4 per triangle, in leaf order (see common_origin.cl).
    const __global float4 *planes;
    int row; // number of float4 in an array
#endif
#if CUTOUTS && defined(TILE_X)
    Textures masks; // the triangles' masks
#endif
} Tree;

// Returns the corners of the triangle at an index in leaf order.
static Corners leaf_corners(const Tree *tree, int index) {
    const __global float4 *quads = (const __global float4 *)tree->leaves + 3 * (size_t)index;
    // Three aligned loads of four floats read the corners. The fourth float of the first load is the triangle's number,
    // that of the second load its material, and that of the third load 0.
    const float4 a = quads[0], b = quads[1], c = quads[2];
    Corners corners;
    corners.a = uniform3(a.x, a.y, a.z);
    corners.b = uniform3(b.x, b.y, b.z);
    corners.c = uniform3(c.x, c.y, c.z);
    return corners;
}

// Returns the number of the triangle at an index in leaf order.
static int leaf_triangle(const Tree *tree, int index) { return as_int(tree->leaves[LEAF_ROW * (size_t)index + 3]); }

#if PLANES_OF_ORIGIN
// Returns the first of the three arrays of planes that were prepared for an origin: the eye is origin 0, the first
// light origin 1.
static const __global float4 *planes_for(const Tree *tree, int origin) { return tree->planes + 3 * (size_t)origin * tree->row; }
#endif
