// The working vectors are an array [9][work-items][3] of varyings in the address space WORKING_SPACE. The array is
// volatile, so that compilers load a stored vector again. If compilers kept vectors in registers, measured times would
// not include the accesses to WORKING_SPACE.

// With n work-items:   vector 0                          vector 1
//                      | item 0: x y z | ... | item n-1 | item 0: x y z | ...
//                        ^ first                          ^ first + stride, for item 0
typedef struct {
    volatile WORKING_SPACE varying *first; // points to x of this work-item's vector 0
    size_t stride; // varyings from one vector to the next; with many work-items, too many for an int
} Working;

static Vec3 working_get(const Working *working, int which) {
    volatile WORKING_SPACE varying *at = working->first + which * working->stride;
    return vec3(at[0], at[1], at[2]);
}

static void working_set(Working *working, int which, Vec3 value) {
    volatile WORKING_SPACE varying *at = working->first + which * working->stride;
    at[0] = value.x;
    at[1] = value.y;
    at[2] = value.z;
}
