// A leaf's triangle for the rays of a pass, Moeller and Trumbore's test as in tile.cl's test_triangle. With A = V0 - O,
// the vectors e2 x e1, e2 x -A and -A x e1 give a, a w1 and a w2 as dot products with (x, y, 1), and
// h = e2 . (-A x e1) is a z. All have the sign of h taken out, so that they are not negative where a ray hits.

typedef struct {
    float4 a;      // its fourth: 1/h
    float4 w1, w2; // with their slack; w1's fourth: the least of a - w1 - w2; w2's: the least 1/z that is not edge-on
} Candidate;

// A function v . (x, y, 1) of a pass's slopes, times `turn`, plus `more`; with a word of something else.
INLINED float4 linear(Uniform3 v, float turn, float more, float word) {
    return (float4)(v.x * turn, v.y * turn, MULTIPLY_ADD(v.z, turn, more), word);
}

INLINED float most_along(const Shaft *shaft, float4 function) {
    return most_of(shaft, uniform3(function.x, function.y, function.z));
}

// Prepares the triangle at a place of leaf order. Returns whether any ray of the shaft may hit it at a 1/z that is
// more than `worst`.
INLINED int prepare(const Shaft *shaft, const Tree *tree, int place, float worst, const int any, Candidate *triangle) {
    Uniform3 a, b, c;
    const int used = load_corners(shaft, tree, place, &a, &b, &c);
    const Uniform3 e1 = uniform_difference(b, a), e2 = uniform_difference(c, a);
    const Uniform3 s = uniform_difference(uniform3(shaft->x, shaft->y, shaft->z), a);
    const Uniform3 n = uniform_cross(e2, e1), u = uniform_cross(e2, s), v = uniform_cross(s, e1);
    const float height = uniform_dot(e2, v);
    const float turn = height < 0.0f ? -1.0f : 1.0f, per_height = turn / height;
    // Slack and edge-on triangles as in tile.cl.
    const float size1 = uniform_size(e1), size2 = uniform_size(e2);
    const float rounding = (any ? LIGHT_SLACK : ROUNDING) * uniform_size(s) * shaft->longest;
    const float slack1 = rounding * size2, slack2 = rounding * size1;
    const float edge_on = 1e-5f * size1 * size2 * shaft->longest * per_height;
    triangle->a = linear(n, turn, 0.0f, per_height);
    triangle->w1 = linear(u, turn, slack1, -2.0f * (slack1 + slack2));
    triangle->w2 = linear(v, turn, slack2, edge_on);
    const float4 w0 = triangle->a - triangle->w1 - triangle->w2;
#if CULL_BACK // a shadow ray runs towards its light, away from where it is cast here; against its axis all is mirrored
    const int wanted = (any ? -height : height) * shaft->sign > 0.0f;
#else
    const int wanted = height != 0.0f;
#endif
    return used & wanted & (most_along(shaft, triangle->w1) >= 0.0f) & (most_along(shaft, triangle->w2) >= 0.0f) &
           (most_along(shaft, w0) >= triangle->w1.w) &
           (most_along(shaft, triangle->a) * per_height * 1.00001f > fmax(worst, edge_on));
}

INLINED float at_slopes(float4 function, float x, float y) {
    return MULTIPLY_ADD(function.x, x, MULTIPLY_ADD(function.y, y, function.z));
}

// Whether a ray hits, nearer than 1/z = nearest and not nearer than ceiling, and where.
INLINED int meets(const Candidate *triangle, float x, float y, float nearest, float ceiling, const int any,
                  float *per_depth) {
    const float a = at_slopes(triangle->a, x, y);
    const float w1 = at_slopes(triangle->w1, x, y), w2 = at_slopes(triangle->w2, x, y);
    const float s = a * triangle->a.w;
    *per_depth = s;
    return (fmin(w1, w2) >= 0.0f) & (a - w1 - w2 >= triangle->w1.w) & (s > fmax(nearest, triangle->w2.w)) &
           (any || s < ceiling);
}

INLINED void store_candidate(Candidate triangle, __local float4 *at) {
    at[0] = triangle.a;
    at[1] = triangle.w1;
    at[2] = triangle.w2;
}

INLINED Candidate load_candidate(const __local float4 *at) {
    Candidate triangle;
    triangle.a = at[0];
    triangle.w1 = at[1];
    triangle.w2 = at[2];
    return triangle;
}
