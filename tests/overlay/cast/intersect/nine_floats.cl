// meaning: Moeller and Trumbore's test with a corner, two edges, and a fixed allowance for rounding
// record_floats: 9
// prepared_for: any-ray
// exact_signs: no
// contradicts: epsilons=paper because the paper's epsilons are numbers of the moller-trumbore test
// contradicts: culling=back because the test ignores the determinant's sign
//
// For tests: a record that is not 12 floats long is an array of numbers.

typedef struct {
    varying t_min;
} Probe;

Probe prepare_probe(varying t_min, Vec3 direction) {
    Probe probe;
    probe.t_min = t_min;
    return probe;
}

Row row_of(Corners corners) {
    const Uniform3 e1 = uniform_difference(corners.b, corners.a), e2 = uniform_difference(corners.c, corners.a);
    Row row;
    row.number[0] = corners.a.x, row.number[1] = corners.a.y, row.number[2] = corners.a.z;
    row.number[3] = e1.x, row.number[4] = e1.y, row.number[5] = e1.z;
    row.number[6] = e2.x, row.number[7] = e2.y, row.number[8] = e2.z;
    return row;
}

int intersect(const Probe *probe, Vec3 origin, Vec3 direction, Row row, varying t_max, Hit *hit) {
    const Vec3 e1 = splat(LOAD3(row.number + 3)), e2 = splat(LOAD3(row.number + 6));
    const Vec3 q = cross3(direction, e2);
    const varying per_a = 1.0f / dot3(e1, q);
    const Vec3 s = subtract(origin, splat(LOAD3(row.number)));
    const Vec3 r = cross3(s, e1);
    hit->t = dot3(e2, r) * per_a;
    hit->w1 = dot3(s, q) * per_a;
    hit->w2 = dot3(direction, r) * per_a;
    const float slack = 8.0f * ROUNDING;
    hit->lanes = (hit->w1 >= -slack) & (hit->w2 >= -slack) & (hit->w1 + hit->w2 <= 1.0f + 2.0f * slack) &
                 (hit->t > probe->t_min) & (hit->t < t_max);
    return ANY(hit->lanes);
}
