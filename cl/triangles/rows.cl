// What a kernel knows of the scene, and from where a traversal takes the rows it tests.

typedef struct {
    Geometry geometry;
    const __global float *lights; // position (3), power (3) each
    int light_count;
    float bias;
#if PLANES_OF_ORIGIN
    const __global float *prepared; // PLANE_FLOATS a triangle, first for the eye, then for each light
#endif
#if STREAM_TILES
    __local float *tile;
#endif
} Scene;

#define PLANE_FLOATS 9

Row load_row(const __global float *at) {
    Row row;
    row.a = LOAD3(at);
    row.b = LOAD3(at + 3);
    row.c = LOAD3(at + 6);
    return row;
}

// Origins are counted 0 for the eye, 1 for the first light: planes differ between them, corners do not.
Row source_row(const Scene *scene, int origin, int triangle) {
#if PLANES_OF_ORIGIN
    return load_row(scene->prepared + PLANE_FLOATS * ((size_t)origin * scene->geometry.count + triangle));
#else
    return corners(&scene->geometry, triangle);
#endif
}

#if STREAM_TILES
#ifndef TILE_TRIANGLES
#error "TILE_TRIANGLES: triangles of a tile in __local memory"
#endif
#define TILE_FLOATS 9
#define TILE_LOCALS __local float tile_store[TILE_FLOATS * TILE_TRIANGLES];
#define BIND_TILE(scene) scene.tile = tile_store;
#define TILE_STEP(scene) TILE_TRIANGLES

// Every work-item of the group must come here, and for the same tile.
void stage_tile(const Scene *scene, int origin, int first) {
    barrier(CLK_LOCAL_MEM_FENCE); // all are done with the tile before
    const int end = min(TILE_TRIANGLES, scene->geometry.count - first);
    for (int k = LOCAL_INDEX; k < end; k += LOCAL_X * LOCAL_Y) {
        const Row row = source_row(scene, origin, first + k);
        __local float *at = scene->tile + TILE_FLOATS * k;
        STORE3(at, row.a)
        STORE3(at + 3, row.b)
        STORE3(at + 6, row.c)
    }
    barrier(CLK_LOCAL_MEM_FENCE);
}

Row row_in_tile(const Scene *scene, int origin, int first, int k) {
    const __local float *at = scene->tile + TILE_FLOATS * k;
    Row row;
    row.a = LOAD3(at);
    row.b = LOAD3(at + 3);
    row.c = LOAD3(at + 6);
    return row;
}
#else
#define TILE_LOCALS
#define BIND_TILE(scene)
#define TILE_STEP(scene) ((scene)->geometry.count)

void stage_tile(const Scene *scene, int origin, int first) {}

Row row_in_tile(const Scene *scene, int origin, int first, int k) { return source_row(scene, origin, first + k); }
#endif
