// meaning: allocated inside the kernel from a global pool by an atomic counter, like the paper's malloc
// memory: heap
// bytes_per_ray: 108
//
// The working vectors are in a pool in global memory. The kernel allocates each vector separately. (The student paper
// that raycl reproduces uses malloc, which OpenCL C lacks.) heap_top is the number of allocated varyings. The host sets
// heap_top to zero before the kernel starts. An allocation beyond the pool's end gets the pool's start, so that nothing
// is written outside the pool. After the kernel, the host rejects the image if heap_top exceeds the pool's size.

typedef struct {
    volatile __global varying *vector[WORKING_VECTORS];
} Working;

#define WORKING_LOCALS
#define BIND_WORKING(working)                           \
    for (int v = 0; v < WORKING_VECTORS; v++)           \
        working.vector[v] = (__global varying *)heap + heap_allocate(heap_top, heap_size, 3);

// Reserves `count` elements (varyings) of the pool. Returns the first reserved element's index, or 0 if the pool is
// full. The pool has a bump allocator: its counter only grows, and all work-items contend for it. Work-items allocate
// their vectors in any order, for example:
//
//     | item 7: x y z | item 2: x y z | item 7: x y z | item 0: x y z | ...          heap_top -> next free
static uint heap_allocate(volatile __global uint *heap_top, uint heap_size, uint count) {
    // One atomic addition reserves the pool's elements, so that no other work-item gets the same elements.
    const uint at = atomic_add(heap_top, count);
    return at + count <= heap_size ? at : 0;
}

// The vectors are volatile, as in working_in_memory.cl, so that compilers do not keep them in registers.
static Vec3 working_get(const Working *working, int which) {
    volatile __global varying *at = working->vector[which];
    return vec3(at[0], at[1], at[2]);
}

static void working_set(Working *working, int which, Vec3 value) {
    volatile __global varying *at = working->vector[which];
    at[0] = value.x;
    at[1] = value.y;
    at[2] = value.z;
}
