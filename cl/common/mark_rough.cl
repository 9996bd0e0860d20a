// Marks the blocks of pixels that get more samples. In these rough blocks, neighbouring pixels differ visibly after the
// first samples: at an edge, at the border of a shadow, or because few samples leave grain. If the background is
// transparent, the pixels' alpha is compared too, since the edge of a dark surface is visible only in alpha.
// src/reference/rough.rs marks rough blocks in f64.

#ifndef ROUGH_STEPS
#error "ROUGH_STEPS: a block is rough if, after one sample, neighbouring pixels differ by more steps (of 255) than this"
#endif

// Returns the mean of a pixel's samples. Beyond the image, the pixels at its border repeat.
static float4 mean_of_pixel(const __global float4 *means, int2 image_size, int x, int y) {
    return means[(size_t)clamp(y, 0, image_size.y - 1) * image_size.x + clamp(x, 0, image_size.x - 1)];
}

// Returns channels from 0 to 255, approximately as they are displayed, with a gamma of 2. The last channel is the
// pixel's alpha times `alpha_scale`. `tone` has the coefficients of the tone curve (src/scene/tone.rs): exposed
// radiance v is displayed as v (x v + y) / (v (z v + w) + 1).
static float4 displayed(float4 mean, float exposure, float4 tone, float alpha_scale) {
    const float4 v = clamp(exposure * mean, 0.0f, 1e6f);
    const float4 shown = 255.0f * sqrt(min(v * (tone.x * v + tone.y) / (v * (tone.z * v + tone.w) + 1.0f), 1.0f));
    return (float4)(shown.xyz, alpha_scale * mean.w);
}

static float largest_channel(float4 v) { return max(max(v.x, v.y), max(v.z, v.w)); }

// Pixels are compared in a window that is one pixel wider than the block on each side. The pixels directly around the
// block count too, since the samples of the block's pixels may lie in these neighbours: the pixel filter is wider than
// a pixel. `left` and `top` are the column and the row of the window's first pixel.
#define WINDOW (SAMPLED_BLOCK + 2)

// Returns an upper bound of the difference between neighbouring pixels: over all channels, the largest difference
// between the channel's greatest and least displayed value in the window. The bound takes less time than the comparison
// of all neighbours, because only the greatest and the least radiance are converted to displayed values. (Apart from
// rounding, a brighter radiance is never displayed darker.)
float most_steps(const __global float4 *means, int2 image_size, int left, int top, float exposure, float4 tone,
                 float alpha_scale) {
    float4 least = (float4)(FLT_MAX), greatest = (float4)(-FLT_MAX);
    for (int y = top; y < top + WINDOW; y++)
        for (int x = left; x < left + WINDOW; x++) {
            const float4 mean = mean_of_pixel(means, image_size, x, y);
            least = min(least, mean);
            greatest = max(greatest, mean);
        }
    return largest_channel(displayed(greatest, exposure, tone, alpha_scale) -
                           displayed(least, exposure, tone, alpha_scale));
}

// Returns the largest difference between the displayed values of neighbouring pixels.
float steps_between_neighbours(const __global float4 *means, int2 image_size, int left, int top, float exposure,
                               float4 tone, float alpha_scale) {
    // `above` holds the row of pixels above the current row, and `before` the pixel on the left.
    float4 above[WINDOW], before = (float4)(0.0f), most_apart = (float4)(0.0f);
    for (int row = 0; row < WINDOW; row++)
        for (int column = 0; column < WINDOW; column++) {
            const float4 mean = mean_of_pixel(means, image_size, left + column, top + row);
            const float4 own = displayed(mean, exposure, tone, alpha_scale);
            // In the first column and the first row, a pixel is compared with itself. Conditions instead of these
            // values would make LLVM 18, the compiler of PoCL 6.0, abort for some CPUs.
            const float4 on_left = column ? before : own, on_top = row ? above[column] : own;
            most_apart = max(most_apart, max(fabs(own - on_left), fabs(own - on_top)));
            above[column] = before = own;
        }
    return largest_channel(most_apart);
}

// Returns 1 if a difference of `steps` (of 255) between pixels is visible after `first` samples per pixel, else 0. The
// grain of `first` samples is weaker than that of one sample, by the factor sqrt(first). Differences therefore count if
// they are above ROUGH_STEPS / sqrt(first). Squares are compared, so that no root is rounded.
static int is_visible(float steps, uint first) { return first * steps * steps > ROUGH_STEPS * ROUGH_STEPS; }

// Sets a block's number of samples to `most` if the block is rough (neighbouring pixels differ visibly, even if only in
// one channel), otherwise to `first`. Also adds a rough block to the list of rough blocks.
__kernel void mark_rough(MARK_ROUGH_PARAMETERS) {
    const int across = sampled_blocks(image_size.x), block = get_global_id(0);
    if (block >= across * sampled_blocks(image_size.y)) return;
    const int left = block % across * SAMPLED_BLOCK - 1, top = block / across * SAMPLED_BLOCK - 1;
    const int is_rough =
        is_visible(most_steps(means, image_size, left, top, exposure, tone, alpha_scale), first) &&
        is_visible(steps_between_neighbours(means, image_size, left, top, exposure, tone, alpha_scale), first);
    wanted[block] = is_rough ? most : first;
    // The order of the list of rough blocks varies from run to run, but the order has no effect, since the blocks are
    // cast independently of each other.
    if (is_rough) rough[atomic_inc(rough_counter)] = ROUGH_BLOCK(block % across, block / across);
}
