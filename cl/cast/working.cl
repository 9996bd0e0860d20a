// The indices of a ray's nine working vectors of 12 bytes each. In the paper's program, the vectors are arrays.

#ifndef WORKING_VECTORS
#error "WORKING_VECTORS: number of working vectors of a ray"
#endif
#define RAY_ORIGIN 0
#define RAY_DIRECTION 1
#define WEIGHTS 2   // barycentric w0, w1, w2 of the nearest hit
#define POINT 3     // P, the ray's hit (with smooth shadows, P' of common/smooth_shadows.cl)
#define NORMAL 4    // n, the surface's normal at P
#define TO_EYE 5    // w_o, the direction to the eye
#define RADIANCE 6  // L_o, the radiance that leaves P towards the eye
#define INCOMING 7  // L_i, the light that arrives at P from one light
#define TO_LIGHT 8  // w_i, the direction to the light
