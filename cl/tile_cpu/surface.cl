// The surfaces that a tile's rays from the eye hit.

// The lights and materials that shading needs.
typedef struct {
    const __global float *lights;
    int light_count;
    float bias;
    const __global float *materials;
#if TEXTURES
    Textures textures;
#endif
#if CORNER_COLOURS
    const __global uint *corner_colours;
#endif
#if SOFT
    Soft soft;
#endif
} Lighting;

// Returns one material, with the same values in all lanes.
static Surface one_material(const __global float *material) {
    Surface surface;
    surface.lambertian = splat(LOAD3(material));
    surface.glossy = splat(LOAD3(material + 3));
    surface.shininess = (varying)(material[6]);
    surface.kind = (varying)(material[7]);
#if EMISSIVE
    surface.emitted = splat(LOAD3(material + 8));
    surface.emission_texture = (varying)(material[11]);
#endif
    return surface;
}

// Returns the materials of the hits of a vector of rays, one per lane. Usually, all hits have the same material.
static Surface gather_materials(const Lighting *lighting, varying numbers, Mask hits) {
    IntLanes at;
    at.all = AS_INT(numbers);
    // If all hits share a material, it is loaded once; otherwise each lane loads the material of its own hit.
    const int first = at.each[LOWEST_BIT(LANE_BITS16(hits))];
    if (!ANY(hits & (at.all != first))) return one_material(lighting->materials + MATERIAL_FLOATS * first);
    // Lanes without a hit load the first hit's material, so that every address is valid.
    at.all = SELECT(hits, at.all, (varying_int)(first));
    Lanes column[MATERIAL_FLOATS];
    for (int lane = 0; lane < WIDTH; lane++)
        for (int i = 0; i < MATERIAL_FLOATS; i++) column[i].each[lane] = lighting->materials[MATERIAL_FLOATS * at.each[lane] + i];
    Surface surface;
    surface.lambertian = vec3(column[0].all, column[1].all, column[2].all);
    surface.glossy = vec3(column[3].all, column[4].all, column[5].all);
    surface.shininess = column[6].all;
    surface.kind = column[7].all;
#if EMISSIVE
    surface.emitted = vec3(column[8].all, column[9].all, column[10].all);
    surface.emission_texture = column[11].all;
#endif
    return surface;
}

// The hits of a vector's rays, and the surface at each hit.
typedef struct {
    Vec3 point, normal, to_eye;
    Surface surface;
} Shaded;

// Computes the hits of a vector of rays from the rays and the triangles that they hit. `corner` and `normal` are
// columns (vectors) with the triangles' corners and normals, as gather_rows returns them.
INLINED void compute_surface_points(const Lighting *lighting, Vec3 origin, Vec3 direction, const varying *corner,
                                    const varying *normal, Mask hits, Shaded *shaded) {
    const Vec3 v0 = vec3(corner[0], corner[1], corner[2]);
    const Vec3 e1 = subtract(vec3(corner[4], corner[5], corner[6]), v0);
    const Vec3 e2 = subtract(vec3(corner[8], corner[9], corner[10]), v0);
    // t and weights are computed again, as in every strategy with shading = deferred, so that the picture does not
    // depend on the test that found the triangle.
    const Hit hit = intersect_plane(v0, e1, e2, origin, direction);
    shaded->point = along(origin, hit.t, direction);
    const Vec3 n0 = vec3(normal[0], normal[1], normal[2]);
    const Vec3 n1 = vec3(normal[4], normal[5], normal[6]);
    const Vec3 n2 = vec3(normal[8], normal[9], normal[10]);
    shaded->normal = normalize_or_zero(along(along(scale(n0, 1.0f - hit.w1 - hit.w2), hit.w1, n1), hit.w2, n2));
#if SMOOTH_SHADOWS
    const Vec3 corners[3] = {v0, vec3(corner[4], corner[5], corner[6]), vec3(corner[8], corner[9], corner[10])};
    const Vec3 normals[3] = {n0, n1, n2};
    const varying weights[3] = {1.0f - hit.w1 - hit.w2, hit.w1, hit.w2};
    move_to_smooth_surface(corners, normals, weights, &shaded->point);
#endif
    shaded->to_eye = negate(direction);
    shaded->surface = COLOURED(gather_materials(lighting, corner[7], hits), lighting->corner_colours,
                               SELECT(hits, AS_INT(corner[3]), (varying_int)(NO_HIT)), hit.w1, hit.w2);
    shaded->surface = TEXTURED(shaded->surface, &lighting->textures,
                               SELECT(hits, AS_INT(corner[3]), (varying_int)(NO_HIT)), hit.w1, hit.w2, direction, hit.t);
}

// Loads the triangles that rays from the eye hit, and computes the hits. `d` are the rays' directions, of any length,
// and `index` the triangles' indices in leaf order.
void find_surface_points(const SurfaceTree *tree, const Lighting *lighting, float4 eye, const Vec3 *d,
                         varying_int index, Mask hits, Shaded *shaded) {
    const Vec3 origin = splat(LOAD3((const float *)&eye));
    const Vec3 direction = scale(*d, 1.0f / sqrt(dot3(*d, *d)));
    // Lanes without a hit gather another lane's triangle, so that every address is valid.
    IntLanes indices;
    indices.all = index;
    const int first = indices.each[LOWEST_BIT(LANE_BITS16(hits))];
    const varying_int safe = SELECT(hits, index, (varying_int)(first));
    const __global float *corners = tree->tree.leaves;
    varying corner[12], normal[12];
    if (!ANY(safe != first)) {
        // All lanes have the same triangle. The triangle is loaded once, and is in registers while the hits are
        // computed.
        spread_row(corners + ROW_FLOATS * (size_t)first, ROW_FLOATS / 3, corner);
        spread_normals(&tree->normals, first, as_int(corners[ROW_FLOATS * (size_t)first + 3]), normal);
        compute_surface_points(lighting, origin, direction, corner, normal, hits, shaded);
    } else {
        gather_rows(corners, ROW_FLOATS / 3, safe, corner);
        gather_normals(&tree->normals, safe, AS_INT(corner[3]), normal);
        compute_surface_points(lighting, origin, direction, corner, normal, hits, shaded);
    }
}

// Computes the hits of a vector of rays, whose directions and nearest triangles are in the bundle (the tile's rays).
static void find_hits_of_vector(const SurfaceTree *tree, const Lighting *lighting, float4 eye, const Bundle *bundle,
                         int vector, Mask hits, Shaded *shaded) {
    const Vec3 d = vec3(bundle->x[vector], bundle->y[vector], bundle->z[vector]);
    find_surface_points(tree, lighting, eye, &d, bundle->leaf_index[vector], hits, shaded);
}
