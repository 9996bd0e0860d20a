// Rays of a common origin, and planes seen from it.

#define LINEAR_IN_PIXEL 0
#include "intersect/edge_planes.cl"
