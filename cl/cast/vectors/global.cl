// meaning: a preallocated scratch buffer in global memory
// memory: scratch
// bytes_per_ray: 108
//
// The working vectors are in a scratch buffer, which the host allocates for all work-items.

#define WORKING_SPACE __global
#include "cast/working_in_memory.cl"

#define WORKING_LOCALS
#define BIND_WORKING(working)                                                                   \
    working.first = (__global varying *)scratch + 3 * ((get_global_id(1) - get_global_offset(1)) * get_global_size(0) + get_global_id(0)); \
    working.stride = 3 * get_global_size(0) * get_global_size(1);
