// Normals in leaf order, for shading the triangles that a tile's rays hit: a row of three normals for each triangle.

typedef struct {
    const __global float *rows; // three normals per triangle: NORMAL_FLOATS floats
} Normals;

#define BIND_NORMALS(normals) normals.rows = surfaces;

// Prefetches a triangle's normals. `index` is the triangle's index in leaf order.
static void fetch_normals(const Normals *normals, const __global float *leaves, int index) {
    const __global float *row = normals->rows + NORMAL_FLOATS * (size_t)index;
    FETCH(row), FETCH(row + NORMAL_FLOATS - 1);
}

// Loads one triangle's normals, as 12 columns (vectors) with the same value in all lanes. The fourth column of each
// normal has no meaning. `number` is the triangle's number in the mesh.
INLINED void spread_normals(const Normals *normals, int index, int number, varying *column) {
    spread_row(normals->rows + NORMAL_FLOATS * (size_t)index, NORMAL_FLOATS / 3, column);
}

// Loads the normals of each lane's triangle, as columns (vectors) like those of spread_normals.
static void gather_normals(const Normals *normals, varying_int indices, varying_int numbers, varying *column) {
    gather_rows(normals->rows, NORMAL_FLOATS / 3, indices, column);
}
