// Measures the rate of multiply-adds in CHAINS chains, which do not wait for each other. Each chain converges to addend
// / (1 - factor), so the result is known.

#include "peak/vector.cl"

#define CHAINS 16
#define STEPS 8
#define EACH_CHAIN(DO) \
    DO(0) DO(1) DO(2) DO(3) DO(4) DO(5) DO(6) DO(7) DO(8) DO(9) DO(10) DO(11) DO(12) DO(13) DO(14) DO(15)

// multiply_add is a function with vector parameters, since some compilers use their widest registers only for such
// functions.
static vector multiply_add(vector a, vector b, vector c) { return fma(a, b, c); }

// Each iteration of the loop executes STEPS * CHAINS * WIDTH multiply-adds, so that the cost of the loop counter is
// negligible.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void fma_rate(const int loops, const float factor,
                                                                         const float addend,
                                                                         __global float *restrict out) {
    const vector b = (vector)(factor), c = (vector)(addend);
#define START(i) vector chain##i = (vector)((float)(get_local_id(0) + i));
#define STEP(i) chain##i = multiply_add(chain##i, b, c);
#define SUM(i) +chain##i
    EACH_CHAIN(START)
    // The chains of multiply-adds are independent, so a multiply-add waits only for the previous one of its chain.
    for (int loop = 0; loop < loops; loop++) {
        EACH_CHAIN(STEP) EACH_CHAIN(STEP) EACH_CHAIN(STEP) EACH_CHAIN(STEP)
        EACH_CHAIN(STEP) EACH_CHAIN(STEP) EACH_CHAIN(STEP) EACH_CHAIN(STEP)
    }
    // Without this store, compilers would remove the computation.
    out[get_global_id(0)] = sum_of(EACH_CHAIN(SUM));
}
