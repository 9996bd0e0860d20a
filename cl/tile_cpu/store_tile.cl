// Stores the radiance of a tile's pixels in the image.

// With PREFETCH, STREAM16 stores 16 floats without writing them to the caches, since nothing reads the image again
// before the next sample or the next kernel.
#if PREFETCH
#define STREAM16(value, to) __builtin_nontemporal_store(value, (__global float16 *)(to))
#else
#define STREAM16(value, to) vstore16(value, 0, (__global float *)(to))
#endif

// Stores one row of a block of pixels: four pixels, with the lanes `lanes` (such as s0123). `row` points to the row's
// first pixel.
#define STORE_PIXELS(lanes, row)                                          \
    STREAM16(MEAN_WITH(vload16(0, (__global float *)(row)),               \
                       interleave(red.lanes, green.lanes, blue.lanes, hit.lanes)), row)

#if SAMPLED
static float sum_of_lanes(float16 v) {
    const float8 a = v.lo + v.hi;
    const float4 b = a.lo + a.hi;
    const float2 c = b.lo + b.hi;
    return c.x + c.y;
}

// Returns four sums, each over the 2 x 2 neighbouring lanes that are the sub-pixels of one pixel.
static float4 sums_of_squares(float16 v) {
    // Adds the values of neighbouring lanes across, then down:
    //
    //      0  1  2  3                 0 1                 0 1
    //      4  5  6  7        ->       2 3        ->       2 3
    //      8  9 10 11                 4 5
    //     12 13 14 15                 6 7
    //     4 rows of 4                 4 rows of 2         2 rows of 2
    const float8 across = v.even + v.odd;
    return across.s0145 + across.s2367;
}

// Updates a pixel's mean of `earlier` samples by `count` new samples, whose sum is `sum`.
static void add_samples(__global float4 *mean, float4 sum, uint earlier, int count) {
    const float per_sample = 1.0f / (float)(earlier + count);
    *mean = earlier ? *mean + (sum - (float)count * *mean) * per_sample : sum * per_sample;
}

// Adds this frame's samples of the 2 x 2 pixels of a vector of rays to the pixels' means in the image.
void store_subpixels(const FrameSamples *samples, __global float4 *restrict image, int2 image_size, float4 background,
                     const Vec3 *sum, const Pixels *pixels, Mask hits) {
    // Sub-pixels without a sample add nothing; samples that hit nothing add the background.
    const varying red = SELECT(hits, sum->x, SELECT(samples->filled, (varying)(background.x), (varying)(0.0f)));
    const varying green = SELECT(hits, sum->y, SELECT(samples->filled, (varying)(background.y), (varying)(0.0f)));
    const varying blue = SELECT(hits, sum->z, SELECT(samples->filled, (varying)(background.z), (varying)(0.0f)));
    const varying hit = SELECT(hits, (varying)(1.0f), (varying)(0.0f));
    const int x = pixels->x.s0, y = pixels->y.s0;
    if (x >= image_size.x || y >= image_size.y) return;
    __global float4 *mean = image + (size_t)y * image_size.x + x;
    // Some of the 2 x 2 pixels may lie outside the image.
    const float4 r = sums_of_squares(red), g = sums_of_squares(green), b = sums_of_squares(blue), h = sums_of_squares(hit);
    const int right = x + 1 < image_size.x, below = y + 1 < image_size.y;
    add_samples(mean, (float4)(r.x, g.x, b.x, h.x), samples->earlier, samples->count);
    if (right) add_samples(mean + 1, (float4)(r.y, g.y, b.y, h.y), samples->earlier, samples->count);
    mean += image_size.x;
    if (below) add_samples(mean, (float4)(r.z, g.z, b.z, h.z), samples->earlier, samples->count);
    if (right && below) add_samples(mean + 1, (float4)(r.w, g.w, b.w, h.w), samples->earlier, samples->count);
}

// Returns the sum of the samples of one pixel. The samples are the rays of a vector. Samples that hit nothing add the
// background. The sum's fourth component is the number of hits.
static float4 sum_of_samples(const FrameSamples *samples, float4 background, const Vec3 *sum, Mask hits) {
    const varying none = (varying)(0.0f);
    const float count = (float)popcount(LANE_BITS16(hits));
    const float red = sum_of_lanes(SELECT(hits, sum->x, none)), green = sum_of_lanes(SELECT(hits, sum->y, none));
    const float blue = sum_of_lanes(SELECT(hits, sum->z, none)), missing = (float)samples->count - count;
    return (float4)(red + missing * background.x, green + missing * background.y, blue + missing * background.z, count);
}

