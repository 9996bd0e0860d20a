// The scene's buffers, and functions that return the rows of the triangles that a traversal tests. A row contains the
// data that a test reads of one triangle (common/rows.cl).

typedef struct {
    Geometry geometry;
    const __global float *lights; // each light's position (3) and power (3), and more with area lights (area_light.cl)
    int light_count;
    float bias; // the shadow bias: the gap between a hit and the near end of its shadow ray
#if PLANES_OF_ORIGIN
    const __global float4 *prepared; // a row per triangle, first for the eye, then for each light
#endif
#if RECORDS_ONCE
    const __global ROW_UNIT *records; // one row per triangle, in the mesh's order or, with a tree, in leaf order
#endif
#if TREE
    Tree tree;
#endif
#if TEXTURES
    Textures textures;
#endif
#if CORNER_COLOURS
    const __global uint *corner_colours;
#endif
#if SOFT
    Soft soft;
#endif
#if STREAM_TILES
    __local ROW_UNIT *tile; // the rows of the triangles that are in __local memory now
#endif
} Scene;

// Returns a triangle's row (the data that a test reads): loads a prepared row from global memory, or computes the row
// from the corners. `origin` (0 is the eye, 1 the first light) matters only if a row has planes through this origin.
Row source_row(const Scene *scene, int origin, int triangle) {
#if PLANES_OF_ORIGIN
    const __global float4 *quads = scene->prepared + 3 * ((size_t)origin * scene->geometry.count + triangle);
    Row row;
    LOAD_ROW(row, quads)
    return row;
#elif RECORDS_ONCE
    const __global ROW_UNIT *record = scene->records + ROW_UNITS * (size_t)triangle;
    Row row;
    LOAD_ROW(row, record)
    return row;
#else
    return row_of(corners(&scene->geometry, triangle));
#endif
}

#if STREAM_TILES
#ifndef TILE_TRIANGLES
#error "TILE_TRIANGLES: triangles of a tile in __local memory"
#endif
#define TILE_LOCALS __local ROW_UNIT tile_store[ROW_UNITS * TILE_TRIANGLES];
#define BIND_TILE(scene) scene.tile = tile_store;
#define TILE_STEP(scene) TILE_TRIANGLES

// Copies a tile of triangles to __local memory: the rows of TILE_TRIANGLES triangles from `first` on, or of fewer at
// the mesh's end. All work-items of the work-group must call stage_tile, for the same tile.
void stage_tile(const Scene *scene, int origin, int first) {
    barrier(CLK_LOCAL_MEM_FENCE); // all have finished the previous tile
    const int end = min(TILE_TRIANGLES, scene->geometry.count - first);
    // The work-items share the work: with n work-items, each copies every n-th row.
    for (int k = LOCAL_INDEX; k < end; k += LOCAL_X * LOCAL_Y) {
        const Row row = source_row(scene, origin, first + k);
        STORE_ROW(row, scene->tile + ROW_UNITS * k)
    }
    // No work-item may read the tile (the copied rows) before it is complete.
    barrier(CLK_LOCAL_MEM_FENCE);
}

static Row row_in_tile(const Scene *scene, int origin, int first, int k) {
    Row row;
    LOAD_ROW(row, scene->tile + ROW_UNITS * k)
    return row;
}
#else
#define TILE_LOCALS
#define BIND_TILE(scene)
#define TILE_STEP(scene) ((scene)->geometry.count)

void stage_tile(const Scene *scene, int origin, int first) {}

static Row row_in_tile(const Scene *scene, int origin, int first, int k) { return source_row(scene, origin, first + k); }
#endif
