// Soft light at half resolution. One picture of half the width and height (a half picture) has the light that arrives,
// with few samples per pixel and so with noise. A second half picture has the unoccluded light, which would arrive if
// nothing blocked it. The kernel filter_half_light divides the first half picture by the second, and filters the ratio.
// The kernel apply_half_light then multiplies the unoccluded light of the picture of full size by the ratio (Heitz,
// Hill and McGuire, "Combining Analytic Direct Illumination and Stochastic Shadows", I3D 2018). The unoccluded light
// has no noise. The half pictures and the full picture contain emitted light. Where a surface only emits light, the
// half pictures are equal, so the ratio is 1, and the multiplication changes nothing. src/reference/half_light.rs has
// both kernels' computations in f64.
//
//     lit, grainy        unoccluded        ratio, filtered            unoccluded, all pixels
//     +---+---+          +---+---+         +---+---+                  +-+-+-+-+
//     | . |:: |    /     | o | o |    =    | 1 | .5|     x            |o|o|o|o|     =  picture
//     +---+---+          +---+---+         +---+---+                  +-+-+-+-+

#ifndef HALF_LIGHT_SHARPNESS
#error "HALF_LIGHT_SHARPNESS: how fast the weight of a pixel for another falls as their unoccluded light differs"
#endif

// In the kernels filter_half_light and apply_half_light, a work-item processes WIDTH neighbouring pixels of a row.

// Returns the factor that scales the brightest channel of a pixel's light to 1. Without this factor, the fourth powers
// in `likeness` would be infinite for a radiance of 3e9, and 0 for a radiance of 1e-12.
INLINED_ROWS varying light_scale(Vec3 own) {
    return 1.0f / max(max(max(own.x, own.y), own.z), (varying)(FLT_MIN));
}

// Returns another pixel's light times `factor`. Channels are limited to 1e4, so that their fourth powers stay finite.
// The limit changes no likeness: the likeness of light that is much brighter than 1 is 0.
INLINED_ROWS Vec3 scaled_light(Vec3 light, varying factor) {
    const Vec3 scaled = scale(light, factor);
    const varying most = (varying)(1e4f);
    return vec3(min(scaled.x, most), min(scaled.y, most), min(scaled.z, most));
}

// Returns the weight of a pixel in the filtered value of another pixel. `a` and `b` are the unoccluded light of the two
// pixels, both multiplied by the light_scale of one of them. The weight is large if a and b are nearly equal. The
// weight is 0 if a and b differ much, as they usually do on different surfaces, or on different sides of an edge.
INLINED_ROWS varying likeness(Vec3 a, Vec3 b) {
    const Vec3 apart = subtract(a, b), both = add(a, b);
    const varying near = max(dot3(both, both) - (float)HALF_LIGHT_SHARPNESS * dot3(apart, apart), (varying)(0.0f));
    return near * near;
}

// Returns part / whole, or `other` where `whole` is 0.
INLINED_ROWS varying part_of(varying part, varying whole, varying other) {
    return SELECT(whole > 0.0f, part / whole, other);
}

// Filters the ratio of the two half pictures. `ratios` receives, for each pixel of a half picture and each channel, the
// part of the unoccluded light that arrives.
//
// Neighbouring pixels use different points of lights and different directions to the sky, which repeat after 4 pixels
// (soft.cl). The filter covers five pixels across and five down. The first and the last of five pixels in a row use the
// same points and directions, and have half the weight of the others. Each of the four choices of points and directions
// thus gets the same total weight in a row, and likewise in a column. Therefore, no noise is left where all pixels are
// alike (Keller and Heidrich, "Interleaved Sampling", EGWR 2001):
//
//     pixel    -2  -1   0   1   2
//     choice    2   3   0   1   2
//     weight   1/2  1   1   1  1/2
__kernel void filter_half_light(FILTER_HALF_LIGHT_PARAMETERS) {
    const int x = WIDTH * (int)get_global_id(0), y = get_global_id(1);
    if (x >= half_size.x || y >= half_size.y) return;
    const PixelRow own = load_pixels(half_unoccluded, half_size, x, y);
    const varying zero = (varying)(0.0f), factor = light_scale(own.colour);
    const Vec3 light = scale(own.colour, factor);
    Vec3 arrives = vec3(zero, zero, zero), all = vec3(zero, zero, zero);
    for (int down = -2; down <= 2; down++)
        for (int across = -2; across <= 2; across++) {
            // A neighbour's weight is the filter's weight (`share`) times the likeness of the unoccluded light of the
            // neighbour and of the pixel itself.
            const PixelRow there = load_pixels(half_unoccluded, half_size, x + across, y + down);
            const Vec3 lit = load_pixels(half_lit, half_size, x + across, y + down).colour;
            const float share = (across == -2 || across == 2 ? 0.5f : 1.0f) * (down == -2 || down == 2 ? 0.5f : 1.0f);
            // The factor `hit` is 0 for the background, which is no surface.
            const varying weight = share * likeness(light, scaled_light(there.colour, factor)) * there.hit;
            arrives = along(arrives, weight, lit);
            all = along(all, weight, there.colour);
        }
    // In a colour channel without unoccluded light, the ratio would be 0 / 0. This channel gets the ratio of the sums
    // over all three channels. If no channel has unoccluded light, all ratios are 1.
    const varying mean = part_of(arrives.x + arrives.y + arrives.z, all.x + all.y + all.z, (varying)(1.0f));
    const Vec3 ratio =
        vec3(part_of(arrives.x, all.x, mean), part_of(arrives.y, all.y, mean), part_of(arrives.z, all.z, mean));
    store_pixels(ratios, half_size, x, y, ratio, own.hit);
}

