// meaning: the OBJ's sets of positions and normals, 32-bit indices
// index_bits: 32

#include "cast/indexed.cl"
