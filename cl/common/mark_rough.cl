// Marks the blocks of pixels that get more samples. In these rough blocks, neighbouring pixels differ visibly after the
// first samples: at an edge, at the border of a shadow, or because few samples leave grain. If the background is
// transparent, the pixels' alpha is compared too, since the edge of a dark surface is visible only in alpha.
// src/reference/rough.rs marks rough blocks in f64.

#ifndef ROUGH_STEPS
#error "ROUGH_STEPS: a block is rough if, after one sample, neighbouring pixels differ by more steps (of 255) than this"
#endif

// Returns a pixel's channels from 0 to 255, approximately as they are displayed, with a gamma of 2. The last channel is
// the pixel's alpha times `alpha_scale`. Beyond the image, the pixels at its border repeat. `tone` has the coefficients
// of the tone curve (src/scene/tone.rs): exposed radiance v is displayed as v (x v + y) / (v (z v + w) + 1).
float4 displayed(const __global float4 *image, int2 image_size, int x, int y, float exposure, float4 tone,
                 float alpha_scale) {
    const float4 mean = image[(size_t)clamp(y, 0, image_size.y - 1) * image_size.x + clamp(x, 0, image_size.x - 1)];
    const float4 v = clamp(exposure * mean, 0.0f, 1e6f);
    const float4 shown = 255.0f * sqrt(min(v * (tone.x * v + tone.y) / (v * (tone.z * v + tone.w) + 1.0f), 1.0f));
    return (float4)(shown.xyz, alpha_scale * mean.w);
}

// Sets a block's number of samples to `most` if the block is rough (neighbouring pixels differ visibly), otherwise to
// `first`. Also adds a rough block to the list of rough blocks. The pixels directly around the block are compared too,
// since the samples of the block's pixels may lie in these neighbours: the pixel filter is wider than a pixel.
__kernel void mark_rough(MARK_ROUGH_PARAMETERS) {
    const int across = sampled_blocks(image_size.x), block = get_global_id(0);
    if (block >= across * sampled_blocks(image_size.y)) return;
    // The window of compared pixels is one pixel wider than the block on each side. `above` holds the row of pixels
    // above the current row.
    const int left = block % across * SAMPLED_BLOCK - 1, top = block / across * SAMPLED_BLOCK - 1;
    float4 above[SAMPLED_BLOCK + 2], most_apart = (float4)(0.0f);
    for (int row = 0; row < SAMPLED_BLOCK + 2; row++) {
        float4 before = displayed(means, image_size, left, top + row, exposure, tone, alpha_scale);
        for (int column = 0; column < SAMPLED_BLOCK + 2; column++) {
            const float4 own = displayed(means, image_size, left + column, top + row, exposure, tone, alpha_scale);
            most_apart = max(most_apart, fabs(own - before));
            if (row) most_apart = max(most_apart, fabs(own - above[column]));
            above[column] = before = own;
        }
    }
    // A block is rough even if only one channel differs visibly. With `first` samples per pixel, the grain is finer by
    // the factor sqrt(first) than with one sample. With finer grain, a smaller difference makes a block rough:
    // ROUGH_STEPS / sqrt(first). Squares of differences are compared, so that no root is rounded.
    const float steps = max(max(most_apart.x, most_apart.y), max(most_apart.z, most_apart.w));
    const int is_rough = first * steps * steps > ROUGH_STEPS * ROUGH_STEPS;
    wanted[block] = is_rough ? most : first;
    // The order of the list of rough blocks varies from run to run, but the order has no effect, since the blocks are
    // cast independently of each other.
    if (is_rough) rough[atomic_inc(rough_counter)] = ROUGH_BLOCK(block % across, block / across);
}
