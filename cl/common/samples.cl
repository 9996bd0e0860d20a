// Functions for pictures with several samples per pixel. The image holds the mean of the samples cast so far, and every
// frame adds further samples. `wanted` holds, for each block of pixels, the number of samples that each pixel of the
// block gets. The number is the largest uint until mark_rough sets it, after the first few samples. A pixel with enough
// samples is treated like a pixel outside the image: its ray is not cast, and nothing is stored for it.

#ifndef SAMPLED_BLOCK
#error "SAMPLED_BLOCK: side in pixels of the blocks whose pixels get equally many samples"
#endif

// A word of the list of rough blocks, the blocks that get more samples. The word holds a block's row and column, both
// counted in blocks:
//
//     31 ... 16 | 15 ... 0
//     row       | column
#define ROUGH_BLOCK(x, y) ((uint)(y) << 16 | (uint)(x))
#define ROUGH_X(block) ((block) & 0xffffu)
#define ROUGH_Y(block) ((block) >> 16)

// Returns how many blocks cover a row or a column of pixels.
static int sampled_blocks(int pixels) { return (pixels + SAMPLED_BLOCK - 1) / SAMPLED_BLOCK; }

// Returns 1 if a pixel of the image gets more than `earlier` samples, else 0.
static int is_wanted(const __global uint *wanted, uint earlier, int2 image_size, int x, int y) {
    return wanted[y / SAMPLED_BLOCK * sampled_blocks(image_size.x) + x / SAMPLED_BLOCK] > earlier;
}

// Returns the mean of a pixel's samples, including the new one, `sample`. `mean` is the mean of the `earlier` samples
// before the new one.
#define MEAN_OF(mean, sample, earlier) ((earlier) ? (mean) + ((sample) - (mean)) / (float)((earlier) + 1) : (sample))
