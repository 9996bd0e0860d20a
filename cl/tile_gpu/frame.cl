// Casts rays from the eye, and finds their nearest hits. The rays of a tile are cast by a group of 32 work-items.
// shadow.cl casts shadow rays, for a limited number of lights at a time (a round of lights). shade.cl casts leftover
// shadow rays, and shades the hits.

// The tiles of a work-group form two columns if their number is even, else one column. In two columns, the tiles are
// closer to each other, so more of the nodes that they read are the same.
#ifndef TILES_ACROSS
#error "TILES_ACROSS: tiles of a work-group side by side"
#endif
#define TILES_DOWN (LOCAL_Y / TILES_ACROSS)

// A frame may cast several rays through each pixel, one per sample. The frame's rays then form a grid that is finer
// than the image: each pixel has 2^bits columns and 2^bits rows of rays. If `bits` is 2, the samples of a pixel lie in
// the grid like this:
//
//      0  1  2  3
//      4  5  6  7      A tile of 8 x 8 rays then covers 2 x 2 pixels: the finer the grid, the
//      8  9 10 11      narrower the tile's shaft, and the fewer nodes the tile visits.
//     12 13 14 15
#if SAMPLED
#define BIND_SAMPLES                       \
    group.wanted = wanted;                 \
    group.earlier = earlier;               \
    group.bits = (int)subpixel_bits;       \
    group.samples = (int)samples_of_frame; \
    group.positions = positions;           \
    group.tile = own_tile(&group, rough, (int)rough_count);
#define SUBPIXEL_BITS group.bits
#define SAMPLES_OF_FRAME group.samples
#else
#define BIND_SAMPLES
#define SUBPIXEL_BITS 0
#define SAMPLES_OF_FRAME 1
#endif
#define GRID_OF(image_size) ((image_size) << SUBPIXEL_BITS)

// Returns the first column and row of a group's tile in the grid of rays, for frames whose tiles cover the whole grid.
// `row` is the row of work-groups that contains the tile.
INLINED int2 tile_in_row(Group *group, int row) {
    // Adds the position of the group's tile within the work-group to the position of the work-group's first tile.
    const int tile_x = (int)get_group_id(0) * TILES_ACROSS + group->number % TILES_ACROSS;
    const int tile_y = row * TILES_DOWN + group->number / TILES_ACROSS;
    return (int2)(tile_x * TILE_X, tile_y * TILE_Y);
}

#if SAMPLED
// Packs the first column and row of a tile into one register. Tiles begin at multiples of 8 x 4 rays. An image of at
// most 65,536 pixels across and down has at most 262,144 rays across and down, so these quotients fit into 16 bits:
//
//     31 ... 16 | 15 ... 0
//     row / 4   | column / 8
INLINED uint packed_tile(int2 at) { return (uint)(at.y / 4) << 16 | (uint)(at.x / 8); }
INLINED int2 unpacked_tile(uint tile) { return (int2)((int)(tile & 0xffffu) * 8, (int)(tile >> 16) * 4); }
#define TILE_OUTSIDE 0xffffffffu // a position beyond every grid of rays

// Returns the packed position of the group's own tile, or TILE_OUTSIDE if the group has no tile. If `rough_count` is
// not 0, tiles cover only the `rough_count` rough blocks (of pixels that get more samples), and no tile is larger than
// a block. For rough blocks, the host starts only as many work-groups as the blocks need, and tiles are numbered block
// by block. For example, a block of 16 x 16 rays has four tiles of 8 x 8:
//
//     rough[0]: 0 1    rough[1]: 4 5
//               2 3              6 7
INLINED uint own_tile(Group *group, const __global uint *rough, int rough_count) {
    const int row = (int)get_global_id(1) / LOCAL_Y, side = SAMPLED_BLOCK << group->bits;
    if (!rough_count) return packed_tile(tile_in_row(group, row));
    const int across = side / TILE_X, tiles = across * (side / TILE_Y);
    const int number = (row * (int)get_num_groups(0) + (int)get_group_id(0)) * LOCAL_Y + group->number;
    // The last groups may have no tile.
    if (number >= rough_count * tiles) return TILE_OUTSIDE;
    const uint block = rough[number / tiles];
    const int tile = number % tiles;
    const int2 start = (int2)((int)ROUGH_X(block), (int)ROUGH_Y(block)) * side;
    return packed_tile(start + (int2)(tile % across * TILE_X, tile / across * TILE_Y));
}
#endif

