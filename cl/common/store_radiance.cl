// Stores the radiance of pixels in the image. With several samples per pixel, the image holds the mean of the samples
// cast so far.

#if SAMPLED
#define EARLIER_PARAMETER uint earlier,
#define EARLIER_ARGUMENT earlier,
#define MEAN_WITH(mean, sample) MEAN_OF(mean, sample, earlier)
#else
#define EARLIER_PARAMETER
#define EARLIER_ARGUMENT
#define MEAN_WITH(mean, sample) sample
#endif

#if WIDTH == 16
// Returns four neighbouring pixels in the image's format.
static float16 interleave(float4 red, float4 green, float4 blue, float4 hit) {
    // Each argument has one channel of four pixels; the image holds r g b hit, r g b hit, ...
    const float8 rb = (float8)(red.x, blue.x, red.y, blue.y, red.z, blue.z, red.w, blue.w);
    const float8 gh = (float8)(green.x, hit.x, green.y, hit.y, green.z, hit.z, green.w, hit.w);
    return (float16)(rb.s0, gh.s0, rb.s1, gh.s1, rb.s2, gh.s2, rb.s3, gh.s3, rb.s4, gh.s4, rb.s5, gh.s5, rb.s6, gh.s6,
                     rb.s7, gh.s7);
}
#endif

// Stores the radiance `sum` for the lanes of `hits`, and the background for all other lanes, in the lanes' pixels. The
// fourth component is 1 for a hit, and 0 for a miss.
static void store_radiance(EARLIER_PARAMETER __global float4 *image, int2 image_size, float4 background, Vec3 sum, Pixels pixels, Mask hits) {
    Lanes red, green, blue, hit;
    IntLanes x, y, inside;
    red.all = SELECT(hits, sum.x, (varying)(background.x));
    green.all = SELECT(hits, sum.y, (varying)(background.y));
    blue.all = SELECT(hits, sum.z, (varying)(background.z));
    hit.all = SELECT(hits, (varying)(1.0f), (varying)(0.0f));
    // The pixels of a work-item's lanes may not be contiguous in the image, so lanes are stored one by one.
    x.all = pixels.x;
    y.all = pixels.y;
    inside.all = pixels.inside;
    for (int lane = 0; lane < WIDTH; lane++)
        if (inside.each[lane])
            image[(size_t)y.each[lane] * image_size.x + x.each[lane]] =
                MEAN_WITH(image[(size_t)y.each[lane] * image_size.x + x.each[lane]],
                          (float4)(red.each[lane], green.each[lane], blue.each[lane], hit.each[lane]));
}
