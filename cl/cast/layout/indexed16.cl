// meaning: the OBJ's sets of positions and normals, 16-bit indices
// index_bits: 16

#include "cast/indexed.cl"
