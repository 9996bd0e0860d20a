// The layout of OBJ files: a set of positions, a set of normals, and a set of materials. Each triangle has the indices
// of three positions, three normals and one material. Indices have INDEX_BITS bits.

#if !defined(INDEX_BITS) || !defined(POSITIONS) || !defined(NORMALS) || !defined(MATERIALS)
#error "INDEX_BITS: 16 or 32; POSITIONS, NORMALS, MATERIALS: number of entries of a set that a work-group copies to __local memory, else 0"
#endif
#if INDEX_BITS == 16
typedef ushort Index;
#else
typedef uint Index;
#endif

#if STAGE_VERTICES
#define VERTEX_LOCALS                                 \
    __local float staged_positions[3 * POSITIONS];      \
    __local Index staged_position_indices[3 * TRIANGLES];
#define BIND_VERTICES(geometry)                                             \
    STAGE(staged_positions, position_set, POSITIONS, 3, 3)                 \
    STAGE(staged_position_indices, position_indices, TRIANGLES, 3, 3)      \
    geometry.positions = staged_positions;                                    \
    geometry.position_indices = staged_position_indices;
#else
#define VERTEX_LOCALS
#define BIND_VERTICES(geometry)        \
    geometry.positions = position_set;   \
    geometry.position_indices = position_indices;
#endif

#if STAGE_NORMALS
#define NORMAL_LOCALS                             \
    __local float staged_normals[3 * NORMALS];      \
    __local Index staged_normal_indices[3 * TRIANGLES];
#define BIND_NORMALS(geometry)                                       \
    STAGE(staged_normals, normal_set, NORMALS, 3, 3)                \
    STAGE(staged_normal_indices, normal_indices, TRIANGLES, 3, 3)   \
    geometry.normals = staged_normals;                                 \
    geometry.normal_indices = staged_normal_indices;
#else
#define NORMAL_LOCALS
#define BIND_NORMALS(geometry)     \
    geometry.normals = normal_set;   \
    geometry.normal_indices = normal_indices;
#endif

#if STAGE_MATERIALS
#define MATERIAL_LOCALS                        \
    __local float staged_materials[MATERIAL_FLOATS * MATERIALS]; \
    __local Index staged_material_indices[TRIANGLES];
#define BIND_MATERIALS(geometry)                                         \
    STAGE(staged_materials, material_set, MATERIALS, MATERIAL_FLOATS, MATERIAL_FLOATS) \
    STAGE(staged_material_indices, material_indices, TRIANGLES, 1, 1)   \
    geometry.materials = staged_materials;                                 \
    geometry.material_indices = staged_material_indices;
#else
#define MATERIAL_LOCALS
#define BIND_MATERIALS(geometry)       \
    geometry.materials = material_set;   \
    geometry.material_indices = material_indices;
#endif

typedef struct {
    VERTEX_SPACE const float *positions;
    VERTEX_SPACE const Index *position_indices;
    NORMAL_SPACE const float *normals;
    NORMAL_SPACE const Index *normal_indices;
    MATERIAL_SPACE const float *materials;
    MATERIAL_SPACE const Index *material_indices;
    int count;
} Geometry;

#define GEOMETRY_LOCALS VERTEX_LOCALS NORMAL_LOCALS MATERIAL_LOCALS
#define BIND_GEOMETRY(geometry) \
    BIND_VERTICES(geometry)   \
    BIND_NORMALS(geometry)    \
    BIND_MATERIALS(geometry)  \
    geometry.count = triangle_count;

static Corners corners(const Geometry *geometry, int triangle) {
    // A corner takes two loads, one after the other: first its index, then its position, which several triangles may
    // share.
    VERTEX_SPACE const Index *index = geometry->position_indices + 3 * triangle;
    Corners corners;
    corners.a = LOAD3(geometry->positions + 3 * index[0]);
    corners.b = LOAD3(geometry->positions + 3 * index[1]);
    corners.c = LOAD3(geometry->positions + 3 * index[2]);
    return corners;
}

// Writes a triangle's normals and material into columns (vectors): one float per column, all in the lane `lane`.
static void gather_surface(const Geometry *geometry, int triangle, int lane, Lanes *column) {
    NORMAL_SPACE const Index *index = geometry->normal_indices + 3 * triangle;
    MATERIAL_SPACE const float *material = geometry->materials + MATERIAL_FLOATS * geometry->material_indices[triangle];
    // The columns have the order that surface_of expects: normals in columns 0 to 8, the material from column 9 on.
    for (int corner = 0; corner < 3; corner++)
        for (int i = 0; i < 3; i++) column[3 * corner + i].each[lane] = geometry->normals[3 * index[corner] + i];
    for (int i = 0; i < MATERIAL_FLOATS; i++) column[9 + i].each[lane] = material[i];
}
