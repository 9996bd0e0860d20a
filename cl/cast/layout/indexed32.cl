// meaning: lists of positions and normals as in OBJ files, 32-bit indices
// index_bits: 32

#include "cast/indexed.cl"
