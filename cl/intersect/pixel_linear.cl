// The same with planes of primary rays as functions of the pixel: a ray through pixel (x, y) is (x, y, 1), so that neighbours
// in a row or a column share terms.

#define LINEAR_IN_PIXEL 1
#include "intersect/edge_planes.cl"