// The whole picture is the picture of full size; `image` is a half picture (of half the width and height). For each of
// WIDTH pixels of the whole picture, from column x on, returns one pixel of row y of `image`: the nearest pixel on the
// left or, if `to_right` is 1, on the right. `left` contains the columns of the nearest pixels on the left.
INLINED_ROWS PixelRow half_pixels(const __global float4 *image, int2 half_size, int2 image_size, int x, int y, varying left, int to_right) {
#if WIDTH == 16
    if (image_size.x == 2 * half_size.x) {
        // Each pixel of the half-size picture covers exactly two columns of the whole picture. Neighbouring lanes need
        // neighbouring pixels, so the pixels are loaded together, and a shuffle distributes them to the lanes.
        const PixelRow row = load_pixels(image, half_size, x / 2 - 1, y);
        const Vec3 c = row.colour;
        PixelRow seen;
        seen.colour = to_right ? vec3(c.x.s1223344556677889, c.y.s1223344556677889, c.z.s1223344556677889)
                               : vec3(c.x.s0112233445566778, c.y.s0112233445566778, c.z.s0112233445566778);
        seen.hit = to_right ? row.hit.s1223344556677889 : row.hit.s0112233445566778;
        return seen;
    }
#endif
    const varying_int columns = clamp(TO_INT(left) + to_right, (varying_int)(0), (varying_int)(half_size.x - 1));
    return gather_pixels(image + (size_t)clamp(y, 0, half_size.y - 1) * half_size.x, columns);
}

// Multiplies the unoccluded light of the whole picture (`image`) by the filtered ratio of the pictures of half the
// size. For a pixel, the ratio is interpolated between the four nearest pixels of `ratios`. Each of these four pixels
// has a large weight if it is near, and if its unoccluded light is similar to that of the whole picture's pixel.
__kernel void apply_half_light(APPLY_HALF_LIGHT_PARAMETERS) {
    const int x = WIDTH * (int)get_global_id(0), y = get_global_id(1);
    if (x >= image_size.x || y >= image_size.y) return;
    const PixelRow pixels = load_pixels(image, image_size, x, y);
    const Vec3 own = pixels.colour;
    // `across` and `down` are the positions of the pixels' centres in the picture of half the size, relative to the
    // centre of that picture's first pixel.
    const float per_x = (float)half_size.x / image_size.x, per_y = (float)half_size.y / image_size.y;
    const varying across = (TO_FLOAT(x + LANE_NUMBER) + 0.5f) * per_x - 0.5f, left = floor(across);
    const float down = (y + 0.5f) * per_y - 0.5f, top = floor(down);
    const varying factor = light_scale(own), zero = (varying)(0.0f);
    const Vec3 light = scale(own, factor);
    // `least` keeps the sum of weights above 0 even if all four pixels have a likeness of 0.
    const varying square = dot3(light, light), least = 0.01f * square * square + 1e-37f;
    Vec3 sum = vec3(zero, zero, zero);
    varying weights = zero;
    // Sums over the four nearest pixels of the half picture, in this order: upper left, upper right, lower left, lower
    // right.
    for (int corner = 0; corner < 4; corner++) {
        const int to_right = corner & 1, below = corner >> 1, row = (int)top + below;
        const varying part = (to_right ? across - left : 1.0f - (across - left)) * (below ? down - top : 1.0f - (down - top));
        const PixelRow ratio = half_pixels(ratios, half_size, image_size, x, row, left, to_right);
        const Vec3 there = half_pixels(half_unoccluded, half_size, image_size, x, row, left, to_right).colour;
        const varying weight = part * (likeness(light, scaled_light(there, factor)) * ratio.hit + least);
        sum = along(sum, weight, ratio.colour);
        weights += weight;
    }
    // Only light from surfaces is multiplied by the ratio; the light that a pixel has from the background is not.
    const Vec3 behind = scale(splat(uniform3(background.x, background.y, background.z)), 1.0f - pixels.hit);
    const Vec3 lit = multiply(subtract(own, behind), scale(sum, 1.0f / weights));
    store_pixels(image, image_size, x, y, add(behind, lit), pixels.hit);
}
