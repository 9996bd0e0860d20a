// A tile of the camera's rays.

#define BLOCKS_ACROSS (TILE_X / BLOCK_X)

// Returns the pixels of a vector of a tile.
Pixels tile_pixels(int vector, int2 image_size) {
    Pixels pixels;
    pixels.x = (int)get_global_id(0) * TILE_X + vector % BLOCKS_ACROSS * BLOCK_X + LANE_X;
    pixels.y = (int)get_global_id(1) * TILE_Y + vector / BLOCKS_ACROSS * BLOCK_Y + LANE_Y;
    pixels.inside = (pixels.x < image_size.x) & (pixels.y < image_size.y);
    return pixels;
}

// Computes the interval of corner + x step_x + y step_y over each vector's block of pixels, extended by its rounding
// error. x and y belong to the first pixel.
void slice_axis(float corner, float step_x, float step_y, float16 x, float16 y, float16 *low, float16 *high) {
    // A direction is linear in x and y, so its smallest and largest values lie at corners of the block.
    const float16 from_x = x * step_x, from_y = y * step_y;
    const float across = (BLOCK_X - 1) * step_x, down = (BLOCK_Y - 1) * step_y;
    const float16 base = corner + from_x + from_y;
    // Rounding errors of the terms: the interval must contain every direction that make_camera_rays computes.
    const float16 rounding =
        5e-7f * (fabs(from_x) + fabs(from_y) + (float16)(fabs(corner) + fabs(across) + fabs(down)));
    *low = base + (min(across, 0.0f) + min(down, 0.0f)) - rounding;
    *high = base + (max(across, 0.0f) + max(down, 0.0f)) + rounding;
}

// Computes the intervals of the tile's directions without making any ray; returns their largest component.
float slice_camera(CAMERA_PARAMETERS, int2 image_size, Slices *slices) {
    float16 longest = (float16)(0.0f);
    for (int part = 0; part < PARTS; part++) {
        // A lane is a vector here: sixteen vectors' intervals are computed at once.
        const int16 vector = LANES + 16 * part;
        const int16 px = (int)get_global_id(0) * TILE_X + vector % BLOCKS_ACROSS * BLOCK_X;
        const int16 py = (int)get_global_id(1) * TILE_Y + vector / BLOCKS_ACROSS * BLOCK_Y;
        const float16 x = convert_float16(px) + 0.5f, y = convert_float16(py) + 0.5f;
        slice_axis(corner.x, step_x.x, step_y.x, x, y, &slices->low[0][part], &slices->high[0][part]);
        slice_axis(corner.y, step_x.y, step_y.y, x, y, &slices->low[1][part], &slices->high[1][part]);
        slice_axis(corner.z, step_x.z, step_y.z, x, y, &slices->low[2][part], &slices->high[2][part]);
        for (int axis = 0; axis < 3; axis++)
            longest = max(longest, max(fabs(slices->low[axis][part]), fabs(slices->high[axis][part])));
#if VECTORS < 16
        for (int axis = 0; axis < 3; axis++) {
            // Lanes without a vector get an empty interval, which overlaps no box.
            slices->low[axis][part] = SELECT(vector < VECTORS, slices->low[axis][part], (float16)(FAR));
            slices->high[axis][part] = SELECT(vector < VECTORS, slices->high[axis][part], (float16)(-FAR));
        }
#endif
        // Blocks completely outside the image get a reach of zero.
        slices->reach[part] = SELECT((px < image_size.x) & (py < image_size.y), (float16)(FAR), (float16)(-1.0f));
    }
    return most_lane(longest);
}

#if SAMPLED
// Returns the vectors whose pixels get another sample.
uint vectors_to_cast(const __global uint *wanted, uint earlier, int2 image_size) {
    uint cast = 0;
    for (int vector = 0; vector < VECTORS; vector++) {
        const Pixels pixels = tile_pixels(vector, image_size);
        const int x = pixels.x.s0, y = pixels.y.s0;
        cast |= pixels.inside.s0 && is_wanted(wanted, earlier, image_size, x, y) ? 1u << vector : 0;
    }
    return cast;
}

// Gives the other vectors an empty interval, which overlaps no box, and a reach of less than zero.
void leave_out_others(Slices *slices, uint cast) {
    for (int part = 0; part < PARTS; part++) {
        const int16 is_cast = (int16)((int)(cast >> (16 * part))) >> LANES & 1;
        for (int axis = 0; axis < 3; axis++) {
            slices->low[axis][part] = SELECT(is_cast != 0, slices->low[axis][part], (float16)(FAR));
            slices->high[axis][part] = SELECT(is_cast != 0, slices->high[axis][part], (float16)(-FAR));
        }
        slices->reach[part] = SELECT(is_cast != 0, slices->reach[part], (float16)(-1.0f));
    }
}
#endif

// Returns the vectors with a ray inside the image.
uint make_camera_rays(CAST_PARAMETERS Bundle *bundle, CAMERA_PARAMETERS, int2 image_size) {
    uint inside = 0;
#if SAMPLED
    for (int vector = 0; vector < VECTORS; vector++) bundle->place[vector] = (varying_int)(NO_HIT);
#endif
    EACH_CAST(vector) {
        const Pixels pixels = tile_pixels(vector, image_size);
        const varying x = TO_FLOAT(pixels.x) + 0.5f, y = TO_FLOAT(pixels.y) + 0.5f;
        bundle->x[vector] = corner.x + x * step_x.x + y * step_y.x;
        bundle->y[vector] = corner.y + x * step_x.y + y * step_y.y;
        bundle->z[vector] = corner.z + x * step_x.z + y * step_y.z;
        // No hit yet: the nearest hit is at infinity. Lanes outside the image are finished from the start.
        bundle->inv_t[vector] = SELECT(pixels.inside, (varying)(LEAST_INV_T), (varying)(FAR));
        bundle->place[vector] = (varying_int)(NO_HIT);
        prepare_rays(bundle, vector, pixels.inside);
        inside |= ANY(pixels.inside) ? 1u << vector : 0;
    }
    return inside;
}
