// The rays of a tile from the eye, and the intervals of their directions.

#define BLOCKS_ACROSS (TILE_X / BLOCK_X)

// The column and row of the first pixel of one of the tile's vectors of rays (16 rays each). `vector` is the vector's
// number, or an int16 of numbers.
#define FIRST_COLUMN(vector) \
    (((int)get_global_id(0) * TILE_X + (vector) % BLOCKS_ACROSS * BLOCK_X) >> SUBPIXEL_BITS)
#define FIRST_ROW(vector) (((int)get_global_id(1) * TILE_Y + (vector) / BLOCKS_ACROSS * BLOCK_Y) >> SUBPIXEL_BITS)

#if SAMPLED
// Returns the number of each lane's sample among the samples of the lane's pixel in this frame. A pixel has 2^bits
// sub-pixels across and 2^bits down.
static varying_int sample_of_lane(int bits) {
    // The lowest `bits` bits of a lane's column and row in its vector are the sub-pixel's column and row in the pixel.
    const int last = (1 << bits) - 1;
    // The number is a sum of products, since one GPU's compiler computes the same expression with `|` and `<<` wrongly
    // (docs/log.md, 2026-11-27).
    return (LANE_X & last) + (LANE_Y & last) * (1 << bits);
}
#endif

// Returns the pixel of each lane of a vector of rays, whose 16 rays form a block of 4 x 4. If the frame casts several
// rays per pixel, several lanes have the same pixel: the block then covers 2 x 2 pixels or one pixel.
static Pixels tile_pixels(CAST_PARAMETERS int vector, int2 image_size) {
    Pixels pixels;
    // All rays form a grid. A ray's column and row in this grid, divided by the number of sub-pixels across or down,
    // give the column and row of the ray's pixel.
    pixels.x = ((int)get_global_id(0) * TILE_X + vector % BLOCKS_ACROSS * BLOCK_X + LANE_X) >> SUBPIXEL_BITS;
    pixels.y = ((int)get_global_id(1) * TILE_Y + vector / BLOCKS_ACROSS * BLOCK_Y + LANE_Y) >> SUBPIXEL_BITS;
    pixels.inside = (pixels.x < image_size.x) & (pixels.y < image_size.y);
#if SAMPLED
    pixels.sample_x = samples->x, pixels.sample_y = samples->y;
    pixels.inside &= samples->filled;
#endif
    return pixels;
}

// Bounds of the positions, in pixels, of the rays of one vector, relative to the corner of the vector's first pixel.
// The rays lie between x and x + across, and between y and y + down.
typedef struct {
    float x, y, across, down;
} BlockRays;

BlockRays block_rays(CAST_PARAMETERS int bits) {
    BlockRays rays;
    rays.x = rays.y = 0.5f;
    rays.across = (BLOCK_X >> bits) - 1;
    rays.down = (BLOCK_Y >> bits) - 1;
#if SAMPLED
    // A sample's position may lie outside its pixel, as far as the pixel filter reaches, so the bounds depend on the
    // positions of the samples.
    rays.x = least_lane(samples->x), rays.y = least_lane(samples->y);
    rays.across += most_lane(samples->x) - rays.x;
    rays.down += most_lane(samples->y) - rays.y;
#endif
    return rays;
}

// Computes, for each vector of rays, the interval of one component (x, y or z) of the directions corner + x step_x + y
// step_y. The interval is widened by a bound of the rounding error. The arguments `x` and `y` are the lower bounds (see
// BlockRays) of the positions of each vector's rays.
static void slice_axis(float corner, float step_x, float step_y, const BlockRays *rays, float16 x, float16 y, float16 *low,
                float16 *high) {
    // The component is linear in x and y, so its smallest and largest values lie at corners of the rectangle that
    // bounds the positions.
    const float16 from_x = x * step_x, from_y = y * step_y;
    const float across = rays->across * step_x, down = rays->down * step_y;
    const float16 base = corner + from_x + from_y;
    // `rounding` bounds the rounding errors of the component: the interval from `low` to `high` must contain every
    // direction that make_camera_rays computes.
    const float16 rounding =
        5e-7f * (fabs(from_x) + fabs(from_y) + (float16)(fabs(corner) + fabs(across) + fabs(down)));
    *low = base + (min(across, 0.0f) + min(down, 0.0f)) - rounding;
    *high = base + (max(across, 0.0f) + max(down, 0.0f)) + rounding;
}

