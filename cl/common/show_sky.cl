// Shows the picture of the sky where rays from the eye have hit nothing.

__kernel void show_sky(SHOW_SKY_PARAMETERS) {
    const Pixels pixels = own_pixels(image_size);
    Soft sky;
    sky.numbers = soft;
    sky.sample = sample;
    const Vec3 seen = radiance_of_sky(&sky, camera_ray(eye, corner, step_x, step_y, pixels).direction);
    Lanes red, green, blue;
    IntLanes x, y, inside;
    red.all = seen.x, green.all = seen.y, blue.all = seen.z;
    x.all = pixels.x, y.all = pixels.y, inside.all = pixels.inside;
    for (int lane = 0; lane < WIDTH; lane++) {
        if (!inside.each[lane]) continue;
        __global float4 *pixel = image + (size_t)y.each[lane] * image_size.x + x.each[lane];
        // The fourth component says whether the ray hit something.
        if (pixel->w == 0.0f) *pixel = (float4)(red.each[lane], green.each[lane], blue.each[lane], 0.0f);
    }
}
