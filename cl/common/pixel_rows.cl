// Vectors of pixels that lie side by side in a row of an image.

// Without inlining, some compilers copy a PixelRow, which consists of several vectors, at every call.
#define INLINED_ROWS static __attribute__((always_inline))

// WIDTH pixels of an image, one vector per channel. `hit`, the fourth channel, is the part of a pixel's rays that hit.
typedef struct {
    Vec3 colour;
    varying hit;
} PixelRow;

// Returns the pixels at arbitrary columns of a row; the columns must lie inside the image.
INLINED_ROWS PixelRow gather_pixels(const __global float4 *row, varying_int columns) {
    IntLanes at;
    at.all = columns;
    Lanes red, green, blue, hit;
    // Each lane loads one pixel of 16 bytes. The pixel's four channels go to four vectors.
    for (int lane = 0; lane < WIDTH; lane++) {
        const float4 pixel = row[at.each[lane]];
        red.each[lane] = pixel.x, green.each[lane] = pixel.y, blue.each[lane] = pixel.z, hit.each[lane] = pixel.w;
    }
    PixelRow pixels;
    pixels.colour = vec3(red.all, green.all, blue.all), pixels.hit = hit.all;
    return pixels;
}

// Returns WIDTH pixels of row y, from column x on. Beyond the image, the pixels at its border repeat.
INLINED_ROWS PixelRow load_pixels(const __global float4 *image, int2 size, int x, int y) {
    const __global float4 *row = image + (size_t)clamp(y, 0, size.y - 1) * size.x;
#if WIDTH == 16
    if (x >= 0 && x + WIDTH <= size.x) {
        // Each of the vectors a, b, c and d holds four pixels of four channels. Separating even and odd lanes twice
        // gives one vector for each channel, with 16 pixels.
        const __global float *from = (const __global float *)(row + x);
        const float16 a = vload16(0, from), b = vload16(1, from), c = vload16(2, from), d = vload16(3, from);
        const float16 rb = (float16)(a.even, b.even), rb2 = (float16)(c.even, d.even);
        const float16 gh = (float16)(a.odd, b.odd), gh2 = (float16)(c.odd, d.odd);
        PixelRow pixels;
        pixels.colour = vec3((float16)(rb.even, rb2.even), (float16)(gh.even, gh2.even), (float16)(rb.odd, rb2.odd));
        pixels.hit = (float16)(gh.odd, gh2.odd);
        return pixels;
    }
#endif
    // At the border of the image, columns are clamped lane by lane.
    return gather_pixels(row, clamp(x + LANE_NUMBER, (varying_int)(0), (varying_int)(size.x - 1)));
}

// Stores WIDTH pixels in row y, from column x on, as far as they lie inside the image.
INLINED_ROWS void store_pixels(__global float4 *image, int2 size, int x, int y, Vec3 colour, varying hit) {
    __global float4 *row = image + (size_t)y * size.x;
#if WIDTH == 16
    if (x + WIDTH <= size.x) {
        // All 16 pixels are inside the image, so four stores of four pixels each are enough.
        __global float *to = (__global float *)(row + x);
        vstore16(interleave(colour.x.s0123, colour.y.s0123, colour.z.s0123, hit.s0123), 0, to);
        vstore16(interleave(colour.x.s4567, colour.y.s4567, colour.z.s4567, hit.s4567), 1, to);
        vstore16(interleave(colour.x.s89ab, colour.y.s89ab, colour.z.s89ab, hit.s89ab), 2, to);
        vstore16(interleave(colour.x.scdef, colour.y.scdef, colour.z.scdef, hit.scdef), 3, to);
        return;
    }
#endif
    Lanes red, green, blue, own_hit;
    red.all = colour.x, green.all = colour.y, blue.all = colour.z, own_hit.all = hit;
    for (int lane = 0; lane < min(WIDTH, size.x - x); lane++)
        row[x + lane] = (float4)(red.each[lane], green.each[lane], blue.each[lane], own_hit.each[lane]);
}
