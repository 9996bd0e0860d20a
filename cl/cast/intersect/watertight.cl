// meaning: Woop, Benthin and Wald 2013: no leaks at edges and vertices
// record_floats: 12
// prepared_for: any-ray
// exact_signs: yes
// operations: 50
// contradicts: epsilons=paper because the paper's epsilons are numbers of the moller-trumbore test
//
// Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013. Corners are sheared so that the ray
// becomes the z axis. After the shear, an edge function is the difference of two products, each rounded separately. The
// sign of an edge function is therefore exactly opposite in the neighbouring triangle, and no ray passes between the
// two triangles. The test is watertight only without contraction to fma. Most misses are found after 50 operations: 9
// for the corners relative to the ray's origin, 30 for sheared x and y (not contracted), 9 for the edge functions, and
// 2 for their sum.

#include "common/exact_signs.cl"
#include "common/in_plane.cl"

// x, y and z are the rows of each lane's matrix, which shears space so that the ray runs along +z. A ray's dominant
// axis is the axis along which its direction has the largest absolute component; the matrix turns this axis into z.
// Lanes may have different dominant axes. The test is watertight for every shear that depends only on the ray.
typedef struct {
    varying t_min;
    Vec3 x, y, z;
} Probe;

// Let d be the direction, k its dominant axis, k+1 and k+2 the next axes in cyclic order, and e_i the unit vector along
// axis i. The rows of the shear matrix are e_(k+1) - d_(k+1)/d_k e_k, e_(k+2) - d_(k+2)/d_k e_k, and e_k / d_k. The
// rows for all three axes are computed, and each lane selects those of its dominant axis. A branch would save little:
// where lanes have different dominant axes, a vector of rays would execute several paths.
static Probe prepare_probe(varying t_min, Vec3 direction) {
    const Vec3 size = vec3(fabs(direction.x), fabs(direction.y), fabs(direction.z));
    // The axis of the largest absolute component becomes z: dividing by a small component would make the shear large.
    const Mask along_x = (size.x >= size.y) & (size.x >= size.z);
    const Mask along_y = !along_x & (size.y >= size.z);
    const varying zero = (varying)(0.0f);
    const varying one = (varying)(1.0f);
    const Vec3 per = vec3(1.0f / direction.x, 1.0f / direction.y, 1.0f / direction.z);

    Probe probe;
    probe.t_min = t_min;
    const Vec3 x_for_z = vec3(one, zero, -direction.x * per.z);
    const Vec3 y_for_z = vec3(zero, one, -direction.y * per.z);
    const Vec3 x_for_x = vec3(-direction.y * per.x, one, zero);
    const Vec3 y_for_x = vec3(-direction.z * per.x, zero, one);
    const Vec3 x_for_y = vec3(zero, -direction.z * per.y, one);
    const Vec3 y_for_y = vec3(one, -direction.x * per.y, zero);
    const Vec3 x = select3(along_x, x_for_x, select3(along_y, x_for_y, x_for_z));
    // If the ray runs against its dominant axis, the shear would mirror triangles and swap front and back faces. To
    // prevent this, the sign of the matrix's first row is reversed for rays that run against their dominant axis.
    const varying_int against = sign_bit(SELECT(along_x, per.x, SELECT(along_y, per.y, per.z)));
    probe.x = vec3(flip_sign(x.x, against), flip_sign(x.y, against), flip_sign(x.z, against));
    probe.y = select3(along_x, y_for_x, select3(along_y, y_for_y, y_for_z));
    probe.z = select3(along_x, vec3(per.x, zero, zero),
                      select3(along_y, vec3(zero, per.y, zero), vec3(zero, zero, per.z)));
    return probe;
}

// Returns a triangle's row (the data that the test reads): the three corners, unchanged.
static Row row_of(Corners corners) {
    Row row;
    row.a = corners.a, row.b = corners.b, row.c = corners.c;
    row.u = row.v = row.w = 0.0f;
    return row;
}

// Stores in `hit` the lanes whose ray hits the triangle at t_min < t < t_max, with t and the weights. Returns 0 only if
// no lane hits; hit->lanes may then be unset. After a return of 1, hit->lanes may still be empty. (PoCL's compiler does
// not inline so long a function by itself. Without inlining, casting takes 1.5 to 4.6 times as long.)
static __attribute__((always_inline)) int intersect(const Probe *probe, Vec3 origin, Vec3 direction, Row row,
                                                    varying t_max, Hit *hit) {
    // Computes the corners relative to the ray's origin, then their sheared x and y. The sheared z is computed only for
    // hits.
    const Vec3 a = subtract(splat(row.a), origin);
    const Vec3 b = subtract(splat(row.b), origin);
    const Vec3 c = subtract(splat(row.c), origin);
    const varying ax = dot3(probe->x, a), ay = dot3(probe->y, a);
    const varying bx = dot3(probe->x, b), by = dot3(probe->y, b);
    const varying cx = dot3(probe->x, c), cy = dot3(probe->y, c);
    // An edge function is twice the signed area of the triangle whose base is the edge, and whose tip is the ray (after
    // the shear, the point (0, 0)).
    const varying u = cx * by - cy * bx;
    const varying v = ax * cy - ay * cx;
    const varying w = bx * ay - by * ax;
    // For a ray inside the triangle, no two edge functions have opposite signs. If an edge function is zero, the ray
    // counts as inside both triangles at the edge, so that no ray slips through between the two triangles.
    const varying least = min(min(u, v), w);
    const varying most = max(max(u, v), w);
    const varying det = u + v + w;
#if CULL_BACK
    Mask inside = (least >= 0.0f) & (det > 0.0f);
#else
    Mask inside = ((least >= 0.0f) | (most <= 0.0f)) & (det != 0.0f);
#endif
    if (!ANY(inside)) return 0;

    // The weights are the edge functions divided by their sum; t is the corners' mean z with these weights.
    const varying za = u * dot3(probe->z, a), zb = v * dot3(probe->z, b), zc = w * dot3(probe->z, c);
    const varying per_det = 1.0f / det;
    hit->t = (za + zb + zc) * per_det;
    hit->w1 = v * per_det;
    hit->w2 = w * per_det;
    hit->lanes = inside & (hit->t > probe->t_min) & (hit->t < t_max);
    if (!ANY(hit->lanes)) return 0;
    // A ray that starts in the triangle's plane misses. If it starts on the triangle, za, zb and zc nearly cancel.
    const Mask doubt = hit->lanes & cancels(za, zb, zc, NEAR_START);
    if (ANY(doubt)) hit->lanes &= !(doubt & starts_in_plane(a, splat(normal_of(row.a, row.b, row.c))));
    return 1;
}