// For tiles in which all rays of a vector are samples of one pixel: adds this frame's samples to the pixels' means in
// the image. `sums` contains one float4 per vector of rays: the sum of the samples of the vector's pixel.
void store_sums(const FrameSamples *samples, const float4 *sums, __global float4 *restrict image, int2 image_size) {
    const int x = FIRST_COLUMN(0), y = FIRST_ROW(0);
#if BLOCKS_ACROSS % 4 == 0
    const int is_inside = x + BLOCKS_ACROSS <= image_size.x && y + VECTORS / BLOCKS_ACROSS <= image_size.y;
    if (is_inside && image_size.x % 4 == 0 && popcount(samples->cast) == VECTORS) {
        // Four pixels of a row are stored at a time.
        const float count = (float)samples->count, per_sample = 1.0f / ((float)samples->earlier + count);
        for (int vector = 0; vector < VECTORS; vector += 4) {
            __global float4 *row = image + (size_t)FIRST_ROW(vector) * image_size.x + FIRST_COLUMN(vector);
            const float16 sum = vload16(0, (const float *)(sums + vector));
            const float16 mean = vload16(0, (const __global float *)row);
            STREAM16(samples->earlier ? mean + (sum - count * mean) * per_sample : sum * per_sample, row);
        }
        return;
    }
#endif
    EACH_CAST(vector) {
        const int column = FIRST_COLUMN(vector), row = FIRST_ROW(vector);
        if (column < image_size.x && row < image_size.y)
            add_samples(image + (size_t)row * image_size.x + column, sums[vector], samples->earlier, samples->count);
    }
}
#endif

// Stores the radiance of a vector of rays, like store_radiance. Four pixels of a row are stored at a time if three
// conditions hold: pixels are not divided into sub-pixels, the vector's block of pixels lies inside the image, and the
// image's width is a multiple of four pixels.
void store_block(CAST_PARAMETERS __global float4 *restrict image, int2 image_size, float4 background,
                 const Vec3 *sum, const Pixels *pixels, Mask hits) {
#if SAMPLED
    if (samples->bits) {
        store_subpixels(samples, image, image_size, background, sum, pixels, hits);
        return;
    }
    const uint earlier = samples->earlier;
#endif
    const int x = pixels->x.s0, y = pixels->y.s0;
    // At the border of the image, or if rows do not begin at multiples of four pixels, pixels are stored one by one.
    if (image_size.x % BLOCK_X || x >= image_size.x || y + BLOCK_Y > image_size.y) {
        store_radiance(EARLIER_ARGUMENT image, image_size, background, *sum, *pixels, hits);
        return;
    }
    const varying red = SELECT(hits, sum->x, (varying)(background.x));
    const varying green = SELECT(hits, sum->y, (varying)(background.y));
    const varying blue = SELECT(hits, sum->z, (varying)(background.z));
    const varying hit = SELECT(hits, (varying)(1.0f), (varying)(0.0f));
    __global float4 *row = image + (size_t)y * image_size.x + x;
    STORE_PIXELS(s0123, row);
    STORE_PIXELS(s4567, row + image_size.x);
    STORE_PIXELS(s89ab, row + 2 * image_size.x);
    STORE_PIXELS(scdef, row + 3 * image_size.x);
}

// Stores the background for a tile whose rays hit nothing: in all pixels of the tile that get a sample in this frame.
void store_background(CAST_PARAMETERS __global float4 *restrict image, int2 image_size, float4 background) {
    const Vec3 none = splat(uniform3(0.0f, 0.0f, 0.0f));
#if SAMPLED
    if (IS_PIXEL_A_VECTOR(samples)) {
        float4 sums[VECTORS];
        const float4 sum = sum_of_samples(samples, background, &none, (Mask)(0));
        for (int vector = 0; vector < VECTORS; vector++) sums[vector] = sum;
        store_sums(samples, sums, image, image_size);
        return;
    }
#endif
    EACH_CAST(vector) {
        const Pixels pixels = tile_pixels(CAST_ARGUMENTS vector, image_size);
        store_block(CAST_ARGUMENTS image, image_size, background, &none, &pixels, (Mask)(0));
    }
}
