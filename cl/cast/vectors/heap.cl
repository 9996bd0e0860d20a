// meaning: allocated inside the kernel from a global pool by an atomic counter, like the paper's malloc
// memory: heap
// bytes_per_ray: 108
//
// Working vectors in a global pool, from which the kernel allocates each vector separately. The pool replaces the
// paper's malloc, which OpenCL C lacks. heap_top counts the varyings that were allocated. The host sets heap_top to
// zero before it starts the kernel, and compares heap_top with the pool's size afterwards. An allocation beyond the
// pool's end gets the start of the pool, so that nothing is written outside the pool; the host then rejects the image.

typedef struct {
    volatile __global varying *vector[WORKING_VECTORS];
} Working;

#define WORKING_LOCALS
#define BIND_WORKING(working)                           \
    for (int v = 0; v < WORKING_VECTORS; v++)           \
        working.vector[v] = (__global varying *)heap + heap_allocate(heap_top, heap_size, 3);

// Returns the index of the first of `count` free varyings. This is a bump allocator: its counter only grows, and all
// work-items contend for it. The pool contains the vectors in the order in which work-items allocate them, which may be
// any order:
//
//     | item 7: x y z | item 2: x y z | item 7: x y z | item 0: x y z | ...          heap_top -> next free
uint heap_allocate(volatile __global uint *heap_top, uint heap_size, uint count) {
    // One atomic addition reserves the varyings, so that no other work-item gets them.
    const uint at = atomic_add(heap_top, count);
    return at + count <= heap_size ? at : 0;
}

// The pointers are volatile, as in working_in_memory.cl, so that the memory is really used.
Vec3 working_get(const Working *working, int which) {
    volatile __global varying *at = working->vector[which];
    return vec3(at[0], at[1], at[2]);
}

void working_set(Working *working, int which, Vec3 value) {
    volatile __global varying *at = working->vector[which];
    at[0] = value.x;
    at[1] = value.y;
    at[2] = value.z;
}