// Computes the intervals of the directions of the tile's rays without computing any ray. Returns an upper bound of the
// absolute values of the directions' components.
float slice_camera(CAST_PARAMETERS CAMERA_PARAMETERS, int2 image_size, Slices *slices) {
    const BlockRays rays = block_rays(CAST_ARGUMENTS SUBPIXEL_BITS);
    float16 longest = (float16)(0.0f);
    for (int part = 0; part < PARTS; part++) {
        // Each lane computes the interval of one vector of rays, so sixteen intervals are computed together.
        const int16 vector = LANES + 16 * part;
        const int16 px = FIRST_COLUMN(vector), py = FIRST_ROW(vector);
        const float16 x = convert_float16(px) + rays.x, y = convert_float16(py) + rays.y;
        slice_axis(corner.x, step_x.x, step_y.x, &rays, x, y, &slices->low[0][part], &slices->high[0][part]);
        slice_axis(corner.y, step_x.y, step_y.y, &rays, x, y, &slices->low[1][part], &slices->high[1][part]);
        slice_axis(corner.z, step_x.z, step_y.z, &rays, x, y, &slices->low[2][part], &slices->high[2][part]);
        for (int axis = 0; axis < 3; axis++)
            longest = max(longest, max(fabs(slices->low[axis][part]), fabs(slices->high[axis][part])));
#if VECTORS < 16
        for (int axis = 0; axis < 3; axis++) {
            // Lanes after the tile's last vector of rays get an empty interval, which overlaps no box.
            slices->low[axis][part] = SELECT(vector < VECTORS, slices->low[axis][part], (float16)(FAR));
            slices->high[axis][part] = SELECT(vector < VECTORS, slices->high[axis][part], (float16)(-FAR));
        }
#endif
        // A block of pixels outside the image gets a reach (largest t) below 0, so that its rays meet no box.
        slices->reach[part] = SELECT((px < image_size.x) & (py < image_size.y), (float16)(FAR), (float16)(-1.0f));
    }
    return most_lane(longest);
}

#if SAMPLED
// Returns the vectors of rays whose pixels get another sample, one bit each. All pixels of a vector get equally many
// samples.
static uint vectors_to_cast(const FrameSamples *samples, const __global uint *wanted, int2 image_size) {
    uint cast = 0;
    for (int vector = 0; vector < VECTORS; vector++) {
        const int x = FIRST_COLUMN(vector), y = FIRST_ROW(vector);
        const int inside = x < image_size.x && y < image_size.y;
        cast |= inside && is_wanted(wanted, samples->earlier, image_size, x, y) ? 1u << vector : 0;
    }
    return cast;
}

// Gives the vectors of rays that are not in `cast` an empty interval, which meets no box, and a reach (largest t)
// below 0.
static void leave_out_others(Slices *slices, uint cast) {
    for (int part = 0; part < PARTS; part++) {
        const int16 is_cast = LANES_OF(cast, part);
        for (int axis = 0; axis < 3; axis++) {
            slices->low[axis][part] = SELECT(is_cast, slices->low[axis][part], (float16)(FAR));
            slices->high[axis][part] = SELECT(is_cast, slices->high[axis][part], (float16)(-FAR));
        }
        slices->reach[part] = SELECT(is_cast, slices->reach[part], (float16)(-1.0f));
    }
}
#endif

// Computes the rays of all of the tile's vectors. Returns the vectors with a ray inside the image, one bit each.
uint make_camera_rays(CAST_PARAMETERS Bundle *bundle, CAMERA_PARAMETERS, int2 image_size) {
    // The ray of a lane passes through the point (right, below), in pixels from the corner of the vector's first pixel.
    // A direction is corner + x step_x + y step_y. Each direction is the sum of `first` and `within`. `first`, the
    // direction to the corner of the vector's first pixel, is the same for all lanes. `within` is the same for all
    // vectors of rays.
    const varying_int column = LANE_X >> SUBPIXEL_BITS, row = LANE_Y >> SUBPIXEL_BITS;
#if SAMPLED
    const varying right = TO_FLOAT(column) + samples->x, below = TO_FLOAT(row) + samples->y;
    const Mask filled = samples->filled;
    for (int vector = 0; vector < VECTORS; vector++) bundle->leaf_index[vector] = (varying_int)(NO_HIT);
#else
    const varying right = TO_FLOAT(column) + 0.5f, below = TO_FLOAT(row) + 0.5f;
    const Mask filled = (Mask)(-1);
#endif
    const Vec3 across = splat(LOAD3((const float *)&step_x)), down = splat(LOAD3((const float *)&step_y));
    const Vec3 within = add(scale(across, right), scale(down, below));
    uint inside = 0;
    EACH_CAST(vector) {
        const int x = FIRST_COLUMN(vector), y = FIRST_ROW(vector);
        const Mask rays = filled & (column < image_size.x - x) & (row < image_size.y - y);
        const float4 first = corner + (float)x * step_x + (float)y * step_y;
        // Directions have depth 1 (a component of 1 along the view direction), not length 1.
        bundle->x[vector] = first.x + within.x;
        bundle->y[vector] = first.y + within.y;
        bundle->z[vector] = first.z + within.z;
        // No ray has hit anything yet, so each ray's nearest hit is at infinity. Lanes outside the image are finished
        // from the start.
        bundle->inv_t[vector] = SELECT(rays, (varying)(LEAST_INV_T), (varying)(FAR));
        bundle->leaf_index[vector] = (varying_int)(NO_HIT);
        prepare_rays(bundle, vector, rays);
        inside |= ANY(rays) ? 1u << vector : 0;
    }
    return inside;
}
