// Kernels that render a frame tile by tile: either one kernel for the whole frame, or one kernel that finds the nearest
// hits and another kernel that shades them.

// Finds the nearest hits of the rays from the eye, and stores the triangles' indices in leaf order in the bundle (the
// tile's rays). If no ray of the tile can hit the scene, the function computes no rays, and returns 0. Otherwise, it
// returns 1.
int find_nearest(CAST_PARAMETERS Bundle *bundle, const SurfaceTree *tree, CAMERA_PARAMETERS, int2 image_size) {
    Slices slices;
    // First, only the intervals of directions are tested, which costs far less than testing each ray of the tile.
    bundle->longest = slice_camera(CAST_ARGUMENTS eye, corner, step_x, step_y, image_size, &slices);
#if SAMPLED
    leave_out_others(&slices, samples->cast);
#endif
    bundle->origin = LOAD3((const float *)&eye);
    bundle->too_near = 1.0f / max(eye.w, LEAST_INV_T);
    const TileInterval interval = interval_of_tile(&slices);
    Boxes boxes;
    // If the intervals show that all rays miss the boxes of the root's children, no ray is computed: the tile shows
    // only background.
    if (!children_overlap(&interval, bundle->origin, tree->tree.nodes, FAR, &boxes)) return 0;
    finish_slices(bundle, &slices);
    const uint open = make_camera_rays(CAST_ARGUMENTS bundle, eye, corner, step_x, step_y, image_size);
    walk(bundle, &slices, &interval, tree, open, 0);
    return 1;
}

#define BIND_SURFACE_TREE(tree)  \
    tree.tree.nodes = nodes;    \
    tree.tree.leaves = leaves;  \
    BIND_NORMALS(tree.normals)  \
    BIND_MASKS(tree.tree)
#if TEXTURES
#define BIND_TEXTURES(lighting)            \
    lighting.textures.rows = texture_rows; \
    lighting.textures.words = texture_words; \
    lighting.textures.cone = cone;
#else
#define BIND_TEXTURES(lighting)
#endif
#if CORNER_COLOURS
#define BIND_COLOURS(lighting) lighting.corner_colours = corner_colours;
#else
#define BIND_COLOURS(lighting)
#endif
#if SAMPLED
#define BIND_LANES(soft) soft.lane_sample = AS_UINT(sample_of_lane(samples->bits));
#else
#define BIND_LANES(soft)
#endif
#if SOFT
#define BIND_SOFT(lighting)         \
    lighting.soft.numbers = soft; \
    lighting.soft.sample = sample; \
    BIND_LANES(lighting.soft)
#else
#define BIND_SOFT(lighting)
#endif
#define BIND_LIGHTING(lighting)         \
    lighting.lights = lights;           \
    lighting.light_count = light_count; \
    lighting.bias = bias;               \
    lighting.materials = materials;     \
    BIND_TEXTURES(lighting)             \
    BIND_COLOURS(lighting)              \
    BIND_SOFT(lighting)
#define TREE_AND_LIGHTING     \
    SurfaceTree tree;         \
    BIND_SURFACE_TREE(tree)   \
    Lighting lighting;        \
    BIND_LIGHTING(lighting)
// The kernels in this file have no barriers, so work-items whose tile is outside the image may return.
#define LEAVE_OUTSIDE(image_size)                                      \
    if (get_global_id(0) * TILE_X >= image_size.x << SUBPIXEL_BITS || \
        get_global_id(1) * TILE_Y >= image_size.y << SUBPIXEL_BITS)   \
        return;

#if SAMPLED
#define BIND_SAMPLES                             \
    FrameSamples frame_samples;                  \
    frame_samples.earlier = earlier;             \
    frame_samples.bits = (int)subpixel_bits;     \
    frame_samples.count = (int)samples_of_frame; \
    frame_samples.filled = sample_of_lane((int)subpixel_bits) < (int)samples_of_frame; \
    frame_samples.x = sample_x;                  \
    frame_samples.y = sample_y;                  \
    const FrameSamples *samples = &frame_samples;
// With LEAVE_ENOUGH, a work-item returns if all pixels of its tile have enough samples.
#define LEAVE_ENOUGH(image_size)                                       \
    frame_samples.cast = vectors_to_cast(samples, wanted, image_size);     \
    if (!frame_samples.cast) return;
#else
#define BIND_SAMPLES
#define LEAVE_ENOUGH(image_size)
#endif

#if FUSED
// Renders a whole frame.
__kernel GROUP_SHAPE void tile_frame(TILE_FRAME_PARAMETERS) {
    BIND_SAMPLES
    LEAVE_OUTSIDE(image_size)
    LEAVE_ENOUGH(image_size)
    TREE_AND_LIGHTING
    Bundle bundle;
    // Casts primary rays first. Then casts shadow rays from each light to the hits, one light after another.
    if (find_nearest(CAST_ARGUMENTS &bundle, &tree, eye, corner, step_x, step_y, image_size))
        shade_tile(CAST_ARGUMENTS &bundle, &tree, &lighting, eye, corner, step_x, step_y, image_size, background, image);
    else
        store_background(CAST_ARGUMENTS image, image_size, background);
}
#else

// Returns the index at which the tile's part of `nearest` begins. The buffer `nearest` is ordered by tiles and not by
// pixels. Only the shading kernel reads this buffer, tile by tile.
size_t tile_start(void) { return (get_global_id(1) * get_global_size(0) + get_global_id(0)) * (TILE_X * TILE_Y); }

// For every ray from the eye, stores the nearest triangle's index in leaf order, or NO_HIT.
__kernel GROUP_SHAPE void tile_primary(TILE_PRIMARY_PARAMETERS) {
    BIND_SAMPLES
    LEAVE_OUTSIDE(image_size)
    LEAVE_ENOUGH(image_size)
    SurfaceTree tree;
    BIND_SURFACE_TREE(tree)
    Bundle bundle;
    // If no ray can hit the scene, the bundle (the tile's rays) has no results, so NO_HIT is stored instead.
    const int may_hit = find_nearest(CAST_ARGUMENTS &bundle, &tree, eye, corner, step_x, step_y, image_size);
    for (int vector = 0; vector < VECTORS; vector++)
        vstore16(may_hit ? bundle.leaf_index[vector] : (varying_int)(NO_HIT), vector, nearest + tile_start());
}

// Shades the nearest triangle of every ray from the eye.
__kernel GROUP_SHAPE void tile_shade(TILE_SHADE_PARAMETERS) {
    BIND_SAMPLES
    LEAVE_OUTSIDE(image_size)
    LEAVE_ENOUGH(image_size)
    TREE_AND_LIGHTING
    Bundle bundle;
    // Computes the rays' directions again, since tile_primary has stored only the indices of the triangles.
    make_camera_rays(CAST_ARGUMENTS &bundle, eye, corner, step_x, step_y, image_size);
    for (int vector = 0; vector < VECTORS; vector++)
        bundle.leaf_index[vector] = vload16(vector, nearest + tile_start());
    shade_tile(CAST_ARGUMENTS &bundle, &tree, &lighting, eye, corner, step_x, step_y, image_size, background, image);
}
#endif
