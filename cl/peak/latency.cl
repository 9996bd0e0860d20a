// Measures the latency of each kind of memory: a single work-item needs each result before its next access.

#ifndef ENTRIES
#error "ENTRIES: number of elements of the arrays in private and __local memory"
#endif

// Each iteration of a loop executes STEPS steps, so that the cost of the loop counter is negligible.
#define STEPS 16
#define DO_STEPS(DO) DO DO DO DO DO DO DO DO DO DO DO DO DO DO DO DO

// Measures the latency of multiply-adds in registers: each multiply-add waits for the previous one.
__kernel void chain_private(const int loops, const float factor, const float addend, __global float *out) {
    float value = out[0];
    for (int loop = 0; loop < loops; loop++) {
        // Each step needs the result of the previous step, so the time per step is a latency, and not a rate.
        DO_STEPS(value = fma(value, factor, addend);)
    }
    out[0] = value;
}

// Fills an array in any address space with indices of its own elements. Reading an element gives the index of the next
// element to read, which is `stride` elements further on.
#define FILL(next) \
    for (int i = 0; i < ENTRIES; i++) next[i] = (i + stride) % ENTRIES;

// Measures the latency of a private array. Each index is known only when the previous read returns, so the array cannot
// be kept in registers.
__kernel void chase_private(const int loops, const int stride, __global int *out) {
    volatile int next[ENTRIES];
    FILL(next)
    // Each read waits for the previous read, which returns the index of the next element. In the kernels chase_local
    // and chase_global, too, each read waits for the previous one.
    int at = 0;
    for (int loop = 0; loop < loops; loop++) {
        DO_STEPS(at = next[at];)
    }
    out[0] = at;
}

// Measures the latency of an array in __local memory.
__kernel void chase_local(const int loops, const int stride, __global int *out) {
    __local volatile int next[ENTRIES];
    FILL(next)
    int at = 0;
    for (int loop = 0; loop < loops; loop++) {
        DO_STEPS(at = next[at];)
    }
    out[0] = at;
}

// Measures the latency of global memory. `next` has one random cycle through a buffer, with one element for each cache
// line. The buffer is larger than any cache if the device has enough memory.
__kernel void chase_global(const int loops, const int start, const __global int *restrict next, __global int *out) {
    int at = start;
    for (int loop = 0; loop < loops; loop++) {
        DO_STEPS(at = next[at];)
    }
    out[0] = at;
}
