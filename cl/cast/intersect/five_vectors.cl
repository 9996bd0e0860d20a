// meaning: the textbook's test, as in the paper's code: it writes its five vectors to private memory each time
// record_floats: 9
// prepared_for: any-ray
// exact_signs: no
// operations: 15
// contradicts: epsilons=relative because its thresholds are the book's constants
//
// This is the test of Moeller and Trumbore 1997 as the textbook (Hughes et al., "Computer Graphics") has it: with a
// division per weight, and with constants as thresholds. In the student paper that raycl reproduces, the function
// `intersect` allocates five vectors at each test, and frees them afterwards. OpenCL C has no malloc, so in raycl, each
// test has an array for each vector. Two measures prevent compilers from keeping the vectors' arrays in registers. The
// arrays are volatile. Each vector begins at an index that is computed from the triangle, although the index is always
// 0. (With a constant index, NVIDIA's compiler keeps even volatile arrays in registers.) On a GPU, the arrays are in
// the work-item's private memory, which is off the chip. Most misses are found after 15 operations: 6 for direction x
// e2, 3 for the determinant a, 3 for origin - v0, and 3 for the first weight. The 6 operations for the triangle's edges
// e1 and e2, and the division by a, are not counted.

enum { E1, E2, Q, S, R, TEST_VECTORS };

// This test prepares nothing per ray: the test's probe (what a test prepares for a ray) contains only t_min.
typedef struct {
    varying t_min;
} Probe;

static Probe prepare_probe(varying t_min, Vec3 direction) {
    Probe probe;
    probe.t_min = t_min;
    return probe;
}

// Returns a triangle's row (the data that the test reads): its three corners. `intersect` computes the edges each time.
static Row row_of(Corners corners) {
    Row row;
    const Uniform3 corner[3] = { corners.a, corners.b, corners.c };
    for (int i = 0; i < 3; i++) {
        row.number[3 * i] = corner[i].x;
        row.number[3 * i + 1] = corner[i].y;
        row.number[3 * i + 2] = corner[i].z;
    }
    return row;
}

// Writes a vector to memory, reads it again, and returns it.
static Vec3 store_and_load(volatile varying *at, Vec3 value) {
    at[0] = value.x;
    at[1] = value.y;
    at[2] = value.z;
    return vec3(at[0], at[1], at[2]);
}

// Stores in `hit` the lanes whose ray hits the triangle at t_min < t < t_max, with t and the weights. Returns 0 only if
// no lane hits; hit->lanes is then not set. After a return of 1, hit->lanes may still be empty.
int intersect(const Probe *probe, Vec3 origin, Vec3 direction, Row row, varying t_max, Hit *hit) {
    volatile varying vector[TEST_VECTORS][3 + 1];
    // `from` is the index at which a vector begins in its array. No coordinate is larger than 1e38, so `from` is always
    // 0, but the compiler does not know this.
    const int from = fabs(row.number[0]) > 1e38f;
    const Uniform3 corner = LOAD3(row.number);
    const Vec3 e1 = store_and_load(vector[E1] + from, splat(uniform_difference(LOAD3(row.number + 3), corner)));
    const Vec3 e2 = store_and_load(vector[E2] + from, splat(uniform_difference(LOAD3(row.number + 6), corner)));
    // If the determinant `a` is near 0, the ray is nearly parallel to the triangle, and misses.
    const Vec3 q = store_and_load(vector[Q] + from, cross3(direction, e2));
    const varying a = dot3(e1, q);
    const Mask crosses = fabs(a) > 1e-7f;
    // Computes the weight of the second corner.
    const Vec3 s = store_and_load(vector[S] + from, subtract(origin, splat(corner)));
    hit->w1 = dot3(s, q) / a;
    const Mask inside1 = crosses & (hit->w1 >= -1e-10f);
    if (!ANY(inside1)) return 0;

    // Computes the weight of the third corner, and t. The first corner's weight is 1 minus the other two weights.
    const Vec3 r = store_and_load(vector[R] + from, cross3(s, e1));
    hit->w2 = dot3(direction, r) / a;
    hit->t = dot3(e2, r) / a;
    hit->lanes = inside1 & (hit->w2 >= -1e-10f) & (hit->w1 + hit->w2 <= 1.0f + 1e-10f);
    hit->lanes &= (hit->t > probe->t_min) & (hit->t < t_max);
#if CULL_BACK
    hit->lanes &= a > 0.0f;
#endif
    return 1;
}
