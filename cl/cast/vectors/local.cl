// meaning: __local memory, 108 bytes per ray: the paper's optimisation 1
// memory: local
// bytes_per_ray: 108
//
// The working vectors are in __local memory, as in optimisation 1 of the student paper that raycl reproduces.

#define WORKING_SPACE __local
#include "cast/working_in_memory.cl"

#define WORKING_LOCALS __local varying working_store[WORKING_VECTORS * LOCAL_X * LOCAL_Y * 3];
#define BIND_WORKING(working)                                                        \
    working.first = working_store + 3 * (get_local_id(1) * LOCAL_X + get_local_id(0)); \
    working.stride = 3 * LOCAL_X * LOCAL_Y;
