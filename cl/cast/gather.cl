// Loads the data of each lane's triangle. Lanes may have different triangles, so the lanes load one after the other.

// Returns the surface of each lane's triangle. Lanes without a hit (NO_HIT) read nothing, and their result is zero.
static Surface gather_surfaces(const Geometry *geometry, varying_int triangle) {
    Lanes column[FLOATS_OF_SURFACE];
    IntLanes id;
    id.all = triangle;
    for (int i = 0; i < FLOATS_OF_SURFACE; i++) column[i].all = (varying)(0.0f); // for lanes without a hit
    for (int lane = 0; lane < WIDTH; lane++)
        if (id.each[lane] != NO_HIT) gather_surface(geometry, id.each[lane], lane, column);
    return surface_of(column);
}

#if SMOOTH_SHADOWS
// Writes the nine coordinates of a triangle's corners into one lane of nine columns (vectors).
void gather_corners(const Geometry *geometry, int triangle, int lane, Lanes *column) {
    const Corners own = corners(geometry, triangle);
    column[0].each[lane] = own.a.x, column[1].each[lane] = own.a.y, column[2].each[lane] = own.a.z;
    column[3].each[lane] = own.b.x, column[4].each[lane] = own.b.y, column[5].each[lane] = own.b.z;
    column[6].each[lane] = own.c.x, column[7].each[lane] = own.c.y, column[8].each[lane] = own.c.z;
}

// Moves each lane's hit from the lane's triangle to the smooth surface above the triangle (smooth_shadows.cl). The
// points of lanes whose triangle is NO_HIT have no meaning.
void move_hits(const Geometry *geometry, varying_int triangle, const Surface *surface, Vec3 weights, Vec3 *point) {
    Lanes column[9];
    IntLanes id;
    id.all = triangle;
    for (int i = 0; i < 9; i++) column[i].all = (varying)(0.0f); // no lane computes with undefined numbers
    for (int lane = 0; lane < WIDTH; lane++)
        if (id.each[lane] != NO_HIT) gather_corners(geometry, id.each[lane], lane, column);
    const Vec3 corner[3] = {vec3(column[0].all, column[1].all, column[2].all),
                            vec3(column[3].all, column[4].all, column[5].all),
                            vec3(column[6].all, column[7].all, column[8].all)};
    const Vec3 normal[3] = {surface->n0, surface->n1, surface->n2};
    const varying weight[3] = {weights.x, weights.y, weights.z};
    move_to_smooth_surface(corner, normal, weight, point);
}
// The additional parameter of shading functions (each lane's triangle), including the comma after the parameter.
#define TRIANGLE_PARAMETER varying_int triangle,
#define TRIANGLE_ARGUMENT(triangle) triangle,
#else
#define TRIANGLE_PARAMETER
#define TRIANGLE_ARGUMENT(triangle)
#endif

#include "common/intersect_plane.cl"

// Returns the hit (t and the weights) of each lane's ray on that lane's triangle. The hits of lanes whose triangle is
// NO_HIT have no meaning.
Hit intersect_planes(const Geometry *geometry, varying_int triangle, Vec3 origin, Vec3 direction) {
    Lanes column[9];
    IntLanes id;
    id.all = triangle;
    // Each of the nine columns is a vector with one lane per ray. Columns 0 to 2 contain corner a, columns 3 to 5 the
    // edge from a to b, and columns 6 to 8 the edge from a to c.
    for (int i = 0; i < 9; i++) column[i].all = (varying)(0.0f);
    for (int lane = 0; lane < WIDTH; lane++) {
        if (id.each[lane] == NO_HIT) continue; // NO_HIT is no triangle's number, so no corners can be read
        const Corners own = corners(geometry, id.each[lane]);
        const Uniform3 e1 = uniform_difference(own.b, own.a);
        const Uniform3 e2 = uniform_difference(own.c, own.a);
        column[0].each[lane] = own.a.x, column[1].each[lane] = own.a.y, column[2].each[lane] = own.a.z;
        column[3].each[lane] = e1.x, column[4].each[lane] = e1.y, column[5].each[lane] = e1.z;
        column[6].each[lane] = e2.x, column[7].each[lane] = e2.y, column[8].each[lane] = e2.z;
    }
    const Vec3 v0 = vec3(column[0].all, column[1].all, column[2].all);
    const Vec3 e1 = vec3(column[3].all, column[4].all, column[5].all);
    const Vec3 e2 = vec3(column[6].all, column[7].all, column[8].all);
    return intersect_plane(v0, e1, e2, origin, direction);
}
