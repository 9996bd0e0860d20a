// Converts pixels to displayed bytes on devices whose memory is separate from the host's. Three bytes per pixel are
// then transferred to the host instead of sixteen. The kernel uses the tables of src/image/display.rs, so that every
// byte equals the byte that the host would compute.

#ifndef SHOWN_VALUES
#error "SHOWN_VALUES: number of values of a displayed channel"
#endif
#ifndef INDEX_SHIFT
#error "INDEX_SHIFT: number of a radiance's lower bits that are ignored when a table is read"
#endif
#ifndef ITEM_PIXELS
#error "ITEM_PIXELS: pixels of a work-item, whose bytes fill whole words"
#endif
#ifndef GROUP
#error "GROUP: work-items of a work-group"
#endif

#define ITEM_BYTES (3 * ITEM_PIXELS)

// Returns the displayed value of a channel. Radiance that is not positive, or not a number, is black. `smallest[value]`
// is the smallest radiance whose displayed value is larger than `value`. `at_least` is indexed by the upper bits of a
// radiance, and contains a lower bound of the displayed value. `smallest` and `at_least` are in global memory:
// work-items read different addresses, which __constant memory would serve one after the other.
static uchar shown(const float radiance, __global const float *smallest, __global const uchar *at_least) {
    if (!(radiance > 0.0f)) return 0;
    uint value = at_least[as_uint(radiance) >> INDEX_SHIFT];
    // The bound in `at_least` is usually at most 1 too low, so the loop takes few steps.
    while (value + 1 < SHOWN_VALUES && smallest[value] <= radiance) value++;
    return (uchar)value;
}

// Displays `count` pixels of `image`, from the pixel with the index `first` on. A pixel's fourth channel is positive if
// the pixel shows a hit. `rows` receives three bytes per pixel, then padding for the last work-item. `counters` has two
// elements. To the first element, the kernel adds the number of pixels that show a hit; to the second, the number of
// pixels with a colour channel that is not finite.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void show_pixels(
    __global const float4 *restrict image, const ulong first, const uint count, __global const float *restrict smallest,
    __global const uchar *restrict at_least, __global uchar *restrict rows, __global uint *restrict counters) {
    __local uint hits, wrong;
    if (get_local_id(0) == 0) hits = wrong = 0;
    barrier(CLK_LOCAL_MEM_FENCE);

    // The pixels of a work-item are consecutive. Beyond the last of the `count` pixels, the kernel uses zeros in place
    // of pixels.
    const uint begin = ITEM_PIXELS * (uint)get_global_id(0);
    uint own_hits = 0, own_wrong = 0;
    uchar bytes[ITEM_BYTES];
    for (uint i = 0; i < ITEM_PIXELS; i++) {
        const float4 pixel = begin + i < count ? image[first + begin + i] : (float4)(0.0f);
        bytes[3 * i] = shown(pixel.x, smallest, at_least);
        bytes[3 * i + 1] = shown(pixel.y, smallest, at_least);
        bytes[3 * i + 2] = shown(pixel.z, smallest, at_least);
        own_hits += pixel.w > 0.0f;
        own_wrong += !(isfinite(pixel.x) && isfinite(pixel.y) && isfinite(pixel.z));
    }
    // Memory is written in units of four bytes, so each store writes four bytes.
    if (begin < count) {
        for (uint i = 0; i < ITEM_BYTES; i += 4) vstore4(vload4(0, bytes + i), 0, rows + 3 * (size_t)begin + i);
    }

    // Each work-group adds to each of the `counters` at most once, since atomic additions at the same address wait for
    // each other.
    if (own_hits) atomic_add(&hits, own_hits);
    if (own_wrong) atomic_add(&wrong, own_wrong);
    barrier(CLK_LOCAL_MEM_FENCE);
    if (get_local_id(0) == 0) {
        if (hits) atomic_add(counters, hits);
        if (wrong) atomic_add(counters + 1, wrong);
    }
}