// STACK_LOCALS defines a group with its stack. LEAF_LOCALS defines the memory for the triangles of a leaf that are
// tested against the group's rays.
#define STACK_LOCALS                            \
    GROUP_LOCALS                                 \
    __local uint2 stacks[LOCAL_Y][STACK_SIZE]; \
    Group group;                                 \
    BIND_GROUP(group)                            \
    BIND_SAMPLES                                 \
    __local uint2 *stack = stacks[group.number];
#define LEAF_LOCALS                                             \
    __local float4 leaf_quads[LOCAL_Y][3 * GROUP_LANES]; \
    __local int leaf_lanes[LOCAL_Y][GROUP_LANES];        \
    Candidates candidates;                                     \
    candidates.quads = leaf_quads[group.number];          \
    candidates.lanes = leaf_lanes[group.number];
#if PLANES_OF_ORIGIN
#define PLANES_OF_TREE       \
    tree.planes = prepared;    \
    tree.row = prepared_row;
#else
#define PLANES_OF_TREE
#endif
#define TREE_OF_TILES     \
    Tree tree;              \
    tree.nodes = nodes;     \
    tree.leaves = leaves;   \
    BIND_MASKS(tree)        \
    PLANES_OF_TREE

// A ray from the eye: its position (x, y) in the grid of the frame's rays, and whether the ray is cast (`inside`).
typedef struct {
    int x, y, inside;
#if SAMPLED
    float ray_x, ray_y; // the point of the image, in pixels, through which the ray passes
#endif
} EyeRay;

// Returns the ray at a position in the grid of the frame's rays. The ray is not cast (`inside` is 0) if it lies outside
// the image, if its pixel has enough samples, or if the frame has no sample for its sub-pixel.
#if SAMPLED
INLINED EyeRay ray_at(Group *group, int2 at, int2 grid) {
    // The lowest `bits` bits of a ray's column and row in the grid of rays are the ray's column and row in its pixel.
    const int last = (1 << group->bits) - 1, sample = (at.x & last) | (at.y & last) << group->bits;
    const int2 pixel = at >> group->bits;
    EyeRay ray;
    ray.x = at.x;
    ray.y = at.y;
    ray.inside = (at.x < grid.x) & (at.y < grid.y) & (sample < group->samples);
    ray.inside = ray.inside && is_wanted(group->wanted, group->earlier, grid >> group->bits, pixel.x, pixel.y);
    ray.ray_x = pixel.x + group->positions[2 * sample];
    ray.ray_y = pixel.y + group->positions[2 * sample + 1];
    return ray;
}
#define RAY_AT_X(ray) (ray).ray_x
#define RAY_AT_Y(ray) (ray).ray_y
#else
INLINED EyeRay ray_at(Group *group, int2 at, int2 grid) {
    EyeRay ray;
    ray.x = at.x;
    ray.y = at.y;
    ray.inside = (at.x < grid.x) & (at.y < grid.y);
    return ray;
}
#define RAY_AT_X(ray) ((ray).x + 0.5f)
#define RAY_AT_Y(ray) ((ray).y + 0.5f)
#endif

// Returns the position of a lane's ray in its tile. The tile consists of blocks of 8 x 4 rays.
INLINED int2 position_in_tile(Group *group, int ray) {
    const int across = TILE_X / 8, lane = forgotten(group->lane);
    return (int2)(ray % across * 8 + lane % 8, ray / across * 4 + lane / 8);
}

// Returns the position of a lane's ray in the grid of rays, for frames whose tiles cover the whole grid. `row` is the
// row of work-groups that contains the tile.
INLINED int2 position_in_row(Group *group, int row, int ray) {
    return tile_in_row(group, row) + position_in_tile(group, ray);
}

// Returns a lane's ray in the group's own tile.
INLINED EyeRay tile_ray(Group *group, int ray, int2 grid) {
#if SAMPLED
    const int2 tile = unpacked_tile(group->tile);
#else
    const int2 tile = tile_in_row(group, (int)get_global_id(1) / LOCAL_Y);
#endif
    return ray_at(group, tile + position_in_tile(group, ray), grid);
}

// Returns the index of a ray from the eye in buffers with one element for each ray of the grid.
INLINED uint index_of(EyeRay ray, int2 grid) { return (uint)ray.y * (uint)grid.x + (uint)ray.x; }

