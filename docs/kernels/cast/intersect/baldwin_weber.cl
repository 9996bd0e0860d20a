// Baldwin and Weber, "Fast Ray-Triangle Intersections by Coordinate Transformation", JCGT 5(3), 2016.
// meaning: Baldwin and Weber 2016: a matrix per triangle, which takes it to the unit triangle
// record_floats: 12
// prepared_for: any-ray
// exact_signs: no
// operations: 12
// contradicts: culling=back because the matrix keeps no sign of the normal
// contradicts: epsilons=paper because the paper's epsilons are numbers of the moller-trumbore test
//
// A matrix of three rows maps the triangle's corners to (0,0,0), (1,0,0) and (0,1,0). The first two coordinates of a
// mapped point are the point's weights of the second and third corner. The third coordinate, the height, is 0 in the
// triangle's plane:
//
//     w1      a.x a.y a.z u       x
//     w2   =  b.x b.y b.z v   x   y
//     height  c.x c.y c.z w       z
//                                 1
//
// The matrix is divided by the largest component of the normal, so the normal's sign is lost: the test cannot
// distinguish the front of a triangle from its back.

typedef struct {
    varying t_min;
} Probe;

Probe prepare_probe(varying t_min, Vec3 direction) {
    Probe probe;
    probe.t_min = t_min;
    return probe;
}

// One component of a cross product.
#define CROSS(p, q, i, j) ((p).i * (q).j - (p).j * (q).i)

Row row_of(Corners corners) {
    const Uniform3 a = corners.a, b = corners.b, c = corners.c;
    const Uniform3 e1 = uniform_difference(b, a), e2 = uniform_difference(c, a);
    const float nx = CROSS(e1, e2, y, z), ny = CROSS(e1, e2, z, x), nz = CROSS(e1, e2, x, y);
    const float height = nx * a.x + ny * a.y + nz * a.z;
    const float sx = fabs(nx), sy = fabs(ny), sz = fabs(nz);
    Row row;
    float n;
    if (sx >= sy && sx >= sz) { // seen along x
        n = nx;
        row.a = uniform3(0.0f, e2.z, -e2.y), row.u = CROSS(c, a, y, z);
        row.b = uniform3(0.0f, -e1.z, e1.y), row.v = -CROSS(b, a, y, z);
    } else if (sy >= sz) { // along y
        n = ny;
        row.a = uniform3(-e2.z, 0.0f, e2.x), row.u = CROSS(c, a, z, x);
        row.b = uniform3(e1.z, 0.0f, -e1.x), row.v = -CROSS(b, a, z, x);
    } else { // along z
        n = nz;
        row.a = uniform3(e2.y, -e2.x, 0.0f), row.u = CROSS(c, a, x, y);
        row.b = uniform3(-e1.y, e1.x, 0.0f), row.v = -CROSS(b, a, x, y);
    }
    // A triangle without area gets a matrix of zeros. The distance t is then 0 / 0, so no ray hits this triangle.
    const float per_n = n == 0.0f ? 0.0f : 1.0f / n;
    row.a = uniform3(row.a.x * per_n, row.a.y * per_n, row.a.z * per_n), row.u *= per_n;
    row.b = uniform3(row.b.x * per_n, row.b.y * per_n, row.b.z * per_n), row.v *= per_n;
    row.c = uniform3(nx * per_n, ny * per_n, nz * per_n), row.w = -height * per_n;
    return row;
}

// Stores in `hit` the lanes whose ray hits the triangle at t_min < t < t_max, with t and the weights. Returns 0 only if
// no lane hits. After a return of 1, hit->lanes may still be empty.
int intersect(const Probe *probe, Vec3 origin, Vec3 direction, Row row, varying t_max, Hit *hit) {
    const varying above = row.c.x * origin.x + row.c.y * origin.y + row.c.z * origin.z + row.w;
    const varying falls = row.c.x * direction.x + row.c.y * direction.y + row.c.z * direction.z;
    hit->t = -above / falls;
    hit->lanes = (hit->t > probe->t_min) & (hit->t < t_max);
    if (!ANY(hit->lanes)) return 0;

    const varying x = origin.x + hit->t * direction.x;
    const varying y = origin.y + hit->t * direction.y;
    const varying z = origin.z + hit->t * direction.z;
    hit->w1 = row.a.x * x + row.a.y * y + row.a.z * z + row.u;
    hit->w2 = row.b.x * x + row.b.y * y + row.b.z * z + row.v;
    // Each weight may exceed its bounds by its rounding error, so that no ray slips through between two triangles.
    const varying slack1 =
        4.0f * ROUNDING * (fabs(row.a.x * x) + fabs(row.a.y * y) + fabs(row.a.z * z) + fabs(row.u));
    const varying slack2 =
        4.0f * ROUNDING * (fabs(row.b.x * x) + fabs(row.b.y * y) + fabs(row.b.z * z) + fabs(row.v));
    hit->lanes &= (hit->w1 >= -slack1) & (hit->w2 >= -slack2) & (hit->w1 + hit->w2 <= 1.0f + slack1 + slack2);
    return 1;
}
