// Several samples of each pixel. The image holds the mean of those cast so far, and every frame adds one to it.
// `wanted` says how many a pixel gets, with one number for each block of pixels; mark_rough changes it after the first
// few samples. A pixel that wants no more is treated like one outside the image: it is not cast and not stored.

#ifndef SAMPLED_BLOCK
#error "SAMPLED_BLOCK: side in pixels of the blocks whose pixels get equally many samples"
#endif

// A rough block, in the list of those that get more samples: its row in the upper 16 bits, its column in the lower ones.
#define ROUGH_BLOCK(x, y) ((uint)(y) << 16 | (uint)(x))
#define ROUGH_X(block) ((block) & 0xffffu)
#define ROUGH_Y(block) ((block) >> 16)

int sampled_blocks(int pixels) { return (pixels + SAMPLED_BLOCK - 1) / SAMPLED_BLOCK; }

// Returns whether a pixel of the image gets another sample after `earlier` ones.
int is_wanted(const __global uint *wanted, uint earlier, int2 image_size, int x, int y) {
    return wanted[y / SAMPLED_BLOCK * sampled_blocks(image_size.x) + x / SAMPLED_BLOCK] > earlier;
}

// Returns the mean of a pixel's earlier samples and another one.
#define MEAN_OF(mean, sample, earlier) ((earlier) ? (mean) + ((sample) - (mean)) / (float)((earlier) + 1) : (sample))
