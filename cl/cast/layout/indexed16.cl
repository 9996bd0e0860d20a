// meaning: lists of positions and normals as in OBJ files, 16-bit indices
// index_bits: 16

#include "cast/indexed.cl"
