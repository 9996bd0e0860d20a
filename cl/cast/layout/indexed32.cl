// meaning: lists of positions and normals as in OBJ files, 32-bit indices; traversal = tile indexes only normals
// index_bits: 32

#include "cast/indexed.cl"
