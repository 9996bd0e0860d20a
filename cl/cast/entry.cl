// The kernels for rays that are cast one by one, or together in the lanes of a vector. These kernels call functions
// from files that depend on the strategy (see cast/parts.cl). The kernels also declare the __local arrays that these
// functions need, because OpenCL C allows __local arrays only in kernels.

#ifndef FUSED
#error "FUSED: 0 or 1: whether one kernel casts a whole frame"
#endif
#ifndef GIVEN_RAYS
#error "GIVEN_RAYS: 0 or 1: whether there is a kernel that casts rays from a buffer (frames do not need this kernel)"
#endif
#include "cast/parts.cl"

#if FUSED
// Casts primary rays, shades their hits, and casts shadow rays. (CAST_FRAME_PARAMETERS: see common/work_group.cl.)
__kernel GROUP_SHAPE void cast_frame(CAST_FRAME_PARAMETERS) {
    SCENE_AND_WORKING
    const Pixels pixels = CAST_PIXELS;
    const varying t_min = begin_rays(&working, search_ray(eye, corner, step_x, step_y, &pixels));
    Nearest nearest;
    closest_hit(&working, &scene, t_min, pixels.inside, &nearest);
// With LINEAR_IN_PIXEL (the pixel-linear intersector), ray directions are in pixel coordinates during the search.
// Shading needs unit directions, so that t is a distance. The rays are therefore computed again, with unit directions.
#if LINEAR_IN_PIXEL
    begin_rays(&working, camera_ray(eye, corner, step_x, step_y, &pixels));
#endif
    // All lanes have taken part in closest_hit, even lanes outside the image, because all work-items must reach any
    // barriers in closest_hit. After closest_hit, lanes outside the image count as misses.
    const Mask hits = pixels.inside & (nearest.triangle != NO_HIT);
    after_closest_hit(&working, &scene, &nearest, hits);
    store_radiance(EARLIER_ARGUMENT image, image_size, background, working_get(&working, RADIANCE), pixels, hits);
}
#else

// Stores the number of every pixel's nearest triangle, or NO_HIT.
__kernel GROUP_SHAPE void cast_primary(CAST_PRIMARY_PARAMETERS) {
    SCENE_AND_WORKING
    const Pixels pixels = CAST_PIXELS;
    const varying t_min = begin_rays(&working, search_ray(eye, corner, step_x, step_y, &pixels));
    Nearest nearest;
    closest_hit(&working, &scene, t_min, pixels.inside, &nearest);
    // One number per pixel is enough: shade_nearest computes t and the weights again from the triangle.
    store_nearest(nearest_triangle, image_size, pixels, nearest.triangle);
}

#include "cast/shade_nearest.cl"
#endif

#if GIVEN_RAYS
// Casts rays from a buffer, for tests and for uses other than pictures. The buffer holds eight floats per ray:
// origin.xyz, t_min, direction.xyz, 0.
__kernel GROUP_SHAPE void cast_rays(CAST_RAYS_PARAMETERS) {
    SCENE_AND_WORKING
    const int first = (int)(get_global_id(1) * get_global_size(0) + get_global_id(0)) * WIDTH;
    // `ray` has seven vectors with one lane per ray: three for the origin, three for the direction, one for t_min.
    // Lanes after the buffer's last ray contain the last ray again.
    Lanes ray[7];
    IntLanes triangle;
    for (int lane = 0; lane < WIDTH; lane++) {
        const int at = min(first + lane, ray_count - 1);
        const float4 from = rays[2 * at], to = rays[2 * at + 1];
        ray[0].each[lane] = from.x, ray[1].each[lane] = from.y, ray[2].each[lane] = from.z;
        ray[3].each[lane] = to.x, ray[4].each[lane] = to.y, ray[5].each[lane] = to.z;
        ray[6].each[lane] = from.w;
    }
    working_set(&working, RAY_ORIGIN, vec3(ray[0].all, ray[1].all, ray[2].all));
    working_set(&working, RAY_DIRECTION, vec3(ray[3].all, ray[4].all, ray[5].all));
    Nearest nearest;
    // The fourth argument, the mask of wanted lanes, is set in all lanes, since every lane has a ray.
    closest_hit(&working, &scene, ray[6].all, (varying_int)(first) == first, &nearest);
    // The results of lanes that repeat the last ray are not stored.
    triangle.all = nearest.triangle;
    for (int lane = 0; lane < WIDTH; lane++)
        if (first + lane < ray_count) nearest_triangle[first + lane] = triangle.each[lane];
}
#endif

#if PLANES_OF_ORIGIN
#include "cast/prepare_origins.cl"
#endif
#if RECORDS_ONCE
#include "cast/prepare_records.cl"
#endif
