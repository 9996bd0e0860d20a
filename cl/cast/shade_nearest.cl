// Computes and stores each pixel's radiance. An earlier kernel has stored the number of the pixel's nearest triangle.
__kernel GROUP_SHAPE void shade_nearest(SHADE_NEAREST_PARAMETERS) {
    SCENE_AND_WORKING
    const Pixels pixels = CAST_PIXELS;
    // The kernel that found the nearest triangle stored only the triangle's number, so shade_nearest computes the ray
    // again. The function after_closest_hit computes the hit from the ray and the triangle.
    begin_rays(&working, camera_ray(eye, corner, step_x, step_y, &pixels));
    Nearest nearest;
    nearest.t = (varying)(FAR);
    nearest.triangle = load_nearest(nearest_triangle, image_size, pixels);
    const Mask hits = nearest.triangle != NO_HIT;
    after_closest_hit(&working, &scene, &nearest, hits);
    store_radiance(EARLIER_ARGUMENT image, image_size, background, working_get(&working, RADIANCE), pixels, hits);
}
