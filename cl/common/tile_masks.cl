// The masks of cut-outs (triangles with holes), in kernels that cast tiles: rays pass through the holes.

#if CUTOUTS
#include "common/cutouts.cl"
#define BIND_MASKS(tree)          \
    tree.masks.rows = mask_rows;  \
    tree.masks.words = mask_words;
#else
#define SOLID_ON_RAYS(textures, triangle, corners, from, direction, hits) hits
#define BIND_MASKS(tree)
#endif
