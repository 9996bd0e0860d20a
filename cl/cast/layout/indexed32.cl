// meaning: lists of positions and normals as in OBJ files, 32-bit indices; with tiles, only normals are indexed
// index_bits: 32

#include "cast/indexed.cl"
