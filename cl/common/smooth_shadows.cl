// The point at which a hit is lit in a scene with smooth shadows. The facets of a coarse mesh with interpolated normals
// shadow each other in steps along the border between light and dark. Therefore, a hit P is lit at a point P' of a
// smooth surface above the triangle. The hit's shadow rays start or end at P', too (Hanika, "Hacking the Shadow
// Terminator", Ray Tracing Gems II, 2021):
//
//        n1            P'            n2
//          \           .            /
//           \    .     |     .     /
//            v1 ------ P ------- v2
//
// A corner's plane contains the corner, and is perpendicular to the corner's normal. P' is the mean of P's projections
// onto the three corners' planes, with P's barycentric weights. If P is above a corner's plane, where the mesh is
// concave, this corner does not move P.
//
// In f64, the function smooth_point in src/reference/shade.rs computes the same point.

// Moves `point`, a hit on a triangle, onto the smooth surface. `corner` and `normal` are the triangle's three corners
// and their normals, which may have any length. `weight` has the hit's weights of the corners.
void move_to_smooth_surface(const Vec3 *corner, const Vec3 *normal, const varying *weight, Vec3 *point) {
    const Vec3 hit = *point;
    for (int i = 0; i < 3; i++) {
        const varying below = max(dot3(subtract(corner[i], hit), normal[i]), (varying)(0.0f));
        *point = along(*point, weight[i] * below / dot3(normal[i], normal[i]), normal[i]);
    }
}
