// Each work-item computes the row (the planes) of one triangle for the rays of one origin. Dimension 0 of the index
// space numbers the triangles, dimension 1 the origins. Origin 0 is the eye, origin i is light i - 1.
__kernel void prepare_origins(PREPARE_ORIGINS_PARAMETERS) {
    const int triangle = get_global_id(0);
    const int origin = get_global_id(1);
    if (triangle >= triangle_count) return;
    const Uniform3 from = origin ? LOAD3(lights + LIGHT_FLOATS * (origin - 1)) : uniform3(eye.x, eye.y, eye.z);
    const __global float *at = soup + SOUP_STRIDE * (size_t)triangle;
    Corners corners;
    corners.a = LOAD3(at);
    corners.b = LOAD3(at + 3);
    corners.c = LOAD3(at + 6);
    // Let n be the triangle's normal, and A a corner. The last argument of planes_of is the sign of n . (A - from) for
    // rays that meet the triangle's front. A ray from the eye meets the side that faces the eye, so this sign is
    // negative. A shadow ray is tested from its light, but runs to the light, and so meets the side that faces away
    // from the light. For shadow rays, the sign of n . (A - from) is positive.
    Row row = planes_of(corners, from, origin ? 1.0f : -1.0f);
#if LINEAR_IN_PIXEL
    // Only rays from the eye belong to pixels, so only the planes through the eye become functions of the pixel.
    if (!origin) row = row_along_pixels(row, corner, step_x, step_y);
#endif
    STORE_ROW(row, prepared + 3 * ((size_t)origin * triangle_count + triangle))
}
