// Copies a buffer to another buffer, one vector per work-item.

#include "peak/vector.cl"

__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void copy(const __global vector *restrict from,
                                                                     __global vector *restrict to) {
    const size_t i = get_global_id(0);
    to[i] = from[i];
}
