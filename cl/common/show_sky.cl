// Shows the picture of the sky where rays from the eye have hit nothing.

// With several samples per pixel, the image holds their mean, which does not show whether the last sample hit
// something. The mean's fourth component times the number of samples is the number of hits so far. If the number of
// hits has not grown, the last sample missed, and the kernel adds the sky's radiance, divided by the number of samples,
// to the mean. Before this addition, the sample counts as black in the mean, since the background is black in scenes
// whose sky is a picture.
__kernel void show_sky(SHOW_SKY_PARAMETERS) {
    const Pixels pixels = own_pixels(image_size);
    Soft sky;
    sky.numbers = soft;
    sky.sample = sample;
#ifdef SUBPIXELS
    sky.lane_sample = (varying_uint)(0);
#endif
    const Vec3 seen = radiance_of_sky(&sky, camera_ray(eye, corner, step_x, step_y, &pixels).direction);
    // The pixels of a work-item's lanes may not be contiguous in the image, so lanes are stored one by one.
    Lanes red, green, blue;
    IntLanes x, y, inside;
    red.all = seen.x, green.all = seen.y, blue.all = seen.z;
    x.all = pixels.x, y.all = pixels.y, inside.all = pixels.inside;
    for (int lane = 0; lane < WIDTH; lane++) {
        if (!inside.each[lane]) continue;
        const size_t at = (size_t)y.each[lane] * image_size.x + x.each[lane];
        const float4 shown = (float4)(red.each[lane], green.each[lane], blue.each[lane], 0.0f);
#if SAMPLED
        if (!is_wanted(wanted, earlier, image_size, x.each[lane], y.each[lane])) continue;
        // The mean of zeros and ones, multiplied by their number, is only nearly a whole number, so the product is
        // rounded.
        const float count = (float)(earlier + 1);
        const uint hits = convert_uint_rte(image[at].w * count);
        if (hits == (earlier ? hits_before[at] : 0)) image[at] += shown / count;
        hits_before[at] = hits;
#else
        // The fourth component is 0 if the ray hit nothing.
        if (image[at].w == 0.0f) image[at] = shown;
#endif
    }
}
