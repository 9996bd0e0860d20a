// Measures the rate of reads from __local memory. In each iteration, a work-item reads SLOTS vectors; neighbouring
// work-items read neighbouring addresses. The pointer `own` is volatile, since compilers would otherwise read the
// memory only once.

#include "peak/vector.cl"

#define SLOTS 8
#define EACH_SLOT(DO) DO(0) DO(1) DO(2) DO(3) DO(4) DO(5) DO(6) DO(7)

__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void local_rate(const int loops,
                                                                           __global float *restrict out) {
    __local vector tile[SLOTS * GROUP];
    const int item = get_local_id(0);
#define FILL(i) tile[i * GROUP + item] = (vector)((float)(1 << item % 4)); // a number that its neighbours do not store
    // Neighbouring work-items access neighbouring vectors, so few work-items need the same memory bank at the same
    // time.
    EACH_SLOT(FILL)
    barrier(CLK_LOCAL_MEM_FENCE);
    const volatile __local vector *own = tile + item;
#define START(i) vector sum##i = (vector)(0.0f);
#define READ(i) sum##i += own[i * GROUP];
#define SUM(i) +sum##i
    EACH_SLOT(START)
    for (int loop = 0; loop < loops; loop++) {
        EACH_SLOT(READ)
    }
    // Without this store, compilers would remove the computation.
    out[get_global_id(0)] = sum_of(EACH_SLOT(SUM));
}
