// meaning: 104 bytes per triangle, nothing shared, as in the paper
// index_bits: none
//
// Each triangle has 26 floats (104 bytes) of its own, as in the paper: three corners (9), three normals (9), and the
// material: k_L (3), k_G (3), s and kind (see Surface in common/rows.cl). With EMISSIVE, a triangle has 30 floats.

#ifndef SOUP_STRIDE
#error "SOUP_STRIDE: floats of a triangle"
#endif

#if STAGE_VERTICES
#define VERTEX_STRIDE 9
#define VERTEX_LOCALS __local float staged_vertices[9 * TRIANGLES];
#define BIND_VERTICES(geometry)                              \
    STAGE(staged_vertices, soup, TRIANGLES, 9, SOUP_STRIDE) \
    geometry.vertices = staged_vertices;
#else
#define VERTEX_STRIDE SOUP_STRIDE
#define VERTEX_LOCALS
#define BIND_VERTICES(geometry) geometry.vertices = soup;
#endif

#if STAGE_NORMALS
#define NORMAL_STRIDE 9
#define NORMAL_LOCALS __local float staged_normals[9 * TRIANGLES];
#define BIND_NORMALS(geometry)                                 \
    STAGE(staged_normals, soup + 9, TRIANGLES, 9, SOUP_STRIDE) \
    geometry.normals = staged_normals;
#else
#define NORMAL_STRIDE SOUP_STRIDE
#define NORMAL_LOCALS
#define BIND_NORMALS(geometry) geometry.normals = soup + 9;
#endif

#if STAGE_MATERIALS
#define MATERIAL_STRIDE MATERIAL_FLOATS
#define MATERIAL_LOCALS __local float staged_materials[MATERIAL_FLOATS * TRIANGLES];
#define BIND_MATERIALS(geometry)                                  \
    STAGE(staged_materials, soup + 18, TRIANGLES, MATERIAL_FLOATS, SOUP_STRIDE) \
    geometry.materials = staged_materials;
#else
#define MATERIAL_STRIDE SOUP_STRIDE
#define MATERIAL_LOCALS
#define BIND_MATERIALS(geometry) geometry.materials = soup + 18;
#endif

typedef struct {
    VERTEX_SPACE const float *vertices;
    NORMAL_SPACE const float *normals;
    MATERIAL_SPACE const float *materials;
    int count;
} Geometry;

#define GEOMETRY_LOCALS VERTEX_LOCALS NORMAL_LOCALS MATERIAL_LOCALS
#define BIND_GEOMETRY(geometry) \
    BIND_VERTICES(geometry)   \
    BIND_NORMALS(geometry)    \
    BIND_MATERIALS(geometry)  \
    geometry.count = triangle_count;

static Corners corners(const Geometry *geometry, int triangle) {
    // The stride between triangles is SOUP_STRIDE floats in the soup, and 9 floats in a copy of only the corners. In a
    // large soup, a triangle's offset exceeds the range of an int.
    VERTEX_SPACE const float *at = geometry->vertices + (size_t)triangle * VERTEX_STRIDE;
    Corners corners;
    corners.a = LOAD3(at);
    corners.b = LOAD3(at + 3);
    corners.c = LOAD3(at + 6);
    return corners;
}

// Writes a triangle's normals and material into columns (vectors): one float per column, all in the lane `lane`.
static void gather_surface(const Geometry *geometry, int triangle, int lane, Lanes *column) {
    NORMAL_SPACE const float *normals = geometry->normals + (size_t)triangle * NORMAL_STRIDE;
    MATERIAL_SPACE const float *material = geometry->materials + (size_t)triangle * MATERIAL_STRIDE;
    // The columns have the order that surface_of expects: normals in columns 0 to 8, the material from column 9 on.
    for (int i = 0; i < 9; i++) column[i].each[lane] = normals[i];
    for (int i = 0; i < MATERIAL_FLOATS; i++) column[9 + i].each[lane] = material[i];
}
