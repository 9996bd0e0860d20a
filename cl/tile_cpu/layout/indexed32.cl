// Normals in the mesh's own order, for shading the triangles that a tile's rays hit. The mesh stores each triangle as
// several words, three of which are the indices of its normals. A hit therefore takes three more loads than with
// normals in leaf order, but a device that shares the host's memory needs no copy of the normals.
//
//     MESH_WORDS words per triangle:  position 0, 1, 2   normal 0, 1, 2   material
//                                                        ^ MESH_NORMALS

#ifndef MESH_WORDS
#error "MESH_WORDS: words of a triangle of the mesh"
#endif
#ifndef MESH_NORMALS
#error "MESH_NORMALS: the number of the first of a triangle's words that are indices of normals"
#endif

typedef struct {
    const __global float *set;      // three floats per normal
    const __global uint *triangles; // MESH_WORDS words per triangle
} Normals;

#define BIND_NORMALS(normals)     \
    normals.set = normal_set;     \
    normals.triangles = mesh_triangles;

// Returns a pointer to the indices of a triangle's normals. `number` is the triangle's number in the mesh.
static const __global uint *indices_of_normals(const Normals *normals, int number) {
    return normals->triangles + MESH_WORDS * (size_t)number + MESH_NORMALS;
}

// Prefetches the indices of a triangle's normals. `index` is the triangle's index in leaf order.
static void fetch_normals(const Normals *normals, const __global float *leaves, int index) {
    FETCH(indices_of_normals(normals, as_int(leaves[ROW_FLOATS * (size_t)index + 3])));
}

// Loads one triangle's normals, as 12 columns (vectors) with the same value in all lanes. The fourth column of each
// normal has no meaning. `index` is the triangle's index in leaf order, `number` its number in the mesh.
INLINED void spread_normals(const Normals *normals, int index, int number, varying *column) {
    const __global uint *indices = indices_of_normals(normals, number);
    for (int part = 0; part < 3; part++) {
        const float3 normal = vload3(indices[part], normals->set);
        column[4 * part] = (varying)(normal.x), column[4 * part + 1] = (varying)(normal.y);
        column[4 * part + 2] = (varying)(normal.z), column[4 * part + 3] = (varying)(0.0f);
    }
}

// Loads the normal of one corner (`part`) for each of four lanes, as quads (float4). `set` may end after the last
// normal, so only three floats of a quad are loaded, not four.
#define QUAD(part, lane) (float4)(vload3(indices[lane][part], normals->set), 0.0f)
#define FOUR_NORMALS(part, lane) \
    (float16)(QUAD(part, lane), QUAD(part, lane + 1), QUAD(part, lane + 2), QUAD(part, lane + 3))

// Loads the normals of each lane's triangle, as columns (vectors) like those of spread_normals.
static void gather_normals(const Normals *normals, varying_int leaf_indices, varying_int numbers, varying *column) {
    IntLanes number;
    number.all = numbers;
    const __global uint *indices[WIDTH];
    for (int lane = 0; lane < WIDTH; lane++) indices[lane] = indices_of_normals(normals, number.each[lane]);
    for (int part = 0; part < 3; part++)
        transpose_quads(FOUR_NORMALS(part, 0), FOUR_NORMALS(part, 4), FOUR_NORMALS(part, 8), FOUR_NORMALS(part, 12),
                        column + 4 * part);
}
