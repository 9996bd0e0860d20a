// Lanes' own triangles, gathered one lane after another.

// The surface of each lane's triangle; lanes without a hit read nothing and hold zeros.
Surface gather_surfaces(const Geometry *geometry, varying_int triangle) {
    Lanes column[FLOATS_OF_SURFACE];
    IntLanes id;
    id.all = triangle;
    for (int i = 0; i < FLOATS_OF_SURFACE; i++) column[i].all = (varying)(0.0f);
    for (int lane = 0; lane < WIDTH; lane++)
        if (id.each[lane] != NO_HIT) gather_surface(geometry, id.each[lane], lane, column);
    return surface_of(column);
}

// Where rays of unit length meet triangles: t and the weights, with no test of the edges, so that a hit found by any
// intersector or rasterised is shaded the same way. The rays are known to hit: in slivers, where rounding says
// anything of the weights, they stay inside all the same, and t follows from them.
Hit meet_plane(Vec3 v0, Vec3 e1, Vec3 e2, Vec3 origin, Vec3 direction) {
    const Vec3 s = subtract(origin, v0);
    const Vec3 q = cross3(direction, e2);
    const Vec3 r = cross3(s, e1);
    const varying per_a = 1.0f / dot3(e1, q);
    const varying zero = (varying)(0.0f), one = (varying)(1.0f);
    Hit hit;
    hit.w1 = min(max(dot3(s, q) * per_a, zero), one);
    hit.w2 = min(max(dot3(direction, r) * per_a, zero), one - hit.w1);
    hit.t = dot3(subtract(along(scale(e1, hit.w1), hit.w2, e2), s), direction);
    return hit;
}

// The same for each lane's own triangle.
Hit meet_planes(const Geometry *geometry, varying_int triangle, Vec3 origin, Vec3 direction) {
    Lanes column[9];
    IntLanes id;
    id.all = triangle;
    for (int i = 0; i < 9; i++) column[i].all = (varying)(0.0f);
    for (int lane = 0; lane < WIDTH; lane++) {
        if (id.each[lane] == NO_HIT) continue;
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
    return meet_plane(v0, e1, e2, origin, direction);
}