// Returns a ray's direction, which has depth 1 (a component of 1 along the view direction), not length 1.
INLINED Vec3 direction_of(float4 corner, float4 step_x, float4 step_y, EyeRay eye_ray) {
    const float x = RAY_AT_X(eye_ray), y = RAY_AT_Y(eye_ray);
    return vec3(corner.x + x * step_x.x + y * step_y.x, corner.y + x * step_x.y + y * step_y.y,
                corner.z + x * step_x.z + y * step_y.z);
}

// Returns which of this lane's rays are cast, one bit each.
INLINED uint rays_inside(Group *group, int2 grid) {
    uint inside = 0;
    EACH_RAY(ray) inside |= tile_ray(group, ray, grid).inside ? 1u << ray : 0u;
    return inside;
}

// Computes the directions of the tile's rays from the eye. These rays begin at the near plane and never end.
INLINED void camera_directions(Group *group, CAMERA_PARAMETERS, int2 grid, Directions *directions) {
    EACH_RAY(ray) {
        const Vec3 direction = direction_of(corner, step_x, step_y, tile_ray(group, ray, grid));
        directions->x[ray] = direction.x, directions->y[ray] = direction.y, directions->z[ray] = direction.z;
#if CUTOUTS
        directions->point[ray] = vec3(eye.x, eye.y, eye.z);
#endif
    }
    directions->per_begin = eye.w > 0.0f ? reciprocal(eye.w) : FAR;
    directions->per_end = 0.0f;
}

// The largest number of passes of a tile: one for each of the two directions of each of the three axes. A pass takes
// all rays whose component along the pass's axis is more than `ALONG_AXIS` times the direction's 1-norm. The ray that
// determines a pass's axis has its largest component along this axis: at least a third of the 1-norm (the sum of the
// components' absolute values). A pass therefore takes all rays that could begin another pass with the same axis and
// the same direction along it. Rays whose direction is not a number (NaN) belong to no pass.
#define MOST_PASSES 6

// For each of a tile's rays from the eye, finds the nearest triangle and stores the triangle's index in leaf order, or
// NO_HIT. Returns which of this lane's rays hit, one bit each. `packet.leaf_index` keeps the hits of earlier passes,
// since a pass changes only the hits of its own rays.
INLINED uint find_nearest(Group *group, const Tree *tree, CAMERA_PARAMETERS, int2 grid, __local uint2 *stack,
                          const Candidates *candidates, __global int *nearest) {
    int unlimited = 0;
    uint todo = rays_inside(group, grid);
    RayPacket packet;
    EACH_RAY(ray) packet.leaf_index[ray] = NO_HIT;
    // This loop over passes runs once, unless the tile is so wide that its rays run along several axes. All lanes leave
    // the loop together, since the functions in the loop need the whole group. The loop has a single exit, since PoCL
    // (OpenCL for CPUs) duplicates the code after a loop with barriers for each of the loop's exits.
    for (int pass = 0; lane_any(group, todo != 0) && pass < MOST_PASSES; pass++) {
        Directions directions;
        Shaft shaft;
        camera_directions(group, eye, corner, step_x, step_y, grid, &directions);
        const uint active = begin_pass(group, tree, origin_at(uniform3(eye.x, eye.y, eye.z), 0), &directions, todo, 0,
                                       &shaft, &packet);
        walk(group, tree, &shaft, &packet, 0, &unlimited, stack, candidates);
        todo &= ~active;
    }
    uint hits = 0;
    // The result of every ray that is cast is stored, even if the ray hit nothing, since shading reads all results.
    EACH_RAY(ray) {
        const EyeRay eye_ray = tile_ray(group, ray, grid);
        if (eye_ray.inside) nearest[index_of(eye_ray, grid)] = packet.leaf_index[ray];
        hits |= packet.leaf_index[ray] != NO_HIT ? 1u << ray : 0u;
    }
    return hits;
}

#if !FUSED
// Finds and stores the nearest hits of rays from the eye.
__kernel GROUP_SHAPE GROUP_ATTRIBUTE void tile_primary(TILE_PRIMARY_PARAMETERS) {
    STACK_LOCALS
    LEAF_LOCALS
    TREE_OF_TILES
    find_nearest(&group, &tree, eye, corner, step_x, step_y, GRID_OF(image_size), stack, &candidates, nearest);
}
#endif
