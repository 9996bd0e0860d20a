// The vectors in the kernels of `raycl peak` (peak rates). Each vector has WIDTH floats: the device's native width or,
// if the device's lanes are work-items, a width that the measurement chooses (src/peak/rig.rs).

#ifndef WIDTH
#error "WIDTH: floats of a vector: 1, 2, 4, 8 or 16"
#endif
#ifndef GROUP
#error "GROUP: work-items of a work-group"
#endif

#if WIDTH == 1
typedef float vector;
#elif WIDTH == 2
typedef float2 vector;
#elif WIDTH == 4
typedef float4 vector;
#elif WIDTH == 8
typedef float8 vector;
#else
typedef float16 vector;
#endif

typedef union {
    vector all;
    float each[WIDTH];
} Parts;

// Returns the sum of a vector's components.
static float sum_of(vector v) {
    Parts parts;
    parts.all = v;
    float sum = 0.0f;
    for (int i = 0; i < WIDTH; i++) sum += parts.each[i];
    return sum;
}
