// The nine working vectors of a work-item (the paper's "arrays"), 12 bytes per ray each.

#ifndef WORKING_VECTORS
#error "WORKING_VECTORS: number of working vectors of a ray"
#endif
#define RAY_ORIGIN 0
#define RAY_DIRECTION 1
#define WEIGHTS 2   // barycentric w0, w1, w2 of the nearest hit
#define POINT 3     // P, the point that the ray hits
#define NORMAL 4    // n
#define TO_EYE 5    // w_o
#define RADIANCE 6  // L_o, the sum over lights
#define INCOMING 7  // L_i, the light's radiance
#define TO_LIGHT 8  // w_i
